"""The sections of a scene other than object and candidates: keys, ranges, SI values, and the rules of their values."""

from __future__ import annotations

import math
import string
from collections.abc import Mapping
from pathlib import PurePosixPath, PureWindowsPath
from typing import Annotated, Any, ClassVar, Literal

from pydantic import AfterValidator, Field, model_validator

from softjaw.fem.pad.halving import halved
from softjaw.study.messages import shown
from softjaw.study.scene.errors import Errors, wrong
from softjaw.study.scene.objects import Shape, Walled
from softjaw.study.scene.section import Direction, SceneSection, Text, Vector, once_and_rising
from softjaw.study.scene.text import flat
from softjaw.study.units import si

Count = Annotated[int, Field(ge=2, le=400)]
Counts = Annotated[tuple[Count, Count, Count], Field(strict=False)]
Extent = Annotated[float, Field(ge=0, le=500)]
Extents = Annotated[tuple[Extent, Extent], Field(strict=False)]
FingerSide = Annotated[float, Field(ge=1, le=1000)]
FingerSize = Annotated[tuple[FingerSide, FingerSide], Field(strict=False)]
Force = Annotated[float, Field(gt=0, le=1000)]
Terms = Annotated[tuple[float, ...], Field(strict=False, max_length=6)]
Grading = Annotated[float, Field(ge=0.05, le=20)]
WallSize = Annotated[float, Field(ge=0.2, le=50)]
Names = Annotated[tuple[int | str, ...], Field(strict=False, min_length=1)]
MOST_ELEMENTS, LARGEST_ASPECT = 1_000_000, 20.0
UNCERTAIN = ("object", "gripper", "friction", "candidates", "task")  # sections whose numbers may be
MOST_MESHES = 4  # of a case, each 1.4 times as fine in every direction as the one before; each costs 3 times as much
ROUNDING = 1e-9  # of a length: the plate's solver finds nodes this close to the rim of the support on it, too
LEVELS = {  # level of the effect: models of [limit_surface]
    "three_motions": ("three_motions",), "fitted_ellipsoid": ("full", "axis_aligned"), "quartic": ("quartic",),
}  # fmt: skip
CONVEX_FITS = ("full", "quartic")  # models that a convex program can fit, too
OPTION_CHARACTERS = {*string.ascii_lowercase, *string.digits, "_"}
VALUE_CHARACTERS = {*string.ascii_letters, *string.digits, *"_,.+-"}
OTHERS = "other options go into the environment variable PETSC_OPTIONS"


