"""PhysX and Isaac Sim: one friction coefficient and a torsional patch radius, as USD.

PhysX bounds the slide of a contact by the friction coefficient mu times the normal force N, whatever its direction, and
its torque by (``DyTGSContactPrep.cpp``; the documentation of ``PxShape::setTorsionalPatchRadius``)

    |T| <= mu N max(r_min, sqrt(r d))

with r the ``torsionalPatchRadius``, r_min the ``minTorsionalPatchRadius`` and d the penetration, which depends on the
solver's settings rather than on the pad. With r = 0 the penetration does not count, and

    mu = min(f_x, f_y) / F_N,   r_min = tau_z / (mu F_N)

let torque and the weaker slide slip where the result file says. For a flat contact r_min is e_n itself: the patch of
PhysX is a ring of that radius. Of the stronger slide PhysX knows nothing, and slide and torque do not take from each
other: a load that does both is carried up to 1.4 times as far as the contact carries it.

Torsional friction acts where a patch has one anchor point, as a ball has, and with the TGS solver only. Of two shapes
PhysX takes the larger radius; their materials combine by ``frictionCombineMode``, and ``max`` comes before that of any
other material: give the object no more friction than the pads.
"""

from __future__ import annotations

from softjaw.study.export.point_contact import RADIUS, PointContact, cell, heading, numbers
from softjaw.study.export.rigid_body import RigidBody
from softjaw.study.export.selection import FloatArray, RankedGrasp, quaternion


def torsional_radius(contact: PointContact) -> float:
    """Radius [m] for which PhysX's largest torque is the contact's."""
    return contact.r / contact.mu


def as_usd(grasp: RankedGrasp, body: RigidBody) -> str:
    """A stage of both fingers at one grasp, with the frame of the object's own file, as USD in text form (.usda)."""
    contacts = cell(grasp)
    return "\n".join(
        [
            "#usda 1.0",
            "(",
            '    defaultPrim = "grasp"',
            "    metersPerUnit = 1",
            "    kilogramsPerUnit = 1",
            '    upAxis = "Z"',
            ")",
            *(f"# {line}" for line in heading(grasp, body)),
            "",
            'def Xform "grasp"',
            "{",
            '    def PhysicsScene "scene" (prepend apiSchemas = ["PhysxSceneAPI"])',
            "    {",
            '        uniform token physxScene:solverType = "TGS"',
            "    }",
            '    def Xform "object"  # the frame of the object\'s own file: put its mesh in here',
            "    {",
            *_placed(contacts.rotation, contacts.origin),
            "    }",
            *(line for f, contact in enumerate(contacts.contacts, 1) for line in _finger(f, contact)),
            "}",
        ]
    )


def _tuple(*values: float) -> str:
    return f"({numbers(*values).replace(' ', ', ')})"


def _placed(rotation: FloatArray, origin: FloatArray) -> list[str]:
    """The lines that place a prim; USD writes the real part of a quaternion first."""
    turn = quaternion(rotation)
    return [
        f"        double3 xformOp:translate = {_tuple(*origin)}",
        f"        quatd xformOp:orient = {_tuple(turn[3], *turn[:3])}",
        '        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]',
    ]


def _finger(f: int, contact: PointContact) -> list[str]:
    """A body in the contact frame, with a ball that touches at its origin, and its material."""
    schemas = '"PhysicsCollisionAPI", "PhysxCollisionAPI", "MaterialBindingAPI"'
    return [
        f'    def Xform "finger{f}" (prepend apiSchemas = ["PhysicsRigidBodyAPI"])',
        "    {",
        *_placed(contact.rotation, contact.origin),
        f'        def Sphere "pad{f}" (prepend apiSchemas = [{schemas}])',
        "        {",
        f"            double radius = {RADIUS}",
        f"            double3 xformOp:translate = (0, 0, {-RADIUS})",
        '            uniform token[] xformOpOrder = ["xformOp:translate"]',
        "            float physxCollision:torsionalPatchRadius = 0",
        f"            float physxCollision:minTorsionalPatchRadius = {numbers(torsional_radius(contact))}",
        f"            rel material:binding:physics = </grasp/friction{f}>",
        "        }",
        "    }",
        f'    def Material "friction{f}" (prepend apiSchemas = ["PhysicsMaterialAPI", "PhysxMaterialAPI"])',
        "    {",
        f"        float physics:staticFriction = {numbers(contact.mu)}",
        f"        float physics:dynamicFriction = {numbers(contact.mu)}",
        '        uniform token physxMaterial:frictionCombineMode = "max"',
        "    }",
    ]
