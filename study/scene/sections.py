"""The sections of a scene other than object and candidates: keys, ranges, SI values, and the rules of their values."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from contextlib import suppress
from functools import lru_cache
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from softjaw.study.grippers import PRESETS
from softjaw.study.messages import shown
from softjaw.study.scene.objects import Shape, Walled
from softjaw.study.scene.section import RISING, Direction, Errors, Point, SceneSection, Vector, wrong
from softjaw.study.units import in_si

Count = Annotated[int, Field(ge=2, le=400)]
Extent = Annotated[float, Field(ge=0, le=500)]
FingerSide = Annotated[float, Field(ge=1, le=1000)]
Force = Annotated[float, Field(gt=0, le=1000)]
Grading = Annotated[float, Field(ge=0.05, le=20)]
MOST_ELEMENTS, LARGEST_ASPECT = 1_000_000, 20.0
UNCERTAIN = ("object", "gripper", "friction", "candidates", "task")  # sections whose numbers may be
COARSE, FINE = 0, 1  # meshes of a case: half as many elements in every direction as the scene says, and its own
MOST_MESHES = 4  # of a case, each further one 1.25 times as fine in every direction, which costs twice as much
FINEST = MOST_MESHES - 1
CONVEX_FITS = ("full", "quartic")  # models that a convex program can fit, too
SAMPLES_SEED = 20240229  # any number; the samples of a scene are always the same
UPPER = 0.975  # where a 95 % interval ends
OPTION, VALUE = re.compile("contact_[a-z0-9_]+"), re.compile("[A-Za-z0-9_,.+-]*")  # of PETSc that a scene may have
OTHERS = "other options go into the environment variable PETSC_OPTIONS"


class Gripper(SceneSection):
    """The two equal pads. No dimension of the original gripper is published; the defaults are plausible ones."""

    preset: str | None = Field(
        None, description="a gripper whose pad, largest opening and forces are taken, or a file of the same form",
        examples=[*PRESETS],
    )  # fmt: skip
    pad_length_mm: float = Field(50.0, ge=1, le=500, description="long side of the pad")
    pad_width_mm: float = Field(22.0, ge=1, le=500, description="short side of the pad")
    pad_thickness_mm: float = Field(15.0, ge=0.5, le=200, description="thickness of the pad")
    material: Literal["blatz_ko", "hyperfoam", "neo_hookean", "linear"] = Field("blatz_ko", description="material law")
    shear_modulus_kpa: float = Field(
        40.0, ge=0.01, le=1e6, description="initial shear modulus of the pad, E / (2 (1 + nu))"
    )
    poisson_ratio: float = Field(0.25, ge=0, le=0.4999, description="Poisson's ratio of the pad; Blatz-Ko foam: 0.25")
    terms_kpa: tuple[Point, ...] = Field(
        (), max_length=6, examples=[[[-2, 40]]],
        description="terms of hyperfoam: exponent alpha and shear modulus mu of 2 mu / alpha^2 (...)",
    )  # fmt: skip
    elements: tuple[Count, Count, Count] = Field(
        (20, 10, 6), description="elements of the whole pad along its length, width and thickness"
    )
    element: Literal["hex8", "hex27"] = Field("hex8", description="trilinear or triquadratic elements")
    grading: tuple[Grading, Grading, Grading] = Field(
        (1.0, 1.0, 1.0), description="size of elements at the pad's ends, sides and back over that at its middle"
    )
    max_opening_mm: float | None = Field(
        None, gt=0, le=1000, description="largest distance of the pads' faces; wider grasps are not solved"
    )
    finger_size_mm: tuple[FingerSide, FingerSide] | None = Field(
        None, description="length and width of what carries a pad, left out where it is the pad's own",
        examples=[[60, 25]],
    )  # fmt: skip
    sheet_thickness_mm: float = Field(2.0, ge=0.05, le=100, description="thickness of the backing plate")
    sheet_modulus_gpa: float = Field(200.0, ge=1e-3, le=2000, description="Young's modulus of the plate; steel: 200")
    sheet_support_mm: tuple[Extent, Extent] = Field((20.0, 10.0), description="the plate's held middle, length first")
    tilt_stiffness_nm_per_rad: float | None = Field(
        None, ge=1e-3, le=1e5, description="moment per angle of a mount that lets the pad tilt; left out: it does not"
    )

    @model_validator(mode="before")
    @classmethod
    def _hyperfoam_defaults(cls, data: Any) -> Any:
        """Fill in hyperfoam's terms from the modulus (one term, which is Blatz-Ko foam), or the modulus from them."""
        if not isinstance(data, dict) or data.get("material") != "hyperfoam":
            return data
        if not data.get("terms_kpa"):
            return {**data, "terms_kpa": ((-2.0, data.get("shear_modulus_kpa", 40.0)),)}
        with suppress(TypeError, ValueError):  # of terms that are refused
            if (modulus := sum(modulus for _, modulus in data["terms_kpa"])) > 0:
                return {"shear_modulus_kpa": modulus, **data}
        return data

    @property
    def hyperfoam_terms(self) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Exponents [-] and shear moduli [Pa] of hyperfoam's terms."""
        return tuple(e for e, _ in self.terms_kpa), tuple(in_si("modulus_kpa", m) for _, m in self.terms_kpa)

    @property
    def pad_size(self) -> tuple[float, float, float]:
        """Length, width and thickness of the pad [m]."""
        return (self.pad_length, self.pad_width, self.pad_thickness)

    @property
    def foam_ratio(self) -> float:
        """Poisson's ratio of the foam; the Blatz-Ko law has its own by its form, whatever the scene says."""
        return 0.25 if self.material == "blatz_ko" else self.poisson_ratio

    def rules(self) -> Errors:
        """Constants that the material cannot have, slivers, and meshes beyond any memory."""
        yield from self._hyperfoam_rules() if self.material == "hyperfoam" else self._material_rules()
        pad = (self.pad_length_mm, self.pad_width_mm)
        if self.finger_size_mm and any(side < least for side, least in zip(self.finger_size_mm, pad, strict=True)):
            yield wrong(self.finger_size_mm, f"at least the pad's, {shown(list(pad))}, length first", "finger_size_mm")
        n = self.elements
        for i in (0, 1):
            if n[i] % 2 and self.grading[i] != 1:
                yield wrong(self.grading[i], f"1.0, or an even number of elements, not {n[i]}", "grading", i)
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
        if self.terms_kpa:
            yield wrong(self.terms_kpa, f'material = "hyperfoam", not {shown(self.material)}, beside it', "terms_kpa")

    def _hyperfoam_rules(self) -> Errors:
        if any(abs(exponent) < 1e-3 for exponent, _ in self.terms_kpa):  # differences of powers over it cancel
            yield wrong(self.terms_kpa, "exponents farther from 0, such as 0.01", "terms_kpa")
        total = sum(modulus for _, modulus in self.terms_kpa)
        if total <= 0:
            yield wrong(self.terms_kpa, f"moduli whose sum is > 0, not {total:g} kPa", "terms_kpa")
        elif not math.isclose(total, self.shear_modulus_kpa):
            expected = f"the sum of the moduli of terms_kpa, {total:g} kPa; leave it out"
            yield wrong(self.shear_modulus_kpa, expected, "shear_modulus_kpa")

    def symmetry_rules(self, effects: Effects) -> Errors:
        """Symmetric halves need even counts."""
        n = list(self.elements)
        if effects.model_size != "full" and (n[0] % 2 or n[1] % 2):
            even = [n[0] + n[0] % 2, n[1] + n[1] % 2, n[2]]
            expected = f'even numbers along length and width, {even}, or effects.model_size = "full"'
            yield wrong(n, f"{expected}, so that symmetric halves can be meshed", "elements")

    def plate_rules(self, effects: Effects) -> Errors:
        """A plate bends or tilts."""
        if self.tilt_stiffness_nm_per_rad is not None and effects.sheet == "elastic":
            expected = 'effects.sheet = "rigid" or "auto": a plate that tilts is rigid itself'
            yield wrong(self.tilt_stiffness_nm_per_rad, expected, "tilt_stiffness_nm_per_rad")


