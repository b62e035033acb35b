"""Scenes: what is accepted, and the sentence for everything that is not."""

import json
import math
import subprocess
import sys
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from pydantic import ValidationError

from softjaw.fem.objects.mesh_file import LENGTHS
from softjaw.study.scene import Scene, SceneError, load_scene, parse_scene
from softjaw.study.scene.objects import SHAPES, Mesh
from softjaw.study.units import in_si

ROOT = Path(__file__).parents[3]
JOBS = sorted((ROOT / "jobs").glob("*.toml"))
BALL = """[object]
shape = "sphere"
radius_mm = 30

[candidates]
stations_mm = [0]

[load]
normal_force_n = [1]
"""
BOTTLE = BALL.replace(
    'shape = "sphere"\nradius_mm = 30',
    'shape = "revolution"\nprofile_mm = [\n  [0, 30], [50, 30],\n  [100, 20],\n  [150, 12],\n]',
)


def problems(text, *overrides, path="ball.toml"):
    with pytest.raises(SceneError) as caught:
        parse_scene(text, path, overrides)
    return caught.value.problems


def problem(text, *overrides):
    found = problems(text, *overrides)
    assert len(found) == 1, "\n".join(map(str, found))
    return found[0]


# What is written, the line and key that are named, and values, numbers and keys that the sentence has to hold.
WRONG_LINES = [
    ("[gripper]\npad_lenght_mm = 5", 12, "gripper.pad_lenght_mm", "[gripper]", "did you mean `pad_length_mm`?"),
    ("[gripper]\npad_length_m = 0.05", 12, "gripper.pad_length_m", "[gripper]", "`pad_length_mm = 50`"),
    ("[gripper]\npad_length = 50", 12, "gripper.pad_length", "[gripper]", "write `pad_length_mm`"),
    ("[gripper]\nshear_modulus_mpa = 0.04", 12, "gripper.shear_modulus_mpa", "[gripper]", "`shear_modulus_kpa = 40`"),
    ("[gripper]\nmu = 0.5", 12, "gripper.mu", "[gripper]", "belongs to [friction]"),
    ("[gripper]\nblue = 1", 12, "gripper.blue", "one of pad_length_mm, pad_width_mm"),
    ("[gripper]\nelements = [20, 5, 6]\nsheet_support_mm = [20, 4]\n[effects]\nmodel_size = 'full'", 13,
     "gripper.sheet_support_mm", "[20.0, 4.0] mm", "[20, 5] and [10, 3] elements", "0 x 7.33333 mm", "even numbers"),
    ("[gripper]\npad_width_mm = '22 mm'", 12, "gripper.pad_width_mm", '"22 mm"', ">= 1", "<= 500 [mm]", "22.0"),
    ("[gripper]\npad_width_mm = true", 12, "gripper.pad_width_mm", "[mm]", "22.0"),
    ("[gripper]\npad_width_mm = 0.022", 12, "gripper.pad_width_mm", "0.022", ">= 1", "if m was meant, write 22"),
    ("[gripper]\npad_width_mm = nan", 12, "gripper.pad_width_mm", "nan"),
    ("[gripper]\nmaterial = 'foam'", 12, "gripper.material", '"foam"', '"blatz_ko", "hyperfoam"',
     'did you mean "hyperfoam"?'),
    ("[gripper]\nelements = [20, 10]", 12, "gripper.elements", "[20, 10]", "a list of 3", "[20, 10, 6]"),
    ("[gripper]\nelements = [20, 10, 1]", 12, "gripper.elements[2]", "1", "whole number >= 2", ">= 2"),
    ("[gripper]\nelements = [21, 10, 6]", 12, "gripper.elements", "[21, 10, 6]", "[22, 10, 6]"),
    ("[gripper]\nelements = [400, 400, 400]", 12, "gripper.elements", "64,000,000", "1,000,000", "[20, 10, 6]"),
    ("[gripper]\nelements = [200, 2, 2]", 12, "gripper.elements", "0.25 x 11 x 7.5 mm", "factor of 20", "[20, 10, 6]"),
    ("[gripper]\npoisson_ratio = 0.3", 12, "gripper.poisson_ratio", "0.3", "0.25"),
    ("[gripper]\nmaterial = 'linear'\npoisson_ratio = 0.5", 13, "gripper.poisson_ratio", "0.5", "<= 0.4999"),
    ("[gripper]\nalpha = [-2]", 12, "gripper.alpha", "blatz_ko"),
    ("[gripper]\nmaterial = 'hyperfoam'\nalpha = [2, 3]", 13, "gripper.alpha", "2 exponents and 1"),
    ("[friction]\nmu = -0.1", 12, "friction.mu", "-0.1", ">= 0", "mu = 0.8"),
    ("[effects]\npad = 'linear'", 12, "effects.pad", "unknown key", "object, sheet, model_size"),
    ("[effects]\nwrench = '6D'", 12, "effects.wrench", '"6D"', '"3-D", "6-D"', 'did you mean "6-D"?'),
    ("[effects]\nlimit_surface = 'quartic'\n[limit_surface]\nmodel = 'full'", 12, "effects.limit_surface",
     '"quartic"', 'limit_surface.model, which is "full"', '`model = "quartic"` in [limit_surface]'),
    ("[limit_surface]\nmodel = 'axis_aligned'\nobjective = 'zhou'", 13, "limit_surface.objective", '"axis_aligned"',
     "least_squares"),
    ("[limit_surface]\nwrench_samples = 'some'", 12, "limit_surface.wrench_samples", '"some"', '"none", "all"'),
    ("[limit_surface]\nwrench_samples = [0, 2]", 12, "limit_surface.wrench_samples[1]", "2", "0 to 1"),
    ("[limit_surface]\nwrench_samples = [-1]", 12, "limit_surface.wrench_samples[0]", "-1", "0 to 1"),
    ("[limit_surface]\nwrench_samples = [\n'0 mm, 9 deg']", 13, "limit_surface.wrench_samples[0]", '"0 mm, 9 deg"',
     'as "0 mm, 0 deg"', 'did you mean "0 mm, 90 deg"?'),
    ("[task]\nweight_direction = [0, 0, 0]", 12, "task.weight_direction", "[0.0, 0.0, 0.0]", "[0, 0, -1]"),
    ("[task]\nmass_g = 5", 12, "task.mass_g", "[task]", "belongs to [object]"),
    ("[sweep]\n'limit_surface.samples' = [60, 80]", 12, 'sweep."limit_surface.samples"', "cannot be swept"),
    ("[accuracy]\nmeshes = true", 12, "accuracy.meshes", "meshes = 2"),
    ("[output]\nfile = 'a.h5'", 12, "output.file", '"a.h5"', '"a.hdf"'),
    ("[output]\nfile = '../a.hdf'", 12, "output.file", '"../a.hdf"', "`-o`"),
    ("[output]\nfile = '/a.hdf'", 12, "output.file", '"/a.hdf"', "`-o`"),
    ("[petsc]\nsnes_max_it = 9", 12, "petsc.snes_max_it", "snes_max_it", "contact_", "`contact_snes_max_it`"),
    ("[petsc]\nfoo = 1", 12, "petsc.foo", "others go into the environment variable PETSC_OPTIONS"),
    ("[petsc]\ncontact_snes_view = 'ascii:/tmp/a'", 12, "petsc.contact_snes_view", "variable PETSC_OPTIONS"),
    ("[petsc]\ncontact_pc_python_type = 'a.b'", 12, "petsc.contact_pc_python_type", "Python"),
    ("[petsc]\ncontact_snes_max_it = [1]", 12, "petsc.contact_snes_max_it", "[1]"),
    ("[output_file]\na = 1", 11, "output_file", "[output]", "did you mean [output]?"),
    ("[sweep]\n'gripper.elements' = [1]", 12, 'sweep."gripper.elements"[0]', "a list of 3"),
    ("[sweep]\n'accuracy.meshes' = [1, 2]", 12, 'sweep."accuracy.meshes"', "cannot be swept"),
    ("[sweep]\n'run.memory_gb' = [1, 2]", 12, 'sweep."run.memory_gb"', "cannot be swept"),
    ("[run]\ntime_limit_s = 0", 12, "run.time_limit_s", "0", ">= 0.1", "time_limit_s = 600"),
    ("[sweep]\n'friction.my' = [1, 2]", 12, 'sweep."friction.my"', "did you mean `friction.mu`?"),
    ("[sweep]\n'friction.mu' = 1", 12, 'sweep."friction.mu"', "1", "= [...]"),
    ("[sweep]\n'friction.mu' = [1, '2']", 12, 'sweep."friction.mu"', '[1, "2"]'),
    ("[sweep]\n'friction.mu' = [1, 1]", 12, 'sweep."friction.mu"', "[1, 1]"),
    ("[sweep]\n'friction.mu' = [\n1,\n-2]", 14, 'sweep."friction.mu"[1]', "-2 (value 2 of 2)", ">= 0"),
    ("[sweep]\nobject.radius_mm = [30, 0.1]", 12, 'sweep."object.radius_mm"[1]', "0.2 mm along x (value 2 of 2)",
     "1 mm", "200 mm"),
    ("[sweep]\n'gripper.element' = ['hex8', 'hex27']", 12, 'sweep."gripper.element"', '"none"'),
]  # fmt: skip


