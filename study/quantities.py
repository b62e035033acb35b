"""Every number a result file holds: name, unit, meaning and shape, in literal tables.

A new quantity is one more line here; layout, store, ``show`` and the report follow from these tables.
"""

from __future__ import annotations

from dataclasses import dataclass

MODELS = ("curved", "flat", "projected")
FINGERS = 2


@dataclass(frozen=True)
class Quantity:
    """One number, or one small array, of a case.

    Parameters
    ----------
    name, units, long_name : str
        Dataset name, SI unit ("" for a pure number), label of a colour bar.
    definition : str
        One sentence; the reader of the file sees it beside the data.
    per : "case" or "finger"
        A finger's quantity has a leading axis of length two.
    by_model : bool
        Whether there is one value for each of `MODELS` (axis after the finger).
    group : str
        ``maps``, ``fingers``, ``checks``, ``work`` or ``limit_surface``.
    shape : tuple of int
        Trailing shape, ``()`` for a scalar.
    """

    name: str
    units: str
    long_name: str
    definition: str
    per: str = "case"
    by_model: bool = False
    group: str = "maps"
    shape: tuple[int, ...] = ()
    only_with_two_meshes: bool = False

    @property
    def key(self) -> str:
        """Key of the value in ``CaseResult.values``."""
        return f"{self.group}/{self.name}"

    @property
    def row_shape(self) -> tuple[int, ...]:
        """Shape of one case's value."""
        finger = (FINGERS,) if self.per == "finger" else ()
        return finger + ((len(MODELS),) if self.by_model else ()) + self.shape


MAPS = (
    Quantity("quality", "", "grasp quality", "Volume of the grasp wrench space spanned by both contacts with unit"
             " normal forces; torque components are divided by the scales given in the scene.", by_model=True),
    Quantity("e_n", "m", "eccentricity parameter e_n", "max tau_z / (mu S), with S the sum of pressure times area over"
             " the patch; of the weaker finger.", by_model=True),
    Quantity("e_n_projected", "m", "eccentricity parameter, physical normal force", "max tau_z / (mu F_N), with F_N the"
             " sum of pressure times area times the cosine between face normal and contact normal; of the weaker"
             " finger.", by_model=True),
    Quantity("epsilon", "", "largest-minimum resisted wrench", "Radius of the largest ball around the origin inside the"
             " grasp wrench space.", by_model=True),
    Quantity("f_x_max", "N", "largest friction along x", "Total friction force along the contact frame's x axis when"
             " the pad slides along x, Eqs. (6)-(8); of the weaker finger.", by_model=True),
    Quantity("f_y_max", "N", "largest friction along y", "Total friction force along the contact frame's y axis when"
             " the pad slides along y; of the weaker finger.", by_model=True),
    Quantity("tau_z_max", "N m", "largest friction torque about z", "Total friction torque about the contact normal"
             " when the pad turns about it; of the weaker finger.", by_model=True),
    Quantity("S", "N", "pressure times area", "Sum of pressure times area over the patch; mean of both fingers."),
    Quantity("F_N", "N", "normal force", "Sum of pressure times area times (n . N), the force along the contact normal;"
             " mean of both fingers."),
    Quantity("travel", "m", "travel of the pad", "How far the pad's back moved towards the object after first touch;"
             " mean of both fingers."),
    Quantity("contact_area", "m^2", "contact area", "Area of the faces under pressure; mean of both fingers."),
    Quantity("p_max", "Pa", "largest pressure", "Largest contact pressure on either finger."),
    Quantity("contact_distance", "m", "distance of the contacts", "Distance between the contact frames' origins."),
    Quantity("curvature_loss", "", "force lost to curvature", "1 - F_N / S: zero for a flat contact, what the tilt of"
             " the loaded normals takes off the normal force otherwise; both fingers together."),
    Quantity("misalignment", "rad", "misalignment of the contacts", "Largest of the angles between one contact normal"
             " and the other reversed, and between the line that joins the contacts and each normal; the score's closed"
             " form is exact at 0 and off by about 1 % at 0.09 rad."),
    Quantity("flags", "", "flags of the case", "Sum of: 1 a contact carries no torque, 2 a contact carries no force"
             " along an axis; contact frame: 4 normal averaged over a cycle, 8 centre of pressure over a hole, 16 no"
             " corners, 32 mixed orientation, 64 overhanging normals; 256 contacts more than 5 degrees from antipodal;"
             " 512 solved with nodal gaps, because weighted ones had no solution; 1024 the line that joins the"
             " contacts leaves a friction cone: the grasp slips; 2048 the fingers' pads run into each other beside the"
             " object; 4096 the mesh is coarse for this contact: the front overlaps the object by more than a tenth of"
             " the travel, or fewer than six elements carry load."),
    *(Quantity(f"{name}_overestimate{suffix}", "", f"{what}: {model} over curved model",
               f"1 - curved / {model} of {name}_max: the share of the planar model's claim that the curved"
               f" contact cannot carry ({note}); of the finger where it is largest.")
      for name, what in (("f_x", "friction along x"), ("f_y", "friction along y"), ("tau_z", "friction torque"))
      for suffix, model, note in (("", "flat", "both scaled by S, the paper's normalisation"),
                                  ("_projected", "projected", "both scaled by the physical normal force F_N; not"
                                   " positive, for a planar model with that force claims too little"))),
    Quantity("e_n_error", "", "relative error of e_n", "Difference of e_n (curved) between the mesh and one with half"
             " as many elements per direction, over its value.", only_with_two_meshes=True),
    Quantity("f_x_max_error", "", "relative error of f_x_max", "As e_n_error.", only_with_two_meshes=True),
    Quantity("f_y_max_error", "", "relative error of f_y_max", "As e_n_error.", only_with_two_meshes=True),
    Quantity("tau_z_max_error", "", "relative error of tau_z_max", "As e_n_error.", only_with_two_meshes=True),
    *(Quantity(f"{name}_overestimate{suffix}_error", "", f"error of {name}_overestimate{suffix}",
               "Absolute difference between the mesh and one with half as many elements per direction.",
               only_with_two_meshes=True)
      for name in ("f_x", "f_y", "tau_z") for suffix in ("", "_projected")),
)


