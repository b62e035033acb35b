"""The pad's mesh and the numbering of its unknowns."""

import numpy as np
import pytest

from softjaw.fem.materials import material
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.pad.shape import PadShape

FOAM = material("blatz_ko", 0.020e6)
SIZE = (0.06, 0.03, 0.015)
SYMMETRIES = [(False, False), (True, False), (False, True), (True, True)]


@pytest.fixture(params=["hex8", "hex27"])
def element(request):
    return request.param


@pytest.mark.parametrize("contact", ["weighted", "blended", "nodal"])
@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_volumes_and_areas_add_up(element, contact, symmetry):
    pad = Pad(PadShape(SIZE, (4, 6, 3), (2.0, 0.5, 3.0), element), FOAM, symmetry, contact)
    assert pad.volume.sum() == pytest.approx(pad.share * np.prod(SIZE), rel=1e-13)
    assert pad.face_area.sum() == pytest.approx(pad.share * SIZE[0] * SIZE[1], rel=1e-13)
    assert pad.node_area.sum() == pytest.approx(pad.share * SIZE[0] * SIZE[1], rel=1e-13)
    assert pad.node_area.min() > 0
    assert pad.volume.min() > 0


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_every_unknown_has_its_place(element, symmetry):
    """Free displacements first, one closing displacement for the bonded back, one pressure per contact node."""
    pad = Pad(PadShape(SIZE, (4, 6, 3), element=element), FOAM, symmetry)
    order = pad.shape.per_side - 1
    n = [order * (k // 2 if s else k) + 1 for k, s in zip((4, 6, 3), (*symmetry, False), strict=True)]
    assert len(pad.nodes) == np.prod(n)
    assert pad.contact_grid == (n[0], n[1])
    above = np.prod(n[:2]) * (n[2] - 1)
    fixed = sum(np.prod([n[j] for j in range(2) if j != i]) * (n[2] - 1) for i in range(2) if symmetry[i])
    assert pad.closing_dof == 3 * above - fixed
    assert pad.size == pad.closing_dof + 1 + n[0] * n[1]
    own = pad.dofs[(pad.dofs >= 0) & (pad.dofs < pad.closing_dof)]
    assert (np.sort(own) == np.arange(pad.closing_dof)).all()
    back = np.isclose(pad.nodes[:, 2], -SIZE[2])
    assert (pad.dofs[back] == [-1, -1, pad.closing_dof]).all()
    assert (pad.dofs == pad.closing_dof).sum() == back.sum() == n[0] * n[1]
    for axis in range(2):
        mirror = symmetry[axis] & np.isclose(pad.nodes[:, axis], 0)
        assert (pad.dofs[mirror, axis] == -1).all()


def test_grading():
    shape = PadShape(SIZE, (8, 6, 5), (4.0, 1.0, 3.0))
    x, y, z = (np.diff(shape.lines(axis, False)) for axis in range(3))
    assert x == pytest.approx(x[::-1])
    assert x[-1] / x[4] == pytest.approx(4)
    assert x[5:] / x[4:-1] == pytest.approx(4 ** (1 / 3))
    assert y == pytest.approx(SIZE[1] / 6)
    assert z[0] / z[-1] == pytest.approx(3)  # the back over the contact face
    assert z.sum() == pytest.approx(SIZE[2])
    assert shape.lines(0, True) == pytest.approx(shape.lines(0, False)[4:])
    assert shape.lines(2, False)[-1] == 0


@pytest.mark.parametrize("elements", [(20, 10, 6), (24, 12, 6), (5, 4, 1), (2, 2, 2), (16, 8, 8)])
def test_halved_has_half_as_many_elements_everywhere(elements):
    shape = PadShape(SIZE, elements, (2.0, 1.5, 3.0), "hex27")
    coarse = shape.halved()
    assert coarse.size == shape.size
    assert coarse.grading == shape.grading
    assert coarse.element == shape.element
    for fine, n, across in zip(elements, coarse.elements, (True, True, False), strict=True):
        # even sides stay even, for the planes of symmetry
        assert n - -(-fine // 2) == (1 if across and fine % 4 == 2 else 0)


def test_pressures_at_nodes_are_those_of_a_smooth_pressure():
    """Forces ``int N_i p`` of p = cos(2 x), in closed form, to fourth order; to second with Gauss points or nodes."""

    def wrong(rule, n):
        pad = Pad(PadShape((2.0, 1.0, 1.0), (n, 1, 1)), FOAM, contact=rule)
        p = np.cos(2 * pad.nodes[pad.face_nodes, 0])
        forces = np.bincount(pad.face_nodes.ravel(), ((pad.face_area * (p @ pad.face_N.T)) @ pad.face_N).ravel())
        h, x = 2.0 / n, pad.nodes[pad.contact_nodes, 0]
        exact = 0.5 * h * np.cos(2 * x) * (np.sin(h) / h) ** 2
        return np.abs(forces[pad.contact_nodes] - exact)[np.abs(x) < 0.99].max() / h

    for rule, order in (("weighted", 2), ("nodal", 2), ("blended", 4)):
        assert np.log2(wrong(rule, 16) / wrong(rule, 32)) == pytest.approx(order, abs=0.1)
