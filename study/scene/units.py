"""Units in the names of scene keys: ``pad_length_mm`` is a length, given in mm and used in m."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from softjaw.fem.objects.mesh_file import LENGTHS


class Unit(NamedTuple):
    """A unit: kind of quantity, size in SI units as ``times / over`` (rounds once), SI unit, way of writing it."""

    kind: str
    times: float
    over: float
    si: str
    text: str

    @property
    def size(self) -> float:
        """One such unit in SI units."""
        return self.times / self.over


UNITS = {
    **{name: Unit("length", times, over, "m", name) for name, (times, over) in LENGTHS.items()},
    "um": Unit("length", 1, 1e6, "m", "um"),
    "kg": Unit("mass", 1, 1, "kg", "kg"),
    "g": Unit("mass", 1, 1000, "kg", "g"),
    "n": Unit("force", 1, 1, "N", "N"),
    "kn": Unit("force", 1000, 1, "N", "kN"),
    "pa": Unit("pressure", 1, 1, "Pa", "Pa"),
    "kpa": Unit("pressure", 1000, 1, "Pa", "kPa"),
    "mpa": Unit("pressure", 1e6, 1, "Pa", "MPa"),
    "gpa": Unit("pressure", 1e9, 1, "Pa", "GPa"),
    "deg": Unit("angle", math.pi, 180, "rad", "degrees"),
    "rad": Unit("angle", 1, 1, "rad", "rad"),
}


def split_unit(key: str) -> tuple[str, str]:
    """Name and unit suffix of a key; the suffix is empty where there is none.

    >>> split_unit("pad_length_mm"), split_unit("model_size")
    (('pad_length', 'mm'), ('model_size', ''))
    """
    stem, _, suffix = key.rpartition("_")
    return (stem, suffix) if stem and suffix in UNITS else (key, "")


def in_si(key: str, value: Any) -> Any:
    """A key's value in SI units; lists go through member by member, ``"auto"`` becomes None.

    >>> in_si("profile_mm", ((0.0, 30.0),)), in_si("grid_step_mm", "auto")
    (((0.0, 0.03),), None)
    """
    if isinstance(value, list | tuple):
        return tuple(in_si(key, member) for member in value)
    if value is None or value == "auto":
        return None
    unit = UNITS.get(split_unit(key)[1])
    return value * unit.times / unit.over if unit else value


def si(key: str) -> Any:
    """A property that gives the key ``key`` of a scene section in SI units (None where the key says ``"auto"``)."""
    return property(lambda section: in_si(key, getattr(section, key)), doc=f"``{key}`` in SI units.")
