"""GraspIt!'s linearised qualities: Qhull in six dimensions against what is known without it."""

import math

import numpy as np
import pytest

from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring import graspit
from softjaw.scoring.bodies import PolytopeBody, fibonacci_vertices, polytope_volume
from softjaw.scoring.closed_form import volume_linf
from softjaw.scoring.contact import SoftContact, contact_axes
from softjaw.scoring.epsilon import epsilon
from softjaw.scoring.graspit import graspit_score, graspit_vertices, linearised_contacts

A, B = (0.8, 0.6, 0.15), (0.5, 0.9, 0.25)
RHO = 0.7


def pads(a, b, d=1.3, tilt=0.0):
    bodies = [Ellipsoid(axes) if len(np.shape(axes)) == 1 else PolytopeBody(axes) for axes in (a, b)]
    c, s = math.cos(tilt), math.sin(tilt)
    return [
        SoftContact([side * d / 2, 0, 0], contact_axes([-side * c, s, 0], [0, 0, 1]), body)
        for side, body in zip((-1, 1), bodies, strict=True)
    ]


@pytest.mark.parametrize(("m", "vertices"), [(8, fibonacci_vertices), (None, lambda axes, m: graspit_vertices(axes))])
def test_the_volume_is_that_of_the_closed_form_for_polytopes(m, vertices):
    sizes = [size for axes in (A, B) for size in polytope_volume(vertices(axes, m))]
    found = graspit_score(pads(A, B), RHO, RHO, m=m)
    assert not found.joggled
    assert found.volume == pytest.approx(volume_linf(*sizes, 1.3, RHO), rel=1e-9)


def test_twenty_vertices_lose_half_the_volume_and_little_of_epsilon():
    """0.511 of the volume and an epsilon of 0.5342 were computed by an independent program."""
    smooth = volume_linf(*(x for a in (A, B) for x in (4 / 3 * math.pi * np.prod(a), math.pi * a[0] * a[1])), 1.3, RHO)
    found = graspit_score(pads(A, B), RHO, RHO)
    assert found.volume / smooth == pytest.approx(0.511251985640949, rel=1e-9)
    assert found.epsilon == pytest.approx(0.5342, abs=5e-5)


def test_epsilon_grows_towards_the_smooth_one():
    """0.398, 0.470 and 0.505 of 10, 20 and 40 vertices were computed by an independent program."""
    found = [graspit_score(pads(A, B), RHO, RHO, m=m).epsilon for m in (6, 10, 20)]
    np.testing.assert_allclose(found[1:], [0.398, 0.470], atol=5e-4)
    assert 0 < found[0] < found[1] < found[2] < 0.53813823519705


def test_the_nearest_facet_is_the_epsilon_of_the_same_polytopes():
    """The search for any bodies, started from an ellipsoid, against the facets of the hull; contacts tilted."""
    contacts = linearised_contacts(pads(A, B, tilt=0.15), 12)
    facet = graspit_score(contacts, RHO, RHO, (0.1, 0.05, 0)).epsilon
    bound = epsilon(contacts, RHO, RHO, (0.1, 0.05, 0))
    assert 0 < bound.lower <= facet * (1 + 1e-9)
    assert facet * (1 - 1e-9) <= bound.upper <= 1.2 * facet


def test_a_grasp_without_torque_or_closure_has_no_quality():
    flat = graspit_score(pads((1, 1, 0), (1, 1, 0)), RHO, RHO)
    assert (flat.volume, flat.epsilon) == (0, 0)
    open_ = graspit_score(pads((0.2, 0.2, 0.1), (0.2, 0.2, 0.1), tilt=0.6), RHO, RHO, m=8)
    assert open_.volume > 0
    assert open_.epsilon == 0


def test_the_unit_moves_graspits_vertices_but_not_off_the_surface():
    metre, milli = (linearised_contacts(pads(A, B), unit=unit)[0].body.vertices for unit in (1.0, 1e-3))
    assert np.abs(metre - milli).max() > 0.1
    np.testing.assert_allclose(((milli / A) ** 2).sum(axis=1), 1, rtol=1e-12)
    np.testing.assert_allclose(
        linearised_contacts(pads(np.multiply(A, [1, 1, 1e-3]), B), unit=1e-3)[0].body.vertices,
        metre * [1, 1, 1e-3],
        rtol=1e-12,
        atol=1e-18,
    )


def test_what_cannot_be_done_is_said():
    with pytest.raises(ValueError, match="2601 sums of wrenches are too many"):
        graspit_score(pads(A, B), RHO, RHO, m=50)
    with pytest.raises(ValueError, match=r"contacts\[1\] has no ellipsoid along its axes"):
        linearised_contacts([*pads(A, B)[:1], *pads(A, fibonacci_vertices(B, 9))[1:]])


def test_a_failing_hull_is_joggled_and_says_so(monkeypatch):
    calls = []

    def hull(points, qhull_options):
        calls.append(qhull_options)
        if qhull_options == "Qx":
            raise graspit.QhullError("QH6271")
        return ConvexHull(points, qhull_options=qhull_options)

    ConvexHull = graspit.ConvexHull
    exact = graspit_score(pads(A, B), RHO, RHO, m=8)
    monkeypatch.setattr(graspit, "ConvexHull", hull)
    found = graspit_score(pads(A, B), RHO, RHO, m=8)
    assert calls == ["Qx", "QJ"]
    assert found.joggled
    assert found.volume == pytest.approx(exact.volume, rel=1e-4)
