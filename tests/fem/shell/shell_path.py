"""A shell under given loads, for the published tables: Newton's method by load steps, and along the path."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from softjaw.fem.errors import ConvergenceError
from softjaw.fem.shell.element import Shell

TOLERANCE = 1e-7  # of the residual, relative to the load
ROUNDING = 16.0 * np.finfo(float).eps  # of the thickness stresses, relative to E: the residual gets no smaller
MOST_ITERATIONS = 25
MOST_HALVINGS = 8  # of a load step
DESIRED = 6  # iterations of a step along the path: longer steps follow easier ones
LARGEST_TURN = np.radians(60.0)  # of the secant from step to step; more means that the path has been lost


class Equilibrium(NamedTuple):
    """Load factor, state ``(6 k,)``, Newton iterations with those of failed tries, and halvings of the step."""

    factor: float
    q: np.ndarray
    iterations: int = 0
    halvings: int = 0


class Loaded(NamedTuple):
    """A shell, which of its numbers are fixed and the load ``(6 k,)``."""

    shell: Shell
    fixed: np.ndarray
    load: np.ndarray
    mixed: bool = True

    @property
    def start(self):
        return Equilibrium(0.0, np.zeros(self.shell.size))

    def newton(self, q, factor, length=0.0, along=None):
        """Equilibrium near ``q``, at this load factor or ``length`` further along the path; and the iterations.

        Along the path each change is at right angles to the displacements of the whole step.
        """
        shell, free = self.shell, np.flatnonzero(~self.fixed)
        noise = ROUNDING * shell.young_modulus * np.linalg.norm(shell.node_area)
        tolerance = max(TOLERANCE * np.linalg.norm(self.load[free]), noise)
        moved, first, before = free % 6 < 3, q, None  # directors have no part in a length
        for done in range(MOST_ITERATIONS + 1):
            residual = (shell.residual(q) - factor * self.load)[free]
            if not np.isfinite(residual).all():
                break
            if np.linalg.norm(residual) <= tolerance and (done or not length):
                return Equilibrium(factor, q), done
            K = csr_matrix((shell.tangent(q, before), shell.column, shell.start), shape=(shell.size,) * 2)
            before = q if self.mixed else None
            symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 1e-3, "options": {"SymmetricMode": True}}
            solver = splu(K[free][:, free].tocsc(), **symmetric)
            step = -solver.solve(residual)
            if length:
                by_load, way = solver.solve(self.load[free]), ((q - first)[free] if done else along) * moved
                more = ((0.0 if done else length * np.linalg.norm(way)) - way @ step) / (way @ by_load)
                factor, step = factor + more, step + more * by_load
            q = q.copy()
            q[free] += step
        raise ConvergenceError(f"no equilibrium near load factor {factor:.6g}")


def load_steps(loaded: Loaded, factors: Iterable[float]) -> Iterator[Equilibrium]:
    """Equilibrium at each load factor in turn, from the reference on; a step that does not converge is halved."""
    here = loaded.start
    for factor in factors:
        goals, iterations, halvings = [factor], 0, 0
        while goals:
            try:
                here, done = loaded.newton(here.q, goals[-1])
            except ConvergenceError:
                halvings += 1
                if halvings > MOST_HALVINGS:
                    raise
                goals.append(0.5 * (here.factor + goals[-1]))
                done = MOST_ITERATIONS
            else:
                goals.pop()
            iterations += done
        yield here._replace(iterations=iterations, halvings=halvings)


def follow(loaded: Loaded, first: float, longest: float) -> Iterator[Equilibrium]:
    """Equilibria along the path from the load factor ``first`` on, whose displacement is the first step's length."""
    (here,) = load_steps(loaded, [first])
    yield here
    free = np.flatnonzero(~loaded.fixed)
    moved = free % 6 < 3
    along = here.q[free]
    length = shortest = min(np.linalg.norm(along * moved), longest)
    while length > 1e-4 * shortest:
        try:
            there, done = loaded.newton(here.q, here.factor, length, along)
        except ConvergenceError:
            length /= 2
            continue
        step = (there.q - here.q)[free]
        a, b = along * moved, step * moved
        if a @ b < np.cos(LARGEST_TURN) * np.linalg.norm(a) * np.linalg.norm(b):
            length /= 2
            continue
        length = min(length * float(np.clip(np.sqrt(DESIRED / done), 0.5, 1.5)), longest)
        along, here = step, there
        yield here
    raise ConvergenceError(f"the path is lost beyond load factor {here.factor:.6g}")
