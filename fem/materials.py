"""Pad materials: stress and tangent of each law at one material point, and the loops over elements that call them.

Every law is one function ``law(F, B, J, par, P, A)``: from the deformation gradient ``F``, its inverse ``B`` and its
determinant ``J`` it writes the first Piola-Kirchhoff stress ``P = dW/dF`` [Pa] and, where ``A`` has entries, the
tangent ``A[i, J, k, L] = dP[i, J] / dF[k, L]`` [Pa] for ``k >= i``; the rest is symmetric.  A new material is one more
such function, a line in ``stress`` and one in ``LAWS``. The loops stand beside the laws because numba's cache looks at
the file of a function alone.

Element arrays keep the node index last and contiguous, so that the innermost loop over the nodes of an element becomes
vector instructions; local unknowns are therefore ordered component first, ``(3, nodes)``.
Arithmetic is strict IEEE: with relaxed rules the last bits depend on whether code was compiled now or loaded from the
cache, and a study would not be the same to the bit; these loops gain nothing from them.
"""

from typing import NamedTuple

import numpy as np
from numba import njit

from softjaw.friction.patch import FloatArray


@njit(cache=True)
def transposed_product(M, N, out):
    """Write ``M^T N`` of two 3 x 3 matrices, without a call to BLAS."""
    for i in range(3):
        for j in range(3):
            out[i, j] = M[0, i] * N[0, j] + M[1, i] * N[1, j] + M[2, i] * N[2, j]


@njit(cache=True, inline="always")
def blatz_ko(F, B, J, par, P, A, work):
    """Foam of Blatz and Ko: ``W = G/2 (tr C^-1 + 2 J - 5)``, ``P = G (J F^-T - F^-T C^-1)``; ``par = [G]``."""
    G = par[0]
    M, D = work[0], work[1]
    for i in range(3):
        for j in range(i + 1):
            M[i, j] = B[i, 0] * B[j, 0] + B[i, 1] * B[j, 1] + B[i, 2] * B[j, 2]  # C^-1
            M[j, i] = M[i, j]
    for i in range(3):
        for j in range(3):
            D[i, j] = B[0, i] * M[0, j] + B[1, i] * M[1, j] + B[2, i] * M[2, j]
            P[i, j] = G * (J * B[j, i] - D[i, j])
    # a residual asks for the stress alone, and the tangent costs several times as much
    if A.size == 0:
        return
    for i in range(3):
        for k in range(i, 3):
            n = G * (B[0, i] * B[0, k] + B[1, i] * B[1, k] + B[2, i] * B[2, k])  # b^-1
            for j in range(3):
                a, b, c = G * J * B[j, i], G * (D[k, j] - J * B[j, k]), G * B[j, k]
                for m in range(3):
                    A[i, j, k, m] = a * B[m, k] + b * B[m, i] + n * M[m, j] + c * D[i, m]


@njit(cache=True)
def neo_hookean(F, B, J, par, P, A, work):
    """Compressible neo-Hookean: ``W = G/2 (tr C - 3 - 2 ln J) + lam/2 (ln J)^2``; ``par = [G, lam]``."""
    G, lam = par[0], par[1]
    log_j = np.log(J)
    for i in range(3):
        for j in range(3):
            P[i, j] = G * F[i, j] + (lam * log_j - G) * B[j, i]
    if A.size == 0:
        return
    for i in range(3):
        for j in range(3):
            for k in range(i, 3):
                for m in range(3):
                    A[i, j, k, m] = lam * B[j, i] * B[m, k] + (G - lam * log_j) * B[j, k] * B[m, i]
            A[i, j, i, j] += G


@njit(cache=True)
def linear(F, B, J, par, P, A, work):
    """Small-strain isotropic elasticity: ``P = lam tr(e) I + 2 G e``, ``e = sym F - I``; ``par = [G, lam]``."""
    G, lam = par[0], par[1]
    trace = F[0, 0] + F[1, 1] + F[2, 2] - 3.0
    for i in range(3):
        for j in range(3):
            P[i, j] = G * (F[i, j] + F[j, i])
        P[i, i] += lam * trace - 2.0 * G
    if A.size == 0:
        return
    A[:] = 0.0
    for i in range(3):
        for j in range(3):
            A[i, i, j, j] += lam
            A[i, j, i, j] += G
            A[i, j, j, i] += G


