"""The ``[object]`` section: one model per shape, keys with units, and SI values as properties."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field

from study.scene.units import UNITS, si

Span = tuple[float, float]
Length = Annotated[float, Field(gt=0)]
Triple = Annotated[tuple[Length, Length, Length], Field(strict=False)]
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
    length_mm: Length = Field(description="length along z")
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


class Revolution(Shape):
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


class Mesh(Shape):
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
    grid_step = si("grid_step_mm")

    @property
    def unit_length(self) -> float:
        """Length of one unit of the file [m]."""
        return UNITS[self.unit].size


Object = Annotated[
    Revolution | EllipticCylinder | Sphere | Box | Plate | Mesh,
    Field(discriminator="shape", description="what is grasped"),
]
SHAPES: dict[str, type[Shape]] = {
    "revolution": Revolution,
    "elliptic_cylinder": EllipticCylinder,
    "sphere": Sphere,
    "box": Box,
    "plane": Plate,
    "mesh": Mesh,
}