@pytest.mark.parametrize("row", WRONG_LINES, ids=[row[0] for row in WRONG_LINES])
def test_a_wrong_line_is_named_with_what_was_expected_and_what_to_do(row):
    lines, line, key, *words = row
    p = problem(f"{BALL}\n{lines}\n")
    assert (p.file, p.line, p.key) == ("ball.toml", line, key)
    assert all(word in str(p) for word in words), p
    assert str(p) == f"ball.toml:{line}: {key}: found {p.found}, expected {p.expected}; {p.remedy}"
    assert all((p.found, p.expected, p.remedy))


# What is put in place of what, and the same.
WRONG_VALUES = [
    ("radius_mm = 30", "", 1, "object.radius_mm", "a number > 0 [mm]", "add `radius_mm = ...` to [object]"),
    ("radius_mm = 30", "radius_mm = 0.03", 3, "object.radius_mm", "0.06 mm along x", "1 mm to 2 m"),
    ("radius_mm = 30", "radius_mm = 200000", 3, "object.radius_mm", "400000 mm", "1 mm to 2 m"),
    ("radius_mm = 30", "radius_mm = 1e9", 3, "object.radius_mm", "2e+09 mm", "1 mm to 2 m"),
    ('"sphere"', '"spher"', 2, "object.shape", '"spher"', '"revolution", "sections"', 'did you mean "sphere"?'),
    ('shape = "sphere"', "", 1, "object.shape", "nothing", '"sphere"'),
    ("[0]", "[-30, 30.5]", 6, "candidates.stations_mm", "1 station off the object: 30.5", "from -30 to 30 mm"),
    ("[0]", "[0, 0]", 6, "candidates.stations_mm", "0 more than once"),
    ("[0]", "[]", 6, "candidates.stations_mm", "[]", "1 to 10000", "`stations_mm = [25, 50, 75]`"),
    ("[0]", "'top'", 6, "candidates.stations_mm", '"top"', "1 to 10000", "`stations_mm = [25, 50, 75]`"),
    ("[0]", "[inf]", 6, "candidates.stations_mm[0]", "a number [mm]"),
    ("stations_mm = [0]", "", 5, "candidates", "stations_mm", "`stations = 35`"),
    ("stations_mm = [0]", "stations = [0, 1]", 6, "candidates.stations", "[0, 1]", ">= 2"),
    ("stations_mm = [0]", "stations = 3", 6, "candidates.stations", "station_range_mm", "add station_range_mm"),
    ("[0]", "[0]\nstations = 3\nstation_range_mm = [0, 9]", 6, "candidates.stations_mm", "stations and"),
    ("stations_mm = [0]", "stations = 3\nstation_range_mm = [9, 0]", 7, "candidates.station_range_mm", "[9, 0]",
     "[0, 9]"),
    ("[0]", "[0]\nangles_deg = [0, 400]", 7, "candidates.angles_deg[1]", "400", "<= 360 [deg]"),
    ("[0]", "[0]\nangles_deg = [0, inf]", 7, "candidates.angles_deg[1]", "<= 360", "360"),
    ("[1]", "[1, -2]", 9, "load.normal_force_n[1]", "-2", "> 0 and <= 1000 [N]"),
    ("[1]", "[0]", 9, "load.normal_force_n[0]", "0", "> 0"),
    ("[1]", "[5000]", 9, "load.normal_force_n[0]", "5000", "<= 1000 [N]"),
    ("[1]", "['5 N']", 9, "load.normal_force_n[0]", '"5 N"', "[N]", "without quotes"),
    ("[1]", "5", 9, "load.normal_force_n", "5", "`normal_force_n = [1, 2, 5]`"),
    ("[1]", "-3", 9, "load.normal_force_n", "-3", "> 0", "`normal_force_n = [1, 2, 5]`"),
    ("[1]", "[-3]", 9, "load.normal_force_n[0]", "-3", "> 0", "<= 1000 [N]"),
    ("[1]", "[" + "9" * 400 + "]", 9, "load.normal_force_n[0]", "9999", "<= 1000"),
    ("[load]\nnormal_force_n = [1]", "", None, "load", "[load]", "add [load], as in jobs/smoke.toml"),
    ("= 30", "= 30,5", 3, "", '"radius_mm = 30,5"'),
    ("= 30", "= thirty", 3, "", "thirty"),
    ("= 30", "= 30\nradius_mm = 40", 4, "", "radius_mm = 40"),
    ("[load]", "[object]", 8, "", "[object]"),
    ("[load]", "[load", 8, "", "[load"),
    ("= 30", "= " + "[" * 3000, None, "", "nested too deeply"),
]  # fmt: skip


