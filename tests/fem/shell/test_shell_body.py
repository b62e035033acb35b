"""Thin-walled bodies: surfaces, meshes, symmetry, supports, materials; rings and pinched tubes in closed form."""

import numpy as np
import pytest

from softjaw.fem.objects.outer_surface import Section, of_revolution, of_sections
from softjaw.fem.objects.revolution import Revolution
from softjaw.fem.shell.thin_walled import supported
from softjaw.fem.shell.wall_material import WallMaterial, wall_material
from softjaw.fem.shell.wall_mesh import MeshSize, all_round, body_mesh, divided, limited
from softjaw.fem.shell.wall_model import LinearShell, faces

FLASK = Revolution(
    np.array([[0, 30], [30, 30], [60, 30], [75, 29], [90, 22], [105, 14], [115, 12], [125, 12], [135, 12]]) / 1e3
)
SQUARE = [
    Section(0.0, 0.030, 0.020, 4.0), Section(0.03, 0.030, 0.020, 4.0), Section(0.07, 0.030, 0.020, 4.0),
    Section(0.09, 0.026, 0.018, 3.0, (0.002, 0.0)), Section(0.12, 0.012, shift=(0.004, 0.0)),
    Section(0.14, 0.012, shift=(0.004, 0.0)),
]
SURFACES = {"flask": of_revolution(FLASK), "square": of_sections(SQUARE)}
COARSE = MeshSize(heights=(0.03, 0.05), around=0.004, along=0.006, coarse=0.012)
RNG = np.random.default_rng(5)
PET = wall_material("pet")
HALF_Y, QUARTER = (False, True), (True, True)
R, E, F = 0.03, 2e9, 1e-4  # of the middle surface [m], [Pa]; load [N]
PLANES = [(True, True), (False, True), (True, False), (False, False)]


@pytest.mark.parametrize("profile", [FLASK.profile, np.array([[0, 0], [0, 15], [0, 30], [50, 30], [90, 20]]) / 1e3])
def test_a_revolved_wall_and_the_rigid_body_are_the_same(profile):
    """Also where points of the profile lie at one height."""
    body = Revolution(profile, beyond=True)
    surface = of_revolution(body)
    theta, s = RNG.uniform(-4, 7, 200), RNG.uniform(0, surface.end, 200)
    gap, normal, _ = body.gap(surface.jets(theta, s)[:, 0])
    assert np.abs(gap).max() < 1e-15
    assert np.abs(normal - surface.normals(theta, s)).max() < 1e-12


@pytest.mark.parametrize("name", SURFACES)
def test_derivatives_of_the_surface(name):
    """Central differences of fourth order, away from joints; exponents above 2 bend sharply at their flat sides."""
    surface, h = SURFACES[name], np.array([1e-3, 2e-6])
    joints = np.concatenate([surface.curve.breaks, [surface.station(p.z) for p in SQUARE[:-1]]])
    s = RNG.uniform(1e-3, surface.end - 1e-3, 300)
    s = s[np.abs(s[:, None] - joints).min(axis=1) > 1e-5]
    theta = RNG.uniform(0.2, np.pi / 2 - 0.2, len(s)) + np.pi / 2 * RNG.integers(-2, 5, len(s))
    if name == "flask":
        theta[:8] = np.pi / 2 * np.arange(8)
    D = surface.jets(theta, s)
    for axis in (0, 1):
        dt, ds = h * (np.arange(2) == axis)
        near, far = (
            surface.jets(theta + k * dt, s + k * ds) - surface.jets(theta - k * dt, s - k * ds) for k in (1, 2)
        )
        found = ((8 * near - far) / (12 * h[axis]))[:, 0]
        assert np.abs(found - D[:, 1 + axis]).max() < 1e-6 * np.abs(D[:, 1 + axis]).max()


def test_sections_have_the_shape_that_was_asked_for():
    surface = SURFACES["square"]
    theta = RNG.uniform(0, 7, 50)
    for p in SQUARE[1:5]:
        x, y, z = surface.jets(theta, surface.station(p.z))[:, 0].T
        assert z == pytest.approx(p.z, abs=1e-12)
        b = p.a if p.b is None else p.b
        size = np.abs((x - p.shift[0]) / p.a) ** p.exponent + np.abs((y - p.shift[1]) / b) ** p.exponent
        assert size == pytest.approx(1, rel=1e-9)


