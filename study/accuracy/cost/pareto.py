"""Settings that no other beats in both time and error."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike


def front(seconds: ArrayLike, error: ArrayLike) -> list[int]:
    """Numbers of the settings on the Pareto front, the cheapest first; those without a value are left out.

    Examples
    --------
    >>> front([1.0, 2.0, 3.0, 4.0], [0.1, 0.2, 0.05, float("nan")])
    [0, 2]
    """
    t, e = np.asarray(seconds, float), np.asarray(error, float)
    known = [int(i) for i in np.lexsort((e, t)) if np.isfinite(t[i]) and np.isfinite(e[i])]
    kept: list[int] = []
    for i in known:
        if not kept or e[i] < e[kept[-1]]:
            kept.append(i)
    return kept
