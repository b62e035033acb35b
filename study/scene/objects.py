"""The ``[object]`` section: one model per shape with its keys, SI values, and the rules of its values."""

import math
from contextlib import suppress
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, get_args

from pydantic import Field, PrivateAttr, ValidationInfo, field_validator

from softjaw.fem.objects.mesh_file import ENDINGS, lacking
from softjaw.study.scene.section import Errors, Point, SceneSection, Text, numbers_text, refusal, wrong

SMALLEST_MM, LARGEST_MM = 1.0, 2000.0
WALL_KEYS = ("base_wall_mm", "young_modulus_gpa", "wall_poisson_ratio", "yield_strength_mpa", "allowed_dent_mm")


Span = tuple[float, float]
Length = Annotated[float, Field(gt=0)]


class Shape(SceneSection):
    """What all shapes share. The object's axis is z."""

    SIZE_KEYS: ClassVar[tuple[str, ...]] = ()  # key of the extents, or one key for each of x, y and z
    name: Text = Field("", max_length=100, description="name for titles and tables")
    mass_g: float | None = Field(None, gt=0, le=1e6, description="mass, for the force to use")
    density: float | None = Field(None, gt=0, le=30_000, description="instead of the mass, of a solid body [kg/m^3]")

    @property
    def axis_symmetry(self) -> int:
        """Order of the rotational symmetry about z: 0 is every angle, 1 none."""
        return self._geometry()[0]

    @property
    def spans_mm(self) -> dict[str, Span]:
        """Extent along each axis, where it is known without a mesh file [mm]."""
        return self._geometry()[1]

    def _geometry(self) -> tuple[int, dict[str, Span]]:
        """`axis_symmetry` and `spans_mm`."""
        return 1, {}

    def rules(self) -> Errors:
        """Extents outside 1 mm to 2 m are slips of the unit; a body has one mass."""
        if self.density is not None and (self.mass_g is not None or getattr(self, "wall_mm", None) is not None):
            beside = "mass_g" if self.mass_g is not None else "wall_mm"
            yield wrong(self.density, f"mass_g alone: {beside} stands beside it", "density")
        for i, (axis, (low, high)) in enumerate(self.spans_mm.items()):
            extent = high - low
            if not SMALLEST_MM <= extent <= LARGEST_MM:
                key = self.SIZE_KEYS[i % len(self.SIZE_KEYS)]
                expected = f"an extent of {SMALLEST_MM:g} to {LARGEST_MM:g} mm, not {extent:g} mm along {axis}"
                yield wrong(getattr(self, key), f"{expected}; check the unit, which is mm", key)
                return


class Walled(Shape):
    """Shapes that can have a thin wall: ``wall_mm`` makes them hollow, and the wall gives way under the pads."""

    wall_mm: Length | Annotated[tuple[Point, ...], Field(min_length=2, max_length=500)] | None = Field(
        None, description="wall thickness, or pairs [z, thickness] with rising z; without it the object is rigid"
    )
    base_wall_mm: Length | None = Field(None, description="thickness of a flat bottom; that of the wall if left out")
    wall_material: Literal["PET", "PP", "HDPE", "custom"] = Field("PET", description="material of the wall")
    young_modulus_gpa: float | None = Field(None, gt=0, le=1000, description="Young's modulus if not the material's")
    wall_poisson_ratio: float | None = Field(None, ge=0, le=0.49, description="Poisson's ratio if not the material's")
    yield_strength_mpa: float | None = Field(None, gt=0, le=1e5, description="yield strength instead of the material's")
    allowed_dent_mm: Length | None = Field(None, description="largest allowed indentation, for the safe force range")
    open_ends: Literal["top", "both", "none"] = Field(
        "top", description="top: open as a cup and a bottle without its cap are; both: a tube"
    )
    support: Literal["free", "standing", "clamped"] = Field(
        "free", description="held by the fingers alone, on a foot glued to a table, or clamped (a tube at both ends)"
    )

    @property
    def thicknesses_mm(self) -> tuple[float, ...]:
        """Thickness at every point where one is given [mm]."""
        return tuple(t for _, t in self.wall_mm) if isinstance(self.wall_mm, tuple) else (self.wall_mm or 0.0,)

    @property
    def open_top(self) -> bool:
        """Whether nothing closes the top."""
        return self.open_ends != "none"

    @property
    def open_bottom(self) -> bool:
        """Whether nothing closes the bottom."""
        return self.open_ends == "both"

    def rules(self) -> Errors:
        """A thickness that is thin beside the object, and a complete material."""
        yield from super().rules()
        if self.wall is not None:
            yield from self._wall_rules()
            return
        for key in WALL_KEYS:
            if (value := getattr(self, key, None)) is not None:
                yield wrong(value, "a wall beside it, as in `wall_mm = 0.4`", key)

    def _wall_rules(self) -> Errors:
        if self.open_bottom and self.base_wall_mm is not None:
            yield wrong(self.base_wall_mm, 'either base_wall_mm or open_ends = "both"', "base_wall_mm")
        for i, (low, high) in enumerate(pairwise(self.wall_mm if isinstance(self.wall_mm, tuple) else ()), 1):
            if high[0] <= low[0]:
                yield wrong(high, f"pairs [z, thickness] with z rising from {low[0]:g} mm", "wall_mm", i)
        # a thinner foil is a slip of the unit; share of the smallest extent: a thicker wall is no shell
        most = 0.1 * min((high - low for low, high in self.spans_mm.values()), default=math.inf)
        given = [("wall_mm", t) for t in self.thicknesses_mm]
        given += [("base_wall_mm", self.base_wall_mm)] if self.base_wall_mm is not None else []
        for key, value in given:
            if not 0.01 <= value <= most:
                expected = f"a thickness from 0.01 to {most:g} mm, a tenth of the object's smallest extent"
                if key == "wall_mm" and value > most:
                    expected += "; a thicker wall is no shell: leave it out for a rigid object"
                yield wrong(value, expected, key)
                break
        missing = [k for k in ("young_modulus_gpa", "wall_poisson_ratio") if getattr(self, k) is None]
        if self.wall_material == "custom" and missing:
            expected = f"{' and '.join(missing)} beside it, as in `wall_poisson_ratio = 0.38`"
            yield wrong("custom", expected, "wall_material")


