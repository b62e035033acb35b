"""Elements: patch test, rigid motions, zero modes; strain measures; the contact face."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softjaw.fem import materials as kernel
from softjaw.fem.contact.rigid import RigidProblem
from softjaw.fem.materials import material
from softjaw.fem.pad.foam import Foam
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.pad.shape import PadShape

G = 0.020e6
SIZE = (0.06, 0.03, 0.015)
LAWS = {
    "blatz_ko": material("blatz_ko", G),
    "hyperfoam": material("hyperfoam", poisson_ratio=0.1, shear_moduli=[1.2e4, 0.8e4], exponents=[-2.0, 8.0]),
    "neo_hookean": material("neo_hookean", G, 0.4),
    "linear": material("linear", G, 0.3),
}
TURN = Rotation.random(random_state=3).as_matrix()
AFFINE = np.array([[1.1, 0.3, -0.1], [0.05, 0.9, 0.2], [0.1, -0.2, 0.7]])


@pytest.fixture(params=["hex8", "hex27"])
def pad(request):
    return Pad(PadShape(SIZE, (4, 4, 3), (0.5, 3.0, 2.5), request.param), LAWS["blatz_ko"])


def assembled(pad, law, u, tangent=False):
    """Element forces (n, 3, nodes), stiffness and smallest det F for nodal displacements (k, 3)."""
    local = np.ascontiguousarray(u[pad.element_nodes].transpose(0, 2, 1))
    n, nodes = pad.element_nodes.shape
    r, K = np.empty((n, 3, nodes)), np.empty((n, 3, nodes, 3, nodes) if tangent else (0, 0, 0, 0, 0))
    return r, K, kernel.elements(law.number, law.parameters, local, pad.dN, pad.volume, r, K)


def nodal(pad, r):
    out = np.zeros((len(pad.nodes), 3))
    np.add.at(out, pad.element_nodes, r.transpose(0, 2, 1))
    return out


@pytest.mark.parametrize("name", LAWS)
def test_patch(pad, name):
    """Affine motion: no force inside, the contact face pulled by ``P e_z`` times its area, and ``sum r X = V P``."""
    law = LAWS[name]
    u = pad.nodes @ (AFFINE - np.eye(3)).T
    r, _, det = assembled(pad, law, u)
    f = nodal(pad, r)
    P, empty, work = np.empty((3, 3)), np.empty((0, 0, 0, 0)), np.empty((3, 3, 3))
    kernel.stress(law.number, AFFINE, np.linalg.inv(AFFINE), np.linalg.det(AFFINE), law.parameters, P, empty, work)
    x, y, z = np.abs(pad.nodes.T)
    tol = 1e-9
    inside = (x < SIZE[0] / 2 - tol) & (y < SIZE[1] / 2 - tol)
    scale = np.abs(f).max()
    assert inside.sum() > 4
    assert np.abs(f[inside & (z > tol) & (z < SIZE[2] - tol)]).max() < 1e-13 * scale
    virial, volume = np.einsum("ni,nj->ij", f, pad.nodes), np.prod(SIZE)
    assert np.abs(virial - volume * P).max() < 1e-13 * volume * np.abs(P).max()
    front = pad.node_area * ((x < SIZE[0] / 2 - tol) & (y < SIZE[1] / 2 - tol))[pad.contact_nodes]
    expected = front[:, None] * P[:, 2]
    inner = front > 0
    assert np.abs(f[pad.contact_nodes][inner] - expected[inner]).max() < 1e-13 * scale
    assert det == pytest.approx(np.linalg.det(AFFINE), rel=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_rigid_motions_need_no_force_and_the_undeformed_pad_has_its_zero_modes_and_ellipticity(pad, name):
    turn = np.eye(3) if name == "linear" else TURN
    r, _, det = assembled(pad, LAWS[name], pad.nodes @ (turn - np.eye(3)).T + [0.1, -0.2, 0.3])
    force = LAWS[name].young_modulus * SIZE[0] * SIZE[1]
    assert np.abs(nodal(pad, r)).max() < 1e-13 * force
    assert det == pytest.approx(1, rel=1e-12)
    _, K, _ = assembled(pad, LAWS[name], np.zeros_like(pad.nodes), tangent=True)
    n = 3 * pad.element_nodes.shape[1]
    values = np.linalg.eigvalsh(K[0].reshape(n, n))
    assert np.abs(values[:6]).max() < 1e-13 * values[-1]
    assert values[6] > 1e-3 * values[-1]
    strain, ellipticity = measures(pad, LAWS[name], np.eye(3), TURN)
    assert strain < 1e-14
    assert ellipticity == pytest.approx(1, rel=1e-7)


def measures(pad, law, F, directions):
    foam = Foam(Pad(pad.shape, law))
    foam._displacements = lambda x: x
    u = pad.nodes @ (np.asarray(F) - np.eye(3)).T
    return foam.strains(np.ascontiguousarray(u[pad.element_nodes].transpose(0, 2, 1)), np.asarray(directions))[1:]


def test_largest_strain(pad):
    strain, _ = measures(pad, LAWS["blatz_ko"], TURN @ np.diag([1.2, 0.7, 1.0]) @ TURN, np.eye(3))
    assert strain == pytest.approx(0.3, rel=1e-12)


@pytest.mark.parametrize(("excess", "elliptic"), [(0.98, True), (1.02, False)])
def test_blatz_ko_loses_ellipticity_at_a_stretch_ratio_of_two_plus_root_three(pad, excess, elliptic):
    """Elliptic until two stretches differ by 2 + sqrt 3 (Knowles and Sternberg, J. Elasticity 5, 1975)."""
    ratio = excess * (2 + np.sqrt(3))
    angle = np.linspace(0, np.pi, 721)
    fan = np.column_stack([np.cos(angle), 0 * angle, np.sin(angle)])
    _, ellipticity = measures(pad, LAWS["blatz_ko"], np.diag([1.0, 1.0, 1 / ratio]), fan)
    assert (ellipticity > 0) == elliptic


@pytest.mark.parametrize("contact", ["weighted", "blended", "nodal"])
@pytest.mark.parametrize("element", ["hex8", "hex27"])
def test_contact_face_under_constant_pressure_and_gap(element, contact):
    """Every node gets ``A_i g`` and ``-A_i p n``."""
    pad = Pad(PadShape(SIZE, (2, 2, 1), (2.0, 1.0, 1.0), element), LAWS["blatz_ko"], contact=contact)
    n = np.array([0.0, 0.6, -0.8])
    problem = RigidProblem(pad, lambda x: (np.full(len(x), 2e-3), np.tile(n, (len(x), 1)), np.zeros((len(x), 3, 3))))
    x = np.zeros(problem.size)
    x[problem.finger.pressures] = 5e3 / problem.finger.kappa
    (c,) = problem.evaluate(x)
    assert c.weighted == pytest.approx(2e-3 * pad.node_area, rel=1e-13)
    force = problem.residual(x)[pad.dofs[pad.contact_nodes]]
    np.testing.assert_allclose(force, -5e3 * np.outer(pad.node_area, n), rtol=1e-12, atol=1e-20)
