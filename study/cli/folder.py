"""Commands on a folder of objects: the same words as for one, with a pattern as mesh or a folder as file."""

from __future__ import annotations

import sys
import time
from argparse import Namespace
from pathlib import Path
from typing import Any, NamedTuple

from softjaw.study.case.candidates import with_sampled_grasps
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.result.index import index_path
from softjaw.study.run.estimate import START_S, estimated
from softjaw.study.run.object_folder import Listed, ObjectFolder
from softjaw.study.run.plan import free_bytes, make_plan, memory
from softjaw.study.run.progress import duration
from softjaw.study.run.shares import makespan
from softjaw.study.scene import SceneError
from softjaw.study.show import objects
from softjaw.study.table import as_csv, as_json, as_text, hanging, terminal_width

FORMS = {"json": as_json, "csv": as_csv}
PLANNED = 5  # objects that are planned, evenly spread, for what all will take


def run(options: Namespace) -> int:
    """Solve all objects of a scene; the same exit code on every rank."""
    from mpi4py import MPI

    from softjaw.study.launch import solve_objects
    from softjaw.study.run.progress import Unbreakable

    sys.stdout = Unbreakable(sys.stdout)
    out = target(options)
    code = _refused(lambda: solve_objects(options.folder, out, MPI.COMM_WORLD, retry_failed=options.retry_failed))
    if MPI.COMM_WORLD.rank == 0:
        print(objects.summary(out / "index.hdf", terminal_width()), flush=True)
    return int(code)


def check(options: Namespace) -> str:
    """Say which objects a scene names, and that its other keys have no error."""
    from softjaw.study.show.overview import scene_text

    folder: ObjectFolder = options.folder
    scene = _refused(folder.check)
    text = hanging(scene_text(scene, options.scene), terminal_width())
    names = ", ".join(listed.name for listed in folder.objects[:5]) + ", ..." * (len(folder.objects) > 5)
    return f"{text}\n  objects     {len(folder.objects)}: {names}; the mesh above stands for all of them"


def plan(options: Namespace) -> str:
    """Say what a run of all objects will take, by a few of them."""
    _refused(options.folder.check)
    return hanging(objects_text(options.folder, target(options), options.ranks[0]), terminal_width())


class Planned(NamedTuple):
    """What one object will take: times in seconds, sizes in bytes."""

    cases: int
    disk: int
    paths: list[float]
    planning: float
    memory: float


def objects_text(folder: ObjectFolder, out: Path, ranks: int) -> str:
    """Objects, cases, disk, memory and time on so many ranks."""
    objects = folder.objects
    some = objects[:: -(-len(objects) // PLANNED)]
    planned = [made for listed in some if (made := _planned(folder, listed)) is not None]
    rows = {"objects": f"{len(objects)}, of which {len(some)} were looked at"}
    if planned:
        scale = len(objects) / len(some)
        cases, space = scale * sum(made.cases for made in planned), scale * sum(made.disk for made in planned)
        paths = [seconds for made in planned for seconds in made.paths]
        many = paths * max(1, round(scale))
        solving = makespan(many, ranks) * scale * len(paths) / len(many)
        preparing = scale * sum(made.planning for made in planned) / ranks
        each, free = max(made.memory for made in planned), free_bytes(out / "index.hdf")
        rows |= {
            "cases": f"about {cases:.0f}",
            "disk": f"about {space / 1e6:.3g} MB in {out}" + f", {free / 1e9:.1f} GB free" * (free >= 0),
            "memory": f"roughly {each / 1e9:.1g} GB on each rank, {each * ranks / 1e9:.2g} GB on {ranks}",
            "time": f"about {duration(START_S + preparing + solving)} on {ranks} rank{'s' * (ranks > 1)}, "
            f"{duration(preparing)} of it for sampling grasps; estimated on a bed of springs",
        }
    if len(planned) < len(some):
        rows["no grasp"] = f"{len(some) - len(planned)} of {len(some)}: they are rows of the index, with the reason"
    return "\n".join(f"  {name:<10}  {text}" for name, text in rows.items())


def _planned(folder: ObjectFolder, listed: Listed) -> Planned | None:
    begin = time.perf_counter()
    try:
        scene = with_sampled_grasps(folder.scene(listed))
        plan = make_plan(scene, folder.scene_file, folder.overrides_of(listed))
    except (StudyError, SceneError):
        return None
    spent = time.perf_counter() - begin
    return Planned(plan.layout.rows, plan.layout.nbytes, estimated(plan.tried), spent, memory(scene))


def target(options: Namespace) -> Path:
    """The folder of the results; by default the scene's name."""
    out = Path(options.output or Path("results") / Path(options.scene).stem)
    if out.suffix == ".hdf" or out.is_file():
        raise StudyError(USAGE, f"-o: found '{out}', expected a folder, for a scene of many objects")
    return out


def _refused(act: Any) -> Any:
    try:
        return act()
    except SceneError as error:
        raise StudyError(USAGE, str(error)) from error


# --- results ----------------------------------------------------------------------------------------------------------


def _index(options: Namespace) -> Path:
    path = index_path(options.file)
    assert path is not None
    return path


def watch(options: Namespace) -> int:
    """Follow a run until it ends."""
    from softjaw.study.show.watch import watch  # xarray

    return watch(lambda: objects.look(_index(options)), options.every)


def status(options: Namespace) -> str:
    """Say how many objects are in which state, and why some have no grasp."""
    path = _index(options)
    if options.form:
        return FORMS[options.form](objects.index_table(path))
    return objects.status_text(path, terminal_width())


def show(options: Namespace) -> str:
    """Print the objects with their best grasps."""
    table = objects.index_table(_index(options), options.top)
    return FORMS[options.form](table) if options.form else as_text(table, terminal_width())


def report(options: Namespace) -> str:
    """Write one page on all objects."""
    from softjaw.study.show.report.objects_page import write_objects_page  # matplotlib and plotly

    path = _index(options)
    return f"written: {write_objects_page(path, Path(options.output or path.with_suffix('.html')))}"


def export(options: Namespace) -> str:
    """Write the grasps of all objects as one data set."""
    from softjaw.study.cli.exporting import gripper_of
    from softjaw.study.export import data_set

    if options.form not in data_set.FORMS:
        known = ", ".join(data_set.FORMS)
        raise StudyError(USAGE, f"--format: found '{options.form}', expected one of {known} for a folder of objects")
    if options.output is None:
        raise StudyError(USAGE, f"--format {options.form}: name the folder of the data set with -o")
    return data_set.write_data_set(_index(options), Path(options.output), options.form, gripper_of(options))
