"""Names of a table's columns: which quantity each one holds, in which unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

UNITS = {
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "area": {"m2": 1.0, "cm2": 1e-4, "mm2": 1e-6},
    "pressure": {"pa": 1.0, "kpa": 1e3, "mpa": 1e6, "n/mm2": 1e6},
    "number": {"-": 1.0, "1": 1.0},
}
CENTRE = ("x", "y", "z")
NORMAL = ("nx", "ny", "nz")
CORNERS = tuple(f"{axis}{k}" for k in (1, 2, 3, 4) for axis in "xyz")
KINDS = {
    **dict.fromkeys((*CENTRE, *CORNERS), "length"),
    **dict.fromkeys(NORMAL, "number"),
    "area": "area",
    "pressure": "pressure",
}
_ALIASES = {"n_x": "nx", "n_y": "ny", "n_z": "nz", "normal_x": "nx", "normal_y": "ny", "normal_z": "nz"}
_SHAPE = re.compile(r"(?P<name>.*?)\s*(?:_(?P<tail>[^_\s\[\]()]+)|[\[(](?P<boxed>[^\[\]()]*)[\])])?")


@dataclass(frozen=True)
class Column:
    """One column that is used.

    Parameters
    ----------
    name : str
        Quantity: a key of `KINDS`.
    header : str
        As the file spells it.
    position : int
        Place in a row, from 0.
    unit : str or None
        Unit that the header tells, None if it tells none.
    """

    name: str
    header: str
    position: int
    unit: str | None

    @property
    def kind(self) -> str:
        """``length``, ``area``, ``pressure`` or ``number``."""
        return KINDS[self.name]


def split_header(header: str, pressure_name: str | None = None) -> tuple[str, str | None] | None:
    """Quantity and unit of a header (None where it tells no unit); None for a column that has no meaning here.

    ``pressure_name`` is the header, with or without its unit, of the column that holds the pressure.

    Examples
    --------
    >>> split_header("x_mm"), split_header("Pressure [kPa]"), split_header("area"), split_header("x_inch")
    (('x', 'mm'), ('pressure', 'kpa'), ('area', None), None)
    """
    text = header.strip().lower()
    wanted = (pressure_name or "pressure").strip().lower()
    name, unit = _parted(text)
    if text in _ALIASES or text in KINDS:
        name, unit = _ALIASES.get(text, text), None
    if wanted == text:
        return "pressure", unit if unit in UNITS["pressure"] else None
    if name == "pressure" or wanted == name:
        return ("pressure", unit) if wanted == name and unit in UNITS["pressure"] else None
    if name not in KINDS:
        return None
    return (name, unit) if unit is None or unit in UNITS[KINDS[name]] else None


def _parted(text: str) -> tuple[str, str | None]:
    """Name and unit of ``x_mm``, ``x [mm]`` or ``x (mm)``."""
    found = _SHAPE.fullmatch(text)
    if found is None:
        return text, None
    unit = (found["tail"] or found["boxed"] or "").replace(" ", "").replace("^", "").replace("²", "2")
    return found["name"], unit or None


def used_columns(headers: Sequence[str], pressure_name: str | None = None) -> tuple[list[Column], list[str]]:
    """Columns that have a meaning, in the order of the file, and the headers of the others."""
    used, others = [], []
    for i, header in enumerate(headers):
        found = split_header(header, pressure_name)
        if found is None:
            others.append(header.strip())
        else:
            used.append(Column(found[0], header.strip(), i, found[1]))
    return used, others
