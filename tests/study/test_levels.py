"""Forces of a candidate on two meshes, on a rigid object and on a thin wall: each by itself, from the coarse one."""

import math
from collections import Counter
from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest

from softjaw.fem.contact.press import Press
from softjaw.fem.errors import ConvergenceError
from softjaw.friction.patch import ContactPatch
from softjaw.study import pipeline
from softjaw.study.case.contact import joined
from softjaw.study.case.result import CaseFailure
from softjaw.study.case.solver import COARSE, FINE, CandidateSolver, Levels
from softjaw.study.flags import Flag
from softjaw.study.quantities import misses
from tests.study.scenes import CONE, NO_COUPLING, pose_of, scene_of, units_of

# Fingers that are no images of each other, so that there are two coarse paths.
POSE = pose_of((0, 0, 75), (1, 0, 0.02))
WALL = ("object.wall_mm=0.8", "effects.object='nonlinear_shell'", "accuracy.wall_element_mm=5",
        "load.normal_force_n=[1, 2, 3]", "gripper.elements=[6, 4, 2]")  # fmt: skip
BOTH = pytest.mark.parametrize("overrides", [(), pytest.param(WALL, marks=pytest.mark.long)], ids=["rigid", "wall"])
ROUGH = ("effects.friction_pressure_coupling='tangential'",)
OWN, FINER, FINEST = (8, 4, 2), (10, 6, 3), (12, 8, 4)
PLAIN = Levels("rigid", "rigid", "none")


@pytest.fixture(autouse=True)
def every_solve_begins_anew(monkeypatch):
    monkeypatch.setattr(pipeline, "MOST_SOLVERS", 0)


def unit_of(*overrides):
    [unit] = units_of(scene_of(CONE, "accuracy.meshes=2", NO_COUPLING, *overrides, where=POSE, forces="[1, 2, 5]"))
    return unit


@lru_cache
def whole(overrides):
    return dict(pipeline.solve_unit(unit_of(*overrides)))


def bits(result):
    """Everything of a case but its times."""
    values = {k: np.asarray(v).tobytes() for k, v in result.values.items() if not k.startswith("work/seconds")}
    return values, {k: v.tobytes() for k, v in result.patch.items()}, result.message, result.effects


@pytest.mark.parametrize("overrides", [ROUGH, *(pytest.param(of, marks=pytest.mark.long) for of in ((), WALL))],
                         ids=["friction", "rigid", "wall"])  # fmt: skip
def test_a_force_has_the_same_bits_whichever_others_are_asked_for(overrides):
    assert list(whole(overrides)) == [0, 1, 2]
    for wanted in ([2], [1], (2, 0)) if not overrides else ([2], [1]):
        found = refined(*overrides, wanted=wanted)
        assert list(found) == sorted(wanted)
        for k, result in found.items():
            assert bits(result) == bits(whole(overrides)[k])


@BOTH
def test_the_fine_mesh_has_the_state_that_it_has_along_a_load_path(overrides):
    names = ["maps/e_n", "maps/quality", "maps/p_max", "maps/closing", "fingers/f_x_max"]
    names += ["maps/indentation", "maps/wall_stress", "maps/support_force", "wall/place"] if overrides else []
    for k, alone in pipeline.solve_unit(unit_of(*overrides, "accuracy.meshes=1")):
        both = whole(overrides)[k].values
        assert max(both["work/load_steps"]) == 1
        errors = ["e_n", "closing", "indentation", "wall_stress", "wall_strain"][: 5 if overrides else 2]
        assert all(0.0 < both[f"maps/{name}_error"] < 1.5 for name in errors)
        # one mesh cannot tell that it is coarse by the error of e_n
        assert both["maps/flags"] & ~Flag.COARSE == alone.values["maps/flags"] & ~Flag.COARSE
        for name in names:
            assert both[name] == pytest.approx(alone.values[name], rel=1e-8, abs=1e-9), name


def compressed_too_far(monkeypatch, fails):
    at = Press.at

    def tried(press, force, start):
        if fails(press, force):
            raise ConvergenceError("the pad is compressed too far")
        return at(press, force, start)

    monkeypatch.setattr(Press, "at", tried)


