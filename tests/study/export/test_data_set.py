"""A folder's grasps as a data set: the fields of each format, labels, poses, splits, and the loader of the examples."""

import io
import json
import runpy
import shutil
import tarfile
from itertools import cycle

import h5py
import numpy as np
import pytest
import trimesh

from softjaw.study.cli import main
from softjaw.study.export import data_set
from softjaw.study.export.data_set import FORMS, checked_rows, grasp_arrays, write_data_set
from softjaw.study.export.selection import GripperFrame
from softjaw.study.flags import Flag
from softjaw.study.grippers import Hand, gripper_file
from softjaw.study.messages import OTHER_FILE, USAGE
from softjaw.study.quantities import DONE, WIDE
from softjaw.study.quantities import SLIPS as SLIPPING
from softjaw.study.result.index import blank_row, write_index
from softjaw.study.result.store import open_result
from softjaw.study.run import objects
from softjaw.study.run.objects import row_of
from tests.study.export.grasp_results import FORCES, ROOT, STATIONS, geometry, opened, write

NAMES = ("bowl", "cup", "mug.old", "vase")
SLIPS = 1  # the station whose grasps slip
COUNT = len(STATIONS) * len(FORCES)
GRIPPER = GripperFrame(Hand(closing="x"), ("minus-x",))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    flags = np.zeros((len(STATIONS), 1, len(FORCES)))
    flags[SLIPS] = Flag.SLIPS
    out = tmp_path_factory.mktemp("folder")
    rows = [blank_row("none", state="no grasp", reason="too wide", file="none.hdf", mesh="none.stl")]
    for name in NAMES:
        path = write(out / f"{name}.hdf", **{"flags/flags": flags})
        (out / f"{name}.stl").write_bytes(name.encode())
        with open_result(path) as result:
            rows.append(blank_row(name, file=path.name, mesh=f"{name}.stl") | row_of(result))
    write_index(out / "index.hdf", rows, {})
    return out


@pytest.fixture(scope="module")
def sets(folder, tmp_path_factory):
    out = tmp_path_factory.mktemp("sets")
    for form in FORMS:
        assert main(["export", str(folder), "--format", form, "-o", str(out / form), "--approach", "minus-x"]) == 0
    return out


def test_arrays_are_those_of_the_file_and_what_the_sampler_rejected_is_unsuccessful_and_says_why(folder):
    ds = opened(folder / "cup.hdf")
    arrays = grasp_arrays(ds, GripperFrame(Hand(closing="x")))
    assert {len(values) for values in arrays.values()} == {COUNT}
    success = arrays["object_in_gripper"].reshape(len(STATIONS), -1)
    assert (success.all(axis=1) == (np.arange(len(STATIONS)) != SLIPS)).all()
    assert arrays["force"].reshape(len(STATIONS), -1) == pytest.approx(np.tile(FORCES, (len(STATIONS), 1)))
    assert arrays["payload"] == pytest.approx(ds.payload.sel(model="ccm").values.ravel())
    for i in range(len(STATIONS)):
        R, o, _ = geometry(i)
        matrix = arrays["transforms"][i * len(FORCES)]
        assert matrix[:3, 2] == pytest.approx(-R[0][:, 0])  # it approaches against the long side
        assert matrix[:3, 0] == pytest.approx(R[0][:, 2])  # and closes along x, from finger 1
        assert matrix[:3, 3] == pytest.approx(o.mean(axis=0))
    assert arrays["semi_axes"].shape == (COUNT, 2, 3)
    ds.attrs["rejected"] = np.array([10, 20, 30, 1, 0, 0, 0, 0, 1, SLIPPING, 0, 0, 5, 0, 1, 0, 0, 0, 1, WIDE], "f4")
    for gripper in (GripperFrame(Hand(closing="x"), ("y",)), GripperFrame(Hand(closing="x", approaches=["y"]), ())):
        assert grasp_arrays(ds, gripper)["transforms"][COUNT, :3, 2] == pytest.approx([0, -1, 0])
    arrays = grasp_arrays(ds, GripperFrame(Hand(closing="x")))
    assert {len(values) for values in arrays.values()} == {COUNT + 2}
    assert arrays["state"].tolist() == [*[DONE] * COUNT, SLIPPING, WIDE]
    assert not arrays["object_in_gripper"][COUNT:].any()
    assert np.isnan(arrays["payload"][COUNT:]).all()
    first = arrays["transforms"][COUNT]
    assert first[:3, 3] == pytest.approx([0.01, 0.02, 0.03])
    assert first[:3, 0] == pytest.approx([1, 0, 0])  # it closes along finger 1's approach
    assert first[:3, 2] == pytest.approx([0, 0, -1])


