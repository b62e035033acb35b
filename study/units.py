"""Units: those in which a scene may be written, and those of tables and reports; everything between is SI.

No other module multiplies by 1000: scene keys end in their unit (``pad_length_mm``), quantities name their SI unit.
"""

import math
from typing import Any, NamedTuple

from softjaw.fem.objects.mesh_file import LENGTHS

GRAVITY = 9.80665  # m/s^2


class Unit(NamedTuple):
    """A unit that values are given or shown in: one of it is ``times / over`` SI units (two numbers, to round once)."""

    si: str
    times: float
    over: float
    text: str

    @property
    def size(self) -> float:
        """One such unit in SI units."""
        return self.times / self.over


UNITS = {  # by the suffix of a scene's key
    **{name: Unit("m", times, over, name) for name, (times, over) in LENGTHS.items()},
    "um": Unit("m", 1, 1e6, "um"),
    "kg": Unit("kg", 1, 1, "kg"),
    "g": Unit("kg", 1, 1000, "g"),
    "n": Unit("N", 1, 1, "N"),
    "kn": Unit("N", 1000, 1, "kN"),
    "pa": Unit("Pa", 1, 1, "Pa"),
    "kpa": Unit("Pa", 1000, 1, "kPa"),
    "mpa": Unit("Pa", 1e6, 1, "MPa"),
    "gpa": Unit("Pa", 1e9, 1, "GPa"),
    "deg": Unit("rad", math.pi, 180, "deg"),
    "rad": Unit("rad", 1, 1, "rad"),
    "n_per_mm": Unit("N/m", 1000, 1, "N/mm"),
    "nm_per_rad": Unit("N m/rad", 1, 1, "N m/rad"),
}
SHOWN = {  # SI unit -> unit in tables and reports; other units are shown as they are
    "m": UNITS["mm"],
    "kg": UNITS["g"],
    "rad": UNITS["deg"],
    "Pa": UNITS["kpa"],
    "m^2": Unit("m^2", 1, 1e6, "mm^2"),
    "N m": Unit("N m", 1, 1000, "N mm"),
}


def split_unit(key: str) -> tuple[str, str]:
    """Name and unit suffix of a scene's key; the suffix is empty where there is none.

    >>> split_unit("pad_length_mm"), split_unit("springs_n_per_mm"), split_unit("model_size")
    (('pad_length', 'mm'), ('springs', 'n_per_mm'), ('model_size', ''))
    """
    unit = max((unit for unit in UNITS if key.endswith(f"_{unit}")), key=len, default="")
    stem = key[: -len(unit) - 1] if unit else key
    return (stem, unit) if stem else (key, "")


def converted(value: float, unit: str, other: str) -> float:
    """A value given in one unit of the table, in another one of the same kind.

    >>> converted(0.05, "m", "mm"), converted(2.0, "mpa", "kpa")
    (50.0, 2000.0)
    """
    return value * UNITS[unit].size / UNITS[other].size


def in_si(key: str, value: Any) -> Any:
    """A scene key's value in SI units; lists go through member by member, ``"auto"`` becomes None.

    >>> in_si("profile_mm", ((0.0, 30.0),)), in_si("grid_step_mm", "auto")
    (((0.0, 0.03),), None)
    """
    if isinstance(value, list | tuple):
        return tuple(in_si(key, member) for member in value)
    if value is None or value == "auto":
        return None
    unit = UNITS.get(split_unit(key)[1])
    return value * unit.times / unit.over if unit else value


def shown_unit(si_unit: str) -> str:
    """The unit in which a quantity is shown.

    >>> shown_unit("m"), shown_unit("N"), shown_unit("")
    ('mm', 'N', '')
    """
    return SHOWN[si_unit].text if si_unit in SHOWN else si_unit


def shown(value: Any, si_unit: str) -> Any:
    """A value, or an array of values, in the unit in which it is shown.

    >>> shown(0.0125, "m"), shown(2.0, "N")
    (12.5, 2.0)
    """
    unit = SHOWN.get(si_unit)
    return value if unit is None else value * (unit.over / unit.times)


def number(value: float, digits: int = 3) -> str:
    """A number with so many significant digits; a dash where there is none.

    >>> number(0.0123456), number(1.6e-9), number(math.nan), number(120000.0)
    ('0.0123', '1.6e-09', '-', '120000')
    """
    value = float(value)
    if not math.isfinite(value):
        return "-"
    text = f"{value:.{digits}g}"
    return f"{float(text):.0f}" if "e" in text and 1 <= abs(value) < 1e6 else text


def shown_text(value: float, si_unit: str, digits: int = 4) -> str:
    """A value with its unit, as it is shown.

    >>> shown_text(0.0125, "m"), shown_text(5.0, "N"), shown_text(0.5, "")
    ('12.5 mm', '5 N', '0.5')
    """
    text = number(shown(value, si_unit), digits) if math.isfinite(value) else str(float(value))
    return f"{text} {shown_unit(si_unit)}".rstrip()
