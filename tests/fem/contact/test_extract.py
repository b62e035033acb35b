"""The patch of a pressed pad: symmetry, sums, order and geometry of its faces."""

import numpy as np
import pytest

from softjaw.fem.contact.extract import extract
from softjaw.fem.contact.press import Press
from tests.fem import reference
from tests.fem.reference import OVAL, SIZE

WHOLE = (False, False)
PARTS = [(True, False), (False, True), (True, True)]


def patch_of(symmetry=(True, True), element="hex8", gap=OVAL, elements=(8, 4, 2), force=10.0, contact="weighted"):
    pad = reference.pad_of(elements, symmetry, contact, element, grading=(1.5, 0.7, 1.0))
    (pressed,) = Press(pad, gap).load_path([force])
    return pad, pressed, extract(pad, pressed)


@pytest.fixture(scope="module", params=["hex8", "hex27"])
def whole(request):
    return (request.param, *patch_of(WHOLE, request.param))


@pytest.mark.parametrize("symmetry", PARTS)
def test_patch_of_a_part_is_that_of_the_whole_pad(whole, symmetry):
    element, *_, full = whole
    *_, part = patch_of(symmetry, element)
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

    *_, half = patch_of((False, True), gap=gap)
    *_, full = patch_of(WHOLE, gap=gap)
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
    pad, pressed, patch = patch_of(gap=reference.plane, force=30.0)
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
    _, _, patch = patch_of(element=element, contact="nodal")
    force = (patch.load[:, None] * patch.normal).sum(axis=0)
    assert force == pytest.approx([0, 0, 10], rel=1e-9, abs=1e-9)
    assert np.abs((patch.load[:, None] * patch.centroid).sum(axis=0)[:2]).max() < 1e-12
