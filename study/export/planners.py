"""Grasps in the files that motion planners read: isaac_grasp, GraspGen and moveit_msgs/Grasp.

All three take the pose of the gripper's frame in the frame of the object's own file; `study.export.selection` says how
the frame lies in the pads. Lengths are in m.

isaac_grasp (Isaac Sim, "Grasp Editor"; Isaac ROS, "Isaac Grasp File", format version 1.0): ``position``,
``orientation`` as ``{w, xyz}``, ``confidence`` from 0 to 1, ``cspace_position`` of the joints in the grasp and
``pregrasp_cspace_position`` before it. Both pages say that the names of the frames are for the reader; they have
different keys for them, and all are written.

GraspGen (``docs/GRASP_DATASET_FORMAT.md`` and ``docs/GRIPPER_DESCRIPTION.md`` of NVlabs/GraspGen, version 1.0.0):
``object/file`` and ``object/scale``, ``grasps/transforms`` (4 x 4, of the gripper's base) and
``grasps/object_in_gripper``, a mask of the grasps that hold. Its gripper closes along x and approaches along z. Readers
take these keys by name, so what else is known stands beside them.

moveit_msgs/Grasp (``msg/Grasp.msg``, ``msg/GripperTranslation.msg`` of moveit_msgs for ROS 2): a list of messages with
every field. Quaternions are ``{x, y, z, w}``. An empty ``frame_id`` of the pose stands for the object, whose pose
MoveIt takes from its first shape; approach and retreat are along the gripper's own z axis.
"""

from __future__ import annotations

import json
import math
import os
import re
from collections.abc import Sequence
from typing import Any

import xarray as xr

from softjaw.study.case.reach import WAY
from softjaw.study.export.cases import MEANING
from softjaw.study.export.selection import GripperFrame, RankedGrasp
from softjaw.study.ranking import task_keys
from softjaw.study.table import plain
from softjaw.study.units import UNITS

# of every gripper of the format; others have the hand's own
CLOSING = {"graspgen": "x", "acronym": "x", "webdataset": "x"}
LEAST_WAY = WAY / 2  # of approach and retreat [m] that is enough


def as_isaac_grasp(found: Sequence[RankedGrasp], gripper: GripperFrame, ds: xr.Dataset) -> str:
    """An isaac_grasp file; what it has no field for stands in comments."""
    made: dict[str, Any] = {"#": _about(ds, gripper), "format": "isaac_grasp", "format_version": 1.0}
    for key, name in (("object_frame", gripper.object_frame), ("gripper_frame", gripper.hand.frame)):
        made |= {key: name, f"{key}_link": name}
    made["grasps"] = {grasp.name: _isaac_grasp(grasp) for grasp in found}
    return yaml_text(made)


def _isaac_grasp(grasp: RankedGrasp) -> dict[str, Any]:
    x, y, z, w = grasp.quaternion.tolist()
    return {
        "#": grasp.remark,
        "confidence": grasp.merit,
        "position": grasp.origin.tolist(),
        "orientation": {"w": w, "xyz": [x, y, z]},
        "cspace_position": grasp.hold.closed_joints,
        "pregrasp_cspace_position": grasp.hold.open_joints,
    }


def as_graspgen(grasps: Sequence[RankedGrasp], gripper: GripperFrame, ds: xr.Dataset, folder: str = ".") -> str:
    """A GraspGen file of all grasps, also of those that do not hold, with everything else that is known beside them.

    The mesh is named from the ``folder`` of the file.
    """
    keys = task_keys(ds, "object")
    file = os.path.relpath(keys["mesh"], folder) if "mesh" in keys else ""
    made = {
        "object": {"file": file, "scale": UNITS[keys.get("unit", "m")].size},
        "gripper": {"name": gripper.hand.frame, "approach_axis": "z", "closing_axis": gripper.along,
                    "about": _about(ds, gripper)},
        "grasps": {
            "transforms": [grasp.matrix.tolist() for grasp in grasps],
            "object_in_gripper": [not grasp.reasons for grasp in grasps],
            "qualities": [grasp.merit for grasp in grasps],
            "forces": [grasp.force for grasp in grasps],
            "widths": [plain(grasp.maps["opening"]) for grasp in grasps],
            "names": [grasp.name for grasp in grasps],
            "warnings": [[*grasp.warnings, *grasp.hold.unfit] for grasp in grasps],
        },
        "softjaw": {
            "file": str(ds.attrs["file"]), "units": grasps[0].units if grasps else {}, "meaning": MEANING,
            "cases": [{key: plain(value) for key, value in grasp.case.items()} for grasp in grasps],
        },
    }  # fmt: skip
    return json.dumps(made, indent=1)


