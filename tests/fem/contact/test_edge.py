"""The patch of a pressed pad: symmetry, sums, order; area and largest pressure where the pressure is known."""

import numpy as np
import pytest

from softjaw.fem.contact.edge import contact_area, largest_pressure
from softjaw.fem.contact.extract import extract
from softjaw.fem.contact.press import Press
from softjaw.friction.patch import ContactPatch
from tests.fem import reference
from tests.fem.reference import OVAL, SIZE

WHOLE = (False, False)
PARTS = [(True, False), (False, True), (True, True)]
LENGTH, WIDTH, THICK = SIZE


def pressed_patch(symmetry=(True, True), element="hex8", gap=OVAL, elements=(8, 4, 2), force=10.0, contact="weighted"):
    pad = reference.pad_of(elements, symmetry, contact, element, grading=(1.5, 0.7, 1.0))
    (pressed,) = Press(pad, gap).load_path([force])
    return pad, pressed, extract(pad, pressed)


@pytest.fixture(scope="module", params=["hex8", "hex27"])
def whole(request):
    return (request.param, *pressed_patch(WHOLE, request.param))


def test_a_gap_whose_gradient_is_no_unit_vector_has_the_same_patch():
    """As at the ridges of a mesh, where it is interpolated: the force goes with the gradient."""
    *_, expected = pressed_patch()
    *_, patch = pressed_patch(gap=lambda x: tuple(1.2 * each for each in OVAL(x)))
    for name in ("centroid", "normal", "load", "pressure"):
        one, other = getattr(patch, name), getattr(expected, name)
        assert np.abs(one - other).max() < 1e-6 * np.abs(other).max(), name


@pytest.mark.parametrize("symmetry", PARTS)
def test_patch_of_a_part_is_that_of_the_whole_pad(whole, symmetry):
    element, *_, full = whole
    *_, part = pressed_patch(symmetry, element)
    for name in ("centroid", "area", "normal", "pressure", "corners", "load"):
        one, other = getattr(part, name), getattr(full, name)
        assert one.shape == other.shape
        assert np.abs(one - other).max() < 1e-12 * np.abs(other).max(), name


def test_half_a_pad_has_the_loads_of_the_solution_and_faces_tile_the_deformed_front(whole):
    """Only y = 0 is a plane of symmetry of a cylinder that is tilted along x; the patch must not be mirrored in x."""
    tilt = 0.05
    R = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])

    def gap(x):
        g, n, H = OVAL(x @ R.T)
        return g, n @ R, R.T @ H @ R

    *_, half = pressed_patch((False, True), gap=gap)
    *_, full = pressed_patch(WHOLE, gap=gap)
    assert np.abs(half.centroid - full.centroid).max() < 1e-12
    assert np.abs(half.load - full.load).max() < 1e-12 * full.load.max()
    assert abs((full.load * full.centroid[:, 0]).sum() / full.load.sum()) > 1e-3
    # ``S`` is the integral of the pressure, the forces add up to the normal force, and nothing pulls aside.
    element, pad, pressed, patch = whole
    S = pressed.pressure @ pad.node_area
    assert patch.load.sum() == pytest.approx(S, rel=1e-12)
    force = (patch.load[:, None] * patch.normal).sum(axis=0)
    # clipping quadratic pressures moves load within an element, between normals that differ a little
    assert force[2] == pytest.approx(10.0, rel=1e-12 if element == "hex8" else 1e-3)
    assert np.abs(force[:2]).max() < 1e-10
    assert (patch.pressure >= 0).all()
    # Neighbours share corners, the faces cover the deformed contact face, and each holds its centre.
    nx, ny = pad.shape.patch_faces
    corners = patch.corners.reshape(nx, ny, 4, 3)
    assert np.abs(corners[1:, :, 0] - corners[:-1, :, 1]).max() == 0
    assert np.abs(corners[1:, :, 3] - corners[:-1, :, 2]).max() == 0
    assert np.abs(corners[:, 1:, 0] - corners[:, :-1, 3]).max() == 0
    ends = np.array([corners[0, 0, 0], corners[-1, -1, 2]])
    front = pressed.contact_face.reshape(*pad.contact_grid, 3)
    assert np.abs(ends - [front[0, 0], front[-1, -1]]).max() < 1e-15
    e, f = patch.corners[:, 1] - patch.corners[:, 0], patch.corners[:, 3] - patch.corners[:, 0]
    r = patch.centroid - patch.corners[:, 0]
    for one in (np.einsum("ij,ij->i", r, e) / (e**2).sum(1), np.einsum("ij,ij->i", r, f) / (f**2).sum(1)):
        assert ((one > 0) & (one < 1)).all()
    # On a plane the confined middle only moves along z, and the faces' areas add up to the widened contact face.
    pad, pressed, patch = pressed_patch(gap=reference.plane, force=30.0)
    assert np.abs(patch.normal - [0, 0, 1]).max() < 1e-15
    assert np.abs(patch.centroid[:, 2]).max() < 1e-12
    assert patch.load.sum() == pytest.approx(30, rel=1e-12)
    x, y, _ = pressed.contact_face.reshape(*pad.contact_grid, 3).transpose(2, 0, 1)  # a quarter
    rim = np.concatenate([[0], x[-1], x[::-1, -1]]), np.concatenate([[0], y[-1], y[::-1, -1]])
    area = 0.5 * np.abs(np.dot(rim[0], np.roll(rim[1], -1)) - np.dot(rim[1], np.roll(rim[0], -1)))
    assert patch.area.sum() == pytest.approx(4 * area, rel=1e-12)
    assert patch.area.sum() > SIZE[0] * SIZE[1]


