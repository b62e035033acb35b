"""What a three-dimensional view shows of a study: object, cells, cases; the same for windows, pages, figures and files.

Positions are in m in the frame of the object's own file unless a unit is named.
"""

from collections.abc import Iterator
from contextlib import suppress
from functools import cached_property
from typing import Any

import numpy as np
import xarray as xr

from softjaw.fem.objects.gap import IN_PLACE, Pose
from softjaw.study.case.build import own_frame
from softjaw.study.lookup import turning
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.pictures import span
from softjaw.study.quantities import ALONG, AROUND, DONE, NUMERIC_MAPS
from softjaw.study.ranking import nearest
from softjaw.study.result.read import axes_of, read_field, read_patch, scene_of
from softjaw.study.scene import SceneError
from softjaw.study.show.best_grasps import value_text
from softjaw.study.show.grasps import Index, candidate_of, field, forces, order, place, quantity, stated, unravelled
from softjaw.study.show.object_surface import Surface, moved, on_wall, surface_of, undeformed
from softjaw.study.show.overview import listed
from softjaw.study.show.stored_surface import body, stored_surface, weaker
from softjaw.study.show.view.pads import Faces, Pad, pads_of

Place = tuple[float | None, float | None]
NEUTRAL, OPEN, CROSSED = "#dfe3e6", "#b6bfc6", "#6d6570"  # no candidate, not computed, failed
PAD, FORCE = "#8a9199", "#00a5bf"
ARROW_MM = 6.0  # the longest arrow of friction
SLIPS = {"x": "a slip along x of the contact", "y": "a slip along y of the contact", "turn": "a turn about its normal"}


