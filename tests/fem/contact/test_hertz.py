"""Hertz contact: a rigid cylinder and a rigid sphere on a thick linear pad, with observed orders of convergence.

A slice of pad with Poisson's ratio 0 and free ends is in plane strain exactly, so one element along the cylinder does.
Radii come from second moments of the pressure (``<y^2> = a^2 / 4`` under a cylinder, ``<r^2> = 2 a^2 / 5`` under a
sphere); errors are root mean squares over a ladder of forces, for a single radius lies anywhere between two mesh lines.
Part of every error stays on any mesh: the pad ends at ``W`` times the radius, which makes it smaller by 0.8 % at
``W = 10`` and 0.2 % at 20 under a cylinder (``1 / W^2``), below 0.5 % at 6 under a sphere (``1 / W^3``); and Hertz
neglects that the surface moves inwards, by 0.08 % of the half width at the ``a / R = 0.002`` used here.
"""

import numpy as np
import pytest

from softjaw.fem.contact.edge import contact_area, largest_pressure
from softjaw.fem.contact.extract import extract
from softjaw.fem.contact.press import Press
from softjaw.fem.materials import material
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.pad.shape import PadShape
from tests.fem import reference

E, R = 1e6, 0.02


def profile_error(pad, pressed, distance, hertz):
    """Error of the pressure in the mean square, relative; its order is 1 because of the root at the rim."""
    p = pressed.pressure[pad.pressure_index[pad.face_nodes]] @ pad.face_N.T
    exact = hertz.peak * np.sqrt(np.maximum(0, 1 - (distance / hertz.radius) ** 2))
    return np.sqrt(np.sum((p - exact) ** 2 * pad.face_area) / np.sum(exact**2 * pad.face_area))


def radius(pressed, coordinates, factor):
    load, position = pressed.points.load, pressed.points.position[..., coordinates]
    return np.sqrt(factor * np.sum(load * np.sum(position**2, axis=-1)) / load.sum())


def cylinder_errors(n, factors, element="hex8", width=20.0, grade=20.0):
    """Relative errors of half width, peak, profile, reconstructed area and its peak, root mean squares over forces."""
    a, length = 0.002 * R, 1e-3
    shape = PadShape((length, 2 * width * a, width * a), (1, 2 * n, n), (1.0, grade, grade), element)
    pad = Pad(shape, material("linear", E / 2, 0.0), (False, True))
    forces = np.pi * E * (np.asarray(factors) * a) ** 2 / (4 * R) * length
    errors = []
    for pressed in Press(pad, reference.round_gap(R, (1, 2))).load_path(forces):
        hertz = reference.hertz_cylinder(pressed.force / length, R, E)
        y = pressed.points.position[..., 1]
        half_width = radius(pressed, [1], 4.0)
        patch, faces = extract(pad, pressed), shape.patch_faces
        area = 2 * hertz.radius * length
        errors.append([
            half_width / hertz.radius - 1, pressed.pressure.max() / hertz.peak - 1,
            profile_error(pad, pressed, y, hertz), contact_area(patch, faces, shape.size[2]) / area - 1,
            largest_pressure(patch, faces, shape.per_side) / hertz.peak - 1,
            patch.area[patch.load > 0].sum() / area - 1,
        ])  # fmt: skip
    return np.sqrt(np.mean(np.square(errors), axis=0))


def test_cylinder_converges_at_the_expected_orders_and_triquadratic_elements_are_better():
    """Profile: order 1, bounded by the root at the rim; half width and peak, which are means: more."""
    coarse, middle, fine = (cylinder_errors(n, np.linspace(0.75, 1.25, 7)) for n in (8, 16, 32))
    for order in (np.log2(coarse / middle), np.log2(middle / fine)):
        assert order[0] > 1.4
        assert order[1] > 1.8
        assert 0.9 < order[2] < 1.5
    assert (fine[:3] < [0.010, 0.006, 0.07]).all()
    # area and peak as a case has them; the area of the faces that bear goes down by halves, at order 1
    order = np.log2(coarse / fine) / 2
    assert order[3] > 1.2
    assert order[4] > 1.8
    assert fine[3] < 0.25 * fine[5] < 0.025
    # A contact of about five elements across, with the figures of a trilinear mesh of twice as many per direction.
    errors = cylinder_errors(12, np.linspace(0.8, 1.2, 4), "hex27", grade=10.0)
    assert (errors[:5] < [0.03, 0.12, 0.14, 0.07, 0.04]).all()


