"""Load stepping: from one converged contact state to the next, by force control or by displacement control.

`Stepping` goes there in one step where Newton's method can, or keeps to the path of equilibria of a pad on a rigid
object, so that no force leads off it.

Where a force has several equilibria, Newton's method finds the one that its start leads to. So the start has to be
near: a step of the force is as long as the tangent of the path foretells at most `LONGEST` of closing, and its state
has to lie within `STRAY` of what the tangent foretells, else the step is halved. Both are parts of the pad's
thickness and do not depend on the forces that were asked for. Steps in which the largest strain grows by more than
`FOLD` are halved, too; where it grows while the force hardly does (`FOLDING`, `FOLDS`), the foam folds somewhere.
Foam that is strained further than `STRAINED` may buckle: there a stable state has to lead to a stable one, whose
tangent on the free displacements, the nodes in contact held to the object, is positive definite.

Where even a step of `SHORTEST_FORETOLD` leads from a stable state to an unstable one, the path forks: its states
continue and are taken, but a pad that is disturbed may leave them. Where such a step leaves the path, the pad jumps:
the path ends at a limit or folds. With weighted gaps this is an error, because nodal gaps often know of no jump;
else the state beyond is taken. In both cases ``jumped`` is set: this state and those that follow depend on the load
path.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from softjaw.fem.contact.checks import ALTERNATING, BALANCE
from softjaw.fem.contact.problem import ContactProblem, Control
from softjaw.fem.contact.rigid import RigidProblem
from softjaw.fem.errors import ConvergenceError, NotReachedError, SpentError
from softjaw.fem.petsc import NonlinearSolver
from softjaw.friction.patch import FloatArray

State = tuple[FloatArray, float]  # unknowns and force [N]
RESIDUAL = 1e-10  # of the normal force: where a solve ends
SHORTEST_PART = 1.0 / 8.0  # of the step between two forces, before displacement control
MOST_STEPS = 60  # under displacement control, for one force
SHORTEST = 1.0 / 64.0  # of the longest step under displacement control, where that is bounded
FIRMLY, BARELY = 1e-3, 1e-6  # part of the wanted force that a first state should have, and that it must have
LONGEST = 0.2  # foretold closing displacement of one step
STRAY = 0.1  # distance of a node or the backing plate from where it was foretold; good steps of practice keep to 0.06
SHORTEST_FORETOLD = 0.025  # foretold closing displacement of a step that is not halved again
FOLD = 0.25  # growth of the largest strain in one step; good steps of practice keep to 0.15
FOLDING, FOLDS = 0.1, 3.0  # the same, and over the growth of the force's logarithm, where 0.2 is usual
ASTRAY = "the state at {force:.4g} N differs from the state on the coarser mesh"
STRAINED = 0.5  # largest strain from which on a state is checked for stability


def falls(forces: Sequence[float]) -> bool:
    """Whether a force fell along a load path: by more than the solver's tolerance and rounding leave it open.

    >>> falls([1.0, 2.0, 1.999]), falls([1.0, 2.0, 2.0 - 1e-9, 3.0])
    (True, False)
    """
    f = np.asarray(forces, dtype=float)
    # less than this part of the force is the rounding of a plateau
    return bool((np.diff(f) < -1e-6 * np.abs(f[1:])).any())


@dataclass
class Work:
    """Effort of one force level."""

    iterations: int = 0
    steps: int = 0
    halvings: int = 0


class _Place(NamedTuple):
    """A state on the path: unknowns, force [N], largest strain, stability, and the tangent [m/N], None if unknown."""

    x: FloatArray
    force: float
    strain: float
    stable: bool
    tangent: FloatArray | None


@dataclass
class Stepping:
    """Steps of one problem.

    ``most``: Newton iterations of one step after which a shorter one is tried; else the solver's own limit. ``watch``:
    called with every new state and its force [N]; what it raises ends the load path. ``near``: whether the iterate that
    a failed solve ended at keeps the laws of contact to ``slack`` and may pass. ``deepest``: closing displacement at
    which the backing plate would be in a rigid object [m]. ``followed``: the problem once more where its path of
    equilibria is followed.
    """

    problem: ContactProblem
    solver: NonlinearSolver
    most: int | None = None
    watch: Callable[[FloatArray, float], None] = lambda x, force: None
    near: Callable[[FloatArray, float], bool] = lambda x, slack: False
    deepest: float = np.inf
    followed: RigidProblem | None = None
    jumped: bool = False  # whether a step is known to have left the path of equilibria
    off: float = 0.0  # residual over the force on the meshed part where the last state is near enough only
    closed: bool = False  # whether displacement control was needed
    residual: float = RESIDUAL
    passed: float = ALTERNATING  # slack of a state on the way
    slack: float = ALTERNATING  # of the last one
    _last: _Place | None = None

    def solve(
        self, x: FloatArray, control: Control, work: Work, most: int | None = None, slack: float = ALTERNATING
    ) -> FloatArray:
        """One Newton solve; its tolerance is relative to the force on the meshed part of the pad.

        Where it stalls its end may be off by ``slack``.
        """
        self.problem.control = control
        scale = control.force if control.force is not None else self.problem.force_scale(control.closing)
        scale, floor = scale * self.problem.share, self.problem.rounding
        self.solver.thrifty = floor <= BALANCE * scale  # or states would fail their checks
        work.steps += 1
        self.off = 0.0
        try:
            # a tolerance below what rounding leaves would never be met
            x, iterations = self.solver.solve(x, max(self.residual * scale, floor), most)
            work.iterations += iterations
        except ConvergenceError as error:
            x, self.off = error.end or (x, np.inf)
            self.off /= scale
            # `not <=`: a residual that is not a number is not near
            if not self.off <= slack or not self.near(x, slack):
                work.halvings += 1
                raise
        closing = self.problem.closing(x)
        # in equilibrium, but no pad has come there
        if closing >= self.deepest:
            work.halvings += 1
            raise ConvergenceError(f"the backing plate would be in the object, {1e3 * closing:.4g} mm from first touch")
        return x

    def displacement_control(
        self,
        x: FloatArray,
        force: float,
        work: Work,
        longest: float = np.inf,
        forces: list[float] | None = None,
        shortest: float = SHORTEST,
    ) -> FloatArray:
        """Closing displacement on, at most ``longest`` [m] a step, until the force is bracketed; then solve for it.

        The forces of the steps are appended to ``forces``. Steps are halved down to a part ``shortest`` of the longest,
        or of the first.
        """
        problem, failures, self.closed = self.problem, 0, True
        ended: Exception
        # a failed step is halved and an easy one lengthened, so the first length only has to be safe
        step, low = min(0.02 * self.problem.thickness, longest), (x, problem.normal_force(x))
        peak = low[1], problem.closing(x)
        least = shortest * (longest if np.isfinite(longest) else step)
        for _ in range(MOST_STEPS):
            try:
                target = Control(closing=problem.closing(low[0]) + step)
                ahead = self.solve(low[0], target, work, self.most, slack=self.passed)
                high = (ahead, problem.normal_force(ahead))
                # bracketed: from here on the state is looked for between two that lie on the path
                if high[1] >= force:
                    return self._land(low, high, force, work)
                if high[1] < 0.5 * low[1]:
                    raise ConvergenceError(f"the pad jumps to a state of {high[1]:.4g} N")
                self.watch(*high)
                if forces is not None:
                    forces.append(high[1])
                low, step, peak = high, min(1.5 * step, longest), max(peak, (high[1], problem.closing(high[0])))
            except SpentError as error:
                ended = error
                break
            except ConvergenceError as error:
                step, failures = 0.5 * step, failures + 1
                if step < least or failures > 20:
                    ended = ConvergenceError(f"stuck at {low[1]:.4g} N of {force:.4g} N: {error}")
                    break
        else:
            text = f"the force stays below {force:.4g} N: reached {low[1]:.4g} N after {MOST_STEPS} steps"
            ended = NotReachedError(text)
        if falls([peak[0], low[1]]):
            ended = NotReachedError(
                f"the force stays below {force:.4g} N: it has a maximum of {peak[0]:.4g} N at {1e3 * peak[1]:.4g} mm, "
                f"then {low[1]:.4g} N at {1e3 * problem.closing(low[0]):.4g} mm closing: the pad gives way on this mesh"
            )
        raise ended

    def _land(self, low: State, high: State, force: float, work: Work) -> FloatArray:
        """State at ``force`` between two on the path; Newton's method may jump to one further on, which is refused."""
        # a linear start between two neighbouring states is nearer than either of them
        share = (force - low[1]) / (high[1] - low[1])
        x = self.solve(low[0] + share * (high[0] - low[0]), Control(force=force), work, self.most)
        ends = self.problem.closing(low[0]), self.problem.closing(high[0])
        margin = 1e-3 * (ends[1] - ends[0])  # of rounding and tolerance; a jump goes much further
        if not ends[0] - margin <= self.problem.closing(x) <= ends[1] + margin:
            raise ConvergenceError(f"the state at {force:.4g} N lies beyond the one that was looked for")
        self.watch(x, force)
        return x

    def first(self, closing: float, force: float, work: Work) -> State:
        """First state in contact and its force, by displacement control near ``closing``; force has no start."""
        failure, best = "no force yet", None
        # not further in than where a first contact is certain to be on the path
        closing = min(closing, 0.25 * self.problem.thickness) if self.followed else closing
        # too deep a start does not converge, too shallow a one has no force: look in between
        for _ in range(12):
            try:
                x = self.solve(self.problem.guess(closing), Control(closing=closing), work)
            except ConvergenceError as error:
                if best:
                    return best
                closing, failure = 0.6 * closing, str(error)
                continue
            reached = self.problem.normal_force(x)
            # too little force is a state of a few nodes at the rim, a bad place to start the path from
            if reached > FIRMLY * force:
                return x, reached
            best = (x, reached) if reached > BARELY * force else best
            closing *= 1.5
        if best:
            return best
        raise ConvergenceError(
            f"found no first contact for {force:.4g} N near a closing of {closing * 1e3:.4g} mm; less than an element "
            f"may touch: refine the pad's mesh or move the candidate. Last attempt: {failure}"
        )

    def step_to(
        self, x: FloatArray, reached: float, force: float, work: Work, *, by_displacement: bool = True
    ) -> FloatArray:
        """From the state at ``reached`` [N] to ``force``: at once, by parts, or (``by_displacement``) by closing."""
        state = self._begin(x, reached, work)
        done, cut = 0.0, 1.0
        while done < 1.0:
            # all of a step that nothing is foretold of: NaN compares as false
            allowed = LONGEST / max(LONGEST, self._foretold(state, force - reached))
            goal = min(1.0, done + cut * allowed)
            target = force if goal == 1.0 else reached + goal * (force - reached)
            try:
                slack = self.slack if goal == 1.0 else self.passed
                x = self.solve(self._ahead(state, target), Control(force=target), work, self.most, slack=slack)
            except ConvergenceError:
                cut *= 0.5
                # `not >` instead of `<=`: NaN, where nothing is foretold, has to end the halving
                # foretold closing displacement of a step that is given up where Newton's method does not converge
                if cut < SHORTEST_PART and not self._foretold(state, 0.5 * (target - state.force)) > 0.01:
                    if not by_displacement:
                        raise
                    return self._past_limit(state, force, work)
                continue
            ahead = self._place(x, target, None)
            leaves, forks = self._leaves(state, ahead), state.stable and not ahead.stable
            # a state may have converged and still belong to another branch: it is judged before it is passed on
            if leaves or forks or ahead.strain - state.strain > FOLD:
                # here NaN continues the halving, down to a part of 1/1024
                if cut > 1.0 / 1024.0 and not self._foretold(state, target - state.force) <= SHORTEST_FORETOLD:
                    cut, work.halvings = 0.5 * cut, work.halvings + 1
                    continue
                # the path was left before this force; refused where the caller has something else to try
                if leaves and not by_displacement:
                    raise ConvergenceError(f"the pad jumps at {target:.4g} N")
                self.jumped |= leaves or forks
            self.watch(x, target)
            done, cut = goal, min(1.0, 2.0 * cut) if allowed < 1.0 else cut
            # the tangent costs a triangular solve, and behind the last step nobody asks for it
            state = ahead._replace(tangent=self._tangent(x)) if done < 1.0 else ahead
        self._last = state
        return state.x

    def from_near(self, start: FloatArray, force: float, work: Work) -> FloatArray:
        """State at a force [N] by one Newton solve from ``start``, which has come along the path on another mesh.

        Raises `ConvergenceError`: where there is none near it, or where a path that is followed from first contact need
        not lead to it.
        """
        # Newton iterations from the state of a coarser mesh; good starts take 4 to 8
        x = self.solve(start, Control(force=force), work, self.most or (8 if self.followed else None))
        state = self._place(x, force, None)
        if state.strain - self._strain(start) > FOLD or not state.stable:
            work.halvings += 1
            raise ConvergenceError(ASTRAY.format(force=force))
        self._last = state
        return x

    def _begin(self, x: FloatArray, reached: float, work: Work) -> _Place:
        """Place at ``reached`` [N] on the path of this problem; the state there may be another one's."""
        # the tangent of the path needs factors, and these are at hand only where the last solve ended
        known = self.followed is not None and self.solver.is_at(x)
        if known and self._last is not None and self._last.x is x:
            return self._last._replace(tangent=self._tangent(x))
        if self.followed and not known:
            # another problem's state is not quite this one's: solve here, or go without a tangent if that fails
            with suppress(ConvergenceError):
                x, known = self.solve(x, Control(force=reached), work, self.most), True
        state = self._place(x, reached, self._tangent(x) if known else None)
        self.jumped |= not state.stable
        return state

    def _strain(self, x: FloatArray) -> float:
        """Largest strain; 0 where no path is followed."""
        return self.followed.largest_strain(x) if self.followed else 0.0

    def _place(self, x: FloatArray, force: float, tangent: FloatArray | None) -> _Place:
        strain, stable = self._strain(x), True
        # foam that is strained little does not buckle: the check's factorisation is spared
        if self.followed and not strain <= STRAINED:
            entries, multipliers = self.followed.symmetric_tangent(x)
            # every node in contact has one as a multiplier; any more is a direction of instability
            stable = self.solver.negative_eigenvalues(entries) == multipliers
        return _Place(x, force, strain, stable, tangent)

    def _tangent(self, x: FloatArray) -> FloatArray | None:
        """Tangent of the path at the state at which the last solve ended; None where it is not followed."""
        return self.followed.path_tangent(x, self.solver.answer) if self.followed else None

    def _ahead(self, state: _Place, force: float) -> FloatArray:
        """Start for the state at a force [N], on the tangent of the path as far as it is a state of sound elements."""
        if state.tangent is None or not self.problem.keep(state.x, True):
            return state.x
        # pads get stiffer as the contact spreads: by the root of the force the path is straighter than by the force
        step = -2.0 * state.force * (np.sqrt(force / state.force) - 1.0) * state.tangent
        return state.x - self.problem.shorten(state.x, step) * step

    def _foretold(self, state: _Place, step: float) -> float:
        """Closing displacement over thickness that the tangent foretells for a step [N]; NaN if unknown."""
        if state.tangent is None:
            return np.nan
        return abs(self.problem.closing(state.tangent) * step) / self.problem.thickness

    def _leaves(self, state: _Place, ahead: _Place) -> bool:
        """Whether the state ``ahead`` is not the one that the path leads to from ``state``."""
        if state.tangent is not None:
            # displacements and closing only: the bound is a distance in space, which pressures are not
            assert self.followed is not None
            off = (ahead.x - state.x - (ahead.force - state.force) * state.tangent)[: self.followed.closing_dof + 1]
            if np.abs(off).max() > STRAY * self.problem.thickness:
                return True
        # strain that grows while the force hardly does is a fold of the foam's surface, not a larger contact
        return ahead.strain - state.strain > max(FOLDING, FOLDS * abs(np.log(ahead.force / state.force)))

    def _past_limit(self, state: _Place, force: float, work: Work) -> FloatArray:
        """State at ``force`` by displacement control; the force may fall in between, which it does beyond a limit."""
        if not self.followed:
            return self.displacement_control(state.x, force, work)
        forces = [state.force]
        x = self.displacement_control(state.x, force, work, STRAY * self.problem.thickness, forces)
        self.jumped |= falls(forces)
        return x
