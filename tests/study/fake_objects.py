"""Objects whose cases are a formula, to be started under mpirun: ``fake_objects.py SCENE OUT [options]``.

``none`` has no grasp, ``bug`` fails while it is planned and ``late`` when it is finished, ``grows`` gets more stations.
"""

import os

os.environ.update(H5PY_ALWAYS_USE_MPI="1", OMP_NUM_THREADS="1")

import argparse
import signal
import sys
import time
from pathlib import Path
from types import SimpleNamespace

sys.path.insert(0, str(Path(__file__).parent.parent.parent))

from tests.study import fake_run


def plan_of(name, rounds=()):
    return fake_run.fake_plan(name, 2 + len(name), rounds=rounds, apart=True, shift=1000 * len(name))


def study(scene, _overrides):
    from softjaw.study.messages import USAGE, NoGraspError
    from softjaw.study.run.session import Work
    name = scene.object.name
    if name == "none":
        raise NoGraspError(USAGE, "nothing fits")
    work = Work(lambda *_: (), finalise=(lambda _: 1 / 0) if name == "late" else fake_run.finalise)
    more = fake_run.fake_growth(name, 2 + len(name), work).more if name == "grows" else lambda _: ()
    work = work._replace(more=more, grown=lambda rounds: (plan_of(name, rounds), work))
    return plan_of(name if name != "bug" else 1 / 0), work


def main(arguments=None):
    parser = argparse.ArgumentParser()
    parser.add_argument("scene")
    parser.add_argument("out", type=Path)
    for name in ("kill-after", "stop-after"):
        parser.add_argument(f"--{name}", type=int, default=-1)  # cases of this rank
    parser.add_argument("--retry-failed", action="store_true")
    parser.add_argument("--fail", type=int, default=7001)
    parser.add_argument("--delay", type=float, default=0.0)
    options = parser.parse_args(arguments)
    from mpi4py import MPI

    from softjaw.study.messages import StudyError, complain
    from softjaw.study.run.object_folder import folder_of
    from softjaw.study.run.objects import run_objects
    from softjaw.study.run.session import Work
    solved = 0
    nothing = SimpleNamespace(hang=-1, stuck=-1, greedy=-1, unplug=-1, remove=-1, kill=-1, raises=-1, fail=options.fail)
    cases = fake_run.fake_path(SimpleNamespace(**vars(nothing), delay=options.delay))

    def solve_unit(unit, wanted):
        nonlocal solved
        for case in cases(unit, wanted):
            solved += 1
            if solved == options.kill_after:
                os.kill(os.getpid(), signal.SIGKILL)
            if solved == options.stop_after:
                os.kill(os.getpid(), signal.SIGUSR1)
                time.sleep(0.01)
            yield case

    try:
        folder = folder_of(options.scene, [])
        work = Work(solve_unit, time_limit=600.0)
        return run_objects(folder, options.out, study, work, MPI.COMM_WORLD, retry_failed=options.retry_failed)
    except StudyError as error:
        return complain(error)


if __name__ == "__main__":
    sys.exit(main())
