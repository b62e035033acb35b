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

The stage holds the object with mass, centre of mass and inertia, gravity, and both fingers on slides along the closing
axis, each driven by the normal force. USD's physics has no joint that couples two slides: without one the object is
free along the closing axis, up to the friction of the drive. Couple `close1` and `close2` as your gripper's drive does.
"""

from __future__ import annotations

import json

import numpy as np

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
from softjaw.study.export.rigid_body import RigidBody, places
from softjaw.study.export.selection import FloatArray, RankedGrasp, quaternion
from softjaw.study.units import GRAVITY

STIFFNESS = 1e6  # of the drives [N/m], so stiff that they press with their largest force


def torsional_radius(contact: PointContact) -> float:
    """Radius [m] for which PhysX's largest torque is the contact's."""
    return contact.r / contact.mu


def as_usd(grasp: RankedGrasp, body: RigidBody) -> str:
    """A stage of one grasp of an object, as USD in text form (.usda)."""
    contacts = cell(grasp, body.down)
    down = contacts.rotation @ body.down / np.linalg.norm(body.down)
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
            f"        vector3f physics:gravityDirection = {_tuple(*down)}",
            f"        float physics:gravityMagnitude = {GRAVITY}",
            "    }",
            *_object(contacts, carried(grasp, body)),
            *(line for f in (1, 2) for line in _finger(f, contacts, grasp.force)),
            "}",
        ]
    )


def _object(contacts: Cell, body: RigidBody) -> list[str]:
    """The object in the frame of its own file: mass, surface, and a plate in each contact plane."""
    moments, axes = np.linalg.eigh(body.inertia)
    axes[:, 2] *= np.linalg.det(axes)  # a rotation, no reflection
    turn = quaternion(axes)
    pads = ", ".join(f"</grasp/finger{f}/pad{f}>" for f in (1, 2))
    hull = '"PhysicsCollisionAPI", "PhysicsMeshCollisionAPI", "PhysicsFilteredPairsAPI"'
    return [
        '    def Xform "object" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])',
        "    {",
        *_placed(contacts.rotation, contacts.origin),
        f"        float physics:mass = {numbers(body.mass)}",
        f"        point3f physics:centerOfMass = {_tuple(*body.centre)}",
        f"        float3 physics:diagonalInertia = {_tuple(*moments)}",
        f"        quatf physics:principalAxes = {_tuple(turn[3], *turn[:3])}",
        f'        def Mesh "surface" (prepend apiSchemas = [{hull}])  # its hull meets all but the pads',
        "        {",
        '            uniform token physics:approximation = "convexHull"',
        f"            rel physics:filteredPairs = [{pads}]",
        '            uniform token subdivisionScheme = "none"',
        f"            int[] faceVertexCounts = [{', '.join(['3'] * len(body.triangles))}]",
        f"            int[] faceVertexIndices = [{places(body.triangles).replace(' ', ', ')}]",
        f"            point3f[] points = [{', '.join(_tuple(*point) for point in body.points)}]",
        "        }",
        *(line for f, contact in enumerate(contacts.contacts, 1) for line in _plate(f, contact, contacts)),
        "    }",
    ]


def _plate(f: int, contact: PointContact, contacts: Cell) -> list[str]:
    """A plate of the object whose face is the contact plane; guides are drawn when they are asked for."""
    centre = contacts.rotation.T @ (contact.origin + PLATE * contact.rotation[:, 2] - contacts.origin)
    return [
        f'        def Cube "plate{f}" (prepend apiSchemas = ["PhysicsCollisionAPI", "MaterialBindingAPI"])',
        "        {",
        *_placed(contacts.rotation.T @ contact.rotation, centre, (2 * RADIUS, 2 * RADIUS, PLATE)),
        '            uniform token purpose = "guide"',
        f"            rel material:binding:physics = </grasp/friction{f}>",  # the larger of two is the pad's then
        "        }",
    ]


def _tuple(*values: float) -> str:
    return f"({numbers(*values).replace(' ', ', ')})"


def _placed(rotation: FloatArray, origin: FloatArray, scale: tuple[float, ...] = ()) -> list[str]:
    """The lines that place a prim; USD writes the real part of a quaternion first."""
    turn = quaternion(rotation)
    order = ["xformOp:translate", "xformOp:orient", *(["xformOp:scale"] if scale else [])]
    return [
        f"        double3 xformOp:translate = {_tuple(*origin)}",
        f"        quatd xformOp:orient = {_tuple(turn[3], *turn[:3])}",
        *([f"        double3 xformOp:scale = {_tuple(*scale)}"] if scale else []),
        f"        uniform token[] xformOpOrder = {json.dumps(order)}",
    ]


def _finger(f: int, contacts: Cell, force: float) -> list[str]:
    """A body in the contact frame with a ball that touches at its origin, its material, and its joint."""
    contact = contacts.contacts[f - 1]
    schemas = '"PhysicsCollisionAPI", "PhysxCollisionAPI", "MaterialBindingAPI"'
    return [
        f'    def Xform "finger{f}" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])',
        "    {",
        *_placed(contact.rotation, contact.origin),
        f"        float physics:mass = {PAD_MASS}",
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
        *_joint(f, contacts, force),
    ]


def _joint(f: int, contacts: Cell, force: float) -> list[str]:
    """A slide of the finger along the closing axis, driven to the middle by no more than the normal force."""
    contact, first = contacts.contacts[f - 1], contacts.closing * (1.0 if f == 1 else -1.0)
    third = np.roll(first, 1)  # across it, because it is an axis of the scene
    frame = np.column_stack([first, np.cross(third, first), third])
    here, there = quaternion(frame), quaternion(contact.rotation.T @ frame)
    reach = 0.5 * float(np.linalg.norm(contacts.contacts[1].origin - contacts.contacts[0].origin))
    return [
        f'    def PhysicsPrismaticJoint "close{f}" (prepend apiSchemas = ["PhysicsDriveAPI:linear"])',
        "    {",
        '        uniform token physics:axis = "X"',
        f"        rel physics:body1 = </grasp/finger{f}>",
        f"        point3f physics:localPos0 = {_tuple(*contact.origin)}",
        f"        quatf physics:localRot0 = {_tuple(here[3], *here[:3])}",
        "        point3f physics:localPos1 = (0, 0, 0)",
        f"        quatf physics:localRot1 = {_tuple(there[3], *there[:3])}",
        f"        float physics:lowerLimit = {-reach}",
        f"        float physics:upperLimit = {reach}",
        f"        float drive:linear:physics:targetPosition = {reach}",
        f"        float drive:linear:physics:stiffness = {STIFFNESS}",
        f"        float drive:linear:physics:maxForce = {numbers(force)}",
        "    }",
    ]