@pytest.mark.parametrize("row", WRONG_VALUES)
def test_a_wrong_value_is_named_with_what_was_expected_and_what_to_do(row):
    old, new, line, key, *words = row
    p = problem(BALL.replace(old, new, 1))
    assert (p.line, p.key) == (line, key)
    assert all(word in str(p) for word in words), p


def test_a_key_without_its_unit_is_unknown_and_the_right_one_missing():
    missing, unknown = problems(BALL.replace("radius_mm", "radius"))
    assert (missing.key, missing.line) == ("object.radius_mm", 1)
    assert (unknown.key, unknown.line) == ("object.radius", 3)
    assert "write `radius_mm`" in unknown.remedy


@pytest.mark.parametrize(
    ("old", "new", "line", "found"),
    [
        ("  [100, 20],", "  [40, 20],", 5, "[40, 20] after [50, 30]"),
        ("  [100, 20],", "  [50, 30],", 5, "[50, 30] after [50, 30]"),
        ("  [100, 20],", "  [100, 0],", 5, "radius 0 mm"),
        ("  [150, 12],", "  [150, -1],", 6, "radius -1 mm"),
        ("  [100, 20],", "  [100, 20, 1],", 5, "[100, 20, 1]"),
        ("  [100, 20],\n", "", 3, "[[0, 30], [50, 30], [150, 12]]"),
        ("stations_mm = [0]", "stations_mm = [-5]", 10, "1 station off the object: -5"),
    ],
)
def test_an_outline_that_makes_no_body_is_named_by_its_point(old, new, line, found):
    p = problem(BOTTLE.replace(old, new, 1))
    assert p.line == line
    assert found in p.found


