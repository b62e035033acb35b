"""Thin walls where they are hardest: collapse, snap-in, rims, partial meshes, foils and stiff walls."""

from functools import cache

import numpy as np
import pytest

from softjaw.fem.contact.extract import extract, turned
from softjaw.fem.contact.load_stepping import Stepping, Work
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.objects.gap import Pose
from softjaw.fem.shell.facing import FAR, face
from softjaw.fem.shell.opening import Opening
from softjaw.fem.shell.thin_walled import grasp
from softjaw.fem.shell.wall_material import WallMaterial
from softjaw.fem.shell.wall_mesh import MeshSize, body_mesh
from tests.fem.falling_force import MM, Crossings, Curve, crossings
from tests.fem.grips import e_n, grip, pose, thin

ROUGH = MeshSize(0.004, 0.008, 0.016)
SIZE = MeshSize(0.006, 0.012, 0.02, (0.05, 0.10), 0.013)


@cache
def mesh(symmetry):
    return body_mesh(thin().surface, 4e-4, SIZE, symmetry)


def squeezed(body, share, shift=0.0):
    """State in which the whole wall has come closer to x = 0 by a share of its distance, or moved along x."""
    q = np.zeros((len(body.X), 6))
    q[:, 0] = -share * (body.X - body.D)[:, 0] + shift
    return q.ravel()


@pytest.mark.parametrize("symmetry", [(True, True), (True, False), (False, True), (False, False)])
def test_the_opening_is_the_part_of_the_distance_that_is_left(symmetry):
    body = mesh(symmetry)
    opening = Opening(body)
    assert opening(squeezed(body, 0.0)) == pytest.approx(1.0, abs=1e-12)
    assert opening(squeezed(body, 0.7)) == pytest.approx(0.3, abs=1e-12)
    if not symmetry[0]:
        assert opening(squeezed(body, 0.0, 0.05)) == pytest.approx(1.0, abs=1e-12)
    opening.watch(squeezed(body, 0.5), 2.0)
    with pytest.raises(CheckError, match="between 2 and 4 N"):
        opening.watch(squeezed(body, 1.5), 4.0)


@pytest.mark.long
def test_a_wall_as_soft_as_foam_collapses_before_the_force_is_reached():
    """It folds between the pads; how far it is followed before depends on rounding, so the force is high."""
    soft = grip(thin(2e-4, WallMaterial(1e8, 0.38)), elements=(6, 4, 2), mesh=ROUGH)
    path = soft.load_path([0.02, 0.22, 6.0])
    assert [next(path).wall.opening < 0.75 for _ in range(2)] == [False, True]
    with pytest.raises(CheckError):
        next(path)


def test_a_wall_that_gives_way_is_flagged_and_a_long_side_that_points_down_gives_the_same_patch_turned():
    states = grip(thin(2e-4), elements=(6, 4, 2), mesh=ROUGH).load_path([0.3, 1.5])
    assert [s.wall.snapped for s in states] == [False, True]
    # On a slope the patch differs between the ends of the pad.
    up = pose(0.0, 0.142), pose(np.pi, 0.142)
    turn = np.diag([-1.0, -1.0, 1.0])
    down = tuple(Pose(p.rotation @ turn, p.origin) for p in up)
    assert grasp(thin(), up).flipped == (False,)
    assert grasp(thin(), down).flipped == (True,)
    np.testing.assert_allclose(grasp(thin(), down).poses[0].rotation, up[0].rotation, atol=1e-12)
    finger = next(grip(thin(), z=0.142, elements=(6, 4, 2), mesh=ROUGH).load_path([1.0])).fingers[0]
    patch = extract(finger.pad, finger)
    for signs in ((-1.0, -1.0, 1.0), (1.0, -1.0, 1.0), (-1.0, 1.0, 1.0)):
        once = turned(finger.pad, patch, signs)
        again = turned(finger.pad, once, signs)
        for name in ("centroid", "normal", "corners", "pressure"):
            np.testing.assert_allclose(getattr(again, name), getattr(patch, name), rtol=1e-14)  # signs change
        # the same corner of the grid comes first, and faces are run round in the same sense
        for field in (once, patch):
            sides = field.corners[:, 1] - field.corners[:, 0], field.corners[:, 3] - field.corners[:, 0]
            assert (sides[0][:, 0] > 0).all()
            assert (sides[1][:, 1] > 0).all()


def still(wall):
    none = np.zeros((wall.nodes.max() + 1, 3))
    return none, none.copy()


