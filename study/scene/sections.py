"""The sections of a scene other than ``[object]``: keys with units, defaults, ranges, and SI values as properties."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, field_validator, model_validator

from softjaw.study.scene.objects import Section
from softjaw.study.units import si

Vector = Annotated[tuple[float, float, float], Field(strict=False)]
Count = Annotated[int, Field(ge=2, le=400)]
Force = Annotated[float, Field(gt=0, le=1000)]
Angle = Annotated[float, Field(ge=-360, le=360)]
Extent = Annotated[float, Field(ge=0, le=500)]
Grading = Annotated[float, Field(ge=0.05, le=20)]
WallSize = Annotated[float, Field(ge=0.2, le=50)]
POSE = [{"point_mm": [0, 0, 20], "approach": [1, 0, 0], "long_side": [0, 0, 1]}]
Names = Annotated[tuple[int | str, ...], Field(strict=False, min_length=1)]
Share = Annotated[float, Field(ge=0, le=50)]


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
    alpha: tuple[float, ...] = Field(
        (), strict=False, max_length=6, description="exponents of hyperfoam's terms", examples=[[-2]]
    )
    shear_moduli_kpa: tuple[float, ...] = Field(
        (), strict=False, max_length=6, description="moduli of hyperfoam's terms", examples=[[40]]
    )
    elements: Annotated[tuple[Count, Count, Count], Field(strict=False)] = Field(
        (20, 10, 6), description="elements of the whole pad along its length, width and thickness"
    )
    element: Literal["hex8", "hex27"] = Field("hex8", description="trilinear or triquadratic elements")
    grading_x: Grading = Field(1.0, description="size of the elements at the pad's ends over that at its centre")
    grading_y: Grading = Field(1.0, description="size of the elements at the pad's sides over that at its centre")
    grading_z: Grading = Field(1.0, description="size of the elements at the pad's back over that at its contact face")
    sheet_thickness_mm: float = Field(2.0, ge=0.05, le=100, description="thickness of the backing plate")
    sheet_modulus_gpa: float = Field(200.0, ge=1e-3, le=2000, description="Young's modulus of the plate; steel has 200")
    sheet_poisson: float = Field(0.3, ge=0, le=0.4999, description="Poisson's ratio of the backing plate")
    sheet_support_mm: Annotated[tuple[Extent, Extent], Field(strict=False)] = Field(
        (20.0, 10.0), description="length and width of the patch in the plate's middle that the finger holds"
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
    model: Literal["pcm", "pcm_projected"] = Field("pcm", description="planar variant that is shown first")
    cor_grid: int = Field(0, ge=0, le=1000, description="n of an n x n grid of centres of rotation; 0 is off")


class GraspPose(Section):
    """One explicit grasp: finger 1 comes along ``approach`` through the point, finger 2 from the opposite side."""

    point_mm: Vector = Field(
        description="a point on the line along which the fingers close, [x, y, z]", examples=[[0, 0, 20]]
    )
    approach: Vector = Field(description="direction from finger 1 towards the object", examples=[[1, 0, 0]])
    long_side: Vector = Field(
        description="direction of the pads' long side; only its part across the approach counts", examples=[[0, 0, 1]]
    )
    label: str = Field("", max_length=100, description="name of the grasp")
    point = si("point_mm")


class Candidates(Section):
    """Where to grasp: stations along the object's axis x angles about it, or explicit poses."""

    stations: int | None = Field(
        None, ge=2, le=10_000, description="number of stations, spread evenly over station_range_mm"
    )
    station_range_mm: Annotated[tuple[float, float], Field(strict=False)] | None = Field(
        None, description="first and last station along the object's axis", examples=[[25, 175]]
    )
    stations_mm: Annotated[tuple[float, ...], Field(strict=False, min_length=1, max_length=10_000)] | None = Field(
        None, description="stations along the object's axis", examples=[[25, 50, 75]]
    )
    angles_deg: tuple[Angle, ...] = Field(
        (0.0, 90.0),
        strict=False,
        min_length=1,
        max_length=3600,
        description="angles about the axis",
        examples=[[0, 90]],
    )
    roll_deg: Angle = Field(
        0.0, description="turn of the gripper about the approach; 0 has the long side along the axis"
    )
    poses: tuple[GraspPose, ...] = Field(
        (), strict=False, max_length=100_000, description="explicit grasps", examples=[POSE]
    )
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
        strict=False, min_length=1, max_length=1000, description="normal forces per finger", examples=[[1, 2, 5]]
    )
    normal_force = si("normal_force_n")

    @field_validator("normal_force_n")
    @classmethod
    def _ascending(cls, values: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(sorted(values))


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


class Effects(Section):
    """What is simulated; ``auto`` takes the cheapest level that the scene allows."""

    object: Literal["auto", "rigid", "linear_shell", "nonlinear_shell"] = Field(
        "auto", description="the object's compliance; the shells need object.wall_mm"
    )
    sheet: Literal["auto", "rigid", "elastic"] = Field(
        "auto", description="the pad's backing plate: rigid, or a plate that bends"
    )
    model_size: Literal["auto", "full", "half", "quarter"] = Field("auto", description="part of the pad that is meshed")
    fingers: Literal["auto", "two"] = Field("auto", description="fingers that are solved")
    friction: Literal["auto", "ccm"] = Field("auto", description="friction model behind the score")
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


class Uncertainty(Section):
    """How far inputs may be off (0: not asked), as half-widths within which about 95 of 100 cases lie.

    Errors that no formula gives are found by solving a few candidates, the probes, again with the input changed.
    """

    probes: Annotated[int, Field(ge=2, le=1000)] | Names = Field(
        5, description="how many candidates are solved again, or which ones, by number or label"
    )
    mesh: bool = Field(False, description="the error of the mesh, from one with half as many elements per direction")
    shear_modulus_percent: Share = Field(0.0, description="half-width of the pads' shear modulus")
    wall_thickness_percent: Share = Field(0.0, description="half-width of the thickness of a thin wall")
    mu: float = Field(0.0, ge=0, le=5, description="half-width of the friction coefficient")
    pose_mm: float = Field(0.0, ge=0, le=50, description="half-width of the gripper's place along the pads' long side")
    pose_deg: float = Field(0.0, ge=0, le=30, description="half-width of the gripper's turn about the approach")
    pose, pose_turn = si("pose_mm"), si("pose_deg")

    @property
    def parts(self) -> tuple[str, ...]:
        """What is asked for, of ``mesh, mu, modulus, wall, pose``."""
        asked = {
            "mesh": self.mesh, "mu": self.mu, "modulus": self.shear_modulus_percent,
            "wall": self.wall_thickness_percent, "pose": self.pose_mm or self.pose_deg,
        }  # fmt: skip
        return tuple(name for name, wanted in asked.items() if wanted)

    def numbers(self, labels: tuple[str, ...]) -> tuple[int, ...]:
        """Numbers of the candidates that are named, in the order given; empty where only their count is given."""
        named = () if isinstance(self.probes, int) else self.probes
        return tuple(dict.fromkeys(name if isinstance(name, int) else labels.index(name) for name in named))


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
