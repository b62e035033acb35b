"""What a three-dimensional view shows of a result file: object, cells, cases; the same for windows, pages and files."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np

from softjaw.study.flags import flag_words
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.quantities import ALONG, AROUND
from softjaw.study.result.grid_surface import Wall, scene_at, surface_of, undeformed, wall_of
from softjaw.study.result.layout import DONE, FAILED
from softjaw.study.result.vtkhdf import NOBODY, Surface
from softjaw.study.show.data import Data, number
from softjaw.study.show.outline import read_scene
from softjaw.study.show.tables.ranking import nearest

NEUTRAL, OPEN, CROSSED = "#dfe3e6", "#b6bfc6", "#6d6570"  # no candidate, not computed, failed
PAD, FORCE = "#8a9199", "#00a5bf"


class View:
    """A result file at one point of its sweep; candidates are counted over stations and angles."""

    def __init__(self, data: Data, point: tuple[int, ...]) -> None:
        self.data, self.point = data, point
        scene = read_scene(data.ds.attrs["scene"])
        self.scene = None if scene is None else scene_at(scene, point)
        self.gripper = getattr(self.scene, "gripper", None)
        self.note = ""

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
    def surface(self) -> Surface:
        """The object's surface; a point on the border of two candidates' cells is there twice. Empty with a `note`."""
        nothing = Surface(np.empty((0, 3)), np.empty((0, 3), int), np.empty(0, int))
        if self.scene is None:
            self.note = "the object is not drawn: this version cannot read the scene in the file"
            return nothing
        try:
            points, corners, candidate = surface_of(self.scene, self.data.axes)
        except (ValueError, OSError) as error:
            self.note = f"the object is not drawn: {error}"
            return nothing
        pairs = np.column_stack([corners.ravel(), np.repeat(candidate, 3)])
        found, inverse = np.unique(pairs, axis=0, return_inverse=True)
        return Surface(points[found[:, 0]], inverse.reshape(-1, 3), candidate)

    @cached_property
    def owner(self) -> np.ndarray:
        """Candidate of every point of `surface` ``(n,)``, -1 for none."""
        found = np.full(len(self.surface.points), NOBODY)
        found[self.surface.triangles] = self.surface.candidate[:, None]
        return found

    @cached_property
    def marks(self) -> tuple[np.ndarray, np.ndarray]:
        """Where the fingers of explicit poses first touch ``(k, 3)`` [m], and the candidate of each ``(k,)``."""
        origin = self.data.values("fingers/pose_origin") if self.data.by_poses else None
        found, of = [np.empty((0, 3))], []
        for candidate in range(self.candidates if origin is not None else 0):
            known = origin[self.index(candidate, 0)[:-1]]
            solved = np.flatnonzero(np.isfinite(known).all(axis=(1, 2)))
            if solved.size:
                found.append(known[solved[0]])
                of += [candidate] * len(known[solved[0]])
        return np.concatenate(found), np.array(of, int)

    @cached_property
    def wall(self) -> Wall | None:
        """Where the surface's points lie on the wall."""
        return wall_of(self.scene.object, self.surface.points) if self.data.walled and self.scene else None

    def displacement(self, index: tuple[int, ...]) -> tuple[np.ndarray, float] | None:
        """Displacement of the wall's places ``(AROUND, ALONG, 3)`` [m] and the angle they begin at, if stored."""
        rotation = self.data.values("fingers/pose_rotation")
        places = self.data.values("wall/place") if self.data.walled and self.scene else None
        if places is None or rotation is None or not np.isfinite(places[index]).all():
            return None
        approach = rotation[index][0][:, 2]
        angle = float(np.arctan2(-approach[1], -approach[0])) if np.hypot(*approach[:2]) > 1e-6 else 0.0
        before = undeformed(self.scene.object, angle)
        return None if before is None else (places[index].reshape(AROUND, ALONG, 3) - before, angle)

    def moved(self, index: tuple[int, ...]) -> np.ndarray:
        """The surface's points ``(n, 3)`` [m], moved with the wall of a case where the file has it."""
        found = self.displacement(index) if self.wall is not None else None
        x = self.surface.points
        return x if found is None or self.wall is None else x + self.wall.moved(*found)

    def words(self, index: tuple[int, ...], quantity: str) -> list[str]:
        """What there is to say of a case, line by line."""
        data = self.data
        number_ = int(np.ravel_multi_index(index[:-1], data.shape[:-1]))
        lines = [f"candidate {number_}: {data.place(index, force=True)}"]
        if data.status[index] == FAILED:
            return [*lines, f"failed: {data.messages[index] or 'no reason was given'}"]
        if data.status[index] != DONE:
            return [*lines, "not computed yet"]
        names = dict.fromkeys((quantity, "quality", "e_n", "f_x_max", "f_y_max", "tau_z_max", "p_max", "indentation"))
        for name in names:
            if (found := data.map(name)) is not None:
                label, unit, factor = data.units(name)
                lines.append(f"{label}: {number(found[index] * factor)} {unit}".rstrip())
        flags = flag_words(int(data.flags[index]))
        return [*lines, f"flags: {flags}"] if flags else lines


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
