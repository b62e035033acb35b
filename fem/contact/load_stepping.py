"""From one converged contact state to the next: by normal force, by halves of the step, or along the sheet's travel."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.contact.checks import BALANCE
from softjaw.fem.contact.problem import Control
from softjaw.fem.errors import ConvergenceError, NotReachedError
from softjaw.fem.petsc import NonlinearSolver

FloatArray = NDArray[np.float64]
State = tuple[FloatArray, float]  # unknowns and force [N]
WALK_STEPS = 60  # of the sheet, for one force
SHORTEST = 1.0 / 64.0  # of the longest step of a walk, where that is bounded
MOST_FAILURES = 20  # of the steps of one walk
FIRST_TRIES = 12
FALL = 1e-6  # of the force: less is the rounding of a plateau, see `falls`
FIRMLY, BARELY = 1e-3, 1e-6  # part of the wanted force that a first state should have, and that it must have


def falls(forces: Sequence[float]) -> bool:
    """Whether a force fell on the way: by more than the solver's tolerance and rounding leave it open.

    >>> falls([1.0, 2.0, 1.999]), falls([1.0, 2.0, 2.0 - 1e-9, 3.0])
    (True, False)
    """
    f = np.asarray(forces, dtype=float)
    return bool((np.diff(f) < -FALL * np.abs(f[1:])).any())


@dataclass(frozen=True)
class Settings:
    """When a solve ends and when a step is given up.

    ``residual`` is relative to the normal force; ``min_step`` is the shortest part of the step between two forces that
    is tried before another way.
    """

    residual: float = 1e-10
    min_step: float = 1.0 / 8.0


@dataclass
class Work:
    """Effort of one force level."""

    iterations: int = 0
    steps: int = 0
    cuts: int = 0


class Pressing(Protocol):
    """A contact problem that is driven by its sheet."""

    control: Control

    def sheet_force(self, x: FloatArray) -> float:
        """Normal force on the sheet [N]."""

    def travel(self, x: FloatArray) -> float:
        """Travel of the sheet [m]."""


@dataclass
class Stepping:
    """Steps of one problem.

    Parameters
    ----------
    problem : Pressing
    solver : NonlinearSolver
    settings : Settings
    thickness : float
        Of the pad; steps along the travel are parts of it [m].
    share : float
        Part of the pad that is meshed.
    guess : callable
        Travel to a vector of unknowns to start from.
    force_scale : callable
        Travel to the force that a residual there is judged by [N].
    floor : float
        Norm of the residual that rounding leaves [N].
    most : int, optional
        Newton iterations of one step after which a shorter one is tried; else the solver's own limit.
    watch : callable
        Told every new state and its force [N]; what it raises ends the way.
    """

    problem: Pressing
    solver: NonlinearSolver
    settings: Settings
    thickness: float
    share: float
    guess: Callable[[float], FloatArray]
    force_scale: Callable[[float], float]
    floor: float = 0.0
    most: int | None = None
    watch: Callable[[FloatArray, float], None] = lambda x, force: None
    jumped: bool = False  # whether a step is known to have left the path of equilibria

    def solve(self, x: FloatArray, control: Control, work: Work, most: int | None = None) -> FloatArray:
        """One Newton solve; its tolerance is relative to the force on the meshed part of the pad."""
        self.problem.control = control
        scale = control.force if control.force is not None else self.force_scale(control.travel)
        self.solver.thrifty = self.floor <= BALANCE * scale * self.share  # or states would fail their checks
        work.steps += 1
        try:
            x, iterations = self.solver.solve(x, max(self.settings.residual * scale * self.share, self.floor), most)
        except ConvergenceError:
            work.cuts += 1
            raise
        work.iterations += iterations
        return x

    def climb(self, x: FloatArray, reached: float, force: float, work: Work, *, walk: bool = True) -> FloatArray:
        """From the state at ``reached`` [N] to ``force``: in one step, by halves, or (``walk``) along the travel."""
        fraction, done = 1.0, 0.0
        while done < 1.0:
            goal = min(1.0, done + fraction)
            target = force if goal == 1.0 else reached + goal * (force - reached)
            try:
                x = self.solve(x, Control(force=target), work, self.most)
            except ConvergenceError:
                fraction *= 0.5
                if fraction < self.settings.min_step:
                    if not walk:
                        raise
                    return self.walk(x, force, work)
                continue
            self.watch(x, target)
            done = goal
        return x

    def walk(
        self, x: FloatArray, force: float, work: Work, longest: float = np.inf, forces: list[float] | None = None
    ) -> FloatArray:
        """Travel on, at most ``longest`` [m] a step, until the force is bracketed; then solve for it.

        The forces on the way are appended to ``forces``.
        """
        problem, failures = self.problem, 0
        step, low = min(0.02 * self.thickness, longest), (x, problem.sheet_force(x))
        shortest = max(1e-5 * self.thickness, SHORTEST * longest if np.isfinite(longest) else 0.0)
        for _ in range(WALK_STEPS):
            try:
                ahead = self.solve(low[0], Control(travel=problem.travel(low[0]) + step), work, self.most)
                high = (ahead, problem.sheet_force(ahead))
                if high[1] >= force:
                    return self._land(low, high, force, work)
                self.watch(*high)
                if forces is not None:
                    forces.append(high[1])
                low, step = high, min(1.5 * step, longest)
            except ConvergenceError as error:
                step, failures = 0.5 * step, failures + 1
                if step < shortest or failures > MOST_FAILURES:
                    raise ConvergenceError(f"stuck at {low[1]:.4g} N of {force:.4g} N: {error}") from error
        raise NotReachedError(f"the force stays below {force:.4g} N: reached {low[1]:.4g} N after {WALK_STEPS} steps")

    def _land(self, low: State, high: State, force: float, work: Work) -> FloatArray:
        """State at ``force`` between two on the way; Newton's method may jump to one further on, which is refused."""
        share = (force - low[1]) / (high[1] - low[1])
        x = self.solve(low[0] + share * (high[0] - low[0]), Control(force=force), work, self.most)
        ends = self.problem.travel(low[0]), self.problem.travel(high[0])
        margin = 1e-3 * (ends[1] - ends[0])
        if not ends[0] - margin <= self.problem.travel(x) <= ends[1] + margin:
            raise ConvergenceError(f"the state at {force:.4g} N lies beyond the one that was looked for")
        self.watch(x, force)
        return x

    def first(self, travel: float, force: float, work: Work) -> State:
        """First state in contact and its force, by travel control near ``travel``: force control has no start."""
        failure, best = "no force yet", None
        for _ in range(FIRST_TRIES):
            try:
                x = self.solve(self.guess(travel), Control(travel=travel), work)
            except ConvergenceError as error:
                if best:
                    return best
                travel, failure = 0.6 * travel, str(error)
                continue
            reached = self.problem.sheet_force(x)
            if reached > FIRMLY * force:
                return x, reached
            best = (x, reached) if reached > BARELY * force else best
            travel *= 1.5
        if best:
            return best
        raise ConvergenceError(
            f"found no first contact for {force:.4g} N near a travel of {travel * 1e3:.4g} mm; the pad may rest on "
            f"less than an element of its front: refine the pad's mesh or move the candidate. Last attempt: {failure}"
        )
