"""What patches from elsewhere can carry: one record in SI units, for programs, that the text is made from."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.fem.objects.gap import Pose
from softjaw.friction.frame import FrameFlag, behind, contact_length, principal_direction, wound
from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import checked_mu, friction_wrench, pure_torque
from softjaw.lsfit.body import ExactSurface
from softjaw.study.case.contact import ANTIPODAL, Contact, angles, pose_flags
from softjaw.study.case.evaluate import ECCENTRICITIES, exact_score, soft
from softjaw.study.case.limit_surface import STANDS_IN, fit_surfaces
from softjaw.study.case.result import UNDECIDED
from softjaw.study.flags import Flag, flags_in, raised
from softjaw.study.messages import USAGE, StudyError, fault_of, shown
from softjaw.study.patch.faces import ReadPatch
from softjaw.study.patch.patch_reader import ENDINGS, FACTORS, Reading, checked_file, read_table
from softjaw.study.quantities import MODELS, map_row

HALF_TURN = np.diag([1.0, -1.0, -1.0])  # about x: how the second of two equal fingers stands
SURFACES = {  # as a scene names them, and in the text
    "three_motions": "ellipsoid, three motions", "axis_aligned": "ellipsoid, axis-aligned", "full": "ellipsoid, full",
    "quartic": "convex quartic",
}  # fmt: skip
FAINT, SHORTER = 1e-3, 0.05  # of S, on faces that may be noise; of rho, which they change
FITTED_ON = 500  # motions; a fit is judged on others
SPACE = 3  # dimension of the loads (f_x, f_y, tau_z)
FRICTION = {"f_x_max": "f_x", "f_y_max": "f_y", "tau_z_max": "tau_z", "tau_pure": "", **{n: n for n in ECCENTRICITIES}}
UNITS = {
    "area": "m^2", "pressure": "Pa", "S": "N", "F_N": "N", "rho": "m", "origin": "m", "centre_of_pressure": "m",
    **{name: map_row(name).unit for name in FRICTION},
    "volume": "m", "semi_axes": "-, -, m", "E_dir": "rad", "distance": "m", "object_length": "m",
    "contact_length": "m", "misalignment": "rad",
}  # fmt: skip
DEFINITIONS = {
    "S": "sum of pressure times area over the patch",
    "F_N": "its part along the contact normal: the force of the gripper",
    "rho": "longer side of the rectangle round the loaded faces in the contact frame",
    "ccm": "curved contact model: every face resists in its own plane",
    "pcm, pcm_projected": "planar contact model: all faces in one plane, scaled by S (as in the paper), or by F_N",
    "f_x_max, f_y_max, tau_z_max": "largest friction along x and y, and about the contact normal through the origin",
    "tau_pure": "largest friction torque while no net force is transmitted",
    "e_n": "tau_z_max / (mu S)",
    "e_n_ratio": "tau_z_max / max f_t, with the largest friction force in the contact plane, in any direction",
    "e_n_projected": "tau_z_max / (mu F_N)",
    "limit surface": "all loads (f_x, f_y, tau_z) that friction can carry, here per newton of S",
    "E_rad, E_dir": "mean error of a fitted surface's radius; mean angle between its normal and the sliding motion",
    "quality": "volume of the grasp wrench space of both contacts (L-infinity, S = 1 each)",
    "epsilon": "radius of the largest ball round 0 in it, about the midpoint of the contacts: lower and upper bound",
}
SCORES = ("quality", "epsilon")
OF_FRAME = Flag.CYCLE | Flag.HOLE | Flag.NO_CORNERS | Flag.OVERHANG


def read_patch(file: str, reading: Reading) -> ReadPatch:
    """The patch in a file, in the file's coordinates; `StudyError` for what cannot be read (3) or is no patch (2)."""
    for name, kind, unit in (("unit", "length", reading.unit), ("pressure_unit", "pressure", reading.pressure_unit)):
        if unit not in (None, *FACTORS[kind]):
            raise StudyError(USAGE, f"{name}: found {shown(unit)}, expected one of {', '.join(FACTORS[kind])}")
    path = checked_file(file, ENDINGS)
    if path.suffix.lower() == ".csv":
        return read_table(path, reading)
    from softjaw.study.patch.vtk_faces import read_vtk  # VTK, which tables do not need

    return read_vtk(path, reading)


