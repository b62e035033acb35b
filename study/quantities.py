"""Every number of a result file: name, dimensions, unit, label, definition and group, in one literal table.

A new quantity is one more row here. Layout, checksums, reader, tables, comparison, export and look-up follow from the
rows: which maps are the main ones, in which order, what their columns are called, and what the file says of them.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Any

from softjaw.study.flags import flag_definitions

MODELS = ("ccm", "pcm", "pcm_projected")
MODEL_NAMES = dict(zip(MODELS, ("CCM", "PCM", "PCM scaled by F_N"), strict=True))  # in legends and captions
FINGERS = 2
AROUND, ALONG = 48, 40  # places at which a deformed wall is stored
# States of a case, by these codes. From WIDE on there is no grasp worth a solve: neither solved nor failed.
STATES = ("not computed", "complete", "failed", "too wide", "collides", "slips")
MISSING, DONE, FAILED, WIDE, COLLIDES, SLIPS = range(len(STATES))
NO_GRASP = (WIDE, COLLIDES, SLIPS)
RIMS = (1, 2, 4, 8)  # bits of the rims of a pad that carry load: its ends at -x and +x, its sides at -y and +y
REALISATION = "realisation"  # dimension of the samples of uncertain inputs; the first has the scene's own
E_N_TARGET = 0.01  # relative error of e_n that is good enough where a scene names none
LISTED_TARGET = 0.03  # the same of the payload, of the best of sampled grasps
LISTED = 10  # places that a list of the best grasps has where nobody asks for another number
BOTH_ENDS = RIMS[0] | RIMS[1]
PARTS = ("assembly", "factorisation", "rest", "friction")  # of a case's time
# What a quantity may need that not every scene asks for.
NEEDS = ("two meshes", "six components", "mass", "task", "wall", "finer meshes", "patches")
# Exponents of x, y and t, highest power of x first.
MONOMIALS = tuple(
    " ".join(f"{letter}^{k}" if k > 1 else letter for letter, k in zip("xyt", (i, j, 4 - i - j), strict=True) if k)
    for i in range(4, -1, -1)
    for j in range(4 - i, -1, -1)
)


@dataclass(frozen=True)
class Axis:
    """One axis of the maps: ``values`` ``(k,)`` in SI units; texts are numbered and listed in ``options``."""

    name: str
    values: Any
    units: str
    long_name: str
    options: tuple[str, ...] = ()


EFFECTS = {  # that a scene may call for, and their levels, the cheapest first
    "object": ("rigid", "linear shell", "nonlinear shell"),
    "sheet": ("rigid", "elastic plate"),
    "model_size": ("quarter", "half", "full"),
    "fingers": ("one", "two"),
    "friction": ("pcm", "ccm"),
    "wrench": ("3-D", "6-D"),
    "limit_surface": ("ellipsoid from three motions", "fitted ellipsoid", "convex quartic"),
    "friction_pressure_coupling": ("none", "tangential traction"),
}
INDICATORS = {
    "object": "indentation that a linear wall would get at the largest force, over the wall's thickness",
    "sheet": "mean deflection of the backing plate under an even pressure over that of the pad",
    "friction": "share of the pressure sum that the tilt of the loaded normals takes off the normal force, 1 - F_N / S",
    "wrench": "mean share of the three dropped components in the friction wrench",
    "limit_surface": "radial fit error of the fitted limit surface, CCM, of the finger where it is larger",
    "friction_pressure_coupling": "share of the pressure sum that friction which acted back would add across it, of the"
    " finger where it is larger; on the coarse mesh where it is chosen by it",
}
MEASURED_EFFECTS = ("sheet", "friction_pressure_coupling")  # which the coarse mesh decides where the indicator does not
REASONS = (
    "the only level of this version",
    "forced by the scene",
    "indicator below the target",
    "indicator above the target",
    "exact by symmetry",
    "the object has no wall",
    "never skipped, because it costs next to nothing",
    "e_n and quality do not depend on it",
    "measured changes below the target",
    "a measured change above the target",
    "measured changes not surely below the target",
    "left out, though numbers may change by more than the target: it was not solved",
    "left out on the coarse mesh alone, and part of the errors there",
)
MEASURED = {  # parts of an effect that the coarse mesh decides
    "change": "Relative change of e_n (CCM) by the dearer of the last two levels, on the coarse mesh; NaN: unmeasured.",
    "payload_change": "The same of the payload.",
    "quality_change": "The same of the quality.",
}


@dataclass(frozen=True)
class Quantity:
    """One number, or one small array, of a case: a row of the table.

    ``name``: of the dataset in its ``group``; those of ``maps`` are groups of their own, which viewers draw. ``dims``:
    after those of the cases, ``model`` for one value per friction model. ``unit, label, definition``: SI unit ("" for a
    pure number), label of a colour bar, and one sentence that readers see beside the data. ``symbol``: head of a
    column, the name where it is empty. ``needs``: of `NEEDS`, without all of which the quantity is not in the file.
    ``rank``: place among the main maps, 1 for the first; 0 for all others. ``meanings``: what the integers 0, 1, ... of
    a code mean; -1 is none. ``error``: where two meshes tell the error of a map, what it is, "relative", or "absolute"
    in the unit; else nothing. ``of``: the map whose error it is, in whose group it stands.
    """

    name: str
    dims: tuple[str, ...]
    unit: str
    label: str
    definition: str
    group: str = "maps"
    symbol: str = ""
    needs: tuple[str, ...] = ()
    rank: int = 0
    meanings: tuple[str, ...] = ()
    error: str = ""
    of: str = ""

    @property
    def key(self) -> str:
        """Key of the value in ``CaseResult.values``, and path of its dataset but for maps."""
        return f"{self.group}/{self.name}"

    @property
    def variable(self) -> str:
        """Name of the variable of the dataset that `study.result.read.open` gives."""
        return self.name if self.group in ("maps", "status") else f"{SINGULAR.get(self.group, self.group)}_{self.name}"

    @property
    def by_model(self) -> bool:
        """Whether there is one value for each of `MODELS`."""
        return "model" in self.dims

    def error_in_unit(self, error: Any, value: Any) -> Any:
        """An error of this map as it is stored, in the map's unit; ``value`` is what a relative one is a share of."""
        return abs(error * value) if self.error == "relative" else error

    @property
    def of_error(self) -> Quantity:
        """The row of the error of this map."""
        relative = self.error == "relative"
        return Quantity(
            f"{self.name}_error", (), "" if relative else self.unit, f"{'relative ' * relative}error of {self.name}",
            f"{MESHES}{' (CCM)' * self.by_model}{', over its value' * relative}.", needs=(*self.needs, NEEDS[0]),
            of=self.name,
        )  # fmt: skip


