"""What a finger sees of a mesh: hollow bodies, holes, facets, mirror images."""

import numpy as np
import pytest
import trimesh

from softjaw.fem.objects.gap import Pose, edges_of, grid_triangles
from softjaw.fem.objects.mesh_holes import border_loops
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.fem.objects.smooth_triangles import smooth_triangles
from softjaw.fem.objects.traced_surface import traced
from softjaw.fem.objects.triangle_tree import TriangleTree, first_hit
from softjaw.fem.objects.triangles import cleaned

BOX = np.array([[-0.012, -0.008, -0.005], [0.012, 0.008, 0.010]])


def turned(profile, columns=64):
    z, r = np.asarray(profile, float)[1:-1].T
    phi = 2 * np.pi * np.arange(columns) / columns
    ring = np.stack([np.cos(phi), np.sin(phi)], axis=1)
    x = np.concatenate([np.insert(radius * ring, 2, height, axis=1) for height, radius in zip(z, r, strict=True)])
    first, last = len(x), len(x) + 1
    x = np.concatenate([x, [[0, 0, profile[0][0]], [0, 0, profile[-1][0]]]])
    i, j, top = np.arange(columns), (np.arange(columns) + 1) % columns, (len(z) - 1) * columns
    fans = np.stack([0 * i + first, j, i], 1), np.stack([0 * i + last, i + top, j + top], 1)
    return x, np.concatenate([grid_triangles(len(z), columns, closed=True), *fans])


def bottle(wall, neck=0.012, radius=0.03, height=0.15):
    z = np.linspace(0.0, height, 40)
    r = neck + (radius - neck) * 0.5 * (1 - np.tanh((z - 0.7 * height) / 0.012))
    outer = [[0.0, 0.0], *np.column_stack([z, r])]
    if not wall:
        return [*outer, [height, 0.0]]
    inside = np.column_stack([z, r - wall])[z > wall][::-1]
    return [*outer, *inside, [wall, inside[-1, 1]], [wall, 0.0]]


def side(z, angle=0.1, radius=0.03):
    a = -np.array([np.cos(angle), np.sin(angle), 0.0])
    return Pose(np.column_stack([[0, 0, 1.0], np.cross(a, [0, 0, 1.0]), a]), np.array([0, 0, z]) - radius * a)


def in_box(n=600, shrunk=0.999, seed=5):
    return np.random.default_rng(seed).uniform(shrunk * BOX[0], shrunk * BOX[1], (n, 3))


def ball(rows=24, columns=48, radius=0.03):
    t = np.pi * np.arange(rows + 1) / rows
    return turned(np.column_stack([-radius * np.cos(t), radius * np.sin(t)]), columns)


def test_a_faceted_ball_is_nearly_a_ball():
    """Facets of h on radius R: flat ones are off by h^2 / (8 R) and more, smooth ones by an order less in h^2 / R^2."""
    errors = []
    for rows in (12, 24):
        bodies = [
            MeshObject(*ball(rows, 2 * rows), None, (), angle).near(side(0.0), *BOX, 0.002) for angle in (0.0, 30.0)
        ]
        points = bodies[0].pose.to_object(in_box())
        exact = np.linalg.norm(points, axis=1) - 0.03
        close = np.abs(exact) < 2e-3
        rough, fine = (np.abs(region.gap(points)[0] - exact)[close].max() for region in bodies)
        assert rough > 0.03 * (np.pi / rows) ** 2 / 8
        assert fine < rough / 12
        errors.append(rough)
    assert np.log2(errors[0] / errors[1]) > 1.6


def test_edges_above_the_crease_angle_stay_and_neighbours_stay_joined():
    """A cylinder of 24 facets: its wall bulges to the round one, its two edges become circles, its ends stay flat."""
    x, triangles = turned([[0, 0], [0, 0.02], [0.05, 0.02], [0.05, 0]], 24)
    smooth = smooth_triangles(x, triangles)
    assert smooth.crease.sum() == 48
    y, small = smooth.refined(np.arange(len(triangles)), 5)
    assert trimesh.Trimesh(y, small, process=False).is_watertight
    r = np.hypot(y[:, 0], y[:, 1])
    end = (np.abs(y[:, 2]) < 1e-12) | (np.abs(y[:, 2] - 0.05) < 1e-12)
    assert np.abs(r[~end] - 0.02).max() < 3e-6  # the facets' own sagitta is 171e-6
    assert y[:, 2].min() > -1e-12
    assert y[:, 2].max() < 0.05 + 1e-12
    assert len(y[end]) > 2 * 24 * 5
    octagon = turned([[0, 0], [0, 0.02], [0.05, 0.02], [0.05, 0]], 8)
    assert smooth_triangles(*octagon).bulge(np.arange(len(octagon[1]))).max() < 1e-15


