"""The commands. Each imports what it needs when it is called, so that ``check`` loads neither MPI nor PETSc."""

from __future__ import annotations

import json
import os
import sys
import traceback
from argparse import ArgumentParser, Namespace, _SubParsersAction
from pathlib import Path
from typing import Any

from softjaw.study.messages import BUG, DONE, OTHER_FILE, STOPPED, USAGE, StudyError, complain, say
from softjaw.study.preparation import prepare, scene_of, target, with_target_met, work
from softjaw.study.run.memory import is_out_of_memory, no_room, require_room
from softjaw.study.writing import write_file

FILES = ("SCENE", "FILE", "HTML", "PNG", "PICTURE", "VTKHDF")  # metavars of words that are files


def damage(options: Namespace, error: Exception) -> StudyError | None:
    """What is wrong with the result files that an unforeseen error came from: their values are not those written."""
    from softjaw.study.scene.problems import SceneError

    files = [*getattr(options, "files", []), getattr(options, "file", "")]
    for file in (Path(name) for name in files if str(name).endswith(".hdf")):
        from softjaw.study.result.store import open_result, torn_rows

        try:
            with open_result(file) as result:
                layout = result.layout
            torn = torn_rows(file, layout)
        except StudyError as found:
            return found
        if torn:
            text = f"{file}: damaged ({len(torn)} cases do not match their checksums)"
            return StudyError(OTHER_FILE, f"{text}; 'softjaw run' solves them again, or restore it from a copy")
        if isinstance(error, SceneError):
            text = f"{file}: the scene in it cannot be used ({error.problems[0]})"
            return StudyError(OTHER_FILE, f"{text}; restore the file from a copy")
    return None


def init(options: Namespace) -> int:
    """Write a scene and a batch script to start from."""
    from softjaw.study.scene.start import init

    print(init(options, _mesh_size))
    return DONE


def _mesh_size(options: Namespace) -> list[float]:
    """Extents across and along the axis [mm] of a mesh that a study can take."""
    from softjaw.study.case.build import build_object
    from softjaw.study.scene.objects import Mesh

    shape = Mesh(shape="mesh", mesh=str(Path(options.mesh).absolute()), unit=options.unit, axis=options.axis)
    try:
        bounds: Any = build_object(shape).bounds
    except (ValueError, OSError) as error:
        raise StudyError(USAGE, f"--mesh: {error}") from error
    return [1e3 * float(high - low) for low, high in zip(*bounds, strict=True)]


def check(options: Namespace) -> int:
    """Find every error of a scene, or say what would be run."""
    from softjaw.study.case.build import check_object
    from softjaw.study.show.tables.columns import hanging, terminal_width
    from softjaw.study.show.tables.overview import scene_text

    scene = scene_of(options)
    check_object(scene)
    say(hanging(scene_text(scene, options.scene), terminal_width()))
    return DONE


def plan(options: Namespace) -> int:
    """Say what a run will take."""
    from softjaw.study.case.build import warnings
    from softjaw.study.run.plan import make_plan, plan_text
    from softjaw.study.show.tables.columns import hanging, terminal_width

    scene = scene_of(options)
    path = target(options, scene)
    made = make_plan(scene, options.scene, options.overrides)
    lines = [plan_text(made, scene, path, options.ranks), *(f"warning: {text}" for text in warnings(scene))]
    if scene.accuracy.e_n is not None:
        lines.append("accuracy.e_n chooses mesh and effects when the run starts; this plan has those of the scene")
    say(hanging("\n".join(lines), terminal_width()))
    return DONE


def status(options: Namespace) -> int:
    """Say what a result file holds so far."""
    from softjaw.study.result.store import open_result
    from softjaw.study.show.tables.columns import terminal_width
    from softjaw.study.show.tables.status import status_csv, status_json, status_text

    forms = {"json": status_json, "csv": status_csv}
    with open_result(options.file) as result:
        say(forms[options.form](result) if options.form else status_text(result, terminal_width()))
    return DONE


def watch(options: Namespace) -> int:
    """Show how a run goes on until it ends."""
    from softjaw.study.show.tables.watch import watch

    return watch(Path(options.file), options.every)


def scale(options: Namespace) -> int:
    """Replay a finished study on many ranks."""
    from softjaw.study.run.scaling import scaling_text

    say(scaling_text(Path(options.file), options))
    return DONE


def show(options: Namespace) -> int:
    """Print the best grasps."""
    from softjaw.study.result.read import open
    from softjaw.study.show.tables.columns import terminal_width
    from softjaw.study.show.tables.show import as_csv, as_json, as_text, best

    table = best(open(options.file), options.force, options.top, whole_lines=options.form is None)
    forms = {"json": as_json, "csv": as_csv}
    say(forms[options.form](table) if options.form else as_text(table, terminal_width()))
    return DONE


