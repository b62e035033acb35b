"""Hard cases of friction, limit surfaces and scores, each row of one table with the behaviour it has to show.

Every row is tested under its own name: ``pytest tests/test_hard_friction.py -k "duplicated"``. A case has an answer, or
an error or a flag that says what is wrong; none ends in a NaN, an infinity or an exception from a library.
"""

import math
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest
from scipy.spatial import ConvexHull, QhullError

from softjaw.friction.frame import FrameFlag, contact_frame, contact_length, in_frame
from softjaw.friction.motion import SLIDE_X, SLIDE_Y, cor_twists, fibonacci_twists
from softjaw.friction.patch import ContactPatch, NoContactError
from softjaw.friction.torque import pure_torque
from softjaw.friction.wrench import friction_limits, friction_wrench
from softjaw.lsfit.body import hull_volume
from softjaw.lsfit.ellipsoid import axis_aligned_ellipsoid, full_ellipsoid, three_motion_ellipsoid
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.samples import normalised_samples, sample_rank
from softjaw.lsfit.surface import FitFlag
from softjaw.scoring.bodies import fibonacci_vertices, polytope_volume
from softjaw.scoring.quality import ScoreFlag, score
from tests.generators import (
    cap_polar,
    cyl_mesh,
    disc_polar,
    grid_mesh,
    lcg_patch,
    mesh_patch,
    moved,
    points_patch,
    rect_grid,
)
from tests.oracles import least_squares_quartic

X = [1.0, 0.0, 0.0]
ONE_FACE = points_patch([[0, 0]], [2.0])


def values(limits):
    return [limits.f_x, limits.f_y, limits.tau_z]


def samples(patch, rho, twist=None):
    twist = fibonacci_twists(100, rho) if twist is None else twist
    return normalised_samples(friction_wrench(patch, twist, 1.0), twist, patch.load.sum(), rho)


def all_fits(W, T):
    return [axis_aligned_ellipsoid(W), full_ellipsoid(W), least_squares_quartic(W, T), convex_quartic(W, T).surface]


def stacked(*patches):
    fields = ("centroid", "area", "normal", "pressure")
    return ContactPatch(*(np.concatenate([getattr(patch, name) for patch in patches]) for name in fields))


def alternate(patch):
    """Every other normal turned to the other side."""
    return replace(patch, normal=np.where(np.arange(len(patch.load)) % 2, -1, 1)[:, None] * patch.normal)


def single_element_at_the_origin():
    limits = friction_limits(ONE_FACE, 0.5)
    assert values(limits) == [1.0, 1.0, 0.0]
    assert limits.e_n == 0
    surface = three_motion_ellipsoid(*limits.per_unit_force, rho=1.0)
    assert (surface.rank, surface.semi_axes[2], surface.volume) == (2, 0, 0)
    found = score(limits.per_unit_force, limits.per_unit_force, 0.06, 0.06, 0.05)
    assert (found.quality, found.epsilon) == (0, 0)
    assert found.flag == ScoreFlag.NO_TORQUE


def single_tilted_element():
    for theta in (0.0, 0.5, 1.2):
        c, s = math.cos(theta), math.sin(theta)
        tilted = moved(points_patch([[0, 0]], [3.0]), [[1, 0, 0], [0, c, -s], [0, s, c]], [0, 0, 0])
        np.testing.assert_allclose(values(friction_limits(tilted, 0.5)), [1.5, 1.5 * c, 0], atol=1e-15)


def all_pressure_on_a_line():
    line = rect_grid(2.0, 1e-9, 200, 1)
    assert friction_limits(line, 1.0).e_n == pytest.approx(2 / 4, rel=1e-12)
    W, T = samples(line, 2.0)
    assert np.isfinite(W).all()
    assert sample_rank(W) == 3
    assert hull_volume(W) > 0.5
    for surface in all_fits(W, T):
        assert surface.rank == 3
        assert 0.5 < surface.volume < 5


