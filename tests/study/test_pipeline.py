"""The pipeline with the real solver on coarse meshes: what symmetry, definitions and limits demand of every number."""

import re
import shutil
from functools import lru_cache

import numpy as np
import pytest

from softjaw.fem.errors import ConvergenceError
from softjaw.study import pipeline
from softjaw.study.case import pressing
from softjaw.study.case.build import build_object
from softjaw.study.case.errors import OF_FARTHEST
from softjaw.study.case.model import contact_rules
from softjaw.study.case.result import CaseFailure
from softjaw.study.case.solver import followed
from softjaw.study.doctor import launch_environment
from softjaw.study.flags import Flag
from softjaw.study.quantities import MODELS
from softjaw.study.scene import load_scene
from tests.study.launching import ROOT, launch
from tests.study.scenes import BALL, CONE, OVAL, QUICK, results_of, scene_of, units_of

CURVED, FLAT, PROJECTED = range(len(MODELS))
MU = 0.8
PLATE = 'shape = "plane"\nthickness_mm = 40'
TILTED = 2 * np.hypot(25e-3 * np.cos(np.pi / 6), 20e-3 * np.sin(np.pi / 6))  # between two tangents of the ellipse
# Values that are zero up to rounding, with the size that rounding is to be compared with.
SCALES = {
    "maps/misalignment": 1.0, "fingers/frame_origin": 0.01, "fingers/pose_origin": 0.01, "fingers/frame_axes": 1.0,
    "maps/curvature_loss": 1.0, "maps/force_excess": 1.0, "fingers/force_excess": 1.0,
    "checks/force_balance": 1.0, "checks/adhesion": 1.0, "checks/penetration": 1.0,
    "checks/complementarity": 1.0, "maps/payload": 1e6,  # known to 3e-3 at worst, by a search that rounding turns
    **{f"maps/{n}_overestimate{s}": 1.0 for n in ("f_x", "f_y", "tau_z") for s in ("", "_pcm_projected")},
}  # fmt: skip
PRESSED_FLAT = """
import numpy as np
from softjaw.fem.materials import material
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.pad.shape import PadShape
from softjaw.fem.contact.press import Press

def plane(x):
    return -x[:, 2], np.tile([0.0, 0.0, -1.0], (len(x), 1)), np.zeros((len(x), 3, 3))

shape = PadShape((0.05, 0.022, 0.015), (4, 4, 2), (1.0, 1.0, 1.0), "hex8")
[state] = Press(Pad(shape, material("blatz_ko", 4e4), (True, True), "weighted"), plane).load_path([5.0])
print(state.closing)
"""


@lru_cache(maxsize=64)
def solved(shape, *overrides, stations="[0]", angles="[0]", forces="[2, 5]", elements="[8, 4, 2]"):
    place = {"stations": stations, "angles": angles, "forces": forces, "elements": elements}
    made = units_of(scene_of(shape, *QUICK, *overrides, **place))
    return [(unit, [result for _, result in pipeline.solve_unit(unit)]) for unit in made]


def cases(*arguments, **choices):
    return [result.values for _, path in solved(*arguments, **choices) for result in path]


def e_n(*arguments, **choices):
    return np.array([values["maps/e_n"][0] for values in cases(*arguments, **choices)])


def differing(found, expected, tolerance, scale=None):
    """Names of the values, timings aside, that differ by more than a share of their size."""
    assert found.keys() == expected.keys()
    wrong = []
    for name, b in expected.items():
        a, b = np.asarray(found[name], float), np.asarray(b, float)
        size = max(np.abs(b).max(initial=0.0), (scale or {}).get(name, 0.0))
        if not name.startswith("work/") and not np.allclose(a, b, rtol=0.0, atol=tolerance * size, equal_nan=True):
            wrong.append(name)
    return wrong


