"""Closed forms that the solver is measured against: energies, homogeneous states, Hertz, and rigid objects."""

from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix

from softjaw.fem.contact.extract import extract
from softjaw.fem.materials import material
from softjaw.fem.objects.gap import Pose
from softjaw.fem.objects.shapes import EllipticCylinder, Sphere
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.pad.shape import PadShape
from softjaw.friction.frame import contact_frame, in_frame
from softjaw.friction.wrench import friction_limits

SIZE, FOAM = (0.050, 0.022, 0.015), material("blatz_ko", 0.040e6)  # of the usual pad


def blatz_ko_energy(F, G):
    """``G/2 (I2/I3 + 2 sqrt(I3) - 5)`` in the invariants of C, as Blatz and Ko wrote it."""
    C = F.T @ F
    I2 = 0.5 * (np.trace(C) ** 2 - np.trace(C @ C))
    I3 = np.linalg.det(C)
    return G / 2 * (I2 / I3 + 2 * np.sqrt(I3) - 5)


def hyperfoam_energy(F, nu, moduli, exponents):
    """``sum 2 mu / alpha^2 [sum l^alpha - 3 + (J^(-alpha beta) - 1) / beta]`` in the singular values of F."""
    stretch, beta = np.linalg.svd(F, compute_uv=False), nu / (1 - 2 * nu)
    J = stretch.prod()
    return sum(
        2 * mu / a**2 * ((stretch**a).sum() - 3 + (J ** (-a * beta) - 1) / beta)
        for mu, a in zip(moduli, exponents, strict=True)
    )


def neo_hookean_energy(F, G, nu):
    """``G/2 (tr C - 3 - 2 ln J) + lam/2 (ln J)^2``."""
    log_j = np.log(np.linalg.det(F))
    return G / 2 * (np.sum(F * F) - 3 - 2 * log_j) + lame(G, nu) / 2 * log_j**2


def linear_energy(F, G, nu):
    """``G e:e + lam/2 (tr e)^2`` with the small strain ``e``."""
    e = 0.5 * (F + F.T) - np.eye(3)
    return G * np.sum(e * e) + lame(G, nu) / 2 * np.trace(e) ** 2


def lame(G, nu):
    return 2 * G * nu / (1 - 2 * nu)


def differences(function, F, h=1e-5):
    """Derivative by every entry of ``F``, central differences of fourth order; trailing axes (3, 3)."""
    out = np.empty((*np.shape(function(F)), 3, 3))
    for i in range(3):
        for j in range(3):
            E = np.zeros((3, 3))
            E[i, j] = h
            near, far = function(F + E) - function(F - E), function(F + 2 * E) - function(F - 2 * E)
            out[..., i, j] = (8 * near - far) / (12 * h)
    return out


def slopes(f, x, h):
    """Central differences of a function of places ``x (n, 3)`` by their coordinates, on the last axis."""
    return np.stack([(f(x + e) - f(x - e)) / (2 * h) for e in h * np.eye(3)], axis=-1)


@dataclass(frozen=True)
class Hertz:
    """Contact radius or half width [m], peak pressure [Pa] and, for a sphere, approach of a half space [m]."""

    radius: float
    peak: float
    approach: float = float("nan")


def hertz_sphere(force, R, E_star):
    """Rigid sphere on a half space: ``a^3 = 3 F R / (4 E*)``, ``p = 3 F / (2 pi a^2)``, ``d = a^2 / R``."""
    a = (3 * force * R / (4 * E_star)) ** (1 / 3)
    return Hertz(a, 3 * force / (2 * np.pi * a**2), a**2 / R)


def hertz_cylinder(line_force, R, E_star):
    """Rigid cylinder on a half space, force per length: ``a^2 = 4 F R / (pi E*)``, ``p = 2 F / (pi a)``."""
    a = np.sqrt(4 * line_force * R / (np.pi * E_star))
    return Hertz(a, 2 * line_force / (np.pi * a))


def plane(x):
    return -x[:, 2], np.tile([0.0, 0.0, -1.0], (len(x), 1)), np.zeros((len(x), 3, 3))


def round_gap(R, axes):
    """Sphere (``axes = (0, 1, 2)``) or cylinder along x (``axes = (1, 2)``) of radius ``R`` about z = R."""
    mask = np.isin(range(3), axes).astype(float)

    def gap(x):
        d = (x - [0.0, 0.0, R]) * mask
        r = np.linalg.norm(d, axis=1)
        n = d / r[:, None]
        return r - R, n, (np.diag(mask) - n[:, :, None] * n[:, None, :]) / r[:, None, None]

    return gap


def placed(obj, pose):
    R = pose.rotation

    def gap(x):
        g, normal, hessian = obj.gap(pose.to_object(x))
        return g, normal @ R, R.T @ hessian @ R

    return gap


def facing(a):
    """Pose before an object whose axis is z: long side along the axis, approach along -x, front at ``x = a``."""
    return Pose(np.array([[0.0, 0, -1], [0, 1, 0], [1, 0, 0]]), np.array([a, 0.0, 0.0]))


def e_n(state, model="ccm"):
    patch = extract(state.pad, state)
    return friction_limits(in_frame(patch, contact_frame(patch, np.array([1.0, 0.0, 0.0]))), 1.0, model).e_n


def tangent_error(problem, x, d, h):
    """Difference of the tangent along ``d`` from central differences of the residual, over the largest of these."""
    one, other, two, four = (problem.residual(x + s * h * d) for s in (1, -1, 2, -2))
    difference = (8 * (one - other) - (two - four)) / (12 * h)
    return np.abs(dense(problem, x) @ d - difference).max() / np.abs(difference).max()


def dense(problem, x=None, values=None):
    pattern = problem.pattern
    if x is not None:
        problem.tangent(x)
        values = pattern.values
    return csr_matrix((values, pattern.column, pattern.start), shape=(problem.size,) * 2).toarray()


def pad_of(elements=(8, 4, 3), symmetry=(True, True), contact="weighted", element="hex8", law=FOAM, size=SIZE, **more):
    shape = PadShape(size, elements, more.get("grading", (1.0, 1.0, 1.0)), element)
    return Pad(shape, law, symmetry, contact, more.get("back"))


OVAL = placed(EllipticCylinder(0.025, 0.020, 0.1), facing(0.025))
BALL = placed(Sphere(0.025), facing(0.025))
