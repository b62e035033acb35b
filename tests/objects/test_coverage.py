"""Stated errors against meshes finer in every direction, on random scenes of two seeds (docs/accuracy.md)."""

import numpy as np
import pytest

from tests.objects.coverage import FAMILIES, HEADER, rows, scene_tables, table


def test_every_family_is_among_the_scenes():
    kinds = [scene_tables(1, k)[0] for k in range(10)]
    assert [kinds.count(family) for family in FAMILIES] == [2] * 5


def test_a_table_counts_what_is_covered():
    lines = [dict(zip(HEADER, ("1/0", "box", "none", 1.0, "e_n", true, 0.02), strict=True)) for true in (0.01, 0.03)]
    assert "| none (2) |" in (text := table(lines))
    assert "0.50 (1.0)" in text


@pytest.mark.long
@pytest.mark.parametrize("seed", [1, 2])
def test_nine_of_ten_errors_are_inside_the_stated_ones_and_these_are_not_far_too_large(seed):
    """Ten scenes leave 0.95 uncertain by some hundredths."""
    found = [row for k in range(200, 210) for row in rows(seed, k)]
    true, stated = np.array([row[-2:] for row in found], float).T
    known = np.isfinite(stated)
    assert known.mean() > 0.9
    assert (true[known] <= stated[known]).mean() >= 0.9
    assert stated[known].mean() < 10.0 * true[known].mean()  # 3.8 on 96 scenes; ten swing, for few errors make the mean