def zero_pressure_elements():
    """Sums over other numbers of faces may end in other bits: 1e-12 is some thousand times that."""
    loaded, other = lcg_patch(3, 50), lcg_patch(4, 50)
    both = stacked(loaded, other)
    both = replace(both, pressure=np.where(np.arange(100) < 50, both.pressure, 0.0))
    twist = np.random.default_rng(0).normal(size=(20, 6))
    np.testing.assert_allclose(friction_wrench(both, twist, 0.7), friction_wrench(loaded, twist, 0.7), rtol=1e-12)
    assert values(friction_limits(both, 1.0)) == pytest.approx(values(friction_limits(loaded, 1.0)), rel=1e-12)
    # found to 1e-9 of itself, from a circle that the empty faces make larger
    assert pure_torque(both, 1.0) == pytest.approx(pure_torque(loaded, 1.0), rel=2e-9)
    frames = contact_frame(loaded, X), contact_frame(both, X)
    np.testing.assert_allclose(frames[1].centre_of_pressure, frames[0].centre_of_pressure, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(frames[1].axes, frames[0].axes, atol=1e-12)


def empty_patch():
    with pytest.raises(NoContactError, match="zero normal force"):
        replace(lcg_patch(1, 10), pressure=np.zeros(10))
    with pytest.raises(NoContactError, match="zero normal force"):
        ContactPatch(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros(0))


def values_that_are_no_values():
    patch = lcg_patch(1, 10)
    for name in ("centroid", "area", "normal", "pressure"):
        for bad in (np.nan, np.inf, -np.inf):
            array = getattr(patch, name).copy()
            array[3] = bad
            with pytest.raises(ValueError, match=rf"{name}\[3.*must be finite.*face 3"):
                replace(patch, **{name: array})
    for name in ("area", "pressure"):
        array = getattr(patch, name).copy()
        array[3] = -1e-9
        with pytest.raises(ValueError, match=rf"{name}\[3\] is -1e-09: it must not be negative"):
            replace(patch, **{name: array})


def normals_of_other_lengths():
    patch = lcg_patch(2, 50)
    for length in (4.0, 0.3, 1e-200, 1e200):
        scaled = values(friction_limits(replace(patch, normal=length * patch.normal), 1.0))
        np.testing.assert_allclose(scaled, values(friction_limits(patch, 1.0)), rtol=1e-15)
    with pytest.raises(ValueError, match=r"normal\[7\] is zero"):
        replace(patch, normal=patch.normal * (np.arange(50) != 7)[:, None])


def centre_of_rotation_in_an_element():
    """The element there gives nothing; ever so little beside it, its full mu p a."""
    centre = np.array([[0.3, -0.2]])
    for angle in (0.0, 0.4):
        s, c = math.sin(angle), math.cos(angle)
        patch = points_patch(centre, [2.0], [[0, s, c]])
        np.testing.assert_array_equal(friction_wrench(patch, cor_twists(centre), 0.5), np.zeros((1, 6)))
        for distance in (1e-9, 1e-12):
            W = friction_wrench(patch, cor_twists(centre - [[distance, 0]]), 0.5)[0]
            assert np.linalg.norm(W[:3]) == pytest.approx(1.0, rel=1e-12)
            np.testing.assert_allclose(W[:3], [0, c, -s], atol=1e-3)


def normal_along_the_velocity():
    patch = points_patch([[0.3, -0.2, 0.1]], [2.0], [[0, 1, 0]])
    np.testing.assert_array_equal(friction_wrench(patch, SLIDE_Y, 0.5), np.zeros((1, 6)))
    np.testing.assert_array_equal(friction_wrench(patch, np.zeros((2, 3)), 0.5), np.zeros((2, 6)))
    assert friction_limits(patch, 0.5).f_y == 0


def centre_of_rotation_at_infinity():
    patch = rect_grid(2, 1, 8, 4)
    np.testing.assert_allclose(friction_wrench(patch, SLIDE_X, 0.5), [[1, 0, 0, 0, 0, 0]], atol=1e-15)
    with pytest.raises(ValueError, match=r"omega = 0"):
        friction_wrench(patch, cor_twists([[np.inf, 0]]), 0.5)


def samples_in_a_plane():
    """Centres of rotation on the x axis never push along x: every fit says so, and carries nothing there."""
    patch = rect_grid(2, 1, 40, 20)
    twist = cor_twists(np.column_stack([np.linspace(-10, 10, 41), np.zeros(41)]))
    W, T = samples(patch, 2.0, twist)
    assert sample_rank(W) == 2
    for surface in all_fits(W, T):
        assert surface.rank == 2
        assert surface.flag & FitFlag.RANK_DEFICIENT
        assert surface.semi_axes[0] == pytest.approx(0, abs=1e-12)
        assert (surface.semi_axes[1:] > 0.25).all()
        assert surface.volume == 0


def duplicated_elements():
    patch = lcg_patch(4, 70)
    half = replace(patch, area=patch.area / 2)
    double = stacked(half, half)
    np.testing.assert_allclose(values(friction_limits(double, 1.0)), values(friction_limits(patch, 1.0)), rtol=1e-14)
    W, T = samples(patch, 2.0)
    twice = np.vstack([W, W]), np.vstack([T, T])
    for one, two in zip(all_fits(W, T), all_fits(*twice), strict=True):
        np.testing.assert_allclose(two.value(W), one.value(W), rtol=1e-6)


def tiny_patch_in_a_large_unit():
    """With rho in proportion a disc of a micrometre is any disc; with rho = 1 its torque all but vanishes."""
    unit, tiny = disc_polar(1, 20, 40), disc_polar(1e-6, 20, 40)
    of_unit, of_tiny = samples(unit, 2.0), samples(tiny, 2e-6)
    np.testing.assert_allclose(of_tiny, of_unit, atol=1e-13)
    np.testing.assert_allclose(full_ellipsoid(of_tiny[0]).A, full_ellipsoid(of_unit[0]).A, rtol=1e-9, atol=1e-12)
    assert contact_length(tiny) == pytest.approx(1e-6 * contact_length(unit), rel=1e-12)
    badly_scaled = samples(tiny, 1.0)[0]
    assert np.abs(badly_scaled[:, 2]).max() < 1e-6
    with_flag = full_ellipsoid(badly_scaled)
    assert with_flag.flag != FitFlag.CLEAN
    assert np.isfinite(with_flag.semi_axes).all()


def pressures_over_twelve_decades():
    patch = lcg_patch(9, 300)
    wide = replace(patch, pressure=10 ** np.linspace(-6, 6, 300))
    exact = math.fsum(math.hypot(*np.cross(n, X)) * f for n, f in zip(wide.normal, wide.load, strict=True))
    assert friction_limits(wide, 1.0).f_x == pytest.approx(exact, rel=1e-15)
    weak = replace(wide, pressure=np.where(np.arange(300) < 150, wide.pressure, 0.0))
    assert friction_limits(weak, 1.0).f_x > 0


def millimetres_or_metres():
    metre = lcg_patch(3, 50)
    milli = replace(metre, centroid=1e3 * metre.centroid, area=1e6 * metre.area, pressure=1e-6 * metre.pressure)
    one, two = friction_limits(metre, 1.0), friction_limits(milli, 1.0)
    np.testing.assert_allclose(values(two), np.array(values(one)) * [1, 1, 1e3], rtol=1e-14)
    (W, T), (W_milli, T_milli) = samples(metre, 2.0), samples(milli, 2e3)
    np.testing.assert_allclose([W_milli, T_milli], [W, T], atol=1e-14)
    for a, b in zip(all_fits(W, T), all_fits(W_milli, T_milli), strict=True):
        np.testing.assert_allclose(b.value(W), a.value(W), rtol=1e-9)


def overhanging_normals():
    """A cap with the half angle 120 degrees: a third of its area looks back, and lessens F_N but no friction."""
    patch = cap_polar(1, np.radians(120), 60, 40)
    frame = contact_frame(patch, X)
    assert frame.flag & FrameFlag.OVERHANG
    assert frame.overhang_share == pytest.approx(1 / 3, rel=1e-12)
    assert frame.overhang_count == 15 * 40
    local = in_frame(patch, frame)
    limits, projected = friction_limits(local, 1.0), friction_limits(local, 1.0, "pcm_projected")
    assert limits.F_N == pytest.approx(np.pi * math.sin(np.radians(120)) ** 2, rel=1e-3)
    assert projected.f_x == pytest.approx(local.load @ np.abs(local.normal[:, 2]), rel=1e-12)
    assert projected.f_x > limits.F_N * 1.5


def inconsistent_orientation():
    """Friction does not know which side a normal points to; the normal force does, so the frame says it is unsure."""
    patch = mesh_patch(cyl_mesh(1, 0.6, 2, 12, 12))
    one, two = friction_limits(patch, 0.5), friction_limits(alternate(patch), 0.5)
    assert values(one) == pytest.approx(values(two), rel=1e-14)  # other signs round alike, but order may differ
    assert abs(two.F_N) < 0.1 * one.F_N
    assert not contact_frame(patch, X).flag & FrameFlag.ORIENTATION
    fifth = np.where(np.arange(len(patch.load)) % 5 == 0, -1, 1)[:, None]
    assert contact_frame(replace(patch, normal=fifth * patch.normal), X).flag & FrameFlag.ORIENTATION
    with pytest.raises(NoContactError, match="normals of the patch cancel"):
        contact_frame(points_patch([[0, 0], [1, 0]], [1, 1], [[0, 0, 1], [0, 0, -1]]), X)


def pressure_around_a_hole():
    patch = mesh_patch(grid_mesh(5, 5, 1, 1))
    ring = replace(patch, pressure=(np.linalg.norm(patch.centroid, axis=1) > 0.1).astype(float))
    frame = contact_frame(ring, X)
    assert frame.flag == FrameFlag.HOLE
    np.testing.assert_allclose(frame.origin, 0, atol=1e-15)
    np.testing.assert_allclose(frame.axes, np.eye(3), atol=1e-15)


def digits_next_to_an_element():
    """The speed is formed as a difference, so no digit is lost however near the axis runs; |f| = mu p a."""
    for distance in 10.0 ** np.arange(-12, 0):
        offset = np.array([[0.6, 0.8]]) * distance
        place = np.array([[0.25, -0.5]])
        exact_offset = (place + offset) - place
        W = friction_wrench(points_patch(place, [2.0]), cor_twists(place + offset), 0.5)[0]
        direction = np.array([exact_offset[0, 1], -exact_offset[0, 0]]) / np.linalg.norm(exact_offset)
        np.testing.assert_allclose(W[:2], direction, atol=1e-14)


def failure_of_qhull():
    """A hull that Qhull refuses is joggled; its volume is right to 1e-4."""
    vertices = fibonacci_vertices((0.8, 0.6, 0.15), 30)
    exact = polytope_volume(vertices)

    def moody(points, qhull_options=None, **options):
        if qhull_options is None:
            raise QhullError("QH6271 topology error")
        return ConvexHull(points, qhull_options=qhull_options, **options)

    with mock.patch("softjaw.scoring.bodies.ConvexHull", moody):
        np.testing.assert_allclose(polytope_volume(vertices), exact, rtol=1e-4)


ROWS = {
    "single element at the origin": single_element_at_the_origin,
    "single tilted element": single_tilted_element,
    "all pressure on a line": all_pressure_on_a_line,
    "zero-pressure elements": zero_pressure_elements,
    "all pressures zero": empty_patch,
    "NaN, infinite or negative values": values_that_are_no_values,
    "normals that are not of unit length": normals_of_other_lengths,
    "COR exactly at an element centre": centre_of_rotation_in_an_element,
    "normal parallel to the velocity": normal_along_the_velocity,
    "COR at infinity": centre_of_rotation_at_infinity,
    "colinear CORs, data in a plane": samples_in_a_plane,
    "duplicated elements and wrenches": duplicated_elements,
    "e_n near zero beside rho": tiny_patch_in_a_large_unit,
    "pressures over 12 decades": pressures_over_twelve_decades,
    "mm or m": millimetres_or_metres,
    "normals beyond 90 degrees": overhanging_normals,
    "inconsistent orientation of normals": inconsistent_orientation,
    "centre of pressure in a hole": pressure_around_a_hole,
    "kernel next to an element centre": digits_next_to_an_element,
    "failure of Qhull": failure_of_qhull,
}


@pytest.mark.parametrize("row", ROWS)
def test_hard_case(row):
    ROWS[row]()
