"""Files for planners: every field of their documentation with its type, and poses that put the pads where they were."""

import csv
import io
import json
import re

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softjaw.study.cli import main
from softjaw.study.cli.exporting import DATA_SETS, PLANNERS, SIMULATORS, TABLES
from softjaw.study.cli.options import FORMATS
from softjaw.study.export.planners import CLOSING, as_graspgen, flow
from softjaw.study.export.selection import GripperFrame, grasps
from softjaw.study.flags import Flag
from softjaw.study.grippers import APPROACHES, Hand
from softjaw.study.messages import USAGE
from tests.study.export.grasp_results import RADIUS, STATIONS, geometry, opened, write

FOAM = 0.015  # thickness of a pad [m]
LOST = 1  # the station whose grasps slip

# isaac_grasp, format version 1.0: the fields of a grasp, and those of the file that Isaac Sim and Isaac ROS name.
ISAAC_FILE = {"format", "format_version", "object_frame", "gripper_frame", "object_frame_link", "gripper_frame_link",
              "grasps"}  # fmt: skip
ISAAC = {"confidence", "position", "orientation", "cspace_position", "pregrasp_cspace_position"}
# moveit_msgs/Grasp and what it is made of, field by field, as the .msg files of ROS 2 have them.
STAMP = {"sec": int, "nanosec": int}
HEADER = {"stamp": STAMP, "frame_id": str}
WAY = {"direction": {"header": HEADER, "vector": dict.fromkeys("xyz", float)}, "desired_distance": float,
       "min_distance": float}  # fmt: skip
POINT = {"positions": [float], "velocities": [float], "accelerations": [float], "effort": [float],
         "time_from_start": STAMP}  # fmt: skip
POSTURE = {"header": HEADER, "joint_names": [str], "points": [POINT]}
POSE = {"position": dict.fromkeys("xyz", float), "orientation": dict.fromkeys("xyzw", float)}
MOVEIT = {
    "id": str, "pre_grasp_posture": POSTURE, "grasp_posture": POSTURE, "grasp_pose": {"header": HEADER, "pose": POSE},
    "grasp_quality": float, "pre_grasp_approach": WAY, "post_grasp_retreat": WAY, "post_place_retreat": WAY,
    "max_contact_force": float, "allowed_touch_objects": [str],
}  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    flags = np.zeros((5, 1, 3))
    flags[LOST] = Flag.SLIPS
    flags[3] = Flag.COARSE
    return write(tmp_path_factory.mktemp("planners") / "grasps.hdf", **{"flags/flags": flags})


@pytest.fixture(autouse=True)
def read_once(path, monkeypatch):
    """No command reads the file again."""
    monkeypatch.setattr("softjaw.study.cli.exporting.open", lambda _: opened(path))


@pytest.fixture
def said(path, capsys):
    def say(*words):
        assert main(["export", str(path), *map(str, words)]) == 0
        return capsys.readouterr().out

    return say


@pytest.fixture
def gripper(tmp_path):
    path = tmp_path / "mine.toml"
    path.write_text('[hand]\nframe = "hand"\ndepth_mm = 103.4\njoints = { left = 0.5, right = -0.5 }\nstroke_mm = 90\n')
    return path


def read_yaml(text):
    yaml = pytest.importorskip("yaml", reason="PyYAML is not installed: pip install pyyaml")
    return yaml.safe_load(text)


def fits(value, schema):
    """Whether a value has exactly the fields of a schema, each with its type."""
    if isinstance(schema, dict):
        return isinstance(value, dict) and set(value) == set(schema) and all(fits(value[k], schema[k]) for k in schema)
    if isinstance(schema, list):
        return isinstance(value, list) and all(fits(member, schema[0]) for member in value)
    return type(value) is schema


def station_of(position):
    return int(np.argmin(np.abs(STATIONS - position[2])))


def test_every_format_of_the_command_has_a_writer_and_the_other_way_round():
    assert set(FORMATS) == {*TABLES, *PLANNERS, *SIMULATORS, *DATA_SETS, "vtk"}
    assert set(CLOSING) < {*PLANNERS, *DATA_SETS}


@pytest.mark.parametrize("closing", ["x", "y"])
def test_the_gripper_stands_over_its_pads(path, closing):
    """Where the file's pads are, seen from the gripper: finger 1 behind, finger 2 ahead along its closing axis."""
    depth, hand = 0.1, Hand(closing=closing, depth_mm=100.0)
    found = grasps(opened(path), GripperFrame(hand, tuple(APPROACHES)), force=4.0)
    for grasp, approach in zip(found, 5 * tuple(APPROACHES), strict=True):
        R, o, _ = geometry(station_of(grasp.case["fingers"][0]["pose_origin"]))
        one, two = (grasp.rotation.T @ (origin - grasp.origin) for origin in o)
        ahead = np.array([RADIUS, 0, 0] if closing == "x" else [0, RADIUS, 0])
        assert two - one == pytest.approx(2 * ahead, abs=1e-12)
        assert (one + two) / 2 == pytest.approx([0, 0, depth], abs=1e-12)
        axis = R[0][:, 0 if approach.endswith("x") else 1]
        assert grasp.rotation[:, 2] == pytest.approx(-axis if approach.startswith("minus") else axis)
        assert np.linalg.det(grasp.rotation) == pytest.approx(1)
        assert Rotation.from_quat(grasp.quaternion).as_matrix() == pytest.approx(grasp.rotation, abs=1e-12)
        assert grasp.name.endswith(approach.replace("-", "_"))


