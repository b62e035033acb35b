"""The safe force range: where values first pass a limit between solved forces."""

import numpy as np
import pytest

from softjaw.study.result.derived import first_crossing

FORCES = [1.0, 2.0, 4.0, 8.0]


def test_a_value_proportional_to_the_force_is_crossed_where_it_says():
    values = 0.3 * np.array(FORCES)
    for limit in (0.1, 0.3, 0.45, 2.3):
        assert first_crossing(FORCES, values, limit) == pytest.approx(limit / 0.3, rel=1e-12)


def test_a_value_that_falls_again_is_crossed_the_first_time():
    assert first_crossing(FORCES, [0.0, 2.0, 0.5, 3.0], 1.0) == pytest.approx(1.5)


def test_below_the_first_force_it_is_a_line_from_nothing():
    assert first_crossing(FORCES, [2.0, 3.0, 4.0, 5.0], 1.0) == pytest.approx(0.5)


@pytest.mark.parametrize("values", [[0.1, 0.2, 0.3, 0.4], [np.nan] * 4, [0.1, np.nan, 5.0, 5.0]])
def test_what_is_never_passed_or_not_known_has_no_force(values):
    assert np.isnan(first_crossing(FORCES, values, 1.0))


def test_it_works_on_whole_maps_and_finds_limits_that_are_met_exactly():
    values = np.stack([np.array(FORCES), 0.5 * np.array(FORCES)]).reshape(2, 1, 4)
    np.testing.assert_allclose(first_crossing(FORCES, values, 2.0), [[2.0], [4.0]], rtol=1e-14)
