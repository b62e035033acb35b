"""How the level of the sheet behind the pads is chosen, and what it changes."""

import numpy as np
import pytest

from softjaw.study.case.effects import STIFF_PLATE as STIFF
from softjaw.study.quantities import REASONS
from softjaw.study.scene import SceneError, parse_scene
from tests.study.test_pipeline import CONE, OVAL, cases, e_n, solved
from tests.study.test_walls import CUP
from tests.study.test_walls import solved as on_wall

STEEL = ("gripper.sheet_thickness_mm=2",)
PLASTIC = ("gripper.sheet_thickness_mm=1", "gripper.sheet_modulus_gpa=2")
RIGID = 'effects.sheet="rigid"'


def level(*overrides):
    """Level, indicator and reason, alike in every case."""
    (found,) = {result.effects["sheet"][:3] for _, path in solved(OVAL, *overrides) for result in path}
    return found[0], found[1], REASONS[found[2]]


def test_a_steel_sheet_is_rigid_and_a_plastic_one_bends():
    name, compliance, reason = level(*STEEL)
    assert (name, reason) == ("rigid", "indicator below the target")
    assert compliance < 0.2 * STIFF
    name, compliance, reason = level(*PLASTIC)
    assert (name, reason) == ("elastic plate", "indicator above the target")
    assert compliance > STIFF
    assert level(*PLASTIC, RIGID) == ("rigid", compliance, "forced by the scene")
    assert level(*STEEL, 'effects.sheet="elastic"')[::2] == ("elastic plate", "forced by the scene")


@pytest.mark.parametrize("size", [(20, 10), (18, 9), (20, 9.5), (12, 6), (22, 10), (20, 11)])
def test_pads_up_to_the_size_of_the_default_support_are_solved(size):
    """Every node of their sheets is held; such a sheet is rigid, whatever it is made of."""
    pad = [f"gripper.pad_{side}_mm={length}" for side, length in zip(("length", "width"), size, strict=True)]
    name, compliance, reason = level(*pad, *PLASTIC, "gripper.pad_thickness_mm=6")
    if size[0] <= 20 and size[1] <= 10:
        assert (name, compliance, reason) == ("rigid", 0.0, "indicator below the target")
    else:
        assert compliance > 0.0


def test_what_is_neglected_stays_below_the_target():
    """The rigid level of steel is good to far less than 2 % of e_n, that of the plastic sheet is not."""
    np.testing.assert_array_equal(e_n(OVAL, *STEEL), e_n(OVAL, *STEEL, RIGID))
    off = {name: e_n(OVAL, *own, 'effects.sheet="elastic"') / e_n(OVAL, RIGID) - 1.0
           for name, own in (("steel", STEEL), ("plastic", PLASTIC))}  # fmt: skip
    assert np.abs(off["steel"]).max() < 1e-3
    assert (off["plastic"] < -0.02).all()  # the ends of the pad give way and carry less
    closing = [values["maps/closing"] for values in cases(OVAL, *PLASTIC)]
    assert (np.array(closing) > [values["maps/closing"] for values in cases(OVAL, RIGID)]).all()


@pytest.mark.long
def test_sheets_behind_the_pads_on_a_thin_wall():
    """Steel is as good as rigid, plastic is softer: the same force takes more closing displacement."""
    closing = {}
    for name, overrides in (("rigid", (RIGID,)), ("steel", STEEL), ("plastic", PLASTIC)):
        forced = () if name == "rigid" else ('effects.sheet="elastic"',)
        (result,) = on_wall(CUP, *overrides, *forced, forces="[1]")
        closing[name] = result.values["maps/closing"]
    assert closing["steel"] == pytest.approx(closing["rigid"], rel=1e-3)
    assert closing["plastic"] > 1.02 * closing["rigid"]
    (mounted,) = on_wall(CUP, "gripper.tilt_stiffness_nm_per_rad=10000", forces="[1]")
    assert mounted.values["maps/closing"] == pytest.approx(closing["rigid"], rel=1e-4)


def test_a_mount_that_tilts_spreads_the_contact_on_a_slope_and_a_stiff_one_changes_nothing():
    place = dict(stations="[75]", forces="[3]")
    rigid, stiff, soft = (
        cases(CONE, *([f"gripper.tilt_stiffness_nm_per_rad={k}"] if k else []), **place)[0] for k in (None, 1e4, 0.2)
    )
    assert stiff["maps/e_n"] == pytest.approx(rigid["maps/e_n"], rel=2e-3)
    # turned to the slope the pad bears on more of its length
    assert soft["maps/contact_area"] > 1.05 * rigid["maps/contact_area"]
    assert soft["maps/e_n"][0] > 1.02 * rigid["maps/e_n"][0]


def test_a_plate_that_tilts_cannot_be_elastic():
    text = f"[object]\n{OVAL}\n[candidates]\nstations_mm = [0]\nangles_deg = [0]\n[load]\nnormal_force_n = [2]"
    parse_scene(text, overrides=["gripper.tilt_stiffness_nm_per_rad=1"])
    with pytest.raises(SceneError, match="tilt_stiffness_nm_per_rad"):
        parse_scene(text, overrides=["gripper.tilt_stiffness_nm_per_rad=1", 'effects.sheet="elastic"'])
