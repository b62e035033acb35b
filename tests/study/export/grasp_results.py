"""A result file of five grasps at three forces whose frictions are formulas: nothing is solved."""

import runpy
from functools import lru_cache
from types import SimpleNamespace

import numpy as np

from softjaw.study.case.poses import axis_poses
from softjaw.study.export.rigid_body import body_of
from softjaw.study.export.selection import GripperFrame, grasps
from softjaw.study.grippers import Hand
from softjaw.study.result.read import open as open_result
from tests.study.formula_results import grid_axes, make
from tests.study.launching import ROOT

STATIONS = np.linspace(0.0, 0.04, 5)
ANGLES = np.radians([0.0, 40.0, 90.0, 200.0, 330.0])  # one for each station
FORCES = np.array([1.0, 4.0, 16.0])
RADIUS = 0.02
TILT = np.radians([0.0, 0.0, 8.0, 0.0, 12.0])  # of the contact normals against the approach
MU_X, MU_Y = np.array([0.9, 0.5, 0.7, 0.62, 0.8]), np.array([0.8, 0.6, 0.7, 0.45, 0.75])  # over F_N
E_N = np.array([3.0, 5.0, 8.0, 12.0, 15.0]) * 1e-3


def geometry(i):
    """Rotations and origins of both pads of a grasp, and its contact frames in their pads."""
    poses = axis_poses(STATIONS[i], ANGLES[i], 0.3 * i)
    R = np.stack([pose.rotation for pose in poses])
    middle = np.array([0.001, -0.002, STATIONS[i]])
    o = np.stack([middle - RADIUS * pose.rotation[:, 2] for pose in poses])
    c, s = np.cos(TILT[i]), np.sin(TILT[i])
    return R, o, np.stack([[[1, 0, 0], [0, c, -s], [0, s, c]], [[1, 0, 0], [0, c, s], [0, -s, c]]])


def write(path, **more):
    """The file: both fingers carry ``MU_X F_N``, ``MU_Y F_N`` and ``E_N F_N mu``, where mu is the smaller slide."""
    shape = (len(STATIONS), 1, len(FORCES))
    R, o, frames = (np.stack(v) for v in zip(*map(geometry, range(5)), strict=True))
    over = np.broadcast_to(FORCES, shape)
    two = over[..., None] * np.array([1.0, 1.0])

    def each(values):
        found = (np.asarray(values)[:, None, None] * over)[..., None, None]
        return np.broadcast_to(found, (*shape, 2, 3))

    def placed(values):
        return np.broadcast_to(values[:, None, None], (*shape, *values.shape[1:]))

    datasets = {
        "fingers/F_N": two, "fingers/S": 1.1 * two, "fingers/f_x_max": each(MU_X), "fingers/f_y_max": each(MU_Y),
        "fingers/tau_z_max": each(E_N * np.minimum(MU_X, MU_Y)), "fingers/pose_rotation": placed(R),
        "fingers/pose_origin": placed(o), "fingers/frame_axes": placed(frames),
        "fingers/frame_origin": np.array([0.0, 0.0, 0.001]), "opening/opening": 2 * RADIUS,
        "opening_loaded/opening_loaded": 2 * RADIUS - 0.002, "payload/ccm": 0.1 * over * (1 + STATIONS[:, None, None]),
        "quality/ccm": 0.3 + STATIONS[:, None, None] + 0.0 * over,
    } | more  # fmt: skip
    return make(path, axes=grid_axes(STATIONS, [0.0], FORCES), **{k.replace("/", "__"): v for k, v in datasets.items()})


@lru_cache
def opened(path):
    return open_result(path)


@lru_cache
def all_grasps(path, force):
    found = grasps(opened(path), GripperFrame(Hand(closing="x")), force=force)
    return sorted(found, key=lambda grasp: grasp.case["place"]["station"])


@lru_cache
def body(path):
    return body_of(opened(path), all_grasps(path, 4.0)[0].case)


def slipping(simulator):
    return SimpleNamespace(**runpy.run_path(str(ROOT / f"jobs/{simulator}-slip.py")))
