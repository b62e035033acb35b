"""Convex force-motion models of Zhou, Paolini, Bagnell and Mason: sums of lengths instead of sums of squares.

Their objective for the samples ``w_i`` with unit motions ``t_i`` is

    lam |v| + beta sum |P(w_i) - 1| + gamma sum |grad P(w_i) - s_i t_i|    over ``v`` and ``s_i >= 0``

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

from softjaw.lsfit.ellipsoid import MAX_REACH_RATIO, TiltedEllipsoid
from softjaw.lsfit.form import exponents, monomial_gradients, monomials
from softjaw.lsfit.lowest import lies_above, smallest_value
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.sos import conic_solution, gram_map, quadratic_map, side, upper_triangle
from softjaw.lsfit.span import SpanSamples, placed, span_samples
from softjaw.lsfit.surface import FitError, LimitSurface

FloatArray = NDArray[np.float64]


class CollapsedFitError(FitError):
    """The fitted surface does not pass near the samples, or nothing holds it in some direction."""


class ZhouFit(NamedTuple):
    """A fitted surface, in the coordinates of the wrenches.

    ``objective`` is its value in the scaled coordinates of the fit, ``rates (m,)`` are the ``s_i`` of the samples that
    were used.
    """

    surface: LimitSurface
    objective: float
    rates: FloatArray


def zhou_quartic(
    W: ArrayLike, T: ArrayLike, lam: float = 1.0, beta: float = 10.0, gamma: float = 1.0, even: bool = True
) -> ZhouFit:
    """Sos-convex quartic with the least objective, see the head of this file.

    Parameters
    ----------
    W, T : (m, d) array
        Normalised wrenches and unit motions [-].
    lam, beta, gamma : float
        Weights of the coefficients, of the wrenches and of the motions, by default those that the authors use for six
        components. With all 1, as published for three, the errors of the gradients, longer than those of ``P``, may be
        worth more than all of ``P - 1``: then no surface at all is best, which is refused.
    even : bool
        Whether the fit is in components of one size, see `span_samples`; the objective depends on it.

    Raises
    ------
    CollapsedFitError
        If the surface runs away from the samples.
    FitError
        If the solver fails.
    """
    samples = span_samples(W, T, even)
    r, E = samples.rank, exponents(samples.rank, 4)
    M, G = monomials(samples.Y, E), monomial_gradients(samples.Y, r, 4)
    v, rates, objective = _solve(samples, M, G, gram_map(r), np.ones(len(E)), (lam, beta, gamma))
    return _fit(Quartic(v, E), objective, rates, samples)


def zhou_ellipsoid(
    W: ArrayLike, T: ArrayLike, lam: float = 1.0, beta: float = 10.0, gamma: float = 1.0, even: bool = True
) -> ZhouFit:
    """Ellipsoid of any orientation with the least objective; parameters and errors of `zhou_quartic`."""
    samples = span_samples(W, T, even)
    r = samples.rank
    M, G = monomials(samples.Y, exponents(r, 2)), monomial_gradients(samples.Y, r, 2) / 2
    A = quadratic_map(r)
    # The length of v is to be the Frobenius norm of A, which holds every mixed coefficient twice, halved.
    v, rates, objective = _solve(samples, M, G, A, np.sqrt((A.toarray() ** 2).sum(axis=0)), (lam, beta, gamma))
    matrix = (A @ v).reshape(r, r)
    values, V = np.linalg.eigh(matrix)
    # an open form makes no ellipsoid, so it is refused before one is made
    refuse_endless(float(values[0]), V[:, 0], samples.Y, 2)
    return _fit(TiltedEllipsoid(matrix), objective, rates, samples)


def _fit(surface: Quartic | TiltedEllipsoid, objective: float, rates: FloatArray, samples: SpanSamples) -> ZhouFit:
    refuse_runaway(surface, samples.Y)
    return ZhouFit(placed(surface, samples), objective, rates)


def _solve(
    samples: SpanSamples,
    M: FloatArray,
    G: FloatArray,
    A: csr_array,
    size: FloatArray,
    weights: tuple[float, float, float],
) -> tuple[FloatArray, FloatArray, float]:
    """Coefficients ``v (k,)``, rates ``s (m,)`` and objective.

    The unknowns are ``[v, free, s, p, r, n]``: free numbers of the Gram matrix, bounds on ``|P - 1|``, on the length
    of the gradient's error and on ``|v|``. Clarabel asks for ``b - A x`` in a product of cones.
    """
    lam, beta, gamma = weights
    if min(weights) < 0 or not np.isfinite(weights).all():
        raise ValueError(f"lam, beta, gamma are {weights}: expected finite numbers, none negative")
    (m, k), d, f = M.shape, samples.rank, A.shape[1] - M.shape[1]
    unit, none = eye_array(m), csr_array((m, f))
    slip = [[-G[:, :, i], none, diags_array(samples.T[:, i]), None, None, None] for i in range(d)]
    S = upper_triangle(A)
    rows = block_array(
        [
            # the modulus |P - 1| is not smooth; bounded from both sides it becomes linear
            [M, none, None, -unit, None, None],
            [-M, none, None, -unit, None, None],
            [None, none, -unit, None, None, None],
            [None, none, None, None, -unit, None],
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
    b[: 3 * m] = np.repeat([1.0, -1.0, 0.0], m)
    slope = np.repeat([0.0, beta, gamma, lam], [k + f + m, m, m, 1])
    none_squared = csc_array((len(slope),) * 2)
    x, objective = conic_solution(none_squared, slope, rows[order], b, _cones(m, d, k, side(S)))
    return x[:k], x[k + f : k + f + m], objective


def _cones(m: int, d: int, k: int, size: int) -> list:
    return [
        clarabel.NonnegativeConeT(3 * m),
        *[clarabel.SecondOrderConeT(d + 1)] * m,
        clarabel.SecondOrderConeT(k + 1),
        clarabel.PSDTriangleConeT(size),
    ]


def refuse_runaway(surface: Quartic | TiltedEllipsoid, Y: FloatArray) -> None:
    """Raise `CollapsedFitError` if ``surface`` lies twice as far out as the samples ``Y``, or is nearly endless."""
    with np.errstate(divide="ignore"):
        # the median, as single bad samples may lie anywhere
        median = float(np.median(np.maximum(surface.value(Y), 0.0)) ** (-1 / surface.degree))
    if median > 2:
        raise CollapsedFitError(
            f"the surface lies {median:.3g} times as far out as half of the samples: the regulariser outweighs the "
            f"{len(Y)} samples; lower lam, raise beta, or give more samples"
        )
    if isinstance(surface, TiltedEllipsoid):
        return  # `refuse_endless` was asked before its matrix made an ellipsoid
    # the bound from samples is cheap and settles most cases; only the others need a search
    if not lies_above(surface.coefficients, surface.dimension, _least(Y, 4)):
        refuse_endless(*smallest_value(surface.coefficients, surface.dimension), Y, 4)


def refuse_endless(P: float, u: FloatArray, Y: FloatArray, degree: int) -> None:
    """Raise `CollapsedFitError` if a surface reaches too far beyond the samples, by its least value ``P`` at ``u``."""
    least = _least(Y, degree)
    if P < least:
        # a value of zero or less is a reach without end
        reach = MAX_REACH_RATIO * (least / max(P, 1e-300)) ** (1 / degree)
        raise CollapsedFitError(
            f"the surface reaches {reach:.3g} times as far as the samples along {np.round(u, 3).tolist()} (scaled "
            "coordinates), where no sample holds it: sample more motions, lower lam, or raise beta"
        )


def _least(Y: FloatArray, degree: int) -> float:
    """Value on the unit sphere of a surface that reaches `MAX_REACH_RATIO` times as far as the samples."""
    return float((MAX_REACH_RATIO * np.linalg.norm(Y, axis=1).max()) ** -degree)
