"""What a result file holds of each finger: friction limits, frames, checks, work, limit surfaces and patches."""

from __future__ import annotations

from softjaw.study.result.quantity import Quantity, finger

FINGER = (
    finger("fingers", "f_x_max", "N", "largest friction along x", "As the map, for each finger.", by_model=True),
    finger("fingers", "f_y_max", "N", "largest friction along y", "As the map, for each finger.", by_model=True),
    finger("fingers", "tau_z_max", "N m", "largest friction torque about z", "As the map, for each finger.",
            by_model=True),
    finger("fingers", "tau_pure", "N m", "largest torque without a net force", "As the map, for each finger."),
    finger("fingers", "S", "N", "pressure times area", "As the map, for each finger."),
    finger("fingers", "F_N", "N", "normal force", "As the map, for each finger."),
    finger("fingers", "travel", "m", "travel of the pad", "As the map, for each finger."),
    finger("fingers", "frame_origin", "m", "origin of the contact frame", "In the pad's frame: where"
            " the line through the centre of pressure along z meets the pad's deformed face, loaded there or not.",
            shape=(3,)),
    finger("fingers", "frame_axes", "", "axes of the contact frame", "Rows x, y, z in the pad's frame; z is"
            " the object's normal at the origin, the deformed face's own where no load is near.", shape=(3, 3)),
    finger("fingers", "frame_flag", "", "flag of the contact frame", "0: regular; otherwise a rule for a degenerate"
            " patch chose the frame."),
    finger("fingers", "pose_rotation", "", "rotation of the pad", "x_object = rotation x_pad + origin.", shape=(3, 3)),
    finger("fingers", "pose_origin", "m", "origin of the pad", "Centre of the undeformed front face at first touch, in"
            " the object's frame; under load the pad's back has moved on by the travel, along its z axis.", shape=(3,)),
)

CHECKS = (
    finger("checks", "force_balance", "", "force balance", "Difference of contact force and load, over the load."),
    finger("checks", "tension", "", "largest tension", "Largest negative nodal pressure over the largest pressure."),
    finger("checks", "penetration", "", "largest penetration", "Deepest mean overlap at a node over an element."),
    finger("checks", "complementarity", "", "complementarity", "Largest product of pressure and gap at a node, over"
            " the largest pressure and the element size."),
    finger("checks", "overlap", "m", "deepest point inside the object", "Of the quadrature points of the front:"
            " weighted gaps hold on average, so this tells how well the mesh follows the object."),
    finger("checks", "min_det_f", "", "smallest det F", "Smallest ratio of deformed to undeformed volume."),
    finger("checks", "max_strain", "", "largest strain", "Largest difference of a principal stretch from 1."),
    finger("checks", "acoustic", "", "smallest acoustic eigenvalue", "Over the shear modulus, in 24 directions at one"
            " point per element; not positive: the foam lost ellipticity and strains may localise."),
)

WORK = (
    finger("work", "newton_iterations", "", "Newton iterations", "Since the force below."),
    finger("work", "load_steps", "", "load steps", "Newton solves since the force below."),
    finger("work", "cuts", "", "step cuts", "Solves that failed and were tried again in shorter steps."),
    *(Quantity(f"seconds_{part}", "s", f"seconds in {part}", f"Time of the case spent in {part}.", group="work")
      for part in ("assembly", "factorisation", "rest", "friction", "total")),
)

# Exponents of x, y and t, highest power of x first.
MONOMIALS = tuple(
    " ".join(f"{letter}^{k}" if k > 1 else letter for letter, k in zip("xyt", (i, j, 4 - i - j), strict=True) if k)
    for i in range(4, -1, -1)
    for j in range(4 - i, -1, -1)
)
LIMIT_SURFACE = (
    finger("limit_surface", "semi_axes", "-, -, m", "semi-axes of the ellipsoid from three motions", "Largest f_x, f_y"
           " and tau_z over S: the ellipsoid that quality is computed from.", by_model=True, shape=(3,)),
    finger("limit_surface", "rank", "", "semi-axes that are not zero", "3: a body; less: a disc, a segment or a point,"
           " because the contact carries no load along an axis.", by_model=True),
    finger("limit_surface", "rho", "m", "length of the contact", "By which torques are divided in the fit: the longer"
           " side of the loaded patch in the contact frame."),
    finger("limit_surface", "matrix", "", "matrix of the fitted ellipsoid", "A of w A w = 1 in w = (f_x, f_y,"
           " tau_z / rho) / (mu S); NaN where a quartic was fitted.", by_model=True, shape=(3, 3)),
    finger("limit_surface", "coefficients", "", "coefficients of the fitted quartic", "P(w) = 1 in w = (x, y, t) ="
           f" (f_x, f_y, tau_z / rho) / (mu S), of {', '.join(MONOMIALS)} in this order; NaN where an ellipsoid was"
           " fitted.", by_model=True, shape=(15,)),
    finger("limit_surface", "certificate", "", "how the fit is known to be convex", "0 the fit failed, the"
           " ellipsoid from three motions stands in; 1 an ellipsoid; 2 the quartic came out convex; 3 a semidefinite"
           " programme kept the quartic convex.", by_model=True),
    finger("limit_surface", "fit_flag", "", "flag of the fit", "Sum of: 1 the wrenches lie in a plane or on a line, so"
           " the surface is flat; 2 fewer independent wrenches than coefficients; 4 its reach was limited, for the"
           " wrenches alone would give an endless body; 8 rho does not suit the contact.", by_model=True),
    *(finger("limit_surface", name, "-, -, rad", f"misfit of the {what}", f"Means over {motions}: |P - 1|,"
             " |P^(-1/degree) - 1| (the relative error of the radius), angle between gradient and motion.",
             by_model=True, shape=(3,))
      for name, what, motions in (
          ("misfit", "fitted surface", "377 motions that it was not fitted to"),
          ("misfit_own", "fitted surface on its own samples", "the motions that it was fitted to"),
          ("misfit_ellipsoid", "ellipsoid from three motions", "the 377 motions"))),
    finger("limit_surface", "matrix_6d", "", "matrix of the fitted 6-D ellipsoid", "A of w A w = 1 in w = (f_x, f_y,"
           " f_z, tau_x / rho, tau_y / rho, tau_z / rho) / (mu S), curved model; of the directions that the contact"
           " resists.", shape=(6, 6), needs="six components"),
    finger("limit_surface", "rank_6d", "", "directions that the contact resists", "Of the six; 3 for a planar contact.",
           needs="six components"),
    finger("limit_surface", "misfit_6d", "-, -, rad", "misfit of the 6-D ellipsoid", "As misfit, over the motions it"
           " was fitted to.", shape=(3,), needs="six components"),
)

PATCH = (
    finger("patch", "pressure", "Pa", "contact pressure", "Pressure of each face of the pad's front."),
    finger("patch", "area", "m^2", "face area", "Deformed area of each face."),
    finger("patch", "centroid", "m", "face centroid", "Deformed position in the pad's frame.", shape=(3,)),
    finger("patch", "normal", "", "face normal", "Unit normal of the deformed face, in the pad's frame.", shape=(3,)),
)
