"""Solve the cases of a catalogue, each into a file of its own, shared among the ranks; then print its table."""

from __future__ import annotations

import contextlib
import io
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from softjaw.study.catalogue.model import Case, Catalogue, load_catalogue
from softjaw.study.catalogue.outcome import Outcome, outcome
from softjaw.study.catalogue.scenes import case_scene
from softjaw.study.catalogue.table import table_text
from softjaw.study.catalogue.verdict import judge
from softjaw.study.messages import CANNOT_WRITE, DONE, SOME_FAILED, STOPPED, USAGE, StudyError
from softjaw.study.scene.problems import first_of
from softjaw.study.writing import make_folders


def folder_of(options: Namespace) -> Path:
    """Folder of the cases' result files: what ``-o`` names, without its ending, or ``results/<catalogue>``."""
    path = Path(options.output or f"results/{Path(options.scene).stem}")
    return path.with_suffix("") if path.suffix == ".hdf" else path


def run_catalogue(options: Namespace, comm: Any) -> int:
    """Solve what is missing and print the table; collective, with the same exit code on every rank.

    A case is solved by one rank, so none waits for another. Whatever a case dies of is its outcome.
    """
    from softjaw.study.run.schedule import Claims
    from softjaw.study.run.session import on_rank0

    path, folder = Path(options.scene), folder_of(options)
    catalogue = on_rank0(comm, load_catalogue, path)
    on_rank0(comm, _make, folder)
    claims = Claims(comm, len(catalogue.case))
    refused: dict[str, str] = {}
    stopped = False
    for number in claims:
        case = catalogue.case[number]
        code, text = _solve(catalogue, case, path, folder, options)
        refused |= {case.name: text} if text else {}
        if code == STOPPED:
            stopped = True
            claims.stop()
            break
        print(f"[{number + 1}/{len(catalogue.case)}] {case.kind}: {case.name}", flush=True)
    every = {name: text for part in comm.allgather(refused) for name, text in part.items()}
    stopped = any(comm.allgather(stopped))
    claims.free()
    wrong = on_rank0(comm, _report, catalogue, folder, every)
    return STOPPED if stopped else SOME_FAILED if wrong else DONE


def _make(folder: Path) -> None:
    if folder.exists() and not folder.is_dir():
        raise StudyError(CANNOT_WRITE, f"{folder}: is a file; name a folder for the cases of the catalogue with -o")
    make_folders(folder)


def _solve(catalogue: Catalogue, case: Case, path: Path, folder: Path, options: Namespace) -> tuple[int, str]:
    """Solve one case alone on this rank: its exit code, and why it was refused."""
    from mpi4py import MPI

    from softjaw.study.preparation import petsc_overrides, prepare, work
    from softjaw.study.run.session import run_study

    overrides = [*options.overrides, *petsc_overrides(options.petsc)]
    own = Namespace(scene=str(path), overrides=overrides, petsc=[])
    target = folder / f"{case.name}.hdf"
    try:
        with contextlib.redirect_stdout(io.StringIO()):  # one line for each case is enough
            scene = case_scene(catalogue, case, path, overrides)
            plan = prepare(scene, own)
            return run_study(plan, work(scene), target, MPI.COMM_SELF, retry_failed=options.retry_failed), ""
    except StudyError as error:  # also a file of another scene: raised here, it would leave the other ranks waiting
        return DONE, error.message


def _report(catalogue: Catalogue, folder: Path, refused: dict[str, str]) -> int:
    """Print the table; the number of cases that did not come to what is right."""
    outcomes = {
        c.name: Outcome(refused=refused[c.name]) if c.name in refused else outcome(folder / f"{c.name}.hdf")
        for c in catalogue.case
    }
    verdicts = {c.name: judge(c, outcomes) for c in catalogue.case}
    print(table_text(catalogue.case, outcomes, verdicts), flush=True)
    return sum(bool(v.wrong) for v in verdicts.values())


def check_text(path: Path, overrides: Sequence[str]) -> str:
    """What a catalogue holds, after every scene in it has been judged.

    Raises
    ------
    StudyError
        With every case that is wrong: refused where it should not be, or for another reason.
    """
    import re

    catalogue, problems, refused = load_catalogue(path), [], 0
    for case in catalogue.case:
        told = _refusal(catalogue, case, path, overrides)
        refused += bool(told)
        if told and (case.expect != "refused" or not re.search(case.reason, told)):
            problems += [f"{path}: case '{case.name}': {line}" for line in told.splitlines()]
    if problems:
        raise StudyError(USAGE, first_of(problems, path))
    expected = sum(c.expect == "refused" for c in catalogue.case)
    kinds = ", ".join(dict.fromkeys(c.kind for c in catalogue.case))
    late = f" ({expected - refused} of them only when poses are tried)" if refused < expected else ""
    return "\n".join([
        f"{path}: no errors", f"  cases    {len(catalogue.case)}, of which {expected} are to be refused{late}",
        f"  classes  {kinds}", f"  results  one file for each case, results/{path.stem}/NAME.hdf",
    ])  # fmt: skip


def _refusal(catalogue: Catalogue, case: Case, path: Path, overrides: Sequence[str]) -> str:
    """Why a scene of the catalogue is refused, or nothing."""
    from softjaw.study.case.build import check_object

    try:
        check_object(case_scene(catalogue, case, path, overrides))
    except StudyError as error:
        return error.message
    return ""