SINGULAR = {"fingers": "finger", "checks": "check", "effects": "effect"}
F, M, FM = ("finger",), ("model",), ("finger", "model")
MESHES = "Stated error, all that is numerical: mesh, steps of the load path, effects left out, edge of the contact"
MEANS = "|P - 1|, |P^(-1/degree) - 1| (the relative error of the radius), angle between gradient and motion"
MAP_ROWS = (  # of every case, with what is said beside them
    Quantity("quality", M, "", "grasp quality",
             "Volume of the grasp wrench space of both contacts with unit normal forces. As in the paper, arms of "
             "forces are divided by the object's extents along its own x, y and z, torques about the normals by the "
             "contact's length (or as [score] says), and limit surfaces are ellipsoids from three motions.",
             rank=2, error="relative"),
    Quantity("payload", M, "kg", "mass that is held",
             "Largest mass whose weight at the centre of mass both contacts hold with the normal force of this case, in"
             " whichever direction it pulls, or in that of [task]. The squeeze itself is borne first; 0 where friction"
             " cannot. The limit surfaces are those of friction itself; nothing is fitted.", rank=1,
             error="relative"),
    Quantity("safety_factor", M, "", "mass that is held over mass of the object", "payload over object.mass_g.",
             symbol="safety", needs=("mass",), rank=13, error="relative"),
    Quantity("quality_fitted", M, "", "grasp quality, fitted limit surface",
             "As quality, with the limit surface of the scene's [limit_surface], fitted to wrenches of many motions.",
             symbol="fitted", rank=9),
    Quantity("fit_error", (), "", "fit error of the fitted limit surface",
             "Mean of |P^(-1/degree) - 1|, the relative error of the radius of the fitted limit surface P = 1, over "
             "377 motions that it was not fitted to; CCM, of the finger where it is larger.", rank=10),
    Quantity("fit_error_ellipsoid", (), "", "fit error of the ellipsoid from three motions",
             "As fit error, of the ellipsoid that quality is computed from."),
    Quantity("overclaim", (), "", "largest overclaim of the fitted limit surface",
             "Largest share by which it claims more friction than the contact carries, over the motions of fit error."),
    Quantity("overclaim_ellipsoid", (), "", "largest overclaim of the ellipsoid from three motions",
             "As overclaim, of the ellipsoid that quality is computed from."),
    Quantity("e_n", M, "m", "eccentricity parameter e_n",
             "max tau_z / (mu S), Eq. (12) with F_N read as S, the sum of pressure times area; of the weaker finger.",
             rank=3, error="relative"),
    Quantity("e_n_ratio", M, "m", "eccentricity parameter, torque over force",
             "max tau_z / max f_t, Eq. (11), f_t the friction force in the contact plane; of the weaker finger."),
    Quantity("e_n_commanded", M, "m", "eccentricity parameter, force of the gripper",
             "max tau_z / (mu F), Eq. (12) with F_N read as F, the commanded normal_force; of the weaker finger."),
    Quantity("e_n_projected", M, "m", "eccentricity parameter, physical normal force",
             "max tau_z / (mu F_N), F_N the resultant of pressure along the contact normal; of the weaker finger."),
    Quantity("epsilon", M, "", "largest-minimum resisted wrench",
             "Radius of the largest ball around the origin inside the grasp wrench space of quality, with torques "
             "about the midpoint of the contacts. NaN where the contacts, with their arms scaled, are more than "
             "0.5 degrees from antipodal, unless score.epsilon is 'everywhere'."),
    Quantity("f_x_max", M, "N", "largest friction along x",
             "Friction force along the contact frame's x as the pad slides so, Eqs. (6)-(8); of the weaker finger.",
             rank=7, error="relative"),
    Quantity("f_y_max", M, "N", "largest friction along y",
             "Friction force along the contact frame's y as the pad slides so, Eqs. (6)-(8); of the weaker finger.",
             rank=8, error="relative"),
    Quantity("tau_z_max", M, "N m", "largest friction torque about z",
             "Friction torque about the contact normal as the pad turns about it, Eqs. (6)-(8); of the weaker finger.",
             rank=4, error="relative"),
    Quantity("tau_pure", (), "N m", "largest torque without a net force",
             "Largest torque about the contact normal without a force in the contact's plane; tau_z_max comes with one"
             " where the patch is not symmetric, and is larger: up to 2 max(a, b) / (a + b) times where a pad bears on"
             " two ends with loads a and b. CCM, of the weaker finger."),
    Quantity("S", (), "N", "pressure times area", "Sum of pressure times area over the patch; mean of both fingers."),
    Quantity("F_N", (), "N", "normal force",
             "Sum of pressure times area times (n . N), the force along the contact normal; mean of both fingers."),
    Quantity("force_excess", (), "", "force along the contact normal over the gripper's, less 1",
             "F_N / F - 1, with F the normal_force of the case, along the approach: on a slope the contact is pushed "
             "aside too, which the pad's backing bears. Of the finger where it is larger in size."),
    Quantity("closing", (), "m", "closing displacement of the pad",
             "How far the pad's back moved towards the object after first touch; mean of both fingers.",
             error="relative"),
    Quantity("opening", (), "m", "opening at first touch",
             "Distance of the undeformed contact faces of both pads, along the approach, when they touch the object.",
             rank=11),
    Quantity("opening_loaded", (), "m", "opening under load",
             "Opening at first touch less the closing displacements of both pads, as the gripper shows it then.",
             symbol="loaded", rank=12, error="absolute"),
    Quantity("contact_area", (), "m^2", "contact area",
             "Area under pressure, mean of both fingers; its edge is found inside the faces.", symbol="area", rank=14,
             error="relative"),
    Quantity("p_max", (), "Pa", "largest fitted pressure",
             "Largest contact pressure on either finger, of a quadratic fitted to the loads within two elements of the "
             "largest one; at a sharp end of the object, where it is singular, so a mean.", rank=15, error="relative"),
    Quantity("contact_distance", (), "m", "distance of the contacts", "Distance between the contact frames' origins."),
    Quantity("curvature_loss", (), "", "force lost to curvature",
             "1 - F_N / S: what the tilt of the loaded normals takes off the normal force; both fingers together.",
             error="absolute"),
    Quantity("misalignment", (), "rad", "misalignment of the contacts",
             "Largest angle between a contact normal and the other one reversed, or the line through both contacts."),
    Quantity("flags", (), "", "flags of the case", flag_definitions()),
    *(
        Quantity(f"{name}_overestimate{suffix}", (), "", f"{what}: {model} over ccm",
                 f"1 - ccm / {model} of {name}_max: the share of the planar model's claim that the curved contact"
                 f" cannot carry ({note}); of the finger where it is largest.", error="absolute")
        for name, what in (("f_x", "friction along x"), ("f_y", "friction along y"), ("tau_z", "friction torque"))
        for suffix, model, note in (
            ("", "pcm", "both scaled by S, the paper's normalisation"),
            ("_pcm_projected", "pcm_projected", "both scaled by the normal force F_N; never positive: such a planar"
             " model claims too little"),
        )
    ),
    Quantity("pad_elements", (), "", "elements of a pad",
             "Of the case's finest mesh. Errors are from the two finest; faces are those of the scene's own mesh.",
             needs=("finer meshes",)),
    Quantity("indentation", (), "m", "indentation of the wall",
             "Largest inward displacement of the wall, less the motion of the wall as a whole.",
             needs=("wall",), rank=5, error="relative"),
    Quantity("wall_stress", (), "Pa", "largest stress in the wall",
             "Largest von Mises stress on its two faces, recovered from the middles of the elements.",
             symbol="stress", needs=("wall",), rank=6, error="relative"),
    Quantity("wall_strain", (), "", "largest strain of the wall",
             "Largest principal strain, by size, on its two faces, as the stress.", needs=("wall",),
             error="relative"),
    Quantity("support_force", (), "N", "force of the support",
             "What support or friction has to bear: pads push sloping walls along their axis. Of pressures alone."
             " Where friction, mu F_N of both fingers, cannot take it, the flag is 'slides out'.", needs=("wall",)),
)  # fmt: skip
OF_FINGERS = ("f_x_max", "f_y_max", "tau_z_max", "tau_pure", "e_n_ratio", "S", "F_N", "force_excess", "closing")
ROWS = (
    *MAP_ROWS,
    # each finger: limits, contact frame, pose of the pad
    *(Quantity(name, (*F, *q.dims), q.unit, q.label, "As the map, for each finger.", "fingers")
      for name in OF_FINGERS for q in MAP_ROWS if q.name == name),
    Quantity("frame_origin", (*F, "component"), "m", "origin of the contact frame",
             "In the pad's frame: where the line along z through the COP meets the deformed face, loaded there or not.",
             "fingers"),
    Quantity("frame_axes", (*F, "component", "component_2"), "", "axes of the contact frame",
             "Rows x, y, z in the pad's frame; z: the object's normal at the origin, or the face's if no load is near.",
             "fingers"),
    Quantity("frame_flag", F, "", "flag of the contact frame",
             "0: regular; otherwise a rule for a degenerate patch chose the frame.", "fingers"),
    Quantity("pose_rotation", (*F, "component", "component_2"), "", "rotation of the pad",
             "x = rotation x_pad + origin, in the frame of the object's own file.", "fingers"),
    Quantity("pose_origin", (*F, "component"), "m", "origin of the pad",
             "Centre of the undeformed contact face at first touch, in the frame of the object's own file; under load "
             "the pad's back has moved on by the closing displacement, along its z axis.", "fingers"),
    Quantity("pieces", F, "", "pieces of the contact",
             "Connected parts of the loaded patch; faces that touch at a corner belong together.", "fingers"),
    Quantity("holes", F, "", "holes of the contact", "Places without load that are surrounded by it.", "fingers"),
    Quantity("rims", F, "", "rims of the pad under load",
             "Sum of: 1 and 2 the pad's ends, at -x and +x; 4 and 8 its sides, at -y and +y.", "fingers"),
    # checks of the contact solution
    Quantity("force_balance", F, "", "force balance", "Difference of contact force and load, over the load.", "checks"),
    Quantity("adhesion", F, "", "largest adhesion",
             "Largest negative nodal pressure over the largest pressure.", "checks"),
    Quantity("penetration", F, "", "largest penetration", "Deepest mean overlap at a node over an element.", "checks"),
    Quantity("complementarity", F, "", "complementarity",
             "Largest product of pressure and gap at a node, over the largest pressure and the element size.",
             "checks"),
    Quantity("penetration_depth", F, "m", "deepest point inside the object",
             "Of the quadrature points of the contact face: shows how well the mesh follows the object.", "checks"),
    Quantity("min_det_f", F, "", "smallest det F", "Smallest ratio of deformed to undeformed volume.", "checks"),
    Quantity("max_strain", F, "", "largest strain", "Largest difference of a principal stretch from 1.", "checks"),
    Quantity("ellipticity", F, "", "smallest eigenvalue of the acoustic tensor",
             "Over the shear modulus, in 24 directions at one point per element; not positive: strains may localise.",
             "checks"),
    # work
    Quantity("newton_iterations", F, "", "Newton iterations",
             "Since the force below; from first contact with friction that acts back.", "work"),
    Quantity("load_steps", F, "", "load steps", "Newton solves, counted as the iterations.", "work"),
    Quantity("step_halvings", F, "", "step halvings", "Solves that failed and were repeated in half steps.", "work"),
    Quantity("mesh", (), "", "finest mesh that the case was tried on",
             "0: half the scene's elements per direction; 1: the scene's; 3: up to two finer, to meet accuracy.target.",
             "work", needs=("finer meshes",)),
    *(
        Quantity(f"seconds_{part}", (), "s", f"seconds in {part}", f"Time of the case spent in {part}.", "work")
        for part in (*PARTS, "total")
    ),
    # limit surfaces
    Quantity("semi_axes", (*FM, "component"), "-, -, m", "semi-axes of the ellipsoid from three motions",
             "Largest f_x, f_y and tau_z over S: the ellipsoid that quality is computed from.", "limit_surface"),
    Quantity("rank", FM, "", "semi-axes that are not zero",
             "3: a body; less: a disc, a segment or a point, because the contact carries no load along an axis.",
             "limit_surface"),
    Quantity("rho", F, "m", "length of the contact",
             "By which torques are divided in the fit: the longer side of the loaded patch in the contact frame.",
             "limit_surface"),
    Quantity("matrix", (*FM, "component", "component_2"), "", "matrix of the fitted ellipsoid",
             "A of w A w = 1 in w = (f_x, f_y, tau_z / rho) / (mu S); NaN where a quartic was fitted.",
             "limit_surface"),
    Quantity("coefficients", (*FM, "monomial"), "", "coefficients of the fitted quartic",
             f"P(w) = 1 in w = (x, y, t) = (f_x, f_y, tau_z / rho) / (mu S), of {', '.join(MONOMIALS)} in this order;"
             " NaN where an ellipsoid was fitted.", "limit_surface"),
    Quantity("certificate", FM, "", "how the fit is known to be convex",
             "0 fit failed, three-motion ellipsoid used; 1 ellipsoid; 2 quartic, convex as fitted; 3 kept convex.",
             "limit_surface"),
    Quantity("fit_flag", FM, "", "flag of the fit",
             "Sum of: 1 the wrenches lie in a plane or on a line; 2 fewer independent wrenches than coefficients; 4 its"
             " size was limited, which the wrenches alone do not; 8 rho does not suit the contact.", "limit_surface"),
    Quantity("fit_error", (*FM, "component"), "-, -, rad", "fit error of the fitted surface",
             f"Means over 377 motions that it was not fitted to: {MEANS}.", "limit_surface"),
    Quantity("fit_error_own", (*FM, "component"), "-, -, rad", "fit error of the fitted surface on its own samples",
             f"Means over the motions that it was fitted to: {MEANS}.", "limit_surface"),
    Quantity("fit_error_ellipsoid", (*FM, "component"), "-, -, rad", "fit error of the ellipsoid from three motions",
             f"Means over the 377 motions: {MEANS}.", "limit_surface"),
    Quantity("matrix_6d", (*F, "wrench", "wrench_2"), "", "matrix of the fitted 6-D ellipsoid",
             "A of w A w = 1 in w = (f_x, f_y, f_z, tau_x / rho, tau_y / rho, tau_z / rho) / (mu S), CCM; of"
             " the directions that the contact resists.", "limit_surface", needs=("six components",)),
    Quantity("rank_6d", F, "", "directions that the contact resists",
             "Of the six; 3 for a planar contact.", "limit_surface", needs=("six components",)),
    Quantity("fit_error_6d", (*F, "component"), "-, -, rad", "fit error of the 6-D ellipsoid",
             "As fit error, over the motions it was fitted to.", "limit_surface", needs=("six components",)),
    # deformed wall
    Quantity("place", ("wall_place", "component"), "m", "deformed wall",
             f"Outer face in the frame of the object's own file at {AROUND} angles about the axis from finger 1's,"
             f" times {ALONG} places along the outline from the bottom's middle or rim to the top, in equal steps; the "
             "angle runs slowest.", "wall", needs=("wall",)),
    # effects: level, indicator and reason of each
    *(
        Quantity(f"{name}_{part}", (), "", f"{part} of the effect '{name}'", text, "effects", meanings=meanings)
        for name, levels in EFFECTS.items()
        for part, text, meanings in (
            ("level", "Position in the list of levels, the cheapest first.", levels),
            ("indicator", INDICATORS.get(name, "None: this effect is not left to an indicator."), ()),
            ("reason", "Why this level was taken.", REASONS),
            *((part, text, ()) for part, text in MEASURED.items() if name in MEASURED_EFFECTS),
        )
    ),
    # contact patches
    Quantity("pressure", (*F, "face"), "Pa", "contact pressure", "Pressure of each face of the pad's contact face.",
             "patch", needs=("patches",)),
    Quantity("area", (*F, "face"), "m^2", "face area", "Deformed area of each face.", "patch", needs=("patches",)),
    Quantity("centroid", (*F, "face", "component"), "m", "face centroid",
             "Deformed position in the pad's frame.", "patch", needs=("patches",)),
    Quantity("normal", (*F, "face", "component"), "", "face normal",
             "Unit normal of the object at the deformed face, in the pad's frame.", "patch", needs=("patches",)),
    # how the case stands
    Quantity("code", (), "", "state of the case", "Whether the case has values.", "status", meanings=STATES),
    Quantity("attempts", (), "", "times this case was begun", "Finished or not.", "status"),
    Quantity("message", (), "", "why a case has no result, or what to know about one", "Empty if there is none.",
             "status"),
)  # fmt: skip
TABLE = tuple(row for q in ROWS for row in ((q, q.of_error) if q.error else (q,)))
NUMERIC_MAPS = tuple(q for q in TABLE if q.group == "maps" and q.name != "flags")  # bits are no number
MAIN = tuple(q.name for q in sorted((q for q in TABLE if q.rank), key=lambda q: q.rank))
FIRST = ("payload", "quality", "e_n")  # maps that viewers of the file open at
LEAST_FORCE = "force"  # that holds object.mass_g
RANKED_BY = ("payload", "quality", "e_n", "epsilon", LEAST_FORCE)  # what grasps can be ranked by
FORCE_RANGE = ("force_low", "force_high")  # derived bounds of the forces that hold the object and that it bears
BY_KEY = {q.key: q for q in TABLE}