@pytest.mark.parametrize("name", SURFACES)
@pytest.mark.parametrize("top", [True, False])
def test_the_outer_face_lies_on_the_surface_and_the_middle_half_a_wall_inside(name, top):
    surface = SURFACES[name]
    mesh = body_mesh(surface, [(0.0, 8e-4), (0.1, 4e-4)], COARSE, open_top=top)
    theta, s = (grid.ravel() for grid in np.meshgrid(mesh.theta, mesh.s, indexing="ij"))
    assert np.abs(mesh.outer[mesh.number.ravel()] - surface.jets(theta, s)[:, 0]).max() < 1e-15
    z = mesh.outer[:, 2]
    assert mesh.thickness == pytest.approx(np.interp(z, [0, 0.1], [8e-4, 4e-4]), rel=1e-12)
    assert np.abs(np.cross(mesh.D[mesh.number.ravel()], surface.normals(theta, s))).max() < 1e-18
    low = mesh.number[0, 0]
    assert (mesh.number[:, 0] == low).all()
    assert mesh.D[low] == pytest.approx([0, 0, -4e-4], abs=1e-12)


def test_grid_lines_are_fine_where_asked_miss_no_step_of_the_thickness_and_values_between_are_bilinear():
    mesh = body_mesh(SURFACES["flask"], 4e-4, MeshSize(heights=(0.03, 0.05), half_width=0.01))
    arc, z = 0.03 * np.diff(mesh.theta), mesh.outer[mesh.number[0]][:, 2]
    middle = 0.5 * (mesh.theta[1:] + mesh.theta[:-1])
    near = np.abs((0.03 * middle + 0.03 * np.pi / 2) % (0.03 * np.pi) - 0.03 * np.pi / 2) < 0.01
    assert arc[near].max() <= 0.0015
    assert arc.max() > 0.0035
    assert np.abs(mesh.theta - np.pi).min() < 1e-6
    steps = np.diff(mesh.s)
    assert steps[(z[:-1] >= 0.03) & (z[1:] <= 0.05)].max() <= 0.0025 * 1.001
    assert np.abs(np.diff(np.log(steps))).max() < 0.5
    assert mesh.s[np.abs(mesh.s - mesh.surface.flat[0]).argmin()] == mesh.surface.flat[0]
    assert mesh.outer[mesh.foot, 2] == pytest.approx(mesh.outer[:, 2].min(), abs=1e-12)
    steps = [(0.0, 5e-4), (0.121, 5e-4), (0.123, 1.2e-3), (0.135, 1.2e-3)]
    mesh = body_mesh(SURFACES["flask"], steps, COARSE, QUARTER)
    z = SURFACES["flask"].curve.derivative(mesh.s)[:, 0]
    for height in (0.121, 0.123):
        assert np.abs(z - height).min() < 1e-9
    at = mesh.X[:, 2] > 0.1231
    assert mesh.thickness[at] == pytest.approx(1.2e-3)
    x = np.linspace(0, 2, 201)
    assert limited(x, np.where(np.abs(x - 1) < 1e-9, 0.1, 9.0), 0.25) == pytest.approx(0.1 + 0.25 * np.abs(x - 1))
    assert divided(1.0, 3.0, x, np.full(201, 0.25)) == pytest.approx(np.linspace(1, 3, 9), abs=1e-12)
    assert len(divided(1.0, 3.0, x, np.full(201, 0.25), 3)) == 10
    for symmetry in (QUARTER, (False, True), (False, False)):
        mesh = body_mesh(SURFACES["square"], 4e-4, COARSE, symmetry)
        lines, x = all_round(mesh, np.hstack([mesh.X, mesh.X])[mesh.number])
        assert lines[-1] - lines[0] == pytest.approx(2 * np.pi)
        assert x[-1] == pytest.approx(x[0], abs=1e-12)
        turns = np.diff(np.unwrap(np.arctan2(x[:, -1, 1], x[:, -1, 0])))
        assert (turns > 0).all()
        assert turns.sum() == pytest.approx(2 * np.pi)


def flask(symmetry, support="standing"):
    return supported(body_mesh(SURFACES["flask"], 4e-4, COARSE, symmetry, base_thickness=1e-3), PET, support)


def reaction(body, q, load):
    """Force of the whole body's support and springs on it in the equilibrium under ``load``."""
    mesh = body[0].mesh
    held = body[1] & ~mesh.symmetric
    force = np.where(held, body[0].residual(q) - load, 0.0).reshape(-1, 6)
    sprung, stiffness = body[0].springs
    force[sprung, :3] -= (stiffness @ q.reshape(-1, 6)[sprung, :3].ravel()).reshape(-1, 3)
    return np.where([*mesh.symmetry, False], 0.0, force[:, :3].sum(axis=0)) / mesh.share


