"""Thin walls through the whole study on coarse meshes: levels, symmetry, images, order, refusals."""

from functools import lru_cache
from types import SimpleNamespace

import numpy as np
import pytest

from softjaw.fem.shell.wall_problem import WallProblem
from softjaw.study import pipeline
from softjaw.study.case import wall
from softjaw.study.case.effects import ABOVE, BELOW, SMALL_INDENTATION, EffectChoice
from softjaw.study.case.result import CaseFailure
from softjaw.study.case.solver import CandidateSolver
from softjaw.study.flags import Flag
from tests.study.scenes import QUICK, pose_of, scene_of, units_of
from tests.study.test_pipeline import differing

CUP = """shape = "revolution"
profile_mm = [[0, 24], [4, 28], [30, 30], [60, 32], [80, 34]]
wall_mm = 0.6
wall_material = "PP"
"""
OPEN = """shape = "revolution"
open_ends = "top"
profile_mm = [[0, 27], [3, 29.4], [8, 30.4], [30, 31.3], [60, 32.5], [110, 34.5]]
wall_mm = 0.45
wall_material = "PP"
"""
SLOPE = """shape = "revolution"
profile_mm = [[0, 26], [20, 30], [50, 26], [80, 30], [110, 26]]
wall_material = "custom"
wall_poisson_ratio = 0.4
young_modulus_gpa = 1
"""
OVAL = 'shape = "sections"\nwall_mm = 0.5\n' + "".join(
    f"[[object.sections]]\nz_mm = {z}\na_mm = {a}\nb_mm = {b}\n"
    for z, a, b in ((0, 22, 18), (20, 24, 20), (40, 24, 20), (70, 24, 20))
)
COARSE = ("accuracy.wall_element_mm=4", *QUICK)
WHERE = "stations_mm = [40]\nangles_deg = [0]"
STANDING = "object.support='standing'"
LONG = pytest.mark.long


def walled(shape, *changes, where=WHERE, forces="[1, 2]", elements="[6, 4, 2]"):
    return units_of(scene_of(shape, *COARSE, *changes, where=where, forces=forces, elements=elements))


@lru_cache(maxsize=32)
def solved(*arguments, **choices):
    return [result for _, result in pipeline.solve_unit(walled(*arguments, **choices)[0])]


def test_the_level_follows_the_indentation_and_compression_is_a_strain_too(monkeypatch):
    levels = []
    for thickness, modulus, forces in ((1.0, 200.0, "[0.2]"), (0.7, 5.0, "[0.05]"), (0.2, 200.0, "[4]")):
        wall_ = f"object.wall_mm={thickness}", f"object.young_modulus_gpa={modulus}"
        result = solved(CUP, *wall_, forces=forces)[0]
        levels.append(result.effects["object"])
        assert np.isfinite(result.values.get("maps/indentation", 0.0))
    names, indicators, reasons, *_ = zip(*levels, strict=True)
    assert names == ("rigid", "linear shell", "nonlinear shell")
    assert indicators == tuple(sorted(indicators))
    assert indicators[1] <= SMALL_INDENTATION < indicators[2]
    assert reasons == (BELOW, BELOW, ABOVE)
    # a twentieth as large in all: the estimate has smaller elements as well
    small = "pad_length_mm=2.5", "pad_width_mm=1.1", "pad_thickness_mm=0.75"
    profile = [[z / 20, r / 20] for z, r in ((0, 24), (4, 28), (30, 30), (60, 32), (80, 34))]
    [unit] = walled(
        CUP, f"object.profile_mm={profile}", "object.wall_mm=0.01", "object.young_modulus_gpa=200",
        "candidates.stations_mm=[2]", "accuracy.wall_element_mm=0.2", *(f"gripper.{key}" for key in small),
        forces="[0.01]",
    )  # fmt: skip
    level = EffectChoice(CandidateSolver(unit.scene, unit.candidate.poses)).level("object", 0)
    assert (level.level, level.reason) == (names[2], ABOVE)
    assert level.indicator == pytest.approx(indicators[2], rel=0.3)
    # a wall as stiff as the first one, of which a dent is asked for that it may have
    stiff = "object.wall_mm=1", "object.young_modulus_gpa=200", "object.allowed_dent_mm=1e-4"
    [unit] = walled(CUP, *stiff, "accuracy.meshes=2", "accuracy.target=0.4", forces="[0.2]")
    level = EffectChoice(CandidateSolver(unit.scene, unit.candidate.poses)).level("object", 0)
    assert (level.level, level.reason) == (names[1], BELOW)
    face = SimpleNamespace(von_mises=np.ones(1), principal_strain=np.array([[-3e-3, 1e-3]]))
    for name, value in (("faces", [face, face]), ("_indentations", np.zeros(1)), ("_places", None)):
        monkeypatch.setattr(wall, name, lambda *_, value=value: value)
    state = SimpleNamespace(wall=SimpleNamespace(q=np.zeros(6)))
    pushes = ([5.0, 0, 1, 0, 0, 0], [-5.0, 0, 2, 0, 0, 0])
    pose = SimpleNamespace(rotation=np.eye(3)[[1, 2, 0]].T)  # pressed along x
    contacts = [SimpleNamespace(pressure_wrench=np.array(wrench), pose=pose, state=state) for wrench in pushes]
    values = wall.wall_values(None, contacts, None)
    assert values["maps/wall_strain"] == pytest.approx(3e-3)
    assert values["maps/support_force"] == pytest.approx(3.0)