DEFINITIONS = """Friction models: 'ccm', the curved contact model, lets every face resist in its own plane (Xu, Alt,
Zhang, Steinbach: Grasping Posture Estimation for a Two-Finger Parallel Gripper with Soft Material Jaws using a Curved
Contact Area Friction Model); 'pcm', the paper's planar contact model, lays all faces into one plane and keeps the
pressure sum S; 'pcm_projected' is the planar model with the physical normal force F_N. NaN: no value; status/code and
status/message say why. All values are SI."""


def checked_model(model: str) -> str:
    """One of `MODELS`; `ValueError` for what is none."""
    if model not in MODELS:
        raise ValueError(f"model is {model!r}: expected one of {', '.join(MODELS)}")
    return model


def misses(error: Any, target: float | None) -> Any:
    """Where relative errors of e_n are above the target of a scene, or `E_N_TARGET`; unknown ones are not."""
    # share of the target: an error that is no further above it meets it
    return error > (target or E_N_TARGET) * (1.0 + 1e-6)


def quantities(has: Collection[str] = ()) -> tuple[Quantity, ...]:
    """All quantities of a file whose scene asks for these of `NEEDS`."""
    return tuple(q for q in TABLE if set(q.needs) <= set(has))


def map_row(name: str) -> Quantity:
    """The row of a map; `KeyError` for a name that is none."""
    return BY_KEY[f"maps/{name}"]
