"""From a command line to a run: scene with overrides, target of accuracy, plan, and how the cases are solved."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from softjaw.study.messages import USAGE, StudyError


def petsc_overrides(words: Sequence[str]) -> list[str]:
    """PETSc options of the command line as overrides of the scene's ``[petsc]`` table.

    >>> petsc_overrides(["-contact_snes_monitor", "-contact_snes_rtol", "1e-9"])
    ['petsc.contact_snes_monitor=true', 'petsc.contact_snes_rtol=1e-9']
    """
    found: list[list[str]] = []
    for word in words:
        if word.startswith("-contact_"):
            found.append([word[1:], "true"])
        elif (word.startswith("-") and not word[1:2].isdigit()) or not found or found[-1][1] != "true":
            text = f"PETSc option '{word}' after '--': softjaw takes only options of the contact solver, -contact_..."
            raise StudyError(USAGE, f"{text}; others go into the environment variable PETSC_OPTIONS")
        else:
            found[-1][1] = word
    return [f"petsc.{name}={value}" for name, value in found]


def scene_of(options: Namespace) -> Any:
    """The scene that the command line names, with what it changes."""
    from softjaw.study.scene import load_scene
    from softjaw.study.scene.problems import SceneError

    try:
        return load_scene(Path(options.scene), [*options.overrides, *petsc_overrides(options.petsc)])
    except SceneError as error:
        raise StudyError(USAGE, str(error)) from error


def target(options: Namespace, scene: Any) -> Path:
    """The result file of a run; refuse names that no viewer of results would open."""
    if options.output is None:
        return Path(scene.output.file)
    path = Path(options.output)
    if path.suffix != ".hdf":
        better = path / Path(scene.output.file).name if path.is_dir() else path.with_name(path.name + ".hdf")
        text = f"-o: found '{path}', expected a file ending in .hdf, which all viewers open; write -o {better}"
        raise StudyError(USAGE, text)
    return path


def with_target_met(scene: Any, path: Path) -> tuple[Any, Any]:
    """The scene with what its target of accuracy chooses, and the choice; by one rank."""
    if scene.accuracy.e_n is None:
        return scene, None
    from softjaw.study.accuracy.target import settled
    from softjaw.study.case.build import check_object

    check_object(scene)
    return settled(scene, path, lambda text: print(text, flush=True))


def work(scene: Any, choice: Any = None) -> Any:
    """How the cases of a scene are solved; ``choice`` is what its target of accuracy chose."""
    from softjaw.study import pipeline
    from softjaw.study.run.session import Work
    from softjaw.study.show.tables.status import summary

    def finalise(writer: Any) -> None:  # loads what one rank needs at the end
        from softjaw.study.result import derived
        from softjaw.study.result.read import dataset
        from softjaw.study.show.report.verdict import plain_report

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


def prepare(scene: Any, options: Namespace, choice: Any = None) -> Any:
    """The plan of a run, after everything has been tried that would fail every case alike; by one rank."""
    from softjaw.study.case.build import warnings
    from softjaw.study.case.model import check_poses
    from softjaw.study.run.plan import make_plan

    _check_petsc(dict(scene.petsc))
    given = [*options.overrides, *petsc_overrides(options.petsc), *(choice.overrides() if choice else [])]
    plan = make_plan(scene, options.scene, given)
    check_poses(scene, [unit.scene for unit in plan.units])
    for text in warnings(scene):
        print(f"warning: {text}", flush=True)
    return plan


def _check_petsc(wanted: dict[str, Any]) -> None:
    """Refuse PETSc options that no solver asks for, or that PETSc itself refuses."""
    from softjaw.fem.petsc import PETSc, unknown_options

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
