"""Commands that solve: the plan of a run, how its cases are solved, and what a run does at its end."""

from __future__ import annotations

import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from mpi4py import MPI

from softjaw.fem.petsc import PETSc, unknown_options
from softjaw.study import pipeline
from softjaw.study.accuracy import cost as costing
from softjaw.study.accuracy.target import settled
from softjaw.study.case.build import check_object, told, with_sampled_grasps
from softjaw.study.case.model import check_poses
from softjaw.study.cli.quick import petsc_overrides, target
from softjaw.study.cli.results import summary
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.result import derived
from softjaw.study.result.read import dataset
from softjaw.study.run.plan import make_plan
from softjaw.study.run.progress import Unbreakable
from softjaw.study.run.refine import Rounds, added_cases, next_round, refined
from softjaw.study.run.session import Growth, Work, on_rank0, run_study
from softjaw.study.scene import Scene
from softjaw.study.show.report.verdict import plain_report


def run(options: Namespace) -> int:
    """Solve a scene; the same exit code on every rank."""
    comm, path = MPI.COMM_WORLD, target(options, options.scene_read)
    # A run in a pipe whose reader leaves must go on solving.
    sys.stdout = Unbreakable(sys.stdout)
    scene, choice = on_rank0(comm, with_target_met, options.scene_read, path)
    plan = on_rank0(comm, prepare, scene, options, choice)
    growth = _growth(scene, plan, choice, comm)
    return run_study(plan, work(scene, choice), path, comm, retry_failed=options.retry_failed, growth=growth)


def _growth(scene: Scene, plan: Any, choice: Any, comm: Any) -> Growth:
    """How the grasps of a scene are refined; also a file that has been refined already needs it."""
    each, about = added_cases(plan.units, plan.layout), (plan.header.scene_file, plan.header.overrides)

    def study(rounds: Rounds) -> tuple[Any, Work]:
        made = on_rank0(comm, make_plan, scene, *about, True, rounds)
        return made, work(refined(scene, rounds), choice)

    return Growth(study, lambda result: next_round(result, scene, each))


def cost(options: Namespace) -> None:
    """Measure what accuracy costs in time."""
    costing.run(options, with_sampled_grasps(options.scene_read))


def with_target_met(scene: Scene, path: Path) -> tuple[Scene, Any]:
    """The scene with its sampled grasps and what its target of accuracy chooses, and the choice; by one rank."""
    scene = with_sampled_grasps(scene)
    if scene.accuracy.e_n is None:
        return scene, None
    check_object(scene)
    return settled(scene, path, lambda text: print(text, flush=True))


def prepare(scene: Scene, options: Namespace, choice: Any = None) -> Any:
    """The plan of a run, after everything has been tried that would fail every case alike; by one rank."""
    # A wrong option would fail every case alike, after hours of a large study.
    _check_petsc(dict(scene.petsc))
    given = [*options.overrides, *petsc_overrides(options.petsc), *(choice.overrides() if choice else [])]
    plan = make_plan(scene, options.scene, given, ordered=True)
    check_poses(scene, [unit.scene for unit in plan.units])
    for line in told(scene):
        print(line, flush=True)
    return plan


def work(scene: Scene, choice: Any = None) -> Work:
    """How the cases of a scene are solved; ``choice`` is what its target of accuracy chose."""

    def finalise(writer: Any) -> None:
        if choice is not None:
            choice.fill(writer)
        derived.finalise(writer, scene)
        writer.write_report(plain_report(dataset(writer.result()), scene.friction.mu))

    return Work(
        solve_unit=pipeline.solve_unit,
        image=pipeline.image,
        finalise=finalise,
        summary=summary,
        time_limit=scene.run.time_limit_s,
        memory=scene.run.memory_gb,
    )


def _check_petsc(wanted: dict[str, Any]) -> None:
    """Refuse PETSc options that no solver asks for, or that PETSc itself refuses."""
    try:
        strange = unknown_options(wanted)
    except PETSc.Error as error:
        # the last line says what, the ones above it where in PETSc
        reason = str(error).strip().splitlines()[-1].partition("] ")[2] or str(error)
        given = " ".join(f"-{name} {value}" for name, value in wanted.items())
        text = f"petsc: PETSc refuses the options {given}: {reason.strip()}; correct them or leave them out"
        raise StudyError(USAGE, text) from error
    if strange:
        text = f"petsc: no solver asks for the option{'s' * (len(strange) > 1)} {', '.join(strange)}"
        raise StudyError(USAGE, f"{text}; correct the spelling, or remove what does not apply to this solver")
