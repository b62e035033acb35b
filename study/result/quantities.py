"""Every number a result file holds: name, unit, meaning and shape, in literal tables.

A new quantity is one more line in `map_quantities`, `finger_quantities` or here; layout, store, ``show``
and the report follow from these tables.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

from softjaw.study.result.finger_quantities import CHECKS, FINGER, LIMIT_SURFACE, WORK
from softjaw.study.result.map_quantities import MAPS
from softjaw.study.result.quantity import Quantity, finger
from softjaw.study.result.wall_quantities import WALL

EFFECTS = {
    "object": ("rigid", "linear shell", "nonlinear shell"),
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