@pytest.mark.parametrize("element", ["hex8", "hex27"])
def test_nodal_contact_keeps_force_and_centre(element):
    _, _, patch = pressed_patch(element=element, contact="nodal")
    force = (patch.load[:, None] * patch.normal).sum(axis=0)
    assert force == pytest.approx([0, 0, 10], rel=1e-9, abs=1e-9)
    assert np.abs((patch.load[:, None] * patch.centroid).sum(axis=0)[:2]).max() < 1e-12


def patch_of(pressure, n):
    """A flat face of ``n`` elements along length and width, two faces each along a side, with Gauss points' loads."""
    faces = 2 * n[0], 2 * n[1]
    x, y = (np.linspace(-size / 2, size / 2, count + 1) for size, count in zip((LENGTH, WIDTH), faces, strict=True))
    grid = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((faces[0] + 1, faces[1] + 1))], axis=-1)
    corners = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4, 3)
    area = np.full(len(corners), LENGTH * WIDTH / len(corners))
    # means over the faces, as a solution has them
    s = (np.arange(20) + 0.5) / 20
    u, v = (a.ravel()[:, None] for a in np.meshgrid(s, s))
    side = corners[:, 2] - corners[:, 0]
    mean = pressure(corners[:, 0, 0] + u * side[:, 0], corners[:, 0, 1] + v * side[:, 1]).mean(axis=0)
    return ContactPatch(corners.mean(axis=1), area, np.tile([0.0, 0.0, 1.0], (len(area), 1)), mean, corners), faces


def hertz(a, b, x_0=0.0, y_0=0.0):
    return lambda x, y: np.sqrt(np.maximum(0.0, 1.0 - ((x - x_0) / a) ** 2 - ((y - y_0) / b) ** 2))


def errors(pressure, area, n):
    patch, faces = patch_of(pressure, n)
    counted = patch.area[patch.pressure > 0].sum()
    found = contact_area(patch, faces, THICK), largest_pressure(patch, faces, 2), counted
    return np.abs(np.array(found) / [area, 1.0, area] - 1.0)


