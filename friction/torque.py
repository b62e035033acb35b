"""Largest torque that a contact carries while it transmits no net force in its plane."""

from __future__ import annotations

import numpy as np

from softjaw.friction.patch import CANCEL, ContactPatch, FloatArray, NoContactError
from softjaw.friction.wrench import checked_mu, friction_sums, model_faces


def pure_torque(patch: ContactPatch, mu: float, model: str = "ccm", tolerance: float = 1e-9) -> float:
    """Torque limit at zero net force: the least ``H(v_x, v_y, 1)`` over all sliding velocities.

    `FrictionLimits.tau_z` is the largest torque about the origin whatever force comes with it; on asymmetric patches
    this one is smaller. The function is convex and has kinks at face centres (flat patch: its minimiser is the median
    of the faces, weighted with their loads), so it is minimised by shrinking ellipses, which need no smoothness and
    bound the error left.

    Parameters
    ----------
    patch : ContactPatch
        ``n`` faces in the contact frame.
    mu : float
        Coulomb friction coefficient [-].
    model : str
        ``ccm``, ``pcm`` or ``pcm_projected``.
    tolerance : float
        Bound of the error, relative to the torque about the origin [-].

    Returns
    -------
    float
        Torque [N m].
    """
    mu = checked_mu(mu)
    arm, normal, load = model_faces(patch, model)
    size = 2.0 ** np.frexp(np.abs(arm).max())[1]  # lengths are divided by a power of two, which rounds nothing
    arm, radius = arm / size, _radius(patch) / size
    twist, sums = np.array([[0.0, 0.0, 0.0, 0.0, 0.0, 1.0]]), np.empty((1, 7))
    # the first ellipse is a circle that must hold the minimiser
    v, P, best, limit = np.zeros(2), np.eye(2) * radius**2, np.inf, 0.0
    for cut in range(2000):
        twist[0, :2] = v
        friction_sums(arm, normal, load, twist, sums)
        T, g = sums[0, 6], sums[0, :2]
        best, limit = min(best, T), limit if cut else tolerance * T
        width = np.sqrt(max(g @ P @ g, 0.0))
        # the function is convex: nowhere in the ellipse is it below the tangent plane's lowest point
        if T - width >= best - limit:
            return float(mu * size * best)
        v, P = _smaller_ellipse(v, P, g / width, (T - best) / width)
    raise ArithmeticError(f"pure torque not found to {tolerance:g} after {cut + 1} cuts: ask for a larger tolerance")


def _radius(patch: ContactPatch) -> float:
    """Radius around the origin that holds every centre of rotation no worse than the origin itself [m]."""
    r, upright = np.linalg.norm(patch.centroid, axis=1), np.abs(patch.normal[:, 2])
    # farther out every face costs at least its upright share of the distance, more than at the origin
    weight = patch.load @ upright
    if weight <= CANCEL * patch.load.sum():
        raise NoContactError("all faces stand parallel to the contact normal: bring the patch into its contact frame")
    return float(patch.load @ (r * (1 + upright)) / weight)


def _smaller_ellipse(v: FloatArray, P: FloatArray, g: FloatArray, depth: float) -> tuple[FloatArray, FloatArray]:
    """Least ellipse around the part of ``(x - v)' P^-1 (x - v) <= 1`` where ``g . (x - v) <= -depth`` (g' P g = 1)."""
    Pg = P @ g
    tau, delta, sigma = (1 + 2 * depth) / 3, 4 / 3 * (1 - depth**2), 2 * (1 + 2 * depth) / (3 * (1 + depth))
    return v - tau * Pg, delta * (P - sigma * np.outer(Pg, Pg))
