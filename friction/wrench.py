"""Friction wrench of a contact patch for given slip motions, and the largest friction it can carry.

All quantities follow the *load convention*: the wrench is the one that drives the motion, so ``w . t >= 0``; the
friction that the patch returns is ``-w``. (The paper prints the force of the friction beside the torque of the load;
limit surfaces of asymmetric patches need one sign for both.)

Models, as limit surfaces ``pcm_projected`` lies inside ``ccm`` lies inside ``pcm``, face by face:

============= ==================== ================ ==========================================
model         normal of a face     load of a face   arm of a face
============= ==================== ================ ==========================================
ccm           its own              p a              its position (x, y, z)
pcm           contact normal       p a              (x, y, 0): the paper's planar model
pcm_projected contact normal       p a abs(n_z)     (x, y, 0)
============= ==================== ================ ==========================================

Reference: Xu, Alt, Zhang, Steinbach, "Grasping Posture Estimation for a Two-Finger Parallel Gripper with Soft Material
Jaws using a Curved Contact Area Friction Model".
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from softjaw.friction.motion import SLIDE_X, SLIDE_Y, TURN_Z
from softjaw.friction.patch import CANCEL, ContactPatch, FloatArray, cross

MODELS = ("ccm", "pcm", "pcm_projected")
SEARCH_WIDTH = 1e-3  # at which the search for the direction of the largest force ends [rad]


class FrictionLimits(NamedTuple):
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
        Eccentricity parameter ``tau_z / (mu S)``, Eq. (12), a length that does not depend on ``mu`` [m].
    e_n_ratio : float
        Eccentricity parameter ``tau_z / max f_t``, Eq. (11), with the largest force in the contact plane, in whichever
        direction; it does not depend on ``mu`` either [m].
    """

    f_x: float
    f_y: float
    tau_z: float
    S: float
    F_N: float
    e_n: float
    e_n_ratio: float

    @property
    def e_n_projected(self) -> float:
        """Eccentricity parameter ``tau_z / (mu F_N)`` [m]; NaN if the normals cancel to `CANCEL` of S or less."""
        return self.e_n * self.S / self.F_N if self.F_N > CANCEL * self.S else math.nan

    def less(self, used: ArrayLike) -> FrictionLimits:
        """What is left for holding where pressing has used the friction wrench ``used (3,)``, f_x, f_y and tau_z.

        Faces carry tractions ``q`` with ``|q| <= mu p``. With the tractions ``t`` of pressing a load can add what
        keeps ``|t + q|`` below that, so the set of all wrenches is shifted by that of ``-t``, and along an axis it
        reaches as far as before less ``|used|`` to the one side. What ``t`` balances among faces returns as all slip.
        """
        axes = (self.f_x, self.f_y, self.tau_z)
        f_x, f_y, tau_z = (max(0.0, limit - abs(float(u))) for limit, u in zip(axes, np.asarray(used), strict=True))
        share = tau_z / self.tau_z if self.tau_z > 0.0 else 1.0
        return self._replace(f_x=f_x, f_y=f_y, tau_z=tau_z, e_n=share * self.e_n)

    @property
    def per_unit_force(self) -> tuple[float, float, float]:
        """``(f_x, f_y, tau_z) / S``, the semi-axes of the limit surface per newton [-, -, m]."""
        return self.f_x / self.S, self.f_y / self.S, self.tau_z / self.S


