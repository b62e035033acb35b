"""Equilibrium path of a loaded shell past limit points: arc length with an updated normal plane.

The load factor is one more unknown. The first iteration of a step goes a given length along the last secant; every
later correction is at right angles to the step so far (Riks, Int. J. Solids Struct. 15, 1979; Ramm, 1981). Lengths
are those of the displacements ``u`` alone, so that units of load play no part.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from softjaw.fem.errors import ConvergenceError
from softjaw.fem.petsc import NonlinearSolver
from softjaw.fem.shell.model import FloatArray
from softjaw.fem.shell.solve import Equilibrium, ShellProblem, default_tolerance, load_steps

DESIRED = 6  # iterations of a step: longer steps follow easier ones
LARGEST_TURN = np.radians(60.0)  # of the secant from step to step; more means that the path has been lost
SHORTEST = 1e-4  # step, relative to the first


class ArcProblem(ShellProblem):
    """Equilibrium with the load factor as the last unknown (see ``fem.petsc.Problem``)."""

    def __init__(self, problem: ShellProblem) -> None:
        self.__dict__.update(problem.__dict__)
        if len(self.driven):
            raise ValueError("a path by arc length follows a load; it takes no driven displacements")
        self.size = len(self.free) + 1
        loaded = np.flatnonzero(self.load[self.free])
        self._load_column = -self.load[self.free][loaded]
        self._counts = (self.free % 6 < 3).astype(float)  # displacements, not directors
        last, row = np.int32(self.size - 1), np.arange(self.size - 1)
        self.rows = np.concatenate([self.rows, loaded, np.full(self.size, last)]).astype(np.int32)
        self.columns = np.concatenate([self.columns, np.full(len(loaded), last), row, [last]]).astype(np.int32)

    def begin(self, x: FloatArray, along: FloatArray, length: float) -> None:
        """Start a step at ``x (size,)`` of the given length [m] along the secant ``along (size,)``."""
        self._start, self._along, self._step = x.copy(), along, length
        self.forget()

    def length(self, step: FloatArray) -> float:
        """Length [m] of a step ``(size,)``."""
        return float(np.linalg.norm(step[:-1] * self._counts))

    def residual(self, x: FloatArray) -> FloatArray:
        """See `fem.petsc.Problem`."""
        self.factor = x[-1]
        ahead = 0.0 if (x != self._start).any() else -self.stiffness * self._step
        return np.append(super().residual(x[:-1]), ahead)

    def tangent(self, x: FloatArray) -> FloatArray:
        """See `fem.petsc.Problem`."""
        self.factor = x[-1]
        values = super().tangent(x[:-1])
        step = x - self._start
        step = step if step.any() else self._along
        plane = self.stiffness * step[:-1] * self._counts / self.length(step)
        return np.concatenate([values, self._load_column, plane, [0.0]])


def follow(
    problem: ShellProblem, first: float, longest: float = np.inf, iterations: int = 15, steps: int = 500
) -> Iterator[Equilibrium]:
    """Equilibria along the path of ``problem``, from the load factor ``first`` on; the caller stops where it likes.

    Parameters
    ----------
    problem : ShellProblem
    first : float
        Load factor of the first state, which is found under that load; its displacement is the first arc length.
    longest : float
        Largest arc length of a step [m].
    iterations, steps : int
        Newton iterations after which a step is shortened, and the largest number of steps.

    Raises
    ------
    ConvergenceError
        When a step 1e-4 times as long as the first fails.
    """
    state = next(load_steps(problem, [first]))
    yield state
    arc = ArcProblem(problem)
    solver = NonlinearSolver(arc, {}, "path_")
    tolerance = default_tolerance(problem)
    x = np.append(state.q[arc.free], first)
    along = x.copy()
    shortest = SHORTEST * arc.length(along)
    length = min(arc.length(along), longest)
    cuts = spent = 0
    try:
        while steps > 0:
            arc.begin(x, along, length)
            try:
                new, done = solver.solve(x, tolerance, iterations)
            except ConvergenceError:
                done = 0
            spent += done or iterations
            if not done or _turn(arc, along, new - x) > LARGEST_TURN:
                cuts, length = cuts + 1, length / 2
                if length < shortest:
                    raise ConvergenceError(
                        f"the shell's path is lost beyond load factor {x[-1]:.6g}: steps of {length:.3g} m fail; "
                        "refine the mesh, or begin at a smaller load"
                    )
                continue
            along, x = new - x, new
            length = min(length * float(np.clip(np.sqrt(DESIRED / done), 0.5, 1.5)), longest)
            arc.factor = x[-1]
            yield Equilibrium(float(x[-1]), arc.state(x), arc.support_forces(x[:-1]), spent, cuts)
            cuts, spent, steps = 0, 0, steps - 1
    finally:
        solver.destroy()


def _turn(arc: ArcProblem, before: FloatArray, after: FloatArray) -> float:
    """Angle [rad] between two steps ``(size,)``."""
    a, b = before[:-1] * arc._counts, after[:-1] * arc._counts
    return float(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1.0, 1.0)))
