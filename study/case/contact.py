"""A contact patch where it lies: its frame, what friction can carry there, and how two of them stand to each other.

On the faces of a pad it has pieces, holes and loaded rims, and an equal on other faces. Nothing here knows a solver:
the patch may come from a file.
"""

import math
from collections.abc import Sequence
from copy import copy
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from softjaw.fem.objects.gap import IN_PLACE, Pose
from softjaw.fem.pad.shape import PadShape
from softjaw.friction.frame import Frame, contact_frame, contact_length, in_frame
from softjaw.friction.patch import NEGLIGIBLE, ContactPatch, FloatArray, cross
from softjaw.friction.wrench import FrictionLimits, friction_limits, pure_torque
from softjaw.lsfit.ellipsoid import Ellipsoid, three_motion_ellipsoid
from softjaw.scoring.contact import SoftContact
from softjaw.study.case.result import UNDECIDED
from softjaw.study.flags import Flag, raised
from softjaw.study.quantities import MODELS, RIMS

X_OF_PAD = np.array([1.0, 0.0, 0.0])  # the contact frame's x axis follows the pad's long side
ANTIPODAL = np.radians(5.0)  # beyond this misalignment a flag says so


class Contact:
    """A contact patch and what friction can carry there: contact frame, friction limits and ellipsoid per model.

    ``patch``: faces in any frame; ``mu``: Coulomb friction coefficient [-]; ``pose``: of the patch's frame in the
    object's, by default they are the same; ``x_hint (3,)``: direction that becomes x of the contact frame;
    ``whole_face``: as in `friction.frame.contact_frame`.

    ``local`` is the patch in the contact frame and ``rho`` its length [m]; ``unit_limits`` are the friction limits for
    mu = 1, ``ellipsoids`` go through the three motions of ``limits``.

    Raises `NoContactError`, `ValueError`: for a patch without load or direction, and an ``x_hint`` along its normal.
    """

    def __init__(
        self,
        patch: ContactPatch,
        mu: float,
        pose: Pose = IN_PLACE,
        x_hint: ArrayLike = X_OF_PAD,
        whole_face: bool = False,
    ) -> None:
        self.patch, self.mu, self.pose = patch, mu, pose
        self.frame: Frame = contact_frame(patch, x_hint, whole_face)
        self.local: ContactPatch = in_frame(patch, self.frame)
        # what may fail is done here; what takes time waits until it is asked for
        self.rho = contact_length(self.local)

    @cached_property
    def unit_limits(self) -> dict[str, FrictionLimits]:
        """Friction limits for mu = 1, by friction model."""
        return {name: friction_limits(self.local, 1.0, name) for name in MODELS}

    @cached_property
    def limits(self) -> dict[str, FrictionLimits]:
        """Friction limits by friction model."""
        return {
            name: limits._replace(f_x=self.mu * limits.f_x, f_y=self.mu * limits.f_y, tau_z=self.mu * limits.tau_z)
            for name, limits in self.unit_limits.items()
        }

    @cached_property
    def ellipsoids(self) -> dict[str, Ellipsoid]:
        """Ellipsoid through the three motions of the limits, by friction model, per unit of S."""
        return {name: three_motion_ellipsoid(*limits.per_unit_force, self.rho) for name, limits in self.limits.items()}

    @cached_property
    def tau_pure(self) -> float:
        """Largest torque without a net force in the curved model [N m]."""
        return pure_torque(self.local, self.mu)

    @property
    def origin(self) -> FloatArray:
        """Origin of the contact frame in the object's frame ``(3,)`` [m]."""
        return self.pose.to_object(self.frame.origin[None])[0]

    @property
    def axes(self) -> FloatArray:
        """Rows x, y, N of the contact frame in the object's frame ``(3, 3)``."""
        return self.frame.axes @ self.pose.rotation.T

    @property
    def normal(self) -> FloatArray:
        """Contact normal, into the object, in the object's frame ``(3,)``."""
        return self.pose.rotation @ self.frame.axes[2]

    @property
    def pressure_wrench(self) -> FloatArray:
        """Force and torque ``(6,)`` of the pressure on the object, about its frame's origin [N, N m]."""
        force = self.patch.load[:, None] * self.patch.normal @ self.pose.rotation.T
        arm = self.pose.to_object(self.patch.centroid)
        return np.concatenate([force.sum(axis=0), cross(arm, force).sum(axis=0)])

    def drive(self, pressure: FloatArray) -> FloatArray:
        """Force ``(3,)`` of the gripper, along the approach in the object's frame, by the `pressure_wrench` [N]."""
        approach = self.pose.rotation[:, 2]
        return (pressure[:3] @ approach) * approach

    @property
    def loaded(self) -> NDArray[np.bool_]:
        """Which faces of the patch carry load ``(n,)``."""
        return self.patch.pressure > NEGLIGIBLE * self.patch.pressure.max(initial=0.0)

    @property
    def area(self) -> float:
        """Area of the loaded faces [m^2]."""
        return float(self.patch.area[self.loaded].sum())

    @property
    def largest_pressure(self) -> float:
        """Largest pressure of a face [Pa]."""
        return float(self.patch.pressure.max())

    def at(self, pose: Pose) -> Self:
        """The same contact elsewhere on the object."""
        # A shallow copy keeps what was computed already, none of which depends on the place.
        other = copy(self)
        other.pose = pose
        return other

    def soft(self, body: Any) -> SoftContact:
        """The contact as a score takes it, with a limit surface in ``(f_x, f_y, tau_z)``."""
        return SoftContact(self.origin, self.axes, body)


