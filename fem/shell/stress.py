"""Largest stresses and strains on the two faces of a deformed shell."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softjaw.fem.shell import element_kernel as kernel
from softjaw.fem.shell.model import FloatArray, Shell


@dataclass(frozen=True)
class FaceState:
    """Strain and stress of one face at the Gauss points of ``n`` elements.

    Attributes
    ----------
    strain, stress : (n, 4, 3) arrays
        Green-Lagrange strains 11, 22, gamma_12 and second Piola-Kirchhoff stresses 11, 22, 12 [Pa] in the element's
        local axes in the wall; the shears are the centre's.
    """

    strain: FloatArray
    stress: FloatArray

    @property
    def von_mises(self) -> FloatArray:
        """Equivalent stress ``(n, 4)`` of plane stress [Pa]."""
        a, b, c = np.moveaxis(self.stress, -1, 0)
        return np.sqrt(a * a - a * b + b * b + 3.0 * c * c)

    @property
    def principal_strain(self) -> FloatArray:
        """Smaller and larger principal strain in the wall, ``(n, 4, 2)``."""
        a, b, c = np.moveaxis(self.strain, -1, 0)
        middle, radius = 0.5 * (a + b), np.hypot(0.5 * (a - b), 0.5 * c)
        return np.stack([middle - radius, middle + radius], axis=-1)


def faces(shell: Shell, q: FloatArray) -> tuple[FaceState, FaceState]:
    """Outer and inner face in the state ``q (6 k,)``."""
    parts, e = shell.elements, np.empty((len(shell.elements.nodes), kernel.STRAINS))
    x = np.hstack([shell.mesh.X, shell.mesh.D]) + q.reshape(-1, 6)
    kernel.forms(parts.nodes, parts.plane, parts.twist, x, e)
    e -= parts.start
    membrane, bending = e[:, :8].reshape(-1, 4, 2), e[:, 8:16].reshape(-1, 4, 2)
    E, nu = shell.young_modulus, shell.poisson_ratio
    C = E / (1.0 - nu**2) * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 0.5 * (1.0 - nu)]])
    states = []
    for zeta in (1.0, -1.0):
        shear = np.broadcast_to((e[:, 16] + zeta * e[:, 17])[:, None], membrane.shape[:2])
        strain = np.dstack([membrane + zeta * bending, shear])
        states.append(FaceState(strain, strain @ C))
    return states[0], states[1]


def largest(shell: Shell, q: FloatArray) -> dict[str, float]:
    """Largest equivalent stress [Pa] and principal strain (by size) of each face: what a wall has to bear."""
    result = {}
    for name, face in zip(("outer", "inner"), faces(shell, q), strict=True):
        result[f"{name}_von_mises"] = float(face.von_mises.max())
        result[f"{name}_strain"] = float(np.abs(face.principal_strain).max())
    return result
