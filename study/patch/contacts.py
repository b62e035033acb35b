"""Contacts of patches from files: read, each in its contact frame, two that face each other, the exact surface."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from softjaw.fem.objects.gap import Pose
from softjaw.friction.frame import FrameFlag, principal_direction
from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import checked_mu, friction_wrench
from softjaw.lsfit.body import ExactSurface
from softjaw.study.case.contact import Contact
from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.patch.faces import ReadPatch, checked
from softjaw.study.patch.patch_reader import ENDINGS, Reading, checked_file, read_table

EXACT = 2000  # motions whose hull gives the volume of the limit surface itself, to some 1e-4
HALF_TURN = np.diag([1.0, -1.0, -1.0])  # about x: how the second of two equal fingers stands


def read_patch(file: str, reading: Reading) -> ReadPatch:
    """The patch in a file, in the file's coordinates.

    Raises
    ------
    StudyError
        With code 3 if the file cannot be read as what its ending says, 2 if what it holds is no patch.
    """
    path = checked_file(file, ENDINGS)
    ending = path.suffix.lower()
    if ending == ".csv":
        return checked(read_table(path, reading), reading.flip_normals)
    from softjaw.study.patch.vtk_faces import read_vtk, trouble  # VTK, which tables do not need

    if why := trouble(lambda: read_vtk(path, reading)):  # VTK may not survive the file
        raise StudyError(OTHER_FILE, f"{path}: damaged ({why}); write it again")
    return checked(read_vtk(path, reading), reading.flip_normals)


def contact_of(patch: ContactPatch, mu: float, x_axis: ArrayLike | None = None) -> Contact:
    """A patch in its contact frame, with its friction; errors as for `friction_limits`."""
    if not isinstance(patch, ContactPatch):
        expected = "a ContactPatch of centroid, area, normal and pressure"
        raise TypeError(f"patch is a {type(patch).__name__}: expected {expected}")
    mu = checked_mu(mu)
    try:
        contact = Contact(patch, mu, x_hint=principal_direction(patch) if x_axis is None else x_axis)
    except ValueError as error:
        raise type(error)(str(error).replace("x_hint", "x_axis")) from error
    if contact.frame.flag & FrameFlag.ORIENTATION:
        raise ValueError("patch: found normals that oppose their neighbours, expected all to one side; turn the others")
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
        text = f"{names[1]} has its contact at the same place as {names[0]}"
        raise ValueError(f"{text}; both have to use the coordinates of one object")
    pairs = zip(contacts, names, (line, -line), strict=True)
    # difference of cosines that decides nothing
    away = [name for c, name, to in pairs if c.normal @ to < -1e-6 * distance]
    if away:
        found = f"the normals of {away[0]} and {away[-1]} point away from each other"
        remedy = "turn both (--flip-normals, flip_normals=True)"
        if len(away) == 1:
            found = f"the normals of {away[0]} point away from the other contact and those of the other towards it"
            remedy = f"turn the normals of {away[0]}"
        raise ValueError(f"{found}, expected the direction in which each finger presses, into the object; {remedy}")


def grasp_lengths(
    contacts: Sequence[Contact], object_length: float | None, contact_length: float | None
) -> tuple[float, float, float]:
    """Distance of two contacts, and the lengths by which arms and torques about normals are divided [m]."""
    distance = float(np.linalg.norm(contacts[1].origin - contacts[0].origin))
    return distance, object_length or distance, contact_length or max(c.rho for c in contacts)


def exact_surface(contact: Contact, model: str) -> ExactSurface:
    """The limit surface itself of a contact, per unit of S [-, -, m]."""
    share = contact.mu / contact.limits[model].S
    return ExactSurface(lambda t: friction_wrench(contact.local, t, share, model)[:, [0, 1, 5]], contact.rho, EXACT)