class SphereShape(Shape):
    """A ball about the origin."""

    SIZE_KEYS = ("radius_mm",)
    shape: Literal["sphere"]
    radius_mm: Length = Field(description="radius")

    def _geometry(self) -> tuple[int, dict[str, Span]]:
        return 0, dict.fromkeys("xyz", (-self.radius_mm, self.radius_mm))


class EllipticCylinderShape(Shape):
    """A cylinder along z about the origin, with the semi-axes a along x and b along y."""

    SIZE_KEYS = ("semi_axis_a_mm", "semi_axis_b_mm", "length_mm")
    shape: Literal["elliptic_cylinder"]
    semi_axis_a_mm: Length = Field(description="semi-axis along x, the approach at angle 0")
    semi_axis_b_mm: Length = Field(description="semi-axis along y, across the approach at angle 0")
    length_mm: Length = Field(description="length along z, edges rounded by 2 mm included")

    def _geometry(self) -> tuple[int, dict[str, Span]]:
        a, b, half = self.semi_axis_a_mm, self.semi_axis_b_mm, self.length_mm / 2
        return 0 if a == b else 2, {"x": (-a, a), "y": (-b, b), "z": (-half, half)}


class BoxShape(Shape):
    """A box about the origin with rounded edges."""

    SIZE_KEYS = ("size_mm",)
    shape: Literal["box"]
    size_mm: tuple[Length, Length, Length] = Field(description="size along x, y and z", examples=[[60, 40, 120]])
    edge_radius_mm: float = Field(gt=0, description="radius of the edges and corners")

    def _geometry(self) -> tuple[int, dict[str, Span]]:
        symmetry = 4 if self.size_mm[0] == self.size_mm[1] else 2
        return symmetry, {axis: (-size / 2, size / 2) for axis, size in zip("xyz", self.size_mm, strict=True)}

    def rules(self) -> Errors:
        """Edges cannot be rounder than the box is thick."""
        yield from super().rules()
        most = min(self.size_mm) / 2
        if self.edge_radius_mm > most:
            yield wrong(self.edge_radius_mm, f"at most half the smallest size, {most:g} mm", "edge_radius_mm")


class Plate(Shape):
    """Two planes, ``|x| <= thickness / 2``, without end along y and z."""

    SIZE_KEYS = ("thickness_mm",)
    shape: Literal["plane"]
    thickness_mm: Length = Field(description="distance of the two planes, which the fingers press along x")

    def _geometry(self) -> tuple[int, dict[str, Span]]:
        return 2, {"x": (-self.thickness_mm / 2, self.thickness_mm / 2)}


