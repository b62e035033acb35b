"""A study from its scene to its finished file: plan, how cases are solved, what is written and said at the end."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from mpi4py import MPI

from softjaw.study import pipeline
from softjaw.study.case.build import notices
from softjaw.study.case.candidates import with_sampled_grasps
from softjaw.study.case.model import check_petsc
from softjaw.study.result import derived
from softjaw.study.result.read import dataset
from softjaw.study.run.object_folder import ObjectFolder
from softjaw.study.run.objects import run_objects
from softjaw.study.run.plan import make_plan
from softjaw.study.run.refine import Rounds, added_cases, refined
from softjaw.study.run.rounds import next_round
from softjaw.study.run.session import Work, on_rank0, run_study
from softjaw.study.scene import Scene
from softjaw.study.show.best_grasps import summary
from softjaw.study.show.report.verdict import plain_report


def solve_scene(
    scene: Scene,
    path: Path,
    comm: Any,
    *,
    scene_file: str = "",
    overrides: Sequence[str] = (),
    retry_failed: bool = False,
    last: Callable[[Any], str] = summary,
) -> int:
    """Solve a scene into its result file ``path``, or what is missing there; collective over ``comm``.

    ``scene_file, overrides``: where the scene comes from, and what ``--set`` changed; kept in the file.
    ``retry_failed``: whether cases that failed before are tried again. ``last(result)`` gives the text that is printed
    at the end. Returns the exit code, of `study.messages.MEANING`, the same on every rank.

    Raises `StudyError` on every rank: nothing was started, or the file is in use or cannot be written.
    """
    scene = on_rank0(comm, with_sampled_grasps, scene)
    plan = on_rank0(comm, prepare, scene, scene_file, overrides)
    return run_study(plan, work(scene, plan, comm, last), path, comm, retry_failed=retry_failed)


def solve_objects(folder: ObjectFolder, out: Path, comm: Any, *, retry_failed: bool = False) -> int:
    """Solve all objects of a folder into files of ``out`` and an index; collective over ``comm``.

    Returns as for `solve_scene`; 0 also where an object has no grasp. Raises `StudyError` on every rank:
    what is wrong for all objects alike, or ``out`` cannot be used.
    """

    def study(scene: Scene, overrides: tuple[str, ...]) -> tuple[Any, Work]:
        scene = with_sampled_grasps(scene)
        plan = make_plan(scene, folder.scene_file, overrides)
        return plan, work(scene, plan, MPI.COMM_SELF)

    common = on_rank0(comm, folder.check)
    on_rank0(comm, check_petsc, dict(common.petsc))
    each = Work(pipeline.solve_unit, pipeline.image, time_limit=common.run.time_limit_s, memory=common.run.memory_gb)
    return run_objects(folder, out, study, each, comm, retry_failed=retry_failed)


def prepare(scene: Scene, scene_file: str, overrides: Sequence[str]) -> Any:
    """The plan of a run, after everything has been tried that would fail every case alike; by one rank."""
    # A wrong option would fail every case alike, after hours of a large study.
    check_petsc(dict(scene.petsc))
    plan = make_plan(scene, scene_file, overrides)
    for line in notices(scene):
        print(line, flush=True)
    return plan


def work(scene: Scene, plan: Any, comm: Any, last: Callable[[Any], str] = summary) -> Work:
    """How the cases of a scene are solved, and in rounds its grasps and their meshes refined."""
    each, about = added_cases(plan.units, plan.layout), (plan.header.scene_file, plan.header.overrides)

    def with_rounds(rounds: Rounds) -> Work:
        grown_scene = refined(scene, rounds)
        return Work(
            pipeline.solve_unit, pipeline.image, lambda writer: derived.finalise(writer, grown_scene), last,
            scene.run.time_limit_s, scene.run.memory_gb,
            more=lambda result: next_round(result, scene, each),
            grown=lambda rounds: (on_rank0(comm, make_plan, scene, *about, rounds), with_rounds(rounds)),
            report=lambda result: plain_report(dataset(result)),
        )  # fmt: skip

    return with_rounds(())
