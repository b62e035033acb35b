"""Elastic materials of thin walls, by name.

Moduli and yield strengths at room temperature lie in the ranges of Callister and Rethwisch, Fundamentals of Materials
Science and Engineering, 3rd ed., appendix B (PET 2.76-4.14 GPa, PP 1.14-1.55 GPa, HDPE 1.08 GPa), and Poisson's ratios
in those of Ashby, Materials Selection in Mechanical Design. The modulus of PET is lower than its range: 2.0 GPa is a
cautious value for blown walls, which are softer where they were stretched little; give 2.8e9 for well stretched ones.
"""

from typing import NamedTuple


class WallMaterial(NamedTuple):
    """Isotropic elastic wall; above the ``yield_strength`` [Pa] an indentation stays, None where it is not known."""

    young_modulus: float
    poisson_ratio: float
    yield_strength: float | None = None


MATERIALS = {
    "pet": WallMaterial(2.0e9, 0.38, 57e6),
    "pp": WallMaterial(1.3e9, 0.41, 31e6),
    "hdpe": WallMaterial(1.08e9, 0.42, 26e6),
}


def wall_material(name: str | None = None, **values: float | None) -> WallMaterial:
    """Material by name, in which every value that is given replaces the named one's; without a name, by its values."""
    given = {key: value for key, value in values.items() if value is not None}
    return MATERIALS[name.lower()]._replace(**given) if name else WallMaterial(**given)
