"""Friction wrench of a contact patch for given slip motions, and the largest friction it can carry.

All quantities follow the *load convention*: the wrench is the one that drives the motion, so ``w . t >= 0``; the
friction that the patch returns is ``-w``. (The paper prints the force of the friction beside the torque of the load;
limit surfaces of asymmetric patches need one sign for both.)

Models, as limit surfaces ``projected`` lies inside ``curved`` lies inside ``flat``, face by face:

=========== ==================== ================ ==========================================
model       normal of a face     load of a face   arm of a face
=========== ==================== ================ ==========================================
curved      its own              p a              its position (x, y, z)
flat        contact normal       p a              (x, y, 0): the paper's planar model
projected   contact normal       p a abs(n_z)     (x, y, 0)
unrolled    contact normal       p a              arc lengths (x, y, 0), given by the caller
=========== ==================== ================ ==========================================

Reference: Xu, Alt, Zhang, Steinbach, "Grasping Posture Estimation for a Two-Finger Parallel Gripper with Soft Material
Jaws using a Curved Contact Area Friction Model".
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from softjaw.friction.kernel import friction_sums
from softjaw.friction.motion import SLIDE_X, SLIDE_Y, TURN_Z
from softjaw.friction.patch import CANCEL, ContactPatch, FloatArray

Model = Literal["ccm", "pcm", "pcm_projected", "unrolled"]
MODELS: tuple[str, ...] = get_args(Model)


@dataclass(frozen=True)
class FrictionLimits:
    """Largest friction of a contact in its frame, and the normal forces to judge it by.

    Parameters
    ----------
    f_x, f_y : float
        Largest force along x and along y [N].
    tau_z : float
        Largest torque about z through the origin [N m].
    S : float
        Sum of the pressures times areas, the paper's normal force [N].
    F_N : float
        Resultant along the contact normal, the force of the gripper [N].
    e_n : float
        Eccentricity parameter ``tau_z / (mu S)``, a length that does not depend on ``mu`` [m].
    """

    f_x: float
    f_y: float
    tau_z: float
    S: float
    F_N: float
    e_n: float

    @property
    def e_n_projected(self) -> float:
        """Eccentricity parameter ``tau_z / (mu F_N)`` [m]; NaN if the normals cancel to `CANCEL` of S or less."""
        return self.e_n * self.S / self.F_N if self.F_N > CANCEL * self.S else math.nan

    @property
    def per_unit_force(self) -> tuple[float, float, float]:
        """``(f_x, f_y, tau_z) / S``, the semi-axes of the limit surface per newton [-, -, m]."""
        return self.f_x / self.S, self.f_y / self.S, self.tau_z / self.S


def friction_wrench(
    patch: ContactPatch, twist: ArrayLike, mu: float, model: Model = "ccm", unrolled: ArrayLike | None = None
) -> FloatArray:
    """Total friction wrench on the patch for each slip motion, Eqs. (6)-(8), in the load convention.

    Every face resists with ``mu p a`` against the part of its velocity that lies in its own plane. A face at rest, or
    one that moves along its normal, contributes nothing: the centre of its disc of possible forces.

    Parameters
    ----------
    patch : ContactPatch
        ``n`` faces in the contact frame.
    twist : (m, 3) or (m, 6) array
        Slip motions ``[v_x, v_y, omega_z]`` or ``[v, omega]`` of the origin; only the direction matters.
    mu : float
        Coulomb friction coefficient [-].
    model : str
        ``curved``, ``flat``, ``projected`` or ``unrolled``.
    unrolled : (n, 2) array, optional
        Arc-length coordinates of the faces, for the model of that name [m].

    Returns
    -------
    (m, 6) array
        ``[f_x, f_y, f_z, tau_x, tau_y, tau_z]`` about the origin [N, N m]; the paper's limit surface lives in
        columns 0, 1, 5.

    Examples
    --------
    >>> patch = ContactPatch([[0.1, 0, 0], [-0.1, 0, 0]], [1e-4] * 2, [[0, 0, 1]] * 2, [1e4] * 2)
    >>> friction_wrench(patch, TURN_Z, mu=0.5).round(12)[0, 5]
    0.1
    """
    return checked_mu(mu) * _sums(patch, twist, model, unrolled)[0][:, :6]


def friction_support(
    patch: ContactPatch, twist: ArrayLike, mu: float, model: Model = "ccm", unrolled: ArrayLike | None = None
) -> FloatArray:
    """Power ``H(t) = w(t) . t = mu sum p a |P v|`` that friction takes from each motion, ``(m,)`` [W].

    ``H`` is the support function of the limit surface. Its values at the unit motions are the exact maxima of force
    and torque (principle of maximum dissipation), so those need no search. Parameters as in `friction_wrench`.
    """
    sums, scale = _sums(patch, twist, model, unrolled)
    return checked_mu(mu) * scale * sums[:, 6]


def friction_limits(
    patch: ContactPatch, mu: float, model: Model = "ccm", unrolled: ArrayLike | None = None
) -> FrictionLimits:
    """Largest forces along x and y and largest torque about z, from three motions; see `friction_wrench`."""
    f_x, f_y, tau_z = friction_support(patch, np.stack([SLIDE_X, SLIDE_Y, TURN_Z]), 1.0, model, unrolled).tolist()
    faces = patch.loaded
    S, F_N = float(faces.load.sum()), float((faces.load * faces.normal[:, 2]).sum())
    mu = checked_mu(mu)
    return FrictionLimits(mu * f_x, mu * f_y, mu * tau_z, S, F_N, tau_z / S)


def model_faces(
    patch: ContactPatch, model: Model, unrolled: ArrayLike | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arms ``(3, n)``, unit normals ``(3, n)`` and loads ``(n,)`` of the loaded faces, as the model sees them.

    Parameters as in `friction_wrench`; faces that carry no force are left out.
    """
    if model not in MODELS:
        raise ValueError(f"model is {model!r}: choose one of {', '.join(MODELS)}")
    keep = patch.load > 0
    arm, normal, load = patch.centroid[keep].T.copy(), patch.normal[keep].T.copy(), patch.load[keep]
    if model == "ccm":
        return arm, normal, load
    if model == "pcm_projected":
        load = load * np.abs(normal[2])
    if model == "unrolled":
        arc = np.asarray(unrolled, float)
        if arc.shape != (len(keep), 2) or not np.isfinite(arc).all():
            raise ValueError(
                f"unrolled must hold finite arc lengths of shape {(len(keep), 2)}, found shape {arc.shape}"
            )
        arm[:2] = arc[keep].T
    arm[2] = 0.0
    normal[:] = np.array([[0.0], [0.0], [1.0]])
    return arm, normal, load


