"""A shell under given loads, for the published tables: load steps that are halved, and a path by arc length."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.fem.assembly import Pattern, add_up
from softjaw.fem.errors import ConvergenceError
from softjaw.fem.petsc import NonlinearSolver
from softjaw.fem.shell.element import FloatArray, Shell
from softjaw.fem.shell.wall_model import free_numbers

TOLERANCE = 1e-7  # of the residual, relative to the load
ROUNDING = 16.0 * np.finfo(float).eps  # of the thickness stresses, relative to E: the residual gets no smaller
SMALLEST_STEP = 1 / 256  # of the step that was asked for
EASY = 8  # a step that takes no more iterations may be followed by a longer one
GROWTH = 1.5
DESIRED = 6  # iterations of a step: longer steps follow easier ones
LARGEST_TURN = np.radians(60.0)  # of the secant from step to step; more means that the path has been lost
SHORTEST = 1e-4  # step, relative to the first


class ShellProblem:
    """``residual(q) = factor * load`` for the numbers that are not fixed (see ``fem.petsc.Problem``).

    Parameters
    ----------
    shell : Shell
    fixed : (6 k,) array of bool
    load : (6 k,) array, optional
        Outer forces at factor 1 [N]; they keep their direction.
    mixed : bool
        Whether the tangent is that of mixed integration points.
    tie : optional
        What else holds the shell: ``index (m, n)`` of the numbers, ``force`` and ``tangents`` of a state.
    """

    complementarity, non_negative = False, slice(0)

    def __init__(
        self,
        shell: Shell,
        fixed: FloatArray,
        load: FloatArray | None = None,
        *,
        mixed: bool = True,
        tie: Any = None,
    ) -> None:
        self.shell, self.mixed, self.tie = shell, mixed, tie
        self.load = np.zeros(shell.size) if load is None else load
        unknown, self.free = free_numbers(fixed)
        self.size = len(self.free)
        rows, columns = shell.entries(unknown)
        if tie is not None:
            own, n = unknown[tie.index], tie.index.shape[1]
            rows = np.concatenate([rows, np.repeat(own[:, :, None], n, 2).ravel()])
            columns = np.concatenate([columns, np.repeat(own[:, None, :], n, 1).ravel()])
        self._set_pattern(rows, columns)
        self.stiffness = float(np.abs(shell.tangent(np.zeros(shell.size))).mean())
        self.factor = 0.0
        self.forget()

    def _set_pattern(self, rows: FloatArray, columns: FloatArray) -> None:
        self.rows, self.columns, self.pattern = rows, columns, Pattern(self.size, rows, columns)
        self._slots = self.pattern.slots(rows, columns)

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
        q = self.state(x)
        inner = self.shell.residual(q) + (0.0 if self.tie is None else self.tie.force(q))
        return (inner - self.factor * self.load)[self.free]

    def tangent(self, x: FloatArray) -> None:
        """See `fem.petsc.Problem`."""
        self.pattern.values[:] = 0.0
        add_up(self._slots, self.entries(x), self.pattern.values)

    def entries(self, x: FloatArray) -> FloatArray:
        """Entries of the tangent, in the order of ``rows`` and ``columns``."""
        q = self.state(x)
        values = self.shell.tangent(q, self._before)
        self._before = q if self.mixed else None
        return values if self.tie is None else np.concatenate([values, self.tie.tangents(q).ravel()])

    def shorten(self, x: FloatArray, step: FloatArray) -> float:
        """Full steps."""
        return 1.0


@dataclass(frozen=True)
class Equilibrium:
    """Solved state.

    Attributes
    ----------
    factor : float
        Load factor.
    q : (6 k,) array
        State [m].
    iterations, halvings : int
        Newton iterations since the last state that was asked for, failed tries included, and how often a step was cut.
    """

    factor: float
    q: FloatArray
    iterations: int
    halvings: int


def load_steps(
    problem: ShellProblem,
    factors: Iterable[float],
    iterations: int = 25,
) -> Iterator[Equilibrium]:
    """Equilibrium at each load factor in turn, from the reference on.

    A step that does not converge is halved, and made longer again after easy ones.

    Parameters
    ----------
    problem : ShellProblem
    factors : iterable of float
    iterations : int
        Newton iterations after which a step is given up.
    Raises
    ------
    ConvergenceError
        When a step 1/256 as long as the one asked for fails.
    """
    solver, tolerance = NonlinearSolver(problem, {}, "shell_"), default_tolerance(problem)
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
                            f"no equilibrium beyond load factor {at:.6g} on the way to {target:.6g}: {error}"
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
    return Equilibrium(problem.factor, problem.state(x), iterations, halvings)


class ArcProblem(ShellProblem):
    """Equilibrium with the load factor as the last unknown (see ``fem.petsc.Problem``)."""

    def __init__(self, problem: ShellProblem) -> None:
        self.__dict__.update(problem.__dict__)
        self.size = len(self.free) + 1
        loaded = np.flatnonzero(self.load[self.free])
        self._load_column = -self.load[self.free][loaded]
        self._counts = (self.free % 6 < 3).astype(float)  # displacements, not directors
        last, row = np.int32(self.size - 1), np.arange(self.size - 1)
        self._set_pattern(
            np.concatenate([self.rows, loaded, np.full(self.size, last)]).astype(np.int32),
            np.concatenate([self.columns, np.full(len(loaded), last), row, [last]]).astype(np.int32),
        )

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

    def entries(self, x: FloatArray) -> FloatArray:
        """See `ShellProblem`."""
        self.factor = x[-1]
        values = super().entries(x[:-1])
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
            yield Equilibrium(float(x[-1]), arc.state(x), spent, halvings)
            halvings, spent, steps = 0, 0, steps - 1
    finally:
        solver.destroy()


def _turn(arc: ArcProblem, before: FloatArray, after: FloatArray) -> float:
    """Angle [rad] between two steps ``(size,)``."""
    a, b = before[:-1] * arc._counts, after[:-1] * arc._counts
    return float(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1.0, 1.0)))
