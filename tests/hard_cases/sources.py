"""The second number of a hard case: another model, a scaled scene, a formula, another code's file, a bound."""

import json
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

import numpy as np

from softjaw.fem.shell.wall_material import MATERIALS
from softjaw.study.scene import Scene, parse_scene
from softjaw.study.scene.text import toml_text
from softjaw.study.units import split_unit
from tests.friction.closed_forms import mean_distance
from tests.hard_cases.hard_case import CASES, FOLDER, HardCase, Outcome, outcome, outcome_of, scene_of, tables_of


def pressed_column(scene: Scene) -> dict[str, np.ndarray]:
    """Closing displacement and e_n of a neo-Hookean pad with Poisson's ratio 0 between plates."""
    g = scene.gripper
    p = np.array(scene.load.normal_force) / (g.pad_length * g.pad_width * g.shear_modulus)
    stretch = (np.sqrt(p**2 + 4.0) - p) / 2.0
    return {"closing": g.pad_thickness * (1.0 - stretch)} | uniform_pressure(scene)


def uniform_pressure(scene: Scene) -> dict[str, np.ndarray]:
    """e_n of a uniform pressure on a rectangle: the mean distance from its centre."""
    mean = mean_distance(scene.gripper.pad_length, scene.gripper.pad_width)
    return {"e_n": np.full(len(scene.load.normal_force), mean)}


def frictionless(scene: Scene) -> dict[str, np.ndarray]:
    n = len(scene.load.normal_force)
    return {name: np.zeros(n) for name in ("f_x_max", "f_y_max", "tau_z_max")}


FORMULAS: dict[str, Callable[[Scene], dict[str, np.ndarray]]] = {
    "pressed column": pressed_column, "uniform pressure": uniform_pressure, "frictionless": frictionless,
}  # fmt: skip
POWERS = {  # of a length and of a force, by the suffix of a scene's key; other units do not scale
    "mm": (1, 0), "n": (0, 1), "kpa": (-2, 1), "mpa": (-2, 1), "gpa": (-2, 1), "n_per_mm": (-1, 1),
}  # fmt: skip


@cache
def second(name: str) -> Outcome | None:
    """The outcome of a case by its source; None where the source gives no outcome of forces."""
    case = CASES[name]
    source = case.source
    if source is None or source.bound or source.told is not None or source.kind == "none":
        return None
    if source.case:
        return outcome(source.case)
    if source.formula:
        return _stated(case, FORMULAS[source.formula](scene_of(case)))
    if source.stored:
        return _stated(case, json.loads((FOLDER / source.stored).read_text())["maps"])
    return outcome_of(lambda: scaled(scene_of(case, source.change), source.length, source.force))


def accepts(case: HardCase, value: Any) -> bool:
    data = tables_of(case)
    *way, last = (int(key) if key.isdigit() else key for key in case.source.bound.key.split("."))
    table: Any = data
    for key in way:
        table = table[key]
    kept, table[last] = table[last], value
    text = toml_text(data)
    table[last] = kept
    return not outcome_of(lambda: parse_scene(text, FOLDER / f"{case.name}.toml"), begin_only=True).refused


def _stated(case: HardCase, maps: Mapping[str, Any]) -> Outcome:
    forces = np.array(scene_of(case).load.normal_force)
    values = {name: np.atleast_1d(np.asarray(value, float)) for name, value in maps.items()}
    n = len(next(iter(values.values())))
    return Outcome("", forces[-n:], np.ones(n, bool), ("",) * n, maps=values)


def scaled(scene: Scene, length: float = 1.0, force: float = 1.0) -> Scene:
    """The scene with lengths and forces multiplied, and moduli by ``force / length^2``.

    Without gravity, inertia and a length of its own the problem has no other scale: strains and friction coefficients
    stay, e_n grows as a length, the friction limits as forces and as moments.
    """
    if length == force == 1.0:
        return scene
    data = scene.effective()
    data["object"] = _with_moduli(data["object"])
    return parse_scene(toml_text(_scaled(data, length, force)), FOLDER / "scaled.toml")


def _with_moduli(shape: Mapping[str, Any]) -> dict[str, Any]:
    """An object's table with the constants of its wall's material written out."""
    named = MATERIALS.get(shape.get("wall_material", "").lower())
    if named is None or not shape.get("wall_mm"):
        return dict(shape)
    own = {"young_modulus_gpa": named.young_modulus / 1e9, "wall_poisson_ratio": named.poisson_ratio,
           "yield_strength_mpa": named.yield_strength / 1e6}  # fmt: skip
    return {**own, **shape, "wall_material": "custom"}


def _scaled(value: Any, length: float, force: float, key: str = "") -> Any:
    if isinstance(value, Mapping):
        return {name: _scaled(v, length, force, name) for name, v in value.items()}
    if isinstance(value, list | tuple):
        return [_scaled(v, length, force, key) for v in value]
    unit = split_unit(key)[1]
    if isinstance(value, bool) or not isinstance(value, int | float) or unit not in POWERS:
        return value
    of_length, of_force = POWERS[unit]
    return value * length**of_length * force**of_force
