"""What all sections of a scene share: their base, and kinds of values."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Annotated, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from softjaw.study.messages import printable
from softjaw.study.scene.errors import Errors, refusal, refuse


class SceneSection(BaseModel):
    """What all sections share: nothing unknown, nothing converted from text, nothing changed later."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, protected_namespaces=())

    @model_validator(mode="after")
    def _rules_hold(self) -> Self:
        refuse(self.rules())
        return self

    def rules(self) -> Errors:
        """What is wrong with keys that are valid one by one, by their paths within the section."""
        return iter(())


def numbers_text(values: Sequence[float]) -> str:
    """A list of numbers as TOML would write it, without trailing zeros."""
    return f"[{', '.join(f'{v:g}' for v in values)}]"


def _lower_first(pair: tuple[float, float]) -> tuple[float, float]:
    if pair[0] >= pair[1]:
        raise refusal(f"two different values, the lower first, as in {numbers_text(pair[::-1])}")
    return pair


def _direction(vector: tuple[float, float, float]) -> tuple[float, float, float]:
    if not 1e-6 <= math.hypot(*vector) <= 1e6:
        raise refusal("a direction, as in [0, 0, -1]")
    return vector


def once_and_rising(values: tuple[float, ...]) -> tuple[float, ...]:
    """The values in rising order; refused if one is given twice."""
    for value, times in Counter(values).items():
        if times > 1:
            raise refusal(f"each value once; {value:g} is repeated")
    return tuple(sorted(values))


def _one_line(text: str) -> str:
    if printable(text) != text or not {"\n", "\t"}.isdisjoint(text):
        raise refusal("text without control characters")
    return text


Text = Annotated[str, AfterValidator(_one_line)]
Point = Annotated[tuple[float, float], Field(strict=False)]
Vector = Annotated[tuple[float, float, float], Field(strict=False)]
Direction = Annotated[Vector, AfterValidator(_direction)]
Interval = Annotated[Point, AfterValidator(_lower_first)]
