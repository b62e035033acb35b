"""The command that writes grasps for planners and simulators."""

import sys
from argparse import Namespace
from collections.abc import Callable
from functools import partial
from pathlib import Path

from softjaw.study.cli.options import GRIPPER, refuse_unused
from softjaw.study.export.cases import as_csv, as_json
from softjaw.study.export.data_set import FORMS, checked_rows, write_data_set
from softjaw.study.export.planners import CLOSING, as_graspgen, as_yaml
from softjaw.study.export.rigid_body import body_of
from softjaw.study.export.selection import GripperFrame, chosen, first, grasps, usable
from softjaw.study.export.simulators import as_mjcf, as_sdf, as_stl, as_usd
from softjaw.study.grippers import Hand, gripper_file
from softjaw.study.messages import USAGE, StudyError, write_file
from softjaw.study.ranking import task_keys
from softjaw.study.result.index import index_path
from softjaw.study.result.read import open
from softjaw.study.units import in_si

TABLES = {"csv": as_csv, "json": as_json}
PLANNERS: dict[str, Callable[..., str]] = {form: partial(as_yaml, form) for form in ("isaac_grasp", "moveit")}
PLANNERS["graspgen"] = as_graspgen
SIMULATORS = {"mjcf": as_mjcf, "sdf": as_sdf, "physx": as_usd}
DATA_SETS = ("acronym", "webdataset")  # of folders alone
UNUSED = {  # options that a format has no use for
    **dict.fromkeys(TABLES, GRIPPER), **dict.fromkeys(SIMULATORS, GRIPPER[1:]), "graspgen": ("frame",),
    "vtk": ("by", "model", "most", "min", *GRIPPER),
}  # fmt: skip


def export(options: Namespace) -> str:
    """Write grasps for planners and simulators; files that were written, or the text itself."""
    index = index_path(options.file)
    if index and options.form not in FORMS:
        raise StudyError(USAGE, f"--format: found '{options.form}', expected {', '.join(FORMS)} for a folder")
    if options.output is None and (index or options.form == "vtk"):
        raise StudyError(USAGE, f"--format {options.form}: name what to write with -o")
    if options.output and Path(options.output).resolve() == Path(options.file).resolve():
        raise StudyError(USAGE, f"-o: found '{options.output}', expected another file than the results")
    if index:
        refuse_unused(options, "force", "by", "model", "most", "min", "frame")
        rows, presets = checked_rows(index)
        if len(presets) > 1 and not options.gripper:
            names = ", ".join(sorted(preset or "no preset" for preset in presets))
            raise StudyError(USAGE, f"{index}: found objects of several grippers ({names}): name one with --gripper")
        gripper = gripper_of(options, next(iter(presets), None))
        return write_data_set(index, rows, Path(options.output), options.form, gripper)
    if options.form in DATA_SETS:
        raise StudyError(USAGE, f"--format {options.form}: found '{options.file}', expected a folder of objects")
    refuse_unused(options, *UNUSED.get(options.form, ()), form=options.form)
    ds = open(options.file)
    if options.form == "vtk":
        from softjaw.study.show.view.solids import write_vtk  # slow to load

        return f"written: {write_vtk(ds, Path(options.output), options.force)}"
    few = options.top if options.top is not None else 1 if options.form in SIMULATORS else 0
    choice = {name: getattr(options, name) for name in ("model", "force", "by")} | {"least": dict(options.least)}
    if options.form in TABLES:
        asked = options.force or options.by or options.least or options.top is not None
        cases = chosen(ds, top=few, **choice)[0] if asked else None
        return _written(options, [TABLES[options.form](ds, options.model, cases)])
    gripper = gripper_of(options, task_keys(ds, "gripper").get("preset"))
    ranked = grasps(ds, gripper, **choice)
    if options.form != "graspgen":  # which has a field for those that do not hold
        ranked, note = usable(ranked)
        if note:
            print(f"note: {note}", file=sys.stderr)
    if not (ranked := first(ranked, few)):
        raise StudyError(USAGE, f"{options.file}: no grasp is left to write; 'softjaw show' lists all")
    if options.form in PLANNERS:
        folder = (str(Path(options.output or ".").parent),) if options.form == "graspgen" else ()
        return _written(options, [PLANNERS[options.form](ranked, gripper, ds, *folder)])
    bodies = [body_of(ds, grasp.case) for grasp in ranked]
    if options.form != "sdf" or options.output is None:
        return _written(options, [SIMULATORS[options.form](g, b) for g, b in zip(ranked, bodies, strict=True)])
    # a model cannot hold its mesh, and NAME.stl is often the user's own
    meshes = [path.with_name(f"{path.stem}-object.stl") for path in _paths(options, len(ranked))]
    texts = [as_sdf(g, b, mesh.name) for g, b, mesh in zip(ranked, bodies, meshes, strict=True)]
    beside = [f"written: {write_file(mesh, as_stl(b))}" for b, mesh in zip(bodies, meshes, strict=True)]
    return "\n".join([_written(options, texts), *beside])


def gripper_of(options: Namespace, preset: str | None = None) -> GripperFrame:
    """The gripper that comes to the grasps: the one that is asked for, or the scene's own."""
    name = options.gripper or preset
    hand = gripper_file(name)[1] if name else Hand()
    approaches = tuple(options.approaches or (("x",) if options.form in SIMULATORS else ()))
    hand = hand.closing_along(CLOSING.get(options.form, hand.closing))
    return GripperFrame(hand, approaches, in_si("wider_mm", options.wider), options.frame)


def _written(options: Namespace, texts: list[str]) -> str:
    """The names of the files that now hold these texts, the second and later ones with a number; or the one text."""
    if options.output is None:
        if len(texts) > 1:
            raise StudyError(USAGE, f"--top: {len(texts)} grasps are a file each; name them with -o, or write --top 1")
        return texts[0]
    paths = _paths(options, len(texts))
    return "\n".join(f"written: {write_file(p, text + chr(10))}" for p, text in zip(paths, texts, strict=True))


def _paths(options: Namespace, count: int) -> list[Path]:
    path = Path(options.output)
    return [path if count == 1 else path.with_stem(f"{path.stem}-{i}") for i in range(1, count + 1)]
