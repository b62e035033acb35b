"""How often stated errors cover the truth: random scenes on the default mesh against meshes finer in every direction.

``python -m tests.objects.coverage SEED FIRST LAST > rows.csv`` (scenes FIRST to LAST - 1 of a seed), then
``... --table rows.csv``. A row is a quantity of a case: family, friction acting back or not, true and stated relative
error. A reference has twice the elements in each direction, those of a thin wall included, and its own load path in
half the steps.
"""

import csv
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from unittest import mock

import numpy as np

from softjaw.fem.contact import friction
from softjaw.study import pipeline
from softjaw.study.case.candidates import units
from softjaw.study.case.effects import COUPLING
from softjaw.study.case.result import CaseFailure, CaseResult
from softjaw.study.scene import Scene
from tests.objects import random_scenes as made

QUANTITIES = ("payload", "quality", "e_n", "f_x_max", "tau_z_max", "closing", "contact_area", "p_max")
SHAPES = {"revolution": (made.outline, made.cone, made.ball), "box": (made.box,),
          "cylinder": (made.ellipse, made.superellipse, made.stacked)}  # fmt: skip
FAMILIES = ("revolution", "cylinder", "box", "mesh", "thin wall")
ROOT = Path(__file__).resolve().parents[2]
HEADER = ("scene", "family", "friction", "force", "quantity", "true", "stated")


def scene_tables(seed: int, k: int) -> tuple[str, dict]:
    """Family and tables of the ``k``-th scene of a seed: one grasp at one force on a small mesh."""
    family, rng = FAMILIES[k % len(FAMILIES)], np.random.default_rng([seed, k, 31])
    pads = made.gripper(rng) | {"elements": [int(2 * rng.integers(4, 6)), 6, 3]}
    tables = {
        "gripper": pads, "friction": {"mu": made.number(rng.uniform(0.15, 1.1))}, "accuracy": {"meshes": 2},
        "limit_surface": {"model": "three_motions"}, "run": {"patches": "none"},
    }  # fmt: skip
    force = made.forces(rng, pads)[int(rng.integers(0, 3))]
    if family == "mesh":
        name, low, high = (("flask", 35, 85), ("mug", 30, 80))[rng.integers(0, 2)]
        mesh = str(ROOT / "jobs" / "objects" / f"{name}.stl")
        tables["object"] = {"shape": "mesh", "mesh": mesh, "unit": "mm", "axis": "z"}
        place = {"stations_mm": [made.number(rng.uniform(low, high))], "angles_deg": [made.number(rng.uniform(0, 90))]}
    elif family == "thin wall":
        body = (made.outline, made.cone)[rng.integers(0, 2)](rng)
        tables["object"] = body | {"wall_mm": made.number(rng.uniform(0.4, 1.0))}
        tables["accuracy"]["wall_element_mm"] = 2.0
        place = {"stations_mm": [made.number(body["profile_mm"][-1][0] * rng.uniform(0.3, 0.7))], "angles_deg": [0]}
        force = made.number(min(force, rng.uniform(0.5, 3)))
    else:
        tables["object"] = SHAPES[family][rng.integers(0, len(SHAPES[family]))](rng)
        place = made.places(rng, tables["object"], pads)
    return family, tables | {"candidates": place, "load": {"normal_force_n": [force]}}


def finer(tables: dict) -> dict:
    elements = [2 * n for n in tables["gripper"]["elements"]]
    wall = {key: value / 2 for key, value in tables["accuracy"].items() if key == "wall_element_mm"}
    return tables | {"gripper": tables["gripper"] | {"elements": elements}, "accuracy": {"meshes": 1, **wall}}


def solved(tables: dict, coupling: str) -> CaseResult | CaseFailure:
    scene = Scene.of_tables(tables | {"effects": {"friction_pressure_coupling": coupling}})
    unit = units(scene)[0]
    return dict(pipeline.solve_unit(unit))[0]


def rows(seed: int, k: int) -> Iterator[tuple]:
    """Comparisons of one scene without friction acting back, and with it as `auto` takes it or leaves it out."""
    family, tables = scene_tables(seed, k)
    for wanted, truth in (("none", "none"), ("auto", "tangential")):
        default = solved(tables, wanted)
        with mock.patch.object(friction, "FIRST_FORCE", friction.FIRST_FORCE / 2**friction.POWER):
            reference = solved(finer(tables), truth)
        if isinstance(default, CaseFailure) or isinstance(reference, CaseFailure):
            continue
        acting = "left out" if default.effects[COUPLING].level == "none" else "acting back"
        level = "off" if wanted == "none" else acting
        for name in QUANTITIES:
            error = default.values.get(f"maps/{name}_error", np.nan)
            value, true = (float(np.ravel(each.values[f"maps/{name}"])[0]) for each in (default, reference))
            if value:
                force = tables["load"]["normal_force_n"][0]
                yield f"{seed}/{k}", family, level, force, name, abs(true / value - 1.0), error


def table(lines: list[dict[str, str]], by: str = "friction") -> str:
    groups: dict[tuple[str, str], list[tuple[float, float]]] = defaultdict(list)
    for line in lines:
        groups[line[by], line["quantity"]].append((float(line["true"]), float(line["stated"])))
    text = [f"| {by} | " + " | ".join(QUANTITIES) + " |", "|---" * (len(QUANTITIES) + 1) + "|"]
    for group in dict.fromkeys(line[by] for line in lines):
        cells = []
        for name in QUANTITIES:
            pairs = np.array([p for p in groups[group, name] if np.isfinite(p).all()])
            share = (pairs[:, 0] <= pairs[:, 1]).mean() if len(pairs) else np.nan
            # mean stated over mean true error: single true errors near zero say nothing
            ratio = pairs[:, 1].mean() / pairs[:, 0].mean() if len(pairs) else np.nan
            cells.append(f"{share:.2f} ({ratio:.1f})")
        text.append(f"| {group} ({len(groups[group, 'e_n'])}) | " + " | ".join(cells) + " |")
    return "\n".join(text)


def main(arguments: list[str]) -> None:
    if arguments[0] == "--table":
        lines = [line for path in arguments[1:] for line in csv.DictReader(Path(path).open())]
        print(table(lines), table(lines, "family"), sep="\n\n")
        return
    out, (seed, first, last) = csv.writer(sys.stdout), map(int, arguments)
    out.writerow(HEADER)
    for k in range(first, last):
        try:
            out.writerows(rows(seed, k))
        except (ValueError, RuntimeError) as error:  # a scene that has no grasp
            print(f"{seed}/{k}: {error}", file=sys.stderr)
        sys.stdout.flush()


if __name__ == "__main__":
    main(sys.argv[1:])