def _finger(group: str, name: str, units: str, long_name: str, definition: str, **extra) -> Quantity:
    return Quantity(name, units, long_name, definition, per="finger", group=group, **extra)


FINGER = (
    _finger("fingers", "f_x_max", "N", "largest friction along x", "As the map, for each finger.", by_model=True),
    _finger("fingers", "f_y_max", "N", "largest friction along y", "As the map, for each finger.", by_model=True),
    _finger("fingers", "tau_z_max", "N m", "largest friction torque about z", "As the map, for each finger.",
            by_model=True),
    _finger("fingers", "S", "N", "pressure times area", "As the map, for each finger."),
    _finger("fingers", "F_N", "N", "normal force", "As the map, for each finger."),
    _finger("fingers", "travel", "m", "travel of the pad", "As the map, for each finger."),
    _finger("fingers", "frame_origin", "m", "origin of the contact frame", "In the pad's frame.", shape=(3,)),
    _finger("fingers", "frame_axes", "", "axes of the contact frame", "Rows x, y, z in the pad's frame.", shape=(3, 3)),
    _finger("fingers", "frame_flag", "", "flag of the contact frame", "0: regular; otherwise a rule for a degenerate"
            " patch chose the frame."),
    _finger("fingers", "pose_rotation", "", "rotation of the pad", "x_object = rotation x_pad + origin.", shape=(3, 3)),
    _finger("fingers", "pose_origin", "m", "origin of the pad", "Centre of the undeformed front face at first touch, in"
            " the object's frame; under load the pad's back has moved on by the travel, along its z axis.", shape=(3,)),
)

