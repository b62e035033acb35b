"""Samples of uncertain inputs: a Latin hypercube of normal distributions."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

SEED = 20240229  # any number; the samples of a scene are always the same
UPPER = 0.975  # where a 95 % interval ends


def latin_hypercube(
    means: Mapping[str, float], half_widths: Mapping[str, float], count: int
) -> list[dict[str, float]]:
    """``count`` samples of independent normal inputs, by the names of ``half_widths``.

    Each input takes the middles of ``count`` intervals of equal probability, each once.

    ``means, half_widths``: of every input; half-widths of its 95 % interval.

    >>> [round(sample["mu"], 3) for sample in sorted(latin_hypercube({"mu": 0.8}, {"mu": 0.1}, 4), key=str)]
    [0.741, 0.784, 0.816, 0.859]
    """
    from scipy.special import ndtri  # slow to load; readers of results need UPPER alone
    from scipy.stats import qmc

    cube = qmc.LatinHypercube(len(half_widths), scramble=False, optimization="random-cd", seed=SEED).random(count)
    normal = ndtri(cube) / ndtri(UPPER)
    values = np.array([means[key] for key in half_widths]) + normal * np.array([*half_widths.values()])
    # digits of a sample, so that no rounding error of a machine makes another one
    return [dict(zip(half_widths, (float(f"{v:.9g}") for v in row), strict=True)) for row in values]
