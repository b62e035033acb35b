"""A dozen meshes of the kinds that users bring (``make bench PARTS=users``): CPU seconds per case on two meshes."""

import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh
from trimesh.creation import annulus, box, capsule, cylinder, icosphere

from softjaw.study.result.store import open_result
from tests.benchmark.table import line, title
from tests.objects.bad_meshes import SHAPES, hammer, low_poly
from tests.objects.bodies import hollow_bottle, mug, scan
from tests.study.launching import children_seconds


def rock() -> trimesh.Trimesh:
    ball = icosphere(3, 0.032)
    x, y, z = ball.vertices.T / 0.032
    ball.vertices *= (1.0 + 0.06 * np.sin(3 * x + 1) * np.cos(2 * y) + 0.05 * np.sin(4 * z + y))[:, None]
    return ball


MESHES: dict[str, Callable[[], trimesh.Trimesh]] = {
    "brick": lambda: box((0.05, 0.04, 0.09)), "hexagonal bar": lambda: cylinder(0.022, 0.1, sections=6),
    "capsule": lambda: capsule(0.09, 0.02, count=(16, 16)), "low-poly ball": lambda: icosphere(2, 0.03),
    "tube": lambda: annulus(0.018, 0.026, 0.08, sections=40), "bracket": SHAPES["L"], "hammer": hammer,
    "screwdriver": low_poly()["screwdriver"], "mug": mug, "bottle": lambda: hollow_bottle(0.18, 0.032, 0.013, 0.003),
    "rock": rock, "mustard bottle": lambda: scan("mustard"),
}  # fmt: skip


def every_mesh() -> None:
    """Each from file to map as `softjaw init` writes its scene, start-up included."""
    title("Meshes of users, CPU seconds a case")
    figures = []
    with tempfile.TemporaryDirectory() as folder:
        for name, make in MESHES.items():
            mesh = Path(folder) / f"{name.replace(' ', '-')}.stl"
            make().export(mesh)
            scene, result = mesh.with_suffix(".toml"), mesh.with_suffix(".hdf")
            _softjaw("init", "mesh", "--mesh", mesh, "--unit", "m", "-o", scene)
            before = children_seconds()
            _softjaw("run", scene, "-o", result)
            spent = children_seconds() - before
            with open_result(result) as file:
                cases = file.codes.size
            figures.append(spent / cases)
            line(f"{name}, {cases} cases", f"{figures[-1]:.2f} s", "at most 0.7 s")
    line("mean", f"{np.mean(figures):.2f} s", "at most 0.35 s")


def _softjaw(*words: object) -> None:
    # 6: some cases failed, which are results
    command = [sys.executable, "-m", "softjaw", *map(str, words)]
    if (code := subprocess.run(command, stdout=subprocess.DEVNULL).returncode) not in (0, 6):
        raise RuntimeError(f"{' '.join(command)} ended with exit code {code}")
