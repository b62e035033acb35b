"""Elastic materials of thin walls, by name.

Moduli and yield strengths at room temperature lie in the ranges of Callister and Rethwisch, Fundamentals of Materials
Science and Engineering, 3rd ed., appendix B (PET 2.76-4.14 GPa, PP 1.14-1.55 GPa, HDPE 1.08 GPa), and Poisson's ratios
in those of Ashby, Materials Selection in Mechanical Design. The modulus of PET is lower than its range: 2.0 GPa is a
cautious value for blown walls, which are softer where they were stretched little; give 2.8e9 for well stretched ones.
"""

from __future__ import annotations

from dataclasses import dataclass, replace


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