@pytest.mark.parametrize("support", ["free", pytest.param("standing", marks=pytest.mark.long)])
def test_on_a_slope_a_stiff_wall_is_a_rigid_object_and_stiffness_and_force_scale_together(support):
    made = SLOPE, f"object.support='{support}'", "object.wall_mm=2.5", "effects.friction_pressure_coupling='none'"

    def values(modulus, shear, force, level="linear_shell"):
        changes = f"object.young_modulus_gpa={modulus}", f"gripper.shear_modulus_kpa={shear}"
        return solved(*made, *changes, f"effects.object='{level}'", forces=f"[{force}]")[0].values

    names = [f"maps/{name}" for name in ("closing", "e_n", "payload", "misalignment")]
    soft, scaled, stiff, rigid = values(0.5, 40, 2), values(2, 160, 8), values(1e3, 40, 2), values(1, 40, 2, "rigid")
    for one, other, powers, rel in ((soft, scaled, (1, 1, 4, 1), 1e-3), (rigid, stiff, (1, 1, 1, 1), 2e-3)):
        for name, power in zip(names, powers, strict=True):
            assert other[name] == pytest.approx(power * np.asarray(one[name]), rel=rel), name
    assert stiff["maps/support_force"] > 0.1


def test_what_a_wall_that_is_taken_as_rigid_closes_less_is_part_of_the_errors():
    stiff = STANDING, "object.wall_mm=1.0", "object.young_modulus_gpa=60.0", "accuracy.meshes=2"
    taken, forced = (solved(CUP, *stiff, f"effects.object='{level}'", forces="[2]")[0] for level in ("auto", "rigid"))
    shell = solved(CUP, *stiff, "effects.object='nonlinear_shell'", forces="[2]")[0]
    assert (taken.effects["object"].level, taken.effects["object"].reason) == ("rigid", BELOW)
    closing, without = (r.values["maps/closing_error"] for r in (taken, forced))
    assert shell.values["maps/closing"] / taken.values["maps/closing"] - 1.0 < closing - without < 0.05
    opening = [r.values["maps/opening_loaded_error"] for r in (taken, forced)]
    assert opening[0] / opening[1] == pytest.approx(closing / without)


@pytest.mark.parametrize("station", [85.4, 85.7])
def test_a_pad_that_stands_a_little_over_an_open_rim_is_solved_as_quickly_as_any(station, monkeypatch):
    tangents, tangent = [], WallProblem.tangent
    monkeypatch.setattr(WallProblem, "tangent", lambda self, x: tangents.append(1) or tangent(self, x))
    pad = "gripper.pad_length_mm=50", "gripper.pad_width_mm=22", "gripper.pad_thickness_mm=15"
    where = f"stations_mm = [{station}]\nangles_deg = [0]"
    solved(OPEN, *pad, "gripper.shear_modulus_kpa=40", where=where, forces="[1]", elements="[10, 6, 3]")
    assert len(tangents) < 20  # several hundred where points leave and face the wall for ever


