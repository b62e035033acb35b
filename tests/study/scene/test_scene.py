"""Scenes: what is accepted, and for everything that is not its place, its key and the value that was found."""

import json
import math

import numpy as np
import pytest
from pydantic import ValidationError

from softjaw.study.scene import Scene, SceneError, load_scene, parse_scene
from softjaw.study.scene.objects import SHAPES
from tests.study.launching import ROOT, launch
from tests.study.scenes import text_of

JOBS = sorted((ROOT / "jobs").glob("*.toml"))
SPHERE = 'shape = "sphere"\nradius_mm = 30'
BALL = f"[object]\n{SPHERE}\n\n[candidates]\nstations_mm = [0]\n\n[load]\nnormal_force_n = [1]\n"
OUTLINE = "profile_mm = [\n  [0, 30], [50, 30],\n  [100, 20],\n  [150, 12],\n]"
POSES = "poses=[{point_mm = [0, 0, 0], approach = [1, 0, 0], long_side = [0, 0, 1]}]"
BOTTLE = BALL.replace(SPHERE, f'shape = "revolution"\n{OUTLINE}')


def body(text):
    return BALL.replace(SPHERE, text)


def problems(text, *overrides, path="ball.toml"):
    with pytest.raises(SceneError) as caught:
        parse_scene(text, path, overrides)
    return caught.value.problems


def problem(text, *overrides):
    (only,) = problems(text, *overrides)
    return only


# Lines below a scene of 10 lines: the line and key that are named, the value found, and what the remedy names.
WRONG_LINES = [
    ("[gripper]\npad_lenght_mm = 5", 12, "gripper.pad_lenght_mm", "an unknown key", "`pad_length_mm`"),
    ("[gripper]\nmu = 0.5", 12, "gripper.mu", "an unknown key", "[friction]"),
    ("[gripper]\nblue = 1", 12, "gripper.blue", "an unknown key", "pad_length_mm, pad_width_mm"),
    ("[grippers]\na = 1", 11, "grippers", "an unknown key", "[gripper]"),
    ("[gripper]\nmaterial = 'foam'", 12, "gripper.material", '"foam"', '"hyperfoam"'),
    ("[effects]\nwrench = '6D'", 12, "effects.wrench", '"6D"', '"6-D"'),
    ("[gripper]\npad_width_mm = '22 mm'", 12, "gripper.pad_width_mm", '"22 mm"', "`pad_width_mm = 22.0`"),
    ("[gripper]\npad_width_mm = 0.022", 12, "gripper.pad_width_mm", "0.022", "[mm]"),
    ("[gripper]\nelements = [20, 10]", 12, "gripper.elements", "[20, 10]", "[20, 10, 6]"),
    ("[gripper]\nelements = [20, 10, 1]", 12, "gripper.elements[2]", "1", "[20, 10, 6]"),
    ("[gripper]\nelements = [21, 10, 6]", 12, "gripper.elements", "[21, 10, 6]", ""),
    ("[gripper]\nelements = [400, 400, 400]", 12, "gripper.elements", "[400, 400, 400]", ""),
    ("[gripper]\npoisson_ratio = 0.3", 12, "gripper.poisson_ratio", "0.3", ""),
    ("[gripper]\nmaterial = 'linear'\npoisson_ratio = 0.5", 13, "gripper.poisson_ratio", "0.5", "0.25"),
    ("[gripper]\nterms_kpa = [[-2, 40]]", 12, "gripper.terms_kpa", "[[-2.0, 40.0]]", ""),
    ("[gripper]\nmaterial = 'hyperfoam'\nterms_kpa = [[1e-6, 40]]", 13, "gripper.terms_kpa", "[[1e-06, 40.0]]", ""),
    ("[gripper]\nmaterial = 'hyperfoam'\nterms_kpa = [[2, -40]]", 13, "gripper.terms_kpa", "[[2.0, -40.0]]", ""),
    ("[gripper]\nelements = [15, 10, 6]\ngrading = [2, 1, 1]\n[effects]\nmodel_size = 'full'", 13, "gripper.grading[0]",
     "2.0", ""),
    ("[gripper]\nfinger_size_mm = [40, 22]", 12, "gripper.finger_size_mm", "[40.0, 22.0]", ""),
    ("[gripper]\npreset = 'four_fingers'", 12, "gripper.preset", '"four_fingers"', ""),
    ("[gripper]\npreset = 'robotiq_2f85'", 9, "load.normal_force_n", "1", ""),
    ("[friction]\nmu = -0.1", 12, "friction.mu", "-0.1", "`mu = 0.8`"),
    ("[friction]\nused_by_pressing = true", 12, "friction.used_by_pressing", "true", ""),
    ("[effects]\nobject = 'linear_shell'", 12, "effects.object", '"linear_shell"', ""),
    ("[gripper]\ntilt_stiffness_nm_per_rad = 1\n[effects]\nsheet = 'elastic'", 12, "gripper.tilt_stiffness_nm_per_rad",
     "1.0", ""),
    ("[task]\nweight_direction = [0, 0, 0]", 12, "task.weight_direction", "[0, 0, 0]", ""),
    ("[task]\ndrive = 'fixed'", 11, "task.weight_direction", '"worst"', ""),
    ("[petsc]\nsnes_max_it = 9", 12, "petsc.snes_max_it", "9", ""),
    ("[petsc]\ncontact_snes_view = 'ascii:/tmp/a'", 12, "petsc.contact_snes_view", '"ascii:/tmp/a"', ""),
    ("[petsc]\ncontact_pc_python_type = 'a.b'", 12, "petsc.contact_pc_python_type", '"a.b"', ""),
    ("[sweep]\n'limit_surface.samples' = [60, 80]", 12, 'sweep."limit_surface.samples"', "[60, 80]", ""),
    ("[sweep]\n'load.normal_force_n' = [[1], [2]]", 12, 'sweep."load.normal_force_n"', "[[1], [2]]", ""),
    ("[sweep]\n'candidates.stations_mm' = [[0], [5]]", 12, 'sweep."candidates.stations_mm"', "[[0], [5]]", ""),
    ("[sweep]\n'candidates.angles_deg' = [[0], [90]]", 12, 'sweep."candidates.angles_deg"', "[[0], [90]]", ""),
    ("[sweep]\n'candidates.refine' = [1, 2]", 12, 'sweep."candidates.refine"', "[1, 2]", ""),
    ("[sweep]\n'gripper.element' = ['hex8', 'hex27']", 12, 'sweep."gripper.element"', '["hex8", "hex27"]', ""),
    ("[sweep]\n'friction.my' = [1, 2]", 12, 'sweep."friction.my"', '"friction.my"', ""),
    ("[sweep]\n'friction.mu' = 1", 12, 'sweep."friction.mu"', "1", ""),
    ("[sweep]\n'friction.mu' = [1, 1]", 12, 'sweep."friction.mu"', "[1, 1]", ""),
    ("[sweep]\nfriction.mu = [1, -2]", 12, 'sweep."friction.mu"[1]', "-2", ""),
    ("[sweep]\nobject.radius_mm = [30, 0.1]", 12, 'sweep."object.radius_mm"[1]', "0.1", ""),
]  # fmt: skip