def test_a_failure_at_one_force_leaves_the_others_alone(monkeypatch):
    expected = whole(())
    compressed_too_far(monkeypatch, lambda press, force: force == 2.0)
    found = refined()
    assert isinstance(found[1], CaseFailure)
    for k in (0, 2):
        assert bits(found[k]) == bits(expected[k])


def test_where_the_coarse_path_ends_the_fine_mesh_is_solved_and_its_error_is_unknown(monkeypatch):
    load_path, expected = Press.load_path, whole(())

    def ends(press, forces):
        yield next(load_path(press, forces))
        raise ConvergenceError("the force stays below 2 N")

    monkeypatch.setattr(Press, "load_path", ends)
    found = refined()
    assert bits(found[0]) == bits(expected[0])
    for k in (1, 2):
        assert "maps/e_n_error" not in found[k].values
        assert "2 N" in found[k].message
        assert min(found[k].values["work/load_steps"]) > 1
        for name in ("maps/e_n", "maps/quality", "maps/closing"):
            assert found[k].values[name] == pytest.approx(expected[k].values[name], rel=1e-8), name
        assert not found[k].values["maps/flags"] & Flag.JUMPED


def aim(target, of="e_n"):
    return f"accuracy.target={target!r}", f"accuracy.target_of='{of}'"


def refined(*overrides, wanted=None):
    return dict(pipeline.solve_unit(unit_of(*overrides), wanted))


def without_count(result):
    values, patch, message, effects = bits(result)
    return {k: v for k, v in values.items() if k not in ("maps/pad_elements", "work/mesh")}, patch, message, effects


@pytest.fixture(scope="module")
def split():
    """Errors of the three forces on two meshes, rising, and the refined on up to three for the middle one as target."""
    errors = {k: found.values["maps/e_n_error"] for k, found in whole(()).items()}
    target = min(sorted(errors.values())[1], 0.5)  # which is the largest that a scene may ask for
    return errors, target, refined(*aim(target))


def test_a_third_mesh_is_taken_where_the_error_is_not_surely_below_the_target_with_its_state(split):
    errors, target, found = split
    count = {k: result.values["maps/pad_elements"] for k, result in found.items()}
    # the error that is the target is undecided
    assert {k for k, n in count.items() if n > math.prod(OWN)} == {k for k, error in errors.items() if error >= target}
    assert set(count.values()) <= {math.prod(mesh) for mesh in (OWN, FINER, FINEST)}
    k = min(errors, key=errors.__getitem__)
    assert without_count(found[k]) == bits(whole(())[k])
    finer = {math.prod(m): refined(f"gripper.elements={list(m)}") for m in (FINER, FINEST)}
    for k in (k for k, error in errors.items() if error >= target):
        values = found[k].values
        # the same state as that of a scene with this mesh, from another coarse one
        for name in ("maps/e_n", "maps/quality", "maps/p_max", "fingers/S"):
            assert values[name] == pytest.approx(finer[values["maps/pad_elements"]][k].values[name], rel=1e-8)
        flagged = bool(values["maps/flags"] & Flag.COARSE)
        assert flagged or not misses(values["maps/e_n_error"], target)


def test_a_refined_patch_has_the_scenes_faces_the_finer_sums_and_is_joined_by_load_else_by_area(split):
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
    # three faces along and two across on two by one, so that those in the middle are cut in halves
    centroid = np.array([[x, y, 0.0] for x in (1.0, 3.0, 5.0) for y in (0.5, 1.5)])
    up, pressure = np.tile([0.0, 0.0, 1.0], (6, 1)), np.array([0.0, 2.0, 0.0, 0.0, 0.0, 0.0])
    shares = np.array([[1.0, 0.5, 0.0], [0.0, 0.5, 1.0]]), np.ones((1, 2))
    found = joined(ContactPatch(centroid, np.full(6, 2.0), up, pressure), *shares)
    assert found["area"].tolist() == [6.0, 6.0]
    assert found["pressure"].tolist() == [pytest.approx(2.0 / 3.0), 0.0]
    assert found["centroid"] == pytest.approx(np.array([[1.0, 1.5, 0.0], [13.0 / 3.0, 1.0, 0.0]]))
    assert found["normal"].tolist() == [[0.0, 0.0, 1.0]] * 2


