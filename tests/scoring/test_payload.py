"""Payload of a gripper: closed forms, linear programmes over all points, and directions by brute force."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from softjaw.scoring.contact import DiscBody, PolytopeBody, SoftContact, fibonacci_vertices
from softjaw.scoring.payload import BOUND_GAP, NEAR, Facets, payload
from tests.scoring.grasps import contact_axes

F, MU, E, D = 5.0, 0.8, 0.006, 0.06
AXES = F * np.array([MU, MU, MU * E])
CORNERS = PolytopeBody(np.vstack([np.diag(AXES), -np.diag(AXES)]))  # friction along one axis at a time, or mixed
SMOOTH = PolytopeBody(fibonacci_vertices(AXES, 1000))
FLAT = DiscBody(MU * F / 4 * np.array([[1, 0, -y, 0, 1, x] for x in (-E, E) for y in (-E, E)]))  # four faces
MIDDLE = (0.0, 0.0, 0.0)


def pair(offset=0.0, body=CORNERS, tilt=0.0):
    """Contacts at x = -D/2 and D/2 that press towards each other, ``offset`` apart along z, tilted about y [rad]."""
    c, s, y = np.cos(tilt), np.sin(tilt), np.eye(3)[1]
    return [
        SoftContact(side * np.array([D / 2, 0, -offset / 2]), contact_axes([-side * c, 0, s], y), body)
        for side in (-1, 1)
    ]


def cap(mu):
    """Friction of faces on a ball, under a pressure as Hertz has it."""
    r, edge = 0.025, 0.008
    x, y = (edge * v.ravel() for v in np.meshgrid((np.arange(20) - 9.5) / 10, (np.arange(12) - 5.5) / 6))
    x, y = (v[np.hypot(x, y) < edge] for v in (x, y))
    load = np.sqrt(1 - (x**2 + y**2) / edge**2)
    normal = np.column_stack([x, y, np.sqrt(r**2 - x**2 - y**2)])
    first = np.cross(normal, [0.0, 1, 0])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    halves = [np.column_stack([v[:, :2], x * v[:, 1] - y * v[:, 0]]) for v in (first, np.cross(normal / r, first))]
    return DiscBody(mu * F * (load / load.sum())[:, None] * np.hstack(halves))


def pushes(contacts, force=F):
    """Wrenches of a pressure along the contact normals, through the contacts' origins."""
    return [np.append(force * c.axes[2], np.cross(c.position, force * c.axes[2])) for c in contacts]


def held(contacts, centre=MIDDLE, direction=None, kind="shared"):
    return payload(contacts, pushes(contacts), centre, direction, kind)


@pytest.mark.parametrize(("kind", "along"), [("shared", 2 * F), ("up_to", F), ("fixed", 0.0)])
def test_along_the_closing_axis_a_finger_takes_what_its_drive_allows_and_across_it_both_hold(kind, along):
    for sign in (1, -1):
        assert held(pair(), direction=[sign, 0, 0], kind=kind).force == pytest.approx(along, rel=1e-6, abs=0.0)
    assert held(pair(), direction=[0, 0, -3], kind=kind).force == pytest.approx(2 * MU * F, rel=1e-6)


def test_in_the_worst_direction_the_load_also_takes_force_from_a_finger():
    """Friction has to stay even, or it would turn: |x| / 2F + (|y| + |z|) / (2 mu F) <= 1 is what is held."""
    found = held(pair())
    assert found.force == pytest.approx(2 * F / np.hypot(1, np.sqrt(2) / MU), rel=1e-6)
    assert np.abs(found.direction) == pytest.approx(np.array([1, 1 / MU, 1 / MU]) / np.hypot(1, np.sqrt(2) / MU), 1e-3)
    round_one = held(pair(body=SMOOTH))
    assert round_one.force == pytest.approx(2 * MU * F / np.hypot(1, MU), rel=3e-3)
    assert round_one.force <= round_one.upper <= round_one.force * (1 + 1.01 * BOUND_GAP)


@pytest.mark.parametrize("kind", ["shared", "fixed"])
@pytest.mark.parametrize("lean", [0.0, 0.1, 0.3])
@pytest.mark.parametrize("body", [CORNERS, FLAT])
def test_a_wedge_is_pressed_less_where_it_is_pulled_out_at_its_thin_end_and_more_at_the_other(kind, lean, body):
    """N (cos a + mu sin a) = F and 2 N (mu cos a - sin a) = W; on the other side with the other sign."""
    contacts, c, s = pair(tilt=lean, body=body), np.cos(lean), np.sin(lean)
    drive = [[F, 0, 0], [-F, 0, 0]]
    for sign in (1, -1):
        found = payload(contacts, pushes(contacts), MIDDLE, [0, 0, sign], kind, drive)
        near = 1e-6 if body is CORNERS else NEAR
        assert found.force == pytest.approx(2 * F * (MU * c - sign * s) / (c + sign * MU * s), rel=near)