@pytest.mark.parametrize("row", WRONG_LINES, ids=[row[0] for row in WRONG_LINES])
def test_a_wrong_line_is_named_with_its_key_value_and_remedy(row):
    lines, line, key, found, remedy = row
    p = problem(f"{BALL}\n{lines}\n")
    assert (p.file, p.line, p.key, p.value) == ("ball.toml", line, key, found)
    assert p.expected
    assert remedy in p.remedy
    assert str(p).startswith(f"ball.toml:{line}: {key}: found {found}, expected {p.expected}")


def posed(approach, more):
    return "stations_mm = [0]", f"[[candidates.poses]]\npoint_mm = [0, 0, 0]\napproach = {approach}\n{more}"


# What is put in place of what; the line and key that are named, and the value found.
WRONG_VALUES = [
    ("radius_mm = 30", "", 1, "object.radius_mm", "nothing"),
    ("radius_mm = 30", "radius_mm = 0.03", 3, "object.radius_mm", "0.03"),
    ('"sphere"', '"spher"', 2, "object.shape", '"spher"'), ('shape = "sphere"', "", 1, "object.shape", "nothing"),
    ("[0]", "[-30, 30.5]", 6, "candidates.stations_mm", "[30.5]"),
    ("[0]", "[0, 0]", 6, "candidates.stations_mm", "[0, 0]"), ("[0]", "'top'", 6, "candidates.stations_mm", '"top"'),
    ("stations_mm = [0]", "", 5, "candidates", "[]"),
    ("stations_mm = [0]", "stations = [0, 1]", 6, "candidates.stations", "[0, 1]"),
    ("stations_mm = [0]", "stations = 3", 6, "candidates.stations", "3"),
    ("[0]", "[0, 5, 9]\nstations = 3", 6, "candidates.stations_mm", "[0.0, 5.0, 9.0]"),
    ("[0]", "[0]\nsampled = 3", 7, "candidates.sampled", '["stations_mm", "sampled"]'),
    ("[1]", "[41]\n[gripper]\npreset = 'wsg50'", 9, "load.normal_force_n", "41"),
    ("stations_mm = [0]", "sampled = 3\nangles_deg = [0]", 7, "candidates.angles_deg", "[0.0]"),
    ("= 30", "= 30\nmass_g = 5\ndensity = 1000", 5, "object.density", "1000.0"),
    ("[0]", "[0]\nangles_deg = [0, 400]", 7, "candidates.angles_deg[1]", "400"),
    (*posed("[0, 0, 0]", "long_side = [0, 0, 1]"), 8, "candidates.poses[0].approach", "[0, 0, 0]"),
    (*posed("[1, 0, 0]", "long_side = [-2, 0.1, 0]"), 9, "candidates.poses[0].long_side", "[-2.0, 0.1, 0.0]"),
    (*posed("[1, 0, 0]", ""), 6, "candidates.poses[0].long_side", "nothing"),
    ("[1]", "[1, -2]", 9, "load.normal_force_n[1]", "-2"), ("[1]", "['5 N']", 9, "load.normal_force_n[0]", '"5 N"'),
]  # fmt: skip


