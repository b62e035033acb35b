"""Estimates along rays: against the exact volume of two contacts, and against hulls for three."""

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.bodies import PolytopeBody, fibonacci_vertices
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.pose import cone_volume, pose_volume
from softjaw.scoring.rays import ray_volume


def somewhere(rng, axes):
    Q = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    return SoftContact(rng.normal(size=3), Q * np.linalg.det(Q), Ellipsoid(axes))


@pytest.mark.parametrize("seed", range(2))
def test_two_contacts_agree_with_the_exact_volume_within_the_stated_error(seed):
    rng = np.random.default_rng(seed)
    contacts = [somewhere(rng, rng.uniform(0.1, 1, 3)) for _ in "12"]
    exact = pose_volume(*contacts, 1.0, 0.7)
    for kind, volume in (("linf", exact.linf), ("l1", exact.l1)):
        found = ray_volume(contacts, 1.0, 0.7, kind=kind, rays=1024, corners=150)
        assert found.relative_error < 0.02
        assert not found.high
        assert abs(found.volume / volume - 1) < 4 * found.relative_error
        assert 0.3 < found.lower / volume < 1


def test_a_repeated_contact_is_one_with_twice_the_normal_force():
    """``K + K = 2 K`` for convex K, and the hull of a union does not change."""
    rng = np.random.default_rng(5)
    one, two = somewhere(rng, (0.8, 0.6, 0.2)), somewhere(rng, (0.5, 0.9, 0.3))
    C1, C2 = (contact.wrench_map(1.0, 1.0) for contact in (one, two))
    exact = {
        "linf": cone_volume(C1, one.body, 2 * C2, two.body).linf,
        "l1": cone_volume(C1, one.body, C2, two.body).l1,
    }
    for kind, volume in exact.items():
        found = ray_volume([one, two, two], 1.0, 1.0, kind=kind, rays=1024, corners=150)
        assert found.volume == pytest.approx(volume, rel=4 * found.relative_error)


def test_three_polytopes_lie_between_their_hull_and_the_estimate():
    rng = np.random.default_rng(3)
    contacts = []
    for axes in rng.uniform(0.2, 1, (3, 3)):
        c = somewhere(rng, axes)
        contacts.append(SoftContact(c.position, c.axes, PolytopeBody(fibonacci_vertices(axes, 6))))
    sums = np.zeros((1, 6))
    for contact in contacts:
        loads = np.column_stack([np.ones(6), contact.body.vertices])
        wrenches = np.vstack([np.zeros(6), loads @ contact.wrench_map(1.0, 1.0).T])
        sums = (sums[:, None] + wrenches).reshape(-1, 6)
    exact = ConvexHull(sums, qhull_options="QJ").volume
    found = ray_volume(contacts, 1.0, 1.0, rays=512, corners=120)
    assert found.high
    assert found.lower <= exact * (1 + 1e-5)
    assert exact < found.volume * (1 + 3 * found.relative_error)


def test_wrenches_in_fewer_dimensions_have_no_volume():
    rng = np.random.default_rng(0)
    place = rng.normal(size=3)
    contacts = [SoftContact(place, somewhere(rng, (1, 1, 1)).axes, Ellipsoid([1, 1, 0])) for _ in "123"]
    for kind in ("linf", "l1"):
        assert ray_volume(contacts, 1.0, 1.0, kind=kind).volume == 0
    nothing = [somewhere(rng, (0, 0, 0)) for _ in "123"]
    assert ray_volume(nothing, 1.0, 1.0).volume == 0


def test_bad_arguments_are_named():
    contact = somewhere(np.random.default_rng(0), (1, 1, 1))
    with pytest.raises(ValueError, match="kind is 'l2'"):
        ray_volume([contact, contact], 1.0, 1.0, kind="l2")
    with pytest.raises(ValueError, match="at least 2 contacts"):
        ray_volume([contact], 1.0, 1.0)
