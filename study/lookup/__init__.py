"""Look a grasp map up between its candidates and forces, for planners: values, errors, and why there is none.

Needs neither MPI nor PETSc. The file is read once and closed.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from softjaw.study.case.candidates import option_text, touching_pads
from softjaw.study.flags import Flag
from softjaw.study.lookup.point import INSIDE, JUMP, NO_RESULT, OUTSIDE, SNAP, GraspPoint
from softjaw.study.messages import closest
from softjaw.study.quantities import BY_KEY, DONE, checked_model
from softjaw.study.ranking import judge, ranked, safety_of
from softjaw.study.result.index import one_file
from softjaw.study.result.interpolation import (
    KINDS,
    Corners,
    FloatArray,
    Nodes,
    blend,
    circle,
    contact_kinds,
    corners,
    error,
    force_claims,
    place_claims,
    plain,
)
from softjaw.study.result.read import axes_of, maps_in, scene_of, sweep_point, values_of
from softjaw.study.result.read import open as open_dataset
from softjaw.study.result.store import place_text
from softjaw.study.scene import SceneError
from softjaw.study.units import UNITS, in_si

LAYOUT = ("station", "angle", "normal_force")  # dimensions of every map


class GraspMap:
    """A result file as a function of station [m], angle [rad] and normal force [N].

    Values lie on straight lines between the solved cases around a point, along forces on power laws. A point has no
    value (NaN) outside the map, beside a case that failed or is missing, between a case before and one after the wall
    has snapped in, and between cases whose contacts differ in kind: in pieces, in holes, or in whether a pad bears on
    both of its ends. `GraspPoint.nearest` is the nearest solved case. Angles repeat after the period that the object's
    symmetry gives; half a turn exchanges the fingers.

    Parameters
    ----------
    file : path or xarray.Dataset
        Result file; one that a run is still writing will do. Or what `softjaw.open` gives, or a part of it.
    where : mapping, optional
        The point of a sweep: a value for each swept key, in the scene's words, ``{"object.radius_mm": 20}``.

    Raises
    ------
    study.messages.StudyError
        The file cannot be read.
    ValueError
        ``where`` does not name one point of the sweep.

    Notes
    -----
    The error of a value is that of a straight line through a curve with the largest second derivative that the cases
    around show, with those beside them, added up over the three axes and times 1.75, along angles 5.25, along forces
    (whose power laws are straight lines of logarithms; of the same grasp) 4.55: a claim, below which at least 95 % of
    the true errors of the main maps stay where that was measured. Between angles more than 25 degrees apart there are
    no values: edges that come to bear between them would stay unseen. Errors that the cases around state themselves
    (``accuracy.meshes = 2``; in between as the values are) are added in squares. Along an axis of two values there is
    no second derivative, and half of their difference stands in; along two forces half of how far a power law is from
    constant or from proportional, whatever is nearer. What is narrower than the spacing of the candidates stays unseen.

    Examples
    --------
    >>> grasps = GraspMap("results/smoke.hdf")
    >>> len(grasps.best(2, by="quality", force=2.0)), grasps.quantities["e_n"][0]
    (2, 'm')
    """

    def __init__(self, file: str | Path | xr.Dataset, where: Mapping[str, Any] | None = None) -> None:
        ds = file if isinstance(file, xr.Dataset) else open_dataset(file)
        one_file(ds.attrs["file"])
        if lost := [name for name in LAYOUT if "status" not in ds or name not in ds.status.dims]:
            raise ValueError(f"the dataset has lost {', '.join(lost)}: take parts with lists, as isel({lost[-1]}=[0])")
        self.file_axes = axes_of(ds)
        station, angle, force = self.file_axes[-3:]
        self.index = _sweep_point(self.file_axes[:-3], dict(where or {}))
        self.data = ds.isel(dict(zip(ds.status.dims, self.index, strict=False)), drop=True)
        with suppress(SceneError):  # of another version
            self.data = self.data.assign_attrs(point=sweep_point(ds, self.index))
        self.status = self.data.status.values
        #: unit and definition of everything that `value` knows
        self.quantities = {name: (unit, ds[name].definition) for name, unit in [*maps_in(ds).items(), ("flags", "")]}
        self.by_poses, self.safety = not station.units, np.ravel(safety_of(self.data))
        angles = circle("angle", "rad", angle.values, *((0.0, False) if self.by_poses else turning(ds, self.index)))
        name, most = ("candidate", 0.5) if self.by_poses else ("station", math.inf)
        stations = plain(name, station.units, station.values, most)
        self.axes: tuple[Nodes, Nodes, Nodes] = (stations, angles, plain("force", "N", force.values))
        self.shape = tuple(len(nodes.x) for nodes in self.axes)
        self.done = self._grid(self.status == DONE)
        self.snapped = self.done & (self._grid(self.read("flags")) & Flag.SNAPPED > 0)
        self._tables: dict[tuple[str, str], FloatArray] = {}
        self._claims: dict[tuple[str, str], tuple[FloatArray, bool]] = {}  # and whether those along forces are relative
        self._poses: dict[tuple[float, float], tuple[FloatArray, FloatArray]] = {}
        self.kind = self._kinds()

    def at(
        self, station: ArrayLike | None = None, angle: ArrayLike | None = None, force: ArrayLike | None = None, *,
        station_mm: ArrayLike | None = None, angle_deg: ArrayLike | None = None, candidate: ArrayLike | None = None,
    ) -> GraspPoint:  # fmt: skip
        """A point of the map, or many: arrays are taken together as numpy broadcasts them.

        Parameters
        ----------
        station, angle, force : float or array
            m, rad, N; ``station_mm`` and ``angle_deg`` instead of the first two. The angle may be left out where the
            map has one, or where the object looks the same from every side.
        candidate : int or array of int
            Number of an explicit pose, from 0, instead of station and angle.
        """
        if force is None:
            raise ValueError("force is missing: give the normal force per finger in N")
        if self.by_poses:
            if candidate is None or not (station is angle is station_mm is angle_deg is None):
                raise ValueError("the candidates of this map are explicit poses: give at(candidate=0, force=5)")
            return self.point(candidate, 0.0, force)
        if candidate is not None:
            raise ValueError("the candidates of this map are stations and angles: give at(station, angle, force)")
        along = _one(station, station_mm, "mm", "station")
        angles = self.file_axes[-2].values
        turn = _one(angle, angle_deg, "deg", "angle", angles[0] if len(angles) == 1 or self.axes[1].free else None)
        return self.point(along, turn, force)

    def best(self, n: int = 1, by: str | None = None, force: float | None = None) -> list[GraspPoint]:
        """The first ``n`` solved grasps as ``softjaw show`` ranks them, those that cannot be used last.

        Parameters
        ----------
        n : int
            How many; fewer where fewer are solved.
        by : str, optional
            "payload" (default), "quality", "e_n", "epsilon", or "force": the least that holds the object's mass.
        force : float, optional
            Force [N] at which they are ranked, solved or between two, and which the points have. By default that of
            ``softjaw show``; where the object's mass is known each point then has its own force to use.
        """
        if not isinstance(n, int | np.integer) or n < 1:
            raise ValueError(f"n is {n}: expected a number of grasps from 1 on")
        ds = judge(self.data, force=force, by=by, top=n, lines=False)
        k, (stations, angles, _) = ds.attrs["level"], (axis.values for axis in self.file_axes[-3:])
        forces, each = ds["normal_force"].values, force is None and "force_low" in ds
        low = ds["force_low"].values.ravel() if each else np.full(self.status[..., 0].size, np.nan)
        first = ranked(ds, k, ds.attrs["score"])[:n]
        station, angle = np.unravel_index(first, self.status.shape[:-1])
        use = np.where(np.isnan(low), forces[k], np.maximum(low, forces[0]))[first]
        place = station if self.by_poses else stations[station], angles[angle]
        # where the contact changes between two solved forces, values are known from the higher one on
        use = np.where(self.point(*place, use).ok, use, forces[np.searchsorted(forces, use)])
        marks = ds["flags"].values[..., k].ravel()[first] & Flag.OUT_OF_REACH
        return [replace(self.point(*at), marks=int(mark)) for *at, mark in zip(*place, use, marks, strict=True)]

    def value(
        self, name: str, station: ArrayLike, angle: ArrayLike, force: ArrayLike, model: str = "ccm"
    ) -> FloatArray | float:
        """One quantity at a station [m], angle [rad] and force [N]; NaN where there is none.

        With explicit poses ``station`` is the candidate's number and the angle does not count. Arrays give arrays.
        """
        return self.point(station, angle, force).value(name, model)

    def error(
        self, name: str, station: ArrayLike, angle: ArrayLike, force: ArrayLike, model: str = "ccm"
    ) -> FloatArray | float:
        """Stated error of `value`, in the quantity's unit; see `GraspPoint.error`."""
        return self.point(station, angle, force).error(name, model)

    def table(self, name: str, model: str = "ccm") -> FloatArray:
        """Values of a quantity at the nodes, flat over station, angle (folded) and force; NaN for unsolved cases.

        Per finger where ``name`` is that of a dataset such as ``fingers/f_x_max``: ``(nodes, 2, ...)``.
        """
        key = name, model
        if key not in self._tables:
            grid = self._grid(self.read(name, checked_model(model)))
            if "/" in name:  # of the fingers, which a turn may exchange
                grid = np.where(_like(self.axes[1].swapped[:, None], grid), grid[:, :, :, ::-1], grid)
            grid = np.where(_like(self.done, grid, 0), grid, np.nan)
            self._tables[key] = grid.reshape(-1, *grid.shape[3:])
        return self._tables[key]

    def interpolated(self, name: str, model: str, at: Corners) -> FloatArray:
        """A quantity at many points, whether they can be trusted or not."""
        values = blend(self.table(name, model), at, name)
        return np.where(_like(at.swap, values, 0), values[:, ::-1], values) if "/" in name else values

    def errors(self, name: str, model: str, at: Corners) -> FloatArray:
        """Error of `interpolated` for a quantity of the case, at many points."""
        key = name, model
        if key not in self._claims:
            grid = self.table(name, model).reshape(self.shape)
            along, power = force_claims(grid, self.axes[2], self.snapped)
            claims = np.stack([*place_claims(grid, self.axes[:2], self.snapped), along])
            self._claims[key] = claims.reshape(3, -1), bool(power.all())
        claims, relative = self._claims[key]
        if not relative:
            return error(claims, at, (0, 1, 2))
        share = np.column_stack([at.share[:, :2], at.power])
        of_force = error(claims, replace(at, share=share), (2,))
        return error(claims, at, (0, 1)) + of_force * self.interpolated(name, model, at)

    def states(self, at: Corners) -> np.ndarray:
        """State of many points, as `GraspPoint.state` has it."""
        used, done, snapped = at.weight > 0, self.done.ravel()[at.index], self.snapped.ravel()[at.index]
        across = (used & snapped).any(axis=1) & (used & ~snapped).any(axis=1)
        kind = self.kind[at.index]
        first = np.take_along_axis(kind, used.argmax(axis=1)[:, None], axis=1)
        jump = (used & (kind != first)).any(axis=1)
        kinds = [~at.inside.all(axis=1), (used & ~done).any(axis=1), across, jump]
        return np.select(kinds, [OUTSIDE, NO_RESULT, SNAP, JUMP], INSIDE)

    def point(self, station: ArrayLike, angle: ArrayLike, force: ArrayLike) -> GraspPoint:
        """`at` in SI units, with the candidate's number as station where the map has explicit poses."""
        parts = np.broadcast_arrays(*(np.asarray(v, float) for v in (station, angle, force)))
        flat = np.stack([part.ravel() for part in parts], axis=-1)
        at = corners(self.axes, flat)
        return GraspPoint(self, parts[0].shape, flat, at, self.states(at))

    def pose(self, station: float, angle: float) -> tuple[FloatArray, FloatArray]:
        """Rotations ``(2, 3, 3)`` and origins ``(2, 3)`` [m] of both pads at first touch; see `GraspPoint.pose`."""
        if (station, angle) not in self._poses:
            axes = [axis.values for axis in self.file_axes[-3:-1]]
            place = tuple(int(np.abs(x - value).argmin()) for x, value in zip(axes, (station, angle), strict=True))
            case = (*place, (self.status[place] == DONE).argmax())  # a pose is the same at every force
            solved = [x[i] for x, i in zip(axes, place, strict=True)]
            if self.status[case] == DONE and np.allclose(solved, (station, angle), rtol=1e-9, atol=1e-12):
                pose = self.read("fingers/pose_rotation")[case], self.read("fingers/pose_origin")[case]
            else:
                pose = touching_pads(scene_of(self.data, self.index), station, angle)
            self._poses[station, angle] = pose
        return self._poses[station, angle]

    def read(self, name: str, model: str = "ccm") -> np.ndarray:
        """A map, or a finger's dataset ``(station, angle, force, finger, ...)`` in one friction model."""
        if name in self.quantities:
            return values_of(self.data, name, model)
        if not self.has(name):
            names = [*self.quantities, *filter(self.has, BY_KEY)]
            meant = closest(name, names)
            hint = f"did you mean {meant}?" if meant else f"it has {', '.join(sorted(names))}"
            raise KeyError(f"{name} is not in {self.data.file}; {hint}")
        variable = self.data[BY_KEY[name].variable]
        return (variable.sel(model=model) if "model" in variable.dims else variable).values

    def has(self, name: str) -> bool:
        """Whether the file has such a map or dataset of the fingers."""
        q = BY_KEY.get(name)
        return name in self.quantities or bool(q and "finger" in q.dims and q.variable in self.data)

    def case(self, index: tuple[int, ...]) -> str:
        """A case in words, by its index along station, angle and force."""
        return place_text(self.file_axes, self.data.label.values, (*self.index, *index))

    def _grid(self, values: np.ndarray) -> np.ndarray:
        for axis, nodes in enumerate(self.axes):
            values = np.take(values, nodes.take, axis=axis)
        return values

    def _kinds(self) -> np.ndarray:
        """A number for each kind of contact at the nodes, flat; 0 where a file does not tell."""
        names = KINDS if self.has("fingers/rims") else ()
        kinds = [contact_kinds(name, self.table(f"fingers/{name}")) for name in names]
        rows = np.column_stack([np.zeros(self.done.size, np.int64), *kinds])
        return np.unique(rows, axis=0, return_inverse=True)[1].ravel()


