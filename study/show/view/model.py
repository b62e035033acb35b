"""What a three-dimensional view shows of a result file: object, cells, cases; the same for windows, pages and files."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from softjaw.study.exits import USAGE, StudyError
from softjaw.study.flags import flag_words
from softjaw.study.result.layout import DONE, FAILED
from softjaw.study.show.data import Data, number
from softjaw.study.show.outline import read_scene, swept_object
from softjaw.study.show.tables.ranking import nearest
from softjaw.study.show.view.surface import NOBODY, Cells, coloured, with_normals
from softjaw.study.show.view.wall import Wall, displacement, wall_of

POSE_MARK = 0.004  # radius of the balls that stand for explicit poses [m]


class View:
    """A result file at one point of its sweep; candidates are counted over stations and angles."""

    def __init__(self, data: Data, point: tuple[int, ...]) -> None:
        self.data, self.point, self.scene = data, point, read_scene(data.result.scene)
        self.note = ""

    @cached_property
    def gripper(self) -> Any:
        """The gripper at this point of the sweep; None where it cannot be told."""
        from softjaw.study.scene.problems import SceneError

        if self.scene is None or any(isinstance(v, str) for values in self.scene.sweep.values() for v in values):
            return getattr(self.scene, "gripper", None)
        values = {key: found[i] for (key, found), i in zip(self.scene.sweep.items(), self.point, strict=False)}
        try:
            return self.scene.with_values(values).gripper
        except SceneError:
            return None

    @property
    def candidates(self) -> int:
        """Number of candidates at this point of the sweep."""
        return self.data.grasps

    def index(self, candidate: int, force: int) -> tuple[int, ...]:
        """Index over all axes of a candidate at a force level."""
        i, j = divmod(candidate, self.data.shape[-2])
        return (*self.point, i, j, force)

    def candidate(self, index: tuple[int, ...]) -> int:
        """Number of the candidate of a case."""
        return index[-3] * self.data.shape[-2] + index[-2]

    def over_candidates(self, values: np.ndarray, force: int) -> np.ndarray:
        """Values over all axes at this point of the sweep and a force: one for each candidate ``(c,)``."""
        return values[self.point][..., force].ravel()

    def state(self, force: int) -> np.ndarray:
        """State of every candidate at a force ``(c,)``."""
        return self.over_candidates(self.data.status, force)

    @cached_property
    def object(self) -> Any:
        """The object of this point of the sweep, as `fem` knows it; None with a note where it cannot be had."""
        from softjaw.study.case.build import build_object

        shape = swept_object(self.scene, (*self.point, 0, 0, 0)) if self.scene else None
        if shape is None:
            self.note = "the object is not drawn: this version cannot read the scene in the file"
            return None
        try:
            return build_object(shape)
        except (ValueError, OSError) as error:
            self.note = f"the object is not drawn: {error}"
            return None

    @cached_property
    def surface(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners ``(m, 3, 6)`` [m] of the object's surface, and the candidate of every triangle, -1 for none."""
        if self.object is None or self.gripper is None:
            return self._marks() if self.data.by_poses else (np.empty((0, 3, 6)), np.empty(0, int))
        points, triangles = self.object.surface()
        if self.data.by_poses:
            corners, cell = self._marks()
            plain = with_normals(points, triangles)
            return np.concatenate([plain, corners]), np.concatenate([np.full(len(plain), NOBODY), cell])
        corners, cell = coloured(points, triangles, self.cells)
        kept = ~self._lid(corners)
        return corners[kept], cell[kept]

    def _lid(self, corners: np.ndarray) -> np.ndarray:
        """Triangles that close the top of an object that is open there: its shape is that of a solid."""
        shape = swept_object(self.scene, (*self.point, 0, 0, 0))
        if not self.data.walled or not getattr(shape, "open_top", False) or shape.shape == "mesh":
            return np.zeros(len(corners), bool)
        wall = wall_of(self.scene, (*self.point, 0, 0, 0), corners[..., :3].reshape(-1, 3))
        if wall is None:
            return np.zeros(len(corners), bool)
        high = corners[..., 2].mean(axis=1) > 0.5 * (corners[..., 2].min() + corners[..., 2].max())
        return np.isnan(wall.around).reshape(-1, 3).any(axis=1) & high

    @cached_property
    def cells(self) -> Cells:
        """The candidates as cells on the surface."""
        length, width = self.gripper.pad_size[:2]
        c, s = abs(np.cos(self.scene.candidates.roll)), abs(np.sin(self.scene.candidates.roll))
        stations, angles = (self.data.axes[k].values for k in (-3, -2))
        return Cells(stations, angles, self.object.axis_symmetry, c * length + s * width, c * width + s * length)

    def _marks(self) -> tuple[np.ndarray, np.ndarray]:
        """Balls where the fingers of explicit poses first touch, for candidates with a solved case."""
        ball = _ball(POSE_MARK)
        origin = self.data.values("fingers/pose_origin")
        found, cell = [np.empty((0, 3, 6))], [np.empty(0, int)]
        for candidate in range(self.candidates if origin is not None else 0):
            known = origin[self.index(candidate, 0)[:-1]]
            solved = np.flatnonzero(np.isfinite(known).all(axis=(1, 2)))
            for place in known[solved[0]] if solved.size else ():
                found.append(ball + np.concatenate([place, np.zeros(3)]))
                cell.append(np.full(len(ball), candidate))
        return np.concatenate(found), np.concatenate(cell)

    @cached_property
    def wall(self) -> Wall | None:
        """Where the surface's corners lie on the wall, in the order of `surface`."""
        if not self.data.walled:
            return None
        return wall_of(self.scene, (*self.point, 0, 0, 0), self.surface[0][..., :3].reshape(-1, 3))

    def displacement(self, index: tuple[int, ...]) -> tuple[np.ndarray, float] | None:
        """Displacement of the wall's places in a case, and the angle they begin at."""
        return displacement(self.data, self.scene, index)

    def moved(self, index: tuple[int, ...]) -> np.ndarray:
        """The surface's corners ``(m, 3, 3)`` [m], moved with the wall of a case where the file has it."""
        x = self.surface[0][..., :3]
        found = self.displacement(index) if self.wall is not None else None
        if found is None or self.wall is None:
            return x
        return x + self.wall.moved(*found).reshape(x.shape)

    def words(self, index: tuple[int, ...], quantity: str) -> list[str]:
        """What is to be said of a case, line by line."""
        data = self.data
        number_ = int(np.ravel_multi_index(index[:-1], data.shape[:-1]))
        lines = [f"candidate {number_}: {data.place(index, force=True)}"]
        if data.status[index] == FAILED:
            return [*lines, f"failed: {data.result.messages[index]}"]
        if data.status[index] != DONE:
            return [*lines, "not solved yet"]
        names = dict.fromkeys((quantity, "quality", "e_n", "f_x_max", "f_y_max", "tau_z_max", "p_max", "dent"))
        for name in names:
            if (found := data.map(name)) is not None:
                label, unit, factor = data.units(name)
                lines.append(f"{label}: {number(found[index] * factor)} {unit}".rstrip())
        flags = flag_words(int(data.flags[index]))
        return [*lines, f"flags: {flags}"] if flags else lines


