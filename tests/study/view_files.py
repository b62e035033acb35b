"""Result files of known geometry for the tests of the three-dimensional views."""

import math

import numpy as np

from softjaw.study.case.result import CaseResult
from softjaw.study.result.layout import Layout
from tests.study.formula_results import OBJECT, grid_axes, written

GRID = (4, 4)  # faces of a pad's front: elements = [2, 2, 2] of eight nodes
SIZE = (0.05, 0.022, 0.015)
CLOSING, PRESSURE = 2e-3, 3e4
SCENE = f"{OBJECT}[gripper]\nelements = [2, 2, 2]\n[candidates]\nstations_mm = [-20, 0, 20]\nangles_deg = [0, 90]\n"
SCENE += "[load]\nnormal_force_n = [1, 5]\n"
FAILED = (2, 1, 1)
AXES = grid_axes([-0.02, 0.0, 0.02], [0, math.pi / 2], [1.0, 5.0])


def quality(index):
    """Largest at station 1, angle 0; grows with the force."""
    return (1.0 + index[-1]) / (1 + abs(index[0] - 1) + 2 * index[1])


def poses(index):
    station, angle = AXES[0].values[index[0]], AXES[1].values[index[1]]
    reach = (0.025, 0.02)[index[1]]
    found = []
    for sign in (-1.0, 1.0):
        z = sign * np.array([math.cos(angle), math.sin(angle), 0.0])
        x = np.array([0.0, 0.0, 1.0])
        found.append((np.stack([x, np.cross(z, x), z], axis=1), np.array([0, 0, station]) - reach * z))
    return found


def patch(force):
    u, v = ((np.arange(n) + 0.5) / n - 0.5 for n in GRID)
    x, y = np.meshgrid(u * SIZE[0], v * SIZE[1], indexing="ij")
    centroid = np.stack([x, y, np.zeros(GRID)], axis=-1).reshape(-1, 3)
    middle = (np.abs(x) < 0.25 * SIZE[0]) & (np.abs(y) < 0.25 * SIZE[1])
    one = {"centroid": centroid, "normal": np.broadcast_to([0.0, 0.0, 1.0], centroid.shape)}
    one |= {"pressure": np.where(middle, PRESSURE * force, 0.0).ravel(), "area": np.full(16, SIZE[0] * SIZE[1] / 16)}
    return {name: np.stack([values, values]) for name, values in one.items()}


def solved(layout, index):
    force = layout.axes[-1].values[index[-1]]
    three = np.array([1.0, 1.1, 0.9])
    values = {"maps/quality": quality(index) * three, "maps/e_n": 0.01 * three, "maps/flags": 0.0}
    rotation, origin = (np.stack(found) for found in zip(*poses(index), strict=True))
    values |= {"fingers/pose_rotation": rotation, "fingers/pose_origin": origin, "fingers/closing": np.full(2, CLOSING)}
    values |= {"fingers/frame_origin": np.zeros((2, 3)), "fingers/frame_axes": np.stack([np.eye(3)] * 2)}
    values |= {"fingers/S": np.full(2, force), "fingers/f_x_max": 0.8 * force * np.stack([three] * 2)}
    values |= {"fingers/tau_z_max": 0.01 * force * np.stack([three] * 2)}
    values |= {"limit_surface/semi_axes": np.broadcast_to([0.8, 0.7, 0.01], (2, 3, 3)) * three[:, None]}
    values |= {"limit_surface/rho": np.full(2, 0.05)}
    return CaseResult(values, patch(force), "")


def make(path, scene=SCENE, patches=True, failed=FAILED):
    """A file of 3 stations x 2 angles x 2 forces; one case has failed, (0, 0, 1) is missing."""
    layout = Layout(AXES, int(np.prod(GRID)) * patches)

    def case(index):
        if index == failed:
            return "no </script> convergence"
        return None if index == (0, 0, 1) else solved(layout, index)

    return written(path, layout, case, scene=scene, title="<b>thing</b>")
