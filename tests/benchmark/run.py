"""Print what the program costs where (``make bench``): figures of one run on one machine, not timed tests."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["H5PY_ALWAYS_USE_MPI"] = "1"  # as study.cli does

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from softjaw.fem import materials as element_kernel
from softjaw.fem.contact.press import Press
from softjaw.fem.materials import material
from softjaw.fem.objects.shapes import EllipticCylinder
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.pad.shape import PadShape
from softjaw.study.doctor import launch_environment
from tests.benchmark import kernels, other_code, users
from tests.benchmark.table import fastest, line, title
from tests.fem import reference

ROOT = Path(__file__).parents[2]
SIZE = (0.060, 0.030, 0.015)  # pad [m]
FOAMS = (
    material("blatz_ko", 20e3), material("hyperfoam", shear_moduli=[20e3], exponents=[-2.0]),
    material("neo_hookean", 20e3, 0.4), material("linear", 20e3, 0.3),
)  # fmt: skip


def element_routine() -> None:
    title("Finite elements")
    for element, elements in (("hex8", (24, 12, 6)), ("hex27", (12, 6, 3))):
        pad = Pad(PadShape(SIZE, elements, element=element), FOAMS[0])
        n, nodes = pad.element_nodes.shape
        u = 1e-4 * np.random.default_rng(0).standard_normal((n, 3, nodes))
        r, K = np.empty((n, 3, nodes)), np.empty((n, 3, nodes, 3, nodes))
        for foam in FOAMS:

            def both(foam=foam, u=u, pad=pad, r=r, K=K) -> None:
                element_kernel.elements(foam.number, foam.parameters, u, pad.dN, pad.volume, r, K)

            goal = "at most 20 us" if element == "hex8" else ""
            line(f"residual and tangent of a {element}, {foam.law}", f"{fastest(both) / n * 1e6:.1f} us", goal)


def contact_solve() -> None:
    """Share of a contact solve that is neither factorisation nor its triangular solves."""
    title("Contact solve")
    gap = reference.placed(EllipticCylinder(0.025, 0.025, 0.2), reference.facing(0.025))
    for elements, forces, goal in (((24, 12, 6), (3.0, 10.0, 30.0), 40), ((48, 24, 12), (3.0,), 25)):
        press = Press(Pad(PadShape(SIZE, elements), FOAMS[0]), gap)
        start = time.perf_counter()
        states = list(press.load_path(forces))
        total, spent = time.perf_counter() - start, press.solver.seconds
        name, size, count = "x".join(map(str, elements)), press.problem.size, sum(s.work.iterations for s in states)
        line(f"contact solve {name}, {size} unknowns, {count} iterations", f"{total:.2f} s")
        line("  assembly", f"{100 * spent.assembly / total:.1f} %")
        rest = 1 - spent.factorisation / total
        line("  everything that is not factorisation", f"{100 * rest:.1f} %", f"at most {goal} %")
        press.destroy()


def whole_map(scene: Path) -> None:
    title(f"Map of {scene.stem}")
    seconds = {}
    with tempfile.TemporaryDirectory() as folder:
        for ranks in (1, 2):
            result = str(Path(folder) / f"{ranks}.hdf")
            words = ["mpirun", "-n", str(ranks), sys.executable, "-m", "softjaw", "run", str(scene), "-o", result]
            start = time.perf_counter()
            subprocess.run(words, check=True, cwd=ROOT, env=launch_environment(), stdout=subprocess.DEVNULL)
            seconds[ranks] = time.perf_counter() - start
            line(f"{scene.stem} on {ranks} rank{'s' * (ranks > 1)}", f"{seconds[ranks]:.1f} s")
    line("time on 2 ranks over time on 1", f"{seconds[2] / seconds[1]:.3f}", "at most 0.55")


def main() -> None:
    parts = {
        "kernels": kernels.every_kernel, "element": element_routine, "contact": contact_solve,
        "getfem": other_code.compare, "map": lambda: whole_map(options.scene), "users": users.every_mesh,
    }  # fmt: skip
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", nargs="*", choices=[*parts, []], help="default: all")
    parser.add_argument("--scene", type=Path, default=ROOT / "jobs" / "bottle-rigid.toml", help="scene of the map")
    options = parser.parse_args()
    for name, part in parts.items():
        if not options.part or name in options.part:
            part()


if __name__ == "__main__":
    main()
