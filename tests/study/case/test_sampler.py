"""Sampled grasps: height fields by closed forms, grasps of bodies whose best place is known, states, determinism."""

import numpy as np
import pytest
import trimesh

from softjaw.study.case import sampler
from softjaw.study.case.bed import CRUSHED, GRID, JawsOnSurface, height_fields, spring_payload
from softjaw.study.case.candidates import with_sampled_grasps
from softjaw.study.case.fit import Jaws, fit_of
from softjaw.study.case.sampler import (
    SampledGrasp,
    antipodal_grasps,
    axes_of,
    offers,
    principal_axes,
    reached_by_hand,
    same_grasp,
    state_of,
)
from softjaw.study.case.task import Task
from softjaw.study.messages import USAGE
from softjaw.study.quantities import COLLIDES, MISSING, WIDE
from softjaw.study.scene import parse_scene
from softjaw.study.units import GRAVITY
from tests.objects.bodies import hollow_bowl, revolved
from tests.study.launching import refusal
from tests.study.scenes import BOX, text_of

PAD = (0.05, 0.022, 0.015)
JAWS = Jaws(PAD, stiffness=8e6, mu=0.8, force=5.0)
TASK = Task(np.zeros(3))
NARROW = Jaws(PAD, stiffness=8e6, mu=0.8, force=5.0, max_opening=0.1)  # the ends are too far apart


def surface(mesh):
    return np.asarray(mesh.vertices, float), np.asarray(mesh.faces, np.int64)


def box(*size):
    return surface(trimesh.creation.box(extents=size))


@pytest.mark.long
def test_height_fields_of_a_ball_are_its_caps_a_bar_is_held_across_its_short_side_a_cylinder_through_its_axis():
    radius = 0.03
    points, triangles = surface(trimesh.creation.icosphere(5, radius))
    x = np.linspace(-0.02, 0.02, 9)
    low, high = height_fields(points, triangles, x, x)
    cap = np.sqrt(radius**2 - x[:, None] ** 2 - x[None, :] ** 2)
    np.testing.assert_allclose(high, cap, atol=2e-5)
    np.testing.assert_allclose(low, -cap, atol=2e-5)
    low, high = height_fields(*box(0.01, 0.01, 0.01), np.linspace(-0.02, 0.02, 5), np.linspace(-0.02, 0.02, 5))
    assert np.isfinite(low).sum() == np.isfinite(high).sum() == 1
    assert (low[2, 2], high[2, 2]) == pytest.approx((-0.005, 0.005))
    # Every pad that lies flat within the 40 x 200 mm faces is as good as any other; none is across the long side.
    grasps = antipodal_grasps(box(0.04, 0.06, 0.2), JAWS._replace(max_opening=0.05), TASK, 6, samples=60)
    good = [g for g in grasps if not g.state]
    assert good
    for g in good:
        assert abs(g.approach[0]) == pytest.approx(1.0, abs=2e-3)
        assert g.opening == pytest.approx(0.04, abs=2e-4)
    assert all(g.opening > 0.05 for g in grasps if g.state == WIDE)
    assert any(g.state == WIDE for g in grasps)
    grasps = antipodal_grasps(surface(trimesh.creation.cylinder(0.03, 0.2, sections=96)), NARROW, TASK, 4, samples=60)
    best = grasps[0]
    assert np.linalg.norm(np.cross(best.point - [0, 0, 0], [0, 0, 1])) < 5e-4
    assert abs(best.approach[2]) < 0.02
    assert abs(best.long_side[2]) > 0.99
    assert best.opening == pytest.approx(0.06, rel=5e-3)


