"""A folder of objects as one data set to learn from: every grasp with its label, in three formats.

A grasp is a candidate at one normal force. It is successful where it holds (a known mass with its safety) and does no
harm (flags); the others, and those that are too wide, collide or slip before any solve, are the unsuccessful ones. So
are grasps that a sampler offered and rejected, which have no force; ``state`` says which. Not converged is left out.
All formats hold the same arrays, SI units, in the frame of the object's own file, whose coordinates times ``scale`` are
metres. An object's name decides its split, so that a data set that grows keeps its splits.
"""

import hashlib
import io
import json
import tarfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from softjaw.fem.objects.gap import IN_PLACE, Pose
from softjaw.study.case.poses import explicit_poses, moved, pose_of
from softjaw.study.export.cases import MEANING, cases
from softjaw.study.export.selection import GripperFrame, gripper_frame, holds
from softjaw.study.flags import LOST
from softjaw.study.messages import OTHER_FILE, USAGE, StudyError, beside, write_file
from softjaw.study.quantities import BY_KEY, DONE, NO_GRASP, STATES
from softjaw.study.ranking import judged, task_keys
from softjaw.study.result.index import STOPPED, arrays_file, read_index
from softjaw.study.result.read import maps_in, open, scene_of
from softjaw.study.result.store import open_result, torn_rows
from softjaw.study.scene.text import parse_toml, scene_table, toml_text
from softjaw.study.table import Row, plain
from softjaw.study.units import UNITS

VALID_SHARE = 5  # one object in so many is for validation
SHARD = 100  # objects of a shard
SPLITS = ("train", "valid")
MAPS = ("payload", "quality", "e_n", "f_x_max", "f_y_max", "tau_z_max", "opening", "opening_loaded")
UNITS_OF = {"transforms": "m", "force": "N", **{name: BY_KEY[f"maps/{name}"].unit for name in MAPS}}
SURFACE = ("frame_origin", "frame_axes", "semi_axes", "unit", "coefficients", "matrix")  # of each finger
Arrays = dict[str, np.ndarray]


class ObjectGrasps(NamedTuple):
    """All grasps of one object: ``arrays`` by name with the grasp as first axis, and where its mesh is."""

    name: str
    mesh: Path
    scale: float
    mass: float
    arrays: Arrays

    @property
    def split(self) -> str:
        """Whether it is for training or for validation."""
        return SPLITS[int(hashlib.sha256(self.name.encode()).hexdigest(), 16) % VALID_SHARE == 0]

    @property
    def file(self) -> str:
        """Name of the mesh in the data set."""
        return self.name + self.kind

    @property
    def kind(self) -> str:
        """Ending of the mesh in the data set: glTF, whose parts may lie in files beside it, becomes one file."""
        return self.mesh.suffix.lower().replace(".gltf", ".glb")

    @property
    def content(self) -> bytes:
        """The mesh in the data set."""
        if self.kind == self.mesh.suffix.lower():
            return self.mesh.read_bytes()
        import trimesh  # slow to load

        return bytes(trimesh.load(self.mesh).export(file_type="glb"))


Files = dict[str, bytes]  # of one object, by name


def write_data_set(index: Path, rows: Sequence[Row], out: Path, form: str, gripper: GripperFrame) -> str:
    """Write the grasps of a folder's objects ``rows`` as a data set into ``out``; a line that says what was written.

    Raises `StudyError`: a file cannot be read or written, or no object has a grasp.
    """
    if out.resolve() == index.parent.resolve():
        raise StudyError(USAGE, f"-o: found '{out}', expected another folder than that of the results")
    before = {path: path.stat().st_mtime_ns for path in out.rglob("*") if path.is_file()}
    listed: dict[str, list[str]] = {split: [] for split in SPLITS}
    good = total = 0
    with ExitStack() as stack:
        opened = {split: stack.enter_context(ExitStack()) for split in SPLITS}
        shards: dict[str, tarfile.TarFile] = {}
        for grasps in _objects(index, rows, gripper):
            number, position = divmod(len(listed[grasps.split]), SHARD)
            if form == "webdataset" and not position:
                shard = opened[grasps.split]
                shard.close()  # the one before
                made = shard.enter_context(beside(out / f"{grasps.split}-{number:06d}.tar", folders=True))
                shards[grasps.split] = shard.enter_context(tarfile.open(made, "w"))
            _add(FORMS[form](grasps), out, shards.get(grasps.split))
            listed[grasps.split].append(grasps.file)
            good += int(grasps.arrays["object_in_gripper"].sum())
            total += len(grasps.arrays["object_in_gripper"])
    if not total:
        raise StudyError(USAGE, f"{index}: found no grasp that is solved; 'softjaw status' says why")
    for split, files in listed.items():
        write_file(out / "splits" / f"{split}.txt", "".join(f"{file}\n" for file in files), folders=True)
    about = {"format": form, "grasps": total, "successful": good, "splits": {k: len(v) for k, v in listed.items()},
             "gripper": {"name": gripper.hand.frame, "approach_axis": "z", "closing_axis": gripper.hand.closing},
             "units": UNITS_OF, "meaning": MEANING, "states": STATES,
             "object_in_gripper": "holds (a known mass with task.safety), does no harm, and this gripper can take it"}
    write_file(out / "data-set.json", json.dumps(about, indent=1))
    counts = " and ".join(f"{len(files)} for {split}" for split, files in listed.items())
    others = len(rows) - len(_solved(rows))
    without = f"; {others} objects without a solved grasp are left out" * bool(others)
    begun = sum(row["state"] == STOPPED for row in _solved(rows))
    without += f"; {begun} objects are not complete" * bool(begun)
    stale = sum(path.stat().st_mtime_ns == stamp for path, stamp in before.items())
    older = f"\nnote: {stale} files in {out} are from before and of other objects or formats" * bool(stale)
    return f"written: {out}: {counts}; {good} of {total} grasps are successful{without}{older}"


