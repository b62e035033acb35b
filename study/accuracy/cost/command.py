"""``softjaw cost``: the study from scene to page."""

from __future__ import annotations

import os
from argparse import Namespace
from pathlib import Path
from typing import Any

from softjaw.study.accuracy.cost.page import cost_page, sentences
from softjaw.study.accuracy.cost.study import Measuring, costs, load, new_study
from softjaw.study.case.build import check_object
from softjaw.study.case.probes import probes
from softjaw.study.messages import OTHER_FILE, STOPPED, USAGE, StudyError, write_file
from softjaw.study.scene.text import differences

SIZES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_NTASKS")


def run(options: Namespace, scene: Any) -> None:
    """Measure what is missing and write the page."""
    refuse_ranks()
    path = Path(options.output or f"results/{Path(options.scene).stem}-cost.hdf")
    if path.suffix != ".hdf":
        raise StudyError(USAGE, f"-o: found '{path}', expected a file ending in .hdf; write -o {path}.hdf")
    check_object(scene)
    found, what = probes(scene, options.candidates), costs(scene)
    title = getattr(scene.object, "name", None) or Path(options.scene).stem
    study = new_study(scene, found, title, options.scene)
    if path.exists():
        old = load(path)
        check_same(path, old, study.digest, study.scene, study.candidates)
        print(f"{path}: resumed, {len(old.measured)} measurements are there", flush=True)
        study = old
    print(f"probes: {'; '.join(study.candidates)}", flush=True)
    try:
        Measuring(study, found, what, path, lambda text: print(text, flush=True)).run(options.time_limit)
    except KeyboardInterrupt as stop:
        raise StudyError(STOPPED, f"stopped; the same command goes on with what {path} lacks") from stop
    _conclude(study, what, path)


def _conclude(study: Any, what: Any, path: Path) -> None:
    """Write page and picture, print the answer."""
    if all(m.message for m in study.of(study.base)):
        text = f"no probe could be solved with the scene as it is: {study.of(study.base)[0].message}"
        raise StudyError(OTHER_FILE, text)
    tables = what.errors(study)
    html, png = cost_page(study, tables)
    for place, data in ((path.with_suffix(".html"), html.encode()), (path.with_suffix(".png"), png)):
        write_file(place, data)
    count = len(study.skipped)
    left = f"{count} level{'s were' if count > 1 else ' was'} not measured, the page says why" if count else ""
    print("\n".join(["", *sentences(study, tables), *([left] if left else [])]))
    print(f"written: {path}, {path.with_suffix('.html')}, {path.with_suffix('.png')}")


def check_same(path: Path, old: Any, digest: str, scene: str, candidates: list[str]) -> None:
    """Refuse to go on with a study of another scene or other candidates."""
    other = "choose another file with -o, or move this one away"
    if old.digest != digest:
        raise StudyError(OTHER_FILE, f"{path}: made from another scene ({differences(old.scene, scene)}); {other}")
    if old.candidates != candidates:
        raise StudyError(OTHER_FILE, f"{path}: has the candidates {'; '.join(old.candidates)}; {other}")


def refuse_ranks() -> None:
    """Measurements of several ranks would disturb each other's times."""
    ranks = next((int(os.environ[name]) for name in SIZES if os.environ.get(name, "").isdigit()), 1)
    if ranks > 1:
        raise StudyError(
            USAGE, f"cost: found {ranks} ranks, expected one: ranks that share a machine disturb each other's times;"
            " start it without mpirun"
        )  # fmt: skip