def test_on_a_plane_all_models_are_one_and_torques_without_a_force_are_the_largest_unlike_elsewhere():
    for values, force in zip(cases(PLATE), (2.0, 5.0), strict=True):
        for name in ("quality", "epsilon", "e_n", "e_n_projected", "f_x_max", "f_y_max", "tau_z_max"):
            assert values[f"maps/{name}"] == pytest.approx([values[f"maps/{name}"][CURVED]] * 3, rel=1e-12), name
        for name in ("f_x", "f_y", "tau_z"):
            assert values[f"maps/{name}_overestimate"] == pytest.approx(0.0, abs=1e-12)
            assert values[f"maps/{name}_overestimate_pcm_projected"] == pytest.approx(0.0, abs=1e-12)
        assert values["maps/S"] == pytest.approx(force, rel=1e-8)
        assert values["maps/F_N"] == pytest.approx(force, rel=1e-8)
        assert values["maps/f_x_max"][FLAT] == pytest.approx(MU * force, rel=1e-8)
        assert values["maps/contact_distance"] == pytest.approx(0.04, rel=1e-9)
        assert values["maps/flags"] == 0
    for values in cases(PLATE):
        assert values["fingers/tau_pure"] == pytest.approx(values["fingers/tau_z_max"][:, CURVED], rel=1e-8)
    lower = [v["maps/tau_pure"] / v["maps/tau_z_max"][CURVED] for v in cases(CONE, stations="[75]")]
    assert 0.9 < min(lower)
    assert max(lower) < 1 - 1e-6


@pytest.mark.parametrize("angle", [0, 30, 90])
def test_the_curved_limits_lie_between_the_planar_ones(angle):
    for values, force in zip(cases(OVAL, angles=f"[{angle}]", elements="[8, 8, 4]"), (2.0, 5.0), strict=True):
        S, F_N = values["fingers/S"], values["fingers/F_N"]
        assert (S > (1 + 1e-3) * F_N).all()
        if angle != 30:  # there the contact normal is not the approach
            assert pytest.approx(force, rel=1e-8) == F_N
        slack = 1 + 1e-12
        for name in ("f_x_max", "f_y_max", "tau_z_max"):
            limits = values[f"fingers/{name}"]
            assert (limits[:, PROJECTED] <= limits[:, CURVED] * slack).all(), name
            assert (limits[:, CURVED] <= limits[:, FLAT] * slack).all(), name
        assert values["fingers/f_x_max"][:, FLAT] == pytest.approx(MU * S)
        assert values["fingers/f_y_max"][:, PROJECTED] == pytest.approx(MU * F_N)
        # along the cylinder nothing is lost, across it much more than around the normal
        assert values["maps/f_y_overestimate"] > values["maps/tau_z_overestimate"] > values["maps/f_x_overestimate"]
        assert values["maps/curvature_loss"] == pytest.approx(1 - F_N.sum() / S.sum())


