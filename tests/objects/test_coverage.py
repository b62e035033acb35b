"""Stated errors against meshes finer in every direction, on random scenes (docs/accuracy.md)."""

import numpy as np
import pytest

from tests.objects.coverage import rows


@pytest.mark.long
def test_nine_of_ten_errors_are_inside_the_stated_ones_and_these_are_not_far_too_large():
    """Ten scenes leave 0.95 uncertain by some hundredths."""
    found = [row for k in range(200, 210) for row in rows(1, k)]
    true, stated = np.array([row[-2:] for row in found], float).T
    known = np.isfinite(stated)
    assert known.mean() > 0.9
    assert (true[known] <= stated[known]).mean() >= 0.9
    assert stated[known].mean() < 10.0 * true[known].mean()  # 3.8 on 96 scenes; ten swing, for few errors make the mean
