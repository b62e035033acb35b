"""How the pads' level is chosen, and what the levels agree on."""

import numpy as np
import pytest

from softjaw.study.case import pad_level
from softjaw.study.quantities import REASONS
from tests.study.test_pipeline import BALL, BOX, OVAL, cases, solved
from tests.study.test_walls import CUP, scene_of
from tests.study.test_walls import solved as on_wall

LIGHT = "[0.2, 0.5]"
FIRM = {"forces": "[1, 5]", "elements": "[12, 6, 4]"}


def levels(*arguments, **choices):
    """Level, indicator and reason of the pads in every case."""
    found = [result.effects["pad"] for _, ladder in solved(*arguments, **choices) for result in ladder]
    return [(level, strain, REASONS[reason]) for level, strain, reason in found]


def e_n(*arguments, **choices):
    return np.array([values["maps/e_n"][0] for values in cases(*arguments, **choices)])


def test_auto_takes_the_linear_pad_where_it_is_good_enough():
    chosen = levels(BOX, forces=LIGHT)
    assert {(level, reason) for level, _, reason in chosen} == {("linear", "indicator below the target")}
    assert max(strain for _, strain, _ in chosen) < pad_level.NEARLY_LINEAR
    foam = e_n(BOX, 'effects.pad="hyperelastic"', forces=LIGHT)
    np.testing.assert_allclose(e_n(BOX, forces=LIGHT), foam, rtol=0.002)
    np.testing.assert_array_equal(e_n(BOX, forces=LIGHT), e_n(BOX, 'effects.pad="linear"', forces=LIGHT))


@pytest.mark.parametrize(("shape", "forces"), [(BALL, LIGHT), (OVAL, "[1, 5]"), (BOX, "[0.5, 8]")])
def test_auto_stays_with_finite_strains_elsewhere(shape, forces):
    """One force that strains the foam decides for the whole ladder; nothing changes against the forced level."""
    chosen = levels(shape, forces=forces)
    assert {(level, reason) for level, _, reason in chosen} == {("hyperelastic", "indicator above the target")}
    np.testing.assert_array_equal(e_n(shape, forces=forces), e_n(shape, 'effects.pad="hyperelastic"', forces=forces))


def test_forced_levels_are_kept():
    forced = {(level, reason) for level, _, reason in levels(BALL, 'effects.pad="linear"', **FIRM)}
    assert forced == {("linear", "forced by the scene")}
    off = e_n(BALL, 'effects.pad="linear"', **FIRM) / e_n(BALL, **FIRM) - 1.0
    assert (off > 0.02).all()  # what auto is there to prevent


def test_too_large_forces_for_the_linear_pad_say_so():
    (failed,) = (
        result for _, ladder in solved(BALL, 'effects.pad="linear"', forces="[1, 60]") for result in ladder[1:]
    )
    assert "inverted" in failed.message
    assert "effects.pad = 'auto'" in failed.message


def test_a_foam_of_linear_material_is_condensed_at_any_force():
    linear = 'gripper.material="linear"'
    chosen = levels(BALL, linear, forces="[1, 3]")
    assert {level for level, _, _ in chosen} == {"linear"}
    np.testing.assert_allclose(
        e_n(BALL, linear, forces="[1, 3]"), e_n(BALL, linear, 'effects.pad="hyperelastic"', forces="[1, 3]"), rtol=1e-9
    )


@pytest.mark.long
def test_both_meshes_of_an_error_estimate_have_one_level():
    finest = [v["maps/e_n_error"] for v in cases(BOX, "accuracy.meshes=2", forces=LIGHT, elements="[8, 4, 4]")]
    foam = ("accuracy.meshes=2", 'effects.pad="hyperelastic"')
    other = [v["maps/e_n_error"] for v in cases(BOX, *foam, forces=LIGHT, elements="[8, 4, 4]")]
    np.testing.assert_allclose(finest, other, atol=1e-3)


@pytest.mark.long
def test_linear_pads_on_a_thin_wall():
    """Small strains on the wall too, where auto stays with finite ones."""
    results = {}
    for level in ("auto", "linear"):
        results[level] = on_wall(CUP, f'effects.pad="{level}"', forces="[0.2, 0.4]")
    names = [{r.effects["pad"][0] for r in own} for own in results.values()]
    assert names == [{"hyperelastic"}, {"linear"}]
    for one, other in zip(*results.values(), strict=True):
        assert other.values["maps/e_n"][0] == pytest.approx(one.values["maps/e_n"][0], rel=0.05)
        assert other.values["maps/e_n"][0] != one.values["maps/e_n"][0]
    assert pad_level.level_on_wall(scene_of(CUP)).reason == "the default level of this version"