def test_narrow_triangle_beside_a_bore_does_not_fold():
    phi, graze = 2 * np.pi * np.arange(24) / 24, np.pi / 24 - np.radians(3.0)  # the rim leaves its chord by 7.5 degrees
    ring = 0.006 * np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=1)
    apex = ring[1] + 0.02 * np.array([-np.sin(graze), np.cos(graze), 0.0])
    wall = grid_triangles(2, 24, closed=True)[:, ::-1]
    x, triangles = np.concatenate([ring - [0, 0, 0.01], ring, [apex]]), np.concatenate([wall, [[25, 24, 48]]])
    points, small = smooth_triangles(x, triangles).refined(np.array([len(wall)]), 4)
    a, b, c = points[small].transpose(1, 0, 2)
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()  # it looks up, as its face does


def test_a_straight_wall_between_cones_stays_straight_and_a_round_one_of_many_facets_stays_round():
    """Long facets of a shank between flares of 22 degrees; a waist of facets of 4 degrees; coarse bands of a ball."""
    cones = [(0, 0), (0.03, 0), (0.03, 0.015), (0.018, 0.045), (0.018, 0.135), (0.03, 0.165), (0.03, 0.18), (0, 0.18)]
    z = np.linspace(0.0, 0.12, 25)
    waist = np.vstack([[0, 0], np.column_stack([0.03 - 0.012 * np.sin(np.pi * z / 0.12), z]), [0, 0.12]])
    angle = np.linspace(0.0, np.pi, 13)
    bands = np.column_stack([0.06 * np.sin(angle).round(12), -0.06 * np.cos(angle)])
    single = [(0, 0), (0.015, 0), (0.025, 0.06), (0.015, 0.12), (0, 0.12)]  # joints round it turn by as much
    handle = [(0, 0), (0.016, 0), (0.016, 0.09), (0, 0.13)]  # of few sides, none of which goes on smoothly but in a tip
    cases = [(cones, 64, 4 * 64, 5e-5), (waist, 64, 0, np.inf), (bands, 64, 0, np.inf)]
    cases += [(handle, sides, sides, 1e-15) for sides in (4, 6, 8)]
    for profile, sections, sharp, most in (*cases, *((single, n, n, 6e-4) for n in (16, 24, 32))):
        body = trimesh.creation.revolve(np.asarray(profile, float), sections=sections)
        smooth = smooth_triangles(body.vertices, body.faces)
        turn = np.degrees(smooth.turn)
        assert (smooth.crease & (turn < 30)).sum() == sharp
        assert smooth.bulge(np.arange(len(body.faces))).max() < most
        assert bool(MeshObject(body.vertices, body.faces).sharp_facets(5e-3)) == (sharp > 0)
        assert not (smooth_triangles(body.vertices, body.faces, 31.0).crease & (turn < 30)).any()  # who wants it round


@pytest.mark.parametrize("axis", [0, 1])
def test_the_mirror_image_of_a_mesh_has_the_mirror_image_of_its_gap(axis):
    """A lopsided body, in the pad's frame, mirrored across a plane of the pad."""
    rng = np.random.default_rng(2)
    x, triangles = ball(16, 30)
    x = x + rng.normal(scale=3e-4, size=x.shape)
    pose = side(0.004)
    flip = np.ones(3)
    flip[axis] = -1
    image = pose.to_object(pose.to_pad(x) * flip), triangles[:, ::-1]
    y = in_box()
    g, normal, hessian = MeshObject(x, triangles).near(pose, *BOX, 0.002).gap(pose.to_object(y))
    other = MeshObject(*image).near(pose, *BOX, 0.002).gap(pose.to_object(y * flip))
    R = pose.rotation
    assert np.abs(g - other[0]).max() < 1e-12
    assert np.abs((normal @ R) * flip - other[1] @ R).max() < 1e-9
    assert np.abs(R.T @ hessian @ R * np.outer(flip, flip) - R.T @ other[2] @ R).max() < 1e-5


