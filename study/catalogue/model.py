"""What a catalogue file holds: parts that scenes are put together from, and cases with the outcome that is right."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from softjaw.study.exits import USAGE, StudyError
from softjaw.study.quantities import NEEDS, quantities
from softjaw.study.scene.errors import SceneError, first_of
from softjaw.study.scene.loading import NAMES
from softjaw.study.scene.shape import Section
from softjaw.study.scene.text import parse_toml, read_text

MOST_REPETITIONS, LONGEST = 3, 300  # in a regular expression
COMPARED = ("travel", "e_n", "S")
MAPS = {q.name: q for q in quantities(NEEDS) if q.group == "maps"}


class Same(Section):
    """Another case that must have the same answer, and how nearly."""

    case: str = Field(description="name of the other case")
    within: float = Field(gt=0, le=0.5, description="largest relative difference of a quantity that is allowed")
    quantities: tuple[str, ...] = Field(COMPARED, strict=False, min_length=1, description="maps that are compared")
    length: float = Field(1.0, gt=0, description="lengths of this case over those of the other")
    force: float = Field(1.0, gt=0, description="forces of this case over those of the other")

    @field_validator("quantities")
    @classmethod
    def _known(cls, names: tuple[str, ...]) -> tuple[str, ...]:
        if strange := [name for name in names if name not in MAPS]:
            raise ValueError(f"no such quantity: {', '.join(strange)}")
        return names

    def factor(self, name: str) -> float:
        """Value of a quantity in this case over that in the other, by its unit."""
        powers = {"N": (0, 1), "m": (1, 0), "m^2": (2, 0), "N m": (1, 1), "Pa": (-2, 1), "": (0, 0)}
        of_length, of_force = powers[MAPS[name].units]
        return self.length**of_length * self.force**of_force


class Known(Section):
    """A value that is known in closed form."""

    quantity: str = Field(description="name of the map")
    value: float = Field(description="its value at the highest force, in SI units")
    within: float = Field(gt=0, le=0.5, description="largest relative difference that is allowed")


class Case(Section):
    """One scene of a catalogue; ``sections`` are what it changes of its base."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9.-]*$", max_length=60, description="name of the case and of its file")
    kind: str = Field(min_length=1, max_length=40, description="class of difficulty")
    base: str = Field("plain", description="name of a [base], or a scene file beside the catalogue")
    expect: Literal["solved", "failed", "refused"] = Field("solved", description="the outcome that is right")
    reason: str = Field("", description="regular expression that the reason of a failure or refusal contains")
    remark: str = Field("", description="regular expression for what is remarked of solved forces; empty: nothing is")
    up_to_n: float = Field(0.0, ge=0, description="forces up to this one must be solved, though others fail")
    same_as: Same | None = None
    known: Known | None = None
    sections: dict[str, Any] = Field(default_factory=dict)

    @field_validator("reason", "remark")
    @classmethod
    def _compiles(cls, pattern: str) -> str:
        # groups that are repeated, and many repetitions, can take for ever to be found missing
        repetitions = sum(map(pattern.count, "*+{"))
        if re.search(r"\)[*+?{]", pattern) or repetitions > MOST_REPETITIONS or len(pattern) > LONGEST:
            limits = f"no repeated group, at most {MOST_REPETITIONS} of * + {{ and {LONGEST} letters"
            raise ValueError(f"a regular expression that may take for ever; expected {limits}")
        try:
            re.compile(pattern)
        except re.error as error:
            raise ValueError(f"no regular expression: {error}") from error
        return pattern

    @model_validator(mode="after")
    def _consistent(self) -> Case:
        if (self.expect == "solved") == bool(self.reason):
            raise ValueError("a case that is to fail or to be refused has a reason, and no other has one")
        return self


class Catalogue(Section):
    """A whole file."""

    title: str = ""
    base: dict[str, dict[str, Any]] = Field(default_factory=dict, description="parts of scenes that cases begin with")
    case: tuple[Case, ...] = Field(strict=False, min_length=1)

    @model_validator(mode="after")
    def _names(self) -> Catalogue:
        names = [c.name for c in self.case]
        if twice := sorted({n for n in names if names.count(n) > 1}):
            raise ValueError(f"cases of the same name: {', '.join(twice)}")
        for c in self.case:
            if c.same_as and c.same_as.case not in names:
                raise ValueError(f"case '{c.name}' is compared with '{c.same_as.case}', which is no case")
            if c.base not in self.base and not c.base.endswith(".toml"):
                raise ValueError(f"case '{c.name}' begins with '{c.base}', which is no [base.{c.base}]")
        return self


def is_catalogue(path: Path) -> bool:
    """Whether a file is a catalogue: it has ``[[case]]``. What cannot be read is no catalogue."""
    try:
        return re.search(r"^\[\[case\]\]", read_text(path), re.MULTILINE) is not None
    except ValueError:
        return False


def load_catalogue(path: Path) -> Catalogue:
    """The catalogue of a file.

    Raises
    ------
    StudyError
        With the place and what is wrong there; scenes are not judged yet.
    """
    try:
        data = parse_toml(read_text(path), str(path))
    except SceneError as error:
        raise StudyError(USAGE, str(error)) from error
    cases = data.get("case", [])
    if isinstance(cases, list):
        data["case"] = [_with_sections(case) for case in cases]
    try:
        return Catalogue.model_validate(data)
    except ValidationError as error:
        lines = [f"{path}: {_place(e['loc'], cases)}{e['msg'].removeprefix('Value error, ')}" for e in error.errors()]
        raise StudyError(USAGE, first_of(lines, path)) from error


def _with_sections(case: Any) -> Any:
    """A case whose scene sections are gathered under one key."""
    if not isinstance(case, Mapping):
        return case
    own = {key: value for key, value in case.items() if key not in NAMES}
    return {**own, "sections": {key: case[key] for key in NAMES if key in case}}


def _place(loc: tuple[int | str, ...], cases: Any) -> str:
    """Name of the case and key of a validation error."""
    if len(loc) > 1 and loc[0] == "case" and isinstance(loc[1], int):
        name = cases[loc[1]].get("name", f"number {loc[1] + 1}") if isinstance(cases[loc[1]], Mapping) else loc[1]
        return f"case '{name}': " + "".join(f"{part}: " for part in loc[2:])
    return "".join(f"{part}: " for part in loc)
