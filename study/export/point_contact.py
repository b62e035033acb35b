"""The friction of each finger as numbers that a simulator takes: largest forces and torque over its normal force.

A simulator that lets a contact touch at one point asks how much friction that point carries for the normal force that
it finds there. Of a contact with the largest forces f_x, f_y along the axes of its frame, the largest torque tau_z
about its normal, and the normal force F_N (`study.quantities`) these are

    mu_x = f_x / F_N,   mu_y = f_y / F_N,   r = tau_z / F_N  [m],

for which r = e_n mu S / F_N, with S the sum of pressure times area; where the contact is flat S is F_N, mu_x and mu_y
are the friction coefficient and r = mu e_n. The three are the semi-axes of the ellipsoid that grasp quality is computed
from, over F_N. They hold at one normal force: a pad that is pressed harder has a larger patch and a larger r.
"""

import math
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation

from softjaw.study.export.rigid_body import DENSITY, RigidBody, places
from softjaw.study.export.selection import FloatArray, RankedGrasp
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.templates import template

RADIUS = 0.01  # of the ball that represents a pad [m]: any will do, because it touches at one point
PAD_MASS = 0.02  # [kg]: friction does not depend on it
PLATE = 5e-3  # half the thickness of the object's plates [m], far more than a ball sinks in
SHARE = 0.9  # of the payload, the most that an object without a mass weighs
DOWN = np.array([0.0, 0.0, -1.0])


class PointContact(NamedTuple):
    """One finger: its contact frame (axes x, y, N as columns, N into the object), and its friction over ``F_N`` [N].

    ``pad_rotation`` and ``pad_origin`` place the pad's own frame, whose z axis is the approach.
    """

    rotation: FloatArray
    origin: FloatArray
    mu_x: float
    mu_y: float
    r: float
    F_N: float
    pad_rotation: FloatArray
    pad_origin: FloatArray

    @property
    def mu(self) -> float:
        """The smaller of both, for simulators whose friction has no direction."""
        return min(self.mu_x, self.mu_y)


class Cell(NamedTuple):
    """A grasp as the small scene that simulators get: both contacts, and the frame of the object's own file.

    Its origin is midway between the pads' faces, and its axes are the closing axis and the long and the short side of
    the pads, in the order in which gravity (``down``, in the frame of the object's own file) is nearest to -z.
    ``closing (3,)`` points from finger 1 to finger 2.
    """

    contacts: tuple[PointContact, PointContact]
    rotation: FloatArray
    origin: FloatArray
    closing: FloatArray

    @property
    def reach(self) -> float:
        """Way of each finger to the middle [m], where fingers that have lost the object meet."""
        return 0.5 * float(np.linalg.norm(self.contacts[1].origin - self.contacts[0].origin))

    def rail(self, f: int) -> FloatArray:
        """Direction in which finger 1 or 2 closes, in its contact frame ``(3,)``."""
        return self.contacts[f - 1].rotation.T @ self.closing * (1.0 if f == 1 else -1.0)

    def plate(self, f: int) -> tuple[FloatArray, FloatArray]:
        """Rotation and middle of a plate of the object whose face is the contact plane, in the object's own frame."""
        contact = self.contacts[f - 1]
        centre = contact.origin + PLATE * contact.rotation[:, 2]
        return self.rotation.T @ contact.rotation, self.rotation.T @ (centre - self.origin)


def cell(grasp: RankedGrasp, down: FloatArray = DOWN) -> Cell:
    """The scene of a grasp; `StudyError` if a finger carries no load, so that its friction has no ratio to it."""
    pads = grasp.case["fingers"]
    across, along = pads[0]["pose_rotation"][:, 2], pads[0]["pose_rotation"][:, 0]
    W = _upright(np.column_stack([across, along, np.cross(across, along)]), np.asarray(down, float))
    middle = (pads[0]["pose_origin"] + pads[1]["pose_origin"]) / 2
    first, second = (_contact(finger, W, middle) for finger in pads)
    return Cell((first, second), W.T, -W.T @ middle, np.round(W.T @ across))