class Friction(SceneSection):
    """Friction between pad and object. Every friction model is computed."""

    mu: float = Field(0.8, ge=0, le=10, description="Coulomb friction coefficient")
    used_by_pressing: bool = Field(
        False, description="whether friction that pressing uses is missing for holding (CCM)"
    )

    def used_rules(self, effects: Effects) -> Errors:
        """What pressing uses is known only where friction acts back."""
        if self.used_by_pressing and effects.friction_pressure_coupling != "tangential":
            expected = 'effects.friction_pressure_coupling = "tangential" beside it'
            yield wrong(True, expected, "used_by_pressing")


class Load(SceneSection):
    """What the fingers press with."""

    normal_force_n: Annotated[tuple[Force, ...], Field(min_length=1, max_length=1000), RISING] = Field(
        description="normal forces per finger", examples=[[1, 2, 5]]
    )


class ScoreKeys(SceneSection):
    """How torques are made comparable with forces in the grasp quality."""

    object_length_mm: Annotated[float, Field(gt=0, le=2000)] | Literal["per_axis", "longest"] = Field(
        "per_axis",
        description="what scales torque arms: the object's extents, as in the paper, the longest of them, or a length",
    )
    contact_length_mm: Annotated[float, Field(gt=0, le=500)] | Literal["pad", "object"] = Field(
        "pad", description="what scales soft torques: the pad's length, as in the paper, the object's, or a length"
    )
    epsilon: Literal["facing", "everywhere"] = Field(
        "facing", description="where epsilon is computed: for antipodal contacts, or in any pose (some 0.01 s each)"
    )


