"""What it saves to make steps with older factors (``fem.petsc.NonlinearSolver``), beside how far that moves e_n."""

from __future__ import annotations

import time
from pathlib import Path
from unittest.mock import patch

import numpy as np

from softjaw.fem.contact.rigid import RigidProblem
from softjaw.fem.petsc import PETSc
from softjaw.fem.shell.wall_problem import WallProblem
from softjaw.study import pipeline
from softjaw.study.run.plan import make_plan
from softjaw.study.scene import load_scene
from tests.benchmark.table import line, title

REPEATS = 3
PLACES = (("bottle-rigid", "stations_mm=[30,60,100,130,145]"), ("bottle", "stations_mm=[60,140]"))


def kept_factors(jobs: Path) -> None:
    """CPU time of a few candidates of both maps, with and without older factors in turn; the least of each."""
    title("Steps with older factors")
    for name, stations in PLACES:
        path = jobs / f"{name}.toml"
        plan = make_plan(load_scene(path, [f"candidates.{stations}"]), str(path))
        _solve(plan)  # compiles
        runs = [(_solve(plan), _without(plan)) for _ in range(REPEATS)]
        (kept, n, e_n), (new, m, e_n_new) = (min(side, key=lambda run: run[0]) for side in zip(*runs, strict=True))
        line(f"{name}, {len(e_n)} cases, every step with new factors", f"{new / len(e_n):.3f} s/case")
        line("  with older ones near solutions", f"{kept / len(e_n):.3f} s/case")
        line("  ratio of CPU time, and of factorisations", f"{kept / new:.2f}, {n / m:.2f}")
        line("  largest relative change of e_n", f"{np.abs(e_n / e_n_new - 1.0).max():.0e}", "at most 1e-8")


def _without(plan) -> tuple[float, int, np.ndarray]:
    def never(self, x, first) -> bool:
        return False

    with patch.object(RigidProblem, "keep", never), patch.object(WallProblem, "keep", never):
        return _solve(plan)


def _solve(plan) -> tuple[float, int, np.ndarray]:
    """CPU time [s], factorisations and e_n of all cases; one that fails has NaN."""
    start, before = time.process_time(), _factorisations()
    cases = [result for unit in plan.units for _, result in pipeline.solve_unit(unit)]
    spent = time.process_time() - start, _factorisations() - before
    e_n = [np.ravel(case.values["maps/e_n"])[0] if hasattr(case, "values") else np.nan for case in cases]
    return *spent, np.array(e_n)


def _factorisations() -> int:
    return sum(PETSc.Log.Event(f"Mat{kind}Num").getPerfInfo()["count"] for kind in ("LUFactor", "CholFctr"))