def friction_wrench(patch: ContactPatch, twist: ArrayLike, mu: float, model: str = "ccm") -> FloatArray:
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
        ``ccm``, ``pcm`` or ``pcm_projected``.

    Returns
    -------
    (m, 6) array
        ``[f_x, f_y, f_z, tau_x, tau_y, tau_z]`` about the origin [N, N m]; the paper's limit surface lives in
        columns 0, 1, 5.

    Examples
    --------
    >>> patch = ContactPatch([[0.1, 0, 0], [-0.1, 0, 0]], [1e-4] * 2, [[0, 0, 1]] * 2, [1e4] * 2)
    >>> float(friction_wrench(patch, TURN_Z, mu=0.5).round(12)[0, 5])
    0.1
    """
    return checked_mu(mu) * _sums(patch, twist, model)[0][:, :6]


def friction_support(patch: ContactPatch, twist: ArrayLike, mu: float, model: str = "ccm") -> FloatArray:
    """Power ``H(t) = w(t) . t = mu sum p a |P v|`` that friction takes from each motion, ``(m,)`` [W].

    ``H`` is the support function of the limit surface. Its values at the unit motions are the exact maxima of force
    and torque (principle of maximum dissipation), so those need no search. Parameters as in `friction_wrench`.
    """
    sums, scale = _sums(patch, twist, model)
    return checked_mu(mu) * scale * sums[:, 6]


@lru_cache(maxsize=8)  # two contacts may share a patch, and payloads ask again for one
def friction_discs(patch: ContactPatch, mu: float, model: str = "ccm") -> FloatArray:
    """Discs ``(n, 6)`` whose sum is the limit surface in ``(f_x, f_y, tau_z)`` [N, N, N m], two half-axes of each.

    A face resists with any force of a disc in its own plane. Parameters as in `friction_wrench`.
    """
    arm, normal, load = model_faces(patch, model)
    # the axis that is farthest from the normal gives directions in the plane without cancellation
    other = np.eye(3)[np.abs(normal).argmin(axis=0)]
    first = cross(normal.T, other)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    axes = [np.column_stack([e[:, :2], arm[0] * e[:, 1] - arm[1] * e[:, 0]]) for e in (first, cross(normal.T, first))]
    return checked_mu(mu) * load[:, None] * np.hstack(axes)


def friction_limits(patch: ContactPatch, mu: float, model: str = "ccm") -> FrictionLimits:
    """Largest forces along x and y and largest torque about z, from three motions; see `friction_wrench`."""
    # for mu = 1, so that e_n, a length of the patch, does not change in its last bits with mu
    f_x, f_y, tau_z = friction_support(patch, np.stack([SLIDE_X, SLIDE_Y, TURN_Z]), 1.0, model).tolist()
    faces = patch.loaded
    S, F_N = float(faces.load.sum()), float((faces.load * faces.normal[:, 2]).sum())
    largest = max(f_x, f_y, _largest_force(patch) if model == "ccm" else 0.0)
    mu = checked_mu(mu)
    return FrictionLimits(mu * f_x, mu * f_y, mu * tau_z, S, F_N, tau_z / S, tau_z / largest)


def _largest_force(patch: ContactPatch) -> float:
    """Largest force ``max f_t`` in the contact plane over all motions, for ``mu = 1`` [N].

    It is the largest value of the support function over translations, whose direction is found on a grid that narrows
    round the best one, to `SEARCH_WIDTH`; the maximum is flat there, so that it is known to 1e-9 of itself.
    A planar contact carries the same in all directions and needs no search.
    """
    best, width, largest = 0.5 * math.pi, 0.5 * math.pi, 0.0
    while width > SEARCH_WIDTH:
        angles = best + width * np.linspace(-1.0, 1.0, 13)
        forces = friction_support(patch, np.column_stack([np.cos(angles), np.sin(angles), np.zeros(angles.size)]), 1.0)
        k = int(forces.argmax())
        best, width, largest = float(angles[k]), width / 6, max(largest, float(forces[k]))
    return largest


@lru_cache(maxsize=8)  # each limit asks for those of its patch some times
def model_faces(patch: ContactPatch, model: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Arms ``(3, n)``, unit normals ``(3, n)`` and loads ``(n,)`` of the loaded faces, as the model sees them.

    Parameters as in `friction_wrench`; faces that carry no force are left out.
    """
    # exactly: a face without load is what the data say, not what a calculation left
    keep = patch.load > 0
    arm, normal, load = patch.centroid[keep].T.copy(), patch.normal[keep].T.copy(), patch.load[keep]
    if model == "ccm":
        return arm, normal, load
    if model == "pcm_projected":  # abs: a face of an overhang presses, whichever way it looks
        load = load * np.abs(normal[2])
    arm[2] = 0.0
    normal[:] = np.array([[0.0], [0.0], [1.0]])
    return arm, normal, load


def checked_mu(mu: float) -> float:
    """Friction coefficient, refused if it is no number, negative or not finite."""
    if np.ndim(mu) or np.asarray(mu).dtype.kind not in "fiu" or not 0 <= mu < math.inf:
        raise ValueError(f"mu is {mu!r}: the friction coefficient must be one finite number and not negative")
    return float(mu)


def _sums(patch: ContactPatch, twist: ArrayLike, model: str) -> tuple[FloatArray, FloatArray]:
    """Kernel sums ``(m, 7)`` for motions scaled by ``1 / scale``, and ``scale (m,)``."""
    arm, normal, load = model_faces(patch, model)
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
        text = f"twist[{k}] is {t[k].tolist()}: write a translation as omega = 0, not as a far centre of rotation"
        raise ValueError(text)
    if t.shape[1] == 6:
        return np.ascontiguousarray(t)
    six = np.zeros((len(t), 6))
    six[:, [0, 1, 5]] = t
    return six


# Speed below which a face is at rest, for motions and arms that move no face faster than some 1: what rounding of both
# leaves of a speed of 0. Its force would have its full size and a direction of chance.
REST = 32 * 2.0**-52