def angle(u: FloatArray, v: FloatArray) -> float:
    """Angle between two vectors [rad]; an arc cosine near 1 would know 8 digits."""
    n = cross(u, v)
    return math.atan2(math.sqrt(n @ n), u @ v)


def angles(first: Contact, second: Contact) -> tuple[float, float]:
    """How far the contacts are from antipodal [rad]: between their normals, and between their line and each normal."""
    line = second.origin - first.origin
    return angle(first.normal, -second.normal), max(angle(first.normal, line), angle(second.normal, -line))


def slips(lean: float, mu: float) -> bool:
    """Whether the line of the contacts, which leans by so much [rad], leaves a friction cone."""
    # Just below a right angle, beyond which the tangent would change its sign.
    return bool(np.tan(min(lean, 1.57)) > mu + UNDECIDED)


def pose_flags(contacts: Sequence[Contact]) -> Flag:
    """Flags of how two contacts stand, and of their frames."""
    first, second = contacts
    normals, line = angles(first, second)
    flags = Flag.NOT_ANTIPODAL * (max(normals, line) > ANTIPODAL - UNDECIDED)
    flags |= Flag.SLIPS * slips(line, first.mu)
    for c in contacts:
        flags |= raised(c.frame.flag)
    return flags


def topology(pressure: ArrayLike, faces: tuple[int, int]) -> dict[str, int]:
    """Pieces, holes and loaded rims of a patch.

    ``pressure`` (n,) array: of all faces of the pad, those across its width running fastest; without pressure a face is
    not loaded. ``faces`` (int, int): faces along the pad's length and across its width. Returns ``pieces`` (faces that
    touch at a corner belong together), ``holes`` (not loaded, with load all round) and ``rims``, a sum of
    `study.quantities.RIMS`.

    >>> topology([1, 1, 1, 1, 0, 1, 1, 1, 1, 0, 0, 0], (4, 3))
    {'pieces': 1, 'holes': 1, 'rims': 13}
    """
    p = np.asarray(pressure, float).reshape(faces)
    # share of the largest pressure, up to which a face is not loaded: rounding must not make pieces
    loaded = p > 1e-6 * p.max()
    pieces = ndimage.label(loaded, np.ones((3, 3)))[1]
    # Padded, so that all that is not loaded and reaches a rim is one region, which is no hole.
    holes = ndimage.label(np.pad(~loaded, 1, constant_values=True))[1] - 1
    rows = (loaded[0], loaded[-1], loaded[:, 0], loaded[:, -1])
    rims = sum(bit for bit, row in zip(RIMS, rows, strict=True) if row.any())
    return {"pieces": pieces, "holes": holes, "rims": rims}


def of_fingers(contacts: Sequence[Any], faces: tuple[int, int]) -> dict[str, list[int]]:
    """`topology` of the patches of both fingers, keyed as in ``study.quantities``."""
    fingers = [topology(contact.patch.pressure, faces) for contact in contacts]
    return {f"fingers/{name}": [finger[name] for finger in fingers] for name in ("pieces", "holes", "rims")}


def on_faces(contact: Any, shape: PadShape) -> dict[str, FloatArray]:
    """Patch of a contact on the faces of a pad with the scene's mesh, keyed as a file has it."""
    patch, pad = contact.patch, contact.state.pad
    if pad.shape == shape:
        return {name: getattr(patch, name) for name in ("pressure", "area", "centroid", "normal")}
    edges = [[_edges(mesh, axis, pad.side_weights) for axis in (0, 1)] for mesh in (pad.shape, shape)]
    return joined(patch, *(_shares(*lines) for lines in zip(*edges, strict=True)))


def joined(patch: ContactPatch, along: FloatArray, across: FloatArray) -> dict[str, FloatArray]:
    """A patch on other faces, which get shares ``(faces, faces of the patch)`` of its own along length and width.

    Loads and areas are divided by these, so that sums over the patch, and moments of its loads, stay as they are;
    position and normal are means by load, or by area where there is none.
    """

    def summed(values: FloatArray) -> FloatArray:
        lines = (along @ values.reshape(along.shape[1], -1)).reshape(len(along), across.shape[1], -1)
        return (across @ lines).reshape(-1, *values.shape[1:])

    def mean(values: FloatArray) -> FloatArray:
        by_load, by_area = summed(forces[:, None] * values), summed(patch.area[:, None] * values)
        return np.where(load[:, None] > 0, by_load / np.where(load > 0, load, 1.0)[:, None], by_area / area[:, None])

    forces = patch.pressure * patch.area
    load, area = summed(forces), summed(patch.area)
    normal = mean(patch.normal)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    # where those on both sides of an edge cancel, the approach is between them
    normal = np.where(length > 0, normal / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])
    return {"pressure": load / area, "area": area, "centroid": mean(patch.centroid), "normal": normal}


def _edges(shape: PadShape, axis: int, weights: FloatArray) -> FloatArray:
    """Edges of the faces of a patch along an axis of the undeformed pad [m]."""
    lines = shape.lines(axis, False)
    inside = lines[:-1, None] + np.diff(lines)[:, None] * (np.cumsum(weights) - weights)
    return np.append(inside.ravel(), lines[-1])


def _shares(edges: FloatArray, others: FloatArray) -> FloatArray:
    """Which part ``(n, m)`` of each of ``m`` intervals between edges lies in each of ``n`` between others."""
    low, high = np.maximum(edges[:-1], others[:-1, None]), np.minimum(edges[1:], others[1:, None])
    parts = np.maximum(high - low, 0.0)
    return parts / parts.sum(axis=0)
