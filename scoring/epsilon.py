"""Epsilon quality of any soft contacts in any pose: the weakest wrench that breaks the grasp, between two bounds.

Epsilon is the least support of the grasp wrench space over unit wrenches, a problem with many local minima. The upper
bound is the support for the weakest wrench found: from the directions the proof points to, or from many if those leave
a gap, the reach along ``u`` gives the facet it meets (`scoring.gauge`), whose own direction is weaker still, until
nothing changes. The lower bound is a proof that a ball fits, by a semidefinite programme; for two contacts it has
always met the upper bound so far. Where 0 is not an inner point epsilon is 0, exactly. That is decided by a convex
programme: either some wrench ``u`` has ``c_i . u + |D_i u| < 0`` for all contacts, or the contacts do not span all
wrenches.

The proof. The ball of radius ``r`` fits if ``sum_i s_i >= r |u|`` wherever ``s_i >= 0`` and ``l_i = (s_i - c_i . u,
D_i u)`` lies in the Lorentz cone. With ``v = (u, s)`` this holds if

    (sum_i s_i)^2 - r^2 |u|^2 = p(v) + non-negative multiples of products that are non-negative there,

with a positive semidefinite form ``p``. The products are ``s_i s_j``, the Lorentz square of ``l_i``, ``s_i (a . l_j)``
with ``a`` in the Lorentz cone, and ``l_i^T Z l_j`` with a matrix ``Z`` that is positive on pairs of Lorentz vectors.
A Lorentz vector of four is a Hermitian 2 x 2 matrix without negative eigenvalues, and forms positive on pairs of those
are sums of a positive 4 x 4 matrix and the partial transpose of another (E. Stoermer 1963, S. L. Woronowicz 1976), so
these ``Z`` are known completely. The largest ``r^2`` is found by Newton's method along a logarithmic barrier; every
point inside proves its own ``r``. The inverse of ``p`` tends to the moments of the weakest wrenches ``v``. Where the
proof leaves a gap the wrenches are split by a plane ``g . v = 0`` between those the moments mix up; on its sides
``g s_i``, ``g (a . l_i)`` and the products of several such forms are further products that are not negative.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.scoring.bodies import Body, ellipsoid_inside, is_ellipsoid, joined
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.gauge import LORENTZ, Bounds, cone_programme, contact_support, gauge
from softjaw.scoring.reach import reach

FloatArray = NDArray[np.float64]


NO_WRENCH = 1e-9  # relative to the largest wrench of a contact: what counts as none
_ROUNDS = 12  # of following a ray to its facet


def epsilon(
    contacts: Sequence[SoftContact],
    object_length: ArrayLike,
    contact_length: float,
    centre_of_mass: ArrayLike = (0.0, 0.0, 0.0),
    kind: str = "linf",
    tolerance: float = 1e-4,
) -> Bounds:
    """Radius of the largest ball around 0 in the grasp wrench space, for normal forces of at most one [-].

    Parameters
    ----------
    contacts : sequence of SoftContact
        One or more, in any pose.
    object_length : float or (3,) array
        As in `scoring.contact.SoftContact.wrench_map` [m].
    contact_length : float
        Lengths by which the torques of forces and those about the normals are divided [m]; epsilon depends on both.
    centre_of_mass : (3,) array
        Point about which torques are taken [m]; epsilon depends on it.
    kind : str
        "linf": every normal force is at most one; "l1": their sum is.
    tolerance : float
        Relative gap of the bounds to work for; an absolute one of 1e-6 is enough too.

    Notes
    -----
    The bounds hold up to rounding. A body that is no ellipsoid is replaced by an ellipsoid inside it for the lower
    bound, which leaves a gap as large as its fit error; the upper bound uses its own support.

    Examples
    --------
    >>> from softjaw.lsfit.ellipsoid import Ellipsoid
    >>> from softjaw.scoring.contact import SoftContact, contact_axes
    >>> body = Ellipsoid([1, 1, 0.2])
    >>> pads = [SoftContact([x, 0, 0], contact_axes([-x, 0, 0], [0, 0, 1]), body) for x in (-0.5, 0.5)]
    >>> round(epsilon(pads, 1.0, 1.0).upper, 6) == round(0.4 / 1.04**0.5, 6)
    True
    """
    if kind not in ("linf", "l1"):
        raise ValueError(f"kind is {kind!r}: take 'linf' or 'l1'")
    C = np.array([contact.wrench_map(object_length, contact_length, centre_of_mass) for contact in contacts])
    if not len(C):
        raise ValueError("contacts is empty: a grasp needs at least one contact")
    c, bodies = C[:, :, 0], [contact.body for contact in contacts]
    D = np.array([ellipsoid_inside(body) @ Ci[:, 1:].T for body, Ci in zip(bodies, C, strict=True)])
    exact = all(is_ellipsoid(body) for body in bodies)
    if (apart := separating_wrench(c, D)) is None:
        lower, upper, u = _between(c, D, kind, tolerance)
    else:
        lower, upper, u = 0.0, 0.0, apart
    # ellipsoids inside the bodies give lower bounds only
    if not exact:
        upper, u = _weakest_of_bodies(C, bodies, u, kind)
    return Bounds(min(lower, upper), upper, u)


def separating_wrench(c: FloatArray, D: FloatArray) -> FloatArray | None:
    """Unit wrench ``(6,)`` that no contact can resist at all, or None if 0 is an inner point of what they span."""
    n, size = len(c), np.abs(c).max()
    _, spread, V = np.linalg.svd(np.vstack([c, D.reshape(-1, 6)]))
    # if the wrenches span less than six dimensions, this direction is felt by no contact
    if len(spread) < 6 or spread[-1] <= NO_WRENCH * spread[0]:
        return V[-1]
    # least t with c_i u + |D_i u| <= t, force and torque of u of at most one
    G = np.zeros((1, n + 2, 4, 7))
    G[0, :n, 0, :6], G[0, :n, 1:, :6], G[0, :n, 0, 6] = c, -D, -1
    # force and torque are bounded apart because these cones have three components beside the first
    G[0, n, 1:, :3] = G[0, n + 1, 1:, 3:6] = -np.eye(3)
    h = np.zeros((1, n + 2, 4))
    h[0, :n, 0], h[0, n:, 0] = size, 1
    x, _ = cone_programme(np.eye(7)[6], G, h, np.array([1e-9 * size]))
    u = x[:, :6] / max(float(np.linalg.norm(x[:, :6])), 1e-300)
    return u[0] if contact_support(c, D, u).max() < -NO_WRENCH * size else None


def _between(c: FloatArray, D: FloatArray, kind: str, tolerance: float) -> tuple[float, float, FloatArray]:
    """Bounds of epsilon, closer than the tolerance unless that takes too many proofs."""
    proofs = [certified_radius(c, D, kind)]
    upper, u = _weakest(c, D, proofs[0].directions, kind, proofs[0].radius * (1 + tolerance / 10))
    for _ in range(16):
        # the bound is the smallest radius of all sides, so only a split of that one can raise it
        first = min(proofs, key=lambda proof: proof.radius)
        if upper <= first.radius * (1 + tolerance) + 1e-6:
            break
        # random starts are for the case of a gap, where the directions of the proof may have missed the weakest
        if len(proofs) == 1:
            many = np.random.default_rng(0).normal(size=(40, 6))
            upper, u = min((upper, u), _weakest(c, D, many, kind, first.radius), key=lambda pair: pair[0])
        proofs.remove(first)
        for side in (first.split, -first.split):
            proofs.append(certified_radius(c, D, kind, np.vstack([first.planes, side])))
            weakest = _weakest(c, D, proofs[-1].directions[:6], kind, first.radius)
            upper, u = min((upper, u), weakest, key=lambda pair: pair[0])
    return min(proof.radius for proof in proofs), upper, u


def _weakest(c: FloatArray, D: FloatArray, u: FloatArray, kind: str, enough: float) -> tuple[float, FloatArray]:
    """Least support found from the starts ``u``, and its unit wrench."""
    best, at = np.inf, u[0]
    for _ in range(_ROUNDS):
        # the facet that the ray meets is at most as far from 0 as the ray goes: the support does not rise
        u = gauge(c, D, u, kind).u
        u = u / np.linalg.norm(u, axis=1, keepdims=True)
        h = joined(contact_support(c, D, u).T, kind)
        before, k = best, h.argmin()
        if h[k] < best:
            best, at = float(h[k]), u[k]
        if best <= enough or before - best <= 1e-9 * best:
            break
    return best, at


def _weakest_of_bodies(C: FloatArray, bodies: Sequence[Body], u: FloatArray, kind: str) -> tuple[float, FloatArray]:
    """Least support of contacts with any bodies found from the start ``u (6,)``, and its unit wrench."""
    best, at = np.inf, u
    for _ in range(_ROUNDS):
        facet = reach(C, bodies, u, kind, tolerance=1e-5)
        length = float(np.linalg.norm(facet.u))
        u = facet.u / length
        if not facet.upper / length < best * (1 - 1e-6):
            break
        best, at = facet.upper / length, u
    return best, at


# in Pauli matrices Lorentz vectors are Hermitian ones without negative eigenvalues
_SIGMA = np.array([[[1, 0], [0, 1]], [[0, 1], [1, 0]], [[0, -1j], [1j, 0]], [[1, 0], [0, -1]]])
_PAIRS = np.einsum("apq,brs->abprqs", _SIGMA, _SIGMA).reshape(16, 4, 4)
_TRANSPOSED = np.array([1.0, 1.0, -1.0, 1.0])  # transposing a Hermitian matrix turns its second Pauli coordinate


class Proof(NamedTuple):
    """A radius proved up to rounding for the wrenches on one side of some planes, and what it leaves open."""

    radius: float
    directions: FloatArray  # (k, 6), candidates for the weakest wrench, unit vectors of both signs
    planes: FloatArray  # (p, 6 + k): the wrenches with planes @ v >= 0 were looked at
    split: FloatArray  # (6 + k,), a plane that would tell the candidates apart


def certified_radius(
    c: FloatArray, D: FloatArray, kind: str = "linf", planes: FloatArray | None = None, tolerance: float = 2e-6
) -> Proof:
    """Radius of a ball around 0 inside the grasp wrench space.

    Parameters
    ----------
    c, D : (n, 6), (n, 3, 6) array
        Contacts as in `scoring.gauge`; 0 has to be an inner point of their grasp wrench space.
    kind : str
        "linf" or "l1".
    planes : (p, 6 + k) array, optional
        Sides of planes, to which the proof is limited.
    tolerance : float
        Gap of the programme, relative to the radius squared, at which it stops.
    """
    programme = _Programme(c, D, kind, planes)
    x = before = programme.start()
    mu = 1.0
    for _ in range(300):
        try:
            step, decrement = programme.newton_step(x, mu)
        except np.linalg.LinAlgError:
            # inside its cones but for rounding: what the iterate before has proved stands
            x = before
            break
        length = 1.0 if np.isfinite(decrement) else 0.0
        while length > 1e-8 and not programme.inside(x + length * step):
            length *= 0.7
        if length <= 1e-8:
            break
        # a step cut at the boundary stops short of it, where the next Hessian would be singular
        before, x = x, x + (length if length == 1 else 0.9 * length) * step
        # from this decrement on the iterate is near the central path, and mu may shrink
        if decrement < 0.5:
            # on the central path the gap is mu times the parameter of the barrier
            if mu * programme.parameter <= tolerance * max(x[0], 1e-9):
                break
            mu *= 0.2
    return Proof(float(np.sqrt(max(x[0], 0.0))), *programme.outlook(x))


class _Programme:
    """Maximise ``x_0 = r^2`` subject to ``A0 + sum_k x_k A_k`` and the multipliers staying in their cones."""

    def __init__(self, c: FloatArray, D: FloatArray, kind: str, planes: FloatArray | None) -> None:
        n = len(c)
        k = 1 if kind == "l1" else n
        d = 6 + k
        s = np.eye(k, d, 6)
        L = np.zeros((n, 4, d))
        L[:, 0, :6], L[:, 1:, :6] = -c, D
        L[:, 0] += s[np.arange(n) % k]
        self.planes = np.zeros((0, d)) if planes is None else planes
        lines = np.vstack([s, self.planes])
        squares = np.einsum("a,iad,iae->ide", LORENTZ, L, L)
        pairs = [np.outer(g, s_) for i, g in enumerate(lines) for s_ in lines[:i]]
        groups = [
            np.diag([1.0] * 6 + [0.0] * k)[None],
            squares,
            np.reshape(pairs, (-1, d, d)),
            np.einsum("id,jae->ijade", lines, L).reshape(-1, d, d),
            *(
                np.einsum("ad,be,b->abde", L[i], L[j], flip).reshape(16, d, d)
                for i in range(n)
                for j in range(i)
                for flip in (np.ones(4), _TRANSPOSED)
            ),
        ]
        A = -np.concatenate(groups)
        # a form knows the symmetric part of its matrix only
        self.A: FloatArray = (A + A.swapaxes(1, 2)) / 2
        self.A0 = np.outer(s.sum(axis=0), s.sum(axis=0))
        ends = np.cumsum([len(g) for g in groups])
        self.single = np.arange(1, ends[2])
        self.mixed = np.arange(ends[1], ends[1] + k * (k - 1) // 2)
        self.lorentz = np.arange(ends[2], ends[3]).reshape(-1, 4)
        self.matrices = np.arange(ends[3], ends[-1]).reshape(-1, 16)
        # parameters of barriers: the size of a determinant, 1 for a half-line, 2 for a Lorentz cone
        self.parameter = d + len(self.single) + 2 * len(self.lorentz) + 4 * len(self.matrices)

    def start(self) -> FloatArray:
        """A point inside: small multipliers, and a negative square of the radius."""
        x = np.zeros(len(self.A))
        x[np.concatenate([self.single, self.lorentz[:, 0], self.matrices[:, 0]])] = 1e-2 / max(len(self.lorentz), 4)
        x[self.mixed] = 2.0  # the form of the s_i becomes diagonal
        x[0] = -1.0
        # a square of the radius that is negative enough outweighs all small multipliers
        while not self.inside(x):
            x[0] *= 4
        return x

    def inside(self, x: FloatArray) -> bool:
        """Whether the form and all multipliers are inside their cones."""
        a = x[self.lorentz]
        # signs are cheap; factors are tried only of what passes them
        if (x[self.single] <= 0).any() or (a[:, 0] <= 0).any() or ((a * a) @ LORENTZ <= 0).any():
            return False
        try:
            np.linalg.cholesky(self._form(x))
            np.linalg.cholesky(np.tensordot(x[self.matrices], _PAIRS, 1))
        except np.linalg.LinAlgError:
            return False
        return True

    def newton_step(self, x: FloatArray, mu: float) -> tuple[FloatArray, float]:
        """Newton step of ``-x_0 / mu`` plus the logarithmic barrier, and its decrement."""
        m = len(x)
        T = np.linalg.inv(self._form(x)) @ self.A
        g = -np.einsum("kii->k", T)
        H = T.reshape(m, -1) @ T.swapaxes(1, 2).reshape(m, -1).T
        g[0] -= 1 / mu
        g[self.single] -= 1 / x[self.single]
        H[self.single, self.single] += 1 / x[self.single] ** 2
        a = x[self.lorentz]
        q = ((a * a) @ LORENTZ)[:, None]
        slope = -2 * a * LORENTZ / q
        g[self.lorentz] += slope
        _add(H, self.lorentz, slope[:, :, None] * slope[:, None, :] - 2 * np.diag(LORENTZ) / q[:, None])
        P = np.linalg.inv(np.tensordot(x[self.matrices], _PAIRS, 1))[:, None] @ _PAIRS
        g[self.matrices] -= np.einsum("pkii->pk", P).real
        flat = P.reshape(-1, 16, 16), P.swapaxes(2, 3).reshape(-1, 16, 16)
        _add(H, self.matrices, (flat[0] @ flat[1].swapaxes(1, 2)).real)
        # unit diagonal: multipliers near their bounds have curvatures of very different size
        size = 1 / np.sqrt(np.abs(np.diag(H)))
        step = -size * np.linalg.solve(H * size[:, None] * size + 1e-14 * np.eye(m), size * g)
        return step, float(-g @ step)

    def outlook(self, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Unit wrenches along the principal axes of the moments, the planes, and one that splits the moments."""
        moments = np.linalg.inv(self._form(x))
        axes = np.linalg.eigh(moments[:6, :6])[1][:, ::-1].T
        total = np.sqrt(self.A0.diagonal())  # sum_i s_i, which is positive wherever u is not 0
        mean = moments @ total / (total @ moments @ total)
        spread = moments / (total @ moments @ total) - np.outer(mean, mean)
        split: FloatArray = np.zeros(len(total))
        split[:6] = np.linalg.eigh(spread[:6, :6])[1][:, -1]
        # through the mean of the moments, so that wrenches they mix up fall on either side
        split -= (split @ mean) * total
        split /= np.abs(split).max()
        both: FloatArray = np.vstack([axes, -axes])
        return both, self.planes, split

    def _form(self, x: FloatArray) -> FloatArray:
        return self.A0 + np.tensordot(x, self.A, 1)


def _add(H: FloatArray, index: NDArray[np.int64], blocks: FloatArray) -> None:
    H[index[:, :, None], index[:, None, :]] += blocks
