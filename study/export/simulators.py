"""A grasp in the simulators' own friction: MuJoCo's elliptic cone, the patch radii of PhysX and of Gazebo.

Each bounds the slides f_1, f_2 of a contact along its tangents and the torque T about its normal by the normal force N
of the moment. With mu_x = f_x / F_N, mu_y = f_y / F_N and r = tau_z / F_N of `study.export.point_contact` and mu, the
smaller of both slides, torque and slides slip where the result file says, at its F_N, and scale with N beside it. What
the fitted quartic knows beyond the ellipsoid from three motions is lost. The pad is a ball, which touches at one point,
and presses on a plate of the object in the contact plane: a box would touch at several points, and each would add its
own torque. The object has its surface, mass, centre of mass and inertia (`study.export.rigid_body`). Both fingers slide
along the closing axis.

**MuJoCo**, with ``condim = 4`` (documentation, "Computation", section on friction cones, and "XML reference", pair,
friction), takes loads between them from the same ellipsoid:

    (f_1 / mu_1)^2 + (f_2 / mu_2)^2 + (T / mu_3)^2 <= N^2,   mu_1 = mu_x,   mu_2 = mu_y,   mu_3 = r  [m].

* ``cone="elliptic"``: the default is a pyramid. ``impratio="10000"`` makes friction stiff, and
  ``noslip_iterations="200"`` stops the creep that MuJoCo's soft friction has below slip; without it a grasp turns
  slowly under any torque, and most where a thin plate bears a weight beside it.
* A ``<pair>``: it alone takes two slides, and nobody's other friction is mixed in.
* The tangents. MuJoCo does not turn them with the pad: the first is the world's y axis laid into the contact plane, or
  the z axis where the normal is within 60 degrees of y (``mju_makeFrame`` of its sources). The file therefore stands in
  the frame of the closed pads, x across and y along their long side. Where the tangents are not the contact's axes, and
  for a gripper that turns, the smaller slide in both places is on the safe side.

The file is a scene that runs, with gravity as the scene says. An equality keeps the strokes equal, as the drive of a
parallel gripper does: a load along the closing axis shifts force from one finger to the other, and their sum stays. The
surface itself is there to be seen, and for a table or walls that are added to the model, which meet its convex hull.

**PhysX and Isaac Sim**, as USD (``DyTGSContactPrep.cpp``; documentation of ``PxShape::setTorsionalPatchRadius``), have

    slide <= mu N in any direction,   T <= mu N max(r_min, sqrt(r_patch d)),   r_min = r / mu  [m],

with d the penetration, which depends on the solver's settings rather than on the pad: with ``torsionalPatchRadius`` 0
it does not count. For a flat contact r_min, the ``minTorsionalPatchRadius``, is e_n itself: the patch of PhysX is a
ring of that radius. Of the stronger slide it knows nothing, and slide and torque do not take from each other: a load
that does both is carried up to 1.4 times as far as the contact carries it. Torsional friction acts where a patch has
one anchor point, as a ball has, and with the TGS solver only. Of two shapes PhysX takes the larger radius; their
materials combine by ``frictionCombineMode``, and ``max`` comes before that of any other material: give the object no
more friction than the pads. Each slide is driven by the normal force. USD's physics has no joint that couples two:
without one the object is free along the closing axis, up to the friction of the drive. Couple `close1` and `close2` as
your gripper's drive does.

**Gazebo**, as SDFormat. The ODE of Gazebo Classic (``contact.cpp``, the torsional row; SDFormat, ``surface/friction``)
has, with direction 1 along ``fdir1`` in the frame of the collision, c the torsional ``coefficient`` and a the
``patch_radius``,

    f_1 <= mu_x N,   f_2 <= mu_y N,   T <= 3 pi / 16 a c N,   c = mu,   a = 16 / (3 pi) r / mu  [m].

The factor is that of the pressure of a ball on an elastic half-space, for which e_n is 3 pi / 16 a; of a flat contact a
is 16 e_n / (3 pi). Of two surfaces Gazebo takes the smaller ``mu``, ``mu2`` and ``coefficient`` and the larger
``patch_radius``: give the object no less friction than the pads, and no patch radius. The three bounds are a box around
the ellipsoid: a load that slides and turns at once is carried up to 1.7 times as far as the contact carries it.
Gazebo's tutorial says that torsional friction works with ODE alone; other engines of Gazebo leave the element out. The
model is turned so that the weight of the scene's direction pulls along -z. Gravity is the world's, and each slide wants
a force of the joint's effort from a plugin of yours. SDFormat 1.7 has no element that couples two slides: Drake's own
is written, Gazebo Classic wants a plugin.
"""

import math
import warnings
from xml.sax.saxutils import escape

import numpy as np
from scipy.spatial.transform import Rotation

from softjaw.study.export.point_contact import PointContact, cell, numbers, rendered
from softjaw.study.export.rigid_body import RigidBody
from softjaw.study.export.selection import FloatArray, RankedGrasp, quaternion
from softjaw.study.units import GRAVITY

ALONG = 1e-6  # sine between a tangent and an axis of the contact below which they are one
BALL = 3 * math.pi / 16  # torque over radius, friction and normal force of the patch that ODE assumes


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
    along_x, along_y = np.abs(contact.rotation[:, :2].T @ tangents(contact.rotation[:, 2])[0])
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
    return rendered("grasp.xml", grasp, body, gravity=gravity, foam=foam, friction=friction, quaternion=quaternion)


def as_usd(grasp: RankedGrasp, body: RigidBody) -> str:
    """A stage of one grasp of an object, as USD in text form (.usda)."""
    made = cell(grasp, body.down)

    def slide(f: int) -> tuple[FloatArray, FloatArray]:
        """Axes of a joint whose x slides the finger along the closing axis, in the stage and in the finger."""
        first = made.closing * (1.0 if f == 1 else -1.0)
        third = np.roll(first, 1)  # across it, because it is an axis of the scene
        frame = np.column_stack([first, np.cross(third, first), third])
        return frame, made.contacts[f - 1].rotation.T @ frame

    parts = {"down": made.rotation @ body.down, "gravity": GRAVITY, "slide": slide, "quaternion": quaternion}
    return rendered("grasp.usda", grasp, body, **parts)


def as_sdf(grasp: RankedGrasp, body: RigidBody, mesh: str = "object.stl") -> str:
    """A model of one grasp of an object, whose surface is in the file ``mesh`` in m."""

    def pose(rotation: FloatArray, origin: FloatArray) -> str:
        """Place and roll, pitch, yaw about fixed axes."""
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # at a pitch of 90 degrees any yaw will do, and it is 0
            return numbers(*origin, *np.asarray(Rotation.from_matrix(rotation).as_euler("xyz")))

    made = cell(grasp, body.down)
    upright = Rotation.align_vectors([[0.0, 0.0, -1.0]], [body.down])[0].as_matrix() @ made.rotation.T
    back = upright, -upright @ made.origin
    return rendered("grasp.sdf", grasp, body, pose=pose, back=back, mesh=escape(mesh), BALL=BALL)


def as_stl(body: RigidBody) -> bytes:
    """The object's surface as a binary STL file [m], in the frame of its own file."""
    return bytes(body.surface.export(file_type="stl"))