def checked_mu(mu: float) -> float:
    """Friction coefficient, refused if it is negative or not finite."""
    if not 0 <= mu < math.inf:
        raise ValueError(f"mu is {mu}: the friction coefficient must be finite and not negative")
    return float(mu)


def _sums(
    patch: ContactPatch, twist: ArrayLike, model: Model, unrolled: ArrayLike | None
) -> tuple[FloatArray, FloatArray]:
    """Kernel sums ``(m, 7)`` for motions scaled by ``1 / scale``, and ``scale (m,)``."""
    arm, normal, load = model_faces(patch, model, unrolled)
    t = _six(twist)
    # Powers of two: they keep the squares of tiny and huge velocities in range and round nothing.
    reach = np.abs(arm).max()
    size = np.maximum(np.abs(t[:, :3]).max(axis=1, initial=0), reach * np.abs(t[:, 3:]).max(axis=1, initial=0))
    scale = np.ldexp(1.0, np.frexp(size)[1])
    out = np.empty((len(t), 7))
    friction_sums(arm, normal, load, t / scale[:, None], out)
    return out, scale


def _six(twist: ArrayLike) -> FloatArray:
    t = np.atleast_2d(np.asarray(twist, float))
    if t.ndim != 2 or t.shape[1] not in (3, 6):
        raise ValueError(f"twist has shape {t.shape}, expected (m, 3) [v_x, v_y, omega_z] or (m, 6) [v, omega]")
    if not np.isfinite(t).all():
        k = int(np.argmin(np.isfinite(t).all(axis=1)))
        raise ValueError(
            f"twist[{k}] is {t[k].tolist()}: write a translation as omega = 0, not as a far centre of rotation"
        )
    if t.shape[1] == 6:
        return np.ascontiguousarray(t)
    six = np.zeros((len(t), 6))
    six[:, [0, 1, 5]] = t
    return six