def test_isaac_grasp_has_the_fields_of_its_documentation(said, gripper):
    text = said("--format", "isaac_grasp", "--force", 4, "--approach", "minus-x", "--gripper", gripper)
    found = read_yaml(text)
    assert set(found) == ISAAC_FILE
    assert (found["format"], found["format_version"], found["gripper_frame"]) == ("isaac_grasp", 1.0, "hand")
    assert len(found["grasps"]) == 4
    for grasp in found["grasps"].values():
        assert set(grasp) == ISAAC
        assert 0 <= grasp["confidence"] <= 1
        assert fits(grasp["position"], [float])
        assert fits(grasp["orientation"], {"w": float, "xyz": [float]})
        rotation = Rotation.from_quat([*grasp["orientation"]["xyz"], grasp["orientation"]["w"]]).as_matrix()
        ahead = np.array(grasp["position"]) + 0.1034 * rotation[:, 2]
        R, o, _ = geometry(station_of(ahead))
        assert rotation[:, 1] == pytest.approx(R[0][:, 2], abs=1e-12)  # closes along y
        assert rotation[:, 2] == pytest.approx(-R[0][:, 0], abs=1e-12)
        assert ahead == pytest.approx(o.mean(axis=0))
        # the foam is on fingers whose bare faces meet at zero, and 90 mm of stroke are less than 20 mm wider
        inner = RADIUS - 0.001 + FOAM
        assert grasp["cspace_position"] == pytest.approx({"left": inner, "right": -inner})
        assert grasp["pregrasp_cspace_position"] == pytest.approx({"left": 0.045, "right": -0.045})
    assert [g["confidence"] for g in found["grasps"].values()] == pytest.approx(sorted(
        (1.0 + np.delete(STATIONS, LOST)) / 1.04, reverse=True))  # fmt: skip
    assert "warnings: coarse" in text


def test_moveit_grasps_have_the_fields_of_their_messages(said, gripper):
    found = read_yaml(said("--format", "moveit", "--force", 16, "--gripper", gripper, "--frame", "mug"))
    assert set(found) == {"grasps"}
    assert len(found["grasps"]) == 4
    for grasp in found["grasps"]:
        assert fits(grasp, MOVEIT)
        assert grasp["grasp_pose"]["header"]["frame_id"] == "mug"
        assert grasp["max_contact_force"] == 16.0
        assert grasp["grasp_posture"]["points"][0]["effort"] == [16.0, 16.0]
        pose = grasp["grasp_pose"]["pose"]
        rotation = Rotation.from_quat([pose["orientation"][k] for k in "xyzw"]).as_matrix()
        ahead = np.array([pose["position"][k] for k in "xyz"]) + 0.1034 * rotation[:, 2]
        assert ahead == pytest.approx(geometry(station_of(ahead))[1].mean(axis=0))
        assert grasp["pre_grasp_approach"]["direction"]["vector"] == pytest.approx({"x": 0.0, "y": 0.0, "z": 1.0})
        assert grasp["post_grasp_retreat"]["direction"]["vector"] == pytest.approx({"x": 0.0, "y": 0.0, "z": -1.0})


def test_graspgen_has_its_keys_a_mask_of_the_grasps_that_hold_and_the_mesh_from_its_own_folder(said, path, tmp_path):
    """Read as its documentation reads it."""
    found = json.loads(said("--format", "graspgen", "--force", 4))
    assert set(found["object"]) == {"file", "scale"}
    transforms, mask = np.array(found["grasps"]["transforms"]), np.array(found["grasps"]["object_in_gripper"])
    assert transforms.shape == (5, 4, 4)
    assert mask.dtype == bool
    assert mask.sum() == 4
    assert transforms[:, 3] == pytest.approx(np.tile([0, 0, 0, 1.0], (5, 1)))
    for T, holds, case in zip(transforms, mask, found["softjaw"]["cases"], strict=True):
        i = station_of(T[:3, 3])
        R, o, _ = geometry(i)
        assert T[:3, 0] == pytest.approx(R[0][:, 2], abs=1e-12)  # closes along x
        assert T[:3, 3] == pytest.approx(o.mean(axis=0))
        assert holds == (i != LOST)
        assert case["place"]["station"] == STATIONS[i]
        assert case["maps"]["payload"] == pytest.approx(0.4 * (1 + STATIONS[i]))
        assert case["maps"]["epsilon"] is None
    assert all(len(values) == 5 for values in found["grasps"].values())
    assert found["grasps"]["warnings"][found["grasps"]["object_in_gripper"].index(False)] == ["slips"]
    ds = opened(path).assign_attrs(scene='[object]\nmesh = "/work/meshes/mug.stl"\nunit = "mm"')
    made = json.loads(as_graspgen([], GripperFrame(), ds, "/work/sets/first"))
    assert made["object"] == {"file": "../../meshes/mug.stl", "scale": 1e-3}
    empty = write(tmp_path / "empty.hdf", **{"payload/ccm": np.zeros((5, 1, 3))})
    found = grasps(opened(empty), GripperFrame(approach=("x",)), force=4.0)
    assert {grasp.reasons for grasp in found} == {("payload 0",)}