def _ball(radius: float) -> np.ndarray:
    """Triangles ``(128, 3, 6)`` of a ball about the origin: an octahedron, divided twice."""
    e = np.eye(3)
    x = np.array([[a * e[0], b * e[1], c * e[2]][:: int(a * b * c)] for a in (1, -1) for b in (1, -1) for c in (1, -1)])
    for _ in range(2):
        a, b, c = x[:, 0], x[:, 1], x[:, 2]
        ab, bc, ca = a + b, b + c, c + a
        x = np.concatenate([np.stack(t, axis=1) for t in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))])
        x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.concatenate([radius * x, x], axis=-1)


def view_of(data: Data, candidate: int | None, place: tuple[float | None, float | None], force: float | None) -> Any:
    """The view and the index of the case that was asked for; by default the best at the force that a report shows.

    ``place`` is a station [m] and an angle [rad]; the nearest of the file are taken, as for the force [N].

    Raises
    ------
    StudyError
        For a candidate that the file does not have, or a station far outside of the map.
    """
    k = data.k if force is None else nearest(data.forces, force)
    best = next(iter(data.order(k)), (*(0 for _ in data.shape[:-1]), k))
    if candidate is not None:
        count = int(np.prod(data.shape[:-1]))
        if not 0 <= candidate < count:
            text = f"--candidate: found {candidate}, expected 0 to {count - 1}, counted over stations and angles"
            raise StudyError(USAGE, text)
        best = (*(int(i) for i in np.unravel_index(candidate, data.shape[:-1])), k)
    elif place != (None, None):
        if data.by_poses:
            raise StudyError(
                USAGE, "--station, --angle: the candidates of this file are poses; choose with --candidate"
            )
        _check_station(data, place[0])
        best = _nearest(data, best, place, k)
    return View(data, best[:-3]), best


def _check_station(data: Data, station: float | None) -> None:
    """Refuse a station [m] that lies farther off the map than the map's stations lie apart: it has another unit."""
    places = np.sort(data.axes[-3].values)
    beyond = 0.0 if station is None else max(places[0] - station, station - places[-1])
    if beyond > max(np.diff(places), default=0.0) + 1e-9:
        found, low, high = (f"{1e3 * value:.6g}" for value in (station, places[0], places[-1]))
        expected = f"{low} to {high} mm, the stations of this file" if low != high else f"{low} mm, the only station"
        raise StudyError(USAGE, f"--station: found {found} mm, expected {expected}")


def _nearest(data: Data, best: tuple[int, ...], place: tuple[float | None, float | None], k: int) -> tuple[int, ...]:
    """The case at this force nearest to a station and an angle; the best one where only one of them is given."""
    near = []
    for axis, wanted in zip(data.axes[-3:-1], place, strict=True):
        near.append(None if wanted is None else nearest(axis.values, wanted))
    fits = [
        i
        for i in data.order(k)
        if i[:-3] == best[:-3] and all(n in (None, m) for n, m in zip(near, i[-3:-1], strict=True))
    ]
    given = tuple(b if n is None else n for n, b in zip(near, best[-3:-1], strict=True))
    return fits[0] if fits else (*best[:-3], *given, k)


def quantity_of(data: Data, name: str | None) -> str:
    """A map of the file by its name; by default the one that grasps are ranked by.

    Raises
    ------
    StudyError
        If the file has no such map.
    """
    names = [q.name for q in data.result.layout.quantities if q.group == "maps" and data.map(q.name) is not None]
    if name is None or name in names:
        return name or data.score
    raise StudyError(
        USAGE, f"--quantity: found '{name}', expected one of {', '.join(names) or 'none: nothing is solved'}"
    )
