"""A shell under given loads, for the published tables: Newton's method by load steps."""

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

    def newton(self, q, factor):
        shell, free = self.shell, np.flatnonzero(~self.fixed)
        noise = ROUNDING * shell.young_modulus * np.linalg.norm(shell.node_area)
        tolerance = max(TOLERANCE * np.linalg.norm(self.load[free]), noise)
        before = None
        for done in range(MOST_ITERATIONS + 1):
            residual = (shell.residual(q) - factor * self.load)[free]
            if not np.isfinite(residual).all():
                break
            if np.linalg.norm(residual) <= tolerance:
                return Equilibrium(factor, q), done
            K = csr_matrix((shell.tangent(q, before), shell.column, shell.start), shape=(shell.size,) * 2)
            before = q if self.mixed else None
            symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 1e-3, "options": {"SymmetricMode": True}}
            step = -splu(K[free][:, free].tocsc(), **symmetric).solve(residual)
            q = q.copy()
            q[free] += step
        raise ConvergenceError(f"no equilibrium near load factor {factor:.6g}")


def load_steps(loaded: Loaded, factors: Iterable[float]) -> Iterator[Equilibrium]:
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