class LimitSurfaceKeys(SceneSection):
    """The surface that bounds the friction wrenches of a contact, fitted to the wrenches of many motions."""

    model: Literal["three_motions", "axis_aligned", "full", "quartic"] = Field(
        "quartic", description="ellipsoid from three motions, fitted ellipsoid (along the axes or any), convex quartic"
    )
    objective: Literal["least_squares", "zhou"] = Field(
        "least_squares", description="what the fit of a full ellipsoid or a quartic minimises; zhou is slower"
    )
    samples: int = Field(500, ge=50, le=20_000, description="motions that the surface is fitted to")

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

    def rules(self) -> Errors:
        """Fingers that keep their forces hold nothing along them."""
        if self.drive == "fixed" and self.direction is None:
            expected = "a direction, as fixed forces hold nothing along themselves, or another drive"
            yield wrong("worst", expected, "weight_direction")

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


class Accuracy(SceneSection):
    """How exactly the contact is solved."""

    meshes: int = Field(2, ge=1, le=2, description="2: each case on a coarser mesh, too, which tells all errors")
    target: float | None = Field(
        None, gt=1e-4, le=0.5, description="largest relative error; a rigid object gets up to two finer meshes for it"
    )
    target_of: Literal["payload", "quality", "e_n"] = Field("payload", description="what the target is for")
    contact: Literal["auto", "weighted", "nodal", "blended"] = Field(
        "auto", description="how gaps are collocated; auto is blended for hex8, else weighted"
    )
    wall_element_mm: float = Field(
        1.5, ge=0.2, le=10, description="size of a wall's elements round it under the pads; up to 4 times elsewhere"
    )

    def rules(self) -> Errors:
        """A target needs errors."""
        if self.target is not None and self.meshes < 2:
            yield wrong(self.target, "accuracy.meshes = 2 beside it, whose difference tells the error", "target")

    @property
    def wall_sizes(self) -> tuple[float, float, float]:
        """Sizes of a thin wall's elements round the object and along it under the pads, and elsewhere at most [m]."""
        around = self.wall_element_mm
        return in_si("sizes_mm", (around, 5 * around / 3, 4 * around))

    @property
    def refined_within(self) -> float:
        """Gain, as a share of the best grasp, for which ``candidates.refine`` solves further ones."""
        return self.target or 0.02

    @property
    def most_meshes(self) -> int:
        """On how many meshes a case is solved at most."""
        return self.meshes if self.target is None else MOST_MESHES


