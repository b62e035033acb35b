"""Convex force-motion models of Zhou, Paolini, Bagnell and Mason: sums of lengths instead of sums of squares.

Their objective for the samples ``w_i`` with unit motions ``t_i`` is

    lam |v| + beta sum |P(w_i) - 1| + gamma sum |grad P(w_i) - s_i t_i|    over ``v`` and ``s_i >= s_min``

with the coefficients ``v`` of a quartic form that is sos-convex, or with ``P = w' A w``, ``A`` positive semidefinite,
``|A|_F`` for ``|v|`` and ``A w`` for the gradient (without its factor 2, as in their programme). Single bad samples
weigh less than in least squares. The programme goes to Clarabel as it is: one cone of second order per sample.

Reference: Zhou, Paolini, Bagnell, Mason, "A convex polynomial force-motion model for planar sliding: identification and
application", ICRA 2016.
"""

from __future__ import annotations

from typing import NamedTuple

import clarabel
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array

from softjaw.lsfit.ellipsoid import TiltedEllipsoid
from softjaw.lsfit.form import exponents, monomial_gradients, monomials
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.sos import conic_solution, gram_map, quadratic_map, side, upper_triangle
from softjaw.lsfit.span import Scaling, SpanSamples, placed, refuse_endless, refuse_runaway, span_samples
from softjaw.lsfit.surface import LimitSurface

FloatArray = NDArray[np.float64]


class ZhouWeights(NamedTuple):
    """Weights of the objective: of the coefficients, of the wrenches and of the motions."""

    lam: float = 1.0
    beta: float = 1.0
    gamma: float = 1.0


SIX_WEIGHTS = ZhouWeights(1.0, 10.0, 1.0)
"""The weights that the paper's authors use for wrenches of six components."""


ENOUGH = 1e-6
"""Relative gap and residuals of the programme from which its solution is taken."""


class ZhouFit(NamedTuple):
    """A fitted surface, in the coordinates of the wrenches.

    ``objective`` is its value in the scaled coordinates of the fit, ``rates (m,)`` are the ``s_i`` of the samples that
    were used, ``rank`` is the dimension of the samples' span; below that of the wrenches the surface is flat and
    flagged.
    """

    surface: LimitSurface
    objective: float
    rates: FloatArray
    rank: int


def zhou_quartic(
    W: ArrayLike,
    T: ArrayLike,
    weights: ZhouWeights = ZhouWeights(),  # noqa: B008 - immutable
    s_min: float = 0.0,
    scaling: Scaling = "maxima",
) -> ZhouFit:
    """Sos-convex quartic with the least objective, see the head of this file.

    Parameters
    ----------
    W, T : (m, d) array
        Normalised wrenches and unit motions [-].
    weights : ZhouWeights
        ``lam``, ``beta`` and ``gamma``, all 1 as published or `SIX_WEIGHTS`. With all 1 the errors of the gradients,
        longer than those of ``P``, may be worth more than all of ``P - 1``: then no surface at all is best, which is
        refused. A larger ``beta``, as in `SIX_WEIGHTS`, prevents it.
    s_min : float
        Least length of the gradients along the motions.
    scaling : str
        Coordinates of the fit, see `span_samples`; the objective depends on them.

    Raises
    ------
    CollapsedFitError
        If the surface runs away from the samples.
    FitError
        If the solver fails.
    """
    samples = span_samples(W, T, scaling)
    r, E = samples.rank, exponents(samples.rank, 4)
    M, G = monomials(samples.Y, E), monomial_gradients(samples.Y, r, 4)
    v, rates, objective = _solve(samples, M, G, gram_map(r), np.ones(len(E)), weights, s_min)
    return _fit(Quartic(v, E), objective, rates, samples)


