"""The maps of every case: friction limits, scores, and what is said beside them."""

from __future__ import annotations

from softjaw.study.flags import flag_definitions
from softjaw.study.result.quantity import Quantity
from softjaw.study.result.wall_quantities import WALL

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
        " patch is not symmetric, and is larger: up to 2 max(a, b) / (a + b) times where a pad bears on two ends with"
        " loads a and b, because its origin lies between them. Curved model, of the weaker finger.",
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
        flag_definitions(),
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
