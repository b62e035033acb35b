"""Gazebo: slides along the pad's axes and a torsional patch radius, as SDFormat writes them.

The ODE of Gazebo Classic bounds each friction of a contact by itself, times the normal force N (``contact.cpp``, the
torsional row; SDFormat, ``surface/friction``):

    |f_1| <= mu N,   |f_2| <= mu2 N,   |T| <= 3 pi / 16 a c N

with the direction 1 along ``fdir1`` in the frame of the collision, a the ``patch_radius`` and c the torsional
``coefficient``. The factor is that of the pressure of a ball on an elastic half-space, for which e_n is 3 pi / 16 a. So

    mu = f_x / F_N,  mu2 = f_y / F_N,  c = mu_small,  a = 16 / (3 pi) tau_z / (c F_N)

let each of the three slip where the result file says; mu_small is the smaller slide. For a flat contact c is the
friction coefficient and a = 16 e_n / (3 pi).

Of two surfaces Gazebo takes the smaller ``mu``, ``mu2`` and ``coefficient`` and the larger ``patch_radius``: give the
object no less friction than the pads, and no patch radius. The three bounds are a box around the ellipsoid: a load that
slides and turns at once is carried up to 1.7 times as far as the contact carries it. Gazebo's tutorial says that
torsional friction works with ODE alone; other engines of Gazebo leave the element out.

The model holds the object with its surface, mass, centre of mass and inertia, and both fingers on slides along the
closing axis. It is turned so that the weight of the scene's direction pulls along -z. Gravity is the world's, and each
slide wants a force of the joint's effort from a plugin of yours. SDFormat 1.7 has no element that couples two slides:
Drake's own is written, Gazebo Classic wants a plugin.
"""

import math
import warnings
from xml.sax.saxutils import escape

import numpy as np
from scipy.spatial.transform import Rotation

from softjaw.study.export.point_contact import PAD_MASS, RADIUS, PointContact, cell, numbers, rendered
from softjaw.study.export.rigid_body import RigidBody
from softjaw.study.export.selection import FloatArray, RankedGrasp

STICKY = 1e3  # friction of the object's plates: of two surfaces the smaller one counts
BALL = 3 * math.pi / 16  # torque over radius, friction and normal force of the patch that ODE assumes


def patch_radius(contact: PointContact) -> float:
    """Radius [m] for which ODE's largest torque is the contact's, with its smaller slide as coefficient."""
    return contact.r / (BALL * contact.mu)


def as_sdf(grasp: RankedGrasp, body: RigidBody, mesh: str = "object.stl") -> str:
    """A model of one grasp of an object, whose surface is in the file ``mesh`` in m."""
    made, ball = cell(grasp, body.down), numbers(0.4 * PAD_MASS * RADIUS**2)
    back = made.rotation.T, -made.rotation.T @ made.origin
    parts = {"pose": _pose, "back": back, "mesh": escape(mesh), "sticky": STICKY, "ball": ball}
    return rendered("grasp.sdf", grasp, body, patch_radius=patch_radius, **parts)


def as_stl(body: RigidBody) -> bytes:
    """The object's surface as a binary STL file [m], in the frame of its own file."""
    return bytes(body.surface.export(file_type="stl"))


def _pose(rotation: FloatArray, origin: FloatArray) -> str:
    """Place and roll, pitch, yaw about fixed axes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # at a pitch of 90 degrees any yaw will do, and it is 0
        return numbers(*origin, *np.asarray(Rotation.from_matrix(rotation).as_euler("xyz")))
