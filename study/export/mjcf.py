"""MuJoCo: the ellipsoidal limit surface as an elliptic friction cone with ``condim = 4``.

MuJoCo bounds the friction forces of a contact (f_1, f_2 along its tangents, the torque f_3 about its normal) by

    (f_1 / mu_1)^2 + (f_2 / mu_2)^2 + (f_3 / mu_3)^2 <= f_N^2

(MuJoCo documentation, "Computation", section on friction cones, and "XML reference", pair, friction): an ellipsoid with
semi-axes mu_i f_N. With mu_1 = f_x / F_N, mu_2 = f_y / F_N and mu_3 = tau_z / F_N, a length [m], it is the ellipsoid
from three motions of `study.export.point_contact`: torque, slides and all loads between them slip where the result file
says, at its F_N, and scale with the normal force beside it. What the fitted quartic knows beyond it is lost.

Four things belong to it.

* The pad is a ball, which touches at one point. A box would touch at several, and each would add its own torque.
* ``cone="elliptic"``: the default is a pyramid. ``impratio="10000"`` makes friction stiff, and
  ``noslip_iterations="200"`` stops the creep that MuJoCo's soft friction has below slip; without it a grasp turns
  slowly under any torque, and most where a thin plate bears a weight beside it.
* A ``<pair>``: it alone takes two slides, and nobody's other friction is mixed in.
* The tangents. MuJoCo does not turn them with the pad: the first is the world's y axis laid into the contact plane, or
  the z axis where the normal is within 60 degrees of y (``mju_makeFrame`` of its sources). The file therefore stands in
  the frame of the closed pads, x across and y along their long side. Where the tangents are not the contact's axes, and
  for a gripper that turns, the smaller slide in both places is on the safe side.

The file is a scene that runs. The object has its surface, mass, centre of mass and inertia
(`study.export.rigid_body`), and gravity pulls as the scene says. Both fingers slide along the closing axis. An equality
keeps their strokes equal, as the drive of a parallel gripper does: a load along the closing axis shifts force from one
finger to the other, and their sum stays. The balls press on plates in the contact planes; the surface itself is there
to be seen, and for a table or walls that are added to the model, which meet its convex hull.
"""

import numpy as np

from softjaw.study.export.point_contact import PointContact, cell, numbers, rendered
from softjaw.study.export.rigid_body import RigidBody
from softjaw.study.export.selection import FloatArray, RankedGrasp, quaternion
from softjaw.study.units import GRAVITY

ALONG = 1e-6  # sine between a tangent and an axis of the contact below which they are one
STIFF = 'solref="0.004 1" solimp="0.9999 0.9999 0.001"'
HIDDEN = 'contype="0" conaffinity="0" group="3"'  # viewers do not draw this group unless they are asked


def tangents(normal: FloatArray) -> FloatArray:
    """The two directions ``(2, 3)`` along which MuJoCo measures the friction of a contact with this normal ``(3,)``.

    >>> tangents(np.array([1.0, 0.0, 0.0])).tolist()
    [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    first = np.array([0.0, 1.0, 0.0] if -0.5 < normal[1] < 0.5 else [0.0, 0.0, 1.0])
    first = first - (first @ normal) * normal
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(normal, first)])


def friction(contact: PointContact) -> tuple[float, float, float]:
    """Both slides along MuJoCo's tangents [-], and torsion [m]."""
    first = tangents(contact.rotation[:, 2])[0]
    along_x, along_y = np.abs(contact.rotation[:, :2].T @ first)
    if along_y < ALONG:
        return contact.mu_x, contact.mu_y, contact.r
    return (contact.mu_y, contact.mu_x, contact.r) if along_x < ALONG else (contact.mu, contact.mu, contact.r)


def as_mjcf(grasp: RankedGrasp, body: RigidBody) -> str:
    """A MuJoCo model of one grasp of an object, with gravity."""

    def foam(contact: PointContact) -> tuple[FloatArray, FloatArray]:
        """The undeformed pad that a ball represents, in the contact frame."""
        middle = contact.pad_origin - body.pad[2] / 2 * contact.pad_rotation[:, 2] - contact.origin
        return contact.rotation.T @ contact.pad_rotation, contact.rotation.T @ middle

    gravity = cell(grasp, body.down).rotation @ (GRAVITY * body.down)
    parts = {"pose": _pose, "foam": foam, "friction": friction, "stiff": STIFF, "hidden": HIDDEN}
    return rendered("grasp.xml", grasp, body, gravity=gravity, **parts)


def _pose(rotation: FloatArray, origin: FloatArray) -> str:
    turn = quaternion(rotation)
    return f'pos="{numbers(*origin)}" quat="{numbers(turn[3], *turn[:3])}"'
