"""What a result file holds of a thin wall: what it bears in every case, and its deformed shape."""

from __future__ import annotations

from softjaw.study.result.quantity import Quantity

AROUND, ALONG = 48, 40  # places at which the deformed wall is stored

WALL = (
    Quantity("dent", "m", "depth of the dent", "Largest inward displacement of the wall, less the motion of the"
             " wall as a whole.", needs="wall"),
    Quantity("wall_stress", "Pa", "largest stress in the wall", "Largest von Mises stress on its two faces.",
             needs="wall"),
    Quantity("wall_strain", "", "largest strain of the wall", "Largest principal strain, by size, on its two faces.",
             needs="wall"),
    Quantity("support_force", "N", "force of the support", "What the support has to bear in this frictionless contact:"
             " the pads push an object with sloping walls along its axis. Friction takes it in a grasp; where it is"
             " more than mu F_N of both fingers can take, the flag 'slides out' says so.", needs="wall"),
    Quantity("place", "m", "deformed wall", f"Outer face in the object's frame at {AROUND} angles about the axis, in"
             f" equal steps from finger 1's, times {ALONG} places along the outline, in equal steps of its arc length"
             " from the bottom's middle or rim to the top; the angle runs slowest.", group="wall",
             shape=(AROUND * ALONG, 3),
             needs="wall"),
)
