"""Volume of two contacts in any pose: against hulls in 6 dimensions, closed forms and laws of scale."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from jobs.graspit import graspit_vertices
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.closed_form import volume_l1, volume_linf
from softjaw.scoring.contact import PolytopeBody, SoftContact, ellipsoid_matrix, fibonacci_vertices
from softjaw.scoring.fibre import hull_mesh, inner_points
from softjaw.scoring.pose import joint_pairs, mixed_area, pose_volume
from softjaw.scoring.quality import grasp_score
from tests.generators import points_patch
from tests.lsfit.test_body import body_of, discs, sum_volume
from tests.scoring.grasps import A, B, facing

POSES = [(0, 0, (0, 0, 0)), (10, 10, (0, 0, 0)), (30, -20, (0.1, 0.3, 0.2)), (60, 5, (0, 0.2, 0.4)),
         (80, 85, (0, 0.2, 0.1)), (20, 160, (0, 0.2, 0.1)), (90, 0, (0, 0, 0.3)), (0, 180, (0, 0.1, 0))]  # fmt: skip


def tilted(angle1, angle2, offset=(0, 0, 0), bodies=(A, B), d=1.3):
    """Contacts whose normals are turned away from facing, in degrees."""
    return facing(*bodies, d, np.radians([angle1, angle2]), offset)


def anywhere(rng, body1, body2):
    turns = Rotation.random(2, random_state=rng).as_matrix()
    return [SoftContact(rng.normal(size=3), R, body) for R, body in zip(turns, (body1, body2), strict=True)]


def hull_volumes(contacts, object_length, contact_length):
    """Volumes of the hulls of all sums of two wrenches, and of the wrenches with 0."""
    wrenches = []
    for contact in contacts:
        V = contact.body.vertices
        loads = np.column_stack([np.ones(len(V)), V])
        wrenches.append(np.vstack([np.zeros(6), loads @ contact.wrench_map(object_length, contact_length).T]))
    sums = (wrenches[0][:, None] + wrenches[1]).reshape(-1, 6)
    return ConvexHull(sums, qhull_options="Qt").volume, ConvexHull(np.vstack(wrenches), qhull_options="QJ").volume


def smooth(body):
    """An ellipsoid that does not tell that it is one."""
    told = ("support", "support_points", "volume", "shadow_area")
    return SimpleNamespace(**{name: getattr(body, name) for name in told})


@pytest.mark.parametrize("pose", POSES)
def test_polytopes_have_the_volume_of_their_hull_in_six_dimensions(pose):
    vertices = [PolytopeBody(fibonacci_vertices(axes, m)) for axes, m in ((A, 9), (B, 7))]
    contacts = tilted(*pose, bodies=vertices)
    found, hulls = pose_volume(*contacts, 1.0, 0.7), hull_volumes(contacts, 1.0, 0.7)
    assert found.linf == pytest.approx(hulls[0], rel=1e-9)
    assert found.l1 == pytest.approx(hulls[1], rel=1e-6)


@pytest.mark.parametrize("kind", ["ellipsoid", "graspit"])
@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_facing_contacts_have_the_closed_form_however_they_are_turned_about_their_line(kind, turn):
    bodies = [Ellipsoid.of_axes(a) if kind == "ellipsoid" else PolytopeBody(graspit_vertices(a)) for a in (A, B)]
    one, two = tilted(0, 0, bodies=bodies)
    x, y, N = two.axes
    c, s = math.cos(turn), math.sin(turn)
    two = SoftContact(two.position, [c * x + s * y, c * y - s * x, N], two.body)
    sizes = [size for body in bodies for size in (body.volume / 0.7, body.shadow_area)]
    volume = pose_volume(one, two, 0.7, 0.7)
    assert volume.linf == pytest.approx(volume_linf(*sizes, 1.3 / 0.7), rel=1e-9)
    assert volume.l1 == pytest.approx(volume_l1(*sizes, 1.3 / 0.7), rel=1e-8)


@pytest.mark.parametrize("seed", range(4))
def test_the_error_is_stated_and_kept(seed):
    rng = np.random.default_rng(seed)
    contacts = anywhere(rng, *(Ellipsoid.of_axes(rng.uniform(0.05, 1, 3)) for _ in "12"))
    fine = pose_volume(*contacts, 1.0, 1.0, relative_error=1e-9)
    usual = pose_volume(*contacts, 1.0, 1.0)
    assert usual.relative_error <= 1e-5
    np.testing.assert_allclose(usual[:2], fine[:2], rtol=1e-5)


def test_laws_of_scale_and_motion_and_bodies_known_by_their_support_are_within_the_stated_error():
    rng = np.random.default_rng(7)
    one, two = anywhere(rng, *map(Ellipsoid.of_axes, rng.uniform(0.1, 1, (2, 3))))
    exact = pose_volume(one, two, 1.0, 1.0, relative_error=1e-8)
    Q, shift = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3)
    moved = [SoftContact(Q @ c.position + shift, c.axes @ Q.T, c.body) for c in (one, two)]
    same = pose_volume(*moved, 1.0, 1.0, relative_error=1e-8), pose_volume(two, one, 1, 1, shift, relative_error=1e-8)
    longer = [SoftContact(1e3 * c.position, c.axes, Ellipsoid.of_axes(c.body.semi_axes * [1, 1, 1e3])) for c in moved]
    same += (pose_volume(*longer, 1e3, 1e3, relative_error=1e-8),)
    for found in same:
        np.testing.assert_allclose(found[:2], exact[:2], rtol=1e-7)
    np.testing.assert_allclose(pose_volume(one, two, 2.0, 2.0)[:2], np.array(exact[:2]) / 8, rtol=1e-5)
    hidden = [smooth(Ellipsoid.of_axes(a)) for a in (A, B)]
    for pose in POSES[1:4]:
        exact = pose_volume(*tilted(*pose), 1.0, 0.7, relative_error=1e-9)
        for bodies in (hidden, [Ellipsoid.of_axes(A), hidden[1]]):
            found = pose_volume(*tilted(*pose, bodies=bodies), 1.0, 0.7)
            assert 1e-5 < found.relative_error < 5e-4
            np.testing.assert_allclose(found[:2], exact[:2], rtol=found.relative_error / 3)


@pytest.mark.parametrize("angle", [30, 90])
def test_friction_of_two_points_is_a_sum_of_two_discs_in_any_pose(angle):
    """Sums of regular polygons inscribed in the discs miss in proportion to the square of a side."""
    patches = [points_patch([[-1, 0], [0.5, 0.4]], [1.0, 2.0]), points_patch([[0.2, 0.7], [-0.4, 0.1]], [0.05, 1.0])]
    pose, polygons = (angle, -20, (0.1, 0.3, 0.2)), []
    for k in (40, 80):
        phi = 2 * np.pi * np.arange(k) / k
        e = np.column_stack([np.cos(phi), np.sin(phi)])
        sums = [((e @ one)[:, None] + e @ two).reshape(-1, 3) for one, two in (discs(p, 2.0) for p in patches)]
        polygons.append(np.array(pose_volume(*tilted(*pose, bodies=[PolytopeBody(V) for V in sums]), 1.0, 0.7)[:2]))
    exact = polygons[1] + (polygons[1] - polygons[0]) / 3
    found = pose_volume(*tilted(*pose, bodies=[body_of(p, 2.0, 2000) for p in patches]), 1.0, 0.7)
    assert found.relative_error < 1e-3
    np.testing.assert_allclose(found[:2], exact, rtol=found.relative_error)


def test_friction_of_points_that_face_each_other_is_scored_within_the_stated_error():
    """In closed form by the volumes of sums of discs; loads over two decades."""
    patch = points_patch([[-1, 0], [0.5, 0.4], [0.3, -0.8]], [1.0, 0.02, 0.3])
    body, V = body_of(patch, 2.0, 2000), sum_volume(discs(patch, 2.0)) / 0.7
    exact = [f(V, body.shadow_area, V, body.shadow_area, 1.3) for f in (volume_linf, volume_l1)]
    found = grasp_score(tilted(0, 0, bodies=(body, body)), 1.0, 0.7, with_epsilon=False)
    assert found.error < 1e-3
    np.testing.assert_allclose([found.quality, found.quality_l1], exact, rtol=found.error)


@pytest.mark.parametrize(("axes1", "flat"), [
    ((0.8, 0.6, 0), False), ((0, 0.6, 0.1), False), ((0, 0, 0.1), False), ((0.5, 0, 0), False), ((0, 0, 0), True),
])  # fmt: skip
def test_contacts_that_do_not_carry_every_load(axes1, flat):
    """The limit of thin bodies; a point without friction leaves fewer than 6 dimensions."""
    pose = (30, -20, (0.1, 0.3, 0.2))
    body = Ellipsoid.of_axes(axes1)
    found = pose_volume(*tilted(*pose, bodies=[body, Ellipsoid.of_axes(B)]), 1.0, 1.0)
    thin = Ellipsoid.of_axes(np.maximum(axes1, 1e-7))
    limit = pose_volume(*tilted(*pose, bodies=[thin, Ellipsoid.of_axes(B)]), 1.0, 1.0)
    np.testing.assert_allclose(found[:2], limit[:2], rtol=1e-4, atol=1e-8)
    assert (found.linf == 0) == flat
    if np.count_nonzero(axes1) == 2:
        by_support = pose_volume(*tilted(*pose, bodies=[smooth(body), Ellipsoid.of_axes(B)]), 1.0, 1.0)
        np.testing.assert_allclose(by_support[:2], limit[:2], rtol=by_support.relative_error + 1e-5)


def test_no_volume_in_fewer_than_six_dimensions_and_mixed_areas_of_polygons():
    points = [Ellipsoid.of_axes([1, 1, 0])] * 2
    cases = [
        tilted(0, 0, bodies=points), tilted(20, -30, (0, 0.1, 0.2), bodies=points),  # no torque about their line
        tilted(0, 0, d=0.0), tilted(90, 90), tilted(90, -90),  # one place; normals across the line
        tilted(10, 10, bodies=[Ellipsoid.of_axes([0, 0, 0])] * 2),
        tilted(10, 10, bodies=[PolytopeBody(np.zeros((1, 3)))] * 2),
    ]  # fmt: skip
    for contacts in cases:
        assert pose_volume(*contacts, 1.0, 1.0) == (0, 0, 0)
    # V(P, P) is the area, and |P + Q| = |P| + 2 V + |Q|.
    P, Q = np.random.default_rng(2).normal(size=(2, 9, 2))
    sums = (P[:, None] + Q).reshape(-1, 2)

    def sides(points):
        ring = points[ConvexHull(points).vertices]
        step = np.roll(ring, -1, axis=0) - ring
        return np.column_stack([step[:, 1], -step[:, 0]])

    p, q, both = (ConvexHull(points).volume for points in (P, Q, sums))
    assert mixed_area(sides(P), sides(P)) == pytest.approx(p, rel=1e-13)
    assert mixed_area(sides(P), sides(Q)) == pytest.approx((both - p - q) / 2, rel=1e-12)
    n1, n2, direction = sides(P), sides(Q), np.array([0.3, -0.7])
    share = np.array([[np.linalg.solve(np.column_stack([-a, b]), direction) for b in n2] for a in n1])
    cross = np.abs(n1[:, None, 0] * n2[:, 1] - n1[:, None, 1] * n2[:, 0])
    assert joint_pairs(n1, n2, direction) == pytest.approx(cross[(share > 0).all(axis=2)].sum(), rel=1e-12)


def test_hulls_and_their_points():
    turned = Ellipsoid(np.random.default_rng(1).normal(size=(3, 3)))
    np.testing.assert_allclose(ellipsoid_matrix(Ellipsoid.of_axes(A)), np.diag(A), atol=1e-15)
    root = ellipsoid_matrix(turned)
    np.testing.assert_allclose([root, root @ root], [root.T, turned.F @ turned.F.T], atol=1e-14)

    def volume(points):
        w, faces = hull_mesh(points)
        return np.linalg.det(w[faces]).sum() / 6

    for body in (turned, turned.scaled([1, -1, 1])):
        assert 0.99 * body.volume < volume(inner_points(smooth(body), 5000)) < body.volume
    cube = PolytopeBody(np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3))
    assert volume(cube.vertices) == pytest.approx(8, rel=1e-12)
    for flat in ([1, 1, 0], [0, 1, 0]):
        assert abs(volume(cube.vertices * flat)) < 1e-5
    assert (cube.volume, cube.shadow_area) == pytest.approx((8, 4))