def test_definitions_of_e_n_say_the_same_torque_and_on_a_slope_the_force_is_the_commanded_over_the_cosine():
    oval, cone = cases(OVAL, angles="[0, 30]"), cases(CONE, stations="[75]")
    for values, force in zip(oval + cone, (2.0, 5.0) * 3, strict=True):
        tau = values["fingers/tau_z_max"]
        S, F_N = values["fingers/S"], values["fingers/F_N"]
        assert values["maps/e_n"] == pytest.approx((tau / (MU * S[:, None])).min(axis=0), rel=1e-12)
        assert values["maps/e_n_projected"] == pytest.approx((tau / (MU * F_N[:, None])).min(axis=0), rel=1e-12)
        # both fingers are alike here, so the products of the maps agree as well
        projected = values["maps/e_n_projected"] * values["maps/F_N"]
        assert values["maps/e_n"] * values["maps/S"] == pytest.approx(projected, rel=1e-9)
        # Eqs. (11) and (12) as the paper prints them, the latter with the force that the gripper commands
        largest = tau / values["fingers/e_n_ratio"]
        along_axes = np.maximum(values["fingers/f_x_max"], values["fingers/f_y_max"])[:, CURVED]
        assert (largest[:, CURVED] >= (1.0 - 1e-12) * along_axes).all()
        assert largest[:, FLAT] == pytest.approx(MU * S)
        assert (values["fingers/e_n_ratio"] >= tau / (MU * S[:, None]) * (1.0 - 1e-12)).all()
        assert values["maps/e_n_commanded"] == pytest.approx((tau / (MU * force)).min(axis=0), rel=1e-12)
        assert values["fingers/force_excess"] == pytest.approx(F_N / force - 1.0)
    # Where the resultant of the pressure lies along the contact normal, as on one straight side of a cone it does.
    for slope, flagged in ((8.0, False), (25.0, True)):
        rise = 60.0 * np.tan(np.radians(slope))
        outline = [[z, float(25.0 + rise * (1.0 - z / 60.0))] for z in (0, 20, 40, 60)]
        cone = f'shape = "revolution"\nprofile_mm = {outline}'
        for values in cases(cone, stations="[30]"):
            expected = 1.0 / np.array(values["fingers/frame_axes"])[:, 2, 2] - 1.0
            assert values["fingers/force_excess"] == pytest.approx(expected, abs=0.1 * expected.max())
            assert bool(int(values["maps/flags"]) & Flag.OBLIQUE) == flagged


@pytest.mark.parametrize("shape", [OVAL, CONE])
def test_a_finger_that_is_an_image_has_what_its_own_solution_gives(monkeypatch, shape):
    place = dict(stations="[75]" if shape == CONE else "[0]", angles="[20]")
    shared = cases(shape, **place)
    monkeypatch.setattr(pressing, "turn_of_pose", lambda *_: None)
    solved.cache_clear()
    separate = cases(shape, **place)
    solved.cache_clear()
    for found, expected in zip(shared, separate, strict=True):
        assert differing(found, expected, 1e-8, SCALES) == []


@pytest.mark.parametrize(("shape", "station", "angles"), [
    (CONE, 75, (0, 37)), (OVAL, 0, (25, 205)), (BALL, 4, (0, 90)),
])  # fmt: skip
def test_images_under_the_objects_symmetry_are_what_solving_them_gives(shape, station, angles):
    stations = f"[{station}]"
    [(unit, path)] = solved(shape, stations=stations, angles=str(list(angles)))
    assert len(unit.served) == 2
    [(_, own)] = solved(shape, stations=stations, angles=f"[{angles[1]}]")
    for result, expected in zip(path, own, strict=True):
        turned = pipeline.image(result, unit, 1)
        assert differing(turned.values, expected.values, 1e-9, SCALES) == []
        assert [e[0] for e in turned.effects.values()] == [e[0] for e in expected.effects.values()]
        assert turned.message == expected.message
        for name, faces in expected.patch.items():
            assert turned.patch[name] == pytest.approx(faces, abs=1e-9 * np.abs(faces).max()), name
        assert differing(pipeline.image(result, unit, 0).values, result.values, 1e-12, SCALES) == []


def test_the_part_of_the_pad_that_is_meshed_does_not_matter_and_without_friction_nothing_is_held():
    shapes = {size: cases(OVAL, f'effects.model_size="{size}"') for size in ("full", "half", "quarter", "auto")}
    for size in ("half", "quarter", "auto"):
        for found, expected in zip(shapes[size], shapes["full"], strict=True):
            names = [name for name in expected if name.startswith(("maps/", "fingers/"))]
            pick = [{name: values[name] for name in names} for values in (found, expected)]
            assert differing(*pick, 1e-8, SCALES) == []
    (_, [middle, _]), (_, [beside, _]) = *solved(OVAL), *solved(BALL, stations="[5]")
    assert [result.effects["model_size"][0] for result in (middle, beside)] == ["quarter", "half"]
    [(_, path)] = solved(OVAL, "friction.mu=0")
    for result, held in zip(path, cases(OVAL), strict=True):
        values = result.values
        for name in ("quality", "epsilon", "f_x_max", "f_y_max", "tau_z_max"):
            np.testing.assert_allclose(values[f"maps/{name}"], 0.0, atol=1e-12)
        # without friction rounding decides whether the two pressures balance each other
        assert values["maps/flags"] & ~(Flag.COARSE | Flag.NOT_BORNE) == Flag.NO_TORQUE | Flag.NO_FORCE
        assert Flag.NO_TORQUE.sentence in result.message
        assert values["maps/e_n"] == pytest.approx(held["maps/e_n"], rel=1e-12)  # a length, whatever mu is
        assert values["maps/S"] == pytest.approx(held["maps/S"], rel=1e-12)