@pytest.mark.parametrize("row", WRONG_VALUES)
def test_a_wrong_value_is_named_with_its_line_and_key(row):
    old, new, line, key, found = row
    p = problem(BALL.replace(old, new, 1))
    assert (p.line, p.key, p.value) == (line, key, found)


NO_TOML = [
    ("= 30", "= 30,5", 3), ("= 30", "= thirty", 3), ("= 30", "= 30\nradius_mm = 40", 4), ("[load]", "[object]", 8),
    ("[load]", "[load", 8), ("= 30", "= " + "[" * 3000, None),
]  # fmt: skip


@pytest.mark.parametrize(("text", "line", "key"), [
    *((BALL.replace(old, new, 1), line, "") for old, new, line in NO_TOML),
    (BOTTLE.replace("[100, 20]", "[40, 20]"), 3, "object.profile_mm[2]"),
    (BOTTLE.replace("[100, 20]", "[50, 30]"), 3, "object.profile_mm[2]"),
    (BOTTLE.replace("[100, 20]", "[100, 0]"), 3, "object.profile_mm[2]"),
    (BOTTLE.replace("[150, 12]", "[150, -1]"), 3, "object.profile_mm[3]"),
    (BOTTLE.replace("[100, 20]", "[100, 20, 1]"), 3, "object.profile_mm[2]"),
    (BOTTLE.replace("  [100, 20],\n", ""), 3, "object.profile_mm"),
    (BOTTLE.replace("[150, 12],\n]", "[150, 12],\n]\nwall_mm = 9"), 8, "object.wall_mm"),
    (BOTTLE.replace("[150, 12],\n]", "[150, 12],\n]\nbase_wall_mm = 1"), 8, "object.base_wall_mm"),
    (BOTTLE.replace("[150, 12],\n]", "[150, 12],\n]\nwall_mm = 1\nbase_wall_mm = 30"), 9, "object.base_wall_mm"),
    (BOTTLE.replace("[150, 12],\n]", "[150, 12],\n]\nwall_mm = 1\nwall_material = 'custom'"), 9,
     "object.wall_material"),
    (body('shape = "box"\nsize_mm = [60, 40, 120]\nedge_radius_mm = 21'), 4, "object.edge_radius_mm"),
    (body('shape = "plane"\nthickness_mm = 20'), 5, "candidates.angles_deg"),
    (BALL.replace("stations_mm = [0]", "angles_deg = [0, 30]\n[[candidates.poses]]\npoint_mm = [0, 0, 0]\n"
                  "approach = [1, 0, 0]\nlong_side = [0, 0, 1]"), 6, "candidates.angles_deg"),
])  # fmt: skip
def test_what_is_no_toml_or_makes_no_body_is_named_by_its_line_and_key(text, line, key):
    p = problem(text)
    assert (p.key, p.line) == (key, line)