def zhou_ellipsoid(
    W: ArrayLike,
    T: ArrayLike,
    weights: ZhouWeights = ZhouWeights(),  # noqa: B008 - immutable
    s_min: float = 0.0,
    scaling: Scaling = "maxima",
) -> ZhouFit:
    """Ellipsoid of any orientation with the least objective; parameters and errors of `zhou_quartic`."""
    samples = span_samples(W, T, scaling)
    r = samples.rank
    M, G = monomials(samples.Y, exponents(r, 2)), monomial_gradients(samples.Y, r, 2) / 2
    A = quadratic_map(r)
    # The length of v is to be the Frobenius norm of A, which holds every mixed coefficient twice, halved.
    v, rates, objective = _solve(samples, M, G, A, np.sqrt((A.toarray() ** 2).sum(axis=0)), weights, s_min)
    matrix = (A @ v).reshape(r, r)
    values, V = np.linalg.eigh(matrix)
    # an open form makes no ellipsoid, so it is refused before one is made
    refuse_endless(float(values[0]), V[:, 0], samples.Y, 2)
    return _fit(TiltedEllipsoid(matrix), objective, rates, samples)


def _fit(surface: Quartic | TiltedEllipsoid, objective: float, rates: FloatArray, samples: SpanSamples) -> ZhouFit:
    refuse_runaway(surface, samples.Y)
    return ZhouFit(placed(surface, samples), objective, rates, samples.rank)


def _solve(
    samples: SpanSamples,
    M: FloatArray,
    G: FloatArray,
    A: csr_array,
    size: FloatArray,
    weights: ZhouWeights,
    s_min: float,
) -> tuple[FloatArray, FloatArray, float]:
    """Coefficients ``v (k,)``, rates ``s (m,)`` and objective.

    The unknowns are ``[v, free, s, p, r, n]``: free numbers of the Gram matrix, bounds on ``|P - 1|``, on the length
    of the gradient's error and on ``|v|``. Clarabel asks for ``b - A x`` in a product of cones.
    """
    if min(weights) < 0 or not np.isfinite([*weights, s_min]).all() or s_min < 0:
        raise ValueError(f"weights are {tuple(weights)} and s_min is {s_min}: expected finite numbers, none negative")
    (m, k), d, f = M.shape, samples.rank, A.shape[1] - M.shape[1]
    one, none = eye_array(m), csr_array((m, f))
    slip = [[-G[:, :, i], none, diags_array(samples.T[:, i]), None, None, None] for i in range(d)]
    S = upper_triangle(A)
    rows = block_array(
        [
            # the modulus |P - 1| is not smooth; bounded from both sides it becomes linear
            [M, none, None, -one, None, None],
            [-M, none, None, -one, None, None],
            [None, none, -one, None, None, None],
            [None, none, None, None, -one, None],
            *slip,
            [None, None, None, None, None, csr_array([[-1.0]])],
            [-diags_array(size), None, None, None, None, None],
            [-S[:, :k], -S[:, k:], None, None, None, None],
        ],
        format="csr",
    )
    # rows come component by component; a cone of second order needs those of one sample side by side
    order = np.arange(rows.shape[0])
    cones_of_slip = slice(3 * m, (4 + d) * m)
    order[cones_of_slip] = order[cones_of_slip].reshape(d + 1, m).T.ravel()
    b = np.zeros(len(order))
    b[: 3 * m] = np.repeat([1.0, -1.0, -s_min], m)
    slope = np.repeat([0.0, weights.beta, weights.gamma, weights.lam], [k + f + m, m, m, 1])
    # nearly collapsed fits stop a few times short of Clarabel's own tolerance, 1e-8; what they reached decides
    none_squared = csc_array((len(slope),) * 2)
    x, objective = conic_solution(none_squared, slope, rows[order], b, _cones(m, d, k, side(S)), ENOUGH)
    return x[:k], x[k + f : k + f + m], objective


def _cones(m: int, d: int, k: int, size: int) -> list:
    return [
        clarabel.NonnegativeConeT(3 * m),
        *[clarabel.SecondOrderConeT(d + 1)] * m,
        clarabel.SecondOrderConeT(k + 1),
        clarabel.PSDTriangleConeT(size),
    ]