def test_an_object_that_is_held_too_weakly_has_its_values_in_the_index_and_no_successful_grasp(folder, monkeypatch):
    ds = opened(folder / "cup.hdf").copy(deep=True)
    ds["flags"].values[-1] = Flag.SLIPS  # where most is held
    ds = ds.assign(safety_factor=0.0 * ds.payload + 0.9, force_low=(ds.status.dims[:-1], np.full((5, 1), np.nan)))
    ds.attrs["scene"] = ds.scene.replace("[object]", "[object]\nmass_g = 120")
    monkeypatch.setattr(objects, "dataset", lambda _: ds)
    assert not grasp_arrays(ds, GRIPPER)["object_in_gripper"].any()
    with open_result(folder / "cup.hdf") as result:
        row = row_of(result)
    assert (row["state"], row["reason"], row["grasps"], row["mass"]) == ("complete", Flag.TOO_WEAK.word, 0, 0.12)
    assert row["payload"] == pytest.approx(0.1 * FORCES[-1] * (1 + STATIONS[-2]))
    ds["flags"].values[:] = Flag.SLIPS
    with open_result(folder / "cup.hdf") as result:
        assert row_of(result)["state"] == "no grasp"


def test_graspgen_has_its_fields_and_splits_acronym_its_datasets_and_shards_both_files_of_an_object(sets, folder):
    out = sets / "graspgen"
    listed = {split: (out / f"splits/{split}.txt").read_text().split() for split in ("train", "valid")}
    assert sorted([*listed["train"], *listed["valid"]]) == [f"{name}.stl" for name in NAMES]
    for name in NAMES:
        found = json.loads((out / f"grasps/{name}.json").read_text())
        assert (out / "objects" / found["object"]["file"]).read_bytes() == name.encode()
        assert found["object"]["scale"] == 1.0
        assert np.shape(found["grasps"]["transforms"]) == (COUNT, 4, 4)
        assert sum(found["grasps"]["object_in_gripper"]) == COUNT - len(FORCES)
    about = json.loads((out / "data-set.json").read_text())
    assert (about["grasps"], about["successful"]) == (4 * COUNT, 4 * (COUNT - len(FORCES)))
    with h5py.File(sets / "acronym/grasps/cup_1.0.h5") as file:
        assert (sets / "acronym" / file["object/file"][()].decode()).read_bytes() == b"cup"
        assert file["object/scale"][()] == 1.0
        assert file["grasps/transforms"].shape == (COUNT, 4, 4)
        assert int(file["grasps/qualities/flex/object_in_gripper"][()].sum()) == COUNT - len(FORCES)
        assert file["grasps/qualities/softjaw/payload"].shape == (COUNT,)
    found = {}
    for path in sorted((sets / "webdataset").glob("*.tar")):
        with tarfile.open(path) as shard:
            found |= {entry.name: shard.extractfile(entry).read() for entry in shard}
    keys = [name.partition(".")[0] for name in found]
    assert sorted(set(keys)) == ["bowl", "cup", "mug%2eold", "vase"]
    assert all(first == other for first, other in zip(keys[::2], keys[1::2], strict=True))
    assert found["cup.mesh.stl"] == b"cup"
    rows, _ = checked_rows(folder / "index.hdf")
    assert "note" not in write_data_set(folder / "index.hdf", rows, out, "graspgen", GRIPPER)
    (out / "objects/plate.stl").touch()
    assert "note: 1 " in write_data_set(folder / "index.hdf", rows, out, "graspgen", GRIPPER)
    assert len(json.loads(found["cup.json"])["grasps"]["force"]) == COUNT


