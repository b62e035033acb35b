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

from __future__ import annotations

import math
import warnings
from xml.sax.saxutils import escape

import numpy as np
from scipy.spatial.transform import Rotation

from softjaw.study.export.point_contact import (
    PAD_MASS,
    PLATE,
    RADIUS,
    Cell,
    PointContact,
    carried,
    cell,
    heading,
    numbers,
)
from softjaw.study.export.rigid_body import RigidBody
from softjaw.study.export.selection import FloatArray, RankedGrasp

STICKY = 1e3  # friction of the object's plates: of two surfaces the smaller one counts
VERSION = "1.7"  # the newest that Gazebo Classic reads
BALL = 3 * math.pi / 16  # torque over radius, friction and normal force of the patch that ODE assumes


def patch_radius(contact: PointContact) -> float:
    """Radius [m] for which ODE's largest torque is the contact's, with its smaller slide as coefficient."""
    return contact.r / (BALL * contact.mu)


def as_sdf(grasp: RankedGrasp, body: RigidBody, mesh: str = "object.stl") -> str:
    """A model of one grasp of an object, whose surface is in the file ``mesh`` in m."""
    contacts = cell(grasp, body.down)
    return "\n".join(
        [
            '<?xml version="1.0"?>',
            *(f"<!-- {line} -->" for line in heading(grasp, body)),
            f'<sdf version="{VERSION}" xmlns:drake="http://drake.mit.edu">',
            f'  <model name="{grasp.name}">',
            f"    <pose>{_pose(contacts.rotation.T, -contacts.rotation.T @ contacts.origin)}</pose>",
            *_object(contacts, carried(grasp, body), mesh),
            *(line for f in (1, 2) for line in _finger(f, contacts, grasp.force)),
            "  </model>",
            "</sdf>",
        ]
    )


def as_stl(body: RigidBody) -> bytes:
    """The object's surface as a binary STL file [m], in the frame of its own file."""
    triangles = np.zeros(len(body.triangles), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("colour", "<u2")])
    triangles["corners"] = corners = body.points[body.triangles]
    triangles["normal"] = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    return b"softjaw".ljust(80) + np.uint32(len(triangles)).tobytes() + triangles.tobytes()


def _object(contacts: Cell, body: RigidBody, mesh: str) -> list[str]:
    """The object in the frame of its own file: mass, surface, and a plate in each contact plane."""
    surface = f"<geometry><mesh><uri>{escape(mesh)}</uri></mesh></geometry>"
    moments = {f"i{'xyz'[i]}{'xyz'[j]}": body.inertia[i, j] for i in range(3) for j in range(i, 3)}
    return [
        '    <link name="object">',
        f"      <pose>{_pose(contacts.rotation, contacts.origin)}</pose>",
        f"      <inertial><pose>{numbers(*body.centre)} 0 0 0</pose><mass>{numbers(body.mass)}</mass>",
        f"        <inertia>{''.join(f'<{n}>{numbers(v)}</{n}>' for n, v in moments.items())}</inertia></inertial>",
        f'      <visual name="surface">{surface}</visual>',
        f'      <collision name="surface">{surface}',
        "        <surface><contact><collide_bitmask>2</collide_bitmask></contact></surface>",
        "      </collision>",
        *(line for f, contact in enumerate(contacts.contacts, 1) for line in _plate(f, contact, contacts)),
        "    </link>",
    ]


def _plate(f: int, contact: PointContact, contacts: Cell) -> list[str]:
    """A plate of the object whose face is the contact plane, with more friction than any pad."""
    centre = contacts.rotation.T @ (contact.origin + PLATE * contact.rotation[:, 2] - contacts.origin)
    return [
        f'      <collision name="plate{f}">',
        f"        <pose>{_pose(contacts.rotation.T @ contact.rotation, centre)}</pose>",
        f"        <geometry><box><size>{numbers(4 * RADIUS, 4 * RADIUS, 2 * PLATE)}</size></box></geometry>",
        "        <surface>",
        "          <contact><collide_bitmask>1</collide_bitmask></contact>",
        f"          <friction><torsional><coefficient>{STICKY}</coefficient></torsional>",
        f"            <ode><mu>{STICKY}</mu><mu2>{STICKY}</mu2></ode></friction>",
        "        </surface>",
        "      </collision>",
    ]


def _pose(rotation: FloatArray, origin: FloatArray) -> str:
    """Place and roll, pitch, yaw about fixed axes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # at a pitch of 90 degrees any yaw will do, and it is 0
        return numbers(*origin, *np.asarray(Rotation.from_matrix(rotation).as_euler("xyz")))


def _finger(f: int, contacts: Cell, force: float) -> list[str]:
    """A link in the contact frame, with a ball that touches at its origin, on a slide along the closing axis."""
    contact = contacts.contacts[f - 1]
    rail = contact.rotation.T @ contacts.closing * (1.0 if f == 1 else -1.0)
    reach = 0.5 * float(np.linalg.norm(contacts.contacts[1].origin - contacts.contacts[0].origin))
    coupled = ['      <drake:mimic joint="close1" multiplier="1" offset="0"/>'] if f == 2 else []
    size = numbers(0.4 * PAD_MASS * RADIUS**2)
    return [
        f'    <link name="finger{f}">',
        f"      <pose>{_pose(contact.rotation, contact.origin)}</pose>",
        f"      <inertial><pose>0 0 {-RADIUS} 0 0 0</pose><mass>{PAD_MASS}</mass>",
        f"        <inertia><ixx>{size}</ixx><iyy>{size}</iyy><izz>{size}</izz></inertia></inertial>",
        f'      <collision name="pad{f}">',
        f"        <pose>0 0 {-RADIUS} 0 0 0</pose>",
        f"        <geometry><sphere><radius>{RADIUS}</radius></sphere></geometry>",
        "        <surface><contact><collide_bitmask>1</collide_bitmask></contact><friction>",
        "          <torsional>",
        f"            <coefficient>{numbers(contact.mu)}</coefficient>",
        "            <use_patch_radius>true</use_patch_radius>",
        f"            <patch_radius>{numbers(patch_radius(contact))}</patch_radius>",
        "          </torsional>",
        "          <ode>",
        f"            <mu>{numbers(contact.mu_x)}</mu>",
        f"            <mu2>{numbers(contact.mu_y)}</mu2>",
        "            <fdir1>1 0 0</fdir1>",
        "          </ode>",
        "        </friction></surface>",
        "      </collision>",
        "    </link>",
        f'    <joint name="close{f}" type="prismatic">',
        f"      <parent>world</parent><child>finger{f}</child>",
        f"      <axis><xyz>{numbers(*rail)}</xyz>",
        f"        <limit><lower>{-reach}</lower><upper>{reach}</upper><effort>{numbers(force)}</effort></limit>",
        "      </axis>",
        *coupled,
        "    </joint>",
    ]
