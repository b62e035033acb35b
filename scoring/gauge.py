"""How far the grasp wrench space of ellipsoidal contacts reaches along a wrench, with the direction that stops it.

A contact with the wrench map ``c, D`` (wrench of its normal force; root of its limit surface times its other columns)
carries ``lam c + D^T f`` with ``|f| <= lam``. The reach along ``w`` is a pair of convex programmes of one value,

    max s:  s w = sum_i lam_i c_i + D_i^T f_i      =      min sum_i s_i:  u . w = 1,  s_i >= c_i . u + |D_i u|,

with ``0 <= lam_i <= 1`` and ``s_i >= 0`` (L-infinity), ``sum_i lam_i <= 1`` and one common ``s`` (L1), or ``lam_i = 1``
and free ``s_i`` (normal forces fixed). `scoring.conic` solves the pair for many wrenches at once. Both sides are then
evaluated as they stand, so the bounds hold however well it converged.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.scoring.conic import cone_programme

FloatArray = NDArray[np.float64]

_ROUNDING = 1e-10  # what loads may miss of a wrench, and of their cones, relative to what they carry


class Gauge(NamedTuple):
    """Bounds on the reach along each wrench, and the directions that give the upper ones."""

    lower: FloatArray  # (m,)
    upper: FloatArray  # (m,)
    u: FloatArray  # (m, r), u . w = 1


def contact_support(c: FloatArray, D: FloatArray, u: FloatArray) -> FloatArray:
    """``c_i . u + |D_i u|`` for each direction and contact, ``(m, n)``."""
    return u @ c.T + np.linalg.norm(np.einsum("iad,md->mia", D, u), axis=2)


def joint_support(c: FloatArray, D: FloatArray, u: FloatArray, kind: str) -> FloatArray:
    """Support of the grasp wrench space, ``(m,)``; kind is "linf", "l1" or "fixed"."""
    h = contact_support(c, D, u)
    if kind == "fixed":
        return h.sum(axis=1)
    h = np.maximum(h, 0)
    return h.max(axis=1) if kind == "l1" else h.sum(axis=1)


def gauge(c: FloatArray, D: FloatArray, w: FloatArray, kind: str = "linf", tolerance: float = 1e-10) -> Gauge:
    """Largest ``s`` with ``s w`` in the grasp wrench space, between two bounds.

    Parameters
    ----------
    c, D : (n, r), (n, 3, r) array
        Contacts; together they must span the ``r`` dimensions.
    w : (m, r) array
        Wrenches, none of them 0.
    kind : str
        "linf", "l1" or "fixed"; the last gives the lower bound -inf if no multiple of the wrench was found held.
    tolerance : float
        Gap at which the programmes stop, relative to the value and to the contacts' supports for ``w / |w|^2``.
    """
    n, r = c.shape
    k = 1 if kind == "l1" else n
    L = np.zeros((n if kind == "fixed" else n + k, 4, r + k))  # (u, s) -> (s_i - c_i u, D_i u), and s_i
    L[:n, 0, :r], L[:n, 1:, :r] = -c, D
    L[np.arange(n), 0, r + np.arange(n) % k] = 1
    if kind != "fixed":
        L[n + np.arange(k), 0, r + np.arange(k)] = 1
    u0 = w / (w * w).sum(axis=1, keepdims=True)
    h = contact_support(c, D, u0)
    size = np.abs(h).max(axis=1, keepdims=True) + np.linalg.norm(D, axis=(1, 2)).max() * 1e-3
    s = h if kind == "fixed" else np.maximum(h, 0)
    v0 = np.hstack([u0, (s.max(axis=1, keepdims=True) if kind == "l1" else s) + size])
    B = np.zeros((len(w), r + k, r - 1 + k))  # steps that keep u . w = 1
    B[:, :r, : r - 1] = _across(w) * np.linalg.norm(u0, axis=1)[:, None, None]
    B[:, r:, r - 1 :] = np.eye(k)
    cost = np.concatenate([np.zeros(r - 1), np.ones(k)])
    G, inside = -np.einsum("iad,mde->miae", L, B), np.einsum("iad,md->mia", L, v0)
    x, z = cone_programme(cost, G, inside, tolerance * size[:, 0])
    u = u0 + np.einsum("mde,me->md", B, x)[:, :r]
    u = u / (u * w).sum(axis=1, keepdims=True)
    upper = joint_support(c, D, u, kind)
    lower = _reach(c, D, w, z[:, :n] * [1, -1, -1, -1], kind)
    return Gauge(np.minimum(lower, upper), upper, u)


def _reach(c: FloatArray, D: FloatArray, w: FloatArray, x: FloatArray, kind: str) -> FloatArray:
    """Reach along ``w`` of the loads ``x = (lam, f)``, ``(m, n, 4)``, once they are made to be in their cones."""
    lam, f = x[..., :1], x[..., 1:]
    lam = np.ones_like(lam) if kind == "fixed" else np.maximum(lam, 0)
    length = np.linalg.norm(f, axis=2, keepdims=True)
    f = f * np.minimum(1, lam / np.maximum(length, 1e-300))
    wrench = np.einsum("mi,ir->mr", lam[..., 0], c) + np.einsum("mia,iar->mr", f, D)
    s = (wrench * w).sum(axis=1) / (w * w).sum(axis=1)
    missing = np.linalg.norm(wrench - s[:, None] * w, axis=1)
    size = (lam[..., 0] * (np.linalg.norm(c, axis=1) + np.linalg.norm(D, axis=(1, 2)))).sum(axis=1)
    total = {"linf": lam.max(axis=(1, 2)), "l1": lam.sum(axis=(1, 2)), "fixed": np.ones(len(w))}[kind]
    failed = -np.inf if kind == "fixed" else 0.0
    return np.where(missing <= _ROUNDING * size, s / np.maximum(total, 1), failed)


def _across(w: FloatArray) -> FloatArray:
    """Orthonormal columns across each wrench, ``(m, r, r - 1)``, by a reflection that turns it to the first axis."""
    a = w / np.linalg.norm(w, axis=1, keepdims=True)
    a[:, 0] += np.copysign(1, a[:, 0])
    reflection = np.eye(w.shape[1]) - 2 * a[:, :, None] * a[:, None, :] / (a * a).sum(axis=1)[:, None, None]
    return reflection[:, :, 1:]