def test_error_maps_hold_the_differences_to_the_coarser_mesh_and_shrink_with_refinement():
    errors = []
    for elements, half in (("[8, 8, 4]", "[4, 4, 2]"), ("[24, 24, 12]", "[12, 12, 6]")):
        [values] = cases(OVAL, "accuracy.meshes=2", elements=elements, forces="[5]")
        [coarse] = cases(OVAL, elements=half, forces="[5]")
        for name in ("e_n", "f_x_max", "f_y_max", "tau_z_max"):
            fine, rough = values[f"maps/{name}"][CURVED], coarse[f"maps/{name}"][CURVED]
            assert values[f"maps/{name}_error"] >= abs(rough / fine - 1) * (1 - 1e-6) - 1e-10, name
        for name in ("f_y_overestimate", "tau_z_overestimate_pcm_projected"):
            gone = abs(values[f"maps/{name}"] - coarse[f"maps/{name}"])
            assert values[f"maps/{name}_error"] >= OF_FARTHEST * gone * (1 - 1e-6), name
        errors.append([values[f"maps/{name}_error"] for name in ("e_n", "tau_z_max", "f_y_overestimate")])
    # the rim of the contact moves by whole faces, so the errors of a third mesh may fall between by chance
    assert (np.array(errors[1]) < 0.6 * np.array(errors[0])).all(), errors


@pytest.mark.parametrize(("shape", "station"), [(OVAL, 0), (BALL, 0), (PLATE, 0), (CONE, 75)])
def test_the_pad_stands_at_first_touch_and_lies_on_the_object_under_load(shape, station):
    """The contact's laws with weighted gaps: pressures do no work against them, so the sum of load times gap is 0."""
    [(unit, path)] = solved(shape, stations=f"[{station}]")
    obj = build_object(unit.scene.object)
    x, y = np.meshgrid(np.linspace(-0.025, 0.025, 501), np.linspace(-0.011, 0.011, 23))
    front = np.column_stack([x.ravel(), y.ravel(), np.zeros(x.size)])
    for result in path:
        values, patch = result.values, result.patch
        for f in range(2):
            rotation, origin = values["fingers/pose_rotation"][f], values["fingers/pose_origin"][f]
            gap = obj.gap(front @ rotation.T + origin)[0]
            assert gap.min() == pytest.approx(0.0, abs=1e-9)
            load = patch["pressure"][f] * patch["area"][f]
            gap, normal, _ = obj.gap(patch["centroid"][f] @ rotation.T + origin)
            closing = np.asarray(values["fingers/closing"])[f]
            assert abs(load @ gap) < 1e-8 * load.sum() * closing
            assert (load * gap**2).sum() < (0.5 * closing) ** 2 * load.sum()
            loaded = load > 0
            # the patch's normals point into the object
            inward = -normal @ rotation
            assert patch["normal"][f][loaded] == pytest.approx(inward[loaded], abs=1e-9)
            assert values["fingers/S"][f] == pytest.approx(load.sum(), rel=1e-12)
            along = (load * patch["normal"][f][:, 2]).sum()
            assert along == pytest.approx(unit.scene.load.normal_force[path.index(result)], rel=1e-8)


