"""A shell under given loads: the nonlinear problem for PETSc, and load steps that are cut where Newton fails."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.fem.errors import ConvergenceError
from softjaw.fem.petsc import NonlinearSolver
from softjaw.fem.shell.element import FloatArray, IntArray, Shell

TOLERANCE = 1e-7  # of the residual, relative to the load
ROUNDING = 16.0 * np.finfo(float).eps  # of the thickness stresses, relative to E: the residual gets no smaller
SMALLEST_STEP = 1 / 256  # of the step that was asked for
EASY = 8  # a step that takes no more iterations may be followed by a longer one
GROWTH = 1.5
DESIRED = 6  # iterations of a step: longer steps follow easier ones
LARGEST_TURN = np.radians(60.0)  # of the secant from step to step; more means that the path has been lost
SHORTEST = 1e-4  # step, relative to the first


def free_numbers(fixed: FloatArray) -> tuple[IntArray, IntArray]:
    """Unknown of each shell number, -1 where ``fixed (6 k,)`` is set, and the numbers that are unknown."""
    free = np.flatnonzero(~np.asarray(fixed, dtype=bool).ravel())
    unknown = np.full(np.size(fixed), -1, dtype=np.int32)
    unknown[free] = np.arange(len(free), dtype=np.int32)
    return unknown, free


class ShellProblem:
    """``residual(q) = factor * load`` for the numbers that are not fixed (see ``fem.petsc.Problem``).

    Parameters
    ----------
    shell : Shell
    fixed : (6 k,) array of bool
    load : (6 k,) array, optional
        Outer forces at factor 1 [N]; they keep their direction.
    path : (6 k,) array, optional
        Displacements [m] at factor 1 of the numbers that are driven; zero where a number is not driven.
    mixed : bool
        Whether the tangent is that of mixed integration points.
    """

    complementarity = False

    def __init__(
        self,
        shell: Shell,
        fixed: FloatArray,
        load: FloatArray | None = None,
        path: FloatArray | None = None,
        *,
        mixed: bool = True,
    ) -> None:
        self.shell, self.mixed = shell, mixed
        self.load = np.zeros(shell.size) if load is None else load
        unknown, self.free = free_numbers(fixed)
        driven = np.zeros(0) if path is None else path[self.free]
        # a driven number stays an unknown, so that the first linear step moves everything along with it
        self.driven, self.values = np.flatnonzero(driven), driven[driven != 0]
        self.size = len(self.free)
        self.rows, self.columns = shell.entries(unknown)
        self.rows = np.where(np.isin(self.rows, self.driven), -1, self.rows).astype(np.int32)
        self.rows, self.columns = (np.append(v, self.driven).astype(np.int32) for v in (self.rows, self.columns))
        self.stiffness = float(np.abs(shell.tangent(np.zeros(shell.size))).mean())
        self.factor = 0.0
        self.forget()

    def forget(self) -> None:
        """Begin a new Newton solve: its first tangent is the plain one."""
        self._before: FloatArray | None = None

    def state(self, x: FloatArray) -> FloatArray:
        """State ``(6 k,)`` that belongs to the unknowns ``(size,)``."""
        q = np.zeros(self.shell.size)
        q[self.free] = x[: len(self.free)]
        return q

    def residual(self, x: FloatArray) -> FloatArray:
        """See `fem.petsc.Problem`."""
        r = (self.shell.residual(self.state(x)) - self.factor * self.load)[self.free]
        r[self.driven] = self.stiffness * (x[self.driven] - self.factor * self.values)
        return r

    def tangent(self, x: FloatArray) -> FloatArray:
        """See `fem.petsc.Problem`."""
        q = self.state(x)
        values = self.shell.tangent(q, self._before)
        self._before = q if self.mixed else None
        return np.append(values, np.full(len(self.driven), self.stiffness))

    def support_forces(self, x: FloatArray) -> FloatArray:
        """Forces ``(6 k,)`` [N] that hold the fixed and the driven numbers; zero elsewhere."""
        force = self.shell.residual(self.state(x)) - self.factor * self.load
        free = np.delete(self.free, self.driven)
        force[free] = 0.0
        return force

    def shorten(self, x: FloatArray, step: FloatArray) -> float:
        """Full steps."""
        return 1.0

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """No bounds."""
        return np.full(self.size, -np.inf), np.full(self.size, np.inf)


@dataclass(frozen=True)
class Equilibrium:
    """Solved state.

    Attributes
    ----------
    factor : float
        Load factor.
    q : (6 k,) array
        State [m].
    reaction : (6 k,) array
        Forces of the supports on the fixed numbers, zero elsewhere [N].
    iterations, halvings : int
        Newton iterations since the last state that was asked for, failed tries included, and how often a step was cut.
    """

    factor: float
    q: FloatArray
    reaction: FloatArray
    iterations: int
    halvings: int


def load_steps(
    problem: ShellProblem,
    factors: Iterable[float],
    iterations: int = 25,
    tolerance: float | None = None,
    options: dict[str, Any] | None = None,
) -> Iterator[Equilibrium]:
    """Equilibrium at each load factor in turn, from the reference on.

    A step that does not converge is halved, and made longer again after easy ones.

    Parameters
    ----------
    problem : ShellProblem
    factors : iterable of float
    iterations : int
        Newton iterations after which a step is given up.
    tolerance : float, optional
        Largest norm of the residual [N]; by default 1e-7 of the load's, or that of rounding errors. Needed where only
        displacements are driven.
    options : dict, optional
        PETSc options with the prefix ``shell_``.

    Raises
    ------
    ConvergenceError
        When a step 1/256 as long as the one asked for fails.
    """
    solver = NonlinearSolver(problem, options or {}, "shell_")
    if tolerance is None:
        tolerance = default_tolerance(problem)
        if not problem.load[problem.free].any():
            raise ValueError("nothing loads the shell; give the tolerance in newtons where displacements are driven")
    x, at = np.zeros(problem.size), 0.0
    try:
        for target in factors:
            whole = step = target - at
            spent = halvings = 0
            while at != target:
                goal = target if abs(target - at) <= 1.001 * abs(step) else at + step
                try:
                    x, done = _solve(solver, problem, x, goal, iterations, tolerance)
                except ConvergenceError as error:
                    spent, halvings, step = spent + iterations, halvings + 1, step / 2
                    if abs(step) < SMALLEST_STEP * abs(whole):
                        raise ConvergenceError(
                            f"the shell found no equilibrium beyond load factor {at:.6g} on the way to {target:.6g}: "
                            f"{error}; if the load has a limit there, follow the path by arc length or drive a "
                            "displacement"
                        ) from error
                    continue
                at, spent = goal, spent + done
                step *= GROWTH if done <= EASY else 1.0
            yield _equilibrium(problem, x, spent, halvings)
    finally:
        solver.destroy()


def default_tolerance(problem: ShellProblem) -> float:
    """Norm of the residual [N] that counts as zero under this problem's load."""
    shell, load = problem.shell, problem.load[problem.free]
    noise = ROUNDING * shell.young_modulus * float(np.linalg.norm(shell.node_area))
    return max(TOLERANCE * float(np.linalg.norm(load)), noise)


