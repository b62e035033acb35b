"""The contact frame on the whole contact face of a pad: continuous over holes, exact on smooth surfaces."""

from dataclasses import replace

import numpy as np
import pytest

from softjaw.friction.foot import ContactFace, foot
from softjaw.friction.frame import FrameFlag, contact_frame
from tests.friction.test_decisions import shaken
from tests.generators import cyl_mesh, grid_mesh, mesh_patch
from tests.turns import seeded

X = np.array([1.0, 0.0, 0.0])


def height(x, y):
    return 0.3 * (1 - x**2)


def bridge(share, n=24, gap=0.25):
    """A pad that is bent as a parabola and loaded at both sides of a gap, ``share`` of the force on the right one."""
    patch = mesh_patch(grid_mesh(n, 6, 1, 0.4, height))
    x = patch.centroid[:, 0]
    over = np.abs(x) < gap
    lips = np.column_stack([np.sign(x), 0 * x, 0.1 + 0 * x])
    pressure = np.where(over, 0.0, np.where(x > 0, share, 1 - share))
    return replace(patch, normal=np.where(over[:, None], lips, patch.normal), pressure=pressure)


def frames(shares):
    return [contact_frame(bridge(share), X, whole_face=True) for share in shares]


def test_over_a_hole_the_frame_stands_on_the_face_continuously_and_its_origin_on_the_line():
    """By symmetry in the middle, at a corner; the planes of the nearest loaded faces meet above it."""
    patch = bridge(0.5)
    frame = contact_frame(patch, X, whole_face=True)
    assert frame.flag == FrameFlag.CLEAN
    np.testing.assert_allclose(frame.origin, [0, 0, height(0.0, 0.0)], atol=1e-12)
    np.testing.assert_allclose(frame.axes, np.eye(3), atol=1e-9)
    without = contact_frame(patch, X)
    assert without.flag == FrameFlag.HOLE
    assert without.origin[2] == pytest.approx(0.3 * (1 + 1 / 4 * 1 / 3), rel=1e-12)
    # The largest change over a step of the share is in proportion to the step; that of a jump is not.
    def largest(found, count):
        places = np.array([np.concatenate([f.origin, f.axes[2]]) for f in found])
        return np.abs(np.diff(places, axis=0)).max() * count

    coarse, fine = (np.linspace(0.35, 0.65, count + 1) for count in (20, 80))
    assert largest(frames(fine), 80) == pytest.approx(largest(frames(coarse), 20), rel=0.35)
    jumps = [largest([contact_frame(bridge(share), X) for share in s], len(s) - 1) for s in (coarse, fine)]
    assert jumps[1] > 2 * jumps[0]
    for share in np.linspace(0.1, 0.9, 23):
        patch = bridge(share)
        frame = contact_frame(patch, X, whole_face=True)
        arm = frame.axes @ (frame.centre_of_pressure - frame.origin)
        assert np.abs(arm[:2]).max() < 1e-12
        x = patch.corners.reshape(24, 6, 4, 3)[int((frame.origin[0] + 1) * 12), 0, :2]
        along = (frame.origin[0] - x[0, 0]) / (x[1, 0] - x[0, 0])
        assert frame.origin[2] == pytest.approx(x[0, 2] + along * (x[1, 2] - x[0, 2]), abs=1e-12)
    # The frame of the loaded faces does not feel the others; sums may end in other bits.
    whole = bridge(0.3)
    one, two = contact_frame(whole, X), contact_frame(whole.loaded, X)
    np.testing.assert_allclose(one.origin, two.origin, atol=1e-14)
    np.testing.assert_allclose(one.axes, two.axes, atol=1e-12)


def test_the_normal_of_a_skew_cylinder_has_order_two():
    """Exact normal direction 15.8376 degrees; on plane faces the error is up to half of a face's turning angle."""
    errors = []
    for n in (8, 16, 32, 64):
        patch = mesh_patch(cyl_mesh(1, np.pi / 3, 2, n, 4), lambda r: 1 + 0.8 * r[:, 1])
        N = contact_frame(patch, X, whole_face=True).axes[2]
        errors.append(abs(np.degrees(np.arctan2(N[1], N[2])) - 15.8376))
    assert errors[-1] < 0.01
    assert np.polyfit(np.log([8, 16, 32, 64]), np.log(errors), 1)[0] < -1.7


