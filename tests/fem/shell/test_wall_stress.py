"""Tubes without a base against closed forms: the ring under two opposite loads, the pinched cylinder, and stresses."""

import numpy as np
import pytest

from softjaw.fem.objects.outer_surface import of_revolution
from softjaw.fem.objects.revolution import Revolution
from softjaw.fem.shell.thin_walled import supported
from softjaw.fem.shell.wall_material import WallMaterial
from softjaw.fem.shell.wall_mesh import MeshSize, body_mesh
from softjaw.fem.shell.wall_model import LinearShell, faces

R, E, F = 0.03, 2e9, 1e-4  # of the middle surface [m], [Pa]; load [N]
PLANES = [(True, True), (False, True), (True, False), (False, False)]


def tube(thickness, length, nu, around, along, planes, support="free"):
    """Evenly meshed tube with a line at angle 0 and half way up."""
    outer = R + 0.5 * thickness
    surface = of_revolution(Revolution(np.array([[z, outer] for z in np.linspace(0.0, length, 4)])))
    size = MeshSize(heights=(0.0, length), half_width=1.0, around=around, along=along, coarse=1.0)
    mesh = body_mesh(surface, thickness, size, planes, open_bottom=True)
    return supported(mesh, WallMaterial(E, nu), support, 1e-4)


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