@pytest.mark.parametrize(
    ("pose", "key", "found"),
    [
        ("point_mm = [0, 0, 0]\napproach = [0, 0, 0]\nlong_side = [0, 0, 1]", "approach", "[0.0, 0.0, 0.0]"),
        ("point_mm = [0, 0, 0]\napproach = [1, 0, 0]\nlong_side = [-2, 0.1, 0]", "long_side", "along the approach"),
        ("point_mm = [0, 0, 9e3]\napproach = [1, 0, 0]\nlong_side = [0, 0, 1]", "point_mm", "9000"),
        ("point_mm = [0, 0, 0]\napproach = [1, 0, 0]", "long_side", "nothing"),
    ],
)
def test_an_explicit_pose_must_fix_a_frame(pose, key, found):
    p = problem(BALL.replace("stations_mm = [0]", f"[[candidates.poses]]\n{pose}"))
    assert p.key == f"candidates.poses[0].{key}"
    assert found in p.found
    assert p.line in (6, 7, 8, 9)


def test_angles_beside_explicit_poses_are_refused():
    pose = "[[candidates.poses]]\npoint_mm = [0, 0, 0]\napproach = [1, 0, 0]\nlong_side = [0, 0, 1]"
    p = problem(BALL.replace("stations_mm = [0]", f"angles_deg = [0, 30]\n{pose}"))
    assert (p.key, p.line) == ("candidates.angles_deg", 6)


