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
"""

from __future__ import annotations

import math
import warnings

import numpy as np
from scipy.spatial.transform import Rotation

from softjaw.study.export.point_contact import PAD_MASS, RADIUS, PointContact, cell, heading, numbers
from softjaw.study.export.rigid_body import RigidBody
from softjaw.study.export.selection import FloatArray, RankedGrasp

VERSION = "1.7"  # the newest that Gazebo Classic reads
BALL = 3 * math.pi / 16  # torque over radius, friction and normal force of the patch that ODE assumes


def patch_radius(contact: PointContact) -> float:
    """Radius [m] for which ODE's largest torque is the contact's, with its smaller slide as coefficient."""
    return contact.r / (BALL * contact.mu)


def as_sdf(grasp: RankedGrasp, body: RigidBody) -> str:
    """A model of both fingers at one grasp, with the frame of the object's own file."""
    contacts = cell(grasp)
    return "\n".join(
        [
            '<?xml version="1.0"?>',
            *(f"<!-- {line} -->" for line in heading(grasp, body)),
            f'<sdf version="{VERSION}">',
            f'  <model name="{grasp.name}">',
            f'    <frame name="object"><pose>{_pose(contacts.rotation, contacts.origin)}</pose></frame>',
            *(line for f, contact in enumerate(contacts.contacts, 1) for line in _finger(f, contact)),
            "  </model>",
            "</sdf>",
        ]
    )


def _pose(rotation: FloatArray, origin: FloatArray) -> str:
    """Place and roll, pitch, yaw about fixed axes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # at a pitch of 90 degrees any yaw will do, and it is 0
        return numbers(*origin, *np.asarray(Rotation.from_matrix(rotation).as_euler("xyz")))


def _finger(f: int, contact: PointContact) -> list[str]:
    """A link in the contact frame, with a ball that touches at its origin."""
    size = numbers(0.4 * PAD_MASS * RADIUS**2)
    return [
        f'    <link name="finger{f}">',
        f"      <pose>{_pose(contact.rotation, contact.origin)}</pose>",
        f"      <inertial><pose>0 0 {-RADIUS} 0 0 0</pose><mass>{PAD_MASS}</mass>",
        f"        <inertia><ixx>{size}</ixx><iyy>{size}</iyy><izz>{size}</izz></inertia></inertial>",
        f'      <collision name="pad{f}">',
        f"        <pose>0 0 {-RADIUS} 0 0 0</pose>",
        f"        <geometry><sphere><radius>{RADIUS}</radius></sphere></geometry>",
        "        <surface><friction>",
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
    ]
