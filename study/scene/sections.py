"""The sections of a scene other than ``[object]``: keys with units, defaults, ranges, and SI values as properties."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from softjaw.study.scene.shapes import Section
from softjaw.study.units import si

Vector = Annotated[tuple[float, float, float], Field(strict=False)]
Count = Annotated[int, Field(ge=2, le=400)]
Force = Annotated[float, Field(gt=0, le=1000)]
Angle = Annotated[float, Field(ge=-360, le=360)]
Extent = Annotated[float, Field(ge=0, le=500)]
Grading = Annotated[float, Field(ge=0.05, le=20)]
WallSize = Annotated[float, Field(ge=0.2, le=50)]


class Gripper(Section):
    """The two equal pads. No dimension of the original gripper is published; these defaults are plausible ones."""

    pad_length_mm: float = Field(50.0, ge=1, le=500, description="long side of the pad")
    pad_width_mm: float = Field(22.0, ge=1, le=500, description="short side of the pad")
    pad_thickness_mm: float = Field(15.0, ge=0.5, le=200, description="thickness of the pad")
    material: Literal["blatz_ko", "hyperfoam", "neo_hookean", "linear"] = Field(
        "blatz_ko", description="material law of the pad"
    )
    shear_modulus_kpa: float = Field(40.0, ge=0.01, le=1e6, description="initial shear modulus of the pad")
    poisson_ratio: float = Field(
        0.25, ge=0, le=0.4999, description="Poisson's ratio of the pad; Blatz-Ko foam has 0.25"
    )
    alpha: tuple[float, ...] = Field((), strict=False, max_length=6, description="exponents of hyperfoam's terms")
    shear_moduli_kpa: tuple[float, ...] = Field(
        (), strict=False, max_length=6, description="moduli of hyperfoam's terms"
    )
    elements: Annotated[tuple[Count, Count, Count], Field(strict=False)] = Field(
        (20, 10, 6), description="elements of the whole pad along its length, width and thickness"
    )
    element: Literal["hex8", "hex27"] = Field("hex8", description="trilinear or triquadratic elements")
    grading_x: Grading = Field(1.0, description="size of the elements at the pad's ends over that at its centre")
    grading_y: Grading = Field(1.0, description="size of the elements at the pad's sides over that at its centre")
    grading_z: Grading = Field(1.0, description="size of the elements at the pad's back over that at its front")
    sheet_thickness_mm: float = Field(2.0, ge=0.05, le=100, description="thickness of the sheet behind the pad")
    sheet_modulus_gpa: float = Field(200.0, ge=1e-3, le=2000, description="Young's modulus of the sheet; steel has 200")
    sheet_poisson: float = Field(0.3, ge=0, le=0.4999, description="Poisson's ratio of the sheet")
    sheet_support_mm: Annotated[tuple[Extent, Extent], Field(strict=False)] = Field(
        (20.0, 10.0), description="length and width of the patch in the sheet's middle that the finger holds"
    )
    pad_length, pad_width, pad_thickness = si("pad_length_mm"), si("pad_width_mm"), si("pad_thickness_mm")
    shear_modulus, shear_moduli = si("shear_modulus_kpa"), si("shear_moduli_kpa")
    sheet_thickness, sheet_modulus = si("sheet_thickness_mm"), si("sheet_modulus_gpa")
    sheet_support = si("sheet_support_mm")

    @model_validator(mode="before")
    @classmethod
    def _hyperfoam_defaults(cls, data: Any) -> Any:
        """Fill in hyperfoam's terms from the modulus (one term, which is Blatz-Ko foam), or the modulus from them."""
        if not isinstance(data, dict) or data.get("material") != "hyperfoam":
            return data
        terms = data.get("shear_moduli_kpa", [data.get("shear_modulus_kpa", 40.0)])
        plain = isinstance(terms, list | tuple) and all(isinstance(t, int | float) for t in terms)
        return {"alpha": [-2.0], "shear_modulus_kpa": sum(terms) if plain else 40.0, **data, "shear_moduli_kpa": terms}

    @property
    def pad_size(self) -> tuple[float, float, float]:
        """Length, width and thickness of the pad [m]."""
        return (self.pad_length, self.pad_width, self.pad_thickness)

    @property
    def grading(self) -> tuple[float, float, float]:
        """Ratio of the element sizes at the rim (x, y) and back (z) to those at the centre and front [-]."""
        return (self.grading_x, self.grading_y, self.grading_z)


class Friction(Section):
    """Friction between pad and object. Every model is computed; ``model`` is the planar one shown first."""

    mu: float = Field(0.8, ge=0, le=10, description="Coulomb friction coefficient")
    model: Literal["flat", "projected"] = Field("flat", description="planar variant that is shown first")
    cor_grid: int = Field(0, ge=0, le=1000, description="n of an n x n grid of centres of rotation; 0 is off")


class GraspPose(Section):
    """One explicit grasp: finger 1 comes along ``approach`` through the point, finger 2 from the opposite side."""

    point_mm: Vector = Field(description="a point on the line along which the fingers close, [x, y, z]")
    approach: Vector = Field(description="direction from finger 1 towards the object")
    long_side: Vector = Field(description="direction of the pads' long side; only its part across the approach counts")
    label: str = Field("", max_length=100, description="name of the grasp")
    point = si("point_mm")


