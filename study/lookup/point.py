"""What a map says at one point, or at many at once: values with errors, the limit surfaces of both fingers, reasons."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.friction.patch import NEGLIGIBLE
from softjaw.lsfit.surface import LimitSurface
from softjaw.study.case.result import GraspNumbers
from softjaw.study.flags import flags_in
from softjaw.study.quantities import BOTH_ENDS, BY_KEY, FAILED, FORCE_RANGE, MAIN, MISSING
from softjaw.study.quantities import STATES as OF_CASES
from softjaw.study.ranking import outside
from softjaw.study.result.interpolation import BESIDE_CASES, Corners, FloatArray
from softjaw.study.units import shown_text

INSIDE, OUTSIDE, NO_RESULT, SNAP, JUMP = range(5)


@dataclass(frozen=True, eq=False, repr=False)
class GraspPoint(GraspNumbers):
    """A map at points of this ``shape``; numbers for one point, arrays for many. Made by ``GraspMap.at``.

    Where a point is not inside, values are NaN and `reason` says why.
    """

    map: Any  # the `GraspMap` that it is a point of
    shape: tuple[int, ...]
    place: FloatArray  # (m, 3) station [m], angle [rad], force [N] as asked for
    corners: Corners
    states: np.ndarray  # (m,)
    marks: int = 0  # flags of the grasp that no case has: what the hand does not reach

    @property
    def station(self) -> Any:
        """Station [m]; of explicit poses the number of the candidate."""
        return self._shaped(self.place[:, 0])

    @property
    def angle(self) -> Any:
        """Angle [rad]."""
        return self._shaped(self.place[:, 1])

    @property
    def force(self) -> Any:
        """Normal force per finger [N]."""
        return self._shaped(self.place[:, 2])

    @property
    def state(self) -> Any:
        """Where the point is: 0 inside, 1 outside the map, 2 beside a case without result, 3 and 4 across a jump."""
        return self._shaped(self.states)

    @property
    def ok(self) -> Any:
        """Whether there are values."""
        return self._shaped(self.states == INSIDE)

    @property
    def nearest(self) -> GraspPoint:
        """The solved cases that weigh most around the points; where there is none, the points themselves."""
        at, axes = self.corners, self.map.axes
        weight = np.where(self.map.done.ravel()[at.index], at.weight, 0.0)
        node = np.take_along_axis(at.index, weight.argmax(axis=1)[:, None], axis=1)[:, 0]
        cell = np.unravel_index(at.index[:, 0], self.map.shape)
        moved = self.place.copy()
        for a, i in enumerate(np.unravel_index(node, self.map.shape)):
            x = axes[a].x
            # By the difference: an angle keeps its turns, which tell whether the fingers are exchanged.
            moved[:, a] += x[i] - (x[cell[a]] + at.share[:, a] * (x[cell[a] + 1] - x[cell[a]]))
        moved = np.where((weight.any(axis=1) & (self.states != OUTSIDE))[:, None], moved, self.place)
        parts = moved.reshape(*self.shape, 3)
        return self.map.point(parts[..., 0], parts[..., 1], parts[..., 2])

    @property
    def reason(self) -> Any:
        """Why there is no value, in a sentence; empty where there is one."""
        return self._shaped(np.array([self._reason(i) for i in range(len(self.states))], object))

    def value(self, name: str, model: str = "ccm") -> Any:
        """A quantity of the grasp, in SI units; NaN where there is none."""
        if name == "flags":  # bits have no mean
            return self.flags
        return self._shaped(np.where(self.states == INSIDE, self.map.interpolated(name, model, self.corners), np.nan))

    def error(self, name: str, model: str = "ccm") -> Any:
        """Stated error of `value`, of the cases around and of the interpolation, in the quantity's unit.

        NaN where there is no value, and for what no file states an error of. See `study.lookup.GraspMap`.
        """
        errors, values = (of(name, model, self.corners) for of in (self.map.errors, self.map.interpolated))
        # what meshes leave in a contact they leave in the quality of surfaces that are fitted to it, too
        q = BY_KEY.get(f"maps/{name.removesuffix('_fitted')}")
        stated = q.of_error.name if q is not None and q.error else f"{name}_error"
        if self.map.has(stated):
            cases = self.map.interpolated(stated, "ccm", self.corners)
            # one does not know of the other
            errors = np.hypot(BESIDE_CASES * errors, q.error_in_unit(cases, values) if q is not None else cases)
        known = np.isfinite(values) & (q is None or bool(q.error))
        return self._shaped(np.where((self.states == INSIDE) & known, errors, np.nan))

    def fingers(self, name: str, model: str = "ccm") -> FloatArray:
        """A quantity of both fingers ``(..., 2, ...)``: ``f_x_max`` or ``fingers/S``, ``limit_surface/rho``."""
        values = self.map.interpolated(name if "/" in name else f"fingers/{name}", model, self.corners)
        values[self.states != INSIDE] = np.nan
        return values.reshape(self.shape + values.shape[1:])

    @property
    def pose(self) -> tuple[FloatArray, FloatArray]:
        """Rotations ``(..., 2, 3, 3)`` and origins ``(..., 2, 3)`` [m] of both pads at first touch.

        ``x = rotation x_pad + origin`` in the frame of the object's own file; between solved places where the pads of
        the scene meet its object. NaN where there is no value.
        """
        R, x = np.full((len(self.states), 2, 3, 3), np.nan), np.full((len(self.states), 2, 3), np.nan)
        for i in np.flatnonzero(self.states == INSIDE):
            R[i], x[i] = self.map.pose(*self.place[i, :2].tolist())
        return R.reshape(*self.shape, 2, 3, 3), x.reshape(*self.shape, 2, 3)

    @property
    def flags(self) -> Any:
        """Flags of all cases around the point and of its force by the safe ones; 0 where there is no value."""
        flags = np.nan_to_num(self.map.table("flags")[self.corners.index]).astype(int)
        flags = np.bitwise_or.reduce(np.where(self.corners.weight > 0, flags, 0), axis=1)
        factor, high = (
            np.ravel(self.value(name)) if self.map.has(bound) else np.inf
            for name, bound in (("safety_factor", FORCE_RANGE[0]), ("force_high", FORCE_RANGE[1]))
        )
        flags |= outside(self.place[:, 2], factor, high, self.map.safety)
        return self._shaped(np.where(self.states == INSIDE, flags | self.marks, 0))

    def semi_axes(self, model: str = "ccm") -> FloatArray:
        """Largest f_x, f_y, tau_z of each finger ``(..., 2, 3)`` [N, N, N m]: the ellipsoid from three motions."""
        return self.fingers("limit_surface/semi_axes", model) * self.fingers("S")[..., None]

    def limit_surface(self, finger: int, model: str = "ccm", fitted: bool = True) -> LimitSurface:
        """Limit surface of finger 1 or 2 in (f_x, f_y, tau_z) [N, N, N m], with ``support``, ``holds`` and the rest.

        It is the one that the scene's ``[limit_surface]`` asks for, or the ellipsoid from three motions where not
        ``fitted``. Between the cases the coefficients are interpolated: a mean of convex forms is convex. `ValueError`
        where there is no value, of several points, and where not all cases around have a fitted surface.
        """
        # compiled loops, which a look-up does without until a surface is asked for
        from softjaw.study.case.limit_surface import finger_surface

        if self.shape or self.reason:
            raise ValueError("limit surfaces are made one at a time: ask for one point" if self.shape else self.reason)
        return finger_surface(self.fingers, finger, model, fitted)

    def __str__(self) -> str:
        if self.shape:
            return f"{len(self.states)} points, {int((self.states == INSIDE).sum())} of them with values"
        axes, (station, angle, force) = self.map.axes, self.place[0].tolist()
        turn = [] if self.map.by_poses else [f"angle {shown_text(angle, 'rad', 5)}"]
        words = [f"{axes[0].name} {shown_text(station, axes[0].units, 5)}", *turn, f"force {force:.5g} N"]
        lines = [", ".join(words)]
        if self.reason:
            return f"{lines[0]}: {self.reason}"
        for name in (n for n in (*MAIN, *FORCE_RANGE) if self.map.has(n)):
            units, value, error = self.map.quantities[name][0], self.value(name), self.error(name)
            doubt = f"  +- {shown_text(error, units, 2)}" * bool(error > 0)
            lines.append(f"  {name:<14} {shown_text(value, units, 5)}{doubt}")
        lines += [f"  {flag.sentence}" for flag in flags_in(self.flags)]
        return "\n".join(lines)

    __repr__ = __str__

    def _shaped(self, values: np.ndarray) -> Any:
        return values.reshape(self.shape) if self.shape else values.tolist()[0]

    def _reason(self, i: int) -> str:
        state = int(self.states[i])
        if state == OUTSIDE:
            return self._outside(i)
        cases = self._cases(i)
        if state == NO_RESULT:
            bad = next(c for c, n in cases if not self.map.done.ravel()[n])
            state = self.map.status[bad]
            what = "is not solved yet"
            if state != MISSING:
                word = "failed" if state == FAILED else f"is no grasp, {OF_CASES[state]}"
                what = f"{word}: {self.map.data.message.values[bad]}"
            return f"no value: the case beside it at {self.map.case(bad)} {what}"
        if state == SNAP:
            sides = {bool(self.map.snapped.ravel()[n]): self.map.case(c) for c, n in reversed(cases)}
            return f"no value: the wall snaps in between {sides[False]} and {sides[True]}; ask at a case"
        if state == JUMP:
            kind = self.map.kind
            unlike = [cases[0], next(case for case in cases if kind[case[1]] != kind[cases[0][1]])]
            first, other = (f"{self.map.case(c)} ({self._contact(n)})" for c, n in unlike)
            return f"no smooth value: the contact changes between {first} and {other}; take `nearest`, a solved case"
        return ""

    def _contact(self, node: int) -> str:
        """The kind of contact of both fingers at a node, in words."""
        counts = [self.map.table(f"fingers/{name}")[node].astype(int) for name in ("pieces", "holes", "rims")]
        words = []
        for pieces, holes, rims in np.transpose(counts).tolist():
            hole = f", {holes} hole{'s' * (holes > 1)}" if holes else ""
            ends = ", on both ends" if rims & BOTH_ENDS == BOTH_ENDS else ""
            words.append(f"{pieces} piece{'s' * (pieces != 1)}{hole}{ends}")
        return " and ".join(dict.fromkeys(words))

    def _outside(self, i: int) -> str:
        a = int(np.argmin(self.corners.inside[i]))
        nodes, value, axis = self.map.axes[a], self.place[i, a], self.map.file_axes[-3 + a]
        text = f"outside the map: {nodes.name} {shown_text(value, nodes.units, 5)}"
        if self.map.by_poses and a == 0:
            return f"{text}, there are candidates 0 to {len(axis.values) - 1} and nothing between them"
        low, high = (shown_text(v, nodes.units, 5) for v in (axis.values.min(), axis.values.max()))
        wide = bool(np.diff(nodes.x).max() > nodes.most * (1 + NEGLIGIBLE))
        apart = f"; nothing is known between angles more than {shown_text(nodes.most, nodes.units, 3)} apart" * wide
        return f"{text}, solved: {low}" + (f" to {high}" if low != high else " only") + apart

    def _cases(self, i: int) -> list[tuple[tuple[int, ...], int]]:
        """Indices of the cases around a point along the file's axes, with their nodes."""
        nodes = self.corners.index[i][self.corners.weight[i] > 0]
        places = zip(self.map.axes, np.unravel_index(nodes, self.map.shape), strict=True)
        cases = zip(*(x.take[k].tolist() for x, k in places), strict=True)
        return list(zip(cases, nodes.tolist(), strict=True))