@njit(cache=True, inline="always")
def inverted(M, out):
    """Write the inverse of a 3 x 3 matrix; returns its determinant, and nothing is divided where that is 0."""
    a, b, c, d, e, f, g, h, i = M[0, 0], M[0, 1], M[0, 2], M[1, 0], M[1, 1], M[1, 2], M[2, 0], M[2, 1], M[2, 2]
    x, y, z = e * i - f * h, f * g - d * i, d * h - e * g
    det = a * x + b * y + c * z
    s = 1.0 / det if det != 0.0 else 1.0
    out[0, 0], out[1, 0], out[2, 0] = s * x, s * y, s * z
    out[0, 1], out[1, 1], out[2, 1] = s * (c * h - b * i), s * (a * i - c * g), s * (b * g - a * h)
    out[0, 2], out[1, 2], out[2, 2] = s * (b * f - c * e), s * (c * d - a * f), s * (a * e - b * d)
    return det


@njit(cache=True)
def _turn(M, p, q, c, s):
    """Turn two columns of a 3 x 3 matrix into each other."""
    for k in range(3):
        a, b = M[k, p], M[k, q]
        M[k, p], M[k, q] = c * a - s * b, s * a + c * b


@njit(cache=True)
def principal(C):
    """Eigenvalues ``(3,)`` and eigenvectors (columns) of a symmetric 3 x 3 matrix, by cyclic Jacobi rotations."""
    M, V = C.copy(), np.eye(3)
    for _ in range(30):
        # relative to the diagonal: 1e-32 of the squares is 1e-16 of the entries, where rotations change nothing
        off = M[0, 1] ** 2 + M[0, 2] ** 2 + M[1, 2] ** 2
        if not off > 1e-32 * (M[0, 0] ** 2 + M[1, 1] ** 2 + M[2, 2] ** 2):
            break
        for p in range(2):
            for q in range(p + 1, 3):
                if M[p, q] == 0.0:
                    continue
                # the smaller of both angles that make the entry vanish: it converges and keeps nearly equal values
                theta = 0.5 * (M[q, q] - M[p, p]) / M[p, q]
                t = (1.0 if theta >= 0 else -1.0) / (abs(theta) + np.sqrt(theta * theta + 1.0))
                c = 1.0 / np.sqrt(t * t + 1.0)
                s = t * c
                _turn(M, p, q, c, s)
                _turn(M.T, p, q, c, s)
                _turn(V, p, q, c, s)
    return np.array([M[0, 0], M[1, 1], M[2, 2]]), V