def test_every_problem_is_found_at_once_and_in_the_order_of_the_file():
    text = (
        BALL.replace("30", '"30"').replace("[0]", "[0, true]").replace("[1]", "[-1]")
        + "[gripper]\nx = 1\npad_width_mm = 0\n[effects]\nobject = 'linear_shell'\n[run]\ntime_limit_s = 0\n"
    )
    listed = problems(text, "friction.mu=-1", "fricton.mu=1")
    assert [p.line for p in listed] == [3, 6, 9, 11, 12, 16, None, None]
    assert {p.file for p in listed[-2:]} == {"--set fricton.mu=1", "--set friction.mu=-1"}
    text = BALL + "[effects]\nobject = 'linear_shell'\n[friction]\nmu = -1\n[petsc]\nfoo = 1\n"
    assert [p.key for p in problems(text)] == ["effects.object", "friction.mu", "petsc.foo"]


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_without_dimensions_lists_all_that_it_needs(shape):
    required = [f"object.{key}" for key, field in SHAPES[shape].model_fields.items() if field.is_required()]
    text = BALL.replace("sphere", shape).replace("radius_mm = 30\n", "")
    assert sorted(p.key for p in problems(text)) == sorted(set(required) - {"object.shape"})


@pytest.mark.parametrize(("override", "key", "found"), [
    ("radius_mm=40", "radius_mm", "an unknown key"), ("gripper=1", "gripper", "1"),
    ("friction.mu", "", '"friction.mu"'), ("friction..mu=a", "", '"friction..mu=a"'),
    ("friction.mu=[1", "", '"friction.mu=[1"'), ("object.radius_m=0.04", "object.radius_m", "an unknown key"),
    ("object.radius_mm=O.3", "object.radius_mm", '"O.3"'), ("gripper.element=hex9", "gripper.element", '"hex9"'),
    ("load.normal_force_n=[1, -1]", "load.normal_force_n[1]", "-1"),
    ("sweep.friction.mu=[1, -1]", 'sweep."friction.mu"[1]', "-1"),
])  # fmt: skip
def test_an_override_is_named_as_a_line_is(override, key, found):
    p = problem(BALL, override)
    assert (p.file, p.line, p.key, p.value) == (f"--set {override}", None, key, found)
    assert problem(BALL, "friction.mu=1\n[x]").line is None  # which a terminal would obey


def test_overrides_replace_values_which_are_in_si_units_and_hyperfoam_fills_in_its_terms():
    given = ["object.radius_mm=40", "gripper.material=linear", 'object.name="a ball"', "candidates.stations=3"]
    scene = parse_scene(BALL, overrides=[*given, "candidates.stations_mm=[-9, 9]", "sweep.friction.mu=[0.5, 1]"])
    assert (scene.object.radius_mm, scene.gripper.material, scene.object.name) == (40, "linear", "a ball")
    assert scene.candidates.station_values_mm == (-9, 0, 9)
    assert scene.sweep == {"friction.mu": (0.5, 1.0)}
    turned = BALL.replace("stations_mm = [0]", "stations_mm = [0]\nangles_deg = [0, 45]")
    for way, kept in (("sampled=5", ()), (POSES, ()), ("stations_mm=[1]", (0, 45))):
        scene = parse_scene(turned, overrides=[f"candidates.{way}"])
        assert scene.candidates.station_values_mm == ((1,) if kept else ())
        assert scene.candidates.angles_deg == (kept or (0, 90))
    assert problem(turned, "candidates.sampled=5", "candidates.angles_deg=[0, 45]").key == "candidates.angles_deg"
    given = ["load.normal_force_n=[7, 2, 4]", "candidates.angles_deg=[90, 0]", "gripper.pad_width_mm=22"]
    scene = parse_scene(BOTTLE, overrides=given)
    assert scene.load.normal_force == (2, 4, 7)
    assert scene.candidates.angles == (0, math.pi / 2)
    assert scene.gripper.pad_size == (0.05, 0.022, 0.015)
    assert scene.gripper.shear_modulus == 40e3
    assert scene.object.profile == ((0, 0.03), (0.05, 0.03), (0.1, 0.02), (0.15, 0.012))
    assert scene.score.object_length_mm == "per_axis"
    assert parse_scene(body('shape = "plane"\nthickness_mm = 20'), overrides=["candidates.angles_deg=[0]"])
    massive = parse_scene(BALL, "ball.toml", ["object.mass_g=250", "task.centre_of_mass_mm=[0, 0, 5]"])
    assert (massive.object.mass, massive.task.centre_of_mass) == (0.25, (0.0, 0.0, 0.005))
    one = parse_scene(BALL, overrides=["gripper.material=hyperfoam", "gripper.shear_modulus_kpa=30"])
    assert one.gripper.hyperfoam_terms == ((-2,), (30e3,))
    two = parse_scene(BALL, overrides=["gripper.material=hyperfoam", "gripper.terms_kpa=[[8, 10], [-2, 20]]"])
    assert two.gripper.shear_modulus_kpa == 30
    softer = two.with_values(gripper={"shear_modulus_kpa": 15})
    assert softer.digest == two.with_values(**{"gripper.shear_modulus_kpa": 15}).digest
    with pytest.raises(SceneError, match="gripper: found 15"):
        two.with_values(gripper=15)
    assert softer.gripper.hyperfoam_terms == ((8, -2), (5e3, 10e3))
    other = softer.with_values(**{"gripper.terms_kpa": [[4, 20]]})
    assert (other.gripper.hyperfoam_terms, other.gripper.shear_modulus_kpa) == (((4,), (20e3,)), 20)
    assert other.with_values(**{"gripper.material": "blatz_ko"}).gripper.terms_kpa == ()
    assert scene.with_values(**{"gripper.material": "hyperfoam"}).gripper.hyperfoam_terms == ((-2,), (40e3,))
    assert parse_scene(BALL, overrides=["sweep.gripper.material=['linear', 'hyperfoam']"]).sweep
    assert scene.with_values(**{"gripper.shear_modulus_kpa": None}).gripper.shear_modulus_kpa == 40
    p = problem(BALL, "gripper.material=hyperfoam", "gripper.terms_kpa=[[-2, 10]]", "gripper.shear_modulus_kpa=40")
    assert (p.key, p.value) == ("gripper.shear_modulus_kpa", "40.0")