def test_every_problem_is_found_at_once_and_in_the_order_of_the_file():
    text = (
        BALL.replace("30", '"30"').replace("[0]", "[0, true]").replace("[1]", "[-1]")
        + "[gripper]\nx = 1\npad_width_mm = 0\n"
    )
    found = problems(text, "friction.mu=-1", "fricton.mu=1")
    assert [p.line for p in found] == [3, 6, 9, 11, 12, None, None]
    assert [p.file for p in found[-2:]] == ["--set fricton.mu=1", "--set friction.mu=-1"]
    assert "did you mean [friction]?" in found[-2].remedy


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_without_dimensions_lists_all_that_it_needs(shape):
    required = [f"object.{key}" for key, field in SHAPES[shape].model_fields.items() if field.is_required()]
    text = BALL.replace("sphere", shape).replace("radius_mm = 30\n", "")
    assert sorted(p.key for p in problems(text)) == sorted(set(required) - {"object.shape"})


def test_a_box_cannot_be_rounder_than_it_is_thick_and_planes_are_pressed_along_x():
    box = 'shape = "box"\nsize_mm = [60, 40, 120]\nedge_radius_mm = 21'
    p = problem(BALL.replace('shape = "sphere"\nradius_mm = 30', box))
    assert (p.key, p.line) == ("object.edge_radius_mm", 4)
    assert "write 20 or less" in p.remedy
    plate = BALL.replace('shape = "sphere"\nradius_mm = 30', 'shape = "plane"\nthickness_mm = 20')
    p = problem(plate)
    assert (p.key, p.found) == ("candidates.angles_deg", "90 degrees with two planes")
    assert parse_scene(plate, overrides=["candidates.angles_deg=[0]"]).object.thickness == 0.02


@pytest.mark.parametrize(
    ("override", "found", "remedy"),
    [
        ("radius_mm=40", "without its section", "write --set object.radius_mm=40"),
        ("gripper=1", "section gripper without a key", "gripper.key=value"),
        ("friction.mu", '"friction.mu"', "`=`"),
        ("friction..mu=a", '"friction..mu=a"', "`=`"),
        ("friction.mu=[1", '"friction.mu=[1"', "`=`"),
        ("friction.mu=1\n[x]", "friction.mu", "`=`"),
        ("object.radius_m=0.04", "unknown key", "`radius_mm = 40`"),
        ("object.radius=40", "unknown key", "write `radius_mm`"),
        ("gripper.sheet_thickness=0.3", "unknown key", "write `sheet_thickness_mm`"),
        ("object.radius_mm=O.3", '"O.3"', "a number > 0"),
        ("gripper.element=hex9", '"hex9"', 'did you mean "hex'),
        ("load.normal_force_n=[1, -1]", "-1", "> 0"),
    ],
)
def test_an_override_gets_the_same_sentences(override, found, remedy):
    p = problem(BALL, override)
    assert p.file == f"--set {override}"
    assert p.line is None
    assert found in p.found
    assert remedy in p.remedy


def test_overrides_replace_values_and_the_other_way_of_giving_stations():
    given = ["object.radius_mm=40", "gripper.material=linear", 'object.name="a ball"', "candidates.stations=3"]
    scene = parse_scene(BALL, overrides=[*given, "candidates.station_range_mm=[-9, 9]", "sweep.friction.mu=[0.5, 1]"])
    assert (scene.object.radius_mm, scene.gripper.material, scene.object.name) == (40, "linear", "a ball")
    assert scene.candidates.station_values_mm == (-9, 0, 9)
    assert scene.candidates.stations_mm is None
    assert scene.sweep == {"friction.mu": (0.5, 1.0)}


def test_values_are_in_si_units_and_lists_rise():
    scene = parse_scene(
        BOTTLE, overrides=["load.normal_force_n=[7, 2, 4]", "candidates.angles_deg=[90, 0]", "gripper.pad_width_mm=22"]
    )
    assert scene.load.normal_force == (2, 4, 7)
    assert scene.candidates.angles == (0, math.pi / 2)
    assert scene.gripper.pad_size == (0.05, 0.022, 0.015)
    assert scene.gripper.shear_modulus == 40e3
    assert scene.object.profile == ((0, 0.03), (0.05, 0.03), (0.1, 0.02), (0.15, 0.012))
    assert scene.object.extent == 0.15
    assert scene.score.object_length is None


