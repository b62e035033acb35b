"""Whether the foam of a candidate's pads is simulated for small strains or for finite ones."""

from __future__ import annotations

from dataclasses import dataclass

from softjaw.fem.contact.linear_press import linear_press
from softjaw.fem.contact.press import Settings
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.pad.linear_pad import departure
from softjaw.fem.pad.spring_bed import SpringBed
from softjaw.study.case import model
from softjaw.study.case.build import pad_material
from softjaw.study.case.effects import sheet_level
from softjaw.study.case.margin import surely_below
from softjaw.study.case.model import Finger
from softjaw.study.scene import Scene

# In 444 cases (pads, objects, forces, laws) e_n of the linear pad was off by at most 0.7 times the departure of its law
# from a straight line at its largest strain; this keeps it below 1.8 %.
NEARLY_LINEAR = 0.025
DEFAULT = "the default level of this version"


@dataclass(frozen=True)
class PadLevel:
    """Level of the pads of one candidate, for all its forces; ``reason`` is one of `REASONS`."""

    linear: bool
    reason: str


def choose_pad_level(scene: Scene, fingers: list[Finger]) -> PadLevel:
    """The cheapest level whose e_n is good to 2 %, unless the scene asks for one.

    What decides is the strain at the largest force: first that of the pad as a bed of springs, which costs nothing and
    settles most cases, then that of the linear pad itself.
    """
    if scene.effects.pad != "auto":
        return PadLevel(scene.effects.pad == "linear", "forced by the scene")
    if scene.effects.friction_pressure_coupling == "tangential":
        return PadLevel(False, DEFAULT)  # the condensed pad knows no friction
    if all(_nearly_linear(scene, finger) for finger in fingers):
        return PadLevel(True, "indicator below the target")
    return PadLevel(False, "indicator above the target")


def level_on_wall(scene: Scene) -> PadLevel:
    """On a thin wall, whose solve takes far longer than the pads', ``auto`` leaves the pads at finite strains."""
    if scene.effects.pad == "auto":
        return PadLevel(False, DEFAULT)
    return PadLevel(scene.effects.pad == "linear", "forced by the scene")


def _nearly_linear(scene: Scene, finger: Finger) -> bool:
    law, force = pad_material(scene.gripper), scene.load.normal_force[-1]
    symmetry = model.usable_symmetry(scene, finger, scene.gripper.elements)
    choice = scene.gripper, symmetry, scene.accuracy.contact, False, sheet_level(scene).elastic
    pad = model.pad(*choice)
    squeezed = SpringBed(pad, finger.gap).travel(force) / pad.shape.size[2]
    if not surely_below(departure(law, squeezed), NEARLY_LINEAR):
        return False
    try:
        (state,) = linear_press(model.condensed_pad(*choice), finger.gap, settings=Settings()).ladder([force])
    except (ConvergenceError, CheckError):
        return False
    return surely_below(departure(law, state.checks.max_strain), NEARLY_LINEAR)