@pytest.mark.parametrize("lean", [0.15, 0.25])
def test_alike_fingers_that_are_pulled_across_hold_the_same_with_each_force_kept_as_with_their_sum(lean):
    contacts, drive = pair(tilt=lean, body=cap(0.6)), [[F, 0, 0], [-F, 0, 0]]
    args = contacts, pushes(contacts), [0, 0.01, 0], [0, 1, 1]
    shared, fixed = (payload(*args, kind, drive) for kind in ("shared", "fixed"))
    assert fixed.force == pytest.approx(shared.force, rel=2 * NEAR)
    assert fixed.force <= fixed.upper


@pytest.mark.parametrize("mu", [0.005, 0.011, 0.026, 0.035, 0.046, 0.05])
def test_little_friction_on_a_ball_makes_a_thin_set_whose_bounds_meet_too(mu):
    found = held(pair(body=cap(mu)))
    assert found.upper <= 2 * mu * F * (1 + BOUND_GAP)
    assert 1.9 * mu * F <= found.force <= found.upper <= found.force * (1 + 1.01 * BOUND_GAP)


def test_points_in_the_planes_of_facets_end_in_bounds_that_meet():
    """Boxes, whose hulls Qhull once refused to widen."""
    force, mu, e, distance = 2.830322673600437, 0.33575343309687694, 0.00012007769368455101, 0.027299709516401895
    centre = [0.048199032374876494, -0.2613448862390836, -0.050086627753231305]
    corners = np.array(np.meshgrid(*[[-1, 0, 1]] * 3)).reshape(3, -1).T * (force * mu * np.array([1, 1, e]))
    contacts = [SoftContact(np.array([s * distance / 2, 0, 0]), np.array([[0, 0, s], [0, 1, 0], [-s, 0, 0]], float),
                            PolytopeBody(corners)) for s in (-1, 1)]  # fmt: skip
    found = payload(contacts, pushes(contacts, force), centre, None, "shared")
    assert 0 < (1 - 2 * BOUND_GAP) * found.upper <= found.force <= (1 + 1e-9) * found.upper


def test_a_squeeze_that_is_not_borne_and_contacts_that_slip_or_bear_no_torsion_hold_nothing():
    for direction in (None, [0, 0, -1], [1, 0, 0]):
        found = held(pair(1.05 * MU * D), direction=direction)
        assert not found.borne
        assert (found.force, found.upper) == pytest.approx((0.0, 0.0), abs=1e-12)
    assert held(pair(tilt=0.9 * np.arctan(MU))).force > 0
    out = held(pair(tilt=1.1 * np.arctan(MU)))
    assert not out.borne
    assert out.force == pytest.approx(0.0, abs=1e-12)
    flat = PolytopeBody(CORNERS.vertices * [1, 1, 0])
    assert held(pair(body=flat)).force == pytest.approx(held(pair()).force, rel=1e-5)  # none is needed in the middle
    assert held(pair(body=flat), [0, 0, 0.01]).force == pytest.approx(0, abs=1e-6)
    assert held(pair(body=PolytopeBody(np.zeros((1, 3))))).force == 0


@pytest.mark.parametrize("seed", range(6))
def test_a_squeeze_is_borne_or_not(seed):
    """Margin 1e-7 of the forces: positions and rounding decide nothing 1e-6 away from the limit."""
    turn = Rotation.random(random_state=seed).as_matrix()
    for change, borne in ((-1e-6, True), (1e-6, False)):
        contacts = [SoftContact(turn @ c.position, c.axes @ turn.T, c.body) for c in pair((1 + change) * MU * D)]
        assert held(contacts).borne == borne


def test_payload_grows_with_the_forces_and_does_not_depend_on_the_frame():
    turn, shift = Rotation.random(random_state=3).as_matrix(), np.array([0.1, -0.2, 0.05])
    contacts, com = pair(0.01, SMOOTH), np.array([0.004, 0.01, -0.02])
    moved = [SoftContact(turn @ c.position + shift, c.axes @ turn.T, c.body) for c in contacts]
    force = held(contacts, com).force
    assert held(moved, turn @ com + shift).force == pytest.approx(force, rel=2 * BOUND_GAP)
    more = [SoftContact(c.position, c.axes, PolytopeBody(2 * SMOOTH.vertices)) for c in contacts]
    assert payload(more, pushes(contacts, 2 * F), com).force == pytest.approx(2 * force, rel=1e-9)