def contact_of(
    patch: ContactPatch, mu: float, x_axis: ArrayLike | None = None,
    count: Callable[[NDArray[np.bool_]], str] = lambda chosen: f"{int(chosen.sum())} of {len(chosen)} faces",
) -> Contact:  # fmt: skip
    """A patch in its contact frame, with its friction; errors as for `friction_limits`, which ``count`` faces."""
    if not isinstance(patch, ContactPatch):
        text = f"patch is a {type(patch).__name__}: expected a ContactPatch of centroid, area, normal and pressure"
        raise TypeError(text)
    mu, x_hint = checked_mu(mu), principal_direction(patch) if x_axis is None else np.asarray(x_axis, float)
    if x_hint.shape != (3,) or not np.isfinite(x_hint).all():
        raise ValueError(f"x_axis is {x_hint.tolist()}: expected three finite numbers")
    try:
        contact = Contact(patch, mu, x_hint=x_hint)
    except ValueError as error:
        raise type(error)(str(error).replace("x_hint", "x_axis")) from error
    if contact.frame.flag & FrameFlag.ORIENTATION:
        fault = f"normals in {count(behind(patch.normal, contact.frame.axes[2]))} that oppose their neighbours"
        remedy = "orient them before export (ParaView: Generate Surface Normals with Consistency)"
        raise ValueError(f"normal: found {fault}, expected all to one side; {remedy}")
    return contact


def opposite(contact: Contact, distance: float) -> Contact:
    """The same contact facing this one, half a turn about its x and a distance [m] away."""
    axes, origin = contact.frame.axes, contact.frame.origin
    # half a turn that leaves the contact's own x where it is, seen from the object
    turn = axes.T @ HALF_TURN @ axes
    return contact.at(Pose(turn, origin + distance * axes[2] - turn @ origin))


def check_facing(contacts: Sequence[Contact], names: Sequence[str]) -> None:
    """Refuse contacts at one place, and normals that point away from the other contact, by `ValueError`."""
    line = contacts[1].origin - contacts[0].origin
    distance = float(np.linalg.norm(line))
    if distance <= 1e-9 * max(c.rho for c in contacts):
        text = f"{names[0]} and {names[1]} touch at the same place; give both in the coordinates of one object"
        raise ValueError(text)
    pairs = zip(contacts, names, (line, -line), strict=True)
    # difference of cosines that decides nothing
    away = [name for c, name, to in pairs if c.normal @ to < -1e-6 * distance]
    if away:
        fault = f"the normals of {away[0]} and {away[-1]} point away from each other"
        remedy = "turn both (--flip-normals, flip_normals=True)"
        if len(away) == 1:
            fault = f"the normals of {away[0]} point away from the other contact and those of the other towards it"
            remedy = f"turn the normals of {away[0]}"
        raise ValueError(f"{fault}, expected the direction in which each finger presses, into the object; {remedy}")


def grasp_lengths(
    contacts: Sequence[Contact], object_length: float | None, contact_length: float | None
) -> tuple[float, float, float]:
    """Distance of two contacts, and the lengths by which arms and torques about normals are divided [m]."""
    distance = float(np.linalg.norm(contacts[1].origin - contacts[0].origin))
    return distance, object_length or distance, contact_length or max(c.rho for c in contacts)


def exact_surface(contact: Contact, model: str) -> ExactSurface:
    """The limit surface itself of a contact, per unit of S [-, -, m]; 2000 motions give its volume to some 1e-3."""
    share = contact.mu / contact.limits[model].S
    return ExactSurface(lambda t: friction_wrench(contact.local, t, share, model)[:, [0, 1, 5]], contact.rho, 2000)