def _add(files: Files, out: Path, shard: tarfile.TarFile | None) -> None:
    """Write the files of an object into a folder, or into a shard."""
    for name, content in files.items():
        if shard is None:
            write_file(out / name, content, folders=True)
            continue
        entry = tarfile.TarInfo(name)
        entry.size = len(content)
        shard.addfile(entry, io.BytesIO(content))


# --- formats ----------------------------------------------------------------------------------------------------------


def _as_json(grasps: ObjectGrasps) -> bytes:
    """One object as GraspGen keeps it; what is not known is null."""
    about = {"file": grasps.file, "scale": grasps.scale, "mass": plain(grasps.mass)}
    arrays = {name: plain(values) for name, values in grasps.arrays.items()}
    return json.dumps({"object": about, "grasps": arrays}).encode()


def _graspgen(grasps: ObjectGrasps) -> Files:
    """``objects/NAME.stl``, and ``grasps/NAME.json`` for each."""
    return {f"objects/{grasps.file}": grasps.content, f"grasps/{grasps.name}.json": _as_json(grasps)}


def _acronym(grasps: ObjectGrasps) -> Files:
    """``meshes/NAME.stl``, and ``grasps/NAME_SCALE.h5`` for each, with more qualities beside the simulated one."""
    mesh, arrays = f"meshes/{grasps.file}", dict(grasps.arrays)
    made = {"object/file": mesh, "object/scale": grasps.scale, "object/mass": grasps.mass,
            "grasps/transforms": arrays.pop("transforms"),
            "grasps/qualities/flex/object_in_gripper": arrays.pop("object_in_gripper").astype(np.int64)}
    made |= {f"grasps/qualities/softjaw/{name}": values for name, values in arrays.items()}
    return {mesh: grasps.content, f"grasps/{grasps.name}_{grasps.scale!r}.h5": arrays_file(made)}


def _webdataset(grasps: ObjectGrasps) -> Files:
    """``train-000000.tar``, ...: for each object ``NAME.json``, as GraspGen keeps it, and ``NAME.mesh.stl``."""
    key = grasps.name.replace("%", "%25").replace(".", "%2e")  # what follows the first dot is the kind of a file
    return {f"{key}.json": _as_json(grasps), f"{key}.mesh{grasps.kind}": grasps.content}


FORMS = {"graspgen": _graspgen, "acronym": _acronym, "webdataset": _webdataset}


def checked_rows(index: Path) -> tuple[list[Row], set[str | None]]:
    """Rows of a folder's objects, and the grippers that scenes of those name which have solved cases.

    Raises `StudyError`: a result file is missing or damaged, or a mesh is missing.
    """
    (rows, _), presets = read_index(index), set()
    for row in _solved(rows):
        path, mesh = index.parent / row["file"], index.parent / row["mesh"]
        with open_result(path) as result:
            presets.add(scene_table(result.scene, "gripper").get("preset"))
            if torn_rows(path, result.layout):
                raise StudyError(OTHER_FILE, f"{path}: damaged, numbers do not match their checksums; run it again")
        if not mesh.is_file():
            raise StudyError(OTHER_FILE, f"{mesh}: no such file; put the mesh of '{row['object']}' back")
    return rows, presets


