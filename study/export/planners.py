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
every field. Quaternions are ``{x, y, z, w}``. An empty ``frame_id`` of the pose means the object, whose pose
MoveIt takes from its first shape; approach and retreat are along the gripper's own z axis.
"""

import json
import math
import os
import re
from collections.abc import Sequence
from typing import Any, Literal

import xarray as xr

from softjaw.study.case.reach import WAY
from softjaw.study.export.cases import MEANING
from softjaw.study.export.selection import GripperFrame, RankedGrasp
from softjaw.study.ranking import task_keys
from softjaw.study.table import plain
from softjaw.study.templates import template
from softjaw.study.units import UNITS

# of every gripper of the format; others have the hand's own
CLOSING: dict[str, Literal["x", "y"]] = {"graspgen": "x", "acronym": "x", "webdataset": "x"}


def as_graspgen(grasps: Sequence[RankedGrasp], gripper: GripperFrame, ds: xr.Dataset, folder: str = ".") -> str:
    """A GraspGen file of all grasps, also of those that do not hold, with everything else that is known beside them.

    The mesh is named from the ``folder`` of the file.
    """
    keys = task_keys(ds, "object")
    file = os.path.relpath(keys["mesh"], folder) if "mesh" in keys else ""
    made = {
        "object": {"file": file, "scale": UNITS[keys.get("unit", "m")].size},
        "gripper": {"name": gripper.hand.frame, "approach_axis": "z", "closing_axis": gripper.hand.closing,
                    "about": _about(ds, gripper)},
        "grasps": {
            "transforms": [grasp.matrix.tolist() for grasp in grasps],
            "object_in_gripper": [not grasp.reasons for grasp in grasps],
            "qualities": [grasp.merit for grasp in grasps], "forces": [grasp.force for grasp in grasps],
            "widths": [plain(grasp.maps["opening"]) for grasp in grasps], "names": [grasp.name for grasp in grasps],
            "warnings": [[*grasp.warnings, *grasp.hold.unfit] for grasp in grasps],
        },
        "softjaw": {
            "file": str(ds.attrs["file"]), "units": grasps[0].units if grasps else {}, "meaning": MEANING,
            "cases": [{key: plain(value) for key, value in grasp.case.items()} for grasp in grasps],
        },
    }  # fmt: skip
    return json.dumps(made, indent=1)


def as_yaml(form: str, grasps: Sequence[RankedGrasp], gripper: GripperFrame, ds: xr.Dataset) -> str:
    """Grasps as ``isaac_grasp`` or ``moveit``; what the format has no field for stands in comments."""
    about = _about(ds, gripper).splitlines()
    return template(f"grasp.{form}").render(about=about, grasps=grasps, gripper=gripper, flow=flow, zip=zip, WAY=WAY)


def _about(ds: xr.Dataset, gripper: GripperFrame) -> str:
    """What to know about all grasps of a file."""
    hand = gripper.hand
    return (
        f"Made by softjaw from {ds.attrs['file']}: poses of the gripper in the frame of the object's own file [m].\n"
        f"Gripper: {hand.frame}, approaches along z, closes along {hand.closing} from finger 1 to 2.\n"
        "Quality and confidence are relative to the best grasp of this file."
    )


def flow(value: Any) -> str:
    """A value in one line of YAML: JSON, but for the numbers that YAML 1.1 would take for texts.

    >>> flow(2e-7), flow("2e-7"), flow({"w": 1.0, "xyz": [0.0, 5e-324]})
    ('2.0e-07', '"2e-7"', '{w: 1.0, xyz: [0.0, 5.0e-324]}')
    """
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {flow(item)}' for key, item in value.items())}}}"
    if isinstance(value, list):
        return f"[{', '.join(map(flow, value))}]"
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else f"{'-' * (value < 0)}.inf"
    return re.sub(r"^(-?\d+)e", r"\1.0e", repr(value)) if isinstance(value, float) else json.dumps(value)