def lumpy(seed):
    """A grasp without symmetry, and a centre of mass beside it."""
    rng = np.random.default_rng(seed)
    bodies = [PolytopeBody(np.vstack([v, -v])) for v in rng.normal(size=(2, 40, 3)) * AXES / 2]
    contacts = [SoftContact(c.position, c.axes, b) for c, b in zip(pair(0.004, tilt=0.1), bodies, strict=True)]
    return contacts, rng.normal(size=3) * 0.01, rng


@pytest.mark.parametrize("kind", ["shared", "up_to"])
def test_a_direction_is_a_linear_programme_over_all_points(kind):
    contacts, com, rng = lumpy(1)
    points = []
    for c, push in zip(contacts, pushes(contacts), strict=True):
        C = c.wrench_map(1.0, 1.0, com)
        points.append(np.append(push[:3], push[3:] - np.cross(com, push[:3])) + c.body.vertices @ C[:, 1:].T)
    n = len(points[0])
    both = np.vstack(points) * (2 if kind == "shared" else 1)
    for d in rng.normal(size=(5, 3)):
        d = d / np.linalg.norm(d)
        A, b = np.hstack([both.T, np.append(d, np.zeros(3))[:, None]]), np.zeros(6)
        if kind == "up_to":
            limits = {"A_ub": np.pad(np.kron(np.eye(2), np.ones(n)), ((0, 0), (0, 1))), "b_ub": np.ones(2)}
        else:
            A, b, limits = np.vstack([A, np.append(np.ones(2 * n), 0.0)]), np.append(b, 1.0), {}
        exact = linprog(np.append(np.zeros(2 * n), -1.0), A_eq=A, b_eq=b, **limits)
        found = held(contacts, com, d, kind)
        assert found.borne
        assert found.force == pytest.approx(exact.x[-1], rel=1e-5)
        assert found.upper == pytest.approx(found.force, rel=1e-5)


@pytest.mark.parametrize(("seed", "directions"), [(2, 400), pytest.param(3, 100_000, marks=pytest.mark.long)])
def test_no_direction_of_many_is_worse(seed, directions):
    contacts, com, rng = lumpy(seed)
    found = held(contacts, com)
    least = min(held(contacts, com, d).force for d in rng.normal(size=(directions, 3)))
    assert found.force <= least * (1 + 1e-6)
    assert found.upper >= found.force * (1 - 1e-9)
    assert least <= found.upper * (1 + 60 / np.sqrt(directions) / 10)
    assert held(contacts, com, found.direction).force == pytest.approx(found.upper, rel=1e-3)


@pytest.mark.parametrize("kind", ["shared", "up_to", "fixed"])
@pytest.mark.parametrize("direction", [None, (0.3, -1.0, 0.5)])
@pytest.mark.parametrize("seed", range(2))
def test_a_sum_of_discs_is_exact_where_its_samples_lie_inside(kind, direction, seed):
    rng = np.random.default_rng(seed)
    discs = rng.normal(size=(40, 6)) * np.tile([1, 1, 0.01], 2) * MU * F / 60
    parts = (fibonacci_vertices([1, 1, 100], 8_000) @ discs.reshape(-1, 3).T).reshape(8_000, -1, 2)
    points = np.einsum("mdk,dkc->mc", parts / np.linalg.norm(parts, axis=2, keepdims=True), discs.reshape(-1, 2, 3))
    centre, tilt = rng.normal(0, 0.02, 3), rng.uniform(0, 0.2)
    bodies = DiscBody(discs), PolytopeBody(points)
    exact, sampled = (held(pair(body=body, tilt=tilt), centre, direction, kind) for body in bodies)
    assert sampled.borne
    assert exact.force <= exact.upper <= exact.force * (1 + 1.01 * BOUND_GAP)
    # 8000 motions leave 1e-3 at a limit that an arm makes of small remainders
    assert sampled.force * (1 - BOUND_GAP) <= exact.upper <= sampled.upper * 1.004


def test_facets_are_those_of_a_hull():
    points = np.random.default_rng(0).normal(size=(40, 3))
    hull, facets = ConvexHull(points[:8], incremental=True), Facets(points[:8], incremental=True)
    for n in range(8, 40):
        hull.add_points(points[n : n + 1])
        facets.add_points(points[n : n + 1])
    assert (facets.equations == hull.equations).all()
    assert (facets.simplices == hull.simplices).all()
    assert not hasattr(facets, "volume")  # nobody asks for it, and it takes half of the time
