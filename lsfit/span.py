"""Fits within the span of the samples, with axes of a like length: limit surfaces of all six wrench components.

The friction of a patch moves all six components of the wrench ``[f, tau]`` when its motions are all six of ``[v,
omega]``; the moments are taken about the origin of the contact frame, by ``l = r - O``. Everything here works in any
number of dimensions: a plane patch has rank 3 among the six components, a cylinder or a cap 6.

Beside least squares there are the convex force-motion models of Zhou, Paolini, Bagnell and Mason, sums of lengths
instead of sums of squares. Their objective for the samples ``w_i`` with unit motions ``t_i`` is

    lam |v| + beta sum |P(w_i) - 1| + gamma sum |grad P(w_i) - s_i t_i|    over ``v`` and ``s_i >= 0``

with the coefficients ``v`` of a quartic form that is sos-convex, or with ``P = w' A w``, ``A`` positive semidefinite,
``|A|_F`` for ``|v|`` and ``A w`` for the gradient (without its factor 2, as in their programme). Single bad samples
weigh less than in least squares. The programme goes to Clarabel as it is: one cone of second order per sample.

Reference: Zhou, Paolini, Bagnell, Mason, "A convex polynomial force-motion model for planar sliding: identification and
application", ICRA 2016.
"""

from typing import NamedTuple

import clarabel
import numpy as np
from numpy.typing import ArrayLike
from scipy.sparse import block_array, csc_array, csr_array, diags_array, eye_array

from softjaw.lsfit.ellipsoid import MAX_REACH_RATIO, Ellipsoid, full_ellipsoid
from softjaw.lsfit.form import exponents, monomial_gradients, monomials
from softjaw.lsfit.lowest import lies_above, smallest_value
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.samples import FLAT_RATIO, FitErrors, fit_error, principal_frame, radii
from softjaw.lsfit.sos import conic_solution, gram_map, quadratic_map, side, upper_triangle
from softjaw.lsfit.surface import FitError, FitFlag, FloatArray, LimitSurface

# lam, beta and gamma of Zhou's objective, those of the authors for six components. With all 1, as published for three,
# the errors of the gradients, longer than those of P, may be worth more than all of P - 1: no surface at all is best.
ZHOU_WEIGHTS = 1.0, 10.0, 1.0


class SpanSamples(NamedTuple):
    """Samples in coordinates ``y`` of their span, ``w = B y``.

    ``Y (m, r)`` are the wrenches and ``T (m, r)`` the unit motions, which change by ``B'`` so that powers stay the
    same; ``B (d, r)`` has as many columns as the span has dimensions. ``flag`` tells whether the samples are flat, or
    thin with all components made one size.
    """

    Y: FloatArray
    T: FloatArray
    B: FloatArray
    flag: FitFlag

    @property
    def rank(self) -> int:
        """Dimension of the span."""
        return self.B.shape[1]


def span_samples(W: ArrayLike, T: ArrayLike) -> SpanSamples:
    """Samples within their span, scaled; ``W, T (m, d)`` are normalised wrenches and unit motions [-].

    A plane patch gives wrenches of rank 3 among the six components, a curved one of rank 6. Every component is divided
    by its largest magnitude (as in the published fits in six dimensions), or every principal direction if the samples
    do not span all components that they use. Motions that meet no friction are left out.
    """
    wrenches, motions = np.asarray(W, float), np.asarray(T, float)
    largest = np.abs(wrenches).max(axis=0)
    B, flag = _map(wrenches, largest)
    # a motion that meets no friction has a wrench of rounding, whose direction means nothing
    used = largest > FLAT_RATIO * largest.max()
    moving = (np.abs(wrenches[:, used]) > FLAT_RATIO * largest[used]).any(axis=1)
    Y, slip = wrenches[moving] @ np.linalg.pinv(B).T, motions[moving] @ B
    return SpanSamples(Y, slip / np.linalg.norm(slip, axis=1, keepdims=True), B, flag)


def _map(W: FloatArray, largest: FloatArray) -> tuple[FloatArray, FitFlag]:
    """Columns ``B (d, r)`` of the coordinates, and whether the samples are flat or thin."""
    used = np.flatnonzero(largest > FLAT_RATIO * largest.max())
    scale = largest[used, None]
    # Rank is a property of the samples, not of the unit of a torque: judge it with all components of one size.
    frame, Y, flag = principal_frame(W[:, used] / scale.T)
    B = np.zeros((W.shape[1], frame.shape[1]))
    # a diagonal map keeps the surface a quartic of the components, which files and look-ups can hold
    B[used] = scale * (np.eye(len(used)) if len(used) == len(frame.T) else frame * np.abs(Y).max(axis=0))
    return B, flag | FitFlag.RANK_DEFICIENT * (B.shape[0] > B.shape[1])


