"""Every number a result file holds: name, unit, meaning and shape, in literal tables.

A new quantity is one more line here or in `study.finger_quantities`; layout, store, ``show`` and the report follow from
these tables.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from study.finger_quantities import CHECKS, FINGER, LIMIT_SURFACE, WORK
from study.quantity import Quantity, finger
from study.wall_quantities import WALL

MAPS = (
    Quantity(
        "quality",
        "",
        "grasp quality",
        "Volume of the grasp wrench space spanned by both contacts with unit"
        " normal forces; torque components are divided by the scales given in the scene. The limit surfaces are"
        " the ellipsoids from three motions, as in the paper.",
        by_model=True,
    ),
    Quantity(
        "quality_fitted",
        "",
        "grasp quality, fitted limit surface",
        "As quality, with the limit surface that the"
        " scene's [limit_surface] asks for, fitted to the wrenches of many motions.",
        by_model=True,
    ),
    Quantity(
        "quality_graspit",
        "",
        "grasp quality, linearised as in GraspIt!",
        "As quality, with the hull of the 20"
        " points that GraspIt! takes on each ellipsoid instead of the ellipsoid: about half of quality, in nearly"
        " the same ratio everywhere.",
        by_model=True,
        needs="graspit",
    ),
    Quantity(
        "misfit",
        "",
        "misfit of the fitted limit surface",
        "Mean of |P^(-1/degree) - 1|, the relative error of"
        " the radius of the fitted limit surface P = 1, over 377 motions that it was not fitted to; curved model,"
        " of the finger where it is larger.",
    ),
    Quantity(
        "misfit_ellipsoid",
        "",
        "misfit of the ellipsoid from three motions",
        "As misfit, of the ellipsoid that quality is computed from.",
    ),
    Quantity(
        "e_n",
        "m",
        "eccentricity parameter e_n",
        "max tau_z / (mu S), with S the sum of pressure times area over the patch; of the weaker finger.",
        by_model=True,
    ),
    Quantity(
        "e_n_projected",
        "m",
        "eccentricity parameter, physical normal force",
        "max tau_z / (mu F_N), with F_N the"
        " sum of pressure times area times the cosine between face normal and contact normal; of the weaker"
        " finger.",
        by_model=True,
    ),
    Quantity(
        "epsilon",
        "",
        "largest-minimum resisted wrench",
        "Radius of the largest ball around the origin inside the"
        " grasp wrench space of quality, with torques about the midpoint of the contacts. NaN where the contacts"
        " are more than 0.5 degrees from antipodal, unless score.epsilon is 'everywhere'.",
        by_model=True,
    ),
    Quantity(
        "f_x_max",
        "N",
        "largest friction along x",
        "Total friction force along the contact frame's x axis when"
        " the pad slides along x, Eqs. (6)-(8); of the weaker finger.",
        by_model=True,
    ),
    Quantity(
        "f_y_max",
        "N",
        "largest friction along y",
        "Total friction force along the contact frame's y axis when the pad slides along y, Eqs. (6)-(8); of the weaker"
        " finger.",
        by_model=True,
    ),
    Quantity(
        "tau_z_max",
        "N m",
        "largest friction torque about z",
        "Total friction torque about the contact normal when the pad turns about it, Eqs. (6)-(8); of the weaker"
        " finger.",
        by_model=True,
    ),
    Quantity(
        "tau_pure",
        "N m",
        "largest torque without a net force",
        "Largest torque about the contact normal that the"
        " contact carries while it transmits no force in its plane; tau_z_max comes with such a force where the"
        " patch is not symmetric. Curved model, of the weaker finger.",
    ),
    Quantity("S", "N", "pressure times area", "Sum of pressure times area over the patch; mean of both fingers."),
    Quantity(
        "F_N",
        "N",
        "normal force",
        "Sum of pressure times area times (n . N), the force along the contact normal; mean of both fingers.",
    ),
    Quantity(
        "travel",
        "m",
        "travel of the pad",
        "How far the pad's back moved towards the object after first touch; mean of both fingers.",
    ),
    Quantity("contact_area", "m^2", "contact area", "Area of the faces under pressure; mean of both fingers."),
    Quantity("p_max", "Pa", "largest pressure", "Largest contact pressure on either finger."),
    Quantity("contact_distance", "m", "distance of the contacts", "Distance between the contact frames' origins."),
    Quantity(
        "curvature_loss",
        "",
        "force lost to curvature",
        "1 - F_N / S: zero for a flat contact, what the tilt of"
        " the loaded normals takes off the normal force otherwise; both fingers together.",
    ),
    Quantity(
        "misalignment",
        "rad",
        "misalignment of the contacts",
        "Largest of the angles between one contact normal"
        " and the other reversed, and between the line that joins the contacts and each normal.",
    ),
    Quantity(
        "flags",
        "",
        "flags of the case",
        "Sum of: 1 a contact carries no torque, 2 a contact carries no force"
        " along an axis; contact frame: 4 normal averaged over a cycle, 8 centre of pressure over a hole, 16 no"
        " corners, 32 mixed orientation, 64 overhanging normals; 256 contacts more than 5 degrees from antipodal;"
        " 512 solved with nodal gaps, because weighted ones had no solution; 1024 the line that joins the"
        " contacts leaves a friction cone: the grasp slips; 2048 the fingers' pads run into each other beside the"
        " object; 4096 the mesh is coarse for this contact: the front overlaps the object by more than a tenth of"
        " the travel, fewer than six elements carry load or only one along its length or its width, or"
        " trilinear elements are too stiff for foam with a Poisson's ratio above 0.45; 8192 the wall has snapped in:"
        " on the way to this case the force fell while the fingers closed, or grew less than half as fast as before"
        " on average; 16384 the pads push the object along its axis with more than friction can hold: it slides"
        " out; 32768 the wall's stress is above its yield strength: the dent stays; 65536 a limit surface could not"
        " be fitted, the ellipsoid from three motions stands in; 131072 the foam lost ellipticity: strains may"
        " localise.",
    ),
    *(
        Quantity(
            f"{name}_overestimate{suffix}",
            "",
            f"{what}: {model} over curved model",
            f"1 - curved / {model} of {name}_max: the share of the planar model's claim that the curved"
            f" contact cannot carry ({note}); of the finger where it is largest.",
        )
        for name, what in (("f_x", "friction along x"), ("f_y", "friction along y"), ("tau_z", "friction torque"))
        for suffix, model, note in (
            ("", "flat", "both scaled by S, the paper's normalisation"),
            (
                "_projected",
                "projected",
                "both scaled by the physical normal force F_N; not"
                " positive, for a planar model with that force claims too little",
            ),
        )
    ),
    Quantity(
        "e_n_error",
        "",
        "relative error of e_n",
        "Difference of e_n (curved) between the mesh and one with half as many elements per direction, over its value.",
        needs="two meshes",
    ),
    Quantity("quality_error", "", "relative error of quality", "As e_n_error.", needs="two scores"),
    Quantity("f_x_max_error", "", "relative error of f_x_max", "As e_n_error.", needs="two meshes"),
    Quantity("f_y_max_error", "", "relative error of f_y_max", "As e_n_error.", needs="two meshes"),
    Quantity("tau_z_max_error", "", "relative error of tau_z_max", "As e_n_error.", needs="two meshes"),
    *(
        Quantity(
            f"{name}_overestimate{suffix}_error",
            "",
            f"error of {name}_overestimate{suffix}",
            "Absolute difference between the mesh and one with half as many elements per direction.",
            needs="two meshes",
        )
        for name in ("f_x", "f_y", "tau_z")
        for suffix in ("", "_projected")
    ),
    Quantity(
        "safety_factor",
        "",
        "weight held over weight",
        "How many times its own weight the object could have"
        " before the grasp, with the normal force of this case on both fingers, lost it, with the hull of the"
        " sampled wrenches as limit surface (on the safe side). Below 1 it cannot hold the object. The centre of"
        " mass is that of [task], or the middle of the box round the object.",
        by_model=True,
        needs="mass",
    ),
    *(q for q in WALL if q.group == "maps"),
)

# Levels of each effect, cheapest first; effects/<name>_level holds the position in this list.
EFFECTS = {
    "object": ("rigid", "linear shell", "nonlinear shell"),
    "pad": ("linear", "hyperelastic"),
    "sheet": ("rigid", "elastic plate"),
    "model_size": ("quarter", "half", "full"),
    "fingers": ("one", "two"),
    "friction": ("flat", "curved"),
    "wrench": ("3-D", "6-D"),
    "limit_surface": ("ellipsoid from three motions", "fitted ellipsoid", "convex quartic"),
    "friction_pressure_coupling": ("none", "tangential traction"),
}
# What the indicator of an effect is, where it has one; effects/<name>_indicator.
INDICATORS = {
    "object": "dent that a linear wall would get at the largest force, over the wall's thickness",
    "pad": "largest |principal stretch - 1| of the pads in this state",
    "sheet": "mean deflection of the sheet under an even pressure over that of the pad",
    "friction": "share of the pressure sum that the tilt of the loaded normals takes off the normal force, 1 - F_N / S",
    "wrench": "mean share of the three dropped components in the friction wrench",
    "limit_surface": "radial misfit of the fitted limit surface, curved model, of the finger where it is larger",
    "friction_pressure_coupling": "share of the pressure sum that friction which acted back would add across it, of the"
    " finger where it is larger",
}
REASONS = (
    "the only level of this version",
    "forced by the scene",
    "indicator below the target",
    "indicator above the target",
    "exact by symmetry",
    "the default level of this version",
    "the object has no wall",
    "never skipped, because it costs next to nothing",
    "left out, though the indicator is above the target",
    "e_n and quality do not depend on it",
)


def cor_wrench(n: int) -> Quantity:
    """Friction wrenches of an ``n x n`` grid of centres of rotation."""
    text = (
        "Friction (f_x, f_y, tau_z) of the curved model in the contact frame, for turns about the points of a square"
        f" grid of ten contact lengths a side about the origin: {n} x {n} points, x first."
    )
    name = "wrenches of a grid of centres of rotation"
    return finger("fingers", "cor_wrench", "N, N, N m", name, text, shape=(n * n, 3))


def wrench_samples(n: int) -> Quantity:
    """Friction wrenches of the ``n`` motions that limit surfaces are fitted to."""
    text = (
        "Friction (f_x, f_y, tau_z) about the contact frame's origin for the motions in wrenches/motion; the opposite"
        " motions have the opposite wrenches. Of the candidates in wrenches/candidate only."
    )
    name, units = "wrenches of sampled motions", "N, N, N m"
    return finger("wrenches", "wrench", units, name, text, by_model=True, shape=(n, 3), among="sampled")


def probe_values(variations: Sequence[str]) -> tuple[Quantity, ...]:
    """What the further solves of a probe give."""
    told = "; ".join(f"{i} {name}" for i, name in enumerate(variations))
    text = f"Curved model, of the candidates in probes/candidate solved again with one thing changed: {told}."
    names = {"e_n": ("m", "e_n of changed probes"), "quality": ("", "quality of changed probes")}
    size = (len(variations),)
    return tuple(
        Quantity(name, units, label, text, group="probes", shape=size, among="probe")
        for name, (units, label) in names.items()
    )


def quantities(
    has: Collection[str] = (), cor_grid: int = 0, samples: int = 0, variations: Sequence[str] = ()
) -> tuple[Quantity, ...]:
    """All per-case quantities but the patch.

    Parameters
    ----------
    has : collection of str
        Which of `NEEDS` the scene asks for.
    cor_grid : int
        Points a side of the paper's grid of centres of rotation; 0 for none.
    samples : int
        Motions whose wrenches are stored for some candidates; 0 for none.
    variations : sequence of str
        What is changed in the further solves of probes.
    """
    everything = MAPS + FINGER + CHECKS + WORK + LIMIT_SURFACE + tuple(q for q in WALL if q.group != "maps")
    more = [cor_wrench(cor_grid)] * bool(cor_grid) + [wrench_samples(samples)] * bool(samples)
    more += probe_values(variations) if variations else ()
    return tuple(q for q in (*everything, *more) if not q.needs or q.needs in has)


def definitions(listed: Collection[Quantity]) -> str:
    """One text that says what every one of these quantities is; stored in each result file."""
    lines = [
        "Friction models: 'curved' lets every face resist in its own plane (curved contact model, Xu, Alt, Zhang,",
        "Steinbach: Grasping Posture Estimation for a Two-Finger Parallel Gripper with Soft Material Jaws using a",
        "Curved Contact Area Friction Model); 'flat' lays all faces into one plane and keeps the pressure sum S, the",
        "paper's planar model; 'projected' is the planar model with the physical normal force F_N.",
        "NaN: not there; status/code and status/message say why. All values are SI.",
        "",
    ]
    for q in listed:
        models = " [curved, flat, projected]" if q.by_model else ""
        lines.append(f"{q.key} [{q.units or '-'}]{models}: {q.long_name}. {q.definition}")
    return "\n".join(lines) + "\n"
