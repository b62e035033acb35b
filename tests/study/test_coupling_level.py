"""Friction that acts back on the pressure, through the whole study."""

import numpy as np
import pytest

from softjaw.study.quantities import REASONS
from tests.study.test_pipeline import OVAL, cases, e_n, solved

COUPLED = 'effects.friction_pressure_coupling="tangential"'


def test_levels_and_what_they_change():
    """A pad that cannot slide freely is stiffer; without friction nothing changes; e_n moves by a few per cent."""
    found = {result.effects["friction_pressure_coupling"][::2] for _, path in solved(OVAL) for result in path}
    assert {(level, REASONS[reason]) for level, reason in found} == {
        ("none", "left out, though the indicator is above the target")
    }
    found = {result.effects["friction_pressure_coupling"][::2] for _, own in solved(OVAL, COUPLED) for result in own}
    assert {(level, REASONS[reason]) for level, reason in found} == {("tangential traction", "forced by the scene")}
    off = e_n(OVAL, COUPLED) / e_n(OVAL) - 1.0
    assert (np.abs(off) < 0.05).all()
    assert (np.abs(off) > 1e-3).all()
    for one, other in zip(cases(OVAL, COUPLED), cases(OVAL), strict=True):
        assert one["maps/closing"] < other["maps/closing"]
        assert one["work/load_steps"][0] > other["work/load_steps"][0]
    smooth = ("friction.mu=0", COUPLED)
    closing = [[v["maps/closing"] for v in cases(OVAL, *own)] for own in (smooth, ("friction.mu=0",))]
    np.testing.assert_allclose(*closing, rtol=1e-9)


@pytest.mark.long
def test_symmetry_does_not_matter_with_friction():
    small = {"forces": "[3]", "elements": "[8, 4, 3]"}
    np.testing.assert_allclose(
        e_n(OVAL, COUPLED, **small), e_n(OVAL, COUPLED, 'effects.model_size="full"', **small), rtol=1e-7
    )