class View:
    """A study at one point of its sweep; candidates are counted over stations and angles.

    ``scene`` is the scene there, None where it cannot be read or its mesh has changed; ``note`` says why no object is
    drawn.
    """

    def __init__(self, ds: xr.Dataset, point: Index = ()) -> None:
        self.ds, self.point, self.note = ds, point, ""
        self.scene: Any = None
        with suppress(SceneError):
            self.scene = scene_of(ds, point)
        self._faces: dict[int, xr.Dataset] = {}

    @property
    def candidates(self) -> int:
        """Number of candidates at this point of the sweep."""
        return int(np.prod(self.ds.status.shape[-3:-1]))

    @property
    def walled(self) -> bool:
        """Whether the object has a thin wall."""
        return "wall" in self.ds.attrs["has"] and self.scene is not None

    def index(self, candidate: int, force: int) -> Index:
        """Index over all axes of a candidate at a force level."""
        return (*self.point, *divmod(candidate, self.ds.status.shape[-2]), force)

    def candidate(self, index: Index) -> int:
        """Number of the candidate of a case."""
        return index[-3] * self.ds.status.shape[-2] + index[-2]

    def over_candidates(self, values: np.ndarray, force: int) -> np.ndarray:
        """Values over all axes at this point of the sweep and a force: one for each candidate ``(c,)``."""
        return values[self.point][..., force].ravel()

    def state(self, force: int) -> np.ndarray:
        """State of every candidate at a force ``(c,)``."""
        return self.over_candidates(self.ds.status.values, force)

    def coloured(self, name: str) -> tuple[np.ndarray, list[tuple[float, float]]]:
        """A map in the displayed unit, over all axes, and its smallest and largest value here at every force.

        Grasps are compared at one force: over all forces together their differences would hardly be seen.
        """
        array = field(self.ds, name)
        values = np.full(self.ds.status.shape, np.nan) if array is None else array * quantity(self.ds, name)[2]
        return values, [span(values[self.point][..., k]) for k in range(values.shape[-1])]

    # --- the object ---

    @cached_property
    def placed(self) -> Pose:
        """Where the frame in which the object's axis is z lies in that of its file [m]."""
        try:
            return own_frame(self.scene.object)
        except (AttributeError, ValueError, OSError):  # the object is not drawn either
            return IN_PLACE

    @cached_property
    def surface(self) -> Surface:
        """The object's surface; empty with a `note`."""
        try:
            surface = surface_of(self.scene or scene_of(self.ds, self.point), axes_of(self.ds), self._feet())
        except (ValueError, OSError) as error:
            self.note = f"the object is not drawn: {error}"
            return Surface(np.empty((0, 3)), np.empty((0, 3), int), np.empty(0, int), np.empty(0, int))
        return surface._replace(points=self.placed.to_object(surface.points))

    def _feet(self) -> Iterator[tuple[int, Pose, float]]:
        """Pads of explicit poses at the force that is nearest to the one shown, the best grasp first."""
        first: dict[int, Index] = {}
        levels = sorted(range(len(forces(self.ds))), key=lambda k: abs(k - self.ds.attrs["level"]))
        for i in (i for k in levels for i in order(self.ds, k) if self.ds.attrs["poses"] and i[:-3] == self.point):
            first.setdefault(self.candidate(i), i)
        for candidate, i in first.items():
            stored = (self.ds[f"finger_{name}"].values[i] for name in ("pose_rotation", "pose_origin", "closing"))
            for R, x, closing in zip(*stored, strict=True):
                yield candidate, Pose(self.placed.rotation.T @ R, self.placed.to_pad(x)), closing

    @cached_property
    def wall(self) -> np.ndarray | None:
        """Where the surface's points lie on the wall."""
        return on_wall(self.scene.object, self.placed.to_pad(self.surface.points)) if self.walled else None

    @cached_property
    def _places(self) -> np.ndarray:
        return self.placed.to_pad(read_field(self.ds.attrs["file"], "wall/place", **self._here(self.point)).values)

    def displacement(self, index: Index) -> tuple[np.ndarray, float] | None:
        """Displacement of the wall's places ``(AROUND, ALONG, 3)`` and the angle they begin at, if stored."""
        if not self.walled or not np.isfinite(self._places[index[-3:]]).all():
            return None
        approach = self.ds["finger_pose_rotation"].values[index][0][:, 2] @ self.placed.rotation
        angle = float(np.arctan2(-approach[1], -approach[0])) if np.hypot(*approach[:2]) > 1e-6 else 0.0
        before = undeformed(self.scene.object, angle)
        if before is None:
            return None
        return (self._places[index[-3:]].reshape(AROUND, ALONG, 3) - before) @ self.placed.rotation.T, angle

    def moved(self, index: Index) -> np.ndarray:
        """The surface's points ``(n, 3)``, moved with the wall of a case where the file has it."""
        shift, x = self.displacement(index), self.surface.points
        return x if shift is None or self.wall is None else x + moved(self.wall, *shift)

    # --- a case ---

    def _here(self, index: Index) -> dict[str, int]:
        return {str(axis): i for axis, i in zip(self.ds.status.dims, index, strict=False)}

    def faces(self, index: Index) -> Faces:
        """Stored contact faces of both fingers at a case, by name; empty where there are none."""
        if not self.ds.attrs["patches"]:
            return {}
        if index[-3] not in self._faces:
            self._faces[index[-3]] = read_patch(self.ds.attrs["file"], **self._here(index[:-2]))
        faces = {str(name): v.values[index[-2:]] for name, v in self._faces[index[-3]].data_vars.items()}
        return faces if all(np.isfinite(values).all() for values in faces.values()) else {}

    def pads(self, index: Index) -> list[Pad]:
        """Both pads of a case; empty where it is not solved."""
        return pads_of(self.ds, getattr(self.scene, "gripper", None), index, self.faces(index))

    def limit(self, index: Index) -> np.ndarray | None:
        """Points ``(r, c, 3)`` of the weaker finger's limit surface (CCM) [N, N, N mm]; None where there is none."""
        known = stored_surface(self.ds, index, weaker(self.ds, index), "ccm")
        return None if known is None or known.ellipsoid.rank < 3 else body(known)

    def eye(self, index: Index) -> tuple[np.ndarray, np.ndarray]:
        """Where one sees both pads, finger 1's from behind, and the object upright: direction of the eye, and up."""
        pads = self.pads(index)
        out = -pads[0].approach if pads else np.array([1.0, 0.0, 0.0])
        up = np.array([0.0, 0.0, 1.0])
        if abs(out[2]) > 0.9:  # pads above and below the object
            return np.array([0.8, -0.5, 0.35]), up
        beside = np.cross(up, out)
        return 0.5 * out + 0.8 * beside / np.linalg.norm(beside) + 0.35 * up, up

    def summary(self, index: Index, name: str) -> list[str]:
        """A case in lines: where it is, its main values and the map ``name``, its notes; or why it has none."""
        lines = [f"candidate {candidate_of(self.ds, index)}: {place(self.ds, index, force=True)}"]
        keys = dict.fromkeys((name, "quality", "e_n", "f_x_max", "f_y_max", "tau_z_max", "p_max", "indentation"))
        for key in keys if self.ds.status.values[index] == DONE else ():
            if field(self.ds, key) is not None:
                lines.append(f"{quantity(self.ds, key)[0]}: {value_text(self.ds, key, index, 3, unit=True)}")
        return [*lines, *filter(None, [stated(self.ds, index)])]

    def legend(self, index: Index, motion: str) -> list[str]:
        """What colours and marks of the picture of a case mean."""
        marks = "light grey: no candidate there, or no grasp"
        if self.ds.attrs["poses"]:
            marks = "colours: where the pads of a grasp bear, of the better one where two overlap"
        wall = ["the wall is deformed as computed, not exaggerated"] * (self.displacement(index) is not None)
        return [f"blue: friction of the pads' faces against {SLIPS[motion]}", marks, "dark grey: failed",
                "grey: not computed", *wall, *[self.note] * bool(self.note)]  # fmt: skip