def sphere_errors(n, factors=(0.8, 0.88, 0.96, 1.04, 1.12, 1.2), width=6.0, nu=0.3):
    """Relative errors of radius, peak pressure and profile; and what the approach lacks, in units of F / (E* W)."""
    a = 0.005 * R
    E_star, W = E / (1 - nu**2), width * a
    shape, law = PadShape((2 * W, 2 * W, W), (2 * n, 2 * n, n), (width,) * 3), material("linear", E / 2 / (1 + nu), nu)
    pad, errors, lacking = Pad(shape, law, (True, True)), [], []
    forces = 4 * E_star * (np.array(factors) * a) ** 3 / (3 * R)
    for pressed in Press(pad, reference.round_gap(R, (0, 1, 2))).load_path(forces):
        hertz = reference.hertz_sphere(pressed.force, R, E_star)
        r = np.linalg.norm(pressed.points.position[..., :2], axis=-1)
        patch, faces = extract(pad, pressed), shape.patch_faces
        errors.append([
            radius(pressed, [0, 1], 2.5) / hertz.radius - 1, pressed.pressure[0] / hertz.peak - 1,
            profile_error(pad, pressed, r, hertz),
            contact_area(patch, faces, shape.size[2]) / (np.pi * hertz.radius**2) - 1,
            largest_pressure(patch, faces, shape.per_side) / hertz.peak - 1,
        ])  # fmt: skip
        lacking.append((hertz.approach - pressed.closing) * E_star * W / pressed.force)
    return np.sqrt(np.mean(np.square(errors), axis=0)), np.array(lacking)


def test_sphere_converges_at_the_expected_orders():
    """Three meshes of quarter pads with a Poisson's ratio of 0.3."""
    meshes = np.array([5, 7, 10])
    errors, lacking = zip(*(sphere_errors(n) for n in meshes), strict=True)
    order = np.log2(errors[0] / errors[2])  # over all three, twice as many elements per direction
    assert (np.diff(errors, axis=0)[:, [0, 1, 2, 4]] < 0).all()
    assert order[0] > 1.1
    assert order[1] > 1.8
    assert 0.8 < order[2] < 1.5
    assert errors[2][0] < 0.025
    # a finite pad is stiffer than the half space, by the same compliance at every force: 0.44 F / (E* W), a tenth of
    # the approach here, so that the scatter of 15 % is 1.5 % of the approach
    assert lacking[2] == pytest.approx(lacking[2].mean(), rel=0.15)


@pytest.mark.long
def test_sphere_on_a_fine_mesh():
    (coarse, _), (errors, lacking) = sphere_errors(10), sphere_errors(16)
    order = np.log(coarse / errors) / np.log(1.6)
    assert (order[[0, 3, 2]] > [1.4, 1.0, 0.8]).all()
    assert order[2] < 1.5
    assert (errors[[0, 1, 3]] < [0.01, 0.015, 0.06]).all()
    assert lacking == pytest.approx(lacking.mean(), rel=0.08)


def test_nafems_cylinder_on_a_block():
    """Benchmark CGS-1 at 1/100 of its force: R 50 mm, E 210 and 70 GPa, nu 0.3.

    At 35 kN/mm Hertz gives a half width of 6.21 mm and a peak of 3585 MPa, both proportional to the root of the force.
    One elastic body with the contact modulus of the two stands for both; the pad ends at 16 half widths, as the block.
    """
    E_star = 1e9 / ((1 - 0.3**2) / 210 + (1 - 0.3**2) / 70)
    full = reference.hertz_cylinder(35e6, 0.05, E_star)
    assert full.radius == pytest.approx(6.21e-3, rel=1e-3)
    assert full.peak == pytest.approx(3585e6, rel=1e-3)
    shape = PadShape((1e-3, 0.020, 0.020), (1, 64, 32), (1.0, 20.0, 40.0))
    pad = Pad(shape, material("linear", E_star / 2, 0.0), (False, True))
    (pressed,) = Press(pad, reference.round_gap(0.05, (1, 2))).load_path([350.0])
    assert radius(pressed, [1], 4.0) == pytest.approx(0.621e-3, rel=0.01)
    assert pressed.pressure.max() == pytest.approx(358.5e6, rel=0.01)
