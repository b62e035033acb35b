"""The commands. Each imports what it needs when it is called, so that ``check`` loads neither MPI nor PETSc."""

from __future__ import annotations

import os
import sys
import traceback
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from study.exits import BUG, CANNOT_WRITE, DONE, OTHER_FILE, USAGE, StudyError
from study.printable import printable

RANK = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID")


def first_rank() -> bool:
    """Whether this process speaks for all ranks; known without MPI."""
    return next((os.environ[name] == "0" for name in RANK if name in os.environ), True)


def complain(error: StudyError) -> int:
    """Say what went wrong, once, and give the exit code."""
    if first_rank():
        for line in error.message.splitlines():
            print(f"error: {printable(line)}", file=sys.stderr, flush=True)
    return error.code


def _say(text: str) -> None:
    """Print what may hold texts of files from elsewhere."""
    print(printable(text))


def damage(options: Namespace, error: Exception) -> StudyError | None:
    """What is wrong with the result files that an unforeseen error came from: their values are not those written."""
    from study.scene.errors import SceneError

    files = [*getattr(options, "files", []), getattr(options, "file", "")]
    for file in (Path(name) for name in files if str(name).endswith(".hdf")):
        from study.store import open_result, torn_rows

        try:
            with open_result(file) as result:
                layout = result.layout
            torn = torn_rows(file, layout)
        except StudyError as found:
            return found
        if torn:
            text = f"{file}: damaged ({len(torn)} cases do not match their checksums)"
            return StudyError(OTHER_FILE, f"{text}; 'softjaw repair {file}' says what is good")
        if isinstance(error, SceneError):
            text = f"{file}: the scene in it cannot be used ({error.problems[0]})"
            return StudyError(OTHER_FILE, f"{text}; restore the file from a copy")
    return None


def _scene(options: Namespace) -> Any:
    from study.scene import load_scene
    from study.scene.errors import SceneError

    try:
        return load_scene(Path(options.scene), [*options.overrides, *petsc_overrides(options.petsc)])
    except SceneError as error:
        raise StudyError(USAGE, str(error)) from error


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
            from study.scene.file_checks import OTHERS

            takes = "softjaw takes only options of the contact solver, -contact_..."
            raise StudyError(USAGE, f"PETSc option '{word}' after '--': {takes}; {OTHERS}")
        else:
            found[-1][1] = word
    return [f"petsc.{name}={value}" for name, value in found]


def init(options: Namespace) -> int:
    """Write a scene and a batch script to start from."""
    from study.start import init

    print(init(options))
    return DONE


def _catalogue(options: Namespace) -> bool:
    from study.catalogue.model import is_catalogue

    return is_catalogue(Path(options.scene))


def check(options: Namespace) -> int:
    """Find every error of a scene or of a catalogue, or say what would be run."""
    from study.build import check_object
    from study.columns import hanging, terminal_width
    from study.overview import scene_text

    if _catalogue(options):
        from study.catalogue.run import check_text

        _say(check_text(Path(options.scene), options.overrides))
        return DONE
    scene = _scene(options)
    check_object(scene)
    _say(hanging(scene_text(scene, options.scene), terminal_width()))
    return DONE


def plan(options: Namespace) -> int:
    """Say what a run will take."""
    from study.build import warnings
    from study.columns import hanging, terminal_width
    from study.plan import make_plan, plan_text

    if _catalogue(options):
        text = "is a catalogue of scenes; 'check' and 'run' take it, 'plan' does not"
        raise StudyError(USAGE, f"{options.scene}: {text}")
    scene = _scene(options)
    path = target(options, scene)
    made = make_plan(scene, options.scene, options.overrides)
    lines = [plan_text(made, scene, path, options.ranks), *(f"warning: {text}" for text in warnings(scene))]
    if scene.accuracy.e_n is not None:
        lines.append("accuracy.e_n chooses mesh and effects when the run starts; this plan has those of the scene")
    _say(hanging("\n".join(lines), terminal_width()))
    return DONE


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


def status(options: Namespace) -> int:
    """Say what a result file holds so far."""
    from study.columns import terminal_width
    from study.status import status_csv, status_json, status_text
    from study.store import open_result

    forms = {"json": status_json, "csv": status_csv}
    with open_result(options.file) as result:
        _say(forms[options.form](result) if options.form else status_text(result, terminal_width()))
    return DONE


def watch(options: Namespace) -> int:
    """Show how a run goes on until it ends."""
    from study.watch import watch

    return watch(Path(options.file), options.every)


def repair(options: Namespace) -> int:
    """Say what of a damaged file is good, and make it usable."""
    from study.repair import repair

    _say(repair(Path(options.file), options.write, options.in_place))
    return DONE


def scale(options: Namespace) -> int:
    """Replay a finished study on many ranks."""
    from study.scaling import scaling_text

    _say(scaling_text(Path(options.file), options))
    return DONE


def show(options: Namespace) -> int:
    """Print the best grasps."""
    from study.columns import terminal_width
    from study.show import as_csv, as_json, as_text, best
    from study.store import open_result

    with open_result(options.file) as result:
        table = best(result, options.force, options.top, whole_lines=options.form is None)
    forms = {"json": as_json, "csv": as_csv}
    _say(forms[options.form](table) if options.form else as_text(table, terminal_width()))
    return DONE


