"""No decision about a patch hangs on rounding: rotations and changes of a few units in the last place change none."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softjaw.friction.frame import FrameFlag, contact_frame, in_frame, wound
from softjaw.friction.motion import SLIDE_X, TURN_Z
from softjaw.friction.patch import ContactPatch, NoContactError
from softjaw.friction.wrench import friction_limits, friction_wrench, pure_torque
from tests.generators import cap_polar, cyl_mesh, cylinder_grid, grid_mesh, mesh_patch, points_patch
from tests.turns import seeded

X = np.array([1.0, 0.0, 0.0])
EPS = np.finfo(float).eps


def ulps(values, rng, most=4):
    return values + most * EPS * np.abs(values).max() * rng.uniform(-1, 1, values.shape)


def shaken(patch, seed, far=1.0):
    """The patch turned and moved at random, every number changed by a few ulp; and the rotation."""
    rng = np.random.default_rng(seed)
    R, t = Rotation.random(random_state=rng).as_matrix(), far * rng.uniform(-1, 1, 3)
    corners = None if patch.corners is None else ulps(patch.corners @ R.T + t, rng)
    parts = ulps(patch.centroid @ R.T + t, rng), patch.area, ulps(patch.normal @ R.T, rng), patch.pressure
    return ContactPatch(*parts, corners), R, t


def joined(*patches):
    names = ("centroid", "area", "normal", "pressure", "corners")
    return ContactPatch(*(np.concatenate([getattr(p, name) for p in patches]) for name in names))


def strip(x0, z0, x1, z1):
    return [[x0, -1, z0], [x1, -1, z1], [x1, 1, z1], [x0, 1, z0]]


def with_a_sliver():
    """A cylinder and, on one of its edges, a face without area, whose corners have no order."""
    patch = mesh_patch(cyl_mesh(1, 0.6, 2, 12, 12))
    a, b = patch.corners[70, 0], patch.corners[70, 1]
    line = np.stack([a, a + (b - a) / 3, b, a + (b - a) / 1.7])
    normal, pressure = patch.normal[70][None], patch.pressure[70][None]
    return joined(patch, ContactPatch(line.mean(axis=0)[None], [1e-12], normal, pressure, line[None]))


def wound_the_other_way():
    """A cylinder whose normals are right, with one cell wound the other way."""
    patch = mesh_patch(cyl_mesh(1, 0.6, 2, 12, 12))
    corners = patch.corners.copy()
    corners[31] = corners[31, ::-1]
    return replace(patch, corners=corners)


def flipped():
    patch = mesh_patch(cyl_mesh(1, 0.6, 2, 12, 12))
    return replace(patch, normal=np.where(np.arange(len(patch.load)) % 5 == 0, -1, 1)[:, None] * patch.normal)


def trough():
    """A floor between two walls at exactly 90 degrees to it."""
    return mesh_patch([strip(-1, 1, -1, 0), strip(-1, 0, 0, 0), strip(0, 0, 1, 0), strip(1, 0, 1, 1)])


def prism():
    """Three sides of a triangular prism, 120 degrees apart, the first one pressed hardest."""
    h = np.sqrt(3)
    sides = [strip(1, 0, -1, 0), strip(-1, 0, 0, h), strip(0, h, 1, 0)]
    return replace(mesh_patch(sides), pressure=np.array([9.0, 1.0, 1.0]))


# Every patch with the flags that it has, and the faces that are counted as turned away.
CLEAN, MIXED, WINDING = FrameFlag.CLEAN, FrameFlag.ORIENTATION, FrameFlag.WINDING
OVERHANG, CENTRES = FrameFlag.OVERHANG, FrameFlag.NO_CORNERS
KNOWN = {
    "sliver": (with_a_sliver, CLEAN, 0),
    "wound the other way": (wound_the_other_way, WINDING, 0),
    "flipped": (flipped, MIXED | OVERHANG, 29),
    "walls at 90 degrees": (trough, CLEAN, 0),
    "sides at 120 degrees": (prism, OVERHANG, 2),
    # the line through the centre of pressure runs through a vertex, and lies between plates at equal distances
    "vertex": (lambda: mesh_patch(grid_mesh(4, 4, 1, 1, lambda x, y: -(x**2 + y**2) / 2)), CLEAN, 0),
    "two floors": (lambda: mesh_patch([strip(-1, -1, 1, -1), strip(-1, 1, 1, 1)]), CLEAN, 0),
    "cap of half angle 120 degrees": (lambda: cap_polar(1, np.radians(120), 12, 8), OVERHANG | CENTRES, 24),
    "cylinder of centres": (lambda: cylinder_grid(1, 1, 2, 6, 7), CENTRES, 0),
}


@pytest.mark.parametrize("name", KNOWN)
@seeded
def test_the_contact_frame_turns_with_the_patch_and_keeps_its_flags(name, seed):
    """Flags, counted faces, and origin and axes to 1e-9 of the patch's size."""
    make, flag, count = KNOWN[name]
    patch = make()
    frame = contact_frame(patch, X)
    assert (frame.flag, frame.overhang_count) == (flag, count)
    turned, R, t = shaken(patch, seed)
    found = contact_frame(turned, R @ X)
    assert (found.flag, found.overhang_count, found.iterations) == (flag, count, frame.iterations)
    np.testing.assert_allclose(found.axes, frame.axes @ R.T, atol=1e-9)
    np.testing.assert_allclose(found.origin, R @ frame.origin + t, atol=1e-9)


