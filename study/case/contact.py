"""One finger's contact at one force, how two of them stand to each other, and what the reader should know."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.contact.extract import extract
from softjaw.fem.contact.press import Pressed
from softjaw.friction.frame import Frame, contact_frame, contact_length, in_frame
from softjaw.friction.patch import ContactPatch
from softjaw.friction.torque import pure_torque
from softjaw.friction.wrench import FrictionLimits, friction_limits
from softjaw.lsfit.ellipsoid import Ellipsoid, three_motion_ellipsoid
from softjaw.scoring.score import ScoreFlag
from softjaw.study.case.model import Finger
from softjaw.study.flags import Flag, raised
from softjaw.study.quantities import MODELS
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]
X_OF_PAD = np.array([1.0, 0.0, 0.0])  # the contact frame's x axis follows the pad's long side
ANTIPODAL = np.radians(5.0)  # beyond this misalignment a flag says so
ALIKE = 1e-6  # rad, a slope, or of a length: what is nearer to a limit is undecided
LOADED = 1e-9  # of the largest pressure, below which a face carries no load
OVERLAP = 0.1  # of the travel, beyond which the mesh is coarse for the contact
FEW_ELEMENTS, NARROW = 6, 2  # loaded ones in all, and along length or width, below which it is coarse too
LOCKING = 0.45  # Poisson's ratio above which trilinear elements are too stiff


class Contact:
    """One finger at one force: patch in the pad's frame, contact frame, friction limits and ellipsoid per model.

    ``seen`` brings the patch of the state into the finger's own frame where another one was solved. ``unit_limits`` are
    the friction limits for mu = 1, ``ellipsoids`` go through the three motions of ``limits``.
    """

    def __init__(
        self,
        scene: Scene,
        finger: Finger,
        state: Pressed,
        seen: Callable[[ContactPatch], ContactPatch] | None = None,
    ) -> None:
        self.finger, self.state, self.symmetry = finger, state, state.pad.symmetry
        self.nodal_instead = state.pad.contact != scene.accuracy.contact
        patch = extract(state.pad, state)
        self.patch: ContactPatch = seen(patch) if seen else patch
        self.frame: Frame = contact_frame(self.patch, X_OF_PAD, whole_face=True)
        self.local: ContactPatch = in_frame(self.patch, self.frame)
        self.rho = contact_length(self.local)
        mu = scene.friction.mu
        self.unit_limits: dict[str, FrictionLimits] = {name: friction_limits(self.local, 1.0, name) for name in MODELS}
        self.limits: dict[str, FrictionLimits] = {
            name: replace(found, f_x=mu * found.f_x, f_y=mu * found.f_y, tau_z=mu * found.tau_z)
            for name, found in self.unit_limits.items()
        }
        self.tau_pure = pure_torque(self.local, mu)
        self.ellipsoids: dict[str, Ellipsoid] = {
            name: three_motion_ellipsoid(*found.per_unit_force, self.rho) for name, found in self.limits.items()
        }

    def of(self, finger: Finger) -> Contact:
        """The same contact of another finger, which stands where the object looks the same."""
        other = copy(self)
        other.finger = finger
        return other

    @property
    def origin(self) -> FloatArray:
        """Origin of the contact frame in the object's frame ``(3,)`` [m]."""
        return self.finger.pose.to_object(self.frame.origin[None])[0]

    @property
    def axes(self) -> FloatArray:
        """Rows x, y, N of the contact frame in the object's frame ``(3, 3)``."""
        return self.frame.axes @ self.finger.pose.rotation.T

    @property
    def normal(self) -> FloatArray:
        """Contact normal, into the object, in the object's frame ``(3,)``."""
        return self.finger.pose.rotation @ self.frame.axes[2]

    @property
    def loaded(self) -> NDArray[np.bool_]:
        """Which faces of the patch carry load ``(n,)``."""
        return self.patch.pressure > LOADED * self.patch.pressure.max(initial=0.0)

    @property
    def coarse(self) -> bool:
        """Whether the mesh is coarse for this contact, or its elements are too stiff for the foam."""
        shape, law = self.state.pad.shape, self.state.pad.material
        (n, m, _), k = shape.elements, shape.per_side
        loaded = self.loaded.reshape(n, k, m, k)
        widths = [np.count_nonzero(loaded.any(axes)) for axes in ((1, 2, 3), (0, 1, 3))]
        few = np.count_nonzero(loaded) / k**2 < FEW_ELEMENTS or min(widths) < NARROW
        overlaps = self.state.checks.overlap > OVERLAP * self.state.travel
        return bool(overlaps or few or (shape.element == "hex8" and law.poisson_ratio > LOCKING))

    @property
    def free_front(self) -> float:
        """How far the unloaded part of the front has come beyond first touch [m]."""
        return float(self.patch.centroid[self.patch.pressure == 0, 2].max(initial=0.0))


def angles(one: Contact, two: Contact) -> tuple[float, float]:
    """How far the contacts are from antipodal [rad]: between their normals, and between their line and each normal."""

    def between(u: FloatArray, v: FloatArray) -> float:
        return float(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))  # an arc cosine near 1 knows 8 digits

    line = two.origin - one.origin
    return between(one.normal, -two.normal), max(between(one.normal, line), between(two.normal, -line))


def flags(contacts: Sequence[Contact], mu: float, score_flag: ScoreFlag) -> Flag:
    """Flags of a case, ``score_flag`` being that of its score."""
    one, two = contacts
    normals, line = angles(one, two)
    between_fronts = float((two.finger.pose.origin - one.finger.pose.origin) @ one.finger.pose.rotation[:, 2])
    found = raised(score_flag)
    found |= Flag.ASKEW * (max(normals, line) > ANTIPODAL - ALIKE)
    found |= Flag.SLIPS * (np.tan(min(line, 1.57)) > mu + ALIKE)
    found |= Flag.OVERLAP * (one.free_front + two.free_front > between_fronts * (1.0 - ALIKE))
    found |= Flag.UNSTABLE * (min(c.state.checks.acoustic for c in contacts) <= 0)
    found |= Flag.JUMPED * any(c.state.path_dependent for c in contacts)
    for c in contacts:
        found |= raised(c.frame.flag) | Flag.NODAL * c.nodal_instead | Flag.COARSE * c.coarse
    return found
