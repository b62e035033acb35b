"""The hard cases of ``cases.toml``, their scenes, and what each comes to."""

import tomllib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study import pipeline
from softjaw.study.case.build import check_object
from softjaw.study.case.candidates import check_candidates, units
from softjaw.study.case.result import CaseFailure, CaseResult
from softjaw.study.messages import StudyError
from softjaw.study.quantities import NEEDS, quantities
from softjaw.study.scene import Scene, SceneError, parse_scene
from softjaw.study.scene.model import WAYS
from softjaw.study.scene.text import toml_text

FOLDER = Path(__file__).parent
MAPS = {q.name: q for q in quantities(NEEDS) if q.group == "maps"}
WHOLE = {"object": ("shape",), "candidates": tuple(WAYS)}  # keys that make a section replace its base's
CHECKS = {"force_balance": max, "adhesion": max, "penetration": max, "min_det_f": min, "ellipticity": min}
DATA = tomllib.loads((FOLDER / "cases.toml").read_text())
BASES: dict[str, Any] = DATA["base"]
TOLERANCES: dict[str, tuple[float, str]] = {name: (t["value"], t["because"]) for name, t in DATA["tolerance"].items()}


@dataclass(frozen=True)
class Bound:
    """A bound of what is refused: a scene's dotted key, its value in closed form, one that is accepted, one refused."""

    key: str
    value: float
    accepted: Any
    refused: Any


@dataclass(frozen=True)
class Source:
    """Where the second number of a case comes from: another case, this one changed or scaled, a formula, a file.

    ``quantities`` are compared within the tolerance of that name; without another case and a change, ``length`` and
    ``force`` scale the case itself, its moduli by force / length^2.
    """

    kind: str
    what: str
    within: str = "rounding"
    quantities: tuple[str, ...] = ("closing", "e_n", "S")
    case: str = ""
    change: dict[str, Any] = field(default_factory=dict)
    formula: str = ""
    stored: str = ""
    told: float | None = None
    bound: Bound | None = None
    length: float = 1.0
    force: float = 1.0

    @property
    def tolerance(self) -> float:
        return TOLERANCES[self.within][0]

    def factor(self, name: str) -> float:
        """Value of a quantity by the source over that of the case, by its unit."""
        powers = {"N": (0, 1), "m": (1, 0), "m^2": (2, 0), "N m": (1, 1), "Pa": (-2, 1), "": (0, 0)}
        of_length, of_force = powers[MAPS[name].unit]
        return self.length**of_length * self.force**of_force


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
    hard: str = ""
    because: str = ""
    gap: str = ""
    source: Source | None = None
    sections: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Outcome:
    """What a case came to: by row force [N] and message, worst checks over all, maps and their mesh errors."""

    refused: str = ""
    forces: np.ndarray = field(default_factory=lambda: np.zeros(0))
    done: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    messages: tuple[str, ...] = ()
    checks: dict[str, float] = field(default_factory=dict)
    maps: dict[str, np.ndarray] = field(default_factory=dict)
    errors: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def found(self) -> str:
        return "refused" if self.refused else "solved" if self.done.all() else "failed"

    @property
    def text(self) -> str:
        some = self.found == "failed" and self.done.any()
        return f"failed, {self.done.sum()} of {self.done.size} solved" if some else self.found


def _source(given: dict[str, Any]) -> Source:
    bound = {"bound": Bound(**given["bound"])} if "bound" in given else {}
    return Source(**given | bound | {"quantities": tuple(given.get("quantities", Source.quantities))})


def _load() -> dict[str, HardCase]:
    cases = {}
    for given in DATA["case"]:
        own = {key: given[key] for key in HardCase.__dataclass_fields__ if key in given}
        sections = {key: value for key, value in given.items() if key not in own}
        own |= {"source": _source(own["source"])} if "source" in own else {}
        assert given["name"] not in cases, given["name"]
        cases[given["name"]] = HardCase(**own, sections=sections)
    return cases


CASES = _load()


def tables_of(case: HardCase, change: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Tables of a case's scene, with further sections changed."""
    base = BASES.get(case.base) or tomllib.loads((FOLDER / case.base).read_text())
    data: dict[str, Any] = {name: dict(table) for name, table in base.items()}
    for name, table in (*case.sections.items(), *(change or {}).items()):
        whole = any(key in table for key in WHOLE.get(name, ()))
        data[name] = table if whole else {**data.get(name, {}), **table}
    # what is right for a case hangs neither on a second mesh nor on friction that acts back, unless it asks for them
    usual = {"accuracy": {"meshes": 1}, "effects": {"friction_pressure_coupling": "none"}}
    return data | {name: own | data.get(name, {}) for name, own in usual.items()}


def scene_of(case: HardCase, change: Mapping[str, Any] | None = None) -> Scene:
    return parse_scene(toml_text(tables_of(case, change)), FOLDER / f"{case.name}.toml")


@cache
def outcome(name: str) -> Outcome:
    return outcome_of(lambda: scene_of(CASES[name]))


def outcome_of(made_scene: Callable[[], Scene], begin_only: bool = False) -> Outcome:
    """Solve all cases of a scene, or only begin them; whatever it dies of is its outcome."""
    try:
        scene = made_scene()
        check_object(scene)
        made = units(scene)
        check_candidates(scene)
    except SceneError as error:
        told = (f"{p.key}: found {p.value}, expected {p.expected}; {p.remedy}" for p in error.problems)
        return Outcome("\n".join(told))
    except StudyError as error:
        return Outcome(error.message)
    if begin_only:
        return Outcome()
    return _outcome(*zip(*(row for unit in made for row in _rows(unit)), strict=True))


def _rows(unit: Any) -> list[tuple[float, CaseResult | CaseFailure]]:
    forces, found = unit.scene.load.normal_force, []
    try:
        found += [result for _, result in pipeline.solve_unit(unit)]
    except Exception as error:  # as in a run: the rest of the forces fail
        found += [CaseFailure(f"{type(error).__name__}: {error}")] * (len(forces) - len(found))
    return list(zip(forces, found, strict=True))


def _outcome(forces: tuple[float, ...], results: tuple[CaseResult | CaseFailure, ...]) -> Outcome:
    good = [r.values for r in results if isinstance(r, CaseResult)]

    def maps(suffix: str) -> dict[str, np.ndarray]:
        names = [name for name in MAPS if good and f"maps/{name}{suffix}" in good[0]]
        return {name: np.array([np.ravel(v[f"maps/{name}{suffix}"])[0] for v in good]) for name in names}

    checks = {name: worst(x for v in good for x in v[f"checks/{name}"]) for name, worst in CHECKS.items() if good}
    return Outcome(
        "", np.array(forces), np.array([isinstance(r, CaseResult) for r in results]), tuple(r.message for r in results),
        checks, maps(""), maps("_error"),
    )  # fmt: skip