def _upright(pads: FloatArray, down: FloatArray) -> FloatArray:
    """Axes of the pads as columns, turned so that ``down`` is nearest to -z, and then the closing axis to x."""
    turned = pads @ Rotation.create_group("O").as_matrix().round()
    # Rounded, so that of equal ones the first counts on every machine.
    low, along = np.round(turned[..., 2] @ down, 6), np.round(turned[..., 0] @ pads[:, 0], 6)
    return np.asarray(turned[np.lexsort((-along, low))[0]])


def _contact(finger: dict[str, Any], W: FloatArray, middle: FloatArray) -> PointContact:
    F_N = float(finger["F_N"])
    if not (math.isfinite(F_N) and F_N > 0):
        raise StudyError(USAGE, f"this grasp has a normal force of {F_N:g} N: friction over it is not defined")
    # Between two solved forces the axes lie on straight lines, which leave the rotations: the nearest one is taken.
    U, _, V = np.linalg.svd(W.T @ finger["frame_axes"].T)
    f_x, f_y, tau_z = (float(finger[name]) / F_N for name in ("f_x_max", "f_y_max", "tau_z_max"))
    pad = W.T @ finger["pose_rotation"], W.T @ (finger["pose_origin"] - middle)
    return PointContact(U @ V, W.T @ (finger["frame_origin"] - middle), f_x, f_y, tau_z, F_N, *pad)


def carried(grasp: RankedGrasp, body: RigidBody) -> RigidBody:
    """The object with the mass that it has in a simulator: the scene's, else no more than a share of the payload."""
    most, mass = SHARE * grasp.maps["payload"], body.mass
    if body.weighed or not most < mass:  # also where the payload is unknown
        return body
    return replace(body, mass=most, inertia=body.inertia * most / mass)


def numbers(*values: float) -> str:
    """Numbers as attributes and elements hold them, apart by spaces; no digit is lost.

    >>> numbers(0.1, -0.0, 2)
    '0.1 0.0 2.0'
    """
    return " ".join(repr(float(value) + 0.0) for value in values)


def heading(grasp: RankedGrasp, body: RigidBody) -> list[str]:
    """What the comment at the top of a file says of its grasp and of the mass of its object."""
    mass = carried(grasp, body).mass
    if body.weighed:
        why = "of the scene"
    else:
        why = f"{SHARE:g} of the payload" if mass < body.mass else f"of {DENSITY:g} kg/m^3, for want of object.mass_g"
    lines = [
        "Made by softjaw from one grasp of a result file; lengths in m, forces in N.",
        *grasp.remark.splitlines(),
        f"mass of the object: {1e3 * mass:.4g} g, {why}",
        *["inertia: of the convex hull, for want of a closed surface"] * (not body.closed),
        "friction: the ellipsoid from three motions; the payload follows from all sampled motions",
    ]
    return [line.replace("--", "- -") for line in lines]  # two dashes would end a comment of XML


def rendered(file: str, grasp: RankedGrasp, body: RigidBody, **parts: Any) -> str:
    """The file of a grasp that a simulator opens, from a template of `study.templates` and what is its own."""
    made, weighed = cell(grasp, body.down), carried(grasp, body)
    fingers = [*enumerate(made.contacts, start=1)]
    moments, axes = np.linalg.eigh(weighed.inertia)
    axes[:, 2] *= np.linalg.det(axes)  # a rotation, no reflection
    inertia = {f"i{'xyz'[i]}{'xyz'[j]}": weighed.inertia[i, j] for i in range(3) for j in range(i, 3)}
    return template(file).render(
        grasp=grasp, body=weighed, heading=heading(grasp, body), cell=made, fingers=fingers,
        moments=moments, axes=axes, inertia=inertia, numbers=numbers, places=places, RADIUS=RADIUS, PLATE=PLATE,
        PAD_MASS=PAD_MASS, **parts,
    )  # fmt: skip
