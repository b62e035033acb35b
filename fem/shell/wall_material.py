"""Elastic materials of thin walls, by name.

Moduli and yield strengths at room temperature lie in the ranges of Callister and Rethwisch, Fundamentals of Materials
Science and Engineering, 3rd ed., appendix B (PET 2.76-4.14 GPa, PP 1.14-1.55 GPa, HDPE 1.08 GPa), and Poisson's ratios
in those of Ashby, Materials Selection in Mechanical Design. The modulus of PET is lower than its range: 2.0 GPa is a
cautious value for blown walls, which are softer where they were stretched little; give 2.8e9 for well stretched ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from softjaw.fem.shell import element_kernel as kernel
from softjaw.fem.shell.element import FloatArray, Shell


@dataclass(frozen=True)
class WallMaterial:
    """Isotropic elastic wall.

    Parameters
    ----------
    young_modulus, poisson_ratio : float
        [Pa], [-].
    yield_strength : float, optional
        Stress at which the wall would keep an indentation [Pa]; None where it is not known.
    """

    young_modulus: float
    poisson_ratio: float
    yield_strength: float | None = None

    def __post_init__(self) -> None:
        """Refuse values that no wall has."""
        if not self.young_modulus > 0:
            raise ValueError(f"young_modulus must be positive, found {self.young_modulus} Pa")
        # 0.5 is allowed, unlike for foam: in plane stress nothing becomes infinite
        if not -1.0 < self.poisson_ratio <= 0.5:
            raise ValueError(f"poisson_ratio must lie between -1 and 0.5, found {self.poisson_ratio}")
        if self.yield_strength is not None and not self.yield_strength > 0:
            raise ValueError(f"yield_strength must be positive, found {self.yield_strength} Pa")


MATERIALS = {
    "pet": WallMaterial(2.0e9, 0.38, 57e6),
    "pp": WallMaterial(1.3e9, 0.41, 31e6),
    "hdpe": WallMaterial(1.08e9, 0.42, 26e6),
}


def wall_material(
    name: str | None = None,
    young_modulus: float | None = None,
    poisson_ratio: float | None = None,
    yield_strength: float | None = None,
) -> WallMaterial:
    """Material by name, in which every value that is given replaces the named one's; without a name, by its values.

    Raises
    ------
    ValueError
        For an unknown name, or values that are missing or that no wall has.
    """
    if name is None:
        if young_modulus is None or poisson_ratio is None:
            known = ", ".join(MATERIALS)
            raise ValueError(f"a wall material needs a name ({known}) or young_modulus and poisson_ratio")
        return WallMaterial(young_modulus, poisson_ratio, yield_strength)
    if name.lower() not in MATERIALS:
        raise ValueError(
            f"wall material '{name}' is unknown; choose one of {', '.join(MATERIALS)}, or give young_modulus "
            "and poisson_ratio"
        )
    given = {"young_modulus": young_modulus, "poisson_ratio": poisson_ratio, "yield_strength": yield_strength}
    return replace(MATERIALS[name.lower()], **{key: value for key, value in given.items() if value is not None})


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
        # half of c, because gamma is twice the tensor's shear
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
    # plane stress, as in the element, whose thickness strain has no coupling with the others
    C = E / (1.0 - nu**2) * np.array([[1.0, nu, 0.0], [nu, 1.0, 0.0], [0.0, 0.0, 0.5 * (1.0 - nu)]])
    states = []
    for zeta in (1.0, -1.0):
        shear = np.broadcast_to((e[:, 16] + zeta * e[:, 17])[:, None], membrane.shape[:2])
        strain = np.dstack([membrane + zeta * bending, shear])
        states.append(FaceState(strain, strain @ C))
    return states[0], states[1]
