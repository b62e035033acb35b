"""Homogeneous forms: monomials, derivatives, substitution."""

import numpy as np
import pytest

from softjaw.lsfit.form import (
    exponents,
    hessian_tensor,
    monomial_gradients,
    monomials,
    substitute,
)

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
def test_monomials_are_products_of_powers(d):
    E, w = exponents(d, 4), RANDOM.normal(size=(7, d))
    np.testing.assert_allclose(monomials(w, E), np.prod(w[:, None] ** E, axis=2), rtol=1e-13)


@pytest.mark.parametrize("d", [1, 2, 3, 6])
def test_derivatives_match_differences(d):
    E, w, step = exponents(d, 4), RANDOM.normal(size=(4, d)), 1e-5
    G, c = monomial_gradients(w, d, 4), RANDOM.normal(size=len(E))
    H = np.einsum("ijkl,mk,ml->mij", hessian_tensor(c, d), w, w)
    for i, e in enumerate(step * np.eye(d)):
        np.testing.assert_allclose(
            G[:, :, i], (monomials(w + e, E) - monomials(w - e, E)) / (2 * step), rtol=1e-7, atol=1e-7
        )
        slope = (monomial_gradients(w + e, d, 4) - monomial_gradients(w - e, d, 4)) / (2 * step)
        np.testing.assert_allclose(H[:, i], np.einsum("mkj,k->mj", slope, c), rtol=1e-6, atol=1e-5)


@pytest.mark.parametrize("d", [1, 2, 3, 6])
def test_substitution_is_composition(d):
    E, w, L = exponents(d, 4), RANDOM.normal(size=(5, d)), RANDOM.normal(size=(d, d))
    c = RANDOM.normal(size=len(E))
    np.testing.assert_allclose(monomials(w, E) @ substitute(c, E, L), monomials(w @ L.T, E) @ c, rtol=1e-8, atol=1e-10)