@pytest.mark.parametrize("overrides", [
    ["friction.mu=5"], ["load.normal_force_n=[500]"], ["gripper.material=linear", "gripper.poisson_ratio=0.49"],
    ["gripper.shear_modulus_kpa=40000"], ["gripper.tilt_stiffness_nm_per_rad=1", "gripper.sheet_thickness_mm=0.3"],
])  # fmt: skip
def test_values_that_are_seldom_meant_are_allowed_with_a_warning(overrides):
    assert len(parse_scene(BALL, overrides=overrides).warnings) == 1
    assert not parse_scene(BALL).warnings


def test_a_wall_whose_thickness_is_given_for_other_heights_gets_a_warning():
    for ends, warned in (((0, 0.15), True), ((900, 901), True), ((8, 140), False)):
        pairs = [[z, 0.4] for z in ends]
        text = BOTTLE.replace("[150, 12],\n]", f"[150, 12],\n]\nwall_mm = {pairs}")
        assert any("object.wall_mm" in line for line in parse_scene(text).warnings) == warned


def test_combinations_of_a_sweep_that_make_no_scene_are_named_and_too_many_refused():
    text = body('shape = "elliptic_cylinder"\nsemi_axis_a_mm = 20')
    text += '[sweep]\n"object.semi_axis_b_mm" = [20, 10]\n"object.length_mm" = [80, 3000]\n'
    p = problem(text)
    assert (p.key, p.value) == ('sweep."object.length_mm"[1]', "3000")
    assert parse_scene(text.replace("3000", "60")).cases == 8  # 2 x 2 points of the sweep, 2 angles
    p = problem(BALL, "sweep.object.radius_mm=[10, 20]", "candidates.stations_mm=[15]", "object.radius_mm=20")
    assert (p.key, p.value) == ('sweep."object.radius_mm"[0]', "10")
    # Each value fits the scene alone; together they make elements of 0.2 x 5 mm.
    p = problem(BALL, "sweep.gripper.pad_width_mm=[22, 2]", "sweep.gripper.pad_thickness_mm=[15, 30]")
    assert (p.key, p.value) == ("sweep", '"gripper.pad_width_mm = 2, gripper.pad_thickness_mm = 30"')
    # a section that is not there is one of defaults, and terms of a foam scale with its modulus
    loads = "sweep.task.drive=['shared', 'fixed']", "sweep.task.weight_direction=[[0, 0, -1], [1, 0, 0]]"
    assert parse_scene(BALL, "x.toml", loads).cases == 4 * parse_scene(BALL).cases
    foam = "gripper.material='hyperfoam'", "gripper.terms_kpa=[[8, 30], [-2, 10]]"
    swept = parse_scene(BALL, "x.toml", [*foam, "sweep.gripper.shear_modulus_kpa=[20]"])
    assert swept.at(swept.points[0]).gripper.terms_kpa == ((8.0, 15.0), (-2.0, 5.0))
    many = "candidates.stations=10000", "candidates.stations_mm=[-30, 30]", f"load.normal_force_n={[*range(1, 60)]}"
    assert problem(BALL, *many).value == "1180000"
    swept = [f"sweep.friction.mu={[i / 100 for i in range(101)]}", f"sweep.gripper.pad_width_mm={list(range(15, 115))}"]
    assert problem(BALL, *swept).value == "10100"


