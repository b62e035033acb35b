"""Press a pad on a rigid object along a load path.

A force that Newton's method does not reach in one step is approached by step halving, then by displacement control
until the force is bracketed. Where that fails and fallback pads with other gaps are given, the load path continues with
the first that leads on, from first contact: nodal gaps let a small object slip between the nodes, so that the force
stays low. A pad with other gaps leaves its path to one with nodal gaps sooner, before displacement control and where it
jumps: they couple neighbouring pressures, and a pad's rim on a steep slope can fold or make their active set cycle for
ever.
"""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from softjaw.fem.contact.checks import ALTERNATING, PASSED, check, explained, refuse_fall
from softjaw.fem.contact.load_stepping import RESIDUAL, State, Stepping, Work
from softjaw.fem.contact.path import LoadPath, OnPath, Pressed
from softjaw.fem.contact.problem import Control, Gap
from softjaw.fem.contact.rigid import RigidProblem
from softjaw.fem.errors import CheckError, ConvergenceError, NotReachedError, SpentError
from softjaw.fem.pad.mesh import Pad
from softjaw.friction.patch import FloatArray

LONGEST_CLOSING, SHORTEST_CLOSING = 0.05, 1 / 64  # step to a given closing, of the thickness; of it, the shortest


class Press(LoadPath[RigidProblem]):
    """One pad against one object.

    ``gap``: points ``(n, 3)`` of the pad's frame at first touch to signed distance, gradient and Hessian.
    ``fallbacks``: the same pad with other gaps, the best first, for forces at which ``pad`` has no solution. ``mu``:
    friction coefficient; without it no friction acts back on the pressures. ``options, stride``: as in
    `fem.contact.path.LoadPath`.
    """

    # half of them where other gaps can take over, all for the next; usual: 4 to 15
    MOST_ITERATIONS = 300

    def __init__(
        self, pad: Pad, gap: Gap, options: dict[str, Any] | None = None, fallbacks: Sequence[Pad] = (),
        mu: float | None = None, stride: int = 1,
    ) -> None:  # fmt: skip
        super().__init__([partial(RigidProblem, p, gap, mu) for p in (pad, *fallbacks)], options, stride)

    @property
    def pad(self) -> Pad:
        """The pad at hand."""
        return self.problem.pad

    @property
    def _leads(self) -> bool:
        """Whether displacement control may take over, and jumps are passed, with the pad at hand."""
        return not self._others or self.problem.rule == "nodal"

    def _begin(self) -> None:
        # state of the largest force in equilibrium, which shows why there is none beyond
        self._last = np.zeros(self.problem.size), 0.0

    def _steps(self) -> Stepping:
        problem, rough = self.problem, self.problem.friction is not None
        self.solver.patient = False  # walls jump and settle, pads at edges stall for ever
        # with friction there is no one path of equilibria to keep to; with complementarity factors are those of a part
        # of the tangent, and tell nothing of it
        return Stepping(
            problem, self.solver, watch=self._watch, near=self._keeps_laws, deepest=problem.thickness,
            followed=None if rough or problem.complementarity else problem, passed=PASSED if rough else ALTERNATING,
        )  # fmt: skip

    def _keeps_laws(self, x: FloatArray, slack: float) -> bool:
        """Whether an iterate that no solve has ended at keeps all laws of contact to a part of their scales."""
        # vinewtonrsls has another residual, which says nothing of pressures at their bounds
        if self.problem.complementarity:
            return False
        residual = self.problem.residual(x)[: self.pad.closing_dof + 1]
        if not np.isfinite(residual).all() or not (force := self.problem.normal_force(x)) > 0.0:
            return False
        try:
            imbalance = float(np.abs(residual).max()) / self.pad.share
            check(self.problem.foam, x, self.problem.contact_state(x), imbalance, force, RESIDUAL, slack)
        except CheckError:
            return False
        return True

    def _watch(self, x: FloatArray, force: float) -> None:
        if force >= self._last[1]:
            self._last = x, force
        self.problem.accept(x)

    def at_closing(self, closing: float) -> Pressed:
        """State at a closing displacement of the backing plate [m], by steps from first contact.

        Raises `ConvergenceError`, `CheckError`: if no pad, the fallbacks included, has an acceptable state.
        """
        work = Work()
        self._begin_afresh()
        failures = list[Exception]()
        for problem in (None, *self._fallbacks):
            if problem is not None:
                self._switch(problem())
            try:
                self.solver.iterations_left = self.MOST_ITERATIONS
                x = self._close_to(closing, work)
                return self._pressed(OnPath(x, self.problem.normal_force(x)), work)
            except (ConvergenceError, CheckError) as error:
                failures.append(error)
        raise failures[0]

    def _close_to(self, closing: float, work: Work) -> FloatArray:
        """State at a closing displacement [m], each step started on the secant of the two before."""
        longest = LONGEST_CLOSING * self.problem.thickness
        step, path = min(longest, closing), list[State]()
        while not path or path[-1][1] < closing:
            x, reached = path[-1] if path else (None, 0.0)
            ahead = closing if closing - reached <= 1.001 * step else reached + step
            guess = self.problem.guess(ahead) if x is None else x
            if x is not None and len(path) > 1:
                guess = x + (ahead - reached) / (reached - path[-2][1]) * (x - path[-2][0])
            try:
                path.append((self._stepping.solve(guess, Control(closing=ahead), work), ahead))
            except ConvergenceError:
                step *= 0.5
                if step < SHORTEST_CLOSING * longest:
                    raise
                continue
            step = min(1.5 * step, longest)
        return path[-1][0]

    def _next(self, before: OnPath | None, force: float, work: Work) -> OnPath:
        self._stepping.closed = False
        try:
            x = self._reach(before, force, work)
        except SpentError as error:
            raise explained(self._given_up(self._last[1], force), self.problem.foam, *self._last) from error
        if before is not None:
            # the solver cannot see this: both states are in equilibrium and may pass their own checks
            refuse_fall((before.force, self.problem.closing(before.x)), (force, self.problem.closing(x)))
        return OnPath(x, force, self._stepping.jumped)

    def _reach(self, before: OnPath | None, force: float, work: Work) -> FloatArray:
        """State at ``force``, with other gaps if need be."""
        # where these gaps do not lead on soon, the others are given the time
        if self._others:
            self.solver.iterations_left = self.MOST_ITERATIONS // 2
        try:
            return self._step_to(before, force, work)
        except (ConvergenceError, SpentError) as error:
            if not self._others:
                raise
            # the path of one pad does not lead to states of the other, so it starts afresh
            return self._from_first_contact(before, force, work, error)

    def _from_first_contact(self, below: OnPath | None, force: float, work: Work, failed: Exception) -> FloatArray:
        """State at ``force`` of a fallback, else of the pad itself beyond a jump, from first contact on.

        All forces that follow keep to the pad that serves. ``below`` is the last state, which the path has to meet, or
        it is another one.
        """
        # no fallback from here on, so that displacement control may take over and jumps are passed
        problems = self._others if self._leads else (*self._others, lambda: self._wanted)
        self._others, errors, tried = (), list[Exception](), [self._wanted.rule]
        self.solver.iterations_left = self.MOST_ITERATIONS
        for problem in problems:
            self._switch(problem())
            tried.append(self.problem.rule)
            try:
                return self._through(below, force, work)
            except (ConvergenceError, SpentError) as error:
                errors.append(error)
            # as much as a pad with a fallback has, or a force without a state would take for ever
            self.solver.iterations_left = max(self.solver.iterations_left, self.MOST_ITERATIONS // 2)
        # a limit that was seen is the reason; else what stopped the first that knows of one
        pairs = [*zip((failed, *errors), tried, strict=True)]
        if not (known := [pair for pair in pairs[1:] if isinstance(pair[0], ConvergenceError)]):
            raise errors[0]
        limits = [pair for pair in pairs if isinstance(pair[0], NotReachedError)]
        reason, rule = (limits or known)[0]
        text = f"{reason} (with {rule} gaps; tried with {', '.join(dict.fromkeys(tried))})"
        text += "; more elements may lead further, or a place farther from an edge"
        raise (NotReachedError if limits else ConvergenceError)(text) from known[0][0]

    def _through(self, below: OnPath | None, force: float, work: Work) -> FloatArray:
        """State at ``force`` [N] from first contact on, through the force of the state ``below``."""
        if below is None:
            return self._step_to(None, force, work)
        closing = self.problem.closing(below.x)
        x = self._step_to(None, below.force, work)
        # share of the closing displacement: the other pad's path is not the same one where they differ by more
        differs = abs(self.problem.closing(x) - closing) > 0.1 * closing
        x = self._step_to(OnPath(x, below.force), force, work)
        self._stepping.jumped |= differs
        return x

    def _step_to(self, before: OnPath | None, force: float, work: Work) -> FloatArray:
        """State at ``force`` from the one before, or from scratch."""
        if before is None:
            steps = self._load_steps(0.0, force)
            self.problem.begin()
            x, reached = self._stepping.first(self.problem.closing_of_bed(steps[0]), steps[0], work)
        else:
            (x, reached), steps = (before.x, before.force), self._load_steps(before.force, force)
        # friction is measured from this state, and a failure on the way is explained by it
        self._watch(x, reached)
        try:
            # the first contact may bear more than the first steps ask for
            for goal in (f for f in steps if f > reached or f == force):
                x, reached = self._stepping.step_to(x, reached, goal, work, by_displacement=self._leads), goal
            return x
        except ConvergenceError as error:
            raise explained(error, self.problem.foam, *self._last) from error