def test_a_part_of_a_wall_is_not_faced_from_beyond_its_edges_nor_a_flat_bottom_but_the_rim_above_it():
    quarter, whole = (
        grip(thin(), elements=(4, 2, 2), mesh=ROUGH, allowed=(part, part)).problem.fingers[0].wall
        for part in (True, False)
    )
    assert (quarter.closed, whole.closed) == (False, True)
    theta = np.array([-0.02, 0.02, 0.5 * np.pi - 0.02, 0.5 * np.pi + 0.02])
    points = np.column_stack([0.036 * np.cos(theta), 0.036 * np.sin(theta), np.full(4, 0.075)])
    found = face(quarter, points, quarter.places(points), *still(quarter))
    assert (found.gap == FAR).tolist() == [True, False, False, True]
    np.testing.assert_allclose(found.gap[1:3], 1e-3, atol=1e-7)
    points = np.array([[0.036, 1e-3, 0.075], [0.036, 5e-3, 0.1]])
    good, bad = quarter.places(points), np.tile([0.5 * np.pi, quarter.s[-1]], (2, 1))
    here = face(quarter, points, good, *still(quarter))
    there = face(quarter, points, bad, *still(quarter))
    np.testing.assert_allclose(there.gap, here.gap, atol=1e-12)
    np.testing.assert_allclose(bad, good, atol=1e-9)
    flat = thin().surface.flat[0]
    assert quarter.ends[0] == pytest.approx(flat, abs=1e-12)
    s = np.array([flat - 0.01, 0.5 * (flat + thin().surface.wall[0])])
    X, n = thin().surface.jets(np.full(2, 0.5), s)[:, 0], thin().surface.normals(np.full(2, 0.5), s)
    gap = face(quarter, X + 1e-3 * n, quarter.places(X), *still(quarter)).gap
    assert gap[0] == FAR
    assert gap[1] == pytest.approx(1e-3, abs=2e-6)
    # The can ends open at z = 205 mm; a pad at 198 mm stands over by 8 mm.
    finger = next(grip(thin(), z=0.198, elements=(12, 4, 2), mesh=ROUGH, radius=0.013).load_path([0.5])).fingers[0]
    patch = extract(finger.pad, finger)
    height = 0.198 + patch.centroid[:, 0]
    assert patch.pressure[height > 0.2051].max() <= 1e-12 * patch.pressure.max()
    assert patch.pressure[height > 0.2025].max() > 0.3 * patch.pressure.max()
    assert finger.checks.penetration_depth < 0.15 * finger.closing


def closing_and_e_n(elements, size):
    sizes = MeshSize(size * 0.002, size * 0.003, size * 0.006)
    state = next(grip(thin(), elements=elements, mesh=sizes).load_path([3.0])).fingers[0]
    return np.array([state.closing, e_n(state)])


@pytest.mark.long
def test_closing_and_e_n_converge_with_order_two_in_the_walls_mesh_and_by_a_percent_in_the_pads():
    coarse, middle, fine = (closing_and_e_n((16, 8, 4), size) for size in (2.0, 1.0, 0.5))
    assert (np.log2((middle - coarse) / (fine - middle)) > 1.8).all()
    assert (np.abs(fine / middle - 1.0) < 0.005).all()
    np.testing.assert_allclose(closing_and_e_n((32, 16, 8), 1.0), middle, rtol=0.01)


def stepping(close=0.05):
    problem = Curve()
    return Stepping(problem, Crossings(problem, close))


@pytest.mark.parametrize("wanted", [0.3, 1.9, 2.1, 2.4, 2.45, 3.5])
def test_a_walk_lands_on_the_first_crossing(wanted):
    forces = []
    x = stepping().displacement_control(np.zeros(1), wanted, Work(), 0.5 * MM, forces)
    assert x[0] / MM == pytest.approx(crossings(wanted)[0], abs=1e-9)
    assert (np.diff(forces) < 0).any() == (wanted > 2.5)


def test_a_landing_far_from_its_bracket_is_tried_from_closer_and_a_force_that_is_never_reached_is_an_error():
    work = Work()
    x = stepping(close=0.003).displacement_control(np.zeros(1), 2.2, work, 0.5 * MM)
    assert x[0] / MM == pytest.approx(crossings(2.2)[0], abs=1e-9)
    assert work.steps > 8  # brackets were halved
    flat = stepping()
    flat.problem.normal_force = lambda x: 1.0 - np.exp(-x[0] / MM)
    with pytest.raises(ConvergenceError):
        flat.displacement_control(np.zeros(1), 2.0, Work(), 0.5 * MM)