def test_grasps_are_chosen_by_rank_force_and_least_values_and_simulators_get_a_file_for_each(path, said, tmp_path):
    def stations(*words):
        return [float(row["station [m]"]) for row in csv.DictReader(io.StringIO(said("--csv", *words)))]

    held = [STATIONS[i] for i in (4, 3, 2, 0)]
    assert stations("--force", 4) == pytest.approx([*held, STATIONS[LOST]])  # as `show`: those that slip come last
    assert stations("--top", 2) == pytest.approx(held[:2])
    assert stations("--force", 4, "--min", "payload=407") == pytest.approx(held[:3])  # g, as `show` prints it
    assert stations("--force", 4, "--min", "payload=407", "--min", "quality=0.335") == pytest.approx(held[:1])
    assert len(stations()) == 15
    found = json.loads(said("--json", "--force", 2, "--top", 1))["cases"]
    assert [case["normal_force"] for case in found] == [2.0]
    assert found[0]["maps"]["payload"] == pytest.approx(0.2 * (1 + STATIONS[4]))
    assert main(["export", str(path), "--csv", "--by", "epsilon"]) == USAGE  # no grasp has one
    assert stations("--force", 4, "--by", "payload") == pytest.approx([*held, STATIONS[LOST]])
    each = json.loads(said("--format", "graspgen", "--top", 2, "--approach", "x", "--approach", "minus-y"))
    assert each["grasps"]["names"] == ["grasp_0_x", "grasp_0_minus_y", "grasp_1_x", "grasp_1_minus_y"]
    for name in SIMULATORS:
        assert re.search(r'"grasp(_0)?"', said("--format", name))
    out = tmp_path / "grasp.xml"
    said("--format", "mjcf", "--top", 3, "-o", out)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["grasp-1.xml", "grasp-2.xml", "grasp-3.xml"]
    assert main(["export", str(path), "--format", "mjcf", "--top", "3"]) == USAGE
    (tmp_path / "model-2.stl").write_text("mine")
    said("--format", "sdf", "--top", 2, "-o", tmp_path / "model.sdf")
    assert (tmp_path / "model-2.stl").read_text() == "mine"
    assert (tmp_path / "model-2-object.stl").stat().st_size > 84
    assert "<uri>model-2-object.stl</uri>" in (tmp_path / "model-2.sdf").read_text()


@pytest.mark.parametrize("words", [
    "--format urdf", "--format moveit --force 99", "--csv --min beauty=3", "--csv --min payload", "--csv --min flags=1",
    "--format moveit --min payload=1e9", "--format moveit --gripper three_fingers",
    "--format moveit --gripper robotiq_2f85",  # presses with 20 N at least
    "--csv -o {path}", "--csv --approach y", "--json --gripper wsg50", "--format mjcf --wider 5",
    "--format sdf --frame f", "--format physx --approach x", "--format graspgen --frame f",
    *(f"--format vtk -o {{path}}.vtm --{o}" for o in ("by e_n", "top 3", "model pcm", "min e_n=3", "wider 5")),
])  # fmt: skip
def test_what_cannot_be_written_is_refused(path, words, capsys):
    assert main(["export", str(path), *words.format(path=path).split()]) == USAGE
    assert "error: " in capsys.readouterr().err
    assert path.read_bytes()[1:4] == b"HDF"


@pytest.mark.parametrize("value", [1e-5, -2e-300, 5e-324, 1.0, -0.0, 1e22, 0.1, 123456789.0, np.inf, -np.inf])
def test_numbers_of_yaml_are_numbers(value):
    """PyYAML, which reads YAML 1.1, takes 1e-05 for a text."""
    found = read_yaml(flow({"a": value, "b": [value], "c": str(value)}))
    assert type(found["a"]) is type(found["b"][0]) is float
    assert found == {"a": value, "b": [value], "c": str(value)}
