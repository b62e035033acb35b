"""The type of one row of the tables of quantities: name, unit, meaning and shape of a number of a case."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

MODELS = ("curved", "flat", "projected")
FINGERS = 2
NEEDS = ("two meshes", "six components", "mass", "wall", "graspit", "two scores")


@dataclass(frozen=True)
class Quantity:
    """One number, or one small array, of a case.

    Parameters
    ----------
    name, units, long_name : str
        Dataset name, SI unit ("" for a pure number), label of a colour bar.
    definition : str
        One sentence; the reader of the file sees it beside the data.
    per : "case" or "finger"
        A finger's quantity has a leading axis of length two.
    by_model : bool
        Whether there is one value for each of `MODELS` (axis after the finger).
    group : str
        ``maps``, ``fingers``, ``checks``, ``work`` or ``limit_surface``.
    shape : tuple of int
        Trailing shape, ``()`` for a scalar.
    needs : "" or one of `NEEDS`
        What the scene must ask for; without it the quantity is not in the file.
    among : "", "sampled" or "probe"
        Which candidates alone it is stored for: those whose wrenches are, or the probes.
    """

    name: str
    units: str
    long_name: str
    definition: str
    per: str = "case"
    by_model: bool = False
    group: str = "maps"
    shape: tuple[int, ...] = ()
    needs: str = ""
    among: str = ""

    @property
    def key(self) -> str:
        """Key of the value in ``CaseResult.values``."""
        return f"{self.group}/{self.name}"

    @property
    def row_shape(self) -> tuple[int, ...]:
        """Shape of one case's value."""
        finger = (FINGERS,) if self.per == "finger" else ()
        return finger + ((len(MODELS),) if self.by_model else ()) + self.shape


def finger(group: str, name: str, units: str, long_name: str, definition: str, **extra: Any) -> Quantity:
    """A quantity that each finger has."""
    return Quantity(name, units, long_name, definition, per="finger", group=group, **extra)
