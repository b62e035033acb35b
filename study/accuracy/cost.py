"""``softjaw cost``: the study from scene to page."""

from __future__ import annotations

import os
from argparse import Namespace
from functools import partial
from pathlib import Path
from typing import Any

from softjaw.study.accuracy.convergence import error_tables
from softjaw.study.accuracy.cost_page import cost_page, sentences
from softjaw.study.accuracy.cost_study import Costs, CostStudy, costs, load, new_study
from softjaw.study.accuracy.measure import Measuring
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
    found, parameters = probes(scene, options.candidates), costs(scene)
    title = getattr(scene.object, "name", None) or Path(options.scene).stem
    study = new_study(scene, found, title, options.scene)
    if path.exists():
        study = _resumed(path, study)
    print(f"probes: {'; '.join(study.candidates)}", flush=True)
    try:
        Measuring(study, found, parameters, path, partial(print, flush=True)).run(options.time_limit)
    except KeyboardInterrupt as stop:
        raise StudyError(STOPPED, f"stopped; run the same command again to measure what {path} lacks") from stop
    _conclude(study, parameters, path)


def _resumed(path: Path, new: CostStudy) -> CostStudy:
    """The study that a file holds, if it is of the same scene and candidates."""
    old = load(path)
    remedy = "choose another file with -o, or move this one away"
    if old.digest != new.digest:
        text = f"{path}: made from another scene ({differences(old.scene, new.scene)}); {remedy}"
        raise StudyError(OTHER_FILE, text)
    if old.candidates != new.candidates:
        raise StudyError(OTHER_FILE, f"{path}: has the candidates {'; '.join(old.candidates)}; {remedy}")
    print(f"{path}: resumed with {len(old.measured)} measurements", flush=True)
    return old


def _conclude(study: CostStudy, parameters: Costs, path: Path) -> None:
    """Write page and picture, print the answer."""
    if all(m.message for m in study.of(study.base)):
        text = f"no probe could be solved with the scene as it is: {study.of(study.base)[0].message}"
        raise StudyError(OTHER_FILE, text)
    tables = error_tables(parameters, study)
    html, png = cost_page(study, tables)
    for place, data in ((path.with_suffix(".html"), html.encode()), (path.with_suffix(".png"), png)):
        write_file(place, data)
    skipped = [f"levels not measured: {len(study.skipped)}; the page gives the reasons"] if study.skipped else []
    print("\n".join(["", *sentences(study, tables), *skipped]))
    print(f"written: {path}, {path.with_suffix('.html')}, {path.with_suffix('.png')}")


def refuse_ranks() -> None:
    """Measurements of several ranks would disturb each other's times."""
    ranks = next((int(os.environ[name]) for name in SIZES if os.environ.get(name, "").isdigit()), 1)
    if ranks > 1:
        text = f"cost: found {ranks} ranks, expected one: ranks that share a machine disturb each other's times"
        raise StudyError(USAGE, f"{text}; start it without mpirun")
