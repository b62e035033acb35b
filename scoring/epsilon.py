"""Epsilon quality of any soft contacts in any pose: the weakest wrench that breaks the grasp, between two bounds.

A contact with the wrench map ``c, D`` (wrench of its normal force; root of its limit surface times its other columns)
carries ``lam c + D^T f`` with ``|f| <= lam``. Its support along ``u`` is ``c . u + |D u|``, or 0 if that is negative,
and that of the grasp the sum over the contacts (L-infinity) or the largest (L1).

Epsilon is the least support of the grasp wrench space over unit wrenches, a problem with many local minima. The upper
bound is the support for the weakest wrench found: from the directions the proof points to, or from many if those leave
a gap, the ray along ``u`` leaves the space at a facet, whose own direction is weaker still, until nothing changes. The
lower bound is a proof that a ball fits, by a semidefinite programme; for two contacts it has always met the upper bound
so far. Where 0 is not an inner point epsilon is 0, exactly. That is decided by a convex programme: either some wrench
``u`` has ``c_i . u + |D_i u| < 0`` for all contacts, or the contacts do not span all wrenches. Clarabel solves the
programmes, HiGHS those of polytopes.

The proof. The ball of radius ``r`` fits if ``sum_i s_i >= r |u|`` wherever ``s_i >= 0`` and ``l_i = (s_i - c_i . u,
D_i u)`` lies in the Lorentz cone. With ``v = (u, s)`` this holds if

    (sum_i s_i)^2 - r^2 |u|^2 = p(v) + non-negative multiples of products that are non-negative there,

with a positive semidefinite form ``p``. The products are ``s_i s_j``, the Lorentz square of ``l_i``, ``s_i (a . l_j)``
with ``a`` in the Lorentz cone, and ``l_i^T Z l_j`` with a matrix ``Z`` that is positive on pairs of Lorentz vectors.
A Lorentz vector of four is a Hermitian 2 x 2 matrix without negative eigenvalues, and forms positive on pairs of those
are sums of a positive 4 x 4 matrix and the partial transpose of another (E. Stoermer 1963, S. L. Woronowicz 1976), so
these ``Z`` are known completely. The solver finds the largest ``r^2``; its last digits are made good by moving every
multiplier into its cone, and by what is then lacking of ``p``. The multiplier of ``p`` itself is the matrix of moments
of the weakest wrenches ``v``. Where the proof leaves a gap the wrenches are split by a plane ``g . v = 0`` between
those the moments mix up; on its sides ``g s_i``, ``g (a . l_i)`` and the products of several such forms are further
products that are not negative.
"""

from collections.abc import Sequence
from typing import NamedTuple

import clarabel
import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import linprog
from scipy.sparse import block_diag, csc_array, vstack

from softjaw.scoring.contact import (
    Body,
    FloatArray,
    SoftContact,
    ball_map,
    ellipsoid_inside,
    fibonacci_vertices,
    joined,
    joint_support,
)

NO_WRENCH = 1e-9  # relative to the largest wrench of a contact: what counts as none
MOST_FACETS = 12  # met one after the other from a start
LORENTZ = np.array([1.0, -1.0, -1.0, -1.0])


class Bounds(NamedTuple):
    """Bounds of epsilon, and the unit wrench ``(6,)`` that gives the upper one."""

    lower: float
    upper: float
    u: FloatArray


def epsilon(
    contacts: Sequence[SoftContact],
    object_length: ArrayLike,
    contact_length: float,
    centre_of_mass: ArrayLike = (0.0, 0.0, 0.0),
    kind: str = "linf",
    tolerance: float = 1e-4,
) -> Bounds:
    """Radius of the largest ball around 0 in the grasp wrench space, for normal forces of at most one [-].

    The bounds hold up to rounding. A body that is no ellipsoid is replaced by an ellipsoid inside it for the lower
    bound, which leaves a gap as large as its fit error; the upper bound uses its own support.

    ``contacts``: one or more, in any pose. Lengths and centre [m] are as in `scoring.contact.SoftContact.wrench_map`,
    and epsilon depends on each. ``kind``: with "linf" every normal force is at most one, with "l1" their sum is.
    ``tolerance``: relative gap of the bounds to work for; an absolute one of 1e-6 is enough too.
    """
    C = np.array([contact.wrench_map(object_length, contact_length, centre_of_mass) for contact in contacts])
    c, bodies = C[:, :, 0], [contact.body for contact in contacts]
    D = np.array([ellipsoid_inside(body) @ Ci[:, 1:].T for body, Ci in zip(bodies, C, strict=True)])
    exact = all(ball_map(body) is not None for body in bodies)
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
    size = np.abs(c).max()
    _, spread, V = np.linalg.svd(np.vstack([c, D.reshape(-1, 6)]))
    # if the wrenches span less than six dimensions, this direction is felt by no contact
    if len(spread) < 6 or spread[-1] <= NO_WRENCH * spread[0]:
        return V[-1]
    # least t with c_i u + |D_i u| <= t for u of at most one
    felt = np.concatenate([-c[:, None], D], axis=1) / size
    felt = np.concatenate([felt, np.eye(4, 1) * np.ones((len(c), 1, 1))], axis=2).reshape(-1, 7)
    cones = [*[clarabel.SecondOrderConeT(4)] * len(c), clarabel.SecondOrderConeT(7)]
    room = np.eye(1, len(felt) + 7, len(felt))[0]
    x, _ = _conic(np.eye(7)[6], np.vstack([felt, np.eye(7, 7, -1)]), room, cones)
    u = x[:6] / max(float(np.linalg.norm(x[:6])), 1e-300)
    return u if contact_support(c, D, u[None]).max() < -NO_WRENCH * size else None