def test_hyperfoam_fills_in_its_terms_and_its_modulus():
    one = parse_scene(BALL, overrides=["gripper.material=hyperfoam", "gripper.shear_modulus_kpa=30"])
    assert (one.gripper.alpha, one.gripper.shear_moduli) == ((-2,), (30e3,))
    two = parse_scene(
        BALL, overrides=["gripper.material=hyperfoam", "gripper.alpha=[8, -2]", "gripper.shear_moduli_kpa=[10, 20]"]
    )
    assert two.gripper.shear_modulus_kpa == 30
    p = problem(BALL, "gripper.material=hyperfoam", "gripper.shear_moduli_kpa=[10]", "gripper.shear_modulus_kpa=40")
    assert (p.key, p.found) == ("gripper.shear_modulus_kpa", "40 kPa")


@pytest.mark.parametrize(
    ("overrides", "word"),
    [
        (["friction.mu=5"], "friction.mu = 5"),
        (["load.normal_force_n=[500]"], "shear modulus"),
        (["gripper.material=linear", "gripper.poisson_ratio=0.49"], "hex27"),
    ],
)
def test_values_that_are_seldom_meant_are_allowed_with_a_warning(overrides, word):
    (warning,) = parse_scene(BALL, overrides=overrides).warnings
    assert word in warning
    assert not parse_scene(BALL).warnings


def test_combinations_of_a_sweep_that_make_no_scene_are_named():
    text = BALL.replace('shape = "sphere"\nradius_mm = 30', 'shape = "elliptic_cylinder"\nsemi_axis_a_mm = 20')
    text += '[sweep]\n"object.semi_axis_b_mm" = [20, 10]\n"object.length_mm" = [80, 3000]\n'
    (p,) = problems(text)
    assert p.key == 'sweep."object.length_mm"[1]'
    assert "3000 mm along z (value 2 of 2)" in p.found
    assert parse_scene(text.replace("3000", "60")).cases == 8  # 2 x 2 points of the sweep, 2 angles
    p = problem(BALL, "sweep.object.radius_mm=[10, 20]", "candidates.stations_mm=[15]", "object.radius_mm=20")
    assert p.found == "10 (value 1 of 2), with which candidates.stations_mm has 1 station off the object: 15 mm"


def test_too_many_cases_are_refused():
    many = (
        "candidates.stations=10000",
        "candidates.station_range_mm=[-30, 30]",
        "load.normal_force_n=" + str(list(range(1, 60))),
    )
    assert "1,180,000 cases" in problem(BALL, *many).found


@pytest.mark.parametrize(
    ("content", "found", "remedy"),
    [
        (None, "No such file", "did you mean"),
        (b"/", "Is a directory", "did you mean"),
        (b"\x89HDF\r\n\x1a\n\0\0", "binary data", "softjaw show"),
        (b"a\0b", "binary data", ".toml"),
        (b"# \xe4\n", "not UTF-8 in line 1", "UTF-8"),
        (b"#" * 1_000_002, "more than 1 MB", ".toml"),
        (b"a = 'b", "expected", "text in quotes"),
    ],
)
def test_a_file_that_is_no_scene_is_refused_with_the_reason(tmp_path, content, found, remedy):
    (tmp_path / "bottle.toml").write_text(BALL)
    path = tmp_path / "botle.toml"
    if content == b"/":
        path.mkdir()
    elif content is not None:
        path.write_bytes(content)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    (p,) = caught.value.problems
    assert p.file == str(path)
    assert found in p.found
    assert remedy in p.remedy


def test_a_mesh_is_looked_for_beside_the_scene_and_counts_by_its_bytes(tmp_path):
    mesh = 'shape = "mesh"\nmesh = "parts/x.stl"\nunit = "mm"'
    path = tmp_path / "m.toml"
    path.write_text(BALL.replace('shape = "sphere"\nradius_mm = 30', mesh))
    effective = tmp_path / "parts" / "x.stl"
    with pytest.raises(SceneError, match=r"no such file at .*parts/x\.stl, .*relative to the scene file"):
        load_scene(path)
    (tmp_path / "parts").mkdir()
    effective.touch()
    with pytest.raises(SceneError, match="an empty file at"):
        load_scene(path)
    effective.write_bytes(b"solid")
    scene = load_scene(path)
    assert scene.object.mesh == str(effective)
    other = tmp_path / "y.stl"
    other.write_bytes(b"solid")
    moved = load_scene(path, ["object.mesh=y.stl"])
    assert moved.digest == scene.digest
    other.write_bytes(b"other solid")
    assert moved.digest != scene.digest
    with pytest.raises(SceneError, match=r"a triangle mesh in a \.stl"):
        load_scene(path, ["object.mesh=m.toml"])
    effective.unlink()
    assert parse_scene(scene.effective_toml(), check_files=False) == scene


