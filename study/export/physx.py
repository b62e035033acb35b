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

import numpy as np

from softjaw.study.export.point_contact import PointContact, cell, numbers, rendered
from softjaw.study.export.rigid_body import RigidBody
from softjaw.study.export.selection import FloatArray, RankedGrasp, quaternion
from softjaw.study.units import GRAVITY

STIFFNESS = 1e6  # of the drives [N/m], so stiff that they press with their largest force


def torsional_radius(contact: PointContact) -> float:
    """Radius [m] for which PhysX's largest torque is the contact's."""
    return contact.r / contact.mu


def as_usd(grasp: RankedGrasp, body: RigidBody) -> str:
    """A stage of one grasp of an object, as USD in text form (.usda)."""
    made = cell(grasp, body.down)

    def slide(f: int) -> tuple[FloatArray, FloatArray]:
        """Axes of a joint whose x slides the finger along the closing axis, in the stage and in the finger."""
        first = made.closing * (1.0 if f == 1 else -1.0)
        third = np.roll(first, 1)  # across it, because it is an axis of the scene
        frame = np.column_stack([first, np.cross(third, first), third])
        return frame, made.contacts[f - 1].rotation.T @ frame

    down = made.rotation @ body.down
    parts = {
        "tuple": lambda *values: f"({numbers(*values).replace(' ', ', ')})",
        "turn": lambda rotation: np.roll(quaternion(rotation), 1),  # USD writes the real part first
        "slide": slide,
        "torsional_radius": torsional_radius,
    }
    return rendered("grasp.usda", grasp, body, down=down, gravity=GRAVITY, stiffness=STIFFNESS, **parts)
