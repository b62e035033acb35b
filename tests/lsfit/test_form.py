"""Homogeneous forms: monomials, derivatives, substitution, and the smallest value against dense searches."""

import numpy as np
import pytest
from scipy.optimize import minimize

from softjaw.lsfit.form import exponents, hessian_tensor, monomial_gradients, monomials, substitute
from softjaw.lsfit.lowest import lies_above, smallest_value
from softjaw.lsfit.sos import ball_gram
from tests.scoring.grasps import unit

RANDOM = np.random.default_rng(3)


@pytest.mark.parametrize(
    ("d", "degree", "count"), [(1, 4, 1), (2, 4, 5), (3, 2, 6), (3, 4, 15), (6, 2, 21), (6, 4, 126)]
)
def test_there_are_as_many_monomials_as_ways_to_share_the_degree(d, degree, count):
    E = exponents(d, degree)
    assert E.shape == (count, d)
    assert (E.sum(axis=1) == degree).all()
    assert len(np.unique(E, axis=0)) == count


@pytest.mark.parametrize("d", [1, 2, 3, 6])
def test_monomials_are_products_of_powers_with_substitution_and_derivatives(d):
    E, w = exponents(d, 4), RANDOM.normal(size=(7, d))
    np.testing.assert_allclose(monomials(w, E), np.prod(w[:, None] ** E, axis=2), rtol=1e-13)
    w, L = RANDOM.normal(size=(5, d)), RANDOM.normal(size=(d, d))
    c = RANDOM.normal(size=len(E))
    np.testing.assert_allclose(monomials(w, E) @ substitute(c, E, L), monomials(w @ L.T, E) @ c, rtol=1e-8, atol=1e-10)
    w, step = RANDOM.normal(size=(4, d)), 1e-5
    G, c = monomial_gradients(w, d, 4), RANDOM.normal(size=len(E))
    H = np.einsum("ijkl,mk,ml->mij", hessian_tensor(c, d), w, w)
    for i, e in enumerate(step * np.eye(d)):
        slope = (monomials(w + e, E) - monomials(w - e, E)) / (2 * step)
        np.testing.assert_allclose(G[:, :, i], slope, rtol=1e-7, atol=1e-7)
        slope = (monomial_gradients(w + e, d, 4) - monomial_gradients(w - e, d, 4)) / (2 * step)
        np.testing.assert_allclose(H[:, i], np.einsum("mkj,k->mj", slope, c), rtol=1e-6, atol=1e-5)


def coefficients(P, d):
    w = np.random.default_rng(0).normal(size=(4 * len(exponents(d, 4)), d))
    return np.linalg.lstsq(monomials(w, exponents(d, 4)), P(w), rcond=None)[0]


def random_form(rng, d, kind):
    E = exponents(d, 4)
    if kind == 0:
        return rng.normal(size=len(E))
    if kind == 1:
        A = rng.normal(size=(d + 2, d)) * np.geomspace(1, 10 ** rng.uniform(0, 1.5), d)
        return coefficients(lambda w: ((w @ A.T) ** 4).sum(axis=1), d)
    a = rng.normal(size=len(exponents(d, 2)))
    return coefficients(lambda w: (monomials(w, exponents(d, 2)) @ a) ** 2 + 1e-3 * (w**4).sum(axis=1), d)


@pytest.mark.parametrize(("d", "count"), [
    (1, 3), (2, 12), (3, 12), (4, 3), *(pytest.param(*case, marks=pytest.mark.long) for case in ((3, 60), (6, 2))),
])  # fmt: skip
def test_no_direction_has_a_smaller_value(d, count):
    rng, E = np.random.default_rng(d), exponents(d, 4)
    for k in range(count):
        v = random_form(rng, d, k % 3)
        value, at = smallest_value(v, d)
        assert monomials(at, E)[0] @ v == pytest.approx(value, abs=1e-14 * np.abs(v).max())
        u = unit(rng.normal(size=(20_000, d)))
        P = monomials(u, E) @ v

        def along(x, v=v):
            return float(monomials(unit(x), E)[0] @ v)

        options = {"xatol": 1e-9, "fatol": 1e-15, "maxiter": 400 * d}
        best = min(minimize(along, u[i], method="Nelder-Mead", options=options).fun for i in np.argsort(P)[:2])
        assert value <= best + 1e-12 * np.abs(P).max()


@pytest.mark.parametrize("d", [1, 2, 3, 6])
def test_a_level_is_passed_from_one_side_only(d):
    rng = np.random.default_rng(d)
    for kind in (1, 2):
        v = random_form(rng, d, kind)
        value = smallest_value(v, d)[0]
        assert value > 0
        assert lies_above(v, d, value * (1 - 1e-6))
        assert not lies_above(v, d, value * (1 + 1e-6))
    assert not lies_above(-ball_gram(d)[: len(exponents(d, 4))], d, 0.0)