def test_compliance_is_what_single_forces_do():
    body = flask(QUARTER)
    mesh = body[0].mesh
    node = mesh.number[np.abs(mesh.theta).argmin(), np.abs(mesh.s - mesh.surface.station(0.04)).argmin()]
    nodes = np.array([node, node + 1, node + 7])
    linear = LinearShell(*body)
    C = linear.compliance(nodes)
    assert np.abs(C - C.T).max() < 1e-10 * np.abs(C).max()
    load = np.zeros((body[0].nodes, 6))
    load[node + 7, [1, 4]] = 2.0
    q = linear.solve(load.ravel())
    assert 2 * C[:, 7] == pytest.approx(q.reshape(-1, 2, 3).sum(axis=1)[nodes].ravel(), rel=1e-12)


@pytest.mark.parametrize("support", ["free", "standing", "clamped"])
def test_the_support_carries_what_is_left_over(support):
    """A pull along the axis, spread over the wall: springs, the foot or the bottom hold it."""
    body = flask(HALF_Y, support)
    load = np.zeros((body[0].nodes, 6))
    load[:, 2] = 1e-3 * body[0].node_area / body[0].node_area.sum()
    q = LinearShell(*body).solve(load.ravel())
    assert reaction(body, q, load.ravel()) == pytest.approx([0, 0, -2e-3], rel=1e-5, abs=1e-9)
    assert 0 < q.reshape(-1, 2, 3)[:, :, 2].sum(axis=1).mean() < 1e-7  # as a whole it stays where it is


def test_a_tube_under_pressure():
    """Hoop stress p R / t on average, p R^2 / (E t) wider; the same on all of a long tube with free ends."""
    tube = of_revolution(Revolution(np.array([[0.0, 0.03], [0.02, 0.03], [0.04, 0.03]])))
    mesh = body_mesh(tube, 5e-4, MeshSize(heights=(0.01, 0.03), half_width=1.0), QUARTER, open_bottom=True)
    body, p, R = supported(mesh, PET), 10.0, 0.03 - 2.5e-4
    load = np.zeros((len(mesh.X), 6))
    load[:, :3] = p * body[0].node_area[:, None] * mesh.D / 2.5e-4
    load = np.where(mesh.symmetric.reshape(-1, 6), 0, load).ravel()
    q = LinearShell(*body).solve(load)
    wider = np.einsum("nk,nk->n", q.reshape(-1, 6)[:, :3], mesh.D) / 2.5e-4
    assert wider == pytest.approx(p * R**2 / (PET.young_modulus * 5e-4), rel=2e-3)
    outer, inner = faces(body[0], q)
    middle = 0.5 * (outer.stress + inner.stress)
    assert np.abs(middle).max(axis=2) == pytest.approx(p * R / 5e-4, rel=5e-3)
    # the faces differ by the order of thickness / radius, which the element leaves out
    assert outer.von_mises == pytest.approx(p * R / 5e-4, rel=0.02)
    low, high = np.moveaxis(outer.principal_strain, -1, 0)
    assert high == pytest.approx(p * R / 5e-4 / PET.young_modulus, rel=0.02)
    assert low == pytest.approx(-0.38 * p * R / 5e-4 / PET.young_modulus, rel=0.05)


@pytest.mark.parametrize(
    "arguments", [{"surface": SURFACES["flask"], "thickness": 5e-2}, {"size": MeshSize(heights=(0.03, 0.5))}],
    ids=["too thick", "too high"],
)
def test_bodies_that_cannot_be_meshed_are_refused(arguments):
    with pytest.raises(ValueError):  # noqa: PT011 (the arguments say which)
        body_mesh(**({"surface": SURFACES["square"], "thickness": 4e-4, "size": COARSE} | arguments))


def test_a_wall_that_is_thicker_than_the_edges_of_its_lids_are_round_is_thinner_there():
    surface = SURFACES["square"]
    mesh = body_mesh(surface, 3e-3, COARSE)
    thickness = 2 * np.linalg.norm(mesh.D, axis=1)
    assert thickness.min() < 2e-3
    inside = (mesh.X + mesh.D)[:, 2]
    on_wall = (inside > surface.heights[0] + 1e-6) & (inside < surface.heights[1] - 1e-6)
    assert thickness[on_wall] == pytest.approx(3e-3)