@seeded
def test_the_sides_of_faces_are_decided_or_undecided_for_good(seed):
    patch = joined(with_a_sliver(), wound_the_other_way(), trough())
    # a face that stands at 90 degrees to its own normal has no side either
    normal = patch.normal.copy()
    normal[5] = patch.corners[5, 1] - patch.corners[5, 0]
    patch = replace(patch, normal=normal)
    expected = np.ones(len(patch.load))
    expected[[144, 5]], expected[145 + 31] = 0, -1
    assert wound(patch).tolist() == wound(shaken(patch, seed)[0]).tolist() == expected.tolist()  # -1, 0 or 1


@seeded
def test_what_has_no_frame_never_gets_one(seed):
    ring = cylinder_grid(1, np.pi, 2, 12, 3)  # pressed from all sides
    turned, R, _ = shaken(ring, seed)
    with pytest.raises(NoContactError):
        contact_frame(turned, R @ X)
    plate, R, _ = shaken(mesh_patch(grid_mesh(3, 2, 1, 1)), seed)
    with pytest.raises(ValueError, match="parallel"):
        contact_frame(plate, R @ [0, 0, 1])


@seeded
def test_a_face_at_the_axis_of_rotation_rests(seed):
    """The middle one of three faces on a line: the motion about it moves it by rounding alone."""
    rng = np.random.default_rng(seed)
    R = Rotation.random(random_state=rng).as_matrix()
    r = np.array([[-0.3, 0.2, 0.1], [0, 0, 0], [0.3, -0.2, -0.1]])
    normal = np.array([[0, 0.6, 0.8], [0, 0, 1], [0, -0.6, 0.8]])
    patch = ContactPatch(ulps(r @ R.T, rng), np.ones(3), normal @ R.T, [1.0, 5.0, 1.0])
    turn, slide = np.concatenate([np.zeros(3), R[:, 2]]), np.concatenate([R[:, 2], np.zeros(3)])
    expected = friction_wrench(ContactPatch(r, np.ones(3), normal, [1.0, 5.0, 1.0]), [[0, 0, 0, 0, 0, 1.0]], 0.5)[0]
    found = friction_wrench(patch, turn, 0.5)[0]
    np.testing.assert_allclose(found[:3] @ R, expected[:3], atol=1e-12)
    np.testing.assert_allclose(found[3:] @ R, expected[3:], atol=1e-12)
    # along its normal the middle face does not slide either, and the others do
    along = friction_wrench(patch, slide, 0.5)[0]
    assert np.linalg.norm(along[:3]) == pytest.approx(2 * 0.5 * 0.6, rel=1e-12)


@seeded
def test_normals_that_cancel_leave_no_normal_force_to_divide_by(seed):
    rng = np.random.default_rng(seed)
    patch = points_patch([[0, 0], [1, 0], [0, 1]], [1, 1, 1], [[0.6, 0, 0.8], [0, 0, -1], [-0.6, 0, 0.2]])
    patch = replace(patch, normal=ulps(patch.normal, rng))
    limits = friction_limits(patch, 0.5)
    balanced = replace(patch, pressure=np.array([1.0, 1.0, 1.0]) * [1 / 0.8, 1.0, 1e-300])
    assert np.isnan(friction_limits(balanced, 0.5).e_n_projected)
    assert limits.F_N > 0
    assert np.isfinite(limits.e_n_projected)


@seeded
def test_the_pure_torque_turns_with_the_patch(seed):
    patch = in_frame(trough(), contact_frame(trough(), X))
    again, R, _ = shaken(trough(), seed)
    again = in_frame(again, contact_frame(again, R @ X))
    assert pure_torque(again, 0.5) == pytest.approx(pure_torque(patch, 0.5), rel=1e-8)


def test_motions_and_loads_of_the_frame_are_untouched_by_the_margins():
    """What lies beyond a margin is decided: a face 1e-12 from the axis slides in full, 1e-5 rad is an overhang."""
    patch = points_patch([[1e-12, 0], [1, 0]], [1, 1])
    for motion, component in ((TURN_Z, 1), (SLIDE_X, 0)):
        assert friction_wrench(patch, motion, 1.0)[0, component] == pytest.approx(2.0, rel=1e-12)
    leaning = replace(trough(), corners=None)
    normal = leaning.normal.copy()
    normal[0] = [np.cos(1e-5), 0, -np.sin(1e-5)]
    frame = contact_frame(replace(leaning, normal=normal, pressure=np.array([1.0, 1e4, 1e4, 1.0])), X)
    assert frame.overhang_count == 1