@lru_cache(maxsize=8)
def _normal(samples: int, inputs: int) -> Any:
    """Latin hypercube ``(samples, inputs)`` of normal distributions, over the half-width of their 95 % intervals."""
    from scipy.special import ndtri  # scenes without uncertain inputs are read without scipy
    from scipy.stats import qmc

    cube = qmc.LatinHypercube(inputs, scramble=False, optimization="random-cd", seed=SAMPLES_SEED)
    return ndtri(cube.random(samples)) / ndtri(UPPER)


class Uncertainty(SceneSection):
    """Inputs that are uncertain: the study is solved again for samples of them, which gives maps an interval.

    The samples are a Latin hypercube of normal distributions about the scene's own values.
    """

    samples: int = Field(20, ge=8, le=1000, description="how often the study is solved again")
    spread: dict[str, Annotated[float, Field(gt=0)]] = Field(
        default_factory=dict, description="half-widths of 95 % intervals by dotted key, in the key's unit",
        examples=[{"friction.mu": 0.08}],
    )  # fmt: skip

    def inputs(self, means: Mapping[str, float]) -> list[dict[str, float]]:
        """Samples of independent normal inputs about their means, by key.

        Each input takes the middles of as many intervals of equal probability as there are samples, each once.
        """
        values = [means[key] for key in self.spread] + _normal(self.samples, len(self.spread)) * [*self.spread.values()]
        # digits of a sample, so that no rounding error of a machine makes another one
        return [dict(zip(self.spread, (float(f"{v:.9g}") for v in row), strict=True)) for row in values]

    def spread_rules(self, *sections: SceneSection) -> Errors:
        """Only single numbers of the sections in `UNCERTAIN` can be uncertain."""
        by_name = dict(zip(UNCERTAIN, sections, strict=True))
        for key in self.spread:
            section, _, name = key.partition(".")
            known = section in by_name and name in type(by_name[section]).model_fields
            if not known or type(getattr(by_name[section], name)) not in (int, float):
                expected = f"a key that has a single number, of {', '.join(UNCERTAIN)}"
                yield wrong(self.spread[key], expected, "spread", key)


class Run(SceneSection):
    """Limits for single cases, and what of them is kept. Results do not depend on it."""

    patches: Literal["all", "none"] = Field("all", description="whether the pressure on every face is kept")
    time_limit_s: float = Field(600.0, ge=0.1, le=1e6, description="time after which a case fails; the others continue")
    memory_gb: Annotated[float, Field(ge=0.1, le=1e5)] | Literal["auto", "none"] = Field(
        "auto", description="memory that the cases of a rank may take; auto is the rank's share of what is free"
    )


def petsc_rules(options: Mapping[str, Any]) -> Errors:
    """Options of the contact solver only, and none that writes files or runs code."""
    for key, value in options.items():
        bare = key.lstrip("-").removeprefix("contact_")
        if not OPTION.fullmatch(key):
            expected = f"an option of the contact solver, as contact_{bare}; {OTHERS}"
            yield wrong(value, expected, key)
        elif bare.endswith("python_type"):
            yield wrong(value, "no option that runs Python code", key)
        elif isinstance(value, str) and not VALUE.fullmatch(value):
            yield wrong(value, f"a word, a number or a list of them; {OTHERS}", key)
