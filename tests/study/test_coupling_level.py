"""Friction that acts back on the pressure, through the whole study."""

import numpy as np
import pytest

from softjaw.study.case.effects import FORCED, LITTLE, MUCH, UNDECIDED
from tests.study.test_pipeline import OVAL, cases, e_n, solved

NAME = "friction_pressure_coupling"
FREE = 'effects.friction_pressure_coupling="none"'
AUTO = 'effects.friction_pressure_coupling="auto"'
COUPLED = 'effects.friction_pressure_coupling="tangential"'


def levels(*overrides):
    """Level and reason in every case."""
    found = [result.effects[NAME] for _, path in solved(OVAL, *overrides) for result in path]
    return [(own.level, own.reason) for own in found]


def test_levels_and_what_they_change():
    """A pad that cannot slide freely is stiffer; without friction nothing changes; e_n moves by a few per cent."""
    assert set(levels(FREE)) == {("none", FORCED)}
    assert set(levels(COUPLED)) == {("tangential traction", FORCED)}
    off = e_n(OVAL, COUPLED) / e_n(OVAL, FREE) - 1.0
    assert (np.abs(off) < 0.05).all()
    assert (np.abs(off) > 1e-3).all()
    for one, other in zip(cases(OVAL, COUPLED), cases(OVAL, FREE), strict=True):
        assert one["maps/closing"] < other["maps/closing"]
        assert one["work/load_steps"][0] > other["work/load_steps"][0]
    smooth = ("friction.mu=0", COUPLED)
    closing = [[v["maps/closing"] for v in cases(OVAL, *own)] for own in (smooth, ("friction.mu=0", FREE))]
    np.testing.assert_allclose(*closing, rtol=1e-9)


def test_what_auto_takes_or_leaves_is_what_the_scene_could_ask_for():
    """Bit by bit, at every force by itself; which cases take it follows from the measured change."""
    auto, taken, free = (e_n(OVAL, *own) for own in ((AUTO,), (COUPLED,), (FREE,)))
    found = [result.effects[NAME] for _, path in solved(OVAL, AUTO) for result in path]
    with_it = np.array([own.level == "tangential traction" for own in found]).reshape(auto.shape)
    np.testing.assert_array_equal(auto, np.where(with_it, taken, free))
    for own, true in zip(found, (taken / free - 1.0).ravel(), strict=True):
        assert own.reason in (LITTLE, MUCH, UNDECIDED)
        assert own.change == pytest.approx(true, abs=0.01)


CONE = 'shape = "revolution"\nprofile_mm = [[0, 21], [20, 23.7], [40, 26.3], [60, 29]]'  # 7.6 degrees


def test_what_pressing_has_used_is_missing_for_holding():
    """On a slope it is what slope and force ask for at most, for the plate bears a part; half and whole."""
    small = {"forces": "[3]", "elements": "[8, 4, 3]"}
    place = (COUPLED, "candidates.stations_mm=[30]")

    def of(*more):
        [values] = cases(CONE, *place, *more, **small)
        return values

    plain, left = of(), of("friction.used_by_pressing=true")
    whole = of("friction.used_by_pressing=true", 'effects.model_size="full"')
    used = plain["maps/f_x_max"] - left["maps/f_x_max"]
    assert 0.3 < used[0] / (np.tan(8 / 60) * plain["maps/F_N"]) < 1.0
    assert used[1:].tolist() == [0.0, 0.0]  # planar models know nothing of it
    assert left["maps/f_y_max"][0] == pytest.approx(plain["maps/f_y_max"][0], rel=1e-12)
    assert left["maps/f_x_max"][0] == pytest.approx(whole["maps/f_x_max"][0], rel=1e-6)
    assert left["maps/e_n"][0] == pytest.approx(whole["maps/e_n"][0], rel=1e-6)
    assert left["maps/quality"][0] < plain["maps/quality"][0]


@pytest.mark.long
def test_symmetry_does_not_matter_with_friction():
    small = {"forces": "[3]", "elements": "[8, 4, 3]"}
    np.testing.assert_allclose(
        e_n(OVAL, COUPLED, **small), e_n(OVAL, COUPLED, 'effects.model_size="full"', **small), rtol=1e-7
    )
