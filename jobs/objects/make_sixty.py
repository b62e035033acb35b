"""Sixty meshes of common forms for a run over a folder: ``python jobs/objects/make_sixty.py meshes``.

Twelve kinds in five sizes. Four of the objects have no answer, and the index of the run says why: a plate and a block
that are wider than a gripper opens, a file without triangles and one that is cut off. ``objects.csv`` beside the meshes
names each with its unit; those whose name ends in ``-cm`` are in centimetres.
"""

from __future__ import annotations

import csv
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import trimesh
from trimesh.creation import annulus, box, capsule, cone, cylinder, icosphere, revolve, torus

SIZES = (0.8, 0.9, 1.0, 1.15, 1.3)
BOTTLE = [(0, 0), (26, 0), (30, 4), (30, 90), (14, 115), (14, 130), (0, 130)]  # radius and height [mm]
SPINDLE = [(0, 0), (12, 0), (22, 25), (10, 50), (22, 75), (12, 100), (0, 100)]


def turned(outline: Sequence[tuple[float, float]]) -> trimesh.Trimesh:
    """A body of revolution [m]."""
    return revolve(1e-3 * np.array(outline), sections=40)


def brick() -> trimesh.Trimesh:
    """A block with a knob on it, as two bodies that overlap [m]."""
    knob = cylinder(0.012, 0.05, sections=24)
    knob.apply_translation([0, 0, 0.05])
    return trimesh.util.concatenate([box((0.05, 0.07, 0.06)), knob])


KINDS: dict[str, Callable[[], trimesh.Trimesh]] = {
    "block": lambda: box((0.04, 0.06, 0.1)),
    "cube": lambda: box((0.05, 0.05, 0.05)),
    "rod": lambda: cylinder(0.015, 0.12, sections=32),
    "can": lambda: cylinder(0.03, 0.1, sections=40),
    "ball": lambda: icosphere(subdivisions=3, radius=0.03),
    "capsule": lambda: capsule(height=0.06, radius=0.018),
    "ring": lambda: torus(0.03, 0.011, major_sections=40, minor_sections=20),
    "cone": lambda: cone(0.03, 0.09, sections=40),
    "tube": lambda: annulus(0.02, 0.028, 0.08, sections=40),
    "bottle": lambda: turned(BOTTLE),
    "spindle": lambda: turned(SPINDLE),
    "knob": brick,
}


def main(folder: Path) -> None:
    """Write the meshes and ``objects.csv``."""
    folder.mkdir(parents=True, exist_ok=True)
    lines = [("mesh", "unit", "mass_g")]
    for kind, make in KINDS.items():
        for i, size in enumerate(SIZES):
            unit, scale = ("cm", 100.0) if i == 4 else ("m", 1.0)
            mesh, name = make(), f"{kind}-{i + 1}{'-cm' * (unit == 'cm')}.stl"
            mesh.apply_scale(size)
            mass = 1e3 * 200.0 * abs(mesh.volume)  # of a light body of 200 kg/m^3 [g]
            mesh.apply_scale(scale)
            mesh.export(folder / name)
            lines.append((name, unit, f"{mass:.4g}"))
    box((0.2, 0.2, 0.12)).export(folder / "block-4.stl")
    box((0.25, 0.12, 0.25)).export(folder / "cube-4.stl")
    (folder / "rod-4.stl").write_bytes((folder / "rod-3.stl").read_bytes()[:1000])
    (folder / "can-4.stl").write_text("solid can\nendsolid can\n")
    with (folder / "objects.csv").open("w", newline="", encoding="utf-8") as file:
        csv.writer(file).writerows(lines)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