@pytest.mark.parametrize("at", [(-0.6, -0.6), (0.3, 0.2), (-0.3, 0.1), (0.6, -0.4)])
def test_a_line_meets_a_skew_face_where_it_crosses_it(at):
    """Sides of no two directions alike: Newton's method takes several steps, of either sign."""
    face = ContactFace.of(mesh_patch([[[-1, -1, 0], [1, -0.6, 0.2], [0.5, 1, 0.1], [-0.7, 0.4, 0]]]))
    point, _, missed = face.foot(np.array([*at, 1.0]), np.array([0, 0, 1.0]))
    assert not missed
    np.testing.assert_allclose(point[:2], at, atol=1e-12)


def test_a_line_beside_the_face_meets_its_rim_the_nearer_of_two_crossings_counts_and_steps_are_halved():
    face = ContactFace.of(mesh_patch(grid_mesh(4, 3, 1, 0.5, lambda x, y: -(x**2))))
    point, normal, missed = face.foot(np.array([1.5, 0.1, 3.0]), np.array([0, 0, 1.0]))
    assert missed
    np.testing.assert_allclose(point, [1.5, 0.1, -1.0], atol=1e-12)
    assert normal[0] > 0.7  # of the rim, which falls by 1.5 per unit in its last face
    patch = mesh_patch(grid_mesh(4, 3, 1, 0.5, lambda x, y: -(x**2)))
    bent = replace(patch, normal=np.tile([2.0, 0, 1], (12, 1)), pressure=(patch.centroid[:, 0] > 0.5).astype(float))
    assert contact_frame(bent, X, whole_face=True).flag & ~FrameFlag.HOLE == 0
    floors = [grid_mesh(2, 2, 1, 1, lambda x, y, h=h: h + 0 * x) for h in (-1.0, 1.0)]
    patch = mesh_patch(np.concatenate(floors))
    face, N = ContactFace.of(patch), np.array([0, 0, 1.0])
    for z, expected in ((0.0, 1.0), (1e-12, 1.0), (-1e-12, 1.0), (-0.1, -1.0), (0.1, 1.0)):
        start = np.array([0.3, 0.2, z])
        assert face.foot(start, N)[0][2] == pytest.approx(expected, abs=1e-12)
        assert foot(patch, start, N)[0][2] == pytest.approx(expected, abs=1e-12)
    # Pressed far above its ridge a roof's normal leads to the other side; half steps end on the ridge.
    patch = mesh_patch(grid_mesh(2, 1, 1, 1, lambda x, y: -1.5 * np.abs(x)))
    high = replace(patch, centroid=np.add(patch.centroid, [0.01, 0, 2.0]))
    frame = contact_frame(high, X, whole_face=True)
    assert not frame.flag & FrameFlag.CYCLE
    assert frame.iterations > 20
    arm = frame.axes @ (frame.centre_of_pressure - frame.origin)
    assert np.abs(arm[:2]).max() < 1e-9


@pytest.mark.parametrize(("unit", "far"), [(1.0, 1.0), (1.0, 1e3), (1e3, 1.0)])
@seeded
def test_the_frame_on_the_whole_face_turns_with_the_patch_is_found_far_from_the_origin_and_in_any_unit(unit, far, seed):
    """Corners that differ by rounding are still one corner."""
    patch = bridge(0.37, n=8)
    frame = contact_frame(patch, X, whole_face=True)
    turned, R, t = shaken(replace(patch, centroid=unit * patch.centroid, corners=unit * patch.corners), seed, far)
    found = contact_frame(turned, R @ X, whole_face=True)
    assert found.flag == frame.flag
    np.testing.assert_allclose(found.axes, frame.axes @ R.T, atol=1e-9 * far)
    np.testing.assert_allclose(found.origin, unit * R @ frame.origin + t, atol=1e-9 * unit * far)