def _one(si: Any, other: Any, unit: str, name: str, default: Any = None) -> Any:
    if (si is None) == (other is None) and not (si is other is None and default is not None):
        raise ValueError(f"{name} is {'given twice' if si is not None else 'missing'}: give it once")
    return default if si is other is None else si if other is None else np.asarray(other, float) * UNITS[unit].size


def _like(mask: np.ndarray, values: np.ndarray, lead: int = 1) -> np.ndarray:
    """A mask with as many axes as the values that it is for; ``lead`` axes of the values come before it."""
    return mask.reshape((1,) * lead + mask.shape + (1,) * (values.ndim - mask.ndim - lead))


def _sweep_point(axes: Any, where: Mapping[str, Any]) -> tuple[int, ...]:
    """Index along the swept axes."""
    index, rest = [], dict(where)
    for axis in axes:
        key, factor = axis.long_name, in_si(axis.long_name, 1.0)
        options: list[Any] = [*axis.options] or [v / factor for v in axis.values.tolist()]
        known = f"{key} = {', '.join(map(_text, options))}"
        if key not in rest and len(options) > 1:
            raise ValueError(f"where is missing {key}: give one of {known}")
        given = rest.pop(key, options[0])
        given = option_text(given) if isinstance(given, list | tuple) else given
        matching = [i for i, option in enumerate(options) if _same(option, given)]
        if not matching:
            raise ValueError(f"where has {key} = {_text(given)}: expected one of {known}; there is no interpolation")
        index.append(matching[0])
    if rest:
        known = ", ".join(axis.long_name for axis in axes) or "nothing: the file has no sweep"
        raise ValueError(f"where has {', '.join(rest)}: expected {known}")
    return tuple(index)


def _same(option: Any, given: Any) -> bool:
    if isinstance(option, str) or isinstance(given, str):
        return option == given
    return math.isclose(option, given, rel_tol=1e-9, abs_tol=1e-12)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def turning(ds: xr.Dataset, index: tuple[int, ...]) -> tuple[float, bool]:
    """Period of the angles [rad], 0 for a body of revolution, and whether a period exchanges the fingers.

    Half a turn of the gripper is the same grasp with the fingers exchanged, if both stand alike (roll 0). A scene that
    this version cannot read has a whole turn as its period. ``index``: of the sweep's point.
    """
    try:
        scene = scene_of(ds, index)
    except SceneError:
        return 2 * math.pi, False
    order, swap = scene.axis_symmetry, abs(math.sin(scene.candidates.roll)) < 1e-9
    if order % 2 and swap:
        return math.pi / order, True
    return (2 * math.pi / order if order else 0.0), False