def test_a_wall_that_is_taken_as_rigid_holds_what_the_rigid_object_does():
    wall_, rigid = solved(CUP, "effects.object='rigid'"), solved(CUP.split("wall_mm")[0])
    for name in ("payload", "quality"):  # weight and extents end where the outline does, not at the rims of lids
        ours, theirs = (np.array([r.values[f"maps/{name}"][0] for r in results]) for results in (wall_, rigid))
        assert ours == pytest.approx(theirs, rel=1e-3)


@pytest.mark.long
def test_a_foot_that_a_table_would_have_to_pull_down_is_named():
    pulled, heavy, free = (
        solved(CUP, *changes, "effects.object='nonlinear_shell'")[-1].message
        for changes in ((STANDING,), (STANDING, "object.mass_g=100000"), ())
    )
    assert "the table pulls the foot down with" in pulled
    assert "foot" not in heavy + free


@LONG
def test_across_an_oval_there_is_no_symmetry_and_to_force_one_is_refused():
    where = "stations_mm = [40]\nangles_deg = [45]"
    result = solved(OVAL, where=where)[-1]
    assert result.effects["model_size"][0] == "full"
    one, two = result.values["fingers/tau_z_max"][:, 0]
    assert one == pytest.approx(two, rel=1e-4)  # half a turn is a symmetry, of which only the meshes know nothing
    with pytest.raises(ValueError, match=r"'quarter' needs 2 plane\(s\) of symmetry"):
        solved(OVAL, "effects.model_size='quarter'", where=where)


@pytest.mark.parametrize("long_side", [[0, 0, -1], *(pytest.param(v, marks=LONG) for v in ([0, 0, 1], [0, 1, 0]))])
def test_symmetric_and_whole_models_give_both_fingers_the_same_patches(long_side):
    """On a cone the patch is not its own image turned by half a turn."""
    where = pose_of((0, 0, 50), [-1, 0, 0], long_side)
    small, whole = (solved(CUP, *size, where=where, forces="[1]")[-1] for size in ((), ("effects.model_size='full'",)))
    assert small.effects["fingers"][0] == "one"
    assert whole.effects["fingers"][0] == "two"
    for name, size in (("pressure", None), ("centroid", None), ("normal", 1.0)):
        a, b = small.patch[name], whole.patch[name]
        np.testing.assert_allclose(a, b, atol=2e-5 * (size or np.abs(b).max()), err_msg=name)


@LONG
def test_a_tilted_approach_keeps_one_plane_and_one_along_the_axis_is_refused():
    tilted = solved(CUP, where=pose_of((0, 0, 50), [-1, 0, 0.2], [0, 0, 1]))[-1]
    assert tilted.effects["model_size"][0] == "half"
    assert np.isfinite(tilted.values["maps/e_n"]).all()
    with pytest.raises(Exception, match="90 degrees"):
        solved(CUP, where=pose_of((0, 0, 50), [0, 0, 1], [1, 0, 0]))


@pytest.mark.long
def test_images_of_a_grasp_are_what_their_own_solution_would_be_whatever_was_solved_before():
    where = "stations_mm = [40]\nangles_deg = [0, 37]"
    unit = walled(CUP, where=where)[0]
    assert len(unit.rows) == 2
    image = pipeline.image(solved(CUP, where=where)[-1], unit, 1)
    own = solved(CUP, where="stations_mm = [40]\nangles_deg = [37]")[-1]
    np.testing.assert_allclose(image.values["wall/place"], own.values["wall/place"], atol=1e-9)
    np.testing.assert_allclose(image.values["fingers/pose_origin"], own.values["fingers/pose_origin"], atol=1e-9)
    assert image.values["maps/indentation"] == pytest.approx(own.values["maps/indentation"], rel=1e-6)
    where = "stations_mm = [25, 40]\nangles_deg = [0]"
    one, two = walled(CUP, "effects.object='linear_shell'", where=where)

    def run(order):
        wall.object_factors.cache_clear()
        return {id(u): [r.values for _, r in pipeline.solve_unit(u)] for u in order}

    forth, back = run((one, two)), run((two, one))
    for key, path in forth.items():
        for a, b in zip(path, back[key], strict=True):
            assert not differing(a, b, 0.0)


