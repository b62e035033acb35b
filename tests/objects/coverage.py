"""How often stated errors cover the truth: random scenes on the default mesh against meshes finer in every direction.

    python -m tests.objects.coverage SEED FIRST LAST > rows.csv     (scenes FIRST to LAST - 1 of a seed)
    python -m tests.objects.coverage --table rows.csv

A row is a quantity of a case: family, friction acting back or not, true relative error, stated one. A reference has
`FINER` times the elements in each direction and its own load path; thin walls also have smaller elements of the wall.
"""

from __future__ import annotations

import csv
import sys
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from softjaw.study import pipeline
from softjaw.study.case.build import build_object
from softjaw.study.case.candidates import units
from softjaw.study.case.result import CaseFailure
from softjaw.study.quantities import BY_KEY
from softjaw.study.scene import Scene
from tests.objects.random_scenes import number, outline, random_scene

FINER = 1.6
QUANTITIES = ("payload", "quality", "e_n", "f_x_max", "tau_z_max", "closing", "contact_area", "p_max")
FAMILIES = {"outline": "revolution", "cone": "revolution", "ball": "revolution", "ellipse": "cylinder", "box": "box",
            "superellipse": "cylinder", "stacked": "sections", "mesh": "mesh", "wall": "thin wall"}  # fmt: skip
ROOT = Path(__file__).resolve().parents[2]
HEADER = ("scene", "family", "friction", "force", "quantity", "true", "stated")


def scene_tables(seed: int, k: int) -> tuple[str, dict]:
    """Every sixth scene is a mesh from a file, every other sixth a thin wall, the rest are random shapes."""
    kind, tables = random_scene(seed, k)
    tables |= {"accuracy": {"meshes": 2}, "limit_surface": {"model": "three_motions"}}
    rng = np.random.default_rng([seed, k, 1])
    if k % 6 == 4:
        place = {"stations_mm": [number(rng.uniform(35, 85))], "angles_deg": [number(rng.uniform(0, 90))]}
        mesh = {"shape": "mesh", "mesh": str(ROOT / "jobs" / "objects" / "flask.stl"), "unit": "mm", "axis": "z"}
        return "mesh", tables | {"object": mesh, "candidates": place}
    if k % 6 == 5:
        body = outline(rng)
        height = body["profile_mm"][-1][0]
        tables["load"] = {"normal_force_n": [number(rng.uniform(1.0, 3.0))]}
        place = {"stations_mm": [number(height * rng.uniform(0.3, 0.7))], "angles_deg": [0]}
        return "wall", tables | {"object": body | {"wall_mm": number(rng.uniform(0.4, 1.0))}, "candidates": place}
    tables["load"]["normal_force_n"] = tables["load"]["normal_force_n"][1:]
    return kind, tables


def finer(tables: dict) -> dict:
    """The scene with more elements in every direction, even ones along both sides as on the default mesh."""
    elements = [2 * round(FINER * n / 2) for n in tables["gripper"]["elements"][:2]]
    elements.append(int(np.ceil(FINER * tables["gripper"]["elements"][2])))
    accuracy = {"meshes": 1} | ({"wall_element_mm": 1.0} if "wall_mm" in tables["object"] else {})
    return tables | {"gripper": tables["gripper"] | {"elements": elements}, "accuracy": accuracy}


def solved(tables: dict, **effects: str) -> dict:
    """Results of the scene's one candidate by force."""
    scene = Scene.of_tables(tables | {"effects": effects})
    unit = units(scene, lambda point: build_object(point.object).axis_symmetry)[0]
    return dict(pipeline.solve_unit(unit))


def rows(seed: int, k: int) -> Iterator[tuple]:
    """Comparisons of one scene; the reference has friction acting back wherever a user could have it."""
    kind, tables = scene_tables(seed, k)
    default, reference = solved(tables), solved(finer(tables), friction_pressure_coupling="tangential")
    for i, force in enumerate(tables["load"]["normal_force_n"]):
        if isinstance(default[i], CaseFailure) or isinstance(reference[i], CaseFailure):
            continue
        values, truth = default[i].values, reference[i].values
        level = default[i].effects["friction_pressure_coupling"].level
        for name in QUANTITIES:
            error = values.get(f"maps/{name}_error", np.nan)
            value, true = (float(np.ravel(each[f"maps/{name}"])[0]) for each in (values, truth))
            assert BY_KEY[f"maps/{name}"].error == "relative"
            yield f"{seed}/{k}", FAMILIES[kind], level, force, name, abs(true / value - 1.0), error


def table(lines: list[dict[str, str]], by: str = "friction") -> str:
    """Share of cases whose true error is inside the stated one, and the mean ratio, by quantity."""
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
    """See the module."""
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
