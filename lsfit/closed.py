"""Whether the level set of a quartic form is closed: the smallest value on the sphere against a margin."""

from __future__ import annotations

from enum import Enum

import numpy as np
from numpy.typing import NDArray

from softjaw.lsfit.flag import OpenBodyError, UndecidedError
from softjaw.lsfit.form import exponents
from softjaw.lsfit.geometry import half_sphere_monomials
from softjaw.lsfit.lowest import lies_above, smallest_value

FloatArray = NDArray[np.float64]

CLOSED = 1e-12
"""Share of a form's largest value on the sphere that its smallest one must exceed to be told from zero.

Coefficients of 16 digits that were turned or fitted are off by some 1e-15 of the largest. A body that reaches 1000
times as far as its narrowest width is at this margin, since the reach is ``P^(-1/4)``.
"""


class Closed(Enum):
    """Whether a level set is closed."""

    YES = "yes"
    NO = "no"
    UNDECIDED = "undecided"


def closed(coefficients: FloatArray, dimension: int) -> tuple[Closed, float, FloatArray]:
    """Whether ``P = 1`` is closed for a quartic form, with the value of ``P`` that decides and its direction.

    A form of the sum of forms in variables of their own is closed if each of these is; so a short axis beside long
    ones is judged by its own size where no monomial mixes them.

    Parameters
    ----------
    coefficients : (k,) array
        In the order of ``exponents(dimension, 4)``.

    Returns
    -------
    Closed
        `YES` if ``P`` exceeds `CLOSED` of its largest value all over the sphere, `NO` if it is below minus that
        somewhere or does not depend on a variable at all, else `UNDECIDED`.
    float
        Smallest value of ``P`` on the sphere of the variables that decide; where it is `YES` the margin.
    (d,) array
        Where it is; 0 where it is `YES`.
    """
    E = exponents(dimension, 4)
    answer = Closed.YES, 0.0, np.zeros(dimension)
    for group in _groups(coefficients, E):
        own = coefficients[(E[:, ~group] == 0).all(axis=1)]
        n = int(group.sum())
        margin = CLOSED * float(np.abs(half_sphere_monomials(n, 200) @ own).max())
        if margin > 0 and lies_above(own, n, margin):
            continue
        value, u = smallest_value(own, n)
        direction = np.zeros(dimension)
        direction[group] = u
        if value < -margin or margin == 0:
            return Closed.NO, value, direction
        answer = Closed.UNDECIDED, value, direction
    return answer


def refuse_open(coefficients: FloatArray, dimension: int, placed: FloatArray | None = None) -> None:
    """Refuse a quartic form whose level set is not closed, or not known to be.

    Parameters
    ----------
    coefficients : (k,) array
        In the order of ``exponents(dimension, 4)``.
    placed : (d, d) array, optional
        Map from the variables to those that the message is to name.

    Raises
    ------
    OpenBodyError
        If the form is negative somewhere.
    UndecidedError
        If its smallest value is too small to be told from zero.
    """
    answer, value, u = closed(coefficients, dimension)
    if answer is Closed.YES:
        return
    along = u if placed is None else placed @ u / np.linalg.norm(placed @ u)
    where = f"P is {value:.3g} along {along.round(6).tolist()}"
    if answer is Closed.NO:
        raise OpenBodyError(f"{where}: the level set is not closed, so it bounds no body")
    raise UndecidedError(
        f"{where}, less than rounding can tell from zero ({CLOSED:g} of its largest value): whether the level set is "
        "closed is undecided; if its axes differ by more than a factor of 1000, give their sizes as units"
    )


def _groups(coefficients: FloatArray, E: NDArray[np.int64]) -> list[NDArray[np.bool_]]:
    """Sets of variables, as masks ``(d,)``, that share no monomial with the others."""
    if coefficients.all():
        return [np.ones(E.shape[1], dtype=bool)]
    used = (E[coefficients != 0] > 0).astype(float)
    joined = np.linalg.matrix_power(used.T @ used + np.eye(E.shape[1]), E.shape[1]) > 0
    return list(np.unique(joined, axis=0))