def test_a_finer_mesh_without_a_state_loses_nothing(monkeypatch, split):
    compressed_too_far(monkeypatch, lambda press, force: press.pad.shape.elements == FINER)
    same = ("effects.sheet='rigid'", "effects.friction_pressure_coupling='none'")
    found, two = refined(*same, *aim(1e-3)), refined(*same)
    for k, result in found.items():
        values, patch, message, effects = without_count(result)
        expected = bits(two[k])
        for other in (values, expected[0]):
            del other["maps/flags"]
        assert (values, patch, effects) == (expected[0], expected[1], expected[3])
        assert result.values["maps/flags"] & Flag.COARSE
        assert "the pad is compressed too far" in message
        assert result.values["maps/pad_elements"] == 64


def test_friction_that_acts_back_has_a_third_mesh_too_and_one_mesh_and_two_give_the_same_case():
    two, three = (refined(*ROUGH, "load.normal_force_n=[2]", *more)[0].values for more in ((), aim(1e-3)))
    assert three["maps/pad_elements"] > math.prod(OWN)
    assert three["maps/e_n_error"] != two["maps/e_n_error"]
    assert three["maps/e_n"][0] == pytest.approx(two["maps/e_n"][0], rel=2 * two["maps/e_n_error"])
    # Each mesh walks its own load path, and no force of the list leaves a trace in another.
    one, two = (refined(*ROUGH, *keys) for keys in (("accuracy.meshes=1", "load.normal_force_n=[2]"), ()))
    for key in ("maps/payload", "maps/quality", "maps/e_n", "maps/S", "maps/closing"):
        np.testing.assert_allclose(one[0].values[key], two[1].values[key], rtol=1e-9)  # of the contact solve


@pytest.mark.long
def test_a_simulated_wall_keeps_two_meshes():
    two, three = (refined(*WALL, *more, wanted=[0])[0] for more in ((), aim(1e-3)))
    assert three.values["maps/pad_elements"] == 6 * 4 * 2
    assert three.values["maps/e_n"] == pytest.approx(two.values["maps/e_n"], rel=1e-12)


def test_what_an_earlier_question_was_content_with_does_not_bind_the_next(split, monkeypatch):
    monkeypatch.setattr(pipeline, "MOST_SOLVERS", 1)
    _, target, found = split
    unit = unit_of(*aim(target))
    list(pipeline.solve_unit(replace(unit, finest=(FINE,) * 3)))
    for k, result in pipeline.solve_unit(unit):
        assert result.values["maps/pad_elements"] == found[k].values["maps/pad_elements"]
        assert np.array_equal(result.values["maps/e_n"], found[k].values["maps/e_n"])


@pytest.mark.parametrize("of", ["quality", "payload"])
def test_the_target_may_be_for_another_quantity(of):
    two, k = min((found.values[f"maps/{of}_error"], k) for k, found in whole(()).items())
    enough = refined(*aim(two * 1.01, of), wanted=[k])[k].values
    finer = refined(*aim(two * 0.99, of), wanted=[k])[k].values
    assert (enough["maps/pad_elements"], enough["maps/flags"] & Flag.COARSE) == (math.prod(OWN), 0)
    assert finer["maps/pad_elements"] > math.prod(OWN)
    assert finer[f"maps/{of}_error"] != two


