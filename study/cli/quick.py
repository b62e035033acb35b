"""Commands that answer at once and load neither MPI nor PETSc nor xarray; only what a plan times loads a solver."""

import json
import time
from argparse import Namespace
from collections.abc import Sequence
from contextlib import suppress
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study.case.build import build_object, check_object, geometry, mesh_notes, notices, with_mass
from softjaw.study.case.candidates import check_candidates, with_sampled_grasps
from softjaw.study.messages import DONE, USAGE, NoGraspError, StudyError, fault_of, printable, with_ending
from softjaw.study.run.estimate import END_S, TIMED, TIMED_S, timed
from softjaw.study.run.object_folder import ObjectFolder, folder_of
from softjaw.study.run.plan import free_bytes, gigabytes, make_plan, memory, plan_rows
from softjaw.study.run.progress import duration
from softjaw.study.run.shares import makespan
from softjaw.study.scene import Scene, SceneError, load_scene, start
from softjaw.study.scene.objects import Mesh
from softjaw.study.scene.sections import OTHERS
from softjaw.study.scene.text import quoted
from softjaw.study.show.overview import aligned, listed, scene_text
from softjaw.study.table import hanging, terminal_width
from softjaw.study.units import in_si

PLANNED = 5  # objects that are planned, evenly spread, for what all will take


def init(options: Namespace) -> str:
    """Write a scene and a batch script to start from."""
    return start.init(options, _measured)


def _measured(options: Namespace) -> start.Measured:
    """What a scene should say about a mesh that a study can take."""

    def built(axis: str) -> tuple[Mesh, Any, list[float]]:
        """The mesh as an object with this axis, and its extents [mm]."""
        # Absolute, because the scene that is written may lie in another folder.
        mesh = str(Path(options.mesh).absolute())
        shape = Mesh.model_validate({"shape": "mesh", "mesh": mesh, "unit": options.unit, "axis": axis})
        made: Any = build_object(shape)
        return shape, made, (1e3 * np.ptp(made.bounds, axis=0)).tolist()

    with fault_of("--mesh", ValueError, OSError):
        axis = options.axis or start.longest(dict(zip("xyz", built("z")[2], strict=True)))
        shape, made, extents = built(axis)
        pad, _ = start.jaws(options.gripper)
        middle = geometry().middle_of(shape, in_si("pad_length_mm", pad))
        half = in_si("half_mm", pad / 2)
        stations = (s for s in start.heights(extents[2], pad) if not middle.remark(in_si("station_mm", s), half))
        return axis, tuple(extents), tuple(stations), mesh_notes(made)


def check(options: Namespace) -> str:
    """Find every error of a scene, or say what would be run."""
    if not options.folder:
        scene = _checked(scene_of(options))
        return hanging("\n".join([scene_text(scene, options.scene), *notices(scene)]), terminal_width())
    options.folder.check()  # what is wrong for all alike is said once
    objects, scenes, wrong, ungrasped = options.folder.objects, list[Scene](), list[str](), list[str]()
    noted: dict[str, list[str]] = {}
    for obj in objects:
        try:
            scenes.append(_checked(options.folder.scene(obj)))
            for notice in notices(scenes[-1]):
                noted.setdefault(notice, []).append(obj.name)
        except SceneError as error:
            wrong += [str(p) if p.file == obj.place else f"{obj.place}: {p}" for p in error.problems]
        except StudyError as error:
            (ungrasped if isinstance(error, NoGraspError) else wrong).append(f"{obj.place}: {error.message}")
    if wrong or not scenes:
        raise StudyError(USAGE, "\n".join(wrong or ungrasped))
    text = scene_text(scenes[0], options.scene)
    text += f"\n  objects     {len(objects)}: {objects[0].name} to {objects[-1].name}; the mesh is one of them"
    lines = [text, *(f"  no grasp    {reason}" for reason in ungrasped)]
    lines += [notice.replace(":", f": {listed(names)}:", 1) for notice, names in noted.items()]
    return hanging("\n".join(lines), terminal_width())


def _checked(scene: Scene) -> Scene:
    """A scene with its mass; raises `StudyError` with what is wrong with its object and grasps."""
    scene = with_mass(scene)
    check_object(scene)
    check_candidates(scene)
    return scene


def plan(options: Namespace) -> str | int:
    """Say what a run will take."""
    if options.folder:
        options.folder.check()
        return hanging(objects_text(options.folder, results_folder(options), options.ranks), terminal_width())
    scene = with_sampled_grasps(scene_of(options))
    path = target(options)
    made = make_plan(scene, options.scene, options.overrides)
    for row in chain(plan_rows(made, scene, path, options.ranks), notices(scene)):
        print(printable(hanging(row, terminal_width())), flush=True)
    return DONE