class EvaluatedPatch:
    """A patch from a file and all that friction can carry there; x is along ``long_side`` or its longer direction.

    ``contact`` has its contact frame and friction limits, ``fits`` for each friction model the fitted surfaces by kind,
    ``exact`` for each the limit surface itself, per unit of S.
    """

    def __init__(self, read: ReadPatch, mu: float, long_side: ArrayLike | None = None) -> None:
        self.read, self.x_given = read, long_side is not None
        try:
            self.contact = contact_of(read.patch, mu, long_side, self.count)
        except ValueError as error:
            raise StudyError(USAGE, f"{read.file}: {str(error).replace('x_axis', '--long-side')}") from error
        self.fits = {m: fit_surfaces(self.contact, m, list(SURFACES), "least_squares", FITTED_ON) for m in MODELS}
        self.exact = {m: exact_surface(self.contact, m) for m in MODELS}

    @property
    def rank(self) -> int:
        """Dimension of the loads that the contact can carry, 3 if nothing is missing."""
        return self.exact["ccm"].rank

    def surface(self, model: str, kind: str) -> Any:
        """A limit surface in ``(f_x, f_y, tau_z)`` per unit of S; ``kind`` is ``exact`` or one of `SURFACES`."""
        return self.exact[model] if kind == "exact" else self.fits[model][kind].body(self.contact.mu)

    def count(self, chosen: NDArray[np.bool_]) -> str:
        """How many of the loaded faces ``(n,)`` are chosen, or not where these are fewer, and the first one's place."""
        few = ~chosen if 2 * chosen.sum() > len(chosen) else chosen
        first = f", the first in {self.read.place(int(np.argmax(few)))}" if few.any() else ""
        return f"{int(few.sum())} of {len(few)} loaded faces{first}"


# --- grasp ------------------------------------------------------------------------------------------------------------


def grasp_record(
    first: EvaluatedPatch,
    second: EvaluatedPatch | None,
    kind: str,
    distance: float | None = None,
    object_length: float | None = None,
    contact_length: float | None = None,
) -> dict[str, Any]:
    """Score of a grasp by two patches, for unit normal forces (S = 1), lengths in m; ``kind`` is one of `SURFACES`.

    Without ``second`` the other contact is like the first, half a turn about x and ``distance`` away from it.
    """
    both = first, second or first
    contacts = first.contact, second.contact if second else opposite(first.contact, float(distance or 0.0))
    with fault_of("--other", ValueError):
        check_facing(contacts, [patch.read.file for patch in both])
    d, *lengths = grasp_lengths(contacts, object_length, contact_length)
    score = {m: exact_score(soft(contacts, [p.surface(m, kind) for p in both]), *lengths) for m in MODELS}
    return {
        "surface": kind, "distance": d, "object_length": lengths[0], "contact_length": lengths[1],
        "misalignment": max(angles(*contacts)), "slips": bool(pose_flags(contacts) & Flag.SLIPS), "score": score,
    }  # fmt: skip


# --- record -----------------------------------------------------------------------------------------------------------


def as_record(patches: Sequence[EvaluatedPatch], grasp: dict[str, Any] | None) -> dict[str, Any]:
    """Everything as plain numbers, lists and texts, in SI units; what is not there is None."""
    return {
        "mu": patches[0].contact.mu, "patches": [_patch_record(patch) for patch in patches], "grasp": grasp,
        "notes": _notes(patches, grasp), "units": UNITS, "definitions": DEFINITIONS,
    }  # fmt: skip


def _patch_record(evaluated: EvaluatedPatch) -> dict[str, Any]:
    patch, contact, frame = evaluated.read.patch, evaluated.contact, evaluated.contact.frame
    names = ("origin", "axes", "centre_of_pressure", "flag", "overhang_count", "overhang_share")
    friction = {}
    for model, limits in contact.limits.items():
        values = {key: getattr(limits, name) for key, name in FRICTION.items() if name}
        friction[model] = FRICTION | values | {"tau_pure": pure_torque(contact.local, contact.mu, model)}
    return {
        "file": evaluated.read.file, "faces": evaluated.read.faces, "loaded_faces": len(patch.area),
        "area": patch.area.sum(), "pressure": patch.pressure.max(), "S": contact.limits["ccm"].S,
        "F_N": contact.limits["ccm"].F_N, "rho": contact.rho,
        "frame": {name: getattr(frame, name) for name in names} | {"flag": int(frame.flag)}, "rank": evaluated.rank,
        "friction": friction, "limit_surface": {model: _surfaces_record(evaluated, model) for model in MODELS},
    }  # fmt: skip