@pytest.mark.parametrize("path", JOBS, ids=[p.stem for p in JOBS])
def test_shipped_scenes_load_without_warnings_and_survive_being_written_out(path):
    scene = load_scene(path)
    assert not scene.warnings
    again = parse_scene(scene.effective_toml(), "elsewhere/again.toml")
    assert again == scene
    assert again.digest == scene.digest
    assert again.effective_toml() == scene.effective_toml()


def test_the_shipped_studies_have_the_sizes_they_promise():
    scenes = {p.stem: load_scene(p) for p in JOBS}
    assert scenes["smoke"].cases == 4
    assert scenes["bottle-rigid"].cases == 70 * 6
    a, ratios = scenes["fig4-curvature"].object.semi_axis_a_mm, scenes["fig4-curvature"].sweep["object.semi_axis_b_mm"]
    assert len(ratios) >= 9
    assert (ratios[0] / a, ratios[-1] / a) == (0.4, 2.5)


def test_qualities_of_the_curvature_study_are_scaled_by_the_same_lengths_for_every_ratio():
    scene = load_scene(ROOT / "jobs" / "fig4-curvature.toml")
    points = [scene.with_values({"object.semi_axis_b_mm": b}) for b in scene.sweep["object.semi_axis_b_mm"]]
    assert len({point.object.extent for point in points}) > 1  # what the default would take
    assert {(point.score.object_length, point.score.contact_length) for point in points} == {(0.12, 0.05)}


def test_the_digest_follows_results_only():
    digest = parse_scene(BALL).digest
    same = ["object.name=x", "output.file=x.hdf", "output.patches=none", "petsc.contact_snes_monitor=true",
            "run.time_limit_s=5", "run.memory_gb=none"]  # fmt: skip
    assert parse_scene(BALL, "other.toml", same).digest == digest
    spelled = parse_scene(BALL.replace("30", "30.0") + "# comment\n[friction]\nmu = 0.8\n")
    assert spelled.digest == digest
    for change in ("friction.mu=0.9", "petsc.contact_snes_max_it=9", "sweep.friction.mu=[0.8]", "candidates.roll_deg=1",
                   "accuracy.meshes=1", "score.torque_scale=object", "load.normal_force_n=[1, 2]"):  # fmt: skip
        assert parse_scene(BALL, overrides=[change]).digest != digest, change
    listed = parse_scene(BALL, overrides=["candidates.stations_mm=[0, 5, 10]"])
    spread = parse_scene(BALL, overrides=["candidates.stations=3", "candidates.station_range_mm=[0, 10]"])
    assert listed.digest == spread.digest


def test_texts_survive_being_written_out():
    name = 'a "b" \\ é 😀'
    scene = parse_scene(BALL).with_values({"object.name": name})
    assert parse_scene(scene.effective_toml()).object.name == name


def test_a_scene_is_frozen_and_holds_its_rules_in_python_too():
    scene = parse_scene(BALL)
    with pytest.raises(ValidationError):
        scene.friction.mu = 1.0
    assert len({hash(section) for section in (scene.object, scene.gripper, scene.candidates)}) == 3
    with pytest.raises(ValidationError, match=r"candidates\.stations_mm"):
        Scene.model_validate({**scene.effective(), "candidates": {"stations_mm": [99]}})
    with pytest.raises(SceneError, match=r"friction\.mu"):
        scene.with_values({"friction.mu": -1.0})
    assert scene.with_values({"friction.mu": 0.5}).friction.mu == 0.5


def test_the_schema_knows_every_key_and_its_range():
    schema = Scene.model_json_schema()
    json.dumps(schema)
    gripper = schema["$defs"]["Gripper"]["properties"]
    assert gripper["pad_length_mm"]["maximum"] == 500
    assert all("description" in p for d in schema["$defs"].values() for k, p in d["properties"].items() if k != "shape")
    assert set(schema["required"]) == {"object", "candidates", "load"}