def objects_text(folder: ObjectFolder, out: Path, ranks: Sequence[int]) -> str:
    """Objects, cases, disk, memory and time on each of these numbers of ranks."""
    objects, planned = folder.objects, []
    some = objects[:: -(-len(objects) // PLANNED)]
    scale, begin = len(objects) / len(some), time.process_time()
    for obj in some:
        with suppress(StudyError):
            scene = with_sampled_grasps(folder.scene(obj))
            planned.append((make_plan(scene, folder.scene_file, folder.overrides_of(obj)), memory(scene)))
    preparing = scale * (time.process_time() - begin)
    rows = {"objects": f"{len(objects)}, of which {len(some)} were looked at"}
    if planned:
        plans, budget = [made for made, _ in planned], TIMED_S / len(planned)
        each, loads = zip(*(timed(p.tried, budget, p.layout.inputs) for p in plans), strict=True)
        paths = [seconds for some in each for seconds in some]
        times = max(1, round(scale))
        many, solving, start = paths * times, scale / times, begin + sum(loads) + END_S
        on = {f"{n} rank{'s' * (n > 1)}": (preparing / n, solving * makespan(many, n)) for n in ranks}
        cases, space = (scale * sum(getattr(made.layout, name) for made, _ in planned) for name in ("rows", "nbytes"))
        need, free = max(needs for _, needs in planned), free_bytes(out / "index.hdf")
        rows |= {
            "cases": f"about {cases:.0f}",
            "disk": f"about {space / 1e6:.3g} MB in {out}, {free / 1e9:.1f} GB free",
            "memory": f"roughly {gigabytes(need, 1)} on each rank, {gigabytes(need * ranks[0], 2)} on {ranks[0]}",
            "time": "; ".join(f"about {duration(start + sum(t))} on {name}" for name, t in on.items())
            + f"; {duration(preparing)} for sampling grasps on one; {TIMED}",
        }
    if len(planned) < len(some):
        rows["no grasp"] = f"{len(some) - len(planned)} of {len(some)}: they are rows of the index, with the reason"
    return "\n".join(aligned(rows))


def schema(_options: Namespace) -> str:
    """Print the JSON schema of a scene."""
    return json.dumps(Scene.model_json_schema(), indent=2)


def scene_of(options: Namespace) -> Scene:
    """The scene that the command line names, with what it changes."""
    return load_scene(Path(options.scene), [*options.overrides, *petsc_overrides(options.petsc)])


def objects_of(options: Namespace) -> ObjectFolder | None:
    """The objects of a scene or of ``--objects``, which becomes an override; None for a scene of one."""
    if options.objects is not None:
        meshes = Path(options.objects).absolute()
        pattern = meshes / "*" if meshes.is_dir() else meshes
        options.overrides = [*options.overrides, f"object.mesh={quoted(str(pattern))}"]
    return folder_of(options.scene, [*options.overrides, *petsc_overrides(options.petsc)])


def target(options: Namespace, ending: str = "") -> Path:
    """The result file of a run; refuse names that no viewer would open. By default the scene's name and ``ending``."""
    if options.output is None:
        return Path("results") / f"{Path(options.scene).stem}{ending}.hdf"
    return with_ending("-o", options.output, ".hdf")


def results_folder(options: Namespace) -> Path:
    """The folder of the results; by default the scene's name."""
    out = Path(options.output or Path("results") / Path(options.scene).stem)
    if out.suffix == ".hdf" or out.is_file():
        raise StudyError(USAGE, f"-o: found '{out}', expected a folder, for a scene of many objects")
    return out


def petsc_overrides(words: Sequence[str]) -> list[str]:
    """PETSc options of the command line as overrides of the scene's ``[petsc]`` table.

    >>> petsc_overrides(["-contact_snes_monitor", "-contact_snes_rtol", "1e-9"])
    ['petsc.contact_snes_monitor=true', 'petsc.contact_snes_rtol=1e-9']
    """
    options: list[list[str]] = []
    for word in words:
        if word.startswith("-contact_"):
            options.append([word[1:], "true"])
        # A number with a sign is a value; any other word with a dash is an option of somebody else.
        elif (word.startswith("-") and not word[1:2].isdigit()) or not options or options[-1][1] != "true":
            text = f"found '{word}' after '--', expected an option of the contact solver, as -contact_...; {OTHERS}"
            raise StudyError(USAGE, text)
        else:
            options[-1][1] = word
    return [f"petsc.{name}={value}" for name, value in options]