def test_wall_materials():
    assert wall_material("PP").young_modulus == 1.3e9
    assert wall_material("pet", young_modulus=2.8e9) == WallMaterial(2.8e9, 0.38, 57e6)
    assert wall_material(young_modulus=1e9, poisson_ratio=0.4).yield_strength is None


def tube(thickness, length, nu, around, along, planes, support="free"):
    """Evenly meshed tube with a line at angle 0 and half way up."""
    outer = R + 0.5 * thickness
    surface = of_revolution(Revolution(np.array([[z, outer] for z in np.linspace(0.0, length, 4)])))
    size = MeshSize(heights=(0.0, length), half_width=1.0, around=around, along=along, coarse=1.0)
    mesh = body_mesh(surface, thickness, size, planes, open_bottom=True)
    return supported(mesh, WallMaterial(E, nu), support)


def squeezed(body, weight):
    """State under the load at angles 0 and pi, shared by the nodes of these lines as ``weight (n,)`` says."""
    mesh = body[0].mesh
    load = np.zeros((len(mesh.X), 6))
    for angle, towards in ((0.0, -F), (np.pi, F)):
        i = np.abs(mesh.theta - angle).argmin()
        if abs(mesh.theta[i] - angle) < 1e-6:
            load[mesh.number[i], 0] = towards * weight * (0.5 if mesh.symmetry[1] else 1.0)
    return LinearShell(*body).solve(load.ravel())


def inward(body, q, s):
    """Displacement under the load at angle 0, half of what both of them come closer [m]."""
    mesh, x = body[0].mesh, q.reshape(-1, 6)[:, 0]
    one, other = (x[mesh.number[np.abs(mesh.theta - angle).argmin(), s]] for angle in (0.0, np.pi))
    return -one if mesh.symmetry[0] else 0.5 * (other - one)


def ring(around, planes=PLANES[0], thickness=5e-4, length=0.02):
    """Of a tube without Poisson's effect under two line loads: displacement, stresses, over those of a thin ring."""
    body = tube(thickness, length, 0.0, around, 0.005, planes)
    mesh = body[0].mesh
    q = squeezed(body, np.gradient(mesh.s) * np.where(np.arange(len(mesh.s)) % (len(mesh.s) - 1), 1.0, 0.5) / length)
    middle, wall = len(mesh.s) // 2, length * thickness**2 / 6.0  # section modulus
    deflection = F * R**3 / (E * wall * thickness / 2.0) * (np.pi / 4.0 - 2.0 / np.pi) / 2.0
    outer, inner = faces(body[0], q)
    bending = 0.5 * (outer.stress - inner.stress)[:, middle, 0]
    side, load = (bending[np.abs(mesh.theta - angle).argmin()] for angle in (np.pi / 2, 0.0))
    moments = F * R * (0.5 - 1.0 / np.pi), -F * R / np.pi
    largest = max(outer.von_mises.max(), inner.von_mises.max()) * wall / (F * R / np.pi)
    return inward(body, q, middle) / deflection, side * wall / moments[0], load * wall / moments[1], largest


def test_a_ring_under_two_opposite_loads_bends_as_the_closed_form_says():
    """Of second order where stresses are smooth, and of first order where the load puts a kink into the moment."""
    errors = np.abs(np.array([ring(around) for around in (0.006, 0.003, 0.0015)]) - 1.0)
    assert (errors[-1] < [1e-3, 2e-3, 0.05, 0.05]).all()
    order = np.log2(errors[:-1] / errors[1:])
    assert (order[:, 1] > 1.25).all()
    assert (order[:, 2:] > 0.6).all()


@pytest.mark.parametrize("planes", PLANES[1:])
def test_a_part_of_a_tube_has_the_stresses_of_the_whole(planes):
    assert ring(0.003, planes) == pytest.approx(ring(0.003), rel=1e-6)


def test_a_clamped_tube_is_held_at_both_ends_and_a_standing_one_at_its_lower_rim():
    for support, rims in (("clamped", [0, -1]), ("standing", [0])):
        body = tube(5e-4, 0.04, 0.3, 0.006, 0.008, PLANES[3], support)
        held = body[1].reshape(-1, 6)
        expected = np.zeros_like(held)
        nodes = np.unique(body[0].mesh.number[:, rims])
        expected[nodes if support == "clamped" else np.ix_(nodes, [2])] = True
        assert (held == expected).all()