class Gripper(SceneSection):
    """The two equal pads. No dimension of the original gripper is published; the defaults are plausible ones."""

    pad_length_mm: float = Field(50.0, ge=1, le=500, description="long side of the pad")
    pad_width_mm: float = Field(22.0, ge=1, le=500, description="short side of the pad")
    pad_thickness_mm: float = Field(15.0, ge=0.5, le=200, description="thickness of the pad")
    material: Literal["blatz_ko", "hyperfoam", "neo_hookean", "linear"] = Field("blatz_ko", description="material law")
    shear_modulus_kpa: float = Field(40.0, ge=0.01, le=1e6, description="initial shear modulus of the pad")
    poisson_ratio: float = Field(0.25, ge=0, le=0.4999, description="Poisson's ratio of the pad; Blatz-Ko foam: 0.25")
    alpha: Terms = Field((), description="exponents of hyperfoam's terms", examples=[[-2]])
    shear_moduli_kpa: Terms = Field((), description="moduli of hyperfoam's terms", examples=[[40]])
    elements: Counts = Field((20, 10, 6), description="elements of the whole pad along its length, width and thickness")
    element: Literal["hex8", "hex27"] = Field("hex8", description="trilinear or triquadratic elements")
    grading_x: Grading = Field(1.0, description="size of the elements at the pad's ends over that at its centre")
    grading_y: Grading = Field(1.0, description="size of the elements at the pad's sides over that at its centre")
    grading_z: Grading = Field(1.0, description="size of the elements at the pad's back over that at its contact face")
    max_opening_mm: float | None = Field(
        None, gt=0, le=1000, description="largest distance of the pads' faces; wider grasps are not solved"
    )
    finger_size_mm: FingerSize | None = Field(
        None,
        description="length and width of what carries a pad, left out where it is the pad's own",
        examples=[[60, 25]],
    )
    sheet_thickness_mm: float = Field(2.0, ge=0.05, le=100, description="thickness of the backing plate")
    sheet_modulus_gpa: float = Field(200.0, ge=1e-3, le=2000, description="Young's modulus of the plate; steel: 200")
    sheet_poisson: float = Field(0.3, ge=0, le=0.4999, description="Poisson's ratio of the backing plate")
    sheet_support_mm: Extents = Field((20.0, 10.0), description="length and width of the plate's middle that is held")
    tilt_stiffness_nm_per_rad: float | None = Field(
        None, ge=1e-3, le=1e5, description="moment per angle of a mount that lets the pad tilt; left out: it does not"
    )
    pad_length, pad_width, pad_thickness = si("pad_length_mm"), si("pad_width_mm"), si("pad_thickness_mm")
    shear_modulus, shear_moduli = si("shear_modulus_kpa"), si("shear_moduli_kpa")
    max_opening: ClassVar[Any] = si("max_opening_mm")
    finger_size: ClassVar[Any] = si("finger_size_mm")
    sheet_thickness, sheet_modulus = si("sheet_thickness_mm"), si("sheet_modulus_gpa")
    sheet_support: ClassVar[Any] = si("sheet_support_mm")

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
    def foam_ratio(self) -> float:
        """Poisson's ratio of the foam; the Blatz-Ko law has its own by its form, whatever the scene says."""
        return 0.25 if self.material == "blatz_ko" else self.poisson_ratio

    @property
    def grading(self) -> tuple[float, float, float]:
        """Ratio of the element sizes at the rim (x, y) and back (z) to those at the centre and contact face [-]."""
        return (self.grading_x, self.grading_y, self.grading_z)

    def rules(self) -> Errors:
        """Constants that the material cannot have, slivers, and meshes beyond any memory."""
        yield from self._hyperfoam_rules() if self.material == "hyperfoam" else self._material_rules()
        pad = (self.pad_length_mm, self.pad_width_mm)
        if self.finger_size_mm and any(own < least for own, least in zip(self.finger_size_mm, pad, strict=True)):
            yield wrong(self.finger_size_mm, f"at least the pad's, {shown(list(pad))}, length first", "finger_size_mm")
        n = self.elements
        for i in (0, 1):
            if n[i] % 2 and self.grading[i] != 1:
                yield wrong(self.grading[i], f"1.0, or an even number of elements, not {n[i]}", f"grading_{'xy'[i]}")
        if math.prod(n) > MOST_ELEMENTS:
            expected = f"at most {MOST_ELEMENTS:,} elements, not {math.prod(n):,}; start with [20, 10, 6]"
            yield wrong(n, expected, "elements")
        edges = self._edges_mm()
        if max(map(max, edges)) > LARGEST_ASPECT * min(map(min, edges)):
            sizes = " x ".join(f"{low:.3g}" if low == high else f"{low:.3g}..{high:.3g}" for low, high in edges)
            expected = f"elements whose edges differ by a factor of {LARGEST_ASPECT:g} at most, not {sizes} mm"
            yield wrong(n, f"{expected}; [20, 10, 6] suits most pads", "elements")

    def _edges_mm(self) -> list[tuple[float, float]]:
        """Smallest and largest element edge along x, y and z [mm]."""
        sizes = (self.pad_length_mm / 2, self.pad_width_mm / 2, self.pad_thickness_mm)
        counts = (self.elements[0] // 2, self.elements[1] // 2, self.elements[2])
        edges = []
        for size, n, ratio in zip(sizes, counts, self.grading, strict=True):
            steps = [ratio ** (i / (n - 1)) for i in range(n)] if n > 1 else [1.0]
            edges.append((min(steps) / sum(steps) * size, max(steps) / sum(steps) * size))
        return edges

    def _material_rules(self) -> Errors:
        if self.material == "blatz_ko" and self.poisson_ratio != 0.25:
            expected = '0.25, which Blatz-Ko foam always has, or material = "hyperfoam"'
            yield wrong(self.poisson_ratio, expected, "poisson_ratio")
        for key in ("alpha", "shear_moduli_kpa"):
            if terms := getattr(self, key):
                yield wrong(terms, f'material = "hyperfoam", not {shown(self.material)}, beside it', key)

    def _hyperfoam_rules(self) -> Errors:
        if len(self.alpha) != len(self.shear_moduli_kpa):
            yield wrong(self.alpha, f"as many exponents as moduli, {len(self.shear_moduli_kpa)}", "alpha")
        if 0 in self.alpha:
            yield wrong(self.alpha, "exponents other than 0, such as 0.01", "alpha")
        total = sum(self.shear_moduli_kpa)
        if total <= 0 or not math.isclose(total, self.shear_modulus_kpa, rel_tol=1e-9):
            expected = f"the sum of shear_moduli_kpa, {total:g} kPa, and > 0; leave it out"
            yield wrong(self.shear_modulus_kpa, expected, "shear_modulus_kpa")

    def symmetry_rules(self, effects: Effects) -> Errors:
        """Symmetric halves need even counts."""
        n = list(self.elements)
        if effects.model_size != "full" and (n[0] % 2 or n[1] % 2):
            even = [n[0] + n[0] % 2, n[1] + n[1] % 2, n[2]]
            expected = f'even numbers along length and width, {even}, or effects.model_size = "full"'
            yield wrong(n, f"{expected}, so that symmetric halves can be meshed", "elements")

    def support_rules(self, effects: Effects, accuracy: Accuracy) -> Errors:
        """The finger holds the plate by at least one node of every mesh; with even counts one is in the middle."""
        tilts = self.tilt_stiffness_nm_per_rad is not None
        if tilts and effects.sheet == "elastic":
            expected = 'effects.sheet = "rigid" or "auto": a plate that tilts is rigid itself'
            yield wrong(self.tilt_stiffness_nm_per_rad, expected, "tilt_stiffness_nm_per_rad")
        if effects.sheet == "rigid" or tilts:
            return
        counts = [self.elements[:2], halved(self.elements)[:2]][: accuracy.meshes]
        size = self.pad_length_mm, self.pad_width_mm
        need = [max(side / n[axis] if n[axis] % 2 else 0.0 for n in counts) for axis, side in enumerate(size)]
        if any(held < (1 - ROUNDING) * least for held, least in zip(self.sheet_support_mm, need, strict=True)):
            meshes = " and ".join(f"{list(n)}" for n in counts)
            expected = f"at least {need[0]:g} x {need[1]:g} mm, which holds nodes of meshes of {meshes} elements"
            yield wrong(self.sheet_support_mm, f"{expected}; even numbers need less", "sheet_support_mm")


class Friction(SceneSection):
    """Friction between pad and object. Every model is computed; ``model`` is the planar one shown first."""

    mu: float = Field(0.8, ge=0, le=10, description="Coulomb friction coefficient")
    model: Literal["pcm", "pcm_projected"] = Field("pcm", description="planar variant that is shown first")
    cor_grid: int = Field(0, ge=0, le=1000, description="n of an n x n grid of centres of rotation; 0 is off")
    used_by_pressing: bool = Field(
        False, description="whether the friction that pressing has used is missing for holding (CCM)"
    )

    def used_rules(self, effects: Effects) -> Errors:
        """What pressing uses is known only where friction acts back."""
        if self.used_by_pressing and effects.friction_pressure_coupling != "tangential":
            expected = 'effects.friction_pressure_coupling = "tangential" beside it'
            yield wrong(True, expected, "used_by_pressing")


class Load(SceneSection):
    """What the fingers press with."""

    normal_force_n: Annotated[
        tuple[Force, ...], Field(strict=False, min_length=1, max_length=1000), AfterValidator(once_and_rising)
    ] = Field(description="normal forces per finger", examples=[[1, 2, 5]])
    normal_force: ClassVar[Any] = si("normal_force_n")


class ScoreKeys(SceneSection):
    """How torques are made comparable with forces in the grasp quality."""

    torque_scale: Literal["contact", "object"] = Field(
        "contact", description="length that scales soft torques: of the contact, as in the paper, or of the object"
    )
    object_length_mm: Annotated[float, Field(gt=0, le=2000)] | Literal["auto"] = Field(
        "auto", description="length that scales torque arms along all axes; auto: those of length_scale"
    )
    length_scale: Literal["per_axis", "longest"] = Field(
        "per_axis",
        description="extents of the object that scale torque arms: its own along each of x, y and z, as in the paper,"
        " or the longest along all",
    )
    contact_length_mm: Annotated[float, Field(gt=0, le=500)] | Literal["auto"] = Field(
        "auto", description="length that scales soft torques; auto is the pad's length"
    )
    epsilon: Literal["facing", "everywhere"] = Field(
        "facing", description="where epsilon is computed: for antipodal contacts, or in any pose (some 0.1 s each)"
    )
    object_length, contact_length = si("object_length_mm"), si("contact_length_mm")


class LimitSurfaceKeys(SceneSection):
    """The surface that bounds the friction wrenches of a contact, fitted to the wrenches of many motions."""

    model: Literal["three_motions", "axis_aligned", "full", "quartic"] = Field(
        "quartic", description="ellipsoid from three motions, fitted ellipsoid (along the axes or any), convex quartic"
    )
    objective: Literal["least_squares", "zhou"] = Field(
        "least_squares", description="what the fit of a full ellipsoid or a quartic minimises; zhou is slower"
    )
    samples: int = Field(500, ge=50, le=20_000, description="motions that the surface is fitted to")
    wrench_samples: Names | Literal["none", "all"] = Field(
        "none", description="candidates whose sampled wrenches are stored, by number or label"
    )

    def rules(self) -> Errors:
        """Only some models have several objectives."""
        if self.objective == "zhou" and self.model not in CONVEX_FITS:
            yield wrong("zhou", f'"least_squares", or model {" or ".join(CONVEX_FITS)}', "objective")


class TaskKeys(SceneSection):
    """What the grasp has to hold: the object's weight, in any direction or in one."""

    weight_direction: Direction | Literal["worst"] = Field(
        "worst", description="direction of the weight in the frame of the object's own file; worst: held in every one"
    )
    centre_of_mass_mm: Vector | Literal["auto"] = Field(
        "auto", description="centre of mass [x, y, z] in the same frame; auto is the centroid of the object's volume"
    )
    safety: float = Field(2.0, ge=1, le=100, description="how many times object.mass_g the force to use has to hold")
    drive: Literal["shared", "up_to", "fixed"] = Field(
        "shared", description="what a load makes of the normal forces: their sum stays, each gives way, each stays"
    )
    centre_of_mass: ClassVar[Any] = si("centre_of_mass_mm")

    @property
    def direction(self) -> tuple[float, float, float] | None:
        """Direction of the weight, None for every direction."""
        return None if isinstance(self.weight_direction, str) else self.weight_direction


class Effects(SceneSection):
    """What is simulated; ``auto`` takes the cheapest level that the scene allows."""

    object: Literal["auto", "rigid", "linear_shell", "nonlinear_shell"] = Field(
        "auto", description="the object's compliance; the shells need object.wall_mm"
    )
    sheet: Literal["auto", "rigid", "elastic"] = Field("auto", description="the pad's backing plate")
    model_size: Literal["auto", "full", "half", "quarter"] = Field("auto", description="part of the pad that is meshed")
    fingers: Literal["auto", "two"] = Field("auto", description="fingers that are solved")
    friction: Literal["auto", "ccm"] = Field("auto", description="friction model behind the score")
    limit_surface: Literal["auto", "three_motions", "fitted_ellipsoid", "quartic"] = Field(
        "auto", description="form of the limit surface; auto is that of [limit_surface]"
    )
    friction_pressure_coupling: Literal["auto", "none", "tangential"] = Field(
        "auto", description="whether friction acts back on the contact pressure; auto: where it moves e_n"
    )
    wrench: Literal["auto", "3-D", "6-D"] = Field(
        "auto", description="components of the friction wrench that are stored as a limit surface; auto is 3-D"
    )

    def object_rules(self, shape: Shape) -> Errors:
        """A shell needs a wall."""
        hollow = isinstance(shape, Walled) and shape.wall is not None
        if self.object.endswith("shell") and not hollow:
            yield wrong(self.object, 'an object with a wall, as `wall_mm = 0.4` in [object], or "auto"', "object")

    def surface_rules(self, surface: LimitSurfaceKeys) -> Errors:
        """A forced level is that of the model."""
        models = LEVELS.get(self.limit_surface, ())
        if models and surface.model not in models:
            expected = f'"auto", or the level of limit_surface.model, which is {shown(surface.model)}'
            yield wrong(self.limit_surface, expected, "limit_surface")


class Accuracy(SceneSection):
    """How exactly the contact is solved."""

    meshes: int = Field(
        2, ge=1, le=2, description="2 solves every case on a coarser mesh too, which tells the error of every number"
    )
    target: float | None = Field(
        None, gt=1e-4, le=0.5, description="largest relative error; a case on a rigid object that may have a larger one"
        " is solved on up to two finer meshes"
    )
    target_of: Literal["payload", "quality", "e_n"] = Field("payload", description="what the target is for")
    contact: Literal["auto", "weighted", "nodal", "blended"] = Field(
        "auto", description="how gaps are collocated; auto is blended for hex8, else weighted"
    )
    residual_tolerance: float = Field(1e-10, ge=1e-13, le=1e-9, description="residual over load at which a solve ends")
    min_step_fraction: float = Field(
        1 / 8, gt=0, le=1, description="shortest part of a load step that is tried before displacement control"
    )
    wall_around_mm: WallSize = Field(1.5, description="size of a thin wall's elements round the object, under the pads")
    wall_along_mm: WallSize = Field(2.5, description="size of a thin wall's elements along the axis, under the pads")
    wall_coarse_mm: WallSize = Field(6.0, description="largest size of a thin wall's elements elsewhere")
    wall_around, wall_along, wall_coarse = si("wall_around_mm"), si("wall_along_mm"), si("wall_coarse_mm")

    def rules(self) -> Errors:
        """A target needs errors."""
        if self.target is not None and self.meshes < 2:
            yield wrong(self.target, "accuracy.meshes = 2 beside it, whose difference tells the error", "target")

    @property
    def most_meshes(self) -> int:
        """On how many meshes a case is solved at most."""
        return self.meshes if self.target is None else MOST_MESHES


class Uncertainty(SceneSection):
    """Inputs that are uncertain: the study is solved again for samples of them, which gives maps an interval.

    The samples are a Latin hypercube of normal distributions about the scene's own values.
    """

    samples: int = Field(20, ge=8, le=1000, description="how often the study is solved again")
    spread: dict[str, Annotated[float, Field(gt=0)]] = Field(
        default_factory=dict,
        description="half-widths of 95 % intervals by dotted key, in the key's unit",
        examples=[{"friction.mu": 0.08}],
    )

    @model_validator(mode="before")
    @classmethod
    def _dotted(cls, data: Any) -> Any:
        """Dotted keys mean the same with and without quotes."""
        if isinstance(data, dict) and isinstance(data.get("spread"), dict):
            return data | {"spread": flat(data["spread"])}
        return data

    def spread_rules(self, *sections: SceneSection) -> Errors:
        """Only single numbers of the sections in `UNCERTAIN` can be uncertain."""
        by_name = dict(zip(UNCERTAIN, sections, strict=True))
        for key in self.spread:
            section, _, name = key.partition(".")
            known = section in by_name and name in type(by_name[section]).model_fields
            if type(value := getattr(by_name[section], name) if known else None) not in (int, float):
                expected = f"a key that has a single number, of {', '.join(UNCERTAIN)}"
                yield wrong(value, expected, "spread", key)


class Output(SceneSection):
    """Where results go and what they hold."""

    file: Text = Field(
        "results/scene.hdf", min_length=1, max_length=1000, description="result file, below the working directory"
    )
    patches: Literal["all", "none"] = Field("all", description="whether the pressure on every face is kept")

    def rules(self) -> Errors:
        """Results end in .hdf, the one ending that every viewer takes, and stay below the working directory."""
        path = PurePosixPath(self.file)
        if not self.file.endswith(".hdf"):
            yield wrong(self.file, "a file ending in .hdf, which all viewers open", "file")
        if path.is_absolute() or PureWindowsPath(self.file).drive or ".." in path.parts:
            yield wrong(self.file, "a path below the working directory; `-o` takes any other", "file")


class Run(SceneSection):
    """Limits for single cases. Results do not depend on them: they may differ from run to run."""

    time_limit_s: float = Field(
        600.0, ge=0.1, le=1e6, description="time after which a case fails; the other cases continue"
    )
    memory_gb: Annotated[float, Field(ge=0.1, le=1e5)] | Literal["auto", "none"] = Field(
        "auto",
        description="memory that the cases of a rank may take; auto is the rank's share of what is free",
    )


def petsc_rules(options: Mapping[str, Any]) -> Errors:
    """Options of the contact solver only, and none that writes files or runs code."""
    for key, value in options.items():
        bare = key.lstrip("-").removeprefix("contact_")
        if not key.startswith("contact_") or set(bare) - OPTION_CHARACTERS or not bare:
            expected = f"an option of the contact solver, as contact_{bare}; {OTHERS}"
            yield wrong(value, expected, key)
        elif bare.endswith("python_type"):
            yield wrong(value, "no option that runs Python code", key)
        elif isinstance(value, str) and set(value) - VALUE_CHARACTERS:
            yield wrong(value, f"a word, a number or a list of them; {OTHERS}", key)