@njit(cache=True)
def hyperfoam(F, B, J, par, P, A, work):
    """Storakers' hyperfoam in principal stretches ``l``; ``par = [nu, mu_1, alpha_1, mu_2, alpha_2, ...]``.

    ``W = sum 2 mu / alpha^2 [l_1^alpha + l_2^alpha + l_3^alpha - 3 + (J^(-alpha beta) - 1) / beta]`` with
    ``beta = nu / (1 - 2 nu)`` (Storakers, J. Mech. Phys. Solids 34, 1986).
    """
    beta = par[0] / (1.0 - 2.0 * par[0])
    # rotations keep eigenvectors at right angles also where stretches are nearly equal
    C, FV, S = work[0], work[1], work[2]
    transposed_product(F, F, C)
    c, V = principal(C)
    stretch = np.sqrt(c)
    s, ds = np.zeros(3), np.zeros((3, 3))  # second Piola-Kirchhoff S_a and dS_a / dl_b
    for term in range((par.size - 1) // 2):
        mu, alpha = par[1 + 2 * term], par[2 + 2 * term]
        volume = J ** (-alpha * beta)
        for a in range(3):
            power = stretch[a] ** alpha
            s[a] += 2.0 * mu / alpha * (power - volume) / c[a]
            ds[a, a] += 2.0 * mu / alpha * ((alpha - 2.0) * power + 2.0 * volume) / (c[a] * stretch[a])
            for b in range(3):
                ds[a, b] += 2.0 * mu * beta * volume / (c[a] * stretch[b])
    transposed_product(F.T, V, FV)
    for i in range(3):
        for j in range(3):
            P[i, j] = FV[i, 0] * s[0] * V[j, 0] + FV[i, 1] * s[1] * V[j, 1] + FV[i, 2] * s[2] * V[j, 2]
    if A.size == 0:
        return
    A[:] = 0.0
    VT, X, Y = np.ascontiguousarray(V.T), np.empty((3, 3)), np.empty((3, 3))
    # written out: arrays that are broadcast, or assigned to slices, take seconds to compile
    for a in range(3):
        for i in range(3):
            X[a, i] = s[a] * VT[a, i]
    transposed_product(VT, X, S)
    shear = np.zeros((3, 3))
    for a in range(3):
        for b in range(3):
            if a != b:
                # for nearly equal stretches the differences cancel
                if abs(c[b] - c[a]) > 1e-6 * (c[a] + c[b]):
                    shear[a, b] = (s[b] - s[a]) / (c[b] - c[a])
                else:  # the limit of the quotient for equal stretches
                    shear[a, b] = 0.5 * (ds[b, b] - ds[a, b]) / stretch[b]
    for a in range(3):
        for b in range(3):
            for k in range(3):
                for m in range(3):
                    X[k, m] = ds[a, b] / stretch[b] * FV[k, b] * V[m, b]
                    Y[k, m] = shear[a, b] * (FV[k, a] * V[m, b] + FV[k, b] * V[m, a])
            for i in range(3):
                for j in range(3):
                    x, y = FV[i, a] * V[j, a], FV[i, a] * V[j, b]
                    for k in range(i, 3):
                        for m in range(3):
                            A[i, j, k, m] += x * X[k, m] + y * Y[k, m]
    for i in range(3):
        for j in range(3):
            for m in range(3):  # the geometric part, the same for every component of the displacement
                A[i, j, i, m] += S[j, m]


@njit(cache=True, inline="always")
def stress(law, F, B, J, par, P, A, work):
    """Write stress and tangent of the law with this number; numbers, not functions, let compiled code be cached.

    ``work (3, 3, 3)`` is overwritten: memory that is asked for at every point takes longer than what is done with it.
    """
    if law == 0:
        blatz_ko(F, B, J, par, P, A, work)
    elif law == 1:
        hyperfoam(F, B, J, par, P, A, work)
    elif law == 2:
        neo_hookean(F, B, J, par, P, A, work)
    else:
        linear(F, B, J, par, P, A, work)


@njit(cache=True, inline="always")
def _gradient(u, dN, nodes, F, B):
    """Deformation gradient and its inverse at one point; returns ``det F``."""
    f00 = f11 = f22 = 1.0
    f01 = f02 = f10 = f12 = f20 = f21 = 0.0
    for a in range(nodes):
        x, y, z, d0, d1, d2 = u[0, a], u[1, a], u[2, a], dN[0, a], dN[1, a], dN[2, a]
        f00, f01, f02 = f00 + x * d0, f01 + x * d1, f02 + x * d2
        f10, f11, f12 = f10 + y * d0, f11 + y * d1, f12 + y * d2
        f20, f21, f22 = f20 + z * d0, f21 + z * d1, f22 + z * d2
    F[0, 0], F[0, 1], F[0, 2], F[1, 0], F[1, 1], F[1, 2] = f00, f01, f02, f10, f11, f12
    F[2, 0], F[2, 1], F[2, 2] = f20, f21, f22
    return inverted(F, B)


@njit(cache=True)
def smallest_det(u, dN):
    """Smallest ``det F`` over all points of all elements [-]."""
    F, B = np.empty((3, 3)), np.empty((3, 3))
    smallest = np.inf
    for e in range(dN.shape[0]):
        for q in range(dN.shape[1]):
            smallest = min(smallest, _gradient(u[e], dN[e, q], dN.shape[3], F, B))
    return smallest


@njit(cache=True)
def _elements(law, par, u, dN, w, nodes, r, K):
    """Residual and, where ``K`` has entries, tangent of every element; returns the smallest ``det F``."""
    tangent = K.size > 0
    F, B, P, T = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, nodes))
    work = np.empty((3, 3, 3))
    A = np.empty((3, 3, 3, 3)) if tangent else np.empty((0, 0, 0, 0))
    smallest = np.inf
    for e in range(w.shape[0]):
        r[e] = 0.0
        if tangent:
            K[e] = 0.0
        for q in range(w.shape[1]):
            g = dN[e, q]
            J = _gradient(u[e], g, nodes, F, B)
            smallest = min(smallest, J)
            stress(law, F, B, J, par, P, A, work)
            # the node loop is innermost and contiguous, so that it becomes vector instructions
            dv = w[e, q]
            for i in range(3):
                p0, p1, p2 = dv * P[i, 0], dv * P[i, 1], dv * P[i, 2]
                for a in range(nodes):
                    r[e, i, a] += p0 * g[0, a] + p1 * g[1, a] + p2 * g[2, a]
            if not tangent:
                continue
            for i in range(3):
                for k in range(i, 3):  # the tangent is symmetric: blocks below the diagonal follow
                    for j in range(3):
                        a0, a1, a2 = dv * A[i, j, k, 0], dv * A[i, j, k, 1], dv * A[i, j, k, 2]
                        for b in range(nodes):
                            T[j, b] = a0 * g[0, b] + a1 * g[1, b] + a2 * g[2, b]
                    for a in range(nodes):
                        g0, g1, g2 = g[0, a], g[1, a], g[2, a]
                        for b in range(nodes):
                            K[e, i, a, k, b] += g0 * T[0, b] + g1 * T[1, b] + g2 * T[2, b]
        if tangent:
            for i in range(3):
                for k in range(i):
                    for a in range(nodes):
                        for b in range(nodes):
                            K[e, i, a, k, b] = K[e, k, b, i, a]
    return smallest


