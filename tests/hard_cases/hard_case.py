"""The hard cases of ``cases.toml``, their scenes, and what each comes to."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study import pipeline
from softjaw.study.case.build import build_object, check_object
from softjaw.study.case.candidates import units
from softjaw.study.case.model import check_poses
from softjaw.study.case.result import CaseFailure, CaseResult
from softjaw.study.messages import StudyError
from softjaw.study.quantities import NEEDS, quantities
from softjaw.study.scene import Scene, SceneError, parse_scene
from softjaw.study.scene.load import ALTERNATIVES
from softjaw.study.scene.text import toml_text

FOLDER = Path(__file__).parent
MAPS = {q.name: q for q in quantities(NEEDS) if q.group == "maps"}
WHOLE = {"object": ("shape",), "candidates": sum(ALTERNATIVES, ())}  # keys that make a section replace its base's
CHECKS = {"force_balance": max, "adhesion": max, "penetration": max, "min_det_f": min, "ellipticity": min}


@dataclass(frozen=True)
class Same:
    """Another case that must have the same answer ``within`` a relative difference.

    ``length`` and ``force`` are those of this case over those of the other.
    """

    case: str
    within: float
    quantities: tuple[str, ...] = ("closing", "e_n", "S")
    length: float = 1.0
    force: float = 1.0

    def factor(self, name: str) -> float:
        """Value of a quantity in this case over that in the other, by its unit."""
        powers = {"N": (0, 1), "m": (1, 0), "m^2": (2, 0), "N m": (1, 1), "Pa": (-2, 1), "": (0, 0)}
        of_length, of_force = powers[MAPS[name].unit]
        return self.length**of_length * self.force**of_force


@dataclass(frozen=True)
class Known:
    """A map's value at the highest force that is known in closed form, in SI units."""

    quantity: str
    value: float
    within: float


@dataclass(frozen=True)
class HardCase:
    """One case; the keys are explained in ``cases.toml``, ``sections`` is what it changes of its base."""

    name: str
    kind: str
    base: str = "plain"
    expect: str = "solved"
    reason: str = ""
    note: str = ""
    up_to_n: float = 0.0
    quick: bool = False
    same_as: Same | None = None
    known: Known | None = None
    sections: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """What a case came to.

    Parameters
    ----------
    refused : str
        Why it was not begun, or nothing.
    forces, done : (n,) arrays
        Force of every row [N], and whether it was solved.
    messages : tuple of str
        Note or reason of every row.
    iterations, halvings, seconds : numbers
        Newton iterations, step halvings and time of the solved rows, both fingers.
    checks : dict
        The worst value of every check over rows and fingers.
    maps, errors : dict
        Values of the solved rows by quantity; their mesh errors, where two meshes were solved.
    """

    refused: str = ""
    forces: np.ndarray = field(default_factory=lambda: np.zeros(0))
    done: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    messages: tuple[str, ...] = ()
    iterations: int = 0
    halvings: int = 0
    seconds: float = 0.0
    checks: dict[str, float] = field(default_factory=dict)
    maps: dict[str, np.ndarray] = field(default_factory=dict)
    errors: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def found(self) -> str:
        """Word for the outcome."""
        return "refused" if self.refused else "solved" if self.done.all() else "failed"

    @property
    def text(self) -> str:
        """The outcome in a column of a table."""
        some = self.found == "failed" and self.done.any()
        return f"failed, {self.done.sum()} of {self.done.size} solved" if some else self.found


def _load() -> tuple[dict[str, Any], dict[str, HardCase]]:
    data = tomllib.loads((FOLDER / "cases.toml").read_text())
    cases = {}
    for given in data["case"]:
        own = {key: given[key] for key in HardCase.__dataclass_fields__ if key in given}
        own |= {key: kind(**own[key]) for key, kind in (("same_as", Same), ("known", Known)) if key in own}
        sections = {key: value for key, value in given.items() if key not in own}
        assert given["name"] not in cases, given["name"]
        cases[given["name"]] = HardCase(**own, sections=sections)
    return data["base"], cases


BASES, CASES = _load()


def scene_of(case: HardCase) -> Scene:
    """Scene of a case: sections over those of its base key by key, but another shape or place replaces the whole."""
    base = BASES.get(case.base) or tomllib.loads((FOLDER / case.base).read_text())
    data: dict[str, Any] = {name: dict(table) for name, table in base.items()}
    for name, table in case.sections.items():
        whole = any(key in table for key in WHOLE.get(name, ()))
        data[name] = table if whole else {**data.get(name, {}), **table}
    # what is right for a case does not hang on a second mesh, unless it asks for one
    data["accuracy"] = {"meshes": 1} | data.get("accuracy", {})
    return parse_scene(toml_text(data), FOLDER / f"{case.name}.toml")


@cache
def outcome(name: str) -> Outcome:
    """Solve a case, once in a process."""
    return outcome_of(lambda: scene_of(CASES[name]))


def outcome_of(made_scene: Callable[[], Scene]) -> Outcome:
    """Solve all cases of a scene; whatever it dies of is its outcome."""
    try:
        scene = made_scene()
        check_object(scene)
        made = units(scene, lambda point: build_object(point.object).axis_symmetry)
        check_poses(scene, [unit.scene for unit in made])
    except SceneError as error:
        return Outcome(
            "\n".join(f"{p.key}: found {p.found}, expected {p.expected}; {p.remedy}" for p in error.problems)
        )
    except StudyError as error:
        return Outcome(error.message)
    return _outcome(*zip(*(row for unit in made for row in _rows(unit)), strict=True))


def _rows(unit: Any) -> list[tuple[float, CaseResult | CaseFailure]]:
    """Force and result of every case of a unit."""
    forces, found = unit.scene.load.normal_force, []
    try:
        found += [result for _, result in pipeline.solve_unit(unit)]
    except Exception as error:  # as in a run: the rest of the forces fail
        found += [CaseFailure(f"{type(error).__name__}: {error}")] * (len(forces) - len(found))
    return list(zip(forces, found, strict=True))


def _outcome(forces: tuple[float, ...], results: tuple[CaseResult | CaseFailure, ...]) -> Outcome:
    """Outcome of all rows."""
    good = [r.values for r in results if isinstance(r, CaseResult)]

    def maps(suffix: str) -> dict[str, np.ndarray]:
        names = [name for name in MAPS if good and f"maps/{name}{suffix}" in good[0]]
        return {name: np.array([np.ravel(v[f"maps/{name}{suffix}"])[0] for v in good]) for name in names}

    def total(name: str) -> float:
        return sum(float(np.sum(v[f"work/{name}"])) for v in good)

    checks = {name: worst(x for v in good for x in v[f"checks/{name}"]) for name, worst in CHECKS.items() if good}
    return Outcome(
        "", np.array(forces), np.array([isinstance(r, CaseResult) for r in results]),
        tuple(r.message for r in results), int(total("newton_iterations")), int(total("step_halvings")),
        total("seconds_total"),
        checks, maps(""), maps("_error"),
    )  # fmt: skip