def view_of(ds: xr.Dataset, candidate: int | None, where: Place, force: float | None) -> tuple[View, Index]:
    """The view and the index of the case that was asked for; by default the best at the force that a report shows.

    ``where`` is a station [m] and an angle [rad]; the nearest of the file are taken, as for the force [N].

    Raises `StudyError` for a candidate that the file does not have, or a station far outside of the map.
    """
    k = ds.attrs["level"] if force is None else nearest(forces(ds), force)
    shape = ds.status.shape
    best = next(iter(order(ds, k)), (*(0 for _ in shape[:-1]), k))
    if candidate is not None:
        count = int(np.prod(shape[:-1]))
        if not 0 <= candidate < count:
            raise StudyError(USAGE, f"--candidate: found {candidate}, expected 0 to {count - 1}")
        best = (*unravelled(candidate, shape[:-1]), k)
    elif where != (None, None):
        if ds.attrs["poses"]:
            raise StudyError(USAGE, "--at: this file's candidates are poses; choose with --candidate")
        _check_station(ds, where[0])
        best = _nearest(ds, best, where, k)
    return View(ds, best[:-3]), best


def _check_station(ds: xr.Dataset, station: float | None) -> None:
    """Refuse a station [m] that lies farther off the map than the map's stations lie apart: it has another unit."""
    z = np.sort(ds.station.values)
    if station is not None and max(z[0] - station, station - z[-1]) > max(np.diff(z), default=0.0) + 1e-9:
        known = listed((1e3 * z).tolist(), "mm")
        raise StudyError(USAGE, f"--at: found {1e3 * station:.6g} mm, expected a station of this file: {known}")


def _nearest(ds: xr.Dataset, best: Index, where: Place, k: int) -> Index:
    """The case at this force nearest to a station and an angle; the best one where only one of them is given."""
    station, angle = where
    near: list[int | None] = [None if station is None else nearest(ds.station.values, station), None]
    if angle is not None:
        apart, period = ds.angle.values - angle, turning(ds, best[:-3])[0]  # after which a grasp is the same one
        near[1] = nearest(apart - period * np.round(apart / period) if period else 0.0 * apart, 0.0)
    cases = (i for i in order(ds, k) if i[:-3] == best[:-3])
    fits = (i for i in cases if all(n in (None, m) for n, m in zip(near, i[-3:-1], strict=True)))
    given = tuple(b if n is None else n for n, b in zip(near, best[-3:-1], strict=True))
    return next(fits, (*best[:-3], *given, k))


def maps_of(ds: xr.Dataset) -> list[str]:
    """Names of the maps that have a value; flags are none."""
    return [q.name for q in NUMERIC_MAPS if field(ds, q.name) is not None]


def quantity_of(ds: xr.Dataset, name: str | None) -> str:
    """A map of the study by its name, by default what ranks grasps; `StudyError` if there is none with a value."""
    names = maps_of(ds)
    if name is None or name in names:
        return name or str(ds.attrs["score"])
    raise StudyError(USAGE, f"--quantity: found '{name}', expected one of: {', '.join(names) or 'none is solved'}")
