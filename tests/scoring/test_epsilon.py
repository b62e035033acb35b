"""Bounds of epsilon in any pose: closed forms, random searches that must not undercut them, and degenerate grasps."""

import numpy as np
import pytest
from scipy.optimize import linprog

from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.closed_form import epsilon_l1, epsilon_linf
from softjaw.scoring.contact import SoftContact, ellipsoid_inside, fibonacci_vertices, joined
from softjaw.scoring.contact import joint_support as bodies_support
from softjaw.scoring.epsilon import contact_support, epsilon, facet_of_bodies
from tests.scoring.grasps import A, B, contact_axes, facing, unit


def ring(n, rng, tilt, scale=(1, 1, 0.4)):
    """Contacts around the origin, moved and turned at random; two of them face each other."""
    contacts = []
    for phi in 2 * np.pi * np.arange(n) / n:
        out = np.array([np.cos(phi), np.sin(phi), 0])
        position, N = out / 2 + tilt / 2 * rng.normal(size=3), tilt * rng.normal(size=3) - out
        body = Ellipsoid.of_axes(rng.uniform(0.2, 1, 3) * scale)
        contacts.append(SoftContact(position, contact_axes(N, np.eye(3)[2]), body))
    return contacts


def maps(contacts, *arguments):
    C = np.array([contact.wrench_map(*arguments) for contact in contacts])
    D = [contact.body.semi_axes[:, None] * Ci[:, 1:].T for contact, Ci in zip(contacts, C, strict=True)]
    return C[:, :, 0], np.array(D)


def joint_support(c, D, u, kind):
    return joined(contact_support(c, D, u), kind)


def least_found(c, D, kind, rng, enough=40):
    """Random search that closes in on the weakest wrenches it found."""
    u = unit(rng.normal(size=(20000, 6)))
    for spread in 0.6 ** np.arange(30):
        best = u[joint_support(c, D, u, kind).argsort()[:enough]]
        u = unit(np.vstack([best, np.repeat(best, 40, axis=0) + spread * rng.normal(size=(40 * enough, 6))]))
    return joint_support(c, D, u, kind).min()


@pytest.mark.parametrize(("kind", "closed"), [("linf", epsilon_linf), ("l1", epsilon_l1)])
@pytest.mark.parametrize("seed", range(8))
def test_antipodal_contacts_have_the_closed_form(kind, closed, seed):
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(0.05, 1.5, size=(2, 3)) * [1, 1, rng.choice([0.3, 2.0])]
    x, d, L, rho = rng.uniform(-0.6, 0.6), rng.uniform(0.2, 2.0), 0.8, 0.5
    bound = epsilon(facing(a, b, d), L, rho, (x, 0, 0), kind)
    exact = closed(a / [1, 1, rho], b / [1, 1, rho], (-d / 2 - x) / L, (d / 2 - x) / L)
    assert bound.lower <= exact * (1 + 1e-9)
    assert bound.upper >= exact * (1 - 1e-9)
    assert bound.upper <= bound.lower * (1 + 1e-4)


def test_epsilon_of_a_known_grasp_and_of_contacts_that_cannot_resist_some_wrench():
    """Computed by an independent program: 0.53813823519705 and 0.2849881999516418."""
    for kind, value in (("linf", 0.53813823519705), ("l1", 0.2849881999516418)):
        assert epsilon(facing(A, B), 0.7, 0.7, kind=kind)[:2] == pytest.approx((value, value), rel=1e-5)
    none = (0.8, 0.6, 0.0)
    for contacts in (facing(none, none), facing(A, B)[:1], facing((0, 1, 1), (0, 1, 1)), facing((0, 0, 0), (0, 0, 0))):
        for kind in ("linf", "l1"):
            assert epsilon(contacts, 1.0, 1.0, kind=kind)[:2] == (0, 0)
    assert epsilon(facing(none, A), 1.0, 1.0).lower > 0


@pytest.mark.parametrize("kind", ["linf", "l1"])
@pytest.mark.parametrize(("n", "seed"), [(2, 0), (2, 1), (2, 2), (3, 3), (4, 4)])
def test_the_bounds_meet_and_no_wrench_is_weaker(kind, n, seed):
    rng = np.random.default_rng(seed)
    contacts = ring(n, rng, 0.12)
    com = (0.1, -0.05, 0.02)
    bound = epsilon(contacts, 0.9, 0.8, com, kind)
    c, D = maps(contacts, 0.9, 0.8, com)
    assert 0 < bound.lower <= bound.upper <= bound.lower * (1 + 1e-4)
    assert np.linalg.norm(bound.u) == pytest.approx(1, rel=1e-12)
    assert joint_support(c, D, bound.u[None], kind)[0] == pytest.approx(bound.upper, rel=1e-12)
    assert least_found(c, D, kind, rng) >= bound.lower


