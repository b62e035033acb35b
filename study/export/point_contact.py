"""The friction of each finger as numbers that a simulator takes: largest forces and torque over its normal force.

A simulator that lets a contact touch at one point asks how much friction that point carries for the normal force that
it finds there. Of a contact with the largest forces f_x, f_y along the axes of its frame, the largest torque tau_z
about its normal, and the normal force F_N (`study.quantities`) these are

    mu_x = f_x / F_N,   mu_y = f_y / F_N,   r = tau_z / F_N  [m],

for which r = e_n mu S / F_N, with S the sum of pressure times area; where the contact is flat S is F_N, mu_x and mu_y
are the friction coefficient and r = mu e_n. The three are the semi-axes of the ellipsoid that grasp quality is computed
from, over F_N. They hold at one normal force: a pad that is pressed harder has a larger patch and a larger r.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.study.export.selection import FloatArray, RankedGrasp
from softjaw.study.messages import USAGE, StudyError

RADIUS = 0.01  # of the ball that stands for a pad [m]: any will do, because it touches at one point
PAD_MASS, OBJECT_MASS = 0.02, 0.1  # [kg]: a result file need not know them, and friction does not depend on them


@dataclass(frozen=True, eq=False)
class PointContact:
    """One finger: its contact frame (axes x, y, N as columns, N into the object), and its friction over ``F_N`` [N]."""

    rotation: FloatArray
    origin: FloatArray
    mu_x: float
    mu_y: float
    r: float
    F_N: float

    @property
    def mu(self) -> float:
        """The smaller of both, for simulators whose friction has no direction."""
        return min(self.mu_x, self.mu_y)


@dataclass(frozen=True, eq=False)
class Cell:
    """A grasp as the small scene that simulators get: both contacts, and the frame of the object's own file.

    All of it stands in the frame of the closed pads: origin midway between their faces, x from finger 1 to finger 2, y
    along their long side.
    """

    contacts: tuple[PointContact, PointContact]
    rotation: FloatArray
    origin: FloatArray


def cell(grasp: RankedGrasp) -> Cell:
    """The scene of a grasp.

    Raises
    ------
    StudyError
        A finger of the grasp carries no load, so that its friction has no ratio to it.
    """
    pads = grasp.case["fingers"]
    across, along = pads[0]["pose_rotation"][:, 2], pads[0]["pose_rotation"][:, 0]
    W = np.column_stack([across, along, np.cross(across, along)])
    middle = (pads[0]["pose_origin"] + pads[1]["pose_origin"]) / 2
    first, second = (_contact(finger, W, middle) for finger in pads)
    return Cell((first, second), W.T, -W.T @ middle)


def _contact(finger: dict[str, Any], W: FloatArray, middle: FloatArray) -> PointContact:
    F_N = float(finger["F_N"])
    if not (math.isfinite(F_N) and F_N > 0):
        raise StudyError(USAGE, f"this grasp has a normal force of {F_N:g} N: friction over it is not defined")
    # Between two solved forces the axes lie on straight lines, which leave the rotations: the nearest one is taken.
    U, _, V = np.linalg.svd(W.T @ finger["frame_axes"].T)
    f_x, f_y, tau_z = (float(finger[name]) / F_N for name in ("f_x_max", "f_y_max", "tau_z_max"))
    return PointContact(U @ V, W.T @ (finger["frame_origin"] - middle), f_x, f_y, tau_z, F_N)


def numbers(*values: float) -> str:
    """Numbers as attributes and elements hold them, apart by spaces; no digit is lost.

    >>> numbers(0.1, -0.0, 2)
    '0.1 0.0 2.0'
    """
    return " ".join(repr(float(value) + 0.0) for value in values)


def heading(grasp: RankedGrasp) -> list[str]:
    """What the comment at the top of a file says of its grasp."""
    lines = ["Made by softjaw from one grasp of a result file; lengths in m, forces in N.", *grasp.remark.splitlines()]
    return [line.replace("--", "- -") for line in lines]  # two dashes would end a comment of XML
