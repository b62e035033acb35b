"""One finger's contact at one force, how two of them stand to each other, and what the reader should know."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from fem.extract import extract
from fem.press import Pressed
from friction.frame import Frame, contact_frame, contact_length, in_frame
from friction.patch import ContactPatch
from friction.torque import pure_torque
from friction.wrench import FrictionLimits, friction_limits
from lsfit.ellipsoid import Ellipsoid, three_motion_ellipsoid
from study.case.model import Finger
from study.scene import Scene
from study.storage.quantity import MODELS

FloatArray = NDArray[np.float64]
X_OF_PAD = np.array([1.0, 0.0, 0.0])  # the contact frame's x axis follows the pad's long side
ANTIPODAL = np.radians(5.0)  # beyond this misalignment a flag says so
OVERLAP = 0.1  # of the travel, beyond which the mesh is coarse for the contact
FEW_ELEMENTS, NARROW = 6, 2  # loaded ones in all, and along length or width, below which it is coarse too
LOCKING = 0.45  # Poisson's ratio above which trilinear elements are too stiff
FRAME_FLAGS = 4  # factor that puts the frame's flags above the score's
NOT_ANTIPODAL, NODAL_INSTEAD, SLIPS, PADS_MEET, COARSE = (256 << k for k in range(5))  # as in storage.quantities
UNSTABLE, PATH = 131072, 262144
REMARKS = {  # the most important ones first: a stored message has an end
    UNSTABLE: "foam lost ellipticity, strains may localise",
    PATH: "the pad jumped on the way to this force, the state depends on the load path",
    SLIPS: "the line between the contacts leaves a friction cone, the grasp slips",
    NOT_ANTIPODAL: "contacts more than 5 deg from antipodal",
    PADS_MEET: "the pads run into each other beside the object, which is not simulated",
    COARSE: "the mesh is coarse for this contact",
    NODAL_INSTEAD: "weighted gaps had no solution, nodal gaps were taken",
    1 | 2: "a contact carries no torque, or no force along an axis",
    8192: "the wall has snapped in",
    16384: "the object slides out of the grasp along its axis",
    32768: "the wall yields, the dent stays",
    65536: "a limit surface could not be fitted, the ellipsoid from three motions stands in",
}


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
        self.frame: Frame = contact_frame(self.patch, X_OF_PAD)
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
    def coarse(self) -> bool:
        """Whether the mesh is coarse for this contact, or its elements are too stiff for the foam."""
        shape, law = self.state.pad.shape, self.state.pad.material
        (n, m, _), k = shape.elements, shape.per_side
        loaded = self.patch.pressure.reshape(n, k, m, k) > 0
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
        return float(np.arccos(np.clip(u @ v / (np.linalg.norm(u) * np.linalg.norm(v)), -1.0, 1.0)))

    line = two.origin - one.origin
    return between(one.normal, -two.normal), max(between(one.normal, line), between(two.normal, -line))


def flags(contacts: Sequence[Contact], mu: float, score_flag: int) -> int:
    """Flags of a case, added up as ``study.storage.quantities`` defines them."""
    one, two = contacts
    normals, line = angles(one, two)
    between_fronts = float((two.finger.pose.origin - one.finger.pose.origin) @ one.finger.pose.rotation[:, 2])
    found = score_flag
    found |= NOT_ANTIPODAL * (max(normals, line) > ANTIPODAL)
    found |= SLIPS * (np.tan(min(line, 1.57)) > mu + 1e-9)
    found |= PADS_MEET * (one.free_front + two.free_front > between_fronts)
    found |= UNSTABLE * (min(c.state.checks.acoustic for c in contacts) <= 0)
    found |= PATH * any(c.state.path_dependent for c in contacts)
    for c in contacts:
        found |= FRAME_FLAGS * int(c.frame.flag) | NODAL_INSTEAD * c.nodal_instead | COARSE * c.coarse
    return int(found)


def remark(flagged: int) -> str:
    """What the reader should know about a valid result, always in the same words, so that remarks can be counted."""
    return "; ".join(text for mask, text in REMARKS.items() if flagged & mask)