def test_a_gap_is_closed_by_splitting_epsilon_depends_on_no_frame_and_polytopes_reach_as_programmes_say():
    """The 42nd of these grasps; one programme proves 0.275475 and the weakest wrench found is at 0.275707."""
    rng = np.random.default_rng(7)
    contacts = [ring(2, rng, 0.12) for _ in range(42)][-1]
    bound = epsilon(contacts, 1.0, 1.0)
    assert bound.upper <= bound.lower * (1 + 1e-6) + 1e-9
    contacts = ring(2, np.random.default_rng(5), 0.1)
    here = epsilon(contacts, 0.2, 2.0).upper
    assert epsilon(contacts, 0.2, 2.0, (0, 0.3, 0.2)).upper < 0.99 * here
    assert epsilon(contacts, 0.2, 1.0).upper > 1.01 * here
    Q, shift = contact_axes([1, 2, 3], np.eye(3)[0]).T, np.array([3.0, -2, 1])
    moved = [SoftContact(Q @ k.position + shift, k.axes @ Q.T, k.body) for k in contacts]
    assert epsilon(moved, 0.2, 2.0, shift).upper == pytest.approx(here, rel=1e-5)
    contacts = facing(fibonacci_vertices(A, 9), fibonacci_vertices(B, 12), tilt=0.2)
    C = np.array([k.wrench_map(1.0, 1.0) for k in contacts])
    loads = [np.vstack([np.ones(len(k.body.vertices)), k.body.vertices.T]) for k in contacts]
    w = np.array([0.1, 0.3, -0.2, 0.1, -0.05, 0.2])
    columns = np.hstack([Ci @ load for Ci, load in zip(C, loads, strict=True)])
    owner = np.repeat(np.eye(2), [9, 12], axis=0).T
    exact = linprog(
        [*np.zeros(21), -1], A_eq=np.hstack([columns, -w[:, None]]), b_eq=np.zeros(6),
        A_ub=np.hstack([owner, np.zeros((2, 1))]), b_ub=[1, 1],
    )
    shapes = [k.body for k in contacts]
    u = facet_of_bodies(C, shapes, w, "linf")
    assert bodies_support(C, shapes, u[None], "linf") / (u @ w) == pytest.approx(-exact.fun, rel=1.1e-5)


class Superellipsoid:
    """Support (sum |a t|^p)^(1/p): larger than the ellipsoid's for p < 2, smaller for p > 2."""

    volume = shadow_area = float("nan")

    def __init__(self, semi_axes, p):
        self.semi_axes, self.p = np.array(semi_axes), p

    def support(self, t):
        return (np.abs(np.atleast_2d(t) * self.semi_axes) ** self.p).sum(axis=1) ** (1 / self.p)

    def support_points(self, t):
        s = np.atleast_2d(t) * self.semi_axes
        h = np.maximum(self.support(t), 1e-300)
        return self.semi_axes * np.sign(s) * (np.abs(s) / h[:, None]) ** (self.p - 1)


def test_any_body_is_bounded_by_an_ellipsoid_inside_it_and_has_an_epsilon():
    t = np.random.default_rng(0).normal(size=(5000, 3)) / A
    for p in (1.7, 3.0):
        body = Superellipsoid(A, p)
        inside = np.linalg.norm(t @ ellipsoid_inside(body).T, axis=1) / body.support(t)
        assert 0.93 < inside.max() <= 1
    tilted = np.random.default_rng(1).normal(size=(3, 3))
    np.testing.assert_allclose(ellipsoid_inside(Ellipsoid(tilted)), tilted.T, rtol=1e-15)
    # A body inside the ellipsoid is weaker; the gap is that of the ellipsoid that fits inside it.
    bound = epsilon(facing(Superellipsoid(A, 2.5), Superellipsoid(B, 2.5), tilt=0.1), 0.7, 0.7)
    assert 0.75 * bound.upper < bound.lower <= bound.upper
    assert bound.upper < epsilon(facing(A, B, tilt=0.1), 0.7, 0.7).lower