def test_the_back_of_a_plate_counts_for_nothing_and_behind_a_small_ball_the_gap_has_no_jump():
    """A plate of 3 mm, across the approach: behind its front everything is inside, and the gap is the way to it."""
    plate = trimesh.creation.box((0.003, 0.06, 0.06))
    region = MeshObject(np.asarray(plate.vertices), np.asarray(plate.faces)).near(side(0.0, 0.0, 0.0015), *BOX, 0.002)
    y = in_box()
    assert region.gap(region.pose.to_object(y))[0] == pytest.approx(-y[:, 2], abs=1e-7)
    # A ball smaller than the pad is deep: beside it g is the distance, and no point beside it is inside.
    x, triangles = ball(24, 48, 0.006)
    region = MeshObject(x, triangles).near(side(0.0, 0.0, 0.006), *BOX, 0.002)
    y = in_box(3000)
    g, normal, _ = region.gap(region.pose.to_object(y))
    exact = np.linalg.norm(y - [0, 0, 0.006], axis=1) - 0.006
    for depth, error in ((0.001, 5e-6), (0.004, 1e-4)):
        seen = (y[:, 2] < 0.006) & (np.abs(exact) < depth)
        assert g[seen] == pytest.approx(exact[seen], abs=error)
    beside = np.hypot(y[:, 0], y[:, 1]) > 0.0065
    assert (g[beside] > 0).all()
    assert np.linalg.norm(normal, axis=1).max() < 2.0  # a jump of the samples would show as a steep gradient


def punctured(mesh, place, size):
    x, triangles = mesh
    return x, triangles[np.linalg.norm(x[triangles].mean(axis=1) - place, axis=1) > size]


def test_small_holes_are_filled_flipped_triangles_turned_and_a_large_hole_matters_only_under_a_pad():
    mesh = ball(100, 200)
    x, triangles = punctured(mesh, [0.03, 0, 0], 0.0007)
    assert len(border_loops(triangles)) == 2
    sound = cleaned(x, triangles)
    assert not len(sound.lids)
    assert len(sound.notes) == 1
    assert {tuple(p) for p in sound.points} <= {tuple(p) for p in mesh[0]}
    body = trimesh.Trimesh(sound.points, sound.triangles, process=False)
    assert body.is_watertight
    assert body.volume == pytest.approx(4 / 3 * np.pi * 0.03**3, rel=4e-3)
    x, triangles = ball(16, 32)
    torn = np.delete(triangles, [100, 300], axis=0)
    torn[7] = torn[7, ::-1]
    sound = cleaned(x, np.concatenate([torn, torn[:2]]))
    assert not len(sound.lids)
    assert len(sound.notes) == 3  # doubled, filled, turned
    assert {tuple(sorted(map(tuple, sound.points[t]))) for t in sound.triangles} == {
        tuple(sorted(map(tuple, x[t]))) for t in triangles
    }
    hollow, solid = (traced(MeshObject(*turned(bottle(wall), 48)))[0] for wall in (0.003, None))
    theta, s = np.meshgrid(np.linspace(0, 6, 20), np.linspace(*solid.wall, 30))
    assert hollow.jets(theta, s)[:, 0] == pytest.approx(solid.jets(theta, s)[:, 0], abs=1e-5)
    whole = MeshObject(*ball())
    sound = cleaned(*punctured(ball(), [0, 0.03, 0], 0.008))
    assert len(sound.lids) > 5
    torn = MeshObject(sound.points, sound.triangles, lids=sound.lids, closed=sound.closed)
    x = side(0.0).to_object(in_box())
    assert torn.near(side(0.0), *BOX, 0.002).gap(x)[0] == pytest.approx(whole.near(side(0.0), *BOX, 0.002).gap(x)[0],
                                                                       abs=1e-12)  # fmt: skip
    face = np.column_stack([*(v.ravel() for v in np.meshgrid([-0.004, 0, 0.004], [-0.004, 0, 0.004])), np.zeros(9)])
    assert torn.hole_share(side(0.0), face, 0.01) == 0.0
    assert torn.hole_share(side(0.0, np.pi / 2), face, 0.01) > 0.5
    _, triangles = ball(8, 12)
    beside = [k for k, t in enumerate(triangles) if set(t) <= {12, 13, 24, 25} or set(t) <= {13, 14, 1, 2}]
    loops = border_loops(np.delete(triangles, beside, axis=0))
    assert sorted(map(len, loops)) == [4, 4]
    assert sum(13 in loop for loop in loops) == 2
    # two triangles at an edge of a box: of both ways to fill the hole the edge is the shorter
    box = trimesh.creation.box((0.1, 0.1, 0.1)).subdivide().subdivide().subdivide().subdivide()
    for pair in box.face_adjacency[box.face_adjacency_angles > 1.0][::32]:
        filled = cleaned(box.vertices, np.delete(box.faces, pair, axis=0))
        volume = trimesh.Trimesh(filled.points, filled.triangles).volume
        assert (len(filled.lids), volume) == (0, pytest.approx(1e-3, rel=1e-12))