def compare(options: Namespace) -> int:
    """Print two maps side by side."""
    from softjaw.study.result.read import open
    from softjaw.study.show.tables.columns import terminal_width
    from softjaw.study.show.tables.compare import compare, comparison_csv, comparison_json, comparison_text

    one, other = map(open, options.files)
    found = compare(one, other, options.quantity, options.model)
    forms = {"json": comparison_json, "csv": comparison_csv}
    text = forms[options.form](found) if options.form else comparison_text(found, options.top, terminal_width())
    say(text)
    return DONE


def export(options: Namespace) -> int:
    """Write every case for planners."""
    from softjaw.study.result.read import open
    from softjaw.study.show.tables.export import as_csv, as_json

    text = {"json": as_json, "csv": as_csv}[options.form](open(options.file), options.model)
    if options.output is None:
        say(text)
        return DONE
    write_file(Path(options.output), f"{text}\n")
    print(f"written: {options.output}")
    return DONE


def report(options: Namespace) -> int:
    """Write one page with everything."""
    from softjaw.study.show.report.writing import write_report
    from softjaw.study.show.view.command import choice

    page = Path(options.output or Path(options.file).with_suffix(".html"))
    for made in write_report(Path(options.file), page, *choice(options)):
        print(f"written: {made}")
    return DONE


def patch(options: Namespace) -> int:
    """Judge a pressure field from elsewhere."""
    from softjaw.study.patch.answer_text import answer_text

    say(answer_text(options))
    return DONE


def view(options: Namespace) -> int:
    """Show a result in three dimensions."""
    from softjaw.study.show.view.command import view

    view(options)
    return DONE


def figure(options: Namespace) -> int:
    """Redraw figures of the paper."""
    from softjaw.study.show.figures.command import figure

    def solved(scene: Path, file: Path) -> int:
        words = {"scene": str(scene), "overrides": [], "petsc": [], "output": str(file), "retry_failed": False}
        return run(Namespace(**words))

    return figure(options, solved)


def completion(options: Namespace) -> int:
    """Print a script that lets a shell complete the words of this program, files among them."""
    import shtab

    parser: ArgumentParser = options.program
    commands = next(a for a in parser._actions if isinstance(a, _SubParsersAction)).choices.values()
    for action in (action for made in commands for action in made._actions):
        if action.metavar in FILES:
            action.complete = shtab.FILE  # type: ignore[attr-defined]
    print(shtab.complete(parser, options.shell))
    return DONE


def cost(options: Namespace) -> int:
    """Measure what accuracy costs in time."""
    require_room()
    from softjaw.study.accuracy.cost import run

    run(options, scene_of(options))
    return DONE


def schema(_options: Namespace) -> int:
    """Print the JSON schema of a scene."""
    from softjaw.study.scene import Scene

    print(json.dumps(Scene.model_json_schema(), indent=2))
    return DONE


def doctor(_options: Namespace) -> int:
    """Say whether this machine has what is needed."""
    from softjaw.study.doctor import doctor

    return doctor()


def run(options: Namespace) -> int:
    """Solve a scene; the same exit code on every rank."""
    require_room()
    os.environ["H5PY_ALWAYS_USE_MPI"] = "1"  # before h5py is imported: its own guess misses srun and single runs
    from mpi4py import MPI

    from softjaw.study.run.progress import Unbreakable

    comm = MPI.COMM_WORLD
    sys.stdout = Unbreakable(sys.stdout)
    try:
        return _run_on(comm, options)
    except StudyError as error:
        return complain(error)
    except BaseException as error:
        code = STOPPED if is_out_of_memory(error) else BUG
        if code == STOPPED:
            print(f"error: {no_room(str(error) or type(error).__name__)}", file=sys.stderr)
        else:
            traceback.print_exc()
        sys.stderr.flush()
        if comm.size > 1:
            comm.Abort(code)  # the other ranks wait for this one
        return code


def _run_on(comm: Any, options: Namespace) -> int:
    from softjaw.study.run.session import on_rank0, run_study

    def read() -> tuple[Any, Path]:
        scene = scene_of(options)
        return scene, target(options, scene)

    scene, path = on_rank0(comm, read)  # before the solvers are loaded: most wrong scenes are told of at once
    from softjaw.study import pipeline  # noqa: F401  (loads PETSc, which all ranks have to do together)

    scene, choice = on_rank0(comm, with_target_met, scene, path)
    how = work(scene, choice)
    plan = on_rank0(comm, prepare, scene, options, choice)
    return run_study(plan, how, path, comm, retry_failed=options.retry_failed)
