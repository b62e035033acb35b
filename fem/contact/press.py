"""Press a pad on an object along a load path, each normal force started from the one before, or from a coarser mesh.

A force that Newton's method does not reach in one step is approached by step halving, then by displacement control
until the force is bracketed. Where that fails and fallback pads with other gaps are given, the load path continues with
the first that leads on, from first contact: nodal gaps let a small object slip between the nodes, so that the force
stays low. A pad with other gaps leaves its path to one with nodal gaps sooner, before displacement control and where it
jumps: they couple neighbouring pressures, and a pad's rim on a steep slope can fold or make their active set cycle for
ever. Every state that is passed on has converged and has been checked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.contact.checks import NEAR, Checks, check, explained, refuse_fall
from softjaw.fem.contact.load_stepping import (
    ASTRAY,
    STRAY,
    Following,
    LoadPath,
    Settings,
    State,
    Stepping,
    Work,
    at_once,
)
from softjaw.fem.contact.problem import ContactPoints, ContactProblem, Control, Gap, SpringBed
from softjaw.fem.errors import CheckError, ConvergenceError, NotReachedError, SpentError
from softjaw.fem.pad.foam import Foam
from softjaw.fem.pad.interpolation import interpolated
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.petsc import NonlinearSolver, Seconds

FloatArray = NDArray[np.float64]
# Of Newton's method for one force; half of them where other gaps can take over, all for the next. Usual: 4 to 15.
MOST_ITERATIONS = 300
LONGEST_CLOSING, SHORTEST_CLOSING = 0.05, 1 / 64  # step to a given closing, of the thickness; of it, the shortest
AGREE = 0.1  # of the closing displacement: the other pad's path is not the same one where they differ by more


@dataclass(frozen=True)
class Pressed:
    """A pad in equilibrium on the object at one normal force.

    Parameters
    ----------
    force, closing displacement : float
        Normal force [N] and closing displacement of the backing plate from first touch [m].
    unknowns : (n,) array
        State of the solver.
    pad : Pad
        The pad it was solved with: the fallback where the pad itself had no solution.
    pressure : (contact nodes,) array
        Nominal contact pressure, in the order of ``Pad.contact_nodes`` [Pa].
    contact_face : (contact nodes, 3) array
        Deformed nodes of the contact face, in the pad's frame at first touch [m].
    points : ContactPoints
        Position, normal and load of the quadrature points of the meshed contact face.
    path_dependent : bool
        Whether the pad has jumped before: another load path may lead to another state.
    instead : bool
        Whether the fallback pad was taken.
    notes : tuple of str
        Which means beside Newton's method on steps of the force it took.
    history : tuple of (n,) arrays
        States before it that it depends on; none without friction.
    """

    force: float
    closing: float
    unknowns: FloatArray
    pad: Pad
    pressure: FloatArray
    contact_face: FloatArray
    points: ContactPoints
    checks: Checks
    iterations: int
    steps: int
    halvings: int
    seconds: Seconds
    path_dependent: bool = False
    instead: bool = False
    notes: tuple[str, ...] = ()
    history: tuple[FloatArray, ...] = ()


def pressed(
    foam: Foam, x: FloatArray, state: tuple[FloatArray, FloatArray, ContactPoints], left_over: float, force: float,
    settings: Settings, work: Work, seconds: Seconds, path_dependent: bool = False, instead: bool = False,
    notes: tuple[str, ...] = (), slack: float = 0.0, history: tuple[FloatArray, ...] = (),
) -> Pressed:  # fmt: skip
    """State of one pad that has passed its checks; parameters as in ``fem.contact.checks.check``."""
    pad, (pressure, _, points) = foam.pad, state
    checks = check(foam, x, state, left_over, force, settings.residual, slack)
    contact_face = (pad.nodes + pad.displacement(x))[pad.contact_nodes]
    return Pressed(
        force, float(x[pad.closing_dof]), x, pad, pressure, contact_face, points, checks, work.iterations, work.steps,
        work.halvings, seconds, path_dependent, instead, notes, history,
    )  # fmt: skip


@dataclass
class Press(LoadPath):
    """One pad against one object; ``gap`` takes points of the pad's frame, the pad at first touch.

    Parameters
    ----------
    pad : Pad
    gap : callable
        ``(n, 3)`` points to signed distance, gradient and Hessian.
    options : dict
        PETSc options with the prefix ``contact_``.
    fallbacks : sequence of Pad
        The same pad with other gaps, the best first, for forces at which ``pad`` has no solution.
    settings : Settings
    problem_of : callable
        Pad and gap to the problem.
    load_steps : callable
        From one force [N] (0: no contact yet) to the next: the forces to go through, the last of them the next.
    stepping : type
        How to get from one of them to the next: along the path of equilibria, or in one step where Newton's method can.
    """

    pad: Pad
    gap: Gap
    options: dict[str, Any] = field(default_factory=dict)
    fallbacks: Sequence[Pad] = ()
    settings: Settings = field(default_factory=Settings)
    problem_of: Callable[[Pad, Gap], ContactProblem] = ContactProblem
    load_steps: Callable[[float, float], Sequence[float]] = at_once
    stepping: type[Stepping] = Following

    def __post_init__(self) -> None:
        """Set up the solver."""
        self._wanted, self._left, self._last = self.pad, tuple(self.fallbacks), (np.zeros(self.pad.size), 0.0)
        super().__post_init__()

    @property
    def _leads(self) -> bool:
        """Whether displacement control may take over, and jumps are passed, with the pad at hand."""
        return not self._left or self.pad.contact == "nodal"

    def _set_up(self) -> None:
        self._bed = SpringBed(self.pad, self.gap)
        self.problem = self.problem_of(self.pad, self.gap)
        self.solver = NonlinearSolver(self.problem, self.options)
        self._stepping = self._steps()

    def _steps(self) -> Stepping:
        """Steps of the problem as it is now, of which none has been made."""
        thickness = self.pad.shape.size[2]
        return self.stepping(
            self.problem, self.solver, self.settings, thickness, self.pad.share, self._bed.guess,
            self._bed.force_scale, self.pad.rounding, watch=self._remember, near=self._keeps_laws, deepest=thickness,
        )  # fmt: skip

    def _keeps_laws(self, x: FloatArray) -> bool:
        """Whether an iterate that no solve has ended at keeps all laws of contact to `NEAR`."""
        # vinewtonrsls has another residual, which says nothing of pressures at their bounds
        if self.problem.complementarity or not np.isfinite(left_over := self._left_over(x)):
            return False
        force, state = self.problem.normal_force(x), self.problem.contact_state(x)
        if not force > 0.0:
            return False
        try:
            check(self.problem.foam, x, state, left_over, force, self.settings.residual, NEAR)
        except CheckError:
            return False
        return True

    def _left_over(self, x: FloatArray) -> float:
        """Largest force out of balance at a node, of the whole pad [N]."""
        # rows of displacements and closing alone; those of pressures are judged as gap and adhesion
        return float(np.abs(self.problem.residual(x)[: self.pad.closing_dof + 1]).max() / self.pad.share)

    def _remember(self, x: FloatArray, force: float) -> None:
        """Keep the state of the largest force in equilibrium, which shows why there is none beyond."""
        if force >= self._last[1]:
            self._last = x, force
        self.problem.accept(x)

    def load_path(self, forces: Sequence[float]) -> Iterator[Pressed]:
        """Equilibrium states at ascending normal forces on the whole pad [N].

        Raises
        ------
        ConvergenceError, CheckError
            At the first force without an acceptable state.
        """
        x, reached = None, 0.0
        for force in forces:
            work, elapsed, below = Work(), self._stopwatch(), x
            self.solver.left = MOST_ITERATIONS
            x = self._within_budget(x, reached, force, work)
            self._refuse_fall(below, reached, x, force)
            reached = force
            yield self._pressed(x, force, work, elapsed())

    def at(self, force: float, coarse: Sequence[Pressed]) -> Pressed:
        """State at one normal force on the whole pad [N], whatever else this press has solved.

        ``coarse`` are states of a coarser mesh, the nearest first, none above this force. From each one Newton solve is
        tried; from the first that leads to a state on the load path the force is approached, if it is lower. Where none
        does, or the coarser mesh has jumped before, the force is approached from first contact.

        Raises
        ------
        ConvergenceError, CheckError
            If there is no acceptable state.
        """
        work, elapsed = Work(), self._stopwatch()
        self._begin_afresh()
        x, reached = self._near(coarse, lambda start: self._from(start, work)) or (None, 0.0)
        if x is None or reached < force:
            below, x = x, self._within_budget(x, reached, force, work)
            self._refuse_fall(below, reached, x, force)
        return self._pressed(x, force, work, elapsed())

    def at_closing(self, closing: float) -> Pressed:
        """State at a closing displacement of the backing plate [m], by steps from first contact.

        Raises
        ------
        ConvergenceError, CheckError
            If no pad, the fallbacks included, has an acceptable state.
        """
        work, elapsed = Work(), self._stopwatch()
        self._begin_afresh()
        failed: ConvergenceError | CheckError | None = None
        for pad in (self._wanted, *self.fallbacks):
            if pad is not self.pad:
                self.pad = pad
                self._start_again()
            try:
                self.solver.left = MOST_ITERATIONS
                x = self._close_to(closing, work)
                return self._pressed(x, self.problem.normal_force(x), work, elapsed())
            except (ConvergenceError, CheckError) as error:
                failed = failed or error
        assert failed is not None
        raise failed

    def _close_to(self, closing: float, work: Work) -> FloatArray:
        """State at a closing displacement [m], each step started on the secant of the two before."""
        longest = LONGEST_CLOSING * self.pad.shape.size[2]
        step, here, before = min(longest, closing), 0.0, None
        x = None
        while here < closing:
            ahead = closing if closing - here <= 1.001 * step else here + step
            guess = self._bed.guess(ahead) if x is None else x
            if x is not None and before is not None:
                guess = x + (ahead - here) / (here - before[1]) * (x - before[0])
            try:
                found = self._stepping.solve(guess, Control(closing=ahead), work)
            except ConvergenceError:
                step *= 0.5
                if step < SHORTEST_CLOSING * longest:
                    raise
                continue
            before = None if x is None else (x, here)
            x, here, step = found, ahead, min(1.5 * step, longest)
        assert x is not None
        return x

    def _from(self, start: Pressed, work: Work) -> State:
        """State at the force of a coarser mesh's, with the load path that led there, checked."""
        self.problem.forget()
        for before in start.history:
            self.problem.accept(interpolated(start.pad, before, self.pad))
        near = interpolated(start.pad, start.unknowns, self.pad)
        x = self._stepping.from_near(near, start.force, work)
        if np.abs((x - near)[: self.pad.closing_dof + 1]).max() > STRAY * self.pad.shape.size[2]:
            work.halvings += 1
            raise ConvergenceError(ASTRAY.format(force=start.force))
        self._pressed(x, start.force, work, Seconds())
        return x, start.force

    def _begin_afresh(self) -> None:
        """Forget what was solved before, so that not a bit of what follows depends on it."""
        self._last, self._left = (np.zeros(self._wanted.size), 0.0), tuple(self.fallbacks)
        if self.pad is self._wanted:
            self.solver.forget()
            self._stepping = self._steps()
        else:
            self.pad = self._wanted
            self._start_again()
        self.solver.left = MOST_ITERATIONS

    def _refuse_fall(self, below: FloatArray | None, reached: float, x: FloatArray, force: float) -> None:
        """Refuse a state ``x`` that more force has not led to from the one ``below``, if there is one."""
        # the solver cannot see this: both states are in equilibrium and may pass their own checks
        if below is not None:
            refuse_fall((reached, self.problem.closing(below)), (force, self.problem.closing(x)))

    def _within_budget(self, x: FloatArray | None, reached: float, force: float, work: Work) -> FloatArray:
        """As `_next`; what it needed in vain is told."""
        self._stepping.closed = False
        try:
            return self._next(x, reached, force, work)
        except SpentError as error:
            spent = f"given up after {MOST_ITERATIONS} Newton iterations"
            text = f"stuck at {self._last[1]:.4g} N of {force:.4g} N: {spent}"
            raise self._explained(ConvergenceError(text)) from error

    def _pressed(self, x: FloatArray, force: float, work: Work, seconds: Seconds) -> Pressed:
        """The state ``x``, checked."""
        steps, state = self._stepping, self.problem.contact_state(x)
        return pressed(
            self.problem.foam, x.copy(), state, self._left_over(x), force, self.settings, work, seconds,
            steps.jumped, self.pad is not self._wanted, self._notes(), NEAR if steps.off else 0.0,
            self.problem.history(x),
        )  # fmt: skip

    def _notes(self) -> tuple[str, ...]:
        """Which means beside Newton's method on steps of the force the last state took."""
        steps, notes = self._stepping, []
        if self.pad is not self._wanted:
            notes.append(f"solved with {self.pad.contact} gaps, {self._wanted.contact} ones did not converge")
        if steps.closed:
            notes.append("reached by displacement control")
        if steps.off:
            notes.append(f"the active set alternates, accepted at a residual of {steps.off:.1e} of the force")
        return tuple(notes)

    def _explained(self, error: ConvergenceError) -> ConvergenceError:
        """The error, or one that names the foam's state in the last equilibrium where that is the reason."""
        return explained(error, self.problem.foam, *self._last)

    def _next(self, x: FloatArray | None, reached: float, force: float, work: Work) -> FloatArray:
        """State at ``force`` from the one at ``reached`` [N]."""
        if not self._left:
            return self._step_to(x, reached, force, work)
        # where these gaps do not lead on soon, the others are given the time
        self.solver.left = MOST_ITERATIONS // 2
        try:
            return self._step_to(x, reached, force, work)
        except (ConvergenceError, SpentError) as error:
            below = None if x is None else (reached, self.problem.closing(x))
            # the path of one pad does not lead to states of the other, so it starts afresh
            return self._from_first_contact(below, force, work, error)

    def _from_first_contact(
        self, below: tuple[float, float] | None, force: float, work: Work, failed: Exception
    ) -> FloatArray:
        """State at ``force`` of a fallback, else of the pad itself beyond a jump, from first contact on.

        All forces that follow keep to the pad that was found to serve. ``below`` are force [N] and closing displacement
        [m] of the last state, which the path has to meet, or it is another one.
        """
        # no fallback from here on, so that displacement control may take over and jumps are passed
        pads = self._left if self._leads else (*self._left, self.pad)
        self._left, errors = (), list[Exception]()
        self.solver.left = MOST_ITERATIONS
        for pad in pads:
            self.pad = pad
            self._start_again()
            try:
                return self._through(below, force, work)
            except (ConvergenceError, SpentError) as error:
                errors.append(error)
            # as much as a pad with a fallback has, or a force without a state would take for ever
            self.solver.left = max(self.solver.left, MOST_ITERATIONS // 2)
        # a limit that was seen is the reason; else what stopped the first that knows of one
        if not (known := [error for error in errors if isinstance(error, ConvergenceError)]):
            raise errors[0]
        limits = [error for error in (failed, *known) if isinstance(error, NotReachedError)]
        tried = " nor ".join(dict.fromkeys(pad.contact for pad in (self._wanted, *pads)))
        text = f"{(limits or known)[0]}; neither {tried} gaps lead further, a finer mesh was not tried"
        raise (NotReachedError if limits else ConvergenceError)(text) from known[0]

    def _through(self, below: tuple[float, float] | None, force: float, work: Work) -> FloatArray:
        """State at ``force`` [N] from first contact on, through the force of the state ``below``."""
        if below is None:
            return self._step_to(None, 0.0, force, work)
        reached, closing = below
        x = self._step_to(None, 0.0, reached, work)
        differs = abs(self.problem.closing(x) - closing) > AGREE * closing
        x = self._step_to(x, reached, force, work)
        self._stepping.jumped |= differs
        return x

    def _step_to(self, x: FloatArray | None, reached: float, force: float, work: Work) -> FloatArray:
        """State at ``force`` from the one at ``reached`` [N], or from scratch."""
        steps = self.load_steps(reached, force)
        if x is None:
            self.problem.forget()
            x, reached = self._stepping.first(self._bed.closing(steps[0]), steps[0], work)
        # friction is measured from this state, and a failure on the way is explained by it
        self._remember(x, reached)
        try:
            # the first contact may bear more than the first steps ask for
            for goal in (f for f in steps if f > reached or f == force):
                x, reached = self._stepping.step_to(x, reached, goal, work, by_displacement=self._leads), goal
            return x
        except ConvergenceError as error:
            raise self._explained(error) from error
