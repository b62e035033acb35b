"""Strain and stress of a wall's faces, recovered from the middles of the elements.

Strains of a bilinear element are of second order in its size in its middle alone (Barlow, Int. J. Num. Meth. Eng. 10,
1976). So those of the middles are interpolated linearly to the crossings of the grid lines, as patch recovery does on a
grid (Zienkiewicz and Zhu, Int. J. Num. Meth. Eng. 33, 1992). Planes of symmetry have images behind them, so a part of a
body gives what the whole one does.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softjaw.fem.shell import element_kernel as kernel
from softjaw.fem.shell.element import FloatArray, Shell
from softjaw.fem.shell.wall_mesh import BodyMesh


@dataclass(frozen=True)
class FaceState:
    """Strain and stress of one face at some places.

    Attributes
    ----------
    strain, stress : (..., 3) arrays
        Green-Lagrange strains 11, 22, gamma_12 and second Piola-Kirchhoff stresses 11, 22, 12 [Pa] along the elements'
        axes: 1 along theta, 2 along s where the lines of these are at right angles.
    """

    strain: FloatArray
    stress: FloatArray

    @property
    def von_mises(self) -> FloatArray:
        """Equivalent stress of plane stress at every place [Pa]."""
        a, b, c = np.moveaxis(self.stress, -1, 0)
        return np.sqrt(a * a - a * b + b * b + 3.0 * c * c)

    @property
    def principal_strain(self) -> FloatArray:
        """Smaller and larger principal strain in the wall, ``(..., 2)``."""
        a, b, c = np.moveaxis(self.strain, -1, 0)
        # half of c, because gamma is twice the tensor's shear
        middle, radius = 0.5 * (a + b), np.hypot(0.5 * (a - b), 0.5 * c)
        return np.stack([middle - radius, middle + radius], axis=-1)


def faces(shell: Shell[BodyMesh], q: FloatArray) -> tuple[FaceState, FaceState]:
    """Outer and inner face where grid lines cross, ``(m + 1, n + 1)``, in the state ``q (6 k,)``."""
    outer, inner = (_state(shell, _at_crossings(shell.mesh, own.strain)) for own in middles(shell, q))
    return outer, inner


def middles(shell: Shell, q: FloatArray) -> tuple[FaceState, FaceState]:
    """Outer and inner face in the middles of the ``n`` elements in the state ``q (6 k,)``."""
    parts, e = shell.elements, np.empty((len(shell.elements.nodes), kernel.STRAINS))
    x = np.hstack([shell.mesh.X, shell.mesh.D]) + q.reshape(-1, 6)
    kernel.forms(parts.nodes, parts.plane, parts.twist, x, e)
    e -= parts.start
    membrane, bending = (e[:, first : first + 8].reshape(-1, 4, 2).mean(axis=1) for first in (0, 8))
    outer, inner = (
        _state(shell, np.column_stack([membrane + zeta * bending, e[:, 16] + zeta * e[:, 17]])) for zeta in (1.0, -1.0)
    )
    return outer, inner


def _state(shell: Shell, strain: FloatArray) -> FaceState:
    """Strain and its stress: plane stress as in the element, whose thickness strain has no coupling with the others."""
    E, nu = shell.young_modulus, shell.poisson_ratio
    C = E / (1.0 - nu**2) * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 0.5 * (1.0 - nu)]])
    return FaceState(strain, strain @ C)


def _at_crossings(mesh: BodyMesh, values: FloatArray) -> FloatArray:
    """Strains where grid lines cross, ``(m + 1, n + 1, 3)``, from those in the middles of the elements ``(m n, 3)``."""
    grid, lines = values.reshape(len(mesh.theta) - 1, len(mesh.s) - 1, 3), mesh.theta
    middles = 0.5 * (lines[1:] + lines[:-1])
    # what lies before the first line and behind the last: the other end, or the image, whose shear has the other sign
    image = np.array([1.0, 1.0, -1.0])
    if mesh.closed:
        before, behind, (first, last) = grid[-1:], grid[:1], middles[[-1, 0]] + [-2 * np.pi, 2 * np.pi]
    else:
        before, behind, (first, last) = image * grid[:1], image * grid[-1:], 2 * lines[[0, -1]] - middles[[0, -1]]
    grid = _linear(lines, np.concatenate([[first], middles, [last]]), np.concatenate([before, grid, behind]))
    middles = 0.5 * (mesh.s[1:] + mesh.s[:-1])
    return np.swapaxes(_linear(mesh.s, middles, np.swapaxes(grid, 0, 1)), 0, 1)


def _linear(lines: FloatArray, middles: FloatArray, values: FloatArray) -> FloatArray:
    """Values at ``lines (k,)`` from those at ``middles``, along the first axis; beyond the ends as between the last."""
    if len(middles) == 1:
        return np.repeat(values, len(lines), axis=0)
    i = np.clip(np.searchsorted(middles, lines) - 1, 0, len(middles) - 2)
    part = ((lines - middles[i]) / (middles[i + 1] - middles[i]))[:, None, None]
    return (1.0 - part) * values[i] + part * values[i + 1]