def contact_support(c: FloatArray, D: FloatArray, u: FloatArray) -> FloatArray:
    """``c_i . u + |D_i u|`` for each contact and direction, ``(n, m)``."""
    return c @ u.T + np.linalg.norm(np.einsum("iad,md->ima", D, u), axis=2)


def _conic(cost: FloatArray, A: ArrayLike, room: FloatArray, cones: list) -> tuple[FloatArray, FloatArray]:
    """Minimiser of ``cost . x`` with ``A x + room`` in the cones, and the multipliers, as far as Clarabel comes."""
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.max_threads = 1  # the ranks of a run share the cores
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-10
    none = csc_array((len(cost),) * 2)
    answer = clarabel.DefaultSolver(none, cost, csc_array(-csc_array(A)), room, cones, settings).solve()
    return np.array(answer.x), np.array(answer.z)


def _between(c: FloatArray, D: FloatArray, kind: str, tolerance: float) -> tuple[float, float, FloatArray]:
    """Bounds of epsilon, closer than the tolerance unless that takes too many proofs."""
    proofs = [_proof(c, D, kind, np.zeros((0, 7 if kind == "l1" else 6 + len(c))))]
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
            proofs.append(_proof(c, D, kind, np.vstack([first.planes, side])))
            weakest = _weakest(c, D, proofs[-1].directions[:6], kind, first.radius)
            upper, u = min((upper, u), weakest, key=lambda pair: pair[0])
    return min(proof.radius for proof in proofs), upper, u


def _weakest(c: FloatArray, D: FloatArray, u: FloatArray, kind: str, enough: float) -> tuple[float, FloatArray]:
    """Least support found from the starts ``u``, and its unit wrench."""
    best, at = np.inf, u[0]
    for _ in range(MOST_FACETS):
        # the facet that the ray meets is at most as far from 0 as the ray goes: the support does not rise
        u = _facets(c, D, u, kind)
        h = joined(contact_support(c, D, u), kind)
        before, k = best, h.argmin()
        if h[k] < best:
            best, at = float(h[k]), u[k]
        if best <= enough or before - best <= 1e-9 * best:
            break
    return best, at


def _facets(c: FloatArray, D: FloatArray, w: FloatArray, kind: str) -> FloatArray:
    """Unit normals ``(m, 6)`` of the facets that rays along ``w (m, 6)`` meet: least support with ``u . w = 1``."""
    m, n, k = len(w), len(c), 1 if kind == "l1" else len(c)
    # (u, s) -> u . w - 1, then s_i >= 0, then (s_i - c_i u, D_i u)
    rows = np.zeros((k + 4 * n, 6 + k))
    rows[:k, 6:] = np.eye(k)
    rows[k:, :6] = np.concatenate([-c[:, None], D], axis=1).reshape(-1, 6)
    rows[k + 4 * np.arange(n), 6 + np.arange(n) % k] = 1.0
    along = block_diag([np.append(row, np.zeros(k))[None] for row in w])
    cones = [clarabel.ZeroConeT(m), *[clarabel.NonnegativeConeT(k), *[clarabel.SecondOrderConeT(4)] * n] * m]
    room = np.concatenate([-np.ones(m), np.zeros(m * len(rows))])
    cost = np.tile(np.repeat([0.0, 1.0], [6, k]), m)
    x, _ = _conic(cost, vstack([along, block_diag([rows] * m)]), room, cones)
    u = x.reshape(m, 6 + k)[:, :6]
    return u / np.linalg.norm(u, axis=1, keepdims=True)


def _weakest_of_bodies(C: FloatArray, bodies: Sequence[Body], u: FloatArray, kind: str) -> tuple[float, FloatArray]:
    """Least support of contacts with any bodies found from the start ``u (6,)``, and its unit wrench."""
    best, at = np.inf, u
    for _ in range(MOST_FACETS):
        u = facet_of_bodies(C, bodies, u, kind)
        h = float(joint_support(C, bodies, u[None], kind)[0])
        if not h < best * (1 - 1e-6):
            break
        best, at = h, u
    return best, at


