"""What all shapes of the ``[object]`` section share, and the keys of those that can have a thin wall."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from softjaw.study.units import in_si, si

Span = tuple[float, float]
Length = Annotated[float, Field(gt=0)]
Point = Annotated[tuple[float, float], Field(strict=False)]


class Section(BaseModel):
    """What all sections share: nothing unknown, nothing converted from text, nothing changed later."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False, protected_namespaces=())


class Shape(Section):
    """What all shapes share. The object's axis is z."""

    name: str = Field("", max_length=100, description="name for titles and tables")
    mass_g: Annotated[float, Field(gt=0, le=1e6)] | None = Field(None, description="mass, for the safety factor")
    mass = si("mass_g")

    @property
    def axis_symmetry(self) -> int:
        """Order of the rotational symmetry about z: 0 is every angle, 1 none."""
        return 1

    @property
    def spans_mm(self) -> dict[str, Span]:
        """Extent along each axis where the scene alone tells it [mm]."""
        return {}

    @property
    def extent(self) -> float | None:
        """Largest extent [m]; None where the scene alone does not tell it."""
        return max(high - low for low, high in self.spans_mm.values()) / 1000 if len(self.spans_mm) == 3 else None


class Walled(Shape):
    """Shapes that can have a thin wall: ``wall_mm`` makes them hollow, and the wall gives way under the pads."""

    wall_mm: Length | None = Field(None, description="wall thickness; without it the object is rigid")
    wall_profile_mm: Annotated[tuple[Point, ...], Field(strict=False, min_length=2, max_length=500)] | None = Field(
        None, description="wall thickness by height, as pairs [z, thickness] with rising z, instead of wall_mm"
    )
    base_wall_mm: Length | None = Field(None, description="thickness of a flat bottom; that of the wall if left out")
    wall_material: Literal["PET", "PP", "HDPE", "custom"] = Field("PET", description="material of the wall")
    young_modulus_gpa: Annotated[float, Field(gt=0, le=1000)] | None = Field(
        None, description="Young's modulus of the wall, instead of the material's"
    )
    wall_poisson_ratio: Annotated[float, Field(ge=0, le=0.49)] | None = Field(
        None, description="Poisson's ratio of the wall, instead of the material's"
    )
    yield_strength_mpa: Annotated[float, Field(gt=0, le=1e5)] | None = Field(
        None, description="stress that the wall may bear, instead of the material's"
    )
    allowed_dent_mm: Length | None = Field(None, description="dent that the wall may get, for the window of forces")
    open_top: bool = Field(True, description="whether the last section is open, as a cup's and a bottle's without cap")
    support: Literal["standing", "clamped", "free"] = Field(
        "standing", description="standing on its bottom, clamped there, or held by the fingers alone"
    )
    springs_n_per_mm: float = Field(
        1.0, gt=0, le=1e4, description="weak springs that stand for what friction holds, all together"
    )
    base_wall, young_modulus = si("base_wall_mm"), si("young_modulus_gpa")
    yield_strength, allowed_dent = si("yield_strength_mpa"), si("allowed_dent_mm")

    @property
    def wall(self) -> float | tuple[Span, ...] | None:
        """Wall thickness, or pairs of height and thickness [m]; None for a rigid object."""
        profile = self.wall_profile_mm
        return in_si("wall_mm", self.wall_mm) if profile is None else in_si("wall_profile_mm", profile)

    @property
    def springs(self) -> float:
        """Stiffness of the weak springs [N/m]."""
        return 1000.0 * self.springs_n_per_mm