def _solve(
    solver: NonlinearSolver, problem: ShellProblem, x: FloatArray, factor: float, iterations: int, tolerance: float
) -> tuple[FloatArray, int]:
    """One Newton solve at ``factor``; on failure the problem keeps its last factor."""
    last, problem.factor = problem.factor, factor
    problem.forget()
    try:
        return solver.solve(x, tolerance, iterations)
    except ConvergenceError:
        problem.factor = last
        raise


def _equilibrium(problem: ShellProblem, x: FloatArray, iterations: int, halvings: int) -> Equilibrium:
    return Equilibrium(problem.factor, problem.state(x), problem.support_forces(x), iterations, halvings)


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
    halvings = spent = 0
    try:
        while steps > 0:
            arc.begin(x, along, length)
            try:
                new, done = solver.solve(x, tolerance, iterations)
            except ConvergenceError:
                done = 0
            spent += done or iterations
            if not done or _turn(arc, along, new - x) > LARGEST_TURN:
                halvings, length = halvings + 1, length / 2
                if length < shortest:
                    raise ConvergenceError(
                        f"the shell's path is lost beyond load factor {x[-1]:.6g}: steps of {length:.3g} m fail; "
                        "refine the mesh, or begin at a smaller load"
                    )
                continue
            along, x = new - x, new
            length = min(length * float(np.clip(np.sqrt(DESIRED / done), 0.5, 1.5)), longest)
            arc.factor = x[-1]
            yield Equilibrium(float(x[-1]), arc.state(x), arc.support_forces(x[:-1]), spent, halvings)
            halvings, spent, steps = 0, 0, steps - 1
    finally:
        solver.destroy()


def _turn(arc: ArcProblem, before: FloatArray, after: FloatArray) -> float:
    """Angle [rad] between two steps ``(size,)``."""
    a, b = before[:-1] * arc._counts, after[:-1] * arc._counts
    return float(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1.0, 1.0)))