def _surfaces_record(evaluated: EvaluatedPatch, model: str) -> dict[str, Any]:
    surfaces: dict[str, Any] = {}
    for kind in ("exact", *SURFACES):
        surface = evaluated.surface(model, kind)
        surfaces[kind] = {"volume": surface.volume, "semi_axes": surface.semi_axes}
        if kind != "exact":
            fit = evaluated.fits[model][kind]
            # samples in a plane bound no body, so there is nothing to be off from
            errors = fit.fit_error if evaluated.exact[model].rank == SPACE else (None, None, None)
            surfaces[kind] |= {"stands_in": fit.certificate == STANDS_IN}
            surfaces[kind] |= dict(zip(("E_1", "E_rad", "E_dir"), errors, strict=True))
    return surfaces


def _notes(patches: Sequence[EvaluatedPatch], grasp: dict[str, Any] | None) -> list[str]:
    """What the reader should know, in sentences."""
    notes = []
    for patch in patches:
        name = f"{patch.read.file}: " if len(patches) > 1 else ""
        notes += [*patch.read.notes, *(name + note for note in _patch_notes(patch))]
    if grasp is None:
        return notes
    if grasp["misalignment"] > ANTIPODAL - UNDECIDED:
        notes.append(f"the contacts are {np.degrees(grasp['misalignment']):.2g} deg from antipodal")
    if grasp["slips"]:
        notes.append(Flag.SLIPS.sentence)
    if len(patches) == 1:
        notes.append("the second contact of the grasp is the same patch facing the first: no --other was given")
    return notes


def _without_faint(patch: ContactPatch) -> float:
    """Length of a patch in its contact frame without the faces that together carry next to nothing [m]."""
    order = np.argsort(patch.load)
    bears = np.empty(len(order), bool)
    bears[order] = np.cumsum(patch.load[order]) > FAINT * patch.load.sum()
    return contact_length(patch.only(bears))


def _patch_notes(evaluated: EvaluatedPatch) -> list[str]:
    frame, notes = evaluated.contact.frame, []
    if not evaluated.x_given:
        notes.append("x follows the longer direction of the patch, else an axis of the file: no --long-side was given")
    for flag in flags_in(raised(frame.flag) & OF_FRAME):
        share = f": {frame.overhang_count}, with {100 * frame.overhang_share:.2g} % of S"
        notes.append(flag.sentence + share * (flag == Flag.OVERHANG))
    rho, shorter = evaluated.contact.rho, _without_faint(evaluated.contact.local)
    if shorter < (1 - SHORTER) * rho:
        text = f"rho is {1e3 * rho:.4g} mm by faces that carry a thousandth of S, {1e3 * shorter:.4g} mm without them"
        notes.append(f"{text}; the score divides torques by it: take out what is noise, or give --contact-length")
    if frame.flag & FrameFlag.WINDING:
        against = evaluated.count(wound(evaluated.read.patch) < 0)
        notes.append(f"the corners of {against}, are wound against their normals; the normals were taken as they are")
    for model, fits in evaluated.fits.items():
        if failed := [kind for kind, fit in fits.items() if fit.certificate == STANDS_IN]:
            notes.append(f"{model}: fit failed for {', '.join(failed)}; three-motion ellipsoid used")
    if evaluated.rank < SPACE:
        space = {1: "one line", 2: "a plane"}.get(evaluated.rank, "a point")
        notes.append(f"the loads that friction can carry fill {space} only (rank {evaluated.rank}): no fit is judged")
    return notes