class Candidates(Section):
    """Where to grasp: stations along the object's axis x angles about it, or explicit poses."""

    stations: int | None = Field(
        None, ge=2, le=10_000, description="number of stations, spread evenly over station_range_mm"
    )
    station_range_mm: Annotated[tuple[float, float], Field(strict=False)] | None = Field(
        None, description="first and last station along the object's axis"
    )
    stations_mm: Annotated[tuple[float, ...], Field(strict=False, min_length=1, max_length=10_000)] | None = Field(
        None, description="stations along the object's axis"
    )
    angles_deg: tuple[Angle, ...] = Field(
        (0.0, 90.0), strict=False, min_length=1, max_length=3600, description="angles about the axis"
    )
    roll_deg: Angle = Field(
        0.0, description="turn of the gripper about the approach; 0 has the long side along the axis"
    )
    poses: tuple[GraspPose, ...] = Field((), strict=False, max_length=100_000, description="explicit grasps")
    angles, roll = si("angles_deg"), si("roll_deg")

    @field_validator("stations_mm", "angles_deg")
    @classmethod
    def _ascending(cls, values: tuple[float, ...] | None) -> tuple[float, ...] | None:
        return None if values is None else tuple(sorted(values))

    @property
    def station_values_mm(self) -> tuple[float, ...]:
        """Stations along the object's axis, rising [mm]; empty with explicit poses."""
        if self.stations_mm is not None or self.stations is None or self.station_range_mm is None:
            return self.stations_mm or ()
        (low, high), n = self.station_range_mm, self.stations
        return tuple(low + (high - low) * i / (n - 1) for i in range(n))

    @property
    def station_values(self) -> tuple[float, ...]:
        """Stations along the object's axis, rising [m]; empty with explicit poses."""
        return tuple(s / 1000 for s in self.station_values_mm)

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the candidates: stations, then angles at each."""
        if self.poses:
            return tuple(pose.label or f"pose {i}" for i, pose in enumerate(self.poses))
        return tuple(f"{s:g} mm, {a:g} deg" for s in self.station_values_mm for a in self.angles_deg)

    @property
    def count(self) -> int:
        """Number of candidates."""
        return len(self.poses) or len(self.station_values_mm) * len(self.angles_deg)


class Load(Section):
    """What the fingers press with."""

    normal_force_n: tuple[Force, ...] = Field(
        strict=False, min_length=1, max_length=1000, description="normal forces per finger"
    )
    normal_force = si("normal_force_n")

    @field_validator("normal_force_n")
    @classmethod
    def _ascending(cls, values: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(sorted(values))


class Effects(Section):
    """What is simulated; ``auto`` takes the cheapest level that the scene allows."""

    object: Literal["auto", "rigid", "linear_shell", "nonlinear_shell"] = Field(
        "auto", description="the object's compliance; the shells need object.wall_mm"
    )
    pad: Literal["auto", "linear", "hyperelastic"] = Field(
        "auto", description="the deformation of the pads: small strains (condensed once for all cases), or finite"
    )
    sheet: Literal["auto", "rigid", "elastic"] = Field(
        "auto", description="the sheet behind the pad: rigid, or a plate that bends"
    )
    model_size: Literal["auto", "full", "half", "quarter"] = Field("auto", description="part of the pad that is meshed")
    fingers: Literal["auto", "two"] = Field("auto", description="fingers that are solved")
    friction: Literal["auto", "curved"] = Field("auto", description="friction model behind the score")
    limit_surface: Literal["auto", "three_motions", "fitted_ellipsoid", "quartic"] = Field(
        "auto", description="form of the limit surface; auto is that of [limit_surface]"
    )
    friction_pressure_coupling: Literal["auto", "none", "tangential"] = Field(
        "auto", description="whether friction acts back on the contact pressure; auto is none, as in the paper"
    )
    wrench: Literal["auto", "3-D", "6-D"] = Field(
        "auto", description="components of the friction wrench that are stored as a limit surface; auto is 3-D"
    )


class Accuracy(Section):
    """How exactly the contact is solved."""

    meshes: int = Field(1, ge=1, le=2, description="2 solves every case on a coarser mesh too and maps the differences")
    contact: Literal["weighted", "nodal"] = Field("weighted", description="how gaps are collocated")
    residual_tolerance: float = Field(1e-10, ge=1e-13, le=1e-9, description="residual over load at which a solve ends")
    min_step_fraction: float = Field(
        1 / 8, gt=0, le=1, description="shortest part of a step between two forces that is tried before another way"
    )
    wall_around_mm: WallSize = Field(1.5, description="size of a thin wall's elements round the object, under the pads")
    wall_along_mm: WallSize = Field(2.5, description="size of a thin wall's elements along the axis, under the pads")
    wall_coarse_mm: WallSize = Field(6.0, description="largest size of a thin wall's elements elsewhere")
    e_n: float | None = Field(
        None, gt=1e-4, le=0.5, description="largest relative error of e_n; mesh, steps and effects are chosen by it"
    )
    cost_file: str | None = Field(
        None, min_length=1, max_length=1000, description="result of 'softjaw cost' that they are chosen from"
    )
    wall_around, wall_along, wall_coarse = si("wall_around_mm"), si("wall_along_mm"), si("wall_coarse_mm")


class Output(Section):
    """Where results go and what they hold."""

    file: str = Field(
        "results/scene.hdf", min_length=1, max_length=1000, description="result file, below the working directory"
    )
    patches: Literal["all", "none"] = Field("all", description="whether the pressure on every face is kept")


class Run(Section):
    """How a run guards itself against single cases. Results do not depend on it: it may differ from run to run."""

    time_limit_s: float = Field(
        600.0, ge=0.1, le=1e6, description="time after which a case is given up as failed, and the others go on"
    )
    memory_gb: Annotated[float, Field(ge=0.1, le=1e5)] | Literal["auto", "none"] = Field(
        "auto",
        description="memory that the cases of a rank may take; auto is the rank's share of what is free",
    )
