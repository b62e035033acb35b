"""From a scene to the finite element model of one finger: pad, place of first touch, symmetry, contact solver."""

from functools import lru_cache
from typing import Any

import numpy as np

from softjaw.fem.contact.press import Press
from softjaw.fem.materials import Material, material
from softjaw.fem.pad.backing_plate import relative_compliance
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.pad.shape import BackingPlate, TiltingMount
from softjaw.fem.petsc import PETSc, options_elsewhere, unknown_options
from softjaw.friction.patch import FloatArray
from softjaw.study.case.build import pad_shape
from softjaw.study.case.geometry import KNOWN_DEPTH, Finger
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import Gripper

MIRRORED = 2e-5  # of the pad's length, to which images agree: files are of single precision, e_n moves by less
PLATE_POISSON = 0.3  # of the backing plate; the modulus is what a scene gives


def pad_material(gripper: Gripper) -> Material:
    """Foam of the pads."""
    return material(gripper.material, gripper.shear_modulus, gripper.foam_ratio, *reversed(gripper.hyperfoam_terms))


def backing_plate(gripper: Gripper) -> BackingPlate:
    """Plate behind each pad."""
    return BackingPlate(gripper.sheet_thickness, gripper.sheet_modulus, PLATE_POISSON, gripper.sheet_support)


def tilting_mount(gripper: Gripper) -> TiltingMount | None:
    """Mount of each pad that lets it tilt, or None; its glue is stiff beside the foam."""
    if gripper.tilt_stiffness_nm_per_rad is None:
        return None
    # 1e4 times as stiff as the foam is rigid to 1e-4
    glue = 1e4 * pad_material(gripper).young_modulus / gripper.pad_thickness
    return TiltingMount(gripper.tilt_stiffness_nm_per_rad, glue)


@lru_cache(maxsize=8)
def plate_compliance(gripper: Gripper) -> float:
    """Mean deflection of the backing plate under an even pressure over that of the pad [-]."""
    shape, (n, m, _) = pad_shape(gripper), gripper.elements
    halves = n % 2 == 0, m % 2 == 0
    x, y = (tuple(map(float, shape.lines(axis, half))) for axis, half in enumerate(halves))
    foam = shape.size[2] / pad_material(gripper).young_modulus
    return relative_compliance(x, y, halves, backing_plate(gripper), foam)


@lru_cache(maxsize=16)
def pad(gripper: Gripper, symmetry: tuple[bool, bool], contact: str, coarser: bool, elastic_plate: bool) -> Pad:
    """Discrete pad with its backing plate; the same for all candidates, so it is made once."""
    behind = backing_plate(gripper) if elastic_plate else tilting_mount(gripper)
    return Pad(pad_shape(gripper, coarser), pad_material(gripper), symmetry, contact, behind)


@lru_cache(maxsize=8)
def quadrants(finger: Finger, size: tuple[float, float, float]) -> dict[tuple[int, int], FloatArray]:
    """Gap before a pad of this ``size`` at places of a quarter and their images ``(i x, j y, z)``, by ``(i, j)``."""
    # Off the planes, where both sides are the same point, and a little beyond the rim.
    u = np.linspace(0.03, 0.55, 12)
    x, y, z = np.meshgrid(u * size[0], u * size[1], np.linspace(-0.3, KNOWN_DEPTH, 7) * size[2], indexing="ij")
    points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
    return {(i, j): finger.gap(points * [i, j, 1.0])[0] for i in (1, -1) for j in (1, -1)}


def looks_alike(first: Finger, other: Finger, signs: tuple[int, int], size: tuple[float, float, float]) -> bool:
    """Whether the object before one finger is that before the other one with these signs of x and y of the pad."""
    gaps, other_gaps = quadrants(first, size), quadrants(other, size)
    a, b = signs
    return all(np.abs(other_gaps[i, j] - gaps[i * a, j * b]).max() <= MIRRORED * size[0] for i, j in gaps)


def image_signs(first: Finger, other: Finger, size: tuple[float, float, float]) -> tuple[int, int] | None:
    """Signs with which two fingers look alike; None without any."""
    choices = ((1, 1), (1, -1), (-1, 1), (-1, -1))
    return next((signs for signs in choices if looks_alike(first, other, signs, size)), None)