def as_moveit(found: Sequence[RankedGrasp], gripper: GripperFrame, ds: xr.Dataset) -> str:
    """A list of moveit_msgs/Grasp under ``grasps``; what a message has no field for stands in comments."""
    return yaml_text({"#": _about(ds, gripper), "grasps": [_moveit(grasp, gripper) for grasp in found]})


def _moveit(grasp: RankedGrasp, gripper: GripperFrame) -> dict[str, Any]:
    pose = {
        "position": dict(zip("xyz", grasp.origin.tolist(), strict=True)),
        "orientation": dict(zip("xyzw", grasp.quaternion.tolist(), strict=True)),
    }
    return {
        "#": grasp.remark,
        "id": grasp.name,
        "pre_grasp_posture": _posture(grasp.hold.open_joints, []),
        "grasp_posture": _posture(grasp.hold.closed_joints, [grasp.force]),
        "grasp_pose": {"header": _header(gripper.object_frame), "pose": pose},
        "grasp_quality": grasp.merit,
        "pre_grasp_approach": _way(gripper, 1.0),
        "post_grasp_retreat": _way(gripper, -1.0),
        "post_place_retreat": _way(gripper, -1.0),
        "max_contact_force": grasp.force,
        "allowed_touch_objects": [],
    }


def _header(frame: str) -> dict[str, Any]:
    return {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": frame}


def _posture(joints: dict[str, float], effort: list[float]) -> dict[str, Any]:
    """A trajectory_msgs/JointTrajectory of one point."""
    point = {
        "positions": list(joints.values()),
        "velocities": [],
        "accelerations": [],
        "effort": effort * len(joints),
        "time_from_start": {"sec": 1, "nanosec": 0},
    }
    return {"header": _header(""), "joint_names": list(joints), "points": [point]}


def _way(gripper: GripperFrame, z: float) -> dict[str, Any]:
    """A moveit_msgs/GripperTranslation along the gripper's own z axis."""
    direction = {"header": _header(gripper.hand.frame), "vector": {"x": 0.0, "y": 0.0, "z": z}}
    return {"direction": direction, "desired_distance": WAY, "min_distance": LEAST_WAY}


def _about(ds: xr.Dataset, gripper: GripperFrame) -> str:
    """What to know about all grasps of a file."""
    return "\n".join(
        [
            f"Made by softjaw from {ds.attrs['file']}: poses of the gripper in the frame of the object's own file [m].",
            f"Gripper: {gripper.hand.frame}, approaches along z, closes along {gripper.along} from finger 1 to 2.",
            "Quality and confidence are relative to the best grasp of this file.",
        ]
    )


# --- YAML as readers of versions 1.1 and 1.2 take it ------------------------------------------------------------------


def yaml_text(value: Any, indent: int = 0) -> str:
    """Mappings as blocks, lists of numbers in one line; every number is one for readers of YAML 1.1 and 1.2.

    A text in the key ``#`` is a comment, on lines of its own.

    >>> print(yaml_text({"a": {"b": [1.0, 1e-5], "c": "on", "#": "note"}, "d": []}))
    a:
      b: [1.0, 1.0e-05]
      c: "on"
      # note
    d: []
    """
    pad, lines = " " * indent, []
    for key, held in value.items():
        if key == "#":
            lines += [f"{pad}# {line}" for line in str(held).splitlines()]
        elif isinstance(held, dict) and held:
            lines += [f"{pad}{key}:", yaml_text(held, indent + 2)]
        elif isinstance(held, list | tuple) and held and isinstance(held[0], dict):
            blocks = [yaml_text(member, indent + 2) for member in held]
            lines += [f"{pad}{key}:", *(f"{pad}- {block.lstrip()}" for block in blocks)]
        else:
            lines.append(f"{pad}{key}: {_flow(held)}")
    return "\n".join(lines)


def _flow(value: Any) -> str:
    """A value in one line: JSON, which is YAML, but for the numbers that YAML 1.1 would take for texts.

    >>> _flow(2e-7), _flow("2e-7"), _flow({"w": 1.0, "xyz": [0.0, 5e-324]})
    ('2.0e-07', '"2e-7"', '{w: 1.0, xyz: [0.0, 5.0e-324]}')
    """
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {_flow(held)}' for key, held in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_flow, value))}]"
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else f"{'-' * (value < 0)}.inf"
    if isinstance(value, float):
        return re.sub(r"^(-?\d+)e", r"\1.0e", repr(value))
    return json.dumps(value)
