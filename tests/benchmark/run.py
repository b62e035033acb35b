"""Print what the program costs where (``make bench``): figures of one run on one machine, not timed tests."""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ["H5PY_ALWAYS_USE_MPI"] = "1"  # as study.commands.run does

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fem import kernel
from fem.materials import material
from fem.objects import EllipticCylinder
from fem.pad import Pad, PadShape
from fem.pose import Pose
from fem.press import Press
from friction.frame import contact_frame
from friction.motion import cor_grid
from friction.wrench import friction_limits, friction_wrench
from scoring.score import score
from study.environment import launch_environment, mpirun
from study.model import approach
from tests.generators import cylinder_grid

ROOT = Path(__file__).parents[2]
SIZE = (0.060, 0.030, 0.015)  # pad [m]
FOAMS = (
    material("blatz_ko", 20e3),
    material("hyperfoam", shear_moduli=[20e3], exponents=[-2.0]),
    material("neo_hookean", 20e3, 0.4),
    material("linear", 20e3, 0.3),
)


def fastest(work: Callable[[], object], seconds: float = 1.0) -> float:
    """Shortest of the times that ``work`` takes when it is repeated for so long [s]."""
    work()
    times, end = [], time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < 3:
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def line(what: str, figure: str, goal: str = "") -> None:
    """One line of the table."""
    print(f"{what:<66} {figure:>16}   {goal}", flush=True)


def element_routine() -> None:
    """Residual and tangent of one hexahedron."""
    for element, elements in (("hex8", (24, 12, 6)), ("hex27", (12, 6, 3))):
        pad = Pad(PadShape(SIZE, elements, element=element), FOAMS[0])
        n, nodes = pad.element_nodes.shape
        u = 1e-4 * np.random.default_rng(0).standard_normal((n, 3, nodes))
        r, K = np.empty((n, 3, nodes)), np.empty((n, 3, nodes, 3, nodes))
        for foam in FOAMS:

            def both(foam=foam, u=u, pad=pad, r=r, K=K) -> None:
                kernel.elements(foam.number, foam.parameters, u, pad.dN, pad.volume, r, K)

            goal = "goal: at most 20" if element == "hex8" else ""
            line(f"residual and tangent of a {element}, {foam.law}", f"{fastest(both) / n * 1e6:.1f} us", goal)


def contact_solve() -> None:
    """Share of a contact solve that is neither factorisation nor its triangular solves."""
    cylinder = EllipticCylinder(0.025, 0.025, 0.2)
    pose = Pose(np.array([[0, 0, -1.0], [0, 1, 0], [1, 0, 0]]), np.array([-1.0, 0, 0]))
    finger = approach(cylinder, pose, SIZE)
    for elements, forces, goal in (((24, 12, 6), (3.0, 10.0, 30.0), 40), ((48, 24, 12), (3.0,), 25)):
        press = Press(Pad(PadShape(SIZE, elements), FOAMS[0]), finger.gap)
        states = list(press.ladder(forces))
        total, factor, assembly = (
            sum(getattr(s.seconds, k) for s in states) for k in ("total", "factorisation", "assembly")
        )
        name = "x".join(map(str, elements))
        line(
            f"contact solve {name}, {press.problem.size} unknowns, {sum(s.iterations for s in states)} iterations",
            f"{total:.2f} s",
        )
        line("  assembly", f"{100 * assembly / total:.1f} %")
        line("  everything that is not factorisation", f"{100 * (1 - factor / total):.1f} %", f"goal: at most {goal} %")
        press.destroy()


def friction() -> None:
    """Friction kernel, contact frame and score."""
    patch = cylinder_grid(0.03, 0.6, 0.05, 48, 50)
    n, m = len(patch.area), 441
    twists = cor_grid(21, 0.05)
    seconds = fastest(lambda: friction_wrench(patch, twists, 0.8))
    line(f"COR sweep, {n} faces x {m} motions", f"{n * m / seconds / 1e6:.0f} M pairs/s", "goal: at least 200")
    line("three exact maxima", f"{fastest(lambda: friction_limits(patch, 0.8)) * 1e3:.2f} ms")
    line("contact frame", f"{fastest(lambda: contact_frame(patch, [1.0, 0, 0])) * 1e3:.2f} ms")
    one, two = (0.8, 0.7, 0.012), (0.8, 0.75, 0.011)
    line(
        "antipodal score with both epsilons",
        f"{fastest(lambda: score(one, two, 0.06, 0.2, 0.05), 0.2) * 1e6:.1f} us",
        "goal: at most 50",
    )


def whole_map(scene: Path, folder: Path) -> None:
    """A whole map on one rank and on two, and what writing costs."""
    softjaw = [sys.executable, "-m", "study", "run", str(scene), "-o"]
    seconds = {}
    for ranks in (1, 2):
        command = mpirun(ranks)
        start = time.perf_counter()
        subprocess.run(
            [*command, *softjaw, str(folder / f"{ranks}.hdf")],
            check=True,
            cwd=ROOT,
            env=launch_environment(),
            stdout=subprocess.DEVNULL,
        )
        seconds[ranks] = time.perf_counter() - start
        line(f"{scene.stem} on {ranks} rank{'s' * (ranks > 1)}", f"{seconds[ranks]:.1f} s")
    line("time on 2 ranks over time on 1", f"{seconds[2] / seconds[1]:.3f}", "goal: at most 0.55")
    line("writing", f"{100 * writing_share(scene, folder):.2f} %", "goal: at most 2 % of a run")


def writing_share(scene: Path, folder: Path) -> float:
    """Share of a one-rank run that goes into creating and writing the file."""
    from mpi4py import MPI

    from study import pipeline, run, store
    from study.plan import make_plan
    from study.scene import load_scene

    spent = [0.0]

    def timed(work):
        def wrapped(*arguments, **options):
            start = time.perf_counter()
            try:
                return work(*arguments, **options)
            finally:
                spent[0] += time.perf_counter() - start

        return wrapped

    original = store.ResultWriter._store, store.ResultWriter.count_attempt, run.create
    store.ResultWriter._store, store.ResultWriter.count_attempt, run.create = map(timed, original)
    try:
        loaded, start = load_scene(scene), time.perf_counter()
        work = run.Work(pipeline.solve_unit, pipeline.image)
        run.run_study(make_plan(loaded, str(scene)), work, folder / "writing.hdf", MPI.COMM_SELF)
        return spent[0] / (time.perf_counter() - start)
    finally:
        store.ResultWriter._store, store.ResultWriter.count_attempt, run.create = original


def main() -> None:
    """Run all, or those named on the command line."""
    parts = {"element": element_routine, "friction": friction, "contact": contact_solve}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("part", nargs="*", choices=[*parts, "map", []], help="default: all")
    parser.add_argument("--scene", type=Path, default=ROOT / "jobs" / "bottle-rigid.toml", help="scene of the map")
    options = parser.parse_args()
    for name, part in parts.items():
        if not options.part or name in options.part:
            part()
    if not options.part or "map" in options.part:
        folder = Path(tempfile.mkdtemp())
        try:
            whole_map(options.scene, folder)
        finally:
            shutil.rmtree(folder)


if __name__ == "__main__":
    main()