@pytest.mark.parametrize(
    "content", [None, b"/", b"\x89HDF\r\n\x1a\n\0\0", b"a\0b", b"# \xe4\n", b"#" * 1_000_002, b"a = 'b"]
)
def test_a_file_that_is_no_scene_is_refused(tmp_path, content):
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
    assert ("bottle.toml" in p.remedy) == (content in (None, b"/"))


def test_a_mesh_is_looked_for_beside_the_scene_and_counts_by_its_bytes(tmp_path):
    path = tmp_path / "m.toml"
    path.write_text(body('shape = "mesh"\nmesh = "parts/x.stl"\nunit = "mm"'))
    effective = tmp_path / "parts" / "x.stl"
    for prepare in (lambda: None, effective.parent.mkdir, effective.touch):
        prepare()
        with pytest.raises(SceneError) as refused:
            load_scene(path)
        assert [p.key for p in refused.value.problems] == ["object.mesh"]
    effective.write_bytes(b"solid")
    scene = load_scene(path)
    assert scene.object.mesh == str(effective)
    other = tmp_path / "y.stl"
    other.write_bytes(b"solid")
    moved = load_scene(path, ["object.mesh=y.stl"])
    assert moved.digest == scene.digest
    other.write_bytes(b"other solid")
    assert moved.digest != scene.digest
    with pytest.raises(SceneError, match=r"object\.mesh"):
        load_scene(path, ["object.mesh=m.toml"])
    effective.unlink()
    assert parse_scene(scene.effective_toml(), check_files=False).effective() == scene.effective()


@pytest.mark.parametrize("path", JOBS, ids=[p.stem for p in JOBS])
def test_shipped_scenes_load_without_warnings_and_survive_being_written_out(path):
    scene = load_scene(path)
    assert not scene.warnings
    again = parse_scene(scene.effective_toml(), "elsewhere/again.toml")
    assert again == scene
    assert again.digest == scene.digest
    assert again.effective_toml() == scene.effective_toml()


def test_the_digest_follows_results_only_rules_hold_in_python_and_the_schema_knows_every_key():
    digest = parse_scene(BALL).digest
    same = ["object.name=x", "run.patches=none", "petsc.contact_snes_monitor=true",
            "run.time_limit_s=5", "run.memory_gb=none"]  # fmt: skip
    assert parse_scene(BALL, "other.toml", same).digest == digest
    spelled = parse_scene(BALL.replace("30", "30.0") + "# comment\n[friction]\nmu = 0.8\n")
    assert spelled.digest == digest
    for change in ("friction.mu=0.9", "petsc.contact_snes_max_it=9", "sweep.friction.mu=[0.8]", "candidates.roll_deg=1",
                   "accuracy.meshes=1", "score.contact_length_mm=object", "load.normal_force_n=[1, 2]"):  # fmt: skip
        assert parse_scene(BALL, overrides=[change]).digest != digest, change
    listed = parse_scene(BALL, overrides=["candidates.stations_mm=[0, 5, 10]"])
    spread = parse_scene(BALL, overrides=["candidates.stations=3", "candidates.stations_mm=[0, 10]"])
    assert listed.digest == spread.digest
    name = 'a "b" \\ é 😀'
    scene = parse_scene(BALL).with_values({"object.name": name})
    assert parse_scene(scene.effective_toml()).object.name == name
    scene = parse_scene(BALL)
    with pytest.raises(ValidationError):
        scene.friction.mu = 1.0
    assert len({hash(section) for section in (scene.object, scene.gripper, scene.candidates)}) == 3
    with pytest.raises(ValidationError) as refused:
        Scene.model_validate({**scene.effective(), "candidates": {"stations_mm": [99]}})
    assert [error["loc"] for error in refused.value.errors()] == [("candidates", "stations_mm")]
    with pytest.raises(SceneError, match=r"friction\.mu"):
        scene.with_values({"friction.mu": -1.0})
    assert scene.with_values({"friction.mu": 0.5}).friction.mu == 0.5
    schema = Scene.model_json_schema()
    json.dumps(schema)
    assert schema["$defs"]["Gripper"]["properties"]["pad_length_mm"]["maximum"] == 500
    assert all("description" in p for d in schema["$defs"].values() for k, p in d["properties"].items() if k != "shape")
    assert set(schema["required"]) == {"object", "candidates", "load"}
    text = (
        'candidates.stations_mm = [ # [not] = "this"\n 0, # }\n  "x" ]\nload = { normal_force_n = [1,\n 2, 0] }\n'
        "[object]\nshape = 'sphere'\n\"radius_mm\" = 0\n"
        "[[candidates.poses]]\n[petsc]\ncontact_a.b = 1\n"
    )
    lines = {p.key: p.line for p in problems(text)}
    assert lines["candidates.stations_mm[1]"] == 1
    assert lines["load.normal_force_n[2]"] == 4
    assert lines["object.radius_mm"] == 8
    assert lines["candidates.poses[0].approach"] == 9
    assert lines["petsc.contact_a"] == 11


