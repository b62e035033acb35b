"""What a run of many objects will take, and where its results go."""

from __future__ import annotations

import time
from argparse import Namespace
from pathlib import Path
from typing import NamedTuple

from softjaw.study.case.candidates import with_sampled_grasps
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.run.estimate import START_S, estimated
from softjaw.study.run.object_folder import Listed, ObjectFolder
from softjaw.study.run.plan import free_bytes, make_plan, memory
from softjaw.study.run.progress import duration
from softjaw.study.run.shares import makespan
from softjaw.study.scene import SceneError

PLANNED = 5  # objects that are planned, evenly spread, for what all will take


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


def results_folder(options: Namespace) -> Path:
    """The folder of the results; by default the scene's name."""
    out = Path(options.output or Path("results") / Path(options.scene).stem)
    if out.suffix == ".hdf" or out.is_file():
        raise StudyError(USAGE, f"-o: found '{out}', expected a folder, for a scene of many objects")
    return out