CHECKS = (
    _finger("checks", "force_balance", "", "force balance", "Difference of contact force and load, over the load."),
    _finger("checks", "tension", "", "largest tension", "Largest negative nodal pressure over the largest pressure."),
    _finger("checks", "penetration", "", "largest penetration", "Deepest mean overlap at a node over an element."),
    _finger("checks", "complementarity", "", "complementarity", "Largest product of pressure and gap at a node, over"
            " the largest pressure and the element size."),
    _finger("checks", "overlap", "m", "deepest point inside the object", "Of the quadrature points of the front:"
            " weighted gaps hold on average, so this tells how well the mesh follows the object."),
    _finger("checks", "min_det_f", "", "smallest det F", "Smallest ratio of deformed to undeformed volume."),
    _finger("checks", "max_strain", "", "largest strain", "Largest difference of a principal stretch from 1."),
    _finger("checks", "acoustic", "", "smallest acoustic eigenvalue", "Over the shear modulus, in 24 directions at one"
            " point per element; not positive: the foam lost ellipticity and strains may localise."),
)

WORK = (
    _finger("work", "newton_iterations", "", "Newton iterations", "Since the force below."),
    _finger("work", "load_steps", "", "load steps", "Newton solves since the force below."),
    _finger("work", "cuts", "", "step cuts", "Solves that failed and were tried again in shorter steps."),
    *(Quantity(f"seconds_{part}", "s", f"seconds in {part}", f"Time of the case spent in {part}.", group="work")
      for part in ("assembly", "factorisation", "rest", "friction", "total")),
)

LIMIT_SURFACE = (
    _finger("limit_surface", "semi_axes", "-, -, m", "semi-axes of the ellipsoid", "Largest f_x, f_y and tau_z over S:"
            " the ellipsoid through the wrenches of three motions, which the score is computed from.", by_model=True,
            shape=(3,)),
    _finger("limit_surface", "rank", "", "semi-axes that are not zero", "3: a body; less: a disc, a segment or a point,"
            " because the contact carries no load along an axis.", by_model=True),
)

PATCH = (
    _finger("patch", "pressure", "Pa", "contact pressure", "Pressure of each face of the pad's front."),
    _finger("patch", "area", "m^2", "face area", "Deformed area of each face."),
    _finger("patch", "centroid", "m", "face centroid", "Deformed position in the pad's frame.", shape=(3,)),
    _finger("patch", "normal", "", "face normal", "Unit normal of the deformed face, in the pad's frame.", shape=(3,)),
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
REASONS = (
    "the only level of this version",
    "forced by the scene",
    "indicator below the target",
    "indicator above the target",
    "exact by symmetry",
)


def cor_wrench(n: int) -> Quantity:
    """Friction wrenches of an ``n x n`` grid of centres of rotation."""
    text = (
        "Friction (f_x, f_y, tau_z) of the curved model in the contact frame, for turns about the points of a square"
        f" grid of ten contact lengths a side about the origin: {n} x {n} points, x first."
    )
    name = "wrenches of a grid of centres of rotation"
    return _finger("fingers", "cor_wrench", "N, N, N m", name, text, shape=(n * n, 3))


def quantities(meshes: int = 1, cor_grid: int = 0) -> tuple[Quantity, ...]:
    """All per-case quantities but the patch.

    The error maps exist when every case is solved on two meshes, the wrenches of the paper's grid of centres of
    rotation when the scene asks for a grid of ``cor_grid`` points a side.
    """
    everything = MAPS + FINGER + CHECKS + WORK + LIMIT_SURFACE + ((cor_wrench(cor_grid),) if cor_grid else ())
    return tuple(q for q in everything if meshes > 1 or not q.only_with_two_meshes)


def definitions(meshes: int = 1, cor_grid: int = 0) -> str:
    """One text that says what every quantity is; stored in each result file."""
    lines = [
        "Friction models: 'curved' lets every face resist in its own plane (curved contact model, Xu, Alt, Zhang,",
        "Steinbach: Grasping Posture Estimation for a Two-Finger Parallel Gripper with Soft Material Jaws using a",
        "Curved Contact Area Friction Model); 'flat' lays all faces into one plane and keeps the pressure sum S, the",
        "paper's planar model; 'projected' is the planar model with the physical normal force F_N.",
        "NaN: not there; status/code and status/message say why. All values are SI.",
        "",
    ]
    for q in quantities(meshes, cor_grid) + PATCH:
        models = " [curved, flat, projected]" if q.by_model else ""
        lines.append(f"{q.key} [{q.units or '-'}]{models}: {q.long_name}. {q.definition}")
    return "\n".join(lines) + "\n"