def _solved(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["done"] > 0]


def _objects(index: Path, rows: Sequence[Row], gripper: GripperFrame) -> Iterator[ObjectGrasps]:
    for row in _solved(rows):
        ds, mesh = open(index.parent / row["file"]), index.parent / row["mesh"]
        tables = parse_toml(ds.attrs["scene"], row["file"])
        tables["object"] |= {"mesh": str(mesh.resolve())} if "mesh" in tables["object"] else {}  # where it is now
        ds.attrs["scene"] = toml_text(tables)
        scale = UNITS[task_keys(ds, "object").get("unit", "m")].size
        each = [grasp_arrays(ds, gripper._replace(approach=(way,))) for way in gripper.approach]
        each = each or [grasp_arrays(ds, gripper)]
        arrays = {name: np.concatenate([part[name] for part in each]) for name in each[0]}
        yield ObjectGrasps(row["object"], mesh, scale, row["mass"], arrays)


def grasp_arrays(ds: xr.Dataset, gripper: GripperFrame) -> Arrays:
    """Arrays over the grasps of a result file: ``transforms (n, 4, 4)``, ``object_in_gripper (n,)``, maps and surfaces.

    Errors of maps are relative, NaN where they are not known, as is everything of a grasp that was not solved.
    """
    ds = ds.assign(flags=(ds.status.dims, judged(ds), ds["flags"].attrs))
    status = ds.status.values
    solved = [tuple(map(int, at)) for at in np.argwhere(status == DONE)]
    poses = _poses(ds)
    refused = [tuple(map(int, at)) for at in np.argwhere(np.isin(status, NO_GRASP)) if at[-3] < len(poses)]
    listed = list(cases(ds, "ccm", [*solved, *refused]))
    for case, at in zip(listed[len(solved) :], refused, strict=True):
        _placed(case, poses[at[-3]])
    listed += [_offered(listed[0], row) for row in ds.attrs["rejected"].reshape(-1, 10) if listed]
    transforms, success = np.tile(np.eye(4), (len(listed), 1, 1)), np.zeros(len(listed), bool)
    for i, case in enumerate(listed):
        approach = (gripper.approach or gripper.hand.approaches)[0]
        depth = gripper.hand.depth(gripper.hand.stroke_mm / 1e3)
        if i < len(solved):
            approach, hold = next(iter(holds(ds, case, gripper).items()))
            depth = hold.depth
            success[i] = not (case["flags"] & LOST or hold.unfit) and case["maps"].get("payload", 1.0) > 0
        transforms[i, :3, :3], transforms[i, :3, 3] = gripper_frame(case, approach, gripper.hand.closing, depth)
    arrays = {"transforms": transforms, "object_in_gripper": success}
    arrays["force"] = np.array([case["place"]["normal_force"] for case in listed], float)
    arrays["state"] = np.array([STATES.index(case["state"]) for case in listed], np.int64)
    arrays["flags"] = np.array([case["flags"] for case in listed], np.int64)
    known = maps_in(ds)
    for name in (n for q in MAPS for n in (q, f"{q}_error") if n in known):
        arrays[name] = np.array([case["maps"][name] for case in listed], float)
    for name in SURFACE:
        arrays[name] = np.array([[finger[name] for finger in case["fingers"]] for case in listed], float)
    return arrays


def _placed(case: dict[str, Any], poses: tuple[Pose, Pose]) -> None:
    for finger, pose in zip(case["fingers"], poses, strict=True):
        finger |= {"pose_origin": pose.origin, "pose_rotation": pose.rotation}


def _offered(like: dict[str, Any], row: np.ndarray) -> dict[str, Any]:
    """A grasp that the sampler offered and rejected, with the keys of another case and nothing known."""
    pose = pose_of(tuple(row[:9].astype(float)))
    fingers = [{name: np.full_like(value, np.nan, dtype=float) for name, value in f.items()} for f in like["fingers"]]
    case = {"place": {"normal_force": np.nan}, "state": STATES[int(row[9])], "flags": 0, "fingers": fingers}
    _placed(case, explicit_poses(pose, IN_PLACE))
    return case | {"maps": dict.fromkeys(like["maps"], np.nan)}


def _poses(ds: xr.Dataset) -> list[tuple[Pose, Pose]]:
    """Poses of the scene's explicit candidates in the frame of the object's file, solved or not."""
    where = scene_of(ds).candidates
    return [moved(explicit_poses(pose, IN_PLACE), where.shift, where.roll) for pose in where.poses or ()]
