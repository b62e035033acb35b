"""Shells under given loads or displacements, by steps, and problems with published answers.

A problem has a mesh, supports, loads and the displacements that are read. Nonlinear: Sze, Liu and Lo, Finite Elements
in Analysis and Design 40, 2004; linear: MacNeal and Harder, Finite Elements in Analysis and Design 1, 1985. Lengths,
forces and moduli as printed there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

from softjaw.fem.errors import ConvergenceError
from softjaw.fem.shell.element import Shell, patch

TOLERANCE = 1e-7  # of the residual, relative to the load
ROUNDING = 16.0 * np.finfo(float).eps  # of the thickness stresses, relative to E: the residual gets no smaller
MOST_ITERATIONS = 25
UX, UY, UZ = np.eye(6)[:3]  # a force on a node


class Equilibrium(NamedTuple):
    """State ``(6 k,)``, and the Newton iterations."""

    q: np.ndarray
    iterations: int = 0


class Loaded(NamedTuple):
    """A shell, which of its numbers are fixed and the load ``(6 k,)``."""

    shell: Shell
    fixed: np.ndarray
    load: np.ndarray
    mixed: bool = True

    def newton(self, q, factor):
        """Equilibrium near ``q`` at this load factor."""
        shell, free, before = self.shell, np.flatnonzero(~self.fixed), None
        noise = ROUNDING * shell.young_modulus * np.linalg.norm(shell.node_area)
        tolerance = max(TOLERANCE * np.linalg.norm(self.load), noise)
        for done in range(MOST_ITERATIONS + 1):
            residual = (shell.residual(q) - factor * self.load)[free]
            if not np.isfinite(residual).all():
                break
            if np.linalg.norm(residual) <= tolerance:
                return Equilibrium(q, done)
            K = csr_matrix((shell.tangent(q, before), shell.column, shell.start), shape=(shell.size,) * 2)
            before = q if self.mixed else None
            symmetric = {"permc_spec": "MMD_AT_PLUS_A", "diag_pivot_thresh": 1e-3, "options": {"SymmetricMode": True}}
            q = q.copy()
            q[free] -= splu(K[free][:, free].tocsc(), **symmetric).solve(residual)
        raise ConvergenceError(f"no equilibrium near load factor {factor:.6g}")


def load_steps(loaded: Loaded, factors: Iterable[float]) -> Iterator[Equilibrium]:
    """Equilibrium at each load factor in turn, from the reference on."""
    here = Equilibrium(np.zeros(loaded.shell.size))
    for factor in factors:
        here = loaded.newton(here.q, factor)
        yield here


def moved_steps(case, displacements):
    """Load factor and state with the loaded node, the first that is read, moved so far: past a maximum of it too."""
    (node, component, sign), *_ = case.probes
    fixed, q = case.fixed.copy(), np.zeros(case.shell.size)
    fixed[node, component] = True
    for displacement in displacements:
        q = q.copy()
        q[6 * node + component] = sign * displacement
        q = case.loaded._replace(fixed=fixed.ravel()).newton(q, 0.0).q
        yield case.shell.residual(q)[6 * node + component] / case.load[node, component], q


@dataclass
class Case:
    """``probes`` are (node, component, sign)."""

    shell: Shell
    fixed: np.ndarray
    load: np.ndarray
    probes: list = field(default_factory=list)

    @property
    def loaded(self):
        return Loaded(self.shell, self.fixed.ravel(), self.load.ravel())

    def read(self, q):
        return [sign * q.reshape(-1, 6)[node, component] for node, component, sign in self.probes]


def case(X, normal, thickness, E, nu):
    shell = Shell(patch(X, normal, thickness), E, nu)
    return Case(shell, np.zeros((shell.nodes, 6), bool), np.zeros((shell.nodes, 6)))


def symmetric(fixed, nodes, axis):
    """Plane of symmetry at right angles to the axis."""
    fixed[nodes, axis] = fixed[nodes, 3 + axis] = True


def line_load(c, nodes, force):
    """Force per length along a line of nodes."""
    length = np.linalg.norm(np.diff(c.shell.mesh.X[nodes], axis=0), axis=1)
    for i, part in enumerate(length):
        c.load[nodes[i : i + 2]] += 0.5 * part * np.asarray(force)


def numbers(rows, columns):
    return np.arange((rows + 1) * (columns + 1)).reshape(rows + 1, columns + 1)


def cantilever(n=16):
    x, y = np.meshgrid(np.linspace(0, 10, n + 1), [0.0, 1.0], indexing="ij")
    c = case(np.stack([x, y, 0 * x], -1), [0, 0, 1.0], 0.1, 1.2e6, 0.0)
    k = numbers(n, 1)
    c.fixed[k[0]] = True
    line_load(c, k[-1], 4 * UZ)
    c.probes = [(k[-1, 0], 0, -1), (k[-1, 0], 2, 1)]
    return c


def annulus(around=80, across=10):
    r, t = np.meshgrid(np.linspace(6, 10, across + 1), np.linspace(0, 2 * np.pi, around + 1), indexing="ij")
    c = case(np.stack([r * np.cos(t), r * np.sin(t), 0 * r], -1), [0, 0, 1.0], 0.03, 21e6, 0.0)
    k = numbers(across, around)
    c.fixed[k[:, -1]] = True
    line_load(c, k[:, 0], 0.8 * UZ)
    c.probes = [(k[0, 0], 2, 1), (k[-1, 0], 2, 1)]
    return c


def hemisphere(n=16, P=400.0):
    """Quarter with a hole of 18 degrees; half of each point load. Linear: 0.0940 under forces of 2."""
    t, s = np.meshgrid(np.linspace(0, np.pi / 2, n + 1), np.radians(np.linspace(0, 72, n + 1)), indexing="ij")
    e = np.stack([np.cos(s) * np.cos(t), np.cos(s) * np.sin(t), np.sin(s)], -1)
    c = case(10 * e, e, 0.04, 6.825e7, 0.3)
    k = numbers(n, n)
    symmetric(c.fixed, k[0], 1)
    symmetric(c.fixed, k[-1], 0)
    c.fixed[k[0, 0], 2] = True
    c.load[k[0, 0]], c.load[k[-1, 0]] = -P / 2 * UX, P / 2 * UY
    c.probes = [(k[-1, 0], 1, 1), (k[0, 0], 0, -1)]
    return c


def cylinder(radius, length, thickness, angle, E, nu, around, along):
    """Patch of a cylinder along y, symmetric about its crown and one end; numbers by angle from the crown, then y."""
    t, y = np.meshgrid(np.linspace(0, angle, around + 1), np.linspace(0, length, along + 1), indexing="ij")
    e = np.stack([np.sin(t), 0 * t, np.cos(t)], -1)
    X = radius * e
    X[..., 1] = y
    c, k = case(X, e, thickness, E, nu), numbers(around, along)
    symmetric(c.fixed, k[0], 0)
    symmetric(c.fixed, k[:, 0], 1)
    return c, k


def hinged_roof(thickness, n=16):
    """Quarter of a shallow cylindrical roof on two hinged straight sides; a quarter of the load in the middle."""
    c, k = cylinder(2540.0, 254.0, thickness, 0.1, 3102.75, 0.3, n, n)
    c.fixed[k[-1], :3] = True
    c.load[k[0, 0]] = -3000 / 4 * UZ
    c.probes = [(k[0, 0], 2, -1)]
    return c


def scordelis_lo(n):
    """Quarter of a roof under its weight of 90 per area, on rigid diaphragms; 0.3024 down at the middle of the side."""
    c, k = cylinder(25.0, 25.0, 0.25, np.radians(40), 4.32e8, 0.0, n, n)
    c.fixed[np.ix_(k[:, -1], [0, 2, 3, 5])] = True
    c.load[:, 2] = -90 * c.shell.node_area
    c.probes = [(k[-1, 0], 2, -1)]
    return c


def pinched_cylinder(n):
    """Eighth of a cylinder with rigid diaphragms between two unit forces; 1.8248e-5 under the force."""
    c, k = cylinder(300.0, 300.0, 3.0, np.pi / 2, 3e6, 0.3, n, n)
    symmetric(c.fixed, k[-1], 2)
    c.fixed[np.ix_(k[:, -1], [0, 2, 3, 5])] = True
    c.load[k[0, 0]] = -0.25 * UZ
    c.probes = [(k[0, 0], 2, -1)]
    return c


def pulled_cylinder(around=24, along=36):
    """Eighth of a cylinder with free ends, pulled outwards by two opposing forces."""
    c, k = cylinder(4.953, 5.175, 0.094, np.pi / 2, 10.5e6, 0.3125, around, along)
    symmetric(c.fixed, k[-1], 2)
    c.load[k[0, 0]] = 40e3 / 4 * UZ
    c.probes = [(k[0, 0], 2, 1), (k[-1, 0], 0, -1), (k[-1, -1], 0, -1)]
    return c


def pinched_half_cylinder(n=40):
    """Half of a half cylinder, clamped at one end, pressed down at the other's crown; the straight side slides."""
    c, k = cylinder(101.6, 304.8, 3.0, np.pi / 2, 2068.5, 0.3, n, n)
    symmetric(c.fixed, k[-1], 2)
    c.fixed[k[:, 0]] = True
    c.load[k[0, -1]] = -2000 / 2 * UZ
    c.probes = [(k[0, -1], 2, -1)]
    return c
