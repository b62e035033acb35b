"""What tests of fits share: samples, volumes from hulls, quartics of plain least squares, the smallest curvature."""

import numpy as np

from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.wrench import friction_limits, friction_wrench
from softjaw.lsfit.body import hull_volume
from softjaw.lsfit.ellipsoid import nearest_solution
from softjaw.lsfit.form import hessian_tensor
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.quartic_fit import convex_quartic, normal_equations, round_samples
from softjaw.lsfit.samples import normalised_samples, sphere_motions
from softjaw.lsfit.sos import ball_gram

SIX = np.array([1, 1, 1, 2, 2, 2])  # units of the components of a motion


def samples(patch, K=500, rho=2.0, twist=None):
    """Wrenches of evenly spread motions, or of those given, over the load, and the unit motions."""
    twist = fibonacci_twists(K, rho) if twist is None else twist
    return normalised_samples(friction_wrench(patch, twist, 1.0), twist, friction_limits(patch, 1.0).S, rho)


def six_samples(patch, K):
    """Wrenches of all six components over the load, and the unit motions."""
    twist = sphere_motions(K) / SIX
    return normalised_samples(friction_wrench(patch, twist, 0.5), twist, 0.5 * patch.load.sum(), 2.0)


def body_volume(coarse, fine):
    """Volume of a limit surface from two sets of evenly spread samples, whose hulls miss it in proportion to 1 / m."""
    inner, gain = hull_volume(fine), len(fine) / len(coarse)
    return inner + (inner - hull_volume(coarse)) / (gain - 1)


def some_motions(W):
    W = np.asarray(W, float)
    return W / np.maximum(np.linalg.norm(W, axis=1, keepdims=True), 1e-300)


def wrenches_alone(W):
    """Convex quartic of wrenches without their motions, and what proves it convex."""
    return convex_quartic(W, some_motions(W), gamma=0.0)


def least_squares_quartic(W, T=None, gamma=0.0):
    """Quartic with the least ``mean ((P - 1)^2 + gamma |(I - t t') grad P|^2)``, convex or not."""
    samples = round_samples(W, some_motions(W) if T is None else T)
    N, b = normal_equations(samples, gamma)
    v, flag = nearest_solution(N, b, ball_gram(samples.B.shape[1])[: len(b)])
    return Quartic(v, samples.B, samples.flag | flag)


def least_curvature(surface, w):
    """Smallest eigenvalue of a quartic's second derivative at the places ``w (m, d)``."""
    H = np.einsum("ijkl,mk,ml->mij", hessian_tensor(surface.coefficients, surface.dimension), w, w)
    return np.linalg.eigvalsh(H).min()


def smallest_curvature(v, d, turns=100):
    """Smallest eigenvalue of the second derivative on the unit sphere, from the softest of many directions.

    ``z' H(u) z`` is the same with ``u`` and ``z`` exchanged, so taking the softest direction in turn only lowers it.
    """
    Q = hessian_tensor(v, d).reshape(d * d, d * d)
    u = np.random.default_rng(0).normal(size=(5000, d))
    u /= np.linalg.norm(u, axis=1, keepdims=True)

    def hessian(u):
        return ((u[:, :, None] * u[:, None, :]).reshape(-1, d * d) @ Q).reshape(-1, d, d)

    u = u[np.argsort(np.linalg.eigvalsh(hessian(u))[:, 0])[:40]]
    for _ in range(turns):
        values, vectors = np.linalg.eigh(hessian(u))
        u = vectors[:, :, 0]
    return values[:, 0].min()
