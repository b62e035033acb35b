"""The sections of a scene that say how a grasp is judged: limit surface, score, and what it has to hold."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from softjaw.study.scene.sections import Vector
from softjaw.study.scene.shapes import Section
from softjaw.study.units import si

Names = Annotated[tuple[int | str, ...], Field(strict=False, min_length=1)]


class Score(Section):
    """How torques are made comparable with forces in the grasp quality."""

    torque_scale: Literal["contact", "object"] = Field(
        "contact",
        description="soft torques over the contact length (the paper's choice), or all over the object length",
    )
    object_length_mm: Annotated[float, Field(gt=0, le=2000)] | Literal["auto"] = Field(
        "auto", description="length that scales torque arms; auto is the object's largest extent"
    )
    contact_length_mm: Annotated[float, Field(gt=0, le=500)] | Literal["auto"] = Field(
        "auto", description="length that scales soft torques; auto is the pad's length"
    )
    epsilon: Literal["facing", "everywhere"] = Field(
        "facing",
        description="where epsilon is computed: for contacts that face each other, or in any pose (some 0.1 s each)",
    )
    graspit: bool = Field(
        False, description="also map the quality that GraspIt!'s 20 vertices per contact give, which is too small"
    )
    object_length, contact_length = si("object_length_mm"), si("contact_length_mm")


class LimitSurface(Section):
    """The surface that bounds the friction wrenches of a contact, fitted to the wrenches of many motions."""

    model: Literal["three_motions", "axis_aligned", "full", "quartic"] = Field(
        "quartic",
        description="ellipsoid from three motions, fitted ellipsoid with axes along the frame or any, convex quartic",
    )
    objective: Literal["least_squares", "zhou"] = Field(
        "least_squares", description="what the fit of a full ellipsoid or a quartic makes small; zhou is slower"
    )
    samples: int = Field(500, ge=50, le=20_000, description="motions that the surface is fitted to")
    wrench_samples: Names | Literal["none", "all"] = Field(
        "none", description="candidates whose sampled wrenches are stored, by number or label"
    )


class Task(Section):
    """What the grasp has to hold: the object's weight, where ``object.mass_g`` gives its mass."""

    weight_direction: Vector = Field((0.0, 0.0, -1.0), description="direction of the weight in the object's frame")
    centre_of_mass_mm: Vector | Literal["auto"] = Field(
        "auto", description="centre of mass [x, y, z]; auto is the middle of the box round the object"
    )
    centre_of_mass = si("centre_of_mass_mm")