def test_the_gripper_of_the_scene_comes_to_a_folder_too_from_every_side_asked_for(folder, tmp_path, monkeypatch):
    presets = cycle([{"preset": "franka_hand"}])
    monkeypatch.setattr(data_set, "scene_table", lambda *_: next(presets))
    ways = ["--approach", "x", "--approach", "minus-y"]
    assert main(["export", str(folder), "--format", "acronym", "-o", str(tmp_path), *ways]) == 0
    frame = gripper_file("franka_hand")[1].frame
    assert json.loads((tmp_path / "data-set.json").read_text())["gripper"]["name"] == frame
    with h5py.File(tmp_path / "grasps/vase_1.0.h5") as file:
        ahead = file["grasps/transforms"][:, :3, 2]
    R = np.repeat([geometry(i)[0][0] for i in range(len(STATIONS))], len(FORCES), axis=0)
    assert ahead == pytest.approx(np.concatenate([R[..., 0], -R[..., 1]]))
    presets = cycle([{"preset": "franka_hand"}, {}])  # whose depths and strokes differ
    assert main(["export", str(folder), "--format", "acronym", "-o", str(tmp_path / "mixed"), *ways]) == USAGE
    assert main(["export", str(folder), "--format", "acronym", "-o", str(tmp_path), "--gripper", "wsg50", *ways]) == 0


def test_damage_ends_it_before_anything_is_written_shards_are_whole_one_by_one_and_gltf_is_one_file(
    folder, tmp_path, monkeypatch
):
    copy, out = tmp_path / "copy", tmp_path / "out"
    shutil.copytree(folder, copy)
    trimesh.creation.box((1.0, 2.0, 3.0)).export(copy / "cup.gltf")
    rows, _ = checked_rows(copy / "index.hdf")
    rows = [row | {"mesh": row["mesh"].replace("cup.stl", "cup.gltf")} for row in rows]
    whole, form = list[int](), FORMS["webdataset"]
    monkeypatch.setattr(data_set, "SHARD", 1)
    monkeypatch.setitem(FORMS, "webdataset", lambda g: [whole.append(len([*out.glob("train-??????.tar")])), form(g)][1])
    write_data_set(copy / "index.hdf", rows, out, "webdataset", GRIPPER)
    assert whole == [0, 1, 2, 3]
    with tarfile.open(out / "train-000001.tar") as shard:
        mesh = trimesh.load(io.BytesIO(shard.extractfile("cup.mesh.glb").read()), "glb")
    assert mesh.extents == pytest.approx([1.0, 2.0, 3.0])
    with h5py.File(copy / "vase.hdf", "r+") as file:
        file["study/payload/ccm"][...] += 1.0
    assert main(["export", str(copy), "--format", "graspgen", "-o", str(tmp_path / "never")]) == OTHER_FILE
    assert not (tmp_path / "never").exists()


def test_the_example_loads_every_object_and_a_single_file_is_no_data_set(sets, capsys, monkeypatch, folder, tmp_path):
    out = sets / "graspgen"
    loader = runpy.run_path(str(ROOT / "jobs/examples/data_set.py"))["Grasps"]
    count = {split: len(loader(str(out), split)) for split in ("train", "valid")}
    assert sum(count.values()) == len(NAMES)
    assert loader(str(out))[0]["transforms"].shape == (COUNT, 4, 4)
    monkeypatch.setattr("sys.argv", ["data_set.py", str(out)])
    runpy.run_path(str(ROOT / "jobs/examples/data_set.py"), run_name="__main__")
    assert f"of {count['train'] * COUNT} grasps" in capsys.readouterr().out
    assert main(["export", str(folder / "cup.hdf"), "--format", "acronym", "-o", str(tmp_path / "set")]) == 2
    assert main(["export", str(folder), "--format", "mjcf", "-o", str(tmp_path / "set")]) == 2