def facet_of_bodies(C: FloatArray, bodies: Sequence[Body], w: FloatArray, kind: str) -> FloatArray:
    """Unit normal ``(6,)`` of the facet that the ray along ``w`` meets, for contacts ``C (n, 6, 4)`` with any bodies.

    By cutting planes: points of a body span a polytope inside it, and the reach of those polytopes along ``w`` is a
    linear programme in ``(u, s)``. Its value is a lower bound, the bodies' own support for its direction an upper one,
    and that direction asks for the next points, until the bounds are close.
    """
    k = 1 if kind == "l1" else len(C)
    far = 1e4 / np.linalg.norm(w)  # of the directions that are looked for: the first polytopes may not hold w at all
    best, upper = w / (w @ w), np.inf
    # without points all over a body the first programmes would run to their bounds
    ends = [body.support(np.eye(3)) for body in bodies]
    spread = [fibonacci_vertices(np.ones(3), 40) / np.where(end > 0, end, 1.0) for end in ends]
    rows = np.vstack([_cuts(C, bodies, spread, k), _cuts(C, bodies, best @ C[:, :, 1:], k)])
    for _ in range(80):
        optimum = linprog(
            np.repeat([0.0, 1.0], [6, k]), A_ub=rows, b_ub=np.zeros(len(rows)),
            A_eq=np.append(w, np.zeros(k))[None], b_eq=[1.0],
            bounds=[(-far, far)] * 6 + [(0, None)] * k, method="highs-ds",
        )  # fmt: skip
        # the solver meets u . w = 1 up to its tolerance only, and the bound needs it exactly
        u = optimum.x[:6] / (optimum.x[:6] @ w)
        h = float(joint_support(C, bodies, u[None], kind)[0])
        if h < upper:
            best, upper = u, h
        # a value that the bounds of u took part in proves nothing
        if np.abs(u).max() < 0.99 * far and upper - optimum.fun <= 1e-5 * abs(upper):
            break
        # a point between the last and the best direction cuts deeper than either
        rows = np.vstack([rows, *(_cuts(C, bodies, v @ C[:, :, 1:], k) for v in (u, (u + best) / 2))])
    return best / np.linalg.norm(best)


def _cuts(C: FloatArray, bodies: Sequence[Body], towards: Sequence[FloatArray], k: int) -> FloatArray:
    """Rows of ``(u, s)``, at most 0 each, of the points of the bodies that are farthest ``towards`` some loads."""
    rows = []
    for i, (body, t) in enumerate(zip(bodies, towards, strict=True)):
        points = body.support_points(t)
        wrenches = C[i, :, 0] + points @ C[i, :, 1:].T
        rows.append(np.hstack([wrenches, -np.tile(np.eye(k)[i % k], (len(points), 1))]))
    return np.vstack(rows)


# --- the proof --------------------------------------------------------------------------------------------------------


# in Pauli matrices Lorentz vectors are Hermitian ones without negative eigenvalues
_SIGMA = np.array([[[1, 0], [0, 1]], [[0, 1], [1, 0]], [[0, -1j], [1j, 0]], [[1, 0], [0, -1]]])
_PAIRS = np.einsum("apq,brs->abprqs", _SIGMA, _SIGMA).reshape(16, 4, 4)
_REAL_PAIRS = np.block([[_PAIRS.real, -_PAIRS.imag], [_PAIRS.imag, _PAIRS.real]])  # with the same eigenvalues, twice
_TRANSPOSED = np.array([1.0, 1.0, -1.0, 1.0])  # transposing a Hermitian matrix turns its second Pauli coordinate


class Proof(NamedTuple):
    """A radius proved up to rounding for the wrenches on one side of some planes, and what it leaves open."""

    radius: float
    directions: FloatArray  # (k, 6), candidates for the weakest wrench, unit vectors of both signs
    planes: FloatArray  # (p, 6 + k): the wrenches with planes @ v >= 0 were looked at
    split: FloatArray  # (6 + k,), a plane that would tell the candidates apart


