"""Further meshes where two do not tell a quantity to the target: which cases, what is stored, what a failure does."""

from __future__ import annotations

import math

import numpy as np
import pytest

from softjaw import press
from softjaw.fem.contact.press import Press
from softjaw.fem.errors import ConvergenceError
from softjaw.friction.patch import ContactPatch
from softjaw.study import pipeline
from softjaw.study.case.topology import joined
from softjaw.study.flags import Flag
from softjaw.study.quantities import misses
from tests.study.test_levels import WALL, bits, unit_of, whole

OWN, FINER, FINEST = (8, 4, 2), (12, 6, 3), (16, 8, 4)


def aim(target, of="e_n"):
    return f"accuracy.target={target!r}", f"accuracy.target_of='{of}'"


def cases(*overrides, wanted=None):
    return dict(pipeline.solve_unit(unit_of(*overrides), wanted))


def without_count(result):
    values, patch, message, effects = bits(result)
    return {k: v for k, v in values.items() if k != "maps/pad_elements"}, patch, message, effects


@pytest.fixture(scope="module")
def split():
    """Errors of the three forces on two meshes, rising, and the cases on up to three for the middle one as target."""
    errors = {k: found.values["maps/e_n_error"] for k, found in whole(()).items()}
    target = sorted(errors.values())[1]
    return errors, target, cases(*aim(target))


def test_a_third_mesh_is_taken_where_the_error_is_not_surely_below_the_target(split):
    errors, target, found = split
    count = {k: result.values["maps/pad_elements"] for k, result in found.items()}
    # the error that is the target is undecided
    assert {k for k, n in count.items() if n > math.prod(OWN)} == {k for k, error in errors.items() if error >= target}
    assert set(count.values()) <= {math.prod(mesh) for mesh in (OWN, FINER, FINEST)}


def test_a_case_that_meets_the_target_is_the_one_of_two_meshes(split):
    errors, _, found = split
    k = min(errors, key=errors.__getitem__)
    assert without_count(found[k]) == bits(whole(())[k])


def test_a_refined_case_has_the_error_of_its_two_finest_meshes_and_the_work_of_all(split):
    errors, target, found = split
    finer = {math.prod(m): cases(f"gripper.elements={list(m)}") for m in (FINER, FINEST)}
    for k in (k for k, error in errors.items() if error >= target):
        values = found[k].values
        # the same state as that of a scene with this mesh, from another coarse one
        for name in ("maps/e_n", "maps/quality", "maps/p_max", "fingers/S"):
            assert values[name] == pytest.approx(finer[values["maps/pad_elements"]][k].values[name], rel=1e-8)
        flagged = bool(values["maps/flags"] & Flag.COARSE)
        assert flagged or not misses(values["maps/e_n_error"], target)


def test_a_refined_patch_has_the_faces_of_the_scene_and_the_sums_of_the_finer_mesh(split):
    *_, found = split
    for k, result in found.items():
        patch, case = result.patch, result.contacts
        assert patch["pressure"].shape == whole(())[k].patch["pressure"].shape == (2, 16 * 8)
        S = (patch["pressure"] * patch["area"]).sum(axis=1)
        assert S == pytest.approx([c.limits["ccm"].S for c in case], rel=1e-12)
        arm = np.einsum("fn,fni->fi", patch["pressure"] * patch["area"], patch["centroid"]) / S[:, None]
        whole_arm = [(c.patch.pressure * c.patch.area) @ c.patch.centroid / s for c, s in zip(case, S, strict=True)]
        assert arm == pytest.approx(np.array(whole_arm), abs=1e-12)
        assert np.linalg.norm(patch["normal"], axis=2) == pytest.approx(1.0, abs=1e-12)


