"""Press a pad on an object along a ladder of normal forces, each force started from the one before.

A force that Newton does not reach in one step is approached by halves. Where that fails, or the pad jumps, and a
fallback pad with nodal gaps is given, the ladder goes on with that one, from first contact (weighted gaps couple
neighbouring pressures, and a pad's rim on a steep slope can fold or make their active set cycle for ever); where that
fails too, or there is none, the sheet is walked by its closing until the force is bracketed. Every state that is passed
on has converged and has been checked.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.contact.checks import Checks, check, explained, refuse_fall
from softjaw.fem.contact.load_stepping import Following, Settings, Stepping, Work
from softjaw.fem.contact.problem import ContactPoints, ContactProblem, Control, Gap, SpringBed
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
        Normal force [N] and closing displacement of the sheet from first touch [m].
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
    path_dependent : bool
        Whether the pad has jumped on the way here: another way may lead to another state.
    """

    force: float
    closing: float
    unknowns: FloatArray
    pad: Pad
    pressure: FloatArray
    front: FloatArray
    points: ContactPoints
    checks: Checks
    iterations: int
    steps: int
    halvings: int
    seconds: Seconds
    path_dependent: bool = False


def pressed(
    foam: Foam, x: FloatArray, state: tuple[FloatArray, FloatArray, ContactPoints], left_over: float, force: float,
    settings: Settings, work: Work, seconds: Seconds, path_dependent: bool = False,
) -> Pressed:  # fmt: skip
    """State of one pad that has passed its checks; parameters as in ``fem.contact.checks.check``."""
    pad, (pressure, _, points) = foam.pad, state
    checks = check(foam, x, state, left_over, force, settings.residual)
    front = (pad.nodes + pad.displacement(x))[pad.front_nodes]
    return Pressed(
        force, float(x[pad.closing_dof]), x, pad, pressure, front, points, checks, work.iterations, work.steps,
        work.halvings, seconds, path_dependent,
    )  # fmt: skip


def since(before: Seconds, now: Seconds, start: float) -> Seconds:
    """Where the time since ``start`` went."""
    total = time.perf_counter() - start
    return Seconds(now.assembly - before.assembly, now.factorisation - before.factorisation, total)


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
    settings : Settings
    problem_of : callable
        Pad and gap to the problem.
    way : callable
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
    way: Callable[[float, float], Sequence[float]] = lambda reached, force: (force,)
    stepping: type[Stepping] = Following

    def __post_init__(self) -> None:
        """Set up the solver of this pad and object."""
        self._set_up()

    def _set_up(self) -> None:
        self._bed = SpringBed(self.pad, self.gap)
        self.problem = self.problem_of(self.pad, self.gap)
        self.solver = NonlinearSolver(self.problem, self.options)
        self._stepping = self.stepping(
            self.problem, self.solver, self.settings, self.pad.shape.size[2], self.pad.share, self._bed.guess,
            self._bed.force_scale, self.pad.rounding, watch=self._remember,
        )  # fmt: skip

    def _remember(self, x: FloatArray, force: float) -> None:
        """Keep the last state in equilibrium, which tells why there is none beyond."""
        self._last = x, force
        self.problem.accept(x)

    def ladder(self, forces: Sequence[float]) -> Iterator[Pressed]:
        """Equilibrium states at ascending normal forces on the whole pad [N].

        Raises
        ------
        ConvergenceError, CheckError
            At the first force without an acceptable state.
        """
        x, reached = None, 0.0
        for force in forces:
            work, before, start, below = Work(), copy(self.solver.seconds), time.perf_counter(), x
            try:
                x = self._climb(x, reached, force, work)
            except ConvergenceError:
                if self.fallback is None:
                    raise
                x = self._other_way(force, work)
            if below is not None:
                refuse_fall((reached, self.problem.closing(below)), (force, self.problem.closing(x)))
            reached = force
            seconds = since(before, self.solver.seconds, start)
            left_over = np.abs(self.problem.residual(x)[: self.pad.closing_dof + 1]).max() / self.pad.share
            state = self.problem.contact_state(x)
            yield pressed(
                self.problem.foam, x.copy(), state, left_over, force, self.settings, work, seconds,
                self._stepping.jumped,
            )  # fmt: skip

    def _other_way(self, force: float, work: Work) -> FloatArray:
        """State at ``force`` of the fallback pad, else of the pad itself beyond a jump; both from first contact on.

        All forces that follow keep to the pad that was found to serve.
        """
        pads, self.fallback, errors = (self.fallback, self.pad), None, []
        for pad in pads:
            self._change(pad)
            try:
                return self._climb(None, 0.0, force, work)
            except ConvergenceError as error:
                errors.append(error)
        raise errors[0]

    def _change(self, pad: Pad) -> None:
        """Go on with another pad."""
        seconds = self.solver.seconds
        self.solver.destroy()
        self.pad = pad
        self._set_up()
        self.solver.seconds = seconds

    def at_closing(self, closing: float, x: FloatArray | None = None) -> tuple[FloatArray, float]:
        """State at a prescribed closing [m] and the normal force it takes [N], from ``x`` or from scratch."""
        start = self._bed.guess(closing) if x is None else x
        x = self._stepping.solve(start, Control(closing=closing), Work())
        return x, self.problem.sheet_force(x)

    def destroy(self) -> None:
        """Give the factors' memory back."""
        self.solver.destroy()

    def _climb(self, x: FloatArray | None, reached: float, force: float, work: Work) -> FloatArray:
        """State at ``force`` from the one at ``reached`` [N], or from scratch."""
        way = self.way(reached, force)
        if x is None:
            x, reached = self._stepping.first(self._bed.closing(way[0]), way[0], work)
        self._remember(x, reached)
        try:
            for goal in (f for f in way if f > reached or f == force):
                x, reached = self._stepping.climb(x, reached, goal, work, walk=self.fallback is None), goal
            return x
        except ConvergenceError as error:
            raise explained(error, self.problem.foam, *self._last) from error