def compare(options: Namespace) -> int:
    """Print two maps side by side."""
    from study.columns import terminal_width
    from study.compare import compare
    from study.compare_text import comparison_csv, comparison_json, comparison_text
    from study.store import open_result

    with open_result(options.files[0]) as one, open_result(options.files[1]) as other:
        found = compare(one, other, options.quantity, options.model)
    forms = {"json": comparison_json, "csv": comparison_csv}
    text = forms[options.form](found) if options.form else comparison_text(found, options.top, terminal_width())
    _say(text)
    return DONE


def export(options: Namespace) -> int:
    """Write every case for planners."""
    from study.export import as_csv, as_json
    from study.store import open_result

    with open_result(options.file) as result:
        text = {"json": as_json, "csv": as_csv}[options.form](result, options.model)
    if options.output is None:
        _say(text)
        return DONE
    try:
        Path(options.output).write_text(f"{text}\n", encoding="utf-8")
    except OSError as error:
        raise StudyError(CANNOT_WRITE, f"{options.output}: cannot be written: {error.strerror}") from error
    print(f"written: {options.output}")
    return DONE


def report(options: Namespace) -> int:
    """Write one page with everything."""
    from study.report.writing import write_report
    from study.view.command import choice

    page = Path(options.output or Path(options.file).with_suffix(".html"))
    for made in write_report(Path(options.file), page, *choice(options)):
        print(f"written: {made}")
    return DONE


def patch(options: Namespace) -> int:
    """Judge a pressure field from elsewhere."""
    from study.patch.command import answer_text

    _say(answer_text(options))
    return DONE


def view(options: Namespace) -> int:
    """Show a result in three dimensions."""
    from study.view.command import view

    view(options)
    return DONE


def figure(options: Namespace) -> int:
    """Redraw figures of the paper."""
    from study.figures.command import figure

    return figure(options)


def completion(options: Namespace) -> int:
    """Print a script that lets a shell complete the words of this program."""
    from study.cli import program
    from study.completion import script

    print(script(program(), options.shell))
    return DONE


def cost(options: Namespace) -> int:
    """Measure what accuracy costs in time."""
    from study.cost.command import run

    run(options, _scene(options))
    return DONE


def schema(_options: Namespace) -> int:
    """Print the JSON schema of a scene."""
    import json

    from study.scene import Scene

    print(json.dumps(Scene.model_json_schema(), indent=2))
    return DONE


def doctor(_options: Namespace) -> int:
    """Say whether this machine has what is needed."""
    from study.doctor import doctor

    return doctor()


def run(options: Namespace) -> int:
    """Solve a scene; the same exit code on every rank."""
    os.environ["H5PY_ALWAYS_USE_MPI"] = "1"  # before h5py is imported: its own guess misses srun and single runs
    from mpi4py import MPI

    from study.progress import Unbreakable

    comm = MPI.COMM_WORLD
    sys.stdout = Unbreakable(sys.stdout)
    try:
        return _run_on(comm, options)
    except StudyError as error:
        return complain(error)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        if comm.size > 1:
            comm.Abort(BUG)  # the other ranks wait for this one
        return BUG


def _run_on(comm: Any, options: Namespace) -> int:
    from study.run import on_rank0, run_study

    if on_rank0(comm, _catalogue, options):
        from study.catalogue.run import run_catalogue

        return run_catalogue(options, comm)

    def read() -> tuple[Any, Path]:
        scene = _scene(options)
        return scene, target(options, scene)

    scene, path = on_rank0(comm, read)  # before the solvers are loaded: most wrong scenes are told of at once
    from study import pipeline  # noqa: F401  (loads PETSc, which all ranks have to do together)

    scene, choice = on_rank0(comm, _settled, scene, path)
    how = work(scene, choice)
    plan = on_rank0(comm, prepare, scene, options, choice)
    return run_study(plan, how, path, comm, retry_failed=options.retry_failed)


def _settled(scene: Any, path: Path) -> tuple[Any, Any]:
    """The scene with what its target of accuracy chooses, and the choice; by one rank."""
    if scene.accuracy.e_n is None:
        return scene, None
    from study.build import check_object
    from study.cost.target import settled

    check_object(scene)
    return settled(scene, path, lambda text: print(text, flush=True))


def work(scene: Any, choice: Any = None) -> Any:
    """How the cases of a scene are solved; ``choice`` is what its target of accuracy chose."""
    from study import derived, pipeline
    from study.cost import stored
    from study.run import Work
    from study.status import summary

    def finalise(writer: Any) -> None:
        stored.fill(writer, choice)
        derived.finalise(writer, scene)

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
    from study.build import warnings
    from study.cost.stored import overrides
    from study.plan import make_plan
    from study.reach import check_poses

    _check_petsc(dict(scene.petsc))
    if scene.accuracy.e_n is not None and choice is None:
        text = f"accuracy.e_n: found {scene.accuracy.e_n:g} in a case of a catalogue, expected it in scenes only"
        raise StudyError(USAGE, f"{text}; give the case its mesh, or run it as a scene of its own")
    given = [*options.overrides, *petsc_overrides(options.petsc), *overrides(choice)]
    plan = make_plan(scene, options.scene, given)
    check_poses(scene, [unit.scene for unit in plan.units])
    for text in warnings(scene):
        print(f"warning: {text}", flush=True)
    return plan


def _check_petsc(wanted: dict[str, Any]) -> None:
    """Refuse PETSc options that no solver asks for, or that PETSc itself refuses."""
    from fem.petsc import PETSc, unknown_options

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