def test_the_tree_finds_what_all_triangles_give_and_the_edges_of_a_coarse_cylinder_are_all_creases():
    x, triangles = turned(bottle(0.003), 12)
    tree = TriangleTree(x, triangles)
    rng = np.random.default_rng(0)
    points = rng.uniform(-0.04, 0.16, (300, 3))
    g, _, border = tree.signed(points)
    alone = [TriangleTree(x, triangle[None]) for triangle in triangles]
    assert np.abs(g) == pytest.approx(np.min([np.abs(one.signed(points)[0]) for one in alone], axis=0), abs=1e-15)
    assert not border.any()
    torn = np.delete(triangles, rng.integers(0, len(triangles), 9), axis=0)
    edges, times = np.unique(np.sort(edges_of(torn), axis=1), axis=0, return_counts=True)
    g, _, border = TriangleTree(x, torn).signed(points)
    rim = np.abs(TriangleTree(x, edges[times == 1][:, [0, 1, 1]]).signed(points)[0])
    assert border.any()
    assert (border == (rim <= np.abs(g) + 1e-15)).all()
    stack = np.empty(128, np.int64)
    for o, d in zip(points[:100], rng.normal(size=(100, 3)), strict=True):
        t, hit = first_hit(o, d, 0.0, -1, False, tree.nodes, stack)
        every = [first_hit(o, d, 0.0, -1, False, one.nodes, stack)[0] for one in alone]
        assert t == pytest.approx(min(every), abs=1e-12)
        if hit >= 0:
            p, n = o + t * d, tree.face_normals[hit]
            assert abs((p - x[triangles[hit, 0]]) @ n) < 1e-12
    # They turn by the crease angle itself, which rounding must not decide edge by edge; above it they are facets.
    for turn in np.linspace(0.0, 0.5, 8):
        body = trimesh.creation.cylinder(30.0, 100.0, sections=12)
        body.apply_transform(trimesh.transformations.rotation_matrix(turn, [0.3, 0.2, 1.0]))
        points = body.vertices.astype(np.float32).astype(float)
        for angle, creases in ((30.0, 36), (30.1, 24)):
            assert smooth_triangles(points, np.asarray(body.faces), angle).crease.sum() == creases


@pytest.mark.parametrize(("sections", "told"), [(11, True), (12, True), (13, False), (48, False)])
def test_wide_facets_that_stay_sharp_are_told_with_what_they_hide(sections, told):
    body = trimesh.creation.cylinder(radius=0.025, height=0.1, sections=sections)
    edges, off = smooth_triangles(body.vertices, body.faces).doubtful(0.0055)
    assert len(edges) == sections * told
    if told:  # the arc over a chord
        np.testing.assert_allclose(off, 0.025 * (1 - np.cos(np.pi / sections)), rtol=0.02)
    assert bool(MeshObject(body.vertices, body.faces).sharp_facets(0.0055)) == told