def _proof(c: FloatArray, D: FloatArray, kind: str, planes: FloatArray) -> Proof:
    """Radius of a ball around 0 inside the grasp wrench space, for the wrenches on one side of ``planes (p, 6 + k)``.

    0 has to be an inner point of the grasp wrench space.
    """
    A0, groups = _products(c, D, kind, planes)
    A = np.concatenate(groups)
    ends = np.cumsum([len(group) for group in groups])
    lorentz, matrices = (np.arange(ends[i], ends[i + 1]) for i in (0, 1))
    d, count = len(A0), len(matrices) // 16
    # largest x_0 = r^2 with A0 - sum x_k A_k and all multipliers in their cones
    unknowns = np.eye(len(A))
    pairs = np.kron(np.eye(count), _triangle(_REAL_PAIRS).T) @ unknowns[matrices]
    rows = np.vstack([unknowns[1 : ends[0]], unknowns[lorentz], pairs, -_triangle(A).T])
    room = np.append(np.zeros(len(rows) - d * (d + 1) // 2), _triangle(A0[None])[0])
    cones = [clarabel.NonnegativeConeT(int(ends[0]) - 1), *[clarabel.SecondOrderConeT(4)] * (len(lorentz) // 4),
             *[clarabel.PSDTriangleConeT(8)] * count, clarabel.PSDTriangleConeT(d)]  # fmt: skip
    x, z = _conic(-unknowns[0], rows, room, cones)
    # into their cones, which the solver keeps up to its tolerance
    x[1 : ends[0]] = np.maximum(x[1 : ends[0]], 0.0)
    a = x[lorentz].reshape(-1, 4)
    x[lorentz[::4]] = np.maximum(a[:, 0], np.linalg.norm(a[:, 1:], axis=1))
    values = np.linalg.eigvalsh(np.tensordot(x[matrices].reshape(-1, 16), _PAIRS, 1))
    x[matrices[::16]] += np.maximum(-values[:, 0], 0.0)
    # what p lacks times |v|^2 is at most that times |u|^2 + (sum s)^2
    lack = max(-float(np.linalg.eigvalsh(A0 - np.tensordot(x, A, 1))[0]), 0.0)
    radius = np.sqrt(max((x[0] - lack) / (1 + lack), 0.0))
    moments = np.zeros((d, d))
    moments.T[np.tril_indices(d)] = z[-(d * (d + 1) // 2) :] / np.sqrt(2.0)
    moments += moments.T
    moments[np.diag_indices(d)] /= np.sqrt(2.0)
    return Proof(float(radius), *_outlook(moments, A0, planes))


def _products(c: FloatArray, D: FloatArray, kind: str, planes: FloatArray) -> tuple[FloatArray, list[FloatArray]]:
    """``(sum s)^2``; forms ``(m, d, d)`` not negative there, first ``|u|^2``, by numbers, Lorentz vectors, matrices."""
    n, k = len(c), 1 if kind == "l1" else len(c)
    d = 6 + k
    s = np.eye(k, d, 6)
    L = np.zeros((n, 4, d))
    L[:, 0, :6], L[:, 1:, :6] = -c, D
    L[:, 0] += s[np.arange(n) % k]
    lines = np.vstack([s, planes])
    pairs = [np.outer(g, other) for i, g in enumerate(lines) for other in lines[:i]]
    numbers = [np.diag([1.0] * 6 + [0.0] * k)[None], np.einsum("a,iad,iae->ide", LORENTZ, L, L)]
    twofold = [
        np.einsum("ad,be,b->abde", L[i], L[j], flip).reshape(16, d, d)
        for i in range(n) for j in range(i) for flip in (np.ones(4), _TRANSPOSED)
    ]  # fmt: skip
    groups = [
        np.concatenate([*numbers, np.reshape(pairs, (-1, d, d))]),
        np.einsum("id,jae->ijade", lines, L).reshape(-1, d, d),
        np.reshape(twofold, (-1, d, d)),
    ]
    # a form knows the symmetric part of its matrix only
    return np.outer(s.sum(axis=0), s.sum(axis=0)), [(A + A.swapaxes(1, 2)) / 2 for A in groups]


def _triangle(A: FloatArray) -> FloatArray:
    """Upper triangles ``(m, d (d + 1) / 2)`` of symmetric matrices as Clarabel orders them."""
    column, row = np.tril_indices(A.shape[1])
    return A[:, row, column] * np.where(row == column, 1.0, np.sqrt(2.0))


def _outlook(moments: FloatArray, A0: FloatArray, planes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit wrenches along the principal axes of the moments, the planes, and one that splits the moments."""
    axes = np.linalg.eigh(moments[:6, :6])[1][:, ::-1].T
    total = np.sqrt(A0.diagonal())  # sum_i s_i, which is positive wherever u is not 0
    mean = moments @ total / (total @ moments @ total)
    spread = moments / (total @ moments @ total) - np.outer(mean, mean)
    split: FloatArray = np.zeros(len(total))
    split[:6] = np.linalg.eigh(spread[:6, :6])[1][:, -1]
    # through the mean of the moments, so that wrenches they mix up fall on either side
    split -= (split @ mean) * total
    split /= np.abs(split).max()
    return np.vstack([axes, -axes]), planes, split