@pytest.mark.long
def test_two_meshes_tell_the_error_a_tube_gives_way_more_than_a_cup_and_a_collapse_fails_the_case(monkeypatch):
    result = solved(CUP, "accuracy.meshes=2", forces="[2]", elements="[8, 8, 4]")[0]
    assert 0 < result.values["maps/e_n_error"] < 0.3
    one, two = walled(CUP, "sweep.object.wall_mm=[0.4, 0.8]", forces="[1]")
    indentations = [next(iter(pipeline.solve_unit(u)))[1].values["maps/indentation"] for u in (one, two)]
    assert indentations[0] > 2 * indentations[1]
    straight = CUP.replace("[0, 24], [4, 28]", "[0, 30]").replace("[60, 32], [80, 34]", "[60, 30], [80, 30]")
    found = [
        solved(straight, *own, forces="[1]")[0].values["maps/indentation"]
        for own in (("object.support='clamped'", "object.open_ends='both'"), (STANDING,), ("object.open_ends='both'",))
    ]
    assert 1.3 * found[0] < found[1] < 0.8 * found[2]
    values = solved(straight, "object.open_ends='both'", "object.wall_mm=0.25", forces="[0.1, 1]")[1].values
    assert values["maps/indentation"] > wall.DENTED_SHARE * 0.030
    assert values["maps/flags"] & Flag.DENTED
    with pytest.raises(Exception, match="base_wall_mm"):
        solved(straight, "object.open_ends='both'", "object.base_wall_mm=0.8")
    from softjaw.fem.shell.opening import Opening
    with monkeypatch.context() as changed:
        changed.setattr(Opening, "__call__", lambda self, q: 1.0 - 1e3 * float(np.abs(q).max()))
        path = [r for _, r in pipeline.solve_unit(walled(CUP, forces="[0.2, 3, 4]")[0])]
    assert not isinstance(path[0], CaseFailure)
    assert all(isinstance(result, CaseFailure) for result in path[1:])
    assert "0.2 N" in path[1].message
    funnel = CUP.replace("[[0, 24], [4, 28], [30, 30], [60, 32], [80, 34]]", "[[0, 14], [10, 15], [60, 35], [70, 39]]")
    for mu, slides in ((0.8, False), (0.1, True)):
        result = solved(funnel, f"friction.mu={mu}", forces="[1]")[0]
        # the funnel's slope of 0.4 pushes it along its axis with about that share of both normal forces
        assert 0.2 < result.values["maps/support_force"] / 2.0 < 0.5
        assert bool(result.values["maps/flags"] & Flag.SLIDES_OUT) == slides
        assert (Flag.SLIDES_OUT.sentence in result.message) == slides


@pytest.mark.long
def test_a_light_touch_of_a_large_flat_wall_is_solved():
    """A canister of 180 x 250 mm: the rounding of its residual grows with its extent and thickness."""
    canister = 'shape = "sections"\nwall_mm = 1.2\nwall_material = "HDPE"\n' + "".join(
        f"[[object.sections]]\nz_mm = {z}\na_mm = {a}\nb_mm = {b}\nexponent = 5\n"
        for z, a, b in ((0, 60, 80), (10, 65, 90), (30, 65, 90), (180, 65, 90), (230, 65, 90), (250, 55, 80))
    )
    pad = [f"gripper.pad_{name}_mm={size}" for name, size in (("length", 60), ("width", 40), ("thickness", 10))]
    where = WHERE.replace("40", "120")
    changes = "accuracy.wall_element_mm=8", "effects.object='nonlinear_shell'", *pad
    [found] = solved(canister, *changes, where=where, forces="[0.05]", elements="[12, 8, 4]")
    assert not isinstance(found, CaseFailure), found
    assert found.values["maps/indentation"] > 0