def test_a_scene_starts_no_heavy_machinery_is_that_of_tables_and_what_is_wrong_is_named_by_its_key(tmp_path):
    code = (
        "import sys; from softjaw.study.scene import load_scene, Scene; load_scene(sys.argv[1]);"
        "Scene.model_json_schema();"
        "heavy = {'numpy', 'scipy', 'numba', 'mpi4py', 'petsc4py', 'h5py', 'pyvista', 'skfem', 'matplotlib'};"
        "sys.exit(' '.join(heavy & set(sys.modules)) or 0)"
    )
    assert launch(0, "-c", code, JOBS[0]) == (0, "", "")
    ball = {"shape": "sphere", "radius_mm": np.float64(30)}
    made = Scene.from_dict({
        "object": ball, "candidates": {"stations_mm": np.array([0, 10])}, "load": {"normal_force_n": [np.int64(1), 2]},
        "sweep": {"friction": {"mu": [0.5, 0.8]}},
    })  # fmt: skip
    file = tmp_path / "ball.toml"
    file.write_text(made.effective_toml())
    assert Scene.from_file(file) == made == load_scene(str(file))
    for overrides in (["object.radius_mm=20"], "object.radius_mm=20"):
        assert Scene.from_file(file, overrides).object.radius == 0.02
    assert made.with_values(**{"gripper.elements": np.array([8, 4, 2])}).gripper.elements == (8, 4, 2)
    with pytest.raises(SceneError) as refused:
        Scene.from_dict({"object": {"shape": "mesh", "mesh": "none.stl", "unit": "mm"}, "load": 5})
    assert {p.key for p in refused.value.problems} == {"candidates", "load", "object.mesh"}
    for tables in (5, {5: {}}):
        with pytest.raises(TypeError):
            Scene.from_dict(tables)


def test_a_table_on_the_command_line_takes_the_place_of_another_and_a_key_of_one_is_put_in():
    text = text_of('shape = "sphere"\nradius_mm = 30') + '[sweep]\n"gripper.shear_modulus_kpa" = [30, 40]\n'
    text += "[uncertainty]\n"
    text += 'spread = { "friction.mu" = 0.1, "candidates.roll_deg" = 1 }\n'
    cases = {
        'sweep={"gripper.pad_width_mm"=[20, 22]}': (["gripper.pad_width_mm"], 2),
        "sweep.gripper.pad_width_mm=[20, 22]": (["gripper.shear_modulus_kpa", "gripper.pad_width_mm"], 2),
        'uncertainty.spread={"friction.mu"=0.05}': (["gripper.shear_modulus_kpa"], 1),
        'uncertainty.spread."friction.mu"=0.05': (["gripper.shear_modulus_kpa"], 2),
    }
    for override, (swept, uncertain) in cases.items():
        scene = parse_scene(text, overrides=[override])
        assert (list(scene.sweep), len(scene.uncertainty.spread)) == (swept, uncertain), override
