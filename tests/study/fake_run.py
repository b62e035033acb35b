"""A study whose cases are a formula, to be started under mpirun by the tests: ``fake_run.py FILE [options]``."""

import os

os.environ.update(H5PY_ALWAYS_USE_MPI="1", OMP_NUM_THREADS="1")

import argparse
import itertools
import resource
import signal
import sys
import time
import traceback
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

sys.path.insert(0, str(Path(__file__).parent.parent.parent))

import numpy as np

FACES, FORCES = 6, 3


@dataclass(frozen=True)
class FakeUnit:
    index: int
    rows: Any
    cost: float
    first: int
    apart: bool
    state: int = 0
    reason: str = ""
    finest: tuple = ()


def fake_plan(digest="scene", stations=6, wide=-1, rounds=(), apart=False, shift=0):
    """Stations x two angles x three forces; both angles of an even station are one unit, one of them is too wide."""
    from softjaw.study.quantities import WIDE, Axis, Quantity
    from softjaw.study.result.layout import Header, Layout
    from softjaw.study.run.plan import Plan
    own = np.linspace(0, 0.1, stations).tolist()
    places = sorted([*own, *(1e-3 * mm for added in rounds for mm in added)])
    axes = (
        Axis("station", np.array(places), "m", "station along the object's axis"),
        Axis("angle", np.array([0, np.pi / 2]), "rad", "angle about the object's axis"),
        Axis("normal_force", np.array([1.0, 2.0, 5.0]), "N", "normal force per finger"),
    )
    slope = Quantity("slope", ("station",), "m/N", "slope", "e_n over force", "derived")
    units = []
    for s, place in enumerate(places):
        # Named by what a study without rounds would call it, or by a number far from these.
        name = own.index(place) if place in own else 1000 + round(1e6 * place)
        rows = [tuple(range((2 * s + a) * FORCES, (2 * s + a + 1) * FORCES)) for a in range(2)]
        for a in [(0, 1)] if name % 2 == 0 else [(0,), (1,)]:
            served, first = tuple(rows[i] for i in a), (2 * name + a[0]) * FORCES + shift
            no_grasp = (WIDE, "needs more") if len(units) == wide else ()
            units.append(FakeUnit(len(units), served, float(1 + name % 3), first, apart, *no_grasp))
    labels = tuple(f"candidate {i}" for i in range(2 * len(places)))
    header = Header(digest, "a = 1\n", "fake", "fake.toml", labels=labels)
    return Plan(Layout(axes, FACES, derived=(slope,), rounds=rounds), header, tuple(units))


def fake_growth(digest, stations, work):
    """The work with rounds of further stations until a budget is spent, by the rule of a real study."""
    from softjaw.study.run.refine import next_stations
    given = (1e3 * np.linspace(0, 0.1, stations)).tolist()
    asked = SimpleNamespace(refine=36, station_values_mm=given)
    scene = SimpleNamespace(candidates=asked, accuracy=SimpleNamespace(refined_within=0.01))
    work = work._replace(
        more=lambda result: next_stations(result, scene, 2 * FORCES),
        grown=lambda rounds: (fake_plan(digest, stations, rounds=rounds), work),
    )
    return work


def fake_result(row):
    from softjaw.study.case.result import CaseResult
    random = np.random.default_rng(row)
    values = {f"maps/{name}": random.random(3) for name in ("payload", "e_n", "f_x_max", "tau_z_max", "quality")}
    values |= {"maps/S": random.random(), "fingers/f_x_max": random.random((2, 3)), "checks/adhesion": random.random(2)}
    values |= {"work/seconds_assembly": 1e-3, "fingers/pose_rotation": random.random((2, 3, 3))}
    patch = {"pressure": random.random((2, FACES)), "normal": random.random((2, FACES, 3))}
    return CaseResult(values, patch, "a note" if row % 7 == 3 else "", {"sheet": ("elastic plate", 0.5, 1)})


def fake_path(options):
    """The injected solver; rows are named by the first candidate that a unit serves."""
    from softjaw.study.case.result import CaseFailure

    def solve_unit(unit, wanted):
        for k in wanted if unit.apart else range(FORCES):
            row = unit.first + k
            deadline = time.monotonic() + (60.0 if row == options.hang else options.delay)
            while time.monotonic() < deadline:
                time.sleep(0.002)
            if row == options.stuck:
                all(itertools.repeat(True))  # never comes back, and hears no signal
            if row == options.greedy:
                held = [np.empty(10**7) for _ in range(10**4)]  # 800 GB
                del held
            if row == options.unplug:  # what a quota or a lost disk answers from now on
                resource.setrlimit(resource.RLIMIT_FSIZE, (4096, resource.RLIM_INFINITY))
            if row == options.remove:
                options.file.unlink()
            if row == options.kill:
                os.kill(os.getpid(), signal.SIGKILL)
            if row == options.raises:
                raise ArithmeticError("the contact solve diverged")
            yield k, CaseFailure("no contact at this force") if row == options.fail else fake_result(row)

    return solve_unit


def finalise(writer):
    e_n = writer.read("e_n/ccm")
    writer.write_derived("slope", (e_n[:, 0, -1] - e_n[:, 0, 0]) / 4.0)


def main(arguments=None):
    parser = argparse.ArgumentParser()
    parser.add_argument("file", type=Path)
    values = {"digest": "scene", "delay": 0.0, "file-limit": 0, "limit": 600.0, "memory": 0.5, "stations": 6}
    for name, value in values.items():
        parser.add_argument(f"--{name}", type=type(value), default=value)
    for name in ("retry-failed", "grow", "apart"):  # apart: forces that do not depend on each other
        parser.add_argument(f"--{name}", action="store_true")
    for name in ("fail", "raises", "kill", "hang", "stuck", "greedy", "unplug", "remove", "bug", "wide"):
        parser.add_argument(f"--{name}", type=int, default=-1)
    options = parser.parse_args(arguments)
    from mpi4py import MPI

    from softjaw.study.messages import StudyError, complain
    from softjaw.study.run.session import Work, run_study
    from softjaw.study.show.best_grasps import summary
    comm = MPI.COMM_WORLD
    if options.file_limit:
        resource.setrlimit(resource.RLIMIT_FSIZE, (options.file_limit, options.file_limit))
    image = None
    if options.bug >= 0:  # outside of a case: the run itself is broken

        def image(result, unit, c):
            return 1 / (unit.index - options.bug) and result

    work = Work(fake_path(options), image, finalise, summary, options.limit, options.memory)
    work = fake_growth(options.digest, options.stations, work) if options.grow else work
    try:
        plan = fake_plan(options.digest, options.stations, wide=options.wide, apart=options.apart)
        return run_study(plan, work, options.file, comm, retry_failed=options.retry_failed)
    except StudyError as error:
        return complain(error)
    except BaseException:
        traceback.print_exc()
        comm.Abort(70)


if __name__ == "__main__":
    sys.exit(main())