@pytest.mark.long
def test_inner_walls_do_not_count_large_fingers_meet_a_step_and_the_same_seed_gives_the_same_grasps():
    outer, inner = trimesh.creation.icosphere(4, 0.03), trimesh.creation.icosphere(4, 0.028)
    hollow = trimesh.util.concatenate([outer, inner])
    turned = surface(outer)[0], surface(outer)[1][:, ::-1]
    grip = JawsOnSurface(surface(outer), np.zeros(3), np.eye(3), JAWS)
    for other in (surface(hollow), turned):
        same = JawsOnSurface(other, np.zeros(3), np.eye(3), JAWS)
        np.testing.assert_allclose(same.sides[0].pressure, grip.sides[0].pressure, atol=1e-6)
        assert same.opening == pytest.approx(grip.opening, rel=1e-12)
    for side in grip.sides:
        assert side.pressure.sum() * side.cell == pytest.approx(JAWS.force, rel=1e-12)
        np.testing.assert_allclose(side.centre, 0.0, atol=5e-5)
    assert max(grip.misalignment) < 5e-3
    # A plate with a rim that is higher than the pad is thick: the pad fits inside the rim, the finger does not.
    plate, rim = trimesh.creation.box(extents=(0.2, 0.2, 0.01)), trimesh.creation.box(extents=(0.01, 0.2, 0.08))
    rim.apply_translation([0.035, 0, 0])
    body = surface(trimesh.util.concatenate([plate, rim]))
    points = body[0] @ axes_of(np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0]))
    assert fit_of(points, body[1], JAWS)[0] == MISSING
    assert fit_of(points, body[1], JAWS._replace(finger=(0.08, 0.03)))[0] == COLLIDES
    # A pad whose rim meets the higher one between two cells of its face.
    axes, half = axes_of(np.array([0.0, 0.0, -1.0]), np.array([1.0, 0.0, 0.0])), JAWS.pad[0] / 2
    for overlap, state in ((-2e-4, MISSING), (2e-4, COLLIDES)):
        assert state_of(JawsOnSurface(body, np.array([0.03 - half + overlap, 0.0, 0.0]), axes, JAWS)) == state
    body = surface(trimesh.creation.annulus(0.02, 0.03, 0.1))
    one, two = (antipodal_grasps(body, JAWS, TASK, 8, seed=3, samples=40) for _ in range(2))
    assert len(one) == len(two)
    for a, b in zip(one, two, strict=True):
        np.testing.assert_array_equal(a.point, b.point)
        np.testing.assert_array_equal(a.approach, b.approach)
    for i, a in enumerate(one):
        assert not any(same_grasp(a, b, PAD[0]) for b in one[:i] if a.state == b.state)


def at_origin(body, jaws=JAWS):
    return JawsOnSurface(body, np.zeros(3), np.eye(3), jaws)


def test_a_bowl_is_held_from_outside_or_by_its_bottom_and_springs_on_a_face_hold_what_the_planar_contact_holds():
    bowl = surface(hollow_bowl(0.04, 0.003, 0.045))
    grasps = antipodal_grasps(bowl, NARROW, Task(np.array([0.0, 0.0, 0.02])), 6, samples=40)
    assert max((g for g in grasps if not g.state), key=lambda g: g.payload).opening > 0.07
    # [mm]; a few millimetres off the middle a pad bears on the wall and holds a third.
    bowl = revolved(1e-3 * np.array([(0, 0), (25, 0), (45, 12), (68, 52), (64.5, 52), (42.5, 15.5), (24, 4), (0, 4)]))
    best = antipodal_grasps(surface(bowl), NARROW, Task(np.array([0, 0, 0.02])), 4, samples=60)[0]
    assert np.abs(best.point[:2]).max() < 1e-3
    assert abs(best.approach[2]) > 0.999
    # A pad on a large plate: the nearest side of two friction cones, and less for a load that stands beside it.
    grip = at_origin(box(0.2, 0.2, 0.05))
    strain = JAWS.force / (PAD[0] * PAD[1] * JAWS.stiffness * PAD[2])
    assert grip.peak == pytest.approx(1.0 / (1.0 + (strain / CRUSHED) ** 2))
    cones = 2 * JAWS.mu * JAWS.force / np.hypot(1.0, JAWS.mu) / GRAVITY
    assert spring_payload(grip.contacts, TASK) == pytest.approx(cones, rel=0.01)
    assert spring_payload(grip.contacts, Task(np.array([0.0, 0.1, 0.0]))) < 0.2 * cones
    length, width = PAD[:2]
    assert at_origin(box(0.2, 0.2, 0.05)).on_edges == pytest.approx(0.0, abs=1e-12)
    # the object ends between the last cells of the face and the ones beyond it, along the length or the width
    assert at_origin(box(1.001 * length, 0.2, 0.05)).on_edges == pytest.approx(2 / GRID[0])
    assert at_origin(box(0.2, 1.001 * width, 0.05)).on_edges == pytest.approx(2 / GRID[1])


def test_a_small_object_is_held_in_the_middle_of_the_pads_not_where_cells_of_their_faces_favour_it():
    ball = surface(trimesh.creation.icosphere(3, 0.004))
    good = [g for g in antipodal_grasps(ball, JAWS, TASK, 3, samples=10) if not g.state]
    assert good
    assert max(np.linalg.norm(g.point) for g in good) < 1e-4


