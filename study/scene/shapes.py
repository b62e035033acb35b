"""The ``[object]`` section: one model per shape, keys with units, and SI values as properties."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from softjaw.study.scene.shape import Length, Point, Section, Shape, Span, Walled
from softjaw.study.units import UNITS, si

Triple = Annotated[tuple[Length, Length, Length], Field(strict=False)]


class Sphere(Shape):
    """A ball about the origin."""

    shape: Literal["sphere"]
    radius_mm: Length = Field(description="radius")
    radius = si("radius_mm")

    @property
    def axis_symmetry(self) -> int:
        """Order of the rotational symmetry about z."""
        return 0

    @property
    def spans_mm(self) -> dict[str, Span]:
        """Extent along each axis [mm]."""
        return dict.fromkeys("xyz", (-self.radius_mm, self.radius_mm))


class EllipticCylinder(Shape):
    """A cylinder along z about the origin, with the semi-axes a along x and b along y."""

    shape: Literal["elliptic_cylinder"]
    semi_axis_a_mm: Length = Field(description="semi-axis along x, the approach at angle 0")
    semi_axis_b_mm: Length = Field(description="semi-axis along y, across the approach at angle 0")
    length_mm: Length = Field(description="length along z, edges rounded by 2 mm included")
    semi_axis_a, semi_axis_b, length = si("semi_axis_a_mm"), si("semi_axis_b_mm"), si("length_mm")

    @property
    def axis_symmetry(self) -> int:
        """Order of the rotational symmetry about z."""
        return 0 if self.semi_axis_a_mm == self.semi_axis_b_mm else 2

    @property
    def spans_mm(self) -> dict[str, Span]:
        """Extent along each axis [mm]."""
        a, b, half = self.semi_axis_a_mm, self.semi_axis_b_mm, self.length_mm / 2
        return {"x": (-a, a), "y": (-b, b), "z": (-half, half)}


class Box(Shape):
    """A box about the origin with rounded edges."""

    shape: Literal["box"]
    size_mm: Triple = Field(description="size along x, y and z")
    edge_radius_mm: float = Field(gt=0, description="radius of the edges and corners")
    size, edge_radius = si("size_mm"), si("edge_radius_mm")

    @property
    def axis_symmetry(self) -> int:
        """Order of the rotational symmetry about z."""
        return 4 if self.size_mm[0] == self.size_mm[1] else 2

    @property
    def spans_mm(self) -> dict[str, Span]:
        """Extent along each axis [mm]."""
        return {axis: (-size / 2, size / 2) for axis, size in zip("xyz", self.size_mm, strict=True)}


class Plate(Shape):
    """Two planes, ``|x| <= thickness / 2``, without end along y and z."""

    shape: Literal["plane"]
    thickness_mm: Length = Field(description="distance of the two planes, which the fingers press along x")
    thickness = si("thickness_mm")

    @property
    def axis_symmetry(self) -> int:
        """Order of the rotational symmetry about z."""
        return 2

    @property
    def spans_mm(self) -> dict[str, Span]:
        """Extent along x [mm]."""
        return {"x": (-self.thickness_mm / 2, self.thickness_mm / 2)}


class Revolution(Walled):
    """A body of revolution about z: a bottle, a cup."""

    shape: Literal["revolution"]
    profile_mm: tuple[Point, ...] = Field(
        strict=False, min_length=4, max_length=2000, description="outline as points [z, radius] with rising z"
    )
    profile = si("profile_mm")

    @property
    def axis_symmetry(self) -> int:
        """Order of the rotational symmetry about z."""
        return 0

    @property
    def spans_mm(self) -> dict[str, Span]:
        """Extent along each axis [mm]."""
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

    @property
    def axis_symmetry(self) -> int:
        """Order of the rotational symmetry about z."""
        if any(any(s.shift_mm) for s in self.sections):
            return 1
        alike = all((s.b_mm or s.a_mm) == s.a_mm and s.exponent == 2.0 for s in self.sections)
        return 0 if alike else 2

    @property
    def spans_mm(self) -> dict[str, Span]:
        """Extent along each axis [mm]."""
        x = [s.shift_mm[0] + side * s.a_mm for s in self.sections for side in (-1, 1)]
        y = [s.shift_mm[1] + side * (s.b_mm or s.a_mm) for s in self.sections for side in (-1, 1)]
        z = [s.z_mm for s in self.sections]
        return {"x": (min(x), max(x)), "y": (min(y), max(y)), "z": (min(z), max(z))}


class Mesh(Walled):
    """A closed triangle mesh from a file."""

    shape: Literal["mesh"]
    mesh: str = Field(
        min_length=1, max_length=4000, description="file of the mesh (.stl, .ply, .obj), beside the scene file"
    )
    unit: Literal["mm", "cm", "m", "inch"] = Field(description="unit of the mesh file's coordinates")
    axis: Literal["x", "y", "z"] = Field("z", description="axis of the mesh file that becomes the object's axis")
    grid_step_mm: Annotated[float, Field(ge=0.01, le=50)] | Literal["auto"] = Field(
        "auto", description="step of the grid on which the distance to the mesh is sampled"
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