def usable_symmetry(scene: Scene, finger: Finger, elements: tuple[int, int, int]) -> tuple[bool, bool]:
    """Planes of symmetry used with this mesh: those that exist, halve it evenly and are allowed by the effects.

    Raises `ValueError` if the scene forces a symmetry that this candidate does not have.
    """
    wanted = scene.effects.model_size
    if wanted == "full":
        return False, False
    planes = [looks_alike(finger, finger, signs, scene.gripper.pad_size) for signs in ((-1, 1), (1, -1))]
    usable = planes[0] and elements[0] % 2 == 0, planes[1] and elements[1] % 2 == 0
    # a coarser mesh for error estimates takes what it can use
    if elements == scene.gripper.elements:
        require_planes(wanted, sum(usable))
    return (False, True) if wanted == "half" and all(usable) else usable


def require_planes(wanted: str, planes: int) -> None:
    """Refuse fewer planes of symmetry than ``effects.model_size`` needs."""
    need = {"half": 1, "quarter": 2}.get(wanted, 0)
    if planes < need:
        text = f"needs {need} plane(s) of symmetry, but object, fingers and mesh share {planes} here; use 'auto'"
        raise ValueError(f"effects.model_size = '{wanted}' {text}")


def pad_of(scene: Scene, symmetry: tuple[bool, bool], rule: str, coarser: bool) -> Pad:
    """Pad on its backing plate, which is rigid unless the scene says that it is elastic; ``rule`` collocates gaps."""
    return pad(scene.gripper, symmetry, rule, coarser, scene.effects.sheet == "elastic")


def contact_rules(scene: Scene, walled: bool) -> tuple[str, ...]:
    """How gaps are collocated, and how where that has no solution; ``walled``: on a wall that gives way."""
    if scene.accuracy.contact == "auto" and scene.gripper.element == "hex8":
        # weighted gaps reach strains of 80 % where others end; a wall gives way before
        return ("blended", "nodal") if walled else ("blended", "nodal", "weighted")
    chosen = "weighted" if scene.accuracy.contact == "auto" else scene.accuracy.contact
    return (chosen,) if chosen == "nodal" else (chosen, "nodal")


def pads_of(scene: Scene, symmetry: tuple[bool, bool], coarser: bool) -> list[Pad]:
    """Pad for a rigid object, and those for where it has no solution."""
    return [pad_of(scene, symmetry, rule, coarser) for rule in contact_rules(scene, walled=False)]


def press_of(scene: Scene, finger: Finger, coarser: bool, stride: int = 1) -> Press:
    """Pad on its object, with friction where the scene wants it to act back."""
    symmetry = usable_symmetry(scene, finger, pad_shape(scene.gripper, coarser).elements)
    wanted, *others = pads_of(scene, symmetry, coarser)
    mu = scene.friction.mu if scene.effects.friction_pressure_coupling == "tangential" else None
    return Press(wanted, finger.gap, dict(scene.petsc), others, mu, stride=stride)


def check_petsc(wanted: dict[str, Any]) -> None:
    """Refuse PETSc options that no solver asks for, that PETSc itself refuses, or that the scene does not know of."""
    if hidden := [f"-{name}" for name in options_elsewhere()]:
        text = f"petsc: found {', '.join(hidden)} in PETSC_OPTIONS, which no result tells; write keys of [petsc]"
        raise StudyError(USAGE, text)
    if not wanted:
        return
    try:
        strange = unknown_options(wanted)
    except PETSc.Error as error:
        # the last line says what, the ones above it where in PETSc
        reason = str(error).strip().splitlines()[-1].partition("] ")[2] or str(error)
        given = " ".join(f"-{name} {value}" for name, value in wanted.items())
        text = f"petsc: PETSc refuses the options {given}: {reason.strip()}; correct them or leave them out"
        raise StudyError(USAGE, text) from error
    if strange:
        text = f"petsc: no solver asks for the option{'s' * (len(strange) > 1)} {', '.join(strange)}"
        raise StudyError(USAGE, f"{text}; correct the spelling, or remove what does not apply to this solver")
