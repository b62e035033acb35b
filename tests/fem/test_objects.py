"""Analytic objects: derivatives, distances with a closed form, shapes of profiles, the first touch."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from softjaw.fem.objects.gap import NoContactError, Pose, first_touch
from softjaw.fem.objects.shapes import Box, EllipticCylinder, Plane, Revolution, Sphere
from tests.fem.reference import slopes

MM = 1e-3
BOTTLE = MM * np.array([
    [0, 0], [0, 15], [0, 28], [3, 33], [20, 33], [50, 33], [80, 33], [100, 25], [115, 14], [125, 12],
    [140, 12], [150, 12],
])  # fmt: skip
SHAPES = {
    "plane": Plane(0.02), "sphere": Sphere(0.03), "elliptic cylinder": EllipticCylinder(0.03, 0.012, 0.1),
    "elliptic stub": EllipticCylinder(0.03, 0.02, 0.008), "box": Box(np.array([0.05, 0.06, 0.07]), 0.008),
    "sharp box": Box(np.array([0.05, 0.06, 0.07]), 0.0), "bottle": Revolution(BOTTLE),
    "open tube": Revolution([[0, 0.03], [0.1, 0.03]]), "spindle": Revolution([[0, 0], [0.05, 0.03], [0.1, 0]]),
}  # fmt: skip
X_AXIS, Z_AXIS = np.array([1.0, 0, 0]), np.array([0, 0, 1.0])


@pytest.fixture(params=SHAPES)
def shape(request):
    return SHAPES[request.param]


def around(shape, n=300, low=-3e-3, high=20e-3):
    rng = np.random.default_rng(5)
    lower, upper = shape.bounds
    x = rng.uniform(lower - high, upper + high, (20 * n, 3))
    g = shape.gap(x)[0]
    return x[(g > low) & (g < high)][:n]


def pose(origin, approach, long_side=Z_AXIS):
    z = np.asarray(approach, dtype=float)
    return Pose(np.stack([long_side, np.cross(z, long_side), z], axis=1), np.asarray(origin, dtype=float))


def face(nx=11, ny=7, length=0.05, width=0.022):
    x, y = np.meshgrid(np.linspace(-length / 2, length / 2, nx), np.linspace(-width / 2, width / 2, ny), indexing="ij")
    return np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3)


def test_normal_and_hessian_are_derivatives_of_the_gap_which_is_a_distance_and_zero_on_the_surface(shape):
    x, h = around(shape), 1e-7
    _, normal, H = shape.gap(x)
    assert np.abs(np.linalg.norm(normal, axis=1) - 1).max() < 1e-14
    assert np.abs(slopes(lambda y: shape.gap(y)[0], x, 1e-6) - normal).max() < 2e-6
    error = np.abs(slopes(lambda y: shape.gap(y)[1], x, h) - H).max(axis=(1, 2))
    # where a flat side meets its rounding, the curvature jumps between the two points of the difference
    assert np.mean(error > 1e-5 * np.abs(H).max() + 1e-4) < 0.01
    assert np.abs(H - H.transpose(0, 2, 1)).max() < 1e-12 * max(1, np.abs(H).max())
    assert np.abs(np.einsum("nij,nj->ni", H, normal)).max() < 1e-12 * max(1, np.abs(H).max())
    x = around(shape, low=0, high=5e-3)
    g, normal, _ = shape.gap(x)
    assert shape.gap(x + 1e-3 * normal)[0] == pytest.approx(g + 1e-3, abs=1e-14)
    assert np.abs(shape.gap(x - g[:, None] * normal)[0]).max() < 1e-15
    x = np.array([[0, 0, 0], [0, 0, 0.02], [1e-300, 0, 0.01], [0.01, 0, 0], [0, 0.005, 0], [0, 0, -1], [1e3, 1e3, 1e3]])
    for value in shape.gap(x):
        assert np.isfinite(value).all()
    points, triangles = shape.surface()
    if isinstance(shape, Plane):
        inner = np.abs(points[:, 2]) < 0.999 * shape.bounds[1, 2]  # a slab's ends are only drawn
        inner &= np.abs(points[:, 1]) < 0.099
    else:
        inner = np.ones(len(points), dtype=bool)
    assert np.abs(shape.gap(points[inner])[0]).max() < 1e-12
    a, b, c = points[triangles].transpose(1, 0, 2)
    facing = np.einsum("ij,ij->i", np.cross(b - a, c - a), shape.gap((a + b + c) / 3)[1])
    large = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12
    assert np.mean(facing[large & inner[triangles].all(axis=1)] > 0) == 1
    assert 500 < len(triangles) < 12_000
    lower, upper = shape.bounds
    assert (points >= lower - 1e-12).all()
    assert (points <= upper + 1e-12).all()


def test_distances_with_a_closed_form():
    x = np.array([[0.05, 0, 0], [0, 0, -0.01], [0.03, 0.04, 0]])
    assert Sphere(0.03).gap(x)[0] == pytest.approx([0.02, -0.02, 0.02], abs=1e-16)
    assert Plane(0.02).gap(x)[0] == pytest.approx([0.04, -0.01, 0.02], abs=1e-16)
    corner = np.array([[0.02 + 0.003, 0.03 + 0.004, 0], [0.03, 0.0, 0.0], [0.02, 0, 0], [0, 0, 0]])
    box = Box(np.array([0.05, 0.07, 0.2]), 0.005)  # the shrunken box has the half sides 20, 30 and 95 mm
    assert box.gap(corner)[0] == pytest.approx([0.0, 0.005, -0.005, -0.025], abs=1e-16)
    tube = SHAPES["open tube"].gap(np.array([[0.04, 0, 0.05], [0, 0.01, 0.05]]))[0]
    assert tube == pytest.approx([0.01, -0.02], abs=1e-15)


@pytest.mark.parametrize(("symmetry", "shape"), [
    (0, Sphere(0.03)), (0, EllipticCylinder(0.02, 0.02, 0.1)), (2, EllipticCylinder(0.02, 0.03, 0.1)), (2, Plane(0.01)),
    (4, Box(np.array([0.05, 0.05, 0.1]), 0.01)), (2, Box(np.array([0.05, 0.06, 0.1]), 0.01)), (0, SHAPES["bottle"]),
])  # fmt: skip
def test_what_looks_the_same_after_a_turn_has_the_same_gap(symmetry, shape):
    t = 2 * np.pi / (symmetry or 7.3)
    x = around(shape)
    turned = x @ np.array([[np.cos(t), np.sin(t), 0], [-np.sin(t), np.cos(t), 0], [0, 0, 1]])
    assert shape.gap(turned)[0] == pytest.approx(shape.gap(x)[0], abs=1e-14)


@pytest.mark.parametrize("ratio", [0.05, 0.4, 0.9999, 1.0, 2.5, 20.0])
@pytest.mark.parametrize("share", [-0.999, -0.5, 0.0, 1e-9, 0.3, 100.0])
def test_ellipse_distance_is_exact_out_to_the_medial_axis(ratio, share):
    """c(t) + d n(t) has distance d, from d = -(distance to the long axis) on, where the foot stops being closest."""
    a, b = 0.03, 0.03 * ratio
    t = np.concatenate([np.linspace(0, 2 * np.pi, 1001), [1e-9, 1e-5, np.pi / 2 - 1e-7]])
    speed = np.hypot(b * np.cos(t), a * np.sin(t))
    normal = np.stack([b * np.cos(t), a * np.sin(t)]) / speed
    d = share * np.minimum(b * speed / a, a * speed / b)
    x = np.stack([a * np.cos(t) + d * normal[0], b * np.sin(t) + d * normal[1], 0 * t], axis=1)
    g, n, _ = EllipticCylinder(a, b, 0.1).gap(x)
    assert np.abs(g - d).max() < 1e-13 * max(a, b, np.abs(d).max())
    if share > -0.9:  # near the medial axis the direction is as sensitive as the foot
        assert np.abs(n[:, :2].T - normal).max() < 1e-9


def test_ellipse_near_its_axes_and_evolute_is_finite_and_below_every_other_distance():
    rng = np.random.default_rng(1)
    t = np.linspace(0, 2 * np.pi, 2001)
    for ratio in (0.05, 0.5, 20.0):
        a, b = 0.03, 0.03 * ratio
        evolute = np.stack([(a * a - b * b) / a * np.cos(t) ** 3, (b * b - a * a) / b * np.sin(t) ** 3], axis=1)
        axes = np.concatenate([np.outer(np.linspace(-2, 2, 401), e) * max(a, b) for e in np.eye(2)])
        cusps = [evolute[::20], evolute[::20] * (1 + 1e-12)]
        x = np.concatenate([*cusps, axes, axes + 1e-300, rng.normal(0, a, (100, 2))])
        g, n, H = EllipticCylinder(a, b, 0.1).gap(np.column_stack([x, np.zeros(len(x))]))
        assert np.isfinite(g).all()
        assert np.isfinite(n).all()
        assert np.isfinite(H).all()
        brute = np.hypot(x[:, :1] - a * np.cos(t), x[:, 1:] - b * np.sin(t)).min(axis=1)
        assert (np.abs(g) <= brute + 1e-15).all()
        assert np.abs(np.abs(g) - brute).max() < 2e-3 * max(a, b)


def test_a_profile_passes_its_points_with_continuous_curvature_and_that_of_a_circle_converges_to_the_sphere():
    z, bottle = MM * np.linspace(3, 80, 500), SHAPES["bottle"]
    g, _, H = bottle.gap(np.column_stack([np.full(500, 33 * MM), np.zeros(500), z]))
    assert np.abs(g).max() < 1e-16
    assert np.abs(H[1:-1, 2, 2]).max() == 0
    assert np.abs(H[[0, -1], 2, 2]).max() < 1e-11  # these places belong to the roundings beside the run, too
    x = np.column_stack([BOTTLE[:, 1], 0 * BOTTLE[:, 0], BOTTLE[:, 0]])
    assert np.abs(bottle.gap(x[:-1])[0]).max() < 1e-15
    assert bottle.bounds[1, 2] == pytest.approx(BOTTLE[-1, 0], rel=1e-12)  # a rim takes the last point
    curve, s = bottle.curve, bottle.curve.breaks[1:-1]
    for order, scale in ((0, 1e-12), (1, 1e-9), (2, 1e-6)):
        jump = curve.derivative(s, order) - curve.derivative(s - 1e-13, order)
        assert np.abs(jump).max() < scale
    radius, errors = 0.03, []
    x = around(Sphere(radius))
    for n in (8, 16, 32):
        t = np.linspace(0, np.pi, n + 1)
        profile = radius * np.stack([-np.cos(t), np.sin(t)], axis=1)
        profile[[0, -1], 1] = 0
        errors.append(np.abs(Revolution(profile).gap(x)[0] - Sphere(radius).gap(x)[0]).max())
    assert np.log2(np.array(errors[:-1]) / errors[1:]).min() > 3.5
    assert errors[-1] < 1e-7
    rng = np.random.default_rng(2)
    for name in ("bottle", "open tube", "spindle"):
        shape = SHAPES[name]
        lower, upper = shape.bounds
        x = rng.uniform(lower - 0.05, upper + 0.05, (200, 3))
        c = shape.curve.derivative(np.linspace(0, shape.curve.breaks[-1], 50_001))
        brute = np.array([np.hypot(c[:, 0] - p[2], c[:, 1] - np.hypot(p[0], p[1])).min() for p in x])
        assert np.abs(np.abs(shape.gap(x)[0]) - brute).max() < 1e-8


@pytest.mark.parametrize("ratio", [0.6, *(pytest.param(ratio, marks=pytest.mark.long) for ratio in (0.2, 3.0))])
def test_elliptic_cylinder_ends_in_a_rounded_edge_and_a_flat_cap(ratio):
    """Against the distance to points all over its surface, which are at most 0.15 mm apart."""
    body = EllipticCylinder(0.015, 0.015 * ratio, 0.01)
    r, half = body.edge_radius, 0.005 - body.edge_radius
    t, u = np.linspace(0, 2 * np.pi, 1800), np.linspace(0, np.pi / 2, 40)
    ellipse = np.stack([body.a * np.cos(t), body.b * np.sin(t)], axis=1)
    normal = np.stack([body.b * np.cos(t), body.a * np.sin(t)], axis=1)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    wall = [np.insert(ellipse, 2, z, axis=1) for z in np.linspace(-half, half, 100)]
    edge = [np.insert(ellipse - r * (1 - np.cos(p)) * normal, 2, half + r * np.sin(p), axis=1) for p in u]
    cap = [np.insert(k * (ellipse - r * normal), 2, half + r, axis=1) for k in np.linspace(0, 1, 200)]
    ends = np.concatenate([edge, cap]).reshape(-1, 3)
    surface = cKDTree(np.concatenate([np.reshape(wall, (-1, 3)), ends, ends * [1, 1, -1]]))
    x = around(body, n=2000, low=-0.02, high=0.01)
    g = body.gap(x)[0]
    assert np.abs(surface.query(x)[0] - np.abs(g)).max() < 3e-4
    near = np.abs(g) > 2e-3
    assert np.abs(surface.query(x)[0] - np.abs(g))[near].max() < 1e-5
    np.testing.assert_allclose(body.gap(x * [1, 1, -1])[0], g, rtol=1e-12, atol=1e-15)


def test_an_elliptic_cylinder_ends_as_a_tube_does_rims_continue_curved_ends_and_corners_are_rounded():
    x = around(EllipticCylinder(0.03, 0.02, 0.1))
    inner = np.abs(x[:, 2]) <= 0.048
    for one, other in zip(*(EllipticCylinder(0.03, 0.02, n).gap(x[inner]) for n in (0.1, 10.0)), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-15)
    tube = Revolution([[-0.05, 0.03], [-0.02, 0.03], [0.02, 0.03], [0.05, 0.03]])
    round_ = EllipticCylinder(0.03, 0.03, 0.1)
    x = around(round_, low=-1e-3, high=0.01)
    assert np.abs(round_.gap(x)[0] - tube.gap(x)[0]).max() < 0.1e-3  # its rounding is not quite a circle
    assert round_.bounds == pytest.approx(tube.bounds, abs=1e-9)
    # The vase's wall flares at its open ends; the rim takes over direction and curvature and stays about a circle.
    z = MM * np.linspace(0, 100, 11)
    vase = Revolution(np.stack([z, 0.03 + 4 * (z - 0.05) ** 2], axis=1), rim=0.003)
    assert np.abs(vase.curve.curvature(np.linspace(0.0, vase.curve.breaks[-1], 2000))).max() < 3 / 0.003
    s = vase.curve.breaks[1:-1]
    assert vase.curve.curvature(s) == pytest.approx(vase.curve.curvature(s - 1e-12), abs=1e-3)
    tip = Revolution([[0, 0], [0.05, 0.03]])
    g, normal, H = tip.gap(np.array([[0, 0, -0.01], [1e-12, 0, -0.01]]))
    assert g == pytest.approx([0.01, 0.01], abs=1e-15)
    assert normal == pytest.approx(np.array([[0, 0, -1.0]] * 2), abs=1e-9)
    assert H[0, 0, 0] == pytest.approx(H[0, 1, 1], rel=1e-9)
    can = Revolution([[0, 0], [0, 0.015], [0, 0.03], [0.05, 0.03], [0.1, 0.03], [0.1, 0.015], [0.1, 0]], rim=0.004)
    x = np.array([[0.03, 0, 0.1], [0.03, 0, 0.05], [0.01, 0, 0.1], [0.03 - 0.004, 0, 0.1]])
    g = can.gap(x)[0]
    assert g[0] == pytest.approx((np.sqrt(2) - 1) * 0.004, rel=0.05)  # a circle's; the C2 rounding is close to one
    assert np.abs(g[1:]).max() < 1e-15


@pytest.mark.parametrize(("profile", "radius"), [
    ([[0, 20], [60, 20]], 20), ([[0, 0], [0, 20], [60, 20], [60, 0]], 20), ([[0, 0], [0, 20], [60, 20]], 20),
    ([[0, 0], [0, 10], [0, 20], [30, 20], [60, 20]], 20), ([[0, 37], [60, 13]], 35),
    ([[0, 20], [40, 27], [60, 45]], 43), ([[0, 12], [40, 12], [50, 20], [60, 28]], 26),
    ([[0, 0], [0, 20], [60, 30], [60, 0]], 29),
])  # fmt: skip
def test_a_rigid_body_ends_where_its_profile_does_with_caps_and_without_and_flares_up_to_a_rim(profile, radius):
    (low, high) = Revolution(MM * np.array(profile)).bounds
    assert [low[2], high[2]] == pytest.approx([0, 60 * MM], abs=1e-12)
    assert radius * MM - 1e-12 <= high[0] <= max(r for _, r in profile) * MM + 1e-12


@pytest.mark.parametrize("profile", [
    [[0, 0.03], [0.05, 0.03], [0.02, 0.01], [0.02, 0.06], [0.06, 0.04]],
    [[0, 0.05], [0.02, 0.002], [0.05, 0.002], [0.07, 0.05]],
], ids=["crosses itself", "swings"])  # fmt: skip
def test_impossible_profiles_are_refused(profile):
    with pytest.raises(ValueError):  # noqa: PT011 (the profile says which)
        Revolution(profile)


def test_first_touch_on_a_sphere_and_a_cylinder_of_a_grazing_edge_and_where_the_pad_passes():
    """A pad's centre meets the crest; a row of points beside the crest meets R - sqrt(R^2 - y^2) later."""
    start = pose([0.2, 0, 0], -X_AXIS)
    for shape in (Sphere(0.03), EllipticCylinder(0.03, 0.03, 0.1)):
        assert first_touch(shape, start, face(), 0.5) == pytest.approx(0.17, abs=2e-12)
        off = face(ny=2)  # two rows at y = +-11 mm; on the sphere its middle point, x = 0, is first
        assert first_touch(shape, start, off, 0.5) == pytest.approx(0.2 - np.sqrt(0.03**2 - 0.011**2), abs=2e-12)
    shape = Sphere(0.03)
    graze = pose([0.2, 0, 0.03 + 0.025 - 1e-7], -X_AXIS)  # the pad's lower edge dips 0.1 um below the pole
    expected = 0.2 - np.sqrt(0.03**2 - (0.03 - 1e-7) ** 2)
    assert first_touch(shape, graze, face(), 0.5) == pytest.approx(expected, abs=1e-9)
    for start, reach in (  # beside the object, away from it, inside it, too far for its reach
        (pose([0.2, 0, 0.0551], -X_AXIS), 0.5), (pose([0.2, 0, 0], X_AXIS), 0.5), (pose([0, 0, 0], -X_AXIS), 0.5),
        (pose([0.2, 0, 0], -X_AXIS), 0.169),
    ):  # fmt: skip
        with pytest.raises(NoContactError):
            first_touch(shape, start, face(), reach)
