"""Materials against their energies, homogeneous states in closed form, and Hooke's law."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softjaw.fem.materials import Material, material, principal, stress
from tests.fem import reference

G = 0.020e6
TWO_TERMS = {"shear_moduli": (1.2e4, 0.8e4), "exponents": (-2.0, 8.0)}
LAWS = {
    "blatz_ko": (material("blatz_ko", G), lambda F: reference.blatz_ko_energy(F, G)),
    "hyperfoam": (material("hyperfoam", poisson_ratio=0.3, shear_moduli=[G], exponents=[3.5]),
                  lambda F: reference.hyperfoam_energy(F, 0.3, [G], [3.5])),
    "two-term hyperfoam": (material("hyperfoam", poisson_ratio=0.1, **TWO_TERMS),
                           lambda F: reference.hyperfoam_energy(F, 0.1, *TWO_TERMS.values())),
    "neo_hookean": (material("neo_hookean", G, 0.4), lambda F: reference.neo_hookean_energy(F, G, 0.4)),
    "nearly incompressible": (material("neo_hookean", G, 0.49), lambda F: reference.neo_hookean_energy(F, G, 0.49)),
    "linear": (material("linear", G, 0.3), lambda F: reference.linear_energy(F, G, 0.3)),
}  # fmt: skip
FINITE = [name for name in LAWS if name != "linear"]
TURN = Rotation.random(random_state=3).as_matrix()


def respond(law: Material, F, tangent=True):
    F = np.ascontiguousarray(F, dtype=float)
    P, A = np.zeros((3, 3)), np.full((3, 3, 3, 3) if tangent else (0, 0, 0, 0), np.nan)
    stress(law.number, F, np.linalg.inv(F), np.linalg.det(F), law.parameters, P, A, np.empty((3, 3, 3)))
    for i, k in ((1, 0), (2, 0), (2, 1)) if tangent else ():
        A[i, :, k] = A[k, :, i].T
    return P, A


def cauchy(law, F):
    P, _ = respond(law, F, tangent=False)
    return P @ F.T / np.linalg.det(F)


def gradients():
    skew = np.eye(3) + 0.25 * np.random.default_rng(7).uniform(-1, 1, (3, 3))
    return {
        "general": skew,
        "two equal": TURN @ np.diag([0.7, 1.1, 1.1]),
        "nearly equal": TURN @ np.diag([1.1 + 1e-5, 1.1, 0.8]) @ TURN.T,
        "pressure": 0.8 * np.eye(3),
        "squeezed": TURN @ np.diag([1.05, 0.4, 1.0]) @ skew,
    }


@pytest.mark.parametrize("state", gradients())
@pytest.mark.parametrize("name", LAWS)
def test_stress_is_the_gradient_of_the_energy_and_the_tangent_that_of_the_stress_and_symmetric(name, state):
    law, energy = LAWS[name]
    F = gradients()[state]
    P, A = respond(law, F)
    assert np.abs(P - reference.differences(energy, F, 3e-4)).max() < 3e-9 * max(np.abs(P).max(), law.young_modulus)
    D = reference.differences(lambda F: respond(law, F, tangent=False)[0], F, 3e-4)
    scale = np.abs(A).max()
    # a hyperfoam takes the limit of its quotient where stretches are equal to 1e-6
    assert np.abs(A - D).max() < 1e-8 * scale
    assert np.abs(A - A.transpose(2, 3, 0, 1)).max() < 1e-9 * scale


@pytest.mark.parametrize("gap", [0.0, 1e-9, 3e-7, 1e-6, 3e-6, 1e-4])
def test_hyperfoam_tangent_is_smooth_where_stretches_meet(gap):
    """The tangent at stretches that differ by ``gap`` is that of equal stretches plus something of that size."""
    law, _ = LAWS["two-term hyperfoam"]
    _, A = respond(law, TURN @ np.diag([1.2 + gap, 1.2, 0.7]))
    _, equal = respond(law, TURN @ np.diag([1.2, 1.2, 0.7]))
    assert np.abs(A - equal).max() < (20 * gap + 1e-9) * np.abs(A).max()


@pytest.mark.parametrize("name", LAWS)
def test_small_strain_is_hooke(name):
    law, _ = LAWS[name]
    P, A = respond(law, np.eye(3))
    delta = np.eye(3)
    shear, lam = law.shear_modulus, reference.lame(law.shear_modulus, law.poisson_ratio)
    straight, crossed = (np.einsum(f"{pairs}->ijkl", delta, delta) for pairs in ("ik,jl", "il,jk"))
    hooke = lam * np.einsum("ij,kl->ijkl", delta, delta) + shear * (straight + crossed)
    assert np.abs(P).max() < 1e-12 * shear
    assert np.abs(A - hooke).max() < 1e-12 * (lam + shear)
    # the antisymmetric part is made regular and does not couple
    compliance = np.linalg.inv(hooke.reshape(9, 9) + shear * np.eye(9) - shear * crossed.reshape(9, 9))
    assert 1 / compliance[0, 0] == pytest.approx(law.young_modulus, rel=1e-12)
    assert -compliance[4, 0] / compliance[0, 0] == pytest.approx(law.poisson_ratio, rel=1e-12)


@pytest.mark.parametrize("name", FINITE)
def test_a_rotation_turns_the_stress_and_a_turned_solid_feels_nothing(name):
    law, _ = LAWS[name]
    F = gradients()["general"]
    P, _ = respond(law, F)
    assert np.abs(respond(law, TURN @ F)[0] - TURN @ P).max() < 1e-13 * np.abs(P).max()
    assert np.abs(respond(law, F @ TURN)[0] - P @ TURN).max() < 1e-13 * np.abs(P).max()
    assert np.abs(respond(law, TURN)[0]).max() < 1e-13 * (law.shear_modulus + law.parameters[-1])


def test_blatz_ko_pressed_to_half_its_height():
    """Lateral stretch ``l^(-1/4)``, Cauchy stress ``G (1 - l^(-5/2))``: -0.0931371 MPa for G = 0.020 MPa, l = 0.5."""
    lateral = 0.5**-0.25
    s = cauchy(material("blatz_ko", G), np.diag([0.5, lateral, lateral]))
    assert s[0, 0] == pytest.approx(G * (1 - 0.5**-2.5), rel=1e-14)
    assert s[0, 0] == pytest.approx(-0.0931371e6, rel=1e-6)
    assert np.abs(s - np.diag([s[0, 0], 0, 0])).max() < 1e-14 * abs(s[0, 0])


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_principal_axes(scale):
    M = np.random.default_rng(2).normal(size=(3, 3)) * scale
    M = M + M.T
    values, vectors = principal(M)
    assert np.sort(values) == pytest.approx(np.linalg.eigvalsh(M), rel=1e-13, abs=1e-14 * scale)
    assert np.abs(vectors @ np.diag(values) @ vectors.T - M).max() < 1e-14 * np.abs(M).max() * 10
    assert np.abs(vectors.T @ vectors - np.eye(3)).max() < 1e-14
