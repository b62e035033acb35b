"""A finger on a rigid object: its pad and sheet at the levels that the scene calls for, ready to climb the forces."""

from __future__ import annotations

from functools import partial

from softjaw.fem.contact.friction_coupling import CoupledProblem, way
from softjaw.fem.contact.load_stepping import Settings, Stepping
from softjaw.fem.contact.press import Press
from softjaw.fem.pad.mesh import Pad
from softjaw.study.case import model
from softjaw.study.case.build import pad_shape
from softjaw.study.case.model import Finger
from softjaw.study.case.sheet_level import sheet_level
from softjaw.study.scene import Scene


def settings(scene: Scene) -> Settings:
    """When a solve ends and a step is given up."""
    return Settings(scene.accuracy.residual_tolerance, scene.accuracy.min_step_fraction)


def pad_of(scene: Scene, symmetry: tuple[bool, bool], rule: str, coarser: bool) -> Pad:
    """Pad of finite strain on its sheet; ``rule`` collocates the gaps."""
    return model.pad(scene.gripper, symmetry, rule, coarser, sheet_level(scene).elastic)


def press_of(scene: Scene, finger: Finger, coarser: bool) -> Press:
    """Pad of finite strain, with friction where the scene wants it to act back."""
    elements, rule = pad_shape(scene.gripper, coarser).elements, scene.accuracy.contact
    symmetry = model.usable_symmetry(scene, finger, elements)
    wanted, nodal = (pad_of(scene, symmetry, r, coarser) for r in (rule, "nodal"))
    fallback = None if nodal is wanted else nodal
    if scene.effects.friction_pressure_coupling == "tangential":
        problem = partial(CoupledProblem, mu=scene.friction.mu)
        steps = {"problem_of": problem, "way": way, "stepping": Stepping}
        return Press(wanted, finger.gap, dict(scene.petsc), None, settings(scene), **steps)
    return Press(wanted, finger.gap, dict(scene.petsc), fallback, settings(scene))