# Reordering of sums lets the loop fill the vector registers. Not among the flags: nnan and ninf, which would allow the
# compiler to drop the test for a face at rest.
@njit(cache=True, fastmath={"reassoc", "contract", "arcp", "nsz"})
def friction_sums(arm, normal, load, twist, out):
    """Wrench and dissipation of unit friction for each motion.

    A face slides with ``c = n x v`` turned by a right angle in its plane, so ``|P v| = |c|`` and ``P v = c x n``: both
    are free of cancellation. The velocity is formed as a difference from the arm, which keeps its digits when the
    centre of rotation lies next to the face.

    ``arm, normal (3, n)`` and ``load (n,)`` are of the faces, ``twist (m, 6)`` is ``[v, omega]`` scaled so that the
    largest of ``v`` and of ``omega`` times ``arm`` is some 1; ``out (m, 7)`` receives force, torque and ``sum load |P
    v|``.
    """
    for k in range(twist.shape[0]):
        v0, v1, v2 = twist[k, 0], twist[k, 1], twist[k, 2]
        o0, o1, o2 = twist[k, 3], twist[k, 4], twist[k, 5]
        f0 = f1 = f2 = t0 = t1 = t2 = H = 0.0
        for i in range(load.size):
            x, y, z = arm[0, i], arm[1, i], arm[2, i]
            nx, ny, nz = normal[0, i], normal[1, i], normal[2, i]
            vx, vy, vz = v0 - o2 * y + o1 * z, v1 + o2 * x - o0 * z, v2 + o0 * y - o1 * x
            cx, cy, cz = ny * vz - nz * vy, nz * vx - nx * vz, nx * vy - ny * vx
            q = cx * cx + cy * cy + cz * cz
            s = load[i] / math.sqrt(q) if q > REST * REST else 0.0
            fx, fy, fz = s * (cy * nz - cz * ny), s * (cz * nx - cx * nz), s * (cx * ny - cy * nx)
            f0 += fx
            f1 += fy
            f2 += fz
            t0 += y * fz - z * fy
            t1 += z * fx - x * fz
            t2 += x * fy - y * fx
            H += s * q
        out[k, 0], out[k, 1], out[k, 2], out[k, 3], out[k, 4], out[k, 5], out[k, 6] = f0, f1, f2, t0, t1, t2, H


def pure_torque(patch: ContactPatch, mu: float, model: str = "ccm") -> float:
    """Torque limit at zero net force [N m]: the least ``H(v_x, v_y, 1)`` over all sliding velocities.

    `FrictionLimits.tau_z` is the largest torque about the origin whatever force comes with it; on asymmetric patches
    this one is smaller. The function is convex and has kinks at face centres (flat patch: its minimiser is the median
    of the faces, weighted with their loads), so it is minimised by shrinking ellipses, which need no smoothness and
    bound the error left: 1e-9 of the torque about the origin. Parameters as in `friction_wrench`.
    """
    mu = checked_mu(mu)
    arm, normal, load = model_faces(patch, model)
    size = 2.0 ** np.frexp(np.abs(arm).max())[1]  # lengths are divided by a power of two, which rounds nothing
    # centres of rotation outside this radius are worse than the origin: every face costs at least its upright share of
    # the distance, more than at the origin
    r, upright = np.linalg.norm(patch.centroid, axis=1), np.abs(patch.normal[:, 2])
    radius = float(patch.load @ (r * (1 + upright)) / (patch.load @ upright))
    least = _least_power(arm / size, normal, load, radius / size)
    if math.isnan(least):
        raise ArithmeticError("pure torque not found to 1e-9: the faces of the patch differ too much in size")
    return float(mu * size * least)


@njit(cache=True)
def _least_power(arm, normal, load, radius):
    """Least ``H(v_x, v_y, 1)`` of faces as `friction_sums` takes them, to 1e-9 of that about the origin; or NaN."""
    twist, sums = np.zeros((1, 6)), np.empty((1, 7))
    twist[0, 5] = 1.0
    # the first ellipse is a circle that must hold the minimiser
    v, P, best, limit = np.zeros(2), np.eye(2) * radius**2, np.inf, 0.0
    for cut in range(2000):
        twist[0, :2] = v
        friction_sums(arm, normal, load, twist, sums)
        T, g = sums[0, 6], sums[0, :2]
        best, limit = min(best, T), limit if cut else 1e-9 * T
        width = math.sqrt(max(g @ P @ g, 0.0))
        # the function is convex: nowhere in the ellipse is it below the tangent plane's lowest point
        if T - width >= best - limit:
            return best
        # the least ellipse round the part of this one where g . (x - v) <= -depth
        Pg, depth = P @ (g / width), (T - best) / width
        v = v - (1 + 2 * depth) / 3 * Pg
        for i in range(2):
            for j in range(2):
                P[i, j] -= 2 * (1 + 2 * depth) / (3 * (1 + depth)) * (Pg[i] * Pg[j])
        P *= 4 / 3 * (1 - depth**2)
    return math.nan