@pytest.mark.long
def test_no_pad_is_put_over_a_hole_and_grasps_are_spread_over_the_places_of_an_object():
    body = box(0.2, 0.2, 0.05)

    def at(x, z):
        return np.array([[[x, 0.0, z - 0.025], [x + 0.01, 0.0, z - 0.025], [x, 0.01, z - 0.025]]])

    grip = at_origin(body)
    assert grip.over(at(0.0, 0.0))
    assert grip.over(at(0.0, 0.05))  # the other pad
    assert grip.over(at(0.028, 0.0))
    assert not grip.over(at(0.031, 0.0))
    assert not grip.over(at(0.0, 0.02))  # in between, out of reach
    assert len(antipodal_grasps(body, NARROW, TASK, 6, samples=40)) > 3
    corners = body[0][body[1]]
    all_over = corners[np.ptp(corners[..., 2], axis=1) == 0.0]  # both large faces
    # where there is no other place a pad is put over a hole all the same
    assert [g for g in antipodal_grasps(body, NARROW, TASK, 4, samples=40, lids=all_over) if not g.state]
    can = surface(trimesh.creation.cylinder(0.03, 0.2, sections=96))
    heights = sorted(g.point[2] for g in antipodal_grasps(can, NARROW, TASK, 8, samples=150) if not g.state)
    assert len(heights) == 8
    assert heights[-1] - heights[0] > 0.09
    assert max(np.diff(heights)) < 0.05


def sampled_scene(opening=50):
    text = text_of(BOX.replace("50, 40", "40, 60"), "sampled = 3\n", forces="[2, 5]")
    return with_sampled_grasps(parse_scene(text, overrides=[f"gripper.max_opening_mm={opening}"]))


@pytest.mark.long
def test_a_scene_gets_the_grasps_as_poses_once_and_for_all():
    scene = sampled_scene()
    poses = scene.candidates.poses
    assert 1 <= len(poses) <= 3
    assert all(abs(pose.approach[0]) > 0.99 for pose in poses)  # across the 40 mm
    assert scene.digest == sampled_scene().digest
    assert parse_scene(scene.effective_toml()).digest == scene.digest  # what a file keeps needs no sampler


def test_a_scene_without_a_grasp_between_the_pads_is_refused(monkeypatch):
    monkeypatch.setattr(sampler, "SAMPLES", 30)
    with refusal(USAGE) as refused:
        sampled_scene(opening=20)
    assert "max_opening_mm" in str(refused.value)


@pytest.mark.long
def test_grasps_that_the_hand_does_not_reach_are_left_out():
    body = surface(trimesh.creation.annulus(0.02, 0.03, 0.2))

    def grasps(reached):
        return [g for g in antipodal_grasps(body, JAWS, TASK, 8, samples=40, reached=reached) if not g.state]

    everywhere = grasps(lambda _: True)
    assert min(grasp.point[2] for grasp in everywhere) < 0.0
    assert all(grasp.point[2] > 0.0 for grasp in grasps(lambda grasp: grasp.point[2] > 0.0))
    assert [g.payload for g in grasps(lambda _: False)] == [g.payload for g in everywhere]


def test_thin_walls_are_not_held_across_their_ends(monkeypatch):
    monkeypatch.setattr(sampler, "SAMPLES", 30)
    cup = 'shape = "revolution"\nprofile_mm = [[0, 28], [20, 29], [40, 30], [60, 31]]\nwall_mm=1\nwall_material = "PP"'
    [pose] = with_sampled_grasps(parse_scene(text_of(cup, "sampled = 1\n"))).candidates.poses
    assert abs(pose.approach[2]) < 0.1


def test_a_hand_reaches_a_slab_as_far_as_its_fingers_do():
    slab = text_of('shape = "box"\nsize_mm = [40, 200, 200]\nedge_radius_mm = 2', forces="[5]")
    at = [SampledGrasp(np.array([0.0, 0.0, z]), np.eye(3)[0], np.eye(3)[2], 0.04, 1.0) for z in (0.0, 0.09)]
    assert list(map(reached_by_hand(parse_scene(slab, "slab")), at)) == [True, True]
    hand = reached_by_hand(parse_scene(slab, "slab", ['gripper.preset="franka_hand"']))
    assert list(map(hand, at)) == [False, True]


def test_where_little_can_be_gripped_it_is_looked_for_with_more_points():
    rod = trimesh.creation.cylinder(0.01, 0.12, sections=24).apply_translation((0.2, 0, 0))
    body = surface(trimesh.util.concatenate([trimesh.creation.icosphere(3, 0.08), rod]))
    offered = [over for _, over in offers(body, NARROW, TASK, 0, 40, None)]
    assert offered.count(None) > 2 * 40  # most are on the ball, which is too wide
    assert offered.count(False) >= 6


def test_a_start_that_is_still_turning_keeps_none_away_that_meets_its_faces_squarely():
    corners = [(0, 0, 0), (0.06, 0, 0), (0, 0.03, 0), (0, 0, 0.04), (0.06, 0, 0.048), (0, 0.03, 0.04)]
    wedge = trimesh.convex.convex_hull(corners)
    best = antipodal_grasps(surface(wedge), NARROW._replace(force=8.0), Task(wedge.center_mass), 4, samples=60)[0]
    assert abs(best.approach[2]) > 0.99
    axes = [principal_axes(mesh.triangles, mesh.area_faces) for mesh in (wedge, wedge.subdivide())]
    np.testing.assert_allclose(*axes, atol=1e-5)  # the same however the faces are cut