class RevolutionShape(Walled):
    """A body of revolution about z: a bottle, a cup."""

    SIZE_KEYS = ("profile_mm",)
    shape: Literal["revolution"]
    profile_mm: tuple[Point, ...] = Field(
        min_length=4, max_length=2000,
        description="outline as points [z, radius] with rising z, a smooth curve through them; straight along three or"
        " more on a line, whose corners are rounded by 2 mm",
        examples=[[[0, 30], [30, 30], [60, 30], [90, 20]]],
    )  # fmt: skip

    def _geometry(self) -> tuple[int, dict[str, Span]]:
        radius = max(r for _, r in self.profile_mm)
        heights = [z for z, _ in self.profile_mm]
        return 0, {"x": (-radius, radius), "y": (-radius, radius), "z": (min(heights), max(heights))}

    def rules(self) -> Errors:
        """An outline leads from one end to the other: z never falls, and only the ends may lie on the axis."""
        yield from super().rules()
        for i, (z, r) in enumerate(self.profile_mm):
            before = self.profile_mm[i - 1]
            if i and (z < before[0] or (z, r) == before):
                expected = f"points [z, radius] with rising z; the one before is {numbers_text(before)}"
                yield wrong((z, r), expected, "profile_mm", i)
            at_end = i in (0, len(self.profile_mm) - 1)
            if r < 0 or (r == 0 and not at_end):
                expected = "a radius >= 0" if at_end else "a radius > 0 between the ends"
                yield wrong((z, r), f"{expected}, each point as [z, radius], in mm", "profile_mm", i)


class SectionTable(SceneSection):
    """One cross-section of a body of stacked sections."""

    z_mm: float = Field(description="height")
    a_mm: float = Field(ge=0, description="semi-axis along x; 0 is allowed for the first and the last section")
    b_mm: Length | None = Field(None, description="semi-axis along y; that along x if left out")
    exponent: float = Field(2.0, ge=2, le=20, description="2 for an ellipse, more for a rounded rectangle")
    shift_mm: Point = Field((0.0, 0.0), description="place of the section's middle, [x, y]")


class Sections(Walled):
    """A body of sections stacked along z, each an ellipse or a rounded rectangle: a bottle that is not round."""

    SIZE_KEYS = ("sections",)
    shape: Literal["sections"]
    sections: tuple[SectionTable, ...] = Field(min_length=4, max_length=500, description="sections, the lowest first")

    def _geometry(self) -> tuple[int, dict[str, Span]]:
        alike = all((s.b_mm or s.a_mm) == s.a_mm and s.exponent == 2.0 for s in self.sections)
        symmetry = 1 if any(any(s.shift_mm) for s in self.sections) else 0 if alike else 2
        x = [s.shift_mm[0] + side * s.a_mm for s in self.sections for side in (-1, 1)]
        y = [s.shift_mm[1] + side * (s.b_mm or s.a_mm) for s in self.sections for side in (-1, 1)]
        z = [s.z_mm for s in self.sections]
        return symmetry, {"x": (min(x), max(x)), "y": (min(y), max(y)), "z": (min(z), max(z))}

    def rules(self) -> Errors:
        """Sections are stacked upwards; only the first and the last may end on the axis."""
        yield from super().rules()
        for i, (low, high) in enumerate(pairwise(self.sections), 1):
            if high.z_mm <= low.z_mm:
                expected = f"sections from bottom to top; the one before is at {low.z_mm:g} mm"
                yield wrong(high.z_mm, expected, "sections", i, "z_mm")
        for i, section in enumerate(self.sections[1:-1], 1):
            if section.a_mm == 0:
                yield wrong(section.a_mm, "a semi-axis above 0 between the ends", "sections", i, "a_mm")


class Mesh(Walled):
    """A triangle mesh from a file."""

    shape: Literal["mesh"]
    mesh: Text = Field(min_length=1, max_length=4000, description=f"mesh file ({', '.join(ENDINGS)}), beside the scene")
    unit: Literal["mm", "cm", "m", "inch"] = Field(description="unit of the mesh file's coordinates")
    axis: Literal["x", "y", "z"] = Field("z", description="axis of the mesh file that becomes the object's axis")
    grid_step_mm: Annotated[float, Field(ge=0.01, le=50)] | Literal["auto"] = Field(
        "auto", description="step of the grid on which the distance to the mesh is sampled"
    )
    crease_angle_deg: Annotated[float, Field(ge=0, le=180)] = Field(
        30.0, description="edges that turn by less are facets of a smooth surface, others stay edges; 0: all stay."
        " Up to 30 those at the ends of long facets stay, too"
    )

    # time and size of the file: what is kept of a mesh is not taken for another one in its place
    _stamp = PrivateAttr((0, 0))

    def model_post_init(self, context: Any) -> None:
        """Note which file it is."""
        with suppress(OSError):
            status = Path(self.mesh).stat()
            self._stamp = status.st_mtime_ns, status.st_size

    @field_validator("mesh")
    @classmethod
    def _file_is_there(cls, mesh: str, info: ValidationInfo) -> str:
        """Of a scene file that is read; what is in the mesh is judged when it is read."""
        if info.context and (expected := lacking(Path(mesh))):
            raise refusal(expected)
        return mesh


Object = Annotated[
    RevolutionShape | Sections | EllipticCylinderShape | SphereShape | BoxShape | Plate | Mesh,
    Field(discriminator="shape", description="what is grasped"),
]
SHAPES: dict[str, type[Shape]] = {
    get_args(model.model_fields["shape"].annotation)[0]: model for model in get_args(get_args(Object)[0])
}
