"""Which thin walls bear which force: thickness x modulus x force, as a table with the CPU time of every load path.

    python jobs/thin-walls.py jobs/cup.toml 54 > table.md               the cup at 54 mm (2 minutes)
    python jobs/thin-walls.py jobs/bottle.toml 112 --angle 90           the bottle where it is widest (5 minutes)

Meshes are coarse: the table is about what is solved and where walls give way, not about the last percent of a value.
"""

from __future__ import annotations

import argparse
import time
from itertools import product
from pathlib import Path

from softjaw.study import pipeline
from softjaw.study.case.candidates import units
from softjaw.study.case.result import CaseFailure
from softjaw.study.flags import flag_words
from softjaw.study.scene import load_scene

COARSE = (
    "accuracy.meshes=1", "accuracy.wall_element_mm=2.5",
    "gripper.elements=[12, 6, 4]", 'effects.object="nonlinear_shell"', 'object.wall_material="custom"',
    "object.wall_poisson_ratio=0.38",
)  # fmt: skip


def row(scene: str, station: float, angle: float, thickness: float, modulus: float, forces: list[float]) -> list[str]:
    """Thickness [mm], modulus [GPa], for each force the closing displacement [mm] and flags, and CPU seconds."""
    held = f"candidates.stations_mm=[{station}]", f"candidates.angles_deg=[{angle}]", f"load.normal_force_n={forces}"
    # a wall of a varying thickness becomes one of the same thickness everywhere
    even = "wall_mm" not in Path(scene).read_text(encoding="utf-8")
    wall = f"wall_mm={thickness}" if even else f"wall_mm=[[0, {thickness}], [100, {thickness}]]"
    point = load_scene(scene, [*COARSE, *held, f"object.{wall}", f"object.young_modulus_gpa={modulus}"])
    unit = next(iter(units(point)))
    start, cells = time.process_time(), []
    for _, case in pipeline.solve_unit(unit):
        if isinstance(case, CaseFailure):
            cells.append(case.message.split(" (")[0])
            break
        values = case.values
        cells.append(f"{1e3 * values['maps/closing']:.2f} {flag_words(int(values['maps/flags']))}".strip())
    cells += [""] * (len(forces) - len(cells))
    return [f"{thickness:g}", f"{modulus:g}", *cells, f"{time.process_time() - start:.1f}"]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene")
    parser.add_argument("station", type=float)
    parser.add_argument("--angle", type=float, default=0.0)
    parser.add_argument("--thickness", type=float, nargs="+", default=[0.2, 0.3, 0.4, 0.6])
    parser.add_argument("--modulus", type=float, nargs="+", default=[0.5, 1.0, 2.0])
    parser.add_argument("--forces", type=float, nargs="+", default=[1.0, 3.0, 5.0, 8.0, 10.0])
    wanted = parser.parse_args()
    head = ["wall [mm]", "E [GPa]", *(f"{force:g} N" for force in wanted.forces), "CPU [s]"]
    print("|", " | ".join(head), "|", flush=True)
    print("|" + "---|" * len(head), flush=True)
    for thickness, modulus in product(wanted.thickness, wanted.modulus):
        cells = row(wanted.scene, wanted.station, wanted.angle, thickness, modulus, wanted.forces)
        print("|", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