def test_a_load_path_that_ends_names_the_last_good_force_and_what_was_not_tried():
    [(_, [good, ended, above])] = solved('shape = "sphere"\nradius_mm = 5', forces="[2, 20, 30]")
    assert good.values["maps/closing"] > 0
    assert isinstance(ended, CaseFailure)
    *met, last_good = numbers_of(ended.message, "N")
    assert any(2 < force < 20 for force in met)
    assert last_good == 2
    assert numbers_of(above.message, "N")[0] == 20
    path = solved(OVAL, "petsc.contact_snes_max_it=2")[0][1]
    assert all(isinstance(result, CaseFailure) for result in path)
    assert numbers_of(path[1].message, "N")[0] == 2
    # beside the middle a ball has one plane of symmetry, not two
    with pytest.raises(ValueError, match=r"'quarter' needs 2 plane"):
        solved(BALL, 'effects.model_size="quarter"', stations="[3]")


def numbers_of(text, unit):
    return [float(number) for number in re.findall(rf"([\d.]+) {unit}\b", text)]


def test_a_solver_that_is_cut_short_takes_more_steps_to_the_same_answer():
    cut = cases(OVAL, "petsc.contact_snes_max_it=3")
    for found, expected in zip(cut, cases(OVAL), strict=True):
        assert differing(found, expected, 1e-7, SCALES) == []
    assert sum(sum(values["work/step_halvings"]) for values in cut) > 0


