"""The ``[object]`` section: one model per shape, keys with units, and SI values as properties."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from softjaw.study.units import UNITS, in_si, si

Span = tuple[float, float]
Length = Annotated[float, Field(gt=0)]
Point = Annotated[tuple[float, float], Field(strict=False)]
Triple = Annotated[tuple[Length, Length, Length], Field(strict=False)]


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
        return self._symmetry()

    @property
    def spans_mm(self) -> dict[str, Span]:
        """Extent along each axis where the scene alone tells it [mm]."""
        return self._spans_mm()

    @property
    def extent(self) -> float | None:
        """Largest extent [m]; None where the scene alone does not tell it."""
        return max(high - low for low, high in self.spans_mm.values()) / 1000 if len(self.spans_mm) == 3 else None

    def _symmetry(self) -> int:
        return 1

    def _spans_mm(self) -> dict[str, Span]:
        return {}


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


class Sphere(Shape):
    """A ball about the origin."""

    shape: Literal["sphere"]
    radius_mm: Length = Field(description="radius")
    radius = si("radius_mm")

    def _symmetry(self) -> int:
        return 0

    def _spans_mm(self) -> dict[str, Span]:
        return dict.fromkeys("xyz", (-self.radius_mm, self.radius_mm))


class EllipticCylinder(Shape):
    """A cylinder along z about the origin, with the semi-axes a along x and b along y."""

    shape: Literal["elliptic_cylinder"]
    semi_axis_a_mm: Length = Field(description="semi-axis along x, the approach at angle 0")
    semi_axis_b_mm: Length = Field(description="semi-axis along y, across the approach at angle 0")
    length_mm: Length = Field(description="length along z, edges rounded by 2 mm included")
    semi_axis_a, semi_axis_b, length = si("semi_axis_a_mm"), si("semi_axis_b_mm"), si("length_mm")

    def _symmetry(self) -> int:
        return 0 if self.semi_axis_a_mm == self.semi_axis_b_mm else 2

    def _spans_mm(self) -> dict[str, Span]:
        a, b, half = self.semi_axis_a_mm, self.semi_axis_b_mm, self.length_mm / 2
        return {"x": (-a, a), "y": (-b, b), "z": (-half, half)}


class Box(Shape):
    """A box about the origin with rounded edges."""

    shape: Literal["box"]
    size_mm: Triple = Field(description="size along x, y and z", examples=[[60, 40, 120]])
    edge_radius_mm: float = Field(gt=0, description="radius of the edges and corners")
    size, edge_radius = si("size_mm"), si("edge_radius_mm")

    def _symmetry(self) -> int:
        return 4 if self.size_mm[0] == self.size_mm[1] else 2

    def _spans_mm(self) -> dict[str, Span]:
        return {axis: (-size / 2, size / 2) for axis, size in zip("xyz", self.size_mm, strict=True)}


class Plate(Shape):
    """Two planes, ``|x| <= thickness / 2``, without end along y and z."""

    shape: Literal["plane"]
    thickness_mm: Length = Field(description="distance of the two planes, which the fingers press along x")
    thickness = si("thickness_mm")

    def _symmetry(self) -> int:
        return 2

    def _spans_mm(self) -> dict[str, Span]:
        return {"x": (-self.thickness_mm / 2, self.thickness_mm / 2)}


class Revolution(Walled):
    """A body of revolution about z: a bottle, a cup."""

    shape: Literal["revolution"]
    profile_mm: tuple[Point, ...] = Field(
        strict=False,
        min_length=4,
        max_length=2000,
        description="outline as points [z, radius] with rising z",
        examples=[[[0, 30], [50, 30], [80, 20], [100, 20]]],
    )
    profile = si("profile_mm")

    def _symmetry(self) -> int:
        return 0

    def _spans_mm(self) -> dict[str, Span]:
        radius = max(r for _, r in self.profile_mm)
        heights = [z for z, _ in self.profile_mm]
        return {"x": (-radius, radius), "y": (-radius, radius), "z": (min(heights), max(heights))}


class SectionTable(Section):
    """One cross-section of a body of stacked sections."""

    z_mm: float = Field(description="height")
    a_mm: float = Field(ge=0, description="semi-axis along x; 0 is allowed for the first and the last section")
    b_mm: Length | None = Field(None, description="semi-axis along y; that along x if left out")
    exponent: float = Field(2.0, ge=2, le=20, description="2 for an ellipse, more for a rounded rectangle")
    shift_mm: Point = Field((0.0, 0.0), strict=False, description="place of the section's middle, [x, y]")
    z, a, b, shift = si("z_mm"), si("a_mm"), si("b_mm"), si("shift_mm")


class Sections(Walled):
    """A body of sections stacked along z, each an ellipse or a rounded rectangle: a bottle that is not round."""

    shape: Literal["sections"]
    sections: tuple[SectionTable, ...] = Field(
        strict=False, min_length=4, max_length=500, description="cross-sections from bottom to top"
    )

    def _symmetry(self) -> int:
        if any(any(s.shift_mm) for s in self.sections):
            return 1
        alike = all((s.b_mm or s.a_mm) == s.a_mm and s.exponent == 2.0 for s in self.sections)
        return 0 if alike else 2

    def _spans_mm(self) -> dict[str, Span]:
        x = [s.shift_mm[0] + side * s.a_mm for s in self.sections for side in (-1, 1)]
        y = [s.shift_mm[1] + side * (s.b_mm or s.a_mm) for s in self.sections for side in (-1, 1)]
        z = [s.z_mm for s in self.sections]
        return {"x": (min(x), max(x)), "y": (min(y), max(y)), "z": (min(z), max(z))}


class Mesh(Walled):
    """A triangle mesh from a file."""

    shape: Literal["mesh"]
    mesh: str = Field(
        min_length=1, max_length=4000, description="file of the mesh (.stl, .obj, .ply, .off), beside the scene file"
    )
    unit: Literal["mm", "cm", "m", "inch"] = Field(description="unit of the mesh file's coordinates")
    axis: Literal["x", "y", "z"] = Field("z", description="axis of the mesh file that becomes the object's axis")
    grid_step_mm: Annotated[float, Field(ge=0.01, le=50)] | Literal["auto"] = Field(
        "auto", description="step of the grid on which the distance to the mesh is sampled"
    )
    crease_angle_deg: Annotated[float, Field(ge=0, le=180)] = Field(
        30.0, description="edges that turn by less are facets of a smooth surface, others stay edges; 0: all stay"
    )
    wall_heights_mm: Annotated[tuple[float, float], Field(strict=False)] | None = Field(
        None, description="part of the mesh along its axis that a thin wall is traced on, [low, high]; else all of it"
    )
    grid_step, wall_heights = si("grid_step_mm"), si("wall_heights_mm")

    @property
    def unit_length(self) -> float:
        """Length of one unit of the file [m]."""
        return UNITS[self.unit].size


Object = Annotated[
    Revolution | Sections | EllipticCylinder | Sphere | Box | Plate | Mesh,
    Field(discriminator="shape", description="what is grasped"),
]
SHAPES: dict[str, type[Shape]] = {
    "revolution": Revolution,
    "sections": Sections,
    "elliptic_cylinder": EllipticCylinder,
    "sphere": Sphere,
    "box": Box,
    "plane": Plate,
    "mesh": Mesh,
}