def span_ellipsoid(W: ArrayLike, T: ArrayLike) -> tuple[LimitSurface, FitErrors]:
    """Ellipsoid of least squares ``min sum (w' A w - 1)^2``, 21 coefficients in six dimensions, and its errors.

    These are in the scaled coordinates, where the axes have a like length; in the others a soft axis decides every
    angle. Where samples leave the ellipsoid open, see `full_ellipsoid`.
    """
    samples = span_samples(W, T)
    surface = full_ellipsoid(samples.Y)
    return surface.mapped(samples.B, samples.flag), fit_error(surface, samples.Y, samples.T)


def span_quartic(W: ArrayLike, T: ArrayLike) -> LimitSurface:
    """`convex_quartic` in the scaled coordinates.

    Six dimensions take at least 1000 samples ``W, T (m, d)``, as 126 coefficients follow the noise of few.
    """
    samples = span_samples(W, T)
    return convex_quartic(samples.Y, samples.T)[0].mapped(samples.B, samples.flag)


def zhou_quartic(samples: SpanSamples, weights: tuple[float, float, float] = ZHOU_WEIGHTS) -> LimitSurface:
    """Sos-convex quartic with the least objective, see the head of this file, in the coordinates of the samples.

    `FitError`: the surface runs away from the samples, or the solver fails.
    """
    r, E = samples.rank, exponents(samples.rank, 4)
    M, G = monomials(samples.Y, E), monomial_gradients(samples.Y, r, 4)
    surface = Quartic(_solve(samples, M, G, gram_map(r), np.ones(len(E)), weights), np.eye(r))
    refuse_runaway(surface, samples.Y)
    # the bound from samples is cheap and settles most cases; only the others need a search
    if not lies_above(surface.form, r, _least(samples.Y, 4)):
        refuse_endless(*smallest_value(surface.form, r), samples.Y, 4)
    return surface.mapped(samples.B, samples.flag)


def zhou_ellipsoid(samples: SpanSamples, weights: tuple[float, float, float] = ZHOU_WEIGHTS) -> LimitSurface:
    """Ellipsoid of any orientation with the least objective; parameters and errors of `zhou_quartic`."""
    r = samples.rank
    M, G = monomials(samples.Y, exponents(r, 2)), monomial_gradients(samples.Y, r, 2) / 2
    A = quadratic_map(r)
    # The length of v is to be the Frobenius norm of A, which holds every mixed coefficient twice, halved.
    size = np.sqrt((A.toarray() ** 2).sum(axis=0))
    matrix = (A @ _solve(samples, M, G, A, size, weights)).reshape(r, r)
    values, V = np.linalg.eigh(matrix)
    # an open form makes no ellipsoid, so it is refused before one is made
    refuse_endless(float(values[0]), V[:, 0], samples.Y, 2)
    surface = Ellipsoid.of_matrix(matrix)
    refuse_runaway(surface, samples.Y)
    return surface.mapped(samples.B, samples.flag)


def _solve(
    samples: SpanSamples,
    M: FloatArray,
    G: FloatArray,
    A: csr_array,
    size: FloatArray,
    weights: tuple[float, float, float],
) -> FloatArray:
    """Coefficients ``v (k,)``.

    The unknowns are ``[v, free, s, p, r, n]``: free numbers of the Gram matrix, bounds on ``|P - 1|``, on the length
    of the gradient's error and on ``|v|``. Clarabel asks for ``b - A x`` in a product of cones.
    """
    lam, beta, gamma = weights
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
    of_slip, of_length = [clarabel.SecondOrderConeT(d + 1)] * m, clarabel.SecondOrderConeT(k + 1)
    cones = [clarabel.NonnegativeConeT(3 * m), *of_slip, of_length, clarabel.PSDTriangleConeT(side(S))]
    return conic_solution(csc_array((len(slope),) * 2), slope, rows[order], b, cones)[:k]


def refuse_runaway(surface: Quartic | Ellipsoid, Y: FloatArray) -> None:
    """Raise `FitError` if ``surface`` lies twice as far out as the samples ``Y``."""
    # the median, as single bad samples may lie anywhere
    median = float(np.median(radii(surface, Y)))
    if median > 2:
        text = f"the surface lies {median:.3g} times as far out as half of the {len(Y)} samples: give more of them"
        raise FitError(text)


def refuse_endless(P: float, u: FloatArray, Y: FloatArray, degree: int) -> None:
    """Raise `FitError` if a surface reaches too far beyond the samples, by its least value ``P`` at ``u``."""
    least = _least(Y, degree)
    if P < least:
        # a value of zero or less is a reach without end
        reach = MAX_REACH_RATIO * (least / max(P, 1e-300)) ** (1 / degree)
        raise FitError(
            f"the surface reaches {reach:.3g} times as far as the samples along {np.round(u, 3).tolist()} (scaled "
            "coordinates), where no sample holds it: sample more motions"
        )


def _least(Y: FloatArray, degree: int) -> float:
    """Value on the unit sphere of a surface that reaches `MAX_REACH_RATIO` times as far as the samples."""
    return float((MAX_REACH_RATIO * np.linalg.norm(Y, axis=1).max()) ** -degree)