@njit(cache=True)
def elements(law, par, u, dN, w, r, K):
    """Residual ``r`` and tangent ``K`` of hexahedra; returns the smallest ``det F`` [-].

    ``law, par``: as of `Material`; ``u (n, 3, nodes)``: displacements [m]; ``dN (n, points, 3, nodes)``: reference
    gradients [1/m]; ``w (n, points)``: reference volumes [m^3]; out: ``r (n, 3, nodes)`` [N] and ``K (n, 3, nodes,
    3, nodes)`` [N/m], with size 0 ``r`` alone.
    """
    # constant node counts let the compiler unroll
    if u.shape[2] == 8:
        return _elements(law, par, u, dN, w, 8, r, K)
    return _elements(law, par, u, dN, w, 27, r, K)


@njit(cache=True)
def strains(law, par, u, dN, directions):
    """Smallest ``det F``, largest ``|principal stretch - 1|`` and smallest eigenvalue of the acoustic tensor [Pa].

    The acoustic tensor ``Q[i, k] = A[i, J, k, L] m_J m_L`` is formed at the first point of every element for the unit
    ``directions (k, 3)``: positive means strongly elliptic (no localisation), infinite that none is given.
    """
    F, B, P, A, C = np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3)), np.empty((3, 3, 3, 3)), np.empty((3, 3))
    work = np.empty((3, 3, 3))
    smallest, largest, ellipticity = np.inf, 0.0, np.inf
    for e in range(dN.shape[0]):
        for q in range(dN.shape[1]):
            J = _gradient(u[e], dN[e, q], dN.shape[3], F, B)
            smallest = min(smallest, J)
            transposed_product(F, F, C)
            # no principal stretch is farther from 1 than C is from the identity
            size2 = 0.0
            for i in range(3):
                size2 += (C[i, i] - 1.0) ** 2
                for j in range(i):
                    size2 += 2.0 * C[i, j] ** 2
            if size2 > largest * largest:
                # rounding can leave the smallest eigenvalue of a crushed element below zero
                for value in principal(C)[0]:
                    largest = max(largest, abs(np.sqrt(max(value, 0.0)) - 1.0))
            # one point per element: loss of ellipticity is a warning, and the tensor in many directions is dear
            if q > 0 or len(directions) == 0:
                continue
            stress(law, F, B, J, par, P, A, work)
            for m in directions:
                for i in range(3):
                    for k in range(i, 3):
                        C[i, k] = 0.0
                        for j in range(3):
                            for n in range(3):
                                C[i, k] += A[i, j, k, n] * m[j] * m[n]
                        C[k, i] = C[i, k]
                # only where the smallest so far, taken off the diagonal, leaves no positive definite matrix
                a, b, c = C[0, 0] - ellipticity, C[1, 1] - ellipticity, C[2, 2] - ellipticity
                minor = a * b - C[0, 1] ** 2
                det = c * minor - a * C[1, 2] ** 2 - b * C[0, 2] ** 2 + 2.0 * C[0, 1] * C[1, 2] * C[0, 2]
                if not (a > 0.0 and minor > 0.0 and det > 0.0):
                    ellipticity = min(ellipticity, principal(C)[0].min())
    return smallest, largest, ellipticity


LAWS = {"blatz_ko": 0, "hyperfoam": 1, "neo_hookean": 2, "linear": 3}


class Material(NamedTuple):
    """A law of ``LAWS``, its parameters ``(k,)`` as its function documents them, and constants for small strain."""

    law: str
    parameters: FloatArray
    shear_modulus: float
    poisson_ratio: float

    @property
    def young_modulus(self) -> float:
        """``E = 2 G (1 + nu)`` of the undeformed state [Pa]."""
        return 2.0 * self.shear_modulus * (1.0 + self.poisson_ratio)

    @property
    def number(self) -> int:
        """The law's number in compiled code."""
        return LAWS[self.law]


def material(
    law: str, shear_modulus: float = 0.0, poisson_ratio: float = 0.25, shear_moduli=(), exponents=()
) -> Material:
    """Material by name; hyperfoam takes ``shear_moduli`` (mu_i [Pa]) and ``exponents`` (alpha_i, not 0)."""
    if law == "blatz_ko":
        par = [shear_modulus]
    elif law == "hyperfoam":
        # in this form of the law the first modulus is the sum, whatever the exponents
        shear_modulus = float(np.sum(shear_moduli))
        par = [poisson_ratio, *np.column_stack([shear_moduli, exponents]).ravel()]
    else:
        par = [shear_modulus, 2.0 * shear_modulus * poisson_ratio / (1.0 - 2.0 * poisson_ratio)]
    return Material(law, np.array(par, dtype=float), shear_modulus, poisson_ratio)
