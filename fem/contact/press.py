"""Press a pad on an object along a load path, each normal force started from the one before.

A force that Newton's method does not reach in one step is approached by step halving, then by displacement control
until the force is bracketed. Where that fails and a fallback pad with other gaps is given, the load path continues with
that one, from first contact. A pad with weighted gaps leaves its path to one with nodal gaps sooner, before
displacement control and where it jumps: weighted gaps couple neighbouring pressures, and a pad's rim on a steep slope
can fold or make their active set cycle for ever. Every state that is passed on has converged and has been checked.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.contact.checks import Checks, check, explained, refuse_fall
from softjaw.fem.contact.load_stepping import Following, LoadPath, Settings, Stepping, Work
from softjaw.fem.contact.problem import ContactPoints, ContactProblem, Gap, SpringBed
from softjaw.fem.errors import ConvergenceError
from softjaw.fem.pad.foam import Foam
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.petsc import NonlinearSolver, Seconds

FloatArray = NDArray[np.float64]


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


def pressed(
    foam: Foam, x: FloatArray, state: tuple[FloatArray, FloatArray, ContactPoints], left_over: float, force: float,
    settings: Settings, work: Work, seconds: Seconds, path_dependent: bool = False, instead: bool = False,
) -> Pressed:  # fmt: skip
    """State of one pad that has passed its checks; parameters as in ``fem.contact.checks.check``."""
    pad, (pressure, _, points) = foam.pad, state
    checks = check(foam, x, state, left_over, force, settings.residual)
    contact_face = (pad.nodes + pad.displacement(x))[pad.contact_nodes]
    return Pressed(
        force, float(x[pad.closing_dof]), x, pad, pressure, contact_face, points, checks, work.iterations, work.steps,
        work.halvings, seconds, path_dependent, instead,
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
    fallback : Pad, optional
        The same pad with other gaps, for forces at which ``pad`` has no solution.
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
    fallback: Pad | None = None
    settings: Settings = field(default_factory=Settings)
    problem_of: Callable[[Pad, Gap], ContactProblem] = ContactProblem
    load_steps: Callable[[float, float], Sequence[float]] = lambda reached, force: (force,)
    stepping: type[Stepping] = Following

    def __post_init__(self) -> None:
        """Set up the solver."""
        self._wanted = self.pad
        super().__post_init__()

    @property
    def _leads(self) -> bool:
        """Whether displacement control may take over, and jumps are passed, with the pad at hand."""
        return self.fallback is None or self.pad.contact == "nodal"

    def _set_up(self) -> None:
        self._bed = SpringBed(self.pad, self.gap)
        self.problem = self.problem_of(self.pad, self.gap)
        self.solver = NonlinearSolver(self.problem, self.options)
        self._stepping = self.stepping(
            self.problem, self.solver, self.settings, self.pad.shape.size[2], self.pad.share, self._bed.guess,
            self._bed.force_scale, self.pad.rounding, watch=self._remember,
        )  # fmt: skip

    def _remember(self, x: FloatArray, force: float) -> None:
        """Keep the last state in equilibrium, which shows why there is none beyond."""
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
            try:
                x = self._step_to(x, reached, force, work)
            except ConvergenceError:
                if self.fallback is None:
                    raise
                # the path of one pad does not lead to states of the other, so it starts afresh
                x = self._from_first_contact(self.fallback, force, work)
            # the solver cannot see this: both states are in equilibrium and may pass their own checks
            if below is not None:
                refuse_fall((reached, self.problem.closing(below)), (force, self.problem.closing(x)))
            reached = force
            # rows of displacements and closing alone; those of pressures are judged as gap and adhesion
            left_over = np.abs(self.problem.residual(x)[: self.pad.closing_dof + 1]).max() / self.pad.share
            state = self.problem.contact_state(x)
            yield pressed(
                self.problem.foam, x.copy(), state, left_over, force, self.settings, work, elapsed(),
                self._stepping.jumped, self.pad is not self._wanted,
            )  # fmt: skip

    def _from_first_contact(self, other: Pad, force: float, work: Work) -> FloatArray:
        """State at ``force`` of the other pad, else of one with weighted gaps beyond a jump, from first contact on.

        All forces that follow keep to the pad that was found to serve.
        """
        # no fallback from here on, so that displacement control may take over and jumps are passed
        pads = (other,) if self._leads else (other, self.pad)
        self.fallback, errors = None, []
        for pad in pads:
            self.pad = pad
            self._start_again()
            try:
                return self._step_to(None, 0.0, force, work)
            except ConvergenceError as error:
                errors.append(error)
        # the other pad's: what failed for the pad itself has failed once before
        raise errors[0]

    def _step_to(self, x: FloatArray | None, reached: float, force: float, work: Work) -> FloatArray:
        """State at ``force`` from the one at ``reached`` [N], or from scratch."""
        steps = self.load_steps(reached, force)
        if x is None:
            x, reached = self._stepping.first(self._bed.closing(steps[0]), steps[0], work)
        # friction is measured from this state, and a failure on the way is explained by it
        self._remember(x, reached)
        try:
            # the first contact may bear more than the first steps ask for
            for goal in (f for f in steps if f > reached or f == force):
                x, reached = self._stepping.step_to(x, reached, goal, work, by_displacement=self._leads), goal
            return x
        except ConvergenceError as error:
            raise explained(error, self.problem.foam, *self._last) from error