def test_faces_are_joined_by_load_else_by_area():
    # three faces along and two across on two by one, so that those in the middle are cut in halves
    centroid = np.array([[x, y, 0.0] for x in (1.0, 3.0, 5.0) for y in (0.5, 1.5)])
    up, pressure = np.tile([0.0, 0.0, 1.0], (6, 1)), np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    shares = np.array([[1.0, 0.5, 0.0], [0.0, 0.5, 1.0]]), np.ones((1, 2))
    found = joined(ContactPatch(centroid, np.full(6, 2.0), up, pressure), *shares)
    assert found["area"].tolist() == [6.0, 6.0]
    assert found["pressure"].tolist() == [pytest.approx(2.0 / 3.0), 0.0]
    assert found["centroid"] == pytest.approx(np.array([[1.0, 1.5, 0.0], [13.0 / 3.0, 1.0, 0.0]]))
    assert found["normal"].tolist() == [[0.0, 0.0, 1.0]] * 2


def test_not_a_bit_depends_on_which_forces_are_asked_for(split):
    _, target, found = split
    again = cases(*aim(target), wanted=[2])
    assert list(again) == [2]
    assert bits(again[2]) == bits(found[2])


def test_a_finer_mesh_without_a_state_loses_nothing(monkeypatch, split):
    at = Press.at

    def fails(press, force, starts):
        if press.pad.shape.elements == FINER:
            raise ConvergenceError("the pad is compressed too far")
        return at(press, force, starts)

    monkeypatch.setattr(Press, "at", fails)
    same = ("effects.sheet='rigid'", "effects.friction_pressure_coupling='none'")
    found, two = cases(*same, *aim(1e-3)), cases(*same)
    for k, result in found.items():
        values, patch, message, effects = without_count(result)
        expected = bits(two[k])
        for other in (values, expected[0]):
            del other["maps/flags"]
        assert (values, patch, effects) == (expected[0], expected[1], expected[3])
        assert result.values["maps/flags"] & Flag.COARSE
        assert "the pad is compressed too far" in message
        assert result.values["maps/pad_elements"] == 64


def test_friction_that_acts_back_has_a_third_mesh_too():
    changes = ("effects.friction_pressure_coupling='tangential'", "load.normal_force_n=[2]")
    two, three = (cases(*changes, *more)[0].values for more in ((), aim(1e-3)))
    assert three["maps/pad_elements"] > math.prod(OWN)
    assert three["maps/e_n_error"] != two["maps/e_n_error"]
    assert three["maps/e_n"][0] == pytest.approx(two["maps/e_n"][0], rel=2 * two["maps/e_n_error"])


@pytest.mark.long
def test_a_simulated_wall_keeps_two_meshes():
    two, three = (cases(*WALL, *more, wanted=[0])[0] for more in ((), aim(1e-3)))
    assert three.values["maps/pad_elements"] == 6 * 4 * 2
    assert three.values["maps/e_n"] == pytest.approx(two.values["maps/e_n"], rel=1e-12)


@pytest.mark.long
def test_one_case_in_memory_is_refined_too():
    scene = unit_of(*aim(1e-3)).scene
    case = press(scene, candidate=0, force=1.0)
    assert case.value("pad_elements") > math.prod(OWN)
    assert case.errors["e_n"] / case.e_n == pytest.approx(case.value("e_n_error"))


@pytest.mark.parametrize("of", ["quality", "payload"])
def test_the_target_may_be_for_another_quantity(of):
    two = whole(())[0].values[f"maps/{of}_error"]
    enough = cases(*aim(two * 1.01, of), wanted=[0])[0].values
    finer = cases(*aim(two * 0.99, of), wanted=[0])[0].values
    assert (enough["maps/pad_elements"], enough["maps/flags"] & Flag.COARSE) == (math.prod(OWN), 0)
    assert finer["maps/pad_elements"] > math.prod(OWN)
    assert finer[f"maps/{of}_error"] != two


def test_a_fourth_mesh_follows_where_the_third_leaves_the_error_above_the_target_and_no_fifth():
    values = cases(*aim(2e-4), wanted=[0])[0].values
    assert values["maps/e_n_error"] > 2e-4
    assert values["maps/pad_elements"] == math.prod(FINEST)
    third = cases("gripper.elements=[12, 6, 3]", wanted=[0])[0].values
    difference = abs(values["maps/e_n"][0] - third["maps/e_n"][0]) / values["maps/e_n"][0]
    # the smaller target also lets the backing plate bend, which moves e_n by 3e-4 of the difference
    assert difference <= values["maps/e_n_error"] * 1.01