@pytest.mark.long
def test_a_fourth_mesh_follows_where_the_error_is_above_the_target_no_fifth_and_steps_are_part_of_errors():
    values = refined(*aim(2e-4), wanted=[0])[0].values
    assert values["maps/e_n_error"] > 2e-4
    assert values["maps/pad_elements"] == math.prod(FINEST)
    third = refined(f"gripper.elements={list(FINER)}", wanted=[0])[0].values
    difference = abs(values["maps/e_n"][0] - third["maps/e_n"][0]) / values["maps/e_n"][0]
    # the smaller target also lets the backing plate bend, which moves e_n by 3e-4 of the difference
    assert difference <= values["maps/e_n_error"] * 1.01
    # In steps of twice the length the same mesh differs by about what its own steps leave.
    unit = unit_of(*ROUGH)
    solver = CandidateSolver(unit.scene, unit.candidate.poses)
    solved = solver.case(1, Levels("rigid", "rigid", "tangential"))
    [(coarse, longer, _)] = solved.pairs
    assert coarse is solved.coarse
    longer, coarse = longer.contacts, coarse.contacts
    assert longer[0].state.work.steps < coarse[0].state.work.steps
    change = abs(longer[0].state.closing / coarse[0].state.closing - 1.0)
    assert 0.0 < change < 0.01
    solver.put_away()
    assert whole(ROUGH)[1].values["maps/closing_error"] > change


@pytest.fixture
def counted(monkeypatch):
    """How often a state is solved: by its force on the fine mesh, and by ``"path"`` for each load path."""
    count, at, load_path = Counter(), Press.at, Press.load_path

    def counting_at(press, force, starts=()):
        count[force] += 1
        if force == 2.0:
            raise ConvergenceError("no state")
        return at(press, force, starts)

    def counting_path(press, forces):
        count["path"] += 1
        return load_path(press, forces)

    monkeypatch.setattr(Press, "at", counting_at)
    monkeypatch.setattr(Press, "load_path", counting_path)
    return count


def test_a_state_or_its_failure_is_solved_once(counted):
    unit = unit_of()
    solver = CandidateSolver(unit.scene, unit.candidate.poses)
    for _ in range(2):
        case = solver.case(0, PLAIN)
        assert (case.fine, case.coarse) == (solver.solve(0, FINE, PLAIN), solver.solve(0, COARSE, PLAIN))
    failures = []
    for _ in range(2):
        with pytest.raises(ConvergenceError) as raised:
            solver.case(1, PLAIN)
        failures.append(raised.value)
    assert failures[0] is failures[1]
    # two fingers that are no images of each other
    assert counted == {1.0: 2, 2.0: 2, "path": 2}
    # other levels have load paths and states of their own
    coupled = solver.solve(0, COARSE, PLAIN._replace(friction_pressure_coupling="tangential"))
    assert coupled.contacts[0].limits["ccm"].e_n != case.coarse.contacts[0].limits["ccm"].e_n
    assert counted == {1.0: 4, 2.0: 2, "path": 2}
    solver.put_away()


def test_a_fine_state_starts_from_the_three_nearest_coarse_ones(monkeypatch):
    given, at = [], Press.at

    def watched(press, force, starts):
        given.append([state.force for state in starts])
        return at(press, force, starts)

    monkeypatch.setattr(Press, "at", watched)
    unit = unit_of("load.normal_force_n=[1, 1.5, 2, 3]")
    solver = CandidateSolver(unit.scene, unit.candidate.poses)
    solver.solve(3, FINE, PLAIN)
    solver.solve(0, FINE, PLAIN)
    # a finer mesh starts from the state on the mesh before it
    finer = solver.solve(0, FINE + 1, PLAIN)
    assert given == [[3.0, 2.0, 1.5]] * 2 + [[1.0]] * 4
    assert finer.contacts[0].state.pad.shape.elements == (10, 6, 3)
    solver.put_away()


def test_a_solver_that_was_put_away_goes_on_with_the_next_force_of_its_path():
    unit = unit_of("load.normal_force_n=[1, 3]")
    kept, new = (CandidateSolver(unit.scene, unit.candidate.poses) for _ in range(2))
    kept.solve(0, COARSE, PLAIN)
    kept.put_away()
    later, alone = (solver.solve(1, COARSE, PLAIN).contacts[0].state for solver in (kept, new))
    assert later.force == 3.0
    np.testing.assert_array_equal(later.points.load, alone.points.load)