def test_area_and_peak_of_an_elliptic_contact_converge_and_a_line_contact_ends_at_its_edges_and_at_the_rims():
    """Over places of its middle, which lie anywhere between the lines; counted faces are far off and slow."""
    places = [(0.0, 0.0), (0.0007, 0.0003), (0.0013, 0.0009), (0.0004, 0.0011)]
    a, b = 0.012, 0.007
    found = [np.mean([errors(hertz(a, b, *at), np.pi * a * b, (n, n)) for at in places], axis=0) for n in (6, 12, 24)]
    coarse, middle, fine = found
    assert (np.log2(coarse / fine)[:2] / 2 > 1.3).all()
    assert middle[0] < 0.06  # a line at either tip is wholly counted where it bears in part only
    assert middle[1] < 0.02
    assert (fine[:2] < [0.25 * fine[2], 0.01]).all()
    # Hertz's cylinder along the pad: the sums along the length, which cross no edge, do not count.
    for half in (0.0046, 0.0053, 0.0061):
        area, peak, counted = errors(hertz(1e9, half), 2 * half * LENGTH, (10, 10))
        assert area < 0.02
        assert peak < 0.04
        assert counted > area
    # a face of the object that ends under the pad: an even pressure, and a punch's, half of whose edge is not resolved
    for power, half in ((0.0, 0.0053), (0.0, 0.0081), (-0.5, 0.0053), (-0.5, 0.0081)):

        def ended(x, y, power=power, half=half):
            return np.where(np.abs(y) < half, np.maximum(1.0 - (y / half) ** 2, 1e-3) ** power, 0.0)

        area, _, counted = errors(ended, 2 * half * LENGTH, (10, 10))
        assert area < 0.06
        assert counted > area
    # p = sqrt(1 - s / b) (1 + s / (2 b)) from the end of the pad on, exact but for the integration over the faces.
    for b in (0.013, 0.0215):

        def pressure(x, y, b=b):
            s = (x + LENGTH / 2) / b
            return np.sqrt(np.maximum(0.0, 1.0 - s)) * (1.0 + 0.5 * s)

        patch, faces = patch_of(pressure, (20, 3))
        assert contact_area(patch, faces, THICK) == pytest.approx(b * WIDTH, rel=0.02)
    patch, faces = patch_of(lambda x, y: 1.0 + 0.0 * x, (4, 3))
    assert contact_area(patch, faces, THICK) == pytest.approx(LENGTH * WIDTH, rel=1e-12)
    assert largest_pressure(patch, faces, 2) == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize(("power", "within"), [(1, 0.04), (2, 0.18)])
def test_under_a_pad_that_is_thin_beside_the_contact_pressure_goes_as_the_depth_or_as_its_square(power, within):
    """A layer of springs, and one that gets stiffer; as a thick pad's contact the areas would be 15 and 30 % less."""
    a, n = 0.0047, 20

    def pressure(x, y):
        return np.maximum(0.0, 1.0 - (x**2 + y**2) / a**2) ** power

    patch, faces = patch_of(pressure, (n, n))
    assert contact_area(patch, faces, 0.0008) == pytest.approx(np.pi * a**2, rel=within)


@pytest.mark.parametrize("line", [1, 0], ids=["inside", "rim"])
def test_one_loaded_line_of_nodes_has_about_the_width_of_its_share(line):
    """Nodal gaps: the loads of both faces beside a node lie on it, so that their second moment is zero."""
    n = 4
    patch, faces = patch_of(lambda x, y: 1.0 + 0.0 * x, (n, n))
    share = WIDTH / n
    place, load = patch.centroid.reshape(*faces, 3).copy(), np.zeros(faces)
    place[..., 1] = -WIDTH / 2 + share * np.repeat(np.arange(n + 1), 2)[1:-1]
    load[:, {0: [0], 1: [1, 2]}[line]] = 1.0
    found = ContactPatch(place.reshape(-1, 3), patch.area, patch.normal, load.ravel(), patch.corners)
    assert 0.8 < contact_area(found, faces, THICK) / (LENGTH * share * (1.0 if line else 0.5)) < 1.3
    assert largest_pressure(found, faces, 2) == pytest.approx(1.0, rel=0.35)