def test_lines_are_found_in_all_ways_of_writing_toml():
    text = (
        'candidates.stations_mm = [ # [not] = "this"\n 0, # }\n  "x" ]\nload = { normal_force_n = [1,\n 2, 0] }\n'
        '[object]\nname = """[a]\nb = 1"""\nshape = \'sphere\'\n"radius_mm" = 0\n'
        "[[candidates.poses]]\n[petsc]\ncontact_a.b = 1\n"
    )
    lines = {p.key: p.line for p in problems(text)}
    assert lines["candidates.stations_mm[1]"] == 3
    assert lines["load.normal_force_n[2]"] == 5
    assert lines["object.radius_mm"] == 10
    assert lines["candidates.poses[0].approach"] == 11
    assert lines["petsc.contact_a"] == 13


def test_checking_a_scene_starts_no_heavy_machinery():
    code = (
        "import sys; from softjaw.study.scene import load_scene, Scene; load_scene(sys.argv[1]);"
        "Scene.model_json_schema();"
        "heavy = {'numpy', 'scipy', 'numba', 'mpi4py', 'petsc4py', 'h5py', 'pyvista', 'skfem', 'matplotlib'};"
        "sys.exit(' '.join(heavy & set(sys.modules)) or 0)"
    )
    done = subprocess.run([sys.executable, "-c", code, JOBS[0]], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")


def test_meshes_come_in_the_units_that_lengths_come_in():
    assert get_args(Mesh.model_fields["unit"].annotation) == tuple(LENGTHS)
    for name, (times, over) in LENGTHS.items():
        mesh = Mesh(shape="mesh", mesh="a.stl", unit=name)
        assert mesh.unit_length == times / over == in_si(f"a_{name}", 1.0)


def test_a_forced_limit_surface_and_the_model_are_one_choice():
    for level, model in (("three_motions", "three_motions"), ("fitted_ellipsoid", "full"), ("quartic", "quartic")):
        scene = parse_scene(BALL, "ball.toml", [f"effects.limit_surface={level}"])
        assert scene.limit_surface.model == model
        assert parse_scene(scene.effective_toml()) == scene
    assert parse_scene(BALL).limit_surface.model == "quartic"


def test_candidates_whose_wrenches_are_stored_go_by_number_or_label():
    wanted = {"'none'": (), "'all'": (0, 1), "[1]": (1,), "['0 mm, 90 deg', 0, 1]": (0, 1), "['0 mm, 0 deg']": (0,)}
    for text, numbers in wanted.items():
        assert parse_scene(BALL, "ball.toml", [f"limit_surface.wrench_samples={text}"]).sampled == numbers


def test_a_mass_is_given_in_grams_and_the_centre_of_mass_in_mm():
    scene = parse_scene(BALL, "ball.toml", ["object.mass_g=250", "task.centre_of_mass_mm=[0, 0, 5]"])
    assert scene.object.mass == 0.25
    assert scene.task.centre_of_mass == (0.0, 0.0, 0.005)
    assert parse_scene(BALL).task.centre_of_mass is None


def test_a_scene_from_tables_is_that_of_a_file_and_takes_numpy(tmp_path):
    ball = {"shape": "sphere", "radius_mm": np.float64(30)}
    made = Scene.from_dict({
        "object": ball, "candidates": {"stations_mm": np.array([0, 10])}, "load": {"normal_force_n": [np.int64(1), 2]},
        "sweep": {"friction": {"mu": [0.5, 0.8]}}, "output": {"file": "results/scene.hdf"},
    })  # fmt: skip
    file = tmp_path / "ball.toml"
    file.write_text(made.effective_toml())
    assert Scene.load(file) == made == load_scene(str(file))
    assert Scene.load(file, ["object.radius_mm=20"]).object.radius == 0.02
    assert made.with_values(**{"gripper.elements": np.array([8, 4, 2])}).gripper.elements == (8, 4, 2)
    assert type(made.load.normal_force[0]) is float  # the section, not the function of the class


@pytest.mark.parametrize("tables", [5, {5: {}}, {"object": {5: 1}}])
def test_tables_that_are_none_are_refused(tables):
    with pytest.raises(TypeError, match="expected a mapping of sections"):
        Scene.from_dict(tables)


def test_what_is_wrong_with_tables_is_named_by_its_key():
    with pytest.raises(SceneError) as refused:
        Scene.from_dict({"object": {"shape": "mesh", "mesh": "none.stl", "unit": "mm"}, "load": 5})
    assert [p.key for p in refused.value.problems] == ["candidates", "load", "object.mesh"]
