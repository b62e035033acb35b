"""Presets of grippers: what a scene gets from them, joint values, and files of one's own."""

import math

import numpy as np
import pytest

import softjaw
from softjaw.study.cli import main
from softjaw.study.cli.options import KINDS
from softjaw.study.grippers import PRESETS, gripper_file
from softjaw.study.messages import USAGE
from softjaw.study.scene import Scene, SceneError, load_scene
from tests.study.launching import ROOT, refusal


def loaded(tmp_path, name, more=""):
    text = f'[object]\nshape = "sphere"\nradius_mm = 10\n[gripper]\npreset = "{name}"\n{more}\n'
    text += "[candidates]\nstations_mm = [0]\n[load]\nnormal_force_n = [30]\n"
    (tmp_path / "scene.toml").write_text(text)
    return load_scene(tmp_path / "scene.toml").gripper


@pytest.mark.parametrize("name", PRESETS)
def test_a_preset_sets_pad_and_opening_and_is_gone(tmp_path, name):
    keys, hand = gripper_file(name)
    found = loaded(tmp_path, name)
    assert {key: getattr(found, key) for key in keys} == keys
    assert found.max_opening_mm == pytest.approx(hand.stroke_mm - 2 * found.pad_thickness_mm)
    scene = load_scene(tmp_path / "scene.toml")
    assert Scene.of_tables(scene.effective()) == scene
    (tmp_path / "mine.toml").write_text("[gripper]\npad_length_mm = 30\n[hand]\nstroke_mm = 60")  # pads as by default
    assert loaded(tmp_path, "mine.toml").max_opening_mm == 60 - 2 * loaded(tmp_path, "mine.toml").pad_thickness_mm


def test_keys_of_the_scene_come_first_and_a_preset_may_stand_on_the_command_line(tmp_path):
    found = loaded(tmp_path, "franka_hand", more="pad_thickness_mm = 10\npad_width_mm = 30")
    assert (found.pad_width_mm, found.pad_thickness_mm, found.max_opening_mm) == (30, 10, 60)
    assert loaded(tmp_path, "franka_hand", more="max_opening_mm = 33").max_opening_mm == 33
    for thickness in ("40", "45"):  # of a stroke of 80 mm
        with pytest.raises(SceneError) as error:
            loaded(tmp_path, "franka_hand", more=f"pad_thickness_mm = {thickness}")
        (problem,) = error.value.problems
        assert (problem.line, problem.key, problem.value) == (6, "gripper.pad_thickness_mm", thickness)
        assert problem.expected.startswith("less than 40 mm")
    scene = Scene.from_file(ROOT / "jobs" / "smoke.toml", ["gripper.preset=wsg50", "load.normal_force_n=[5, 10]"])
    assert scene.gripper.max_opening_mm == 100


def test_a_preset_holds_for_values_that_are_put_in():
    """Its pad where it is new, the opening that other foam leaves, and its forces; a wrong name is told."""
    smoke = Scene.from_file(ROOT / "jobs" / "smoke.toml", ["load.normal_force_n=[5, 10]"])
    franka = smoke.with_values(**{"gripper.preset": "franka_hand"})
    assert (franka.gripper.pad_length_mm, franka.gripper.max_opening_mm) == (18.5, 70)
    thick = {"gripper.pad_thickness_mm": 10.0}
    assert franka.with_values(thick).gripper.max_opening_mm == 60
    assert franka.with_values(**{"gripper.max_opening_mm": 33}).with_values(thick).gripper.max_opening_mm == 33
    assert smoke.with_values(thick | {"gripper.preset": "franka_hand"}).gripper.max_opening_mm == 60
    assert franka.with_values(**{"gripper.preset": "wsg50"}).gripper.max_opening_mm == 100
    assert franka.with_values(**{"gripper.preset": None, "load.normal_force_n": [99]}).load.normal_force == (99.0,)
    for values in ({"load.normal_force_n": [36]}, {"gripper.preset": "franka"}, {"gripper.pad_thickness_mm": 40}):
        with pytest.raises(SceneError) as error:
            franka.with_values(values)
        assert [problem.key for problem in error.value.problems] == [*values]
    with pytest.raises(ValueError, match="expected 1 to 35 N, which this gripper has"):
        softjaw.press(franka, station=0.0, angle=0.0, force=80.0)


def test_joints_are_half_the_gap_within_the_stroke_or_the_angle_of_a_linkage():
    _, hand = gripper_file("franka_hand")
    assert hand.values(0.05) == pytest.approx({"fr3_finger_joint1": 0.025, "fr3_finger_joint2": 0.025})
    assert max(hand.values(1.0).values()) == pytest.approx(0.04)
    _, hand = gripper_file("wsg50")
    assert sorted(hand.values(0.05).values()) == pytest.approx([-0.025, 0.025])
    # The crank turned by the angle brings the pad to half the gap, and as far ahead as the depth says.
    _, hand = gripper_file("robotiq_2f85")
    link = hand.linkage_mm
    for gap in (0.005, 0.03, 0.06, 0.085):
        (angle,) = hand.values(gap).values()
        c, s = math.cos(angle), math.sin(angle)
        y, z = np.array(link.pivot) + np.array([[c, -s], [s, c]]) @ link.crank + link.pad
        assert (2 * y, z) == pytest.approx((1e3 * gap, 1e3 * hand.depth(gap)))
    assert hand.values(0.0) == pytest.approx({"finger_joint": 0.8})
    assert 0 < hand.values(0.085)["finger_joint"] < 0.02


@pytest.mark.parametrize("text", [
    "[hand]\nfingers = 3", "[hand]\nstroke_mm = -1", "[hand]\nclosing = 'z'", "hand =", "[Hand]\nstroke_mm = 40",
    "gripper = 3", "[hand]\nforce_n = [35, 1]", "[hand]\nforce_n = [1, nan]",
    "[hand]\ndepth_mm = inf", "[hand]\nfinger_mm = [-5, 5]", "[hand.joints]\nleft = nan", "[gripper]\npreset = 'wsg50'",
    "[hand.linkage_mm]\npivot = [nan, 0]\ncrank = [0, 20]\npad = [0, 5]",
])  # fmt: skip
def test_a_file_with_wrong_keys_is_refused(tmp_path, text):
    (tmp_path / "mine.toml").write_text(text)
    with refusal(USAGE):
        gripper_file(str(tmp_path / "mine.toml"))


@pytest.mark.parametrize("name", PRESETS)
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "mesh"])
def test_init_writes_it_and_check_passes(kind, name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["init", kind, "--gripper", name, "-o", "mine"]) == 0
    text = (tmp_path / "mine.toml").read_text()
    assert f'preset = "{name}"' in text
    assert max(map(len, text.splitlines())) <= 120
    scene = load_scene("mine.toml")
    low, high = gripper_file(name)[1].force_n
    assert low <= min(scene.load.normal_force_n) <= max(scene.load.normal_force_n) <= high
    assert main(["init", kind, "--gripper", "none", "-o", "other"]) == USAGE
