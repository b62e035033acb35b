"""Press a pad on an object along a ladder of normal forces, each force started from the one before.

A force that Newton does not reach in one step is approached by halves. Where that fails and a fallback pad with nodal
gaps is given, the ladder goes on with that one (weighted gaps couple neighbouring pressures, and a pad's rim on a
steep slope can make their active set cycle for ever); else the sheet is walked by its travel until the force is
bracketed. Every state that is passed on has converged and has been checked.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fem.checks import Checks, check
from fem.contact import ContactPoints, ContactProblem, Control, Gap
from fem.errors import ConvergenceError
from fem.pad import Pad
from fem.petsc import NonlinearSolver, Seconds
from fem.spring_bed import SpringBed

FloatArray = NDArray[np.float64]
WALK_STEPS = 60  # of the sheet, for one force


@dataclass(frozen=True)
class Settings:
    """When a solve ends and when a step is given up.

    ``residual`` is relative to the normal force; ``min_step`` is the shortest part of the step between two forces that
    is tried before another way.
    """

    residual: float = 1e-10
    min_step: float = 1.0 / 8.0


@dataclass(frozen=True)
class Pressed:
    """A pad in equilibrium on the object at one normal force.

    Parameters
    ----------
    force, travel : float
        Normal force [N] and travel of the sheet from first touch [m].
    unknowns : (n,) array
        State of the solver.
    pad : Pad
        The pad it was solved with: the fallback where the pad itself had no solution.
    pressure : (front nodes,) array
        Nominal contact pressure, in the order of ``Pad.front_nodes`` [Pa].
    front : (front nodes, 3) array
        Deformed nodes of the front, in the pad's frame at first touch [m].
    points : ContactPoints
        Position, normal and load of the quadrature points of the meshed front.
    """

    force: float
    travel: float
    unknowns: FloatArray
    pad: Pad
    pressure: FloatArray
    front: FloatArray
    points: ContactPoints
    checks: Checks
    iterations: int
    steps: int
    cuts: int
    seconds: Seconds


@dataclass
class _Work:
    """Effort of one force level."""

    iterations: int = 0
    steps: int = 0
    cuts: int = 0


@dataclass
class Press:
    """One pad against one object; ``gap`` takes points of the pad's frame, the pad at first touch.

    Parameters
    ----------
    pad : Pad
    gap : callable
        ``(n, 3)`` points to signed distance, gradient and Hessian.
    options : dict
        PETSc options with the prefix ``contact_``.
    fallback : Pad, optional
        The same pad with nodal gaps, for forces at which ``pad`` has no solution.
    """

    pad: Pad
    gap: Gap
    options: dict[str, Any] = field(default_factory=dict)
    fallback: Pad | None = None
    settings: Settings = field(default_factory=Settings)

    def __post_init__(self) -> None:
        """Set up the solver of this pad and object."""
        self._set_up()

    def _set_up(self) -> None:
        self._bed = SpringBed(self.pad, self.gap)
        self.problem = ContactProblem(self.pad, self.gap)
        self.solver = NonlinearSolver(self.problem, self.options)

    def ladder(self, forces: Sequence[float]) -> Iterator[Pressed]:
        """Equilibrium states at ascending normal forces on the whole pad [N].

        Raises
        ------
        ConvergenceError, CheckError
            At the first force without an acceptable state.
        """
        x, reached = None, 0.0
        for force in forces:
            work, before, start = _Work(), _copy(self.solver.seconds), time.perf_counter()
            try:
                if x is None:
                    x, reached = self._first(force, work)
                x = self._climb(x, reached, force, work)
            except ConvergenceError:
                if self.fallback is None:
                    raise
                self._fall_back()
                if x is None:
                    x, reached = self._first(force, work)
                x = self._climb(x, reached, force, work)
            reached = force
            checks = check(self.problem, x, force, self.settings.residual)
            spent = self.solver.seconds
            seconds = Seconds(
                spent.assembly - before.assembly,
                spent.factorisation - before.factorisation,
                time.perf_counter() - start,
            )
            front = (self.pad.nodes + self.pad.displacement(x))[self.pad.front_nodes]
            pressure, _, points = self.problem.contact_state(x)
            yield Pressed(
                force, float(x[self.pad.travel_dof]), x.copy(), self.pad, pressure, front, points, checks,
                work.iterations, work.steps, work.cuts, seconds,
            )  # fmt: skip

    def _fall_back(self) -> None:
        """Go on with the fallback pad; its unknowns are numbered alike."""
        seconds = self.solver.seconds
        self.solver.destroy()
        self.pad, self.fallback = self.fallback, None
        self._set_up()
        self.solver.seconds = seconds

    def at_travel(self, travel: float, x: FloatArray | None = None) -> tuple[FloatArray, float]:
        """State at a prescribed travel [m] and the normal force it takes [N], from ``x`` or from scratch."""
        start = self._bed.guess(travel) if x is None else x
        x = self._solve(start, Control(travel=travel), _Work())
        return x, self.problem.sheet_force(x)

    def destroy(self) -> None:
        """Give the factors' memory back."""
        self.solver.destroy()

    # -- stepping ------------------------------------------------------------------------------------------------------

    def _solve(self, x: FloatArray, control: Control, work: _Work) -> FloatArray:
        """One Newton solve; its tolerance is relative to the force on the meshed part of the pad."""
        self.problem.control = control
        scale = control.force if control.force is not None else self._bed.force_scale(control.travel)
        work.steps += 1
        try:
            x, iterations = self.solver.solve(x, self.settings.residual * scale * self.pad.share)
        except ConvergenceError:
            work.cuts += 1
            raise
        work.iterations += iterations
        return x

    def _climb(self, x: FloatArray, reached: float, force: float, work: _Work) -> FloatArray:
        """From the state at ``reached`` [N] to ``force``: in one step, by halves, or along the travel."""
        fraction, done = 1.0, 0.0
        while done < 1.0:
            goal = min(1.0, done + fraction)
            target = force if goal == 1.0 else reached + goal * (force - reached)
            try:
                x = self._solve(x, Control(force=target), work)
            except ConvergenceError:
                fraction *= 0.5
                if fraction < self.settings.min_step:
                    if self.fallback is not None:
                        raise
                    return self._walk(x, force, work)
                continue
            done = goal
        return x

    def _walk(self, x: FloatArray, force: float, work: _Work) -> FloatArray:
        """Travel on until the force is bracketed, then solve for it from the interpolated state."""
        dof = self.pad.travel_dof
        step, low = 0.02 * self.pad.shape.size[2], (x, self.problem.sheet_force(x))
        for _ in range(WALK_STEPS):
            try:
                ahead = self._solve(low[0], Control(travel=low[0][dof] + step), work)
                high = (ahead, self.problem.sheet_force(ahead))
                if high[1] >= force:
                    share = (force - low[1]) / (high[1] - low[1])
                    return self._solve(low[0] + share * (high[0] - low[0]), Control(force=force), work)
                low, step = high, 1.5 * step
            except ConvergenceError as error:
                step *= 0.5
                if step < 1e-5 * self.pad.shape.size[2]:
                    raise ConvergenceError(f"stuck at {low[1]:.4g} N of {force:.4g} N: {error}") from error
        raise ConvergenceError(f"the force stays below {force:.4g} N: reached {low[1]:.4g} N after {WALK_STEPS} steps")

    def _first(self, force: float, work: _Work) -> tuple[FloatArray, float]:
        """First state in contact, by travel control from the bed-of-springs estimate: force control has no start."""
        travel, failure = self._bed.travel(force), "no force yet"
        for _ in range(12):
            try:
                x = self._solve(self._bed.guess(travel), Control(travel=travel), work)
            except ConvergenceError as error:
                travel, failure = 0.6 * travel, str(error)
                continue
            reached = self.problem.sheet_force(x)
            if reached > 1e-3 * force:
                return x, reached
            travel *= 1.5
        raise ConvergenceError(
            f"found no first contact for {force:.4g} N near a travel of {travel * 1e3:.4g} mm; the pad may rest on "
            f"less than an element of its front: refine the pad's mesh or move the candidate. Last attempt: {failure}"
        )


def _copy(seconds: Seconds) -> Seconds:
    return Seconds(seconds.assembly, seconds.factorisation, seconds.total)