def test_over_a_hole_the_frame_stands_on_the_pad():
    """At 1 N in the middle of the waist the pad's middle hangs 0.3 mm over the bottle of 58 mm diameter."""
    place = "candidates.angles_deg=[0]", "candidates.stations_mm=[67.5]", "load.normal_force_n=[1]"
    [result] = results_of(load_scene(ROOT / "jobs" / "bottle-rigid.toml", place))
    origin, axes = (result.values[f"fingers/frame_{name}"][0] for name in ("origin", "axes"))
    assert result.values["fingers/frame_flag"][0] == 0
    np.testing.assert_allclose(axes, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(origin[:2], 0, atol=1e-8)
    assert 58e-3 < result.values["maps/contact_distance"] < 59e-3
    pressure, centroid = result.patch["pressure"][0], result.patch["centroid"][0]
    nearest = np.argsort(np.linalg.norm(centroid - origin, axis=1))[:4]
    assert (pressure[nearest] == 0).all()
    assert origin[2] == pytest.approx(centroid[nearest, 2].mean(), abs=2e-5)


@pytest.mark.parametrize(("radius", "nodal"), [(3, True), (30, False)])
def test_where_weighted_gaps_have_no_solution_nodal_ones_are_taken_and_flagged(radius, nodal):
    """The small ball touches a part of one element, 6.25 mm x 5.5 mm."""
    ball = f'shape = "sphere"\nradius_mm = {radius}'
    for values in cases(ball, 'accuracy.contact="weighted"', forces="[0.01, 0.2]"):
        assert bool(values["maps/flags"] & Flag.NODAL) == nodal


@pytest.mark.parametrize(("choice", "element", "walled", "rules"), [
    ("auto", "hex8", False, ("blended", "nodal", "weighted")), ("auto", "hex27", False, ("weighted", "nodal")),
    ("auto", "hex8", True, ("blended", "nodal")), ("weighted", "hex8", False, ("weighted", "nodal")),
    ("nodal", "hex27", False, ("nodal",)), ("blended", "hex8", True, ("blended", "nodal")),
])  # fmt: skip
def test_which_gaps_are_tried(choice, element, walled, rules):
    overrides = [f'accuracy.contact="{choice}"', f'gripper.element="{element}"']
    assert contact_rules(scene_of(OVAL, *overrides), walled) == rules


@pytest.mark.long
def test_a_changed_material_takes_effect_although_its_callers_were_compiled_before(tmp_path):
    """A foam twice as stiff yields less, also with the machine code of the last run at hand."""
    (tmp_path / "softjaw").mkdir()
    (tmp_path / "softjaw" / "__init__.py").touch()
    for package in ("fem", "friction"):
        shutil.copytree(ROOT / package, tmp_path / "softjaw" / package, ignore=shutil.ignore_patterns("__pycache__"))

    def closing():
        environment = {k: v for k, v in launch_environment().items() if k != "NUMBA_CACHE_DIR"}
        return float(launch(0, "-c", PRESSED_FLAT, cwd=tmp_path, env=environment)[1])

    soft = closing()
    law = tmp_path / "softjaw" / "fem" / "materials.py"
    text = law.read_text()
    changed = text.replace("G = par[0]\n    M, D", "G = 2 * par[0]\n    M, D")
    assert changed != text
    law.write_text(changed)
    assert closing() < 0.7 * soft


@pytest.mark.parametrize(
    ("angle", "expected"), [(0, 0), (4, Flag.NOT_ANTIPODAL), (45, Flag.NOT_ANTIPODAL | Flag.SLIPS)]
)
def test_contacts_beside_each_other_are_flagged_although_their_normals_are_parallel(angle, expected):
    """Pads turned against a plate touch it towards opposite edges; mu = 0.8 holds up to 38.7 degrees."""
    plate = 'shape = "plane"\nthickness_mm = 20'
    [(_, [case])] = solved(plate, angles=f"[{angle}]", forces="[5]", elements="[12, 8, 4]")
    assert case.values["maps/flags"] & (Flag.NOT_ANTIPODAL | Flag.SLIPS) == expected
    if angle:
        assert case.values["maps/misalignment"] > np.radians(5)


def test_a_state_that_depends_on_the_load_path_is_flagged_from_the_jump_on(monkeypatch):
    jumps = lambda steps, here, ahead: here.force < 2.9 < ahead.force  # noqa: E731
    monkeypatch.setattr("softjaw.fem.contact.load_stepping.Stepping._leaves", jumps)
    found = solved(OVAL, 'accuracy.contact="nodal"', forces="[2, 4, 5]")
    for _, path in found:
        assert [bool(int(result.values["maps/flags"]) & Flag.JUMPED) for result in path] == [False, True, True]
        assert [Flag.JUMPED.sentence in result.message for result in path] == [False, True, True]


@pytest.mark.parametrize(("shape", "angle", "width", "rounding"), [
    (BALL, 0, 60e-3, 1e-8), (OVAL, 0, 50e-3, 1e-8), (OVAL, 90, 40e-3, 1e-8), (OVAL, 30, TILTED, 2e-5),
])  # fmt: skip
def test_the_opening_is_the_width_of_the_object_and_both_pads_close_it(shape, angle, width, rounding):
    """At 30 degrees the place of first touch lies between the points that look for it, 1.1 mm apart."""
    for values in cases(shape, angles=f"[{angle}]", forces="[2]"):
        assert values["maps/opening"] == pytest.approx(width, abs=rounding)
        closing = sum(values["fingers/closing"])
        assert closing > 5e-4
        assert values["maps/opening"] - values["maps/opening_loaded"] == pytest.approx(closing, abs=1e-15)
        one, two = values["fingers/pose_origin"]
        assert np.linalg.norm(two - one) == pytest.approx(values["maps/opening"], abs=1e-12)


def test_forces_above_one_that_hardly_touches_begin_anew():
    def load_path(forces):
        for force in forces:
            if force < 1e-3:
                raise ConvergenceError("no first contact")
            yield force

    failed, again, *reached = followed(load_path, (1e-9, 1e-4, 1.0, 2.0))
    assert isinstance(failed, ConvergenceError)
    assert isinstance(again, ConvergenceError)
    assert reached == [1.0, 2.0]
    # a first force that is not small beside the others ends the path, with one failure for all of them
    ended, above = followed(load_path, (9e-4, 0.5))
    assert isinstance(ended, ConvergenceError)
    assert above is ended
