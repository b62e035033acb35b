"""A folder of objects: which there are, one run over all of them, and what the index says."""

import json
import os
import re
import shutil
from pathlib import Path

import h5py
import numpy as np
import pytest
import trimesh
from mpi4py import MPI

import softjaw
from softjaw.study.case.result import CaseResult
from softjaw.study.messages import DONE, IN_USE, OTHER_FILE, SOME_FAILED, STOPPED, USAGE, StudyError
from softjaw.study.result.index import NO_GRASP, blank_row, code_of, open_index, write_index
from softjaw.study.result.store import open_result
from softjaw.study.run.object_folder import folder_of
from softjaw.study.run.objects import row_of
from softjaw.study.run.plan import make_plan
from softjaw.study.run.session import locked
from softjaw.study.scene.text import quoted
from softjaw.study.show.status import sessions
from tests.study import fake_objects
from tests.study.formula_results import written
from tests.study.launching import contents, differing, here, launch, refusal
from tests.study.launching import softjaw as command
from tests.study.scenes import BALL, mesh_of, scene_of

SCRIPT = Path(__file__).parent / "fake_objects.py"
NAMES = ("a", "bug", "grows", "late", "longest", "none")
SCENE = f"[object]\n{mesh_of('meshes/*.stl', 'm')}\n[candidates]\nsampled = 2\n[load]\nnormal_force_n = [2]\n"


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("objects")
    (folder / "meshes").mkdir()
    for i, name in enumerate(NAMES):
        trimesh.creation.box((0.03, 0.04, 0.05 + 0.001 * i)).export(folder / f"meshes/{name}.stl")
    (folder / "meshes/empty.stl").write_bytes(b"")
    (folder / "scene.toml").write_text(SCENE)
    return folder / "scene.toml"


@pytest.fixture(scope="module")
def solved(scene):
    code, _, errors = here(fake_objects.main, scene, out := scene.parent / "one")
    assert code == SOME_FAILED, errors
    return out


def rows(out):
    ds = open_index(out / "index.hdf")
    return {str(name): ds.sel(object=name) for name in ds.object.values}


def same(out, expected):
    files = sorted(path.name for path in expected.glob("*.hdf") if path.stem != "index")
    assert sorted(path.name for path in out.glob("*.hdf") if path.stem != "index") == files
    assert {name: differing(out / name, contents(expected / name)) for name in files} == {name: [] for name in files}
    first, other = (softjaw.open(folder).drop_vars(["seconds", "preparing", "mesh"]) for folder in (out, expected))
    assert first.identical(other.assign_attrs(file=first.attrs["file"]))


def test_a_pattern_and_a_table_list_objects_with_a_name_of_their_own(scene):
    assert [listed.name for listed in folder_of(str(scene), []).objects] == sorted([*NAMES, "empty"])
    table = scene.parent / "some.csv"
    table.write_text("mesh, unit, mass_g, name\nmeshes/a.stl, m, 120, rod\nmeshes/longest.stl, cm,,\n")
    folder = folder_of(str(scene), [f"object.mesh={table}"])
    first, second = (folder.scene(listed).object for listed in folder.objects)
    assert (first.name, first.unit, first.mass_g) == ("rod", "m", 120.0)
    assert (second.name, second.unit, second.mass_g) == ("longest", "cm", None)
    assert folder_of(str(scene), ["object.mesh=meshes/a.stl"]) is None
    (odd := scene.parent / "mug \N{SMILING FACE WITH SMILING EYES}\N{NO-BREAK SPACE}").mkdir()
    shutil.copy(scene.parent / "meshes/a.stl", odd)
    (odd / "folder.stl").mkdir()
    [listed] = (folder := folder_of(str(scene), [f"object.mesh={quoted(str(odd))[:-1]}/*.stl\""])).objects
    assert folder.scene(listed).object.mesh == str(odd / "a.stl")
    folder = folder_of(str(scene), ["object.mesh=mesh*/[ab]*.stl"])
    assert [listed.name for listed in folder.objects] == ["meshes-a", "meshes-bug"]


@pytest.mark.parametrize("mesh", [
    "nothing/*.stl", "missing.csv", "scene.toml*", "mesh\nmeshes/a.stl\nmeshes/a.stl\n", "mesh;unit\nmeshes/a.stl;m\n",
    "mesh,run.time_limit_s\nmeshes/a.stl,9\n", "mesh,name\nmeshes/a.stl,x\nmeshes/bug.stl,X\n",
    "mesh,unit,unit\nmeshes/a.stl,m,m\n", "mesh,name\nmeshes/a.stl,/a",
    '"meshes/a*', "latin/*",
])  # fmt: skip
def test_a_pattern_without_meshes_and_a_table_with_a_name_or_a_column_twice_are_refused(scene, mesh):
    if "\n" in mesh:
        (table := scene.parent / "wrong.csv").write_text(mesh)
        mesh = table.name
    (latin := scene.parent / "latin").mkdir(exist_ok=True)
    (latin / os.fsdecode(b"gr\xf6sse.stl")).write_bytes(b"")
    with refusal(USAGE):
        folder_of(str(scene), [f"object.mesh={mesh}"])


def test_check_reports_every_object_with_its_line_and_a_wrong_first_one_stops_no_other(scene):
    table = scene.parent / "wrong.csv"
    table.write_text("mesh,unit\nmeshes/a.stl,MM\nmeshes/bug.stl,m\n\nmeshes/empty.stl,m\n")
    code, _, errors = command(0, "check", scene, "--objects", table)
    assert (code, re.findall(r"wrong.csv:(\d+)", errors)) == (USAGE, ["2", "5"])
    assert folder_of(str(scene), ["object.mesh=wrong.csv"]).check().object.name == "bug"
    for i, name in enumerate(("full", "open", "wide")):
        box = trimesh.creation.box((0.03, 0.04, 0.05 + 0.01 * i))
        box.update_faces(box.face_normals[:, 2] < 0.5 + (name == "full"))
        (scene.parent / "open").mkdir(exist_ok=True)
        box.export(scene.parent / f"open/{name}.stl")
    _, text, _ = command(0, "check", scene, "--objects", scene.parent / "open", "--set", "friction.mu=5")
    assert "warning: full, open, wide: friction.mu" in text
    assert set(re.findall(r"note: (\w+): ", text)) == {"open", "wide"}


@pytest.mark.parametrize(("objects", "count"), [
    pytest.param("meshes/[al]*.stl", 3, marks=pytest.mark.long), pytest.param("odd [1]", 1, marks=pytest.mark.long),
    ("some.csv", 2),
])  # fmt: skip
@pytest.mark.usefixtures("plans_in_no_time")
def test_the_command_line_names_meshes_from_where_it_is(scene, objects, count, monkeypatch):
    """A folder, a pattern or a table; not from the scene's folder, as a key of the scene would be."""
    (scene.parent / "sub").mkdir(exist_ok=True)
    (scene.parent / "sub/scene.toml").write_text(SCENE)
    (scene.parent / "odd [1]").mkdir(exist_ok=True)
    shutil.copy(scene.parent / "meshes/a.stl", scene.parent / "odd [1]")
    (scene.parent / "some.csv").write_text("mesh\nmeshes/a.stl\nmeshes/longest.stl\n")
    monkeypatch.chdir(scene.parent)
    code, text, _ = command(0, "check", "sub/scene.toml", "--objects", objects)
    assert code == DONE
    assert f"{count}: a" in text
    on = re.findall(r"on (\d) rank", command(0, "plan", "sub/scene.toml", "--objects", objects, "-n", "2,4")[1])
    assert on == ["2", "4"]
    assert command(0, "check", "sub/scene.toml", "--objects", "nothing/*.stl")[0] == USAGE


def test_every_object_is_a_row_of_the_index_and_its_page_and_none_stops_the_others(solved, tmp_path):
    found = rows(solved)
    states = {name: str(row.state.values) for name, row in found.items()}
    assert states == {"a": "complete", "bug": "failed", "empty": "refused", "grows": "complete",
                      "late": "failed", "longest": "some cases failed", "none": "no grasp"}  # fmt: skip
    assert all(found[name].reason.values.item() for name in ("bug", "empty", "late", "longest", "none"))
    assert sorted(path.stem for path in solved.glob("*.hdf")) == ["a", "grows", "index", "late", "longest"]
    for name in ("a", "grows", "longest"):
        ds = softjaw.open(solved / f"{name}.hdf")
        held = np.nan_to_num(ds.payload.sel(model="ccm").values[..., -1])
        assert float(found[name].payload) == held.max()
        assert int(found[name].cases) == ds.status.size
        assert json.loads(ds.attrs["provenance"])[-1]["reason"] == "complete"
    assert command(0, "status", solved)[0] == DONE
    code, text, _ = command(0, "show", solved, "--csv")
    assert (code, len(text.splitlines())) == (DONE, len(NAMES) + 2)
    assert command(0, "watch", solved / "index.hdf")[0] == SOME_FAILED
    assert command(0, "report", solved, "-o", tmp_path / "page.html")[0] == DONE
    html = (tmp_path / "page.html").read_text()
    assert [name for name in (*NAMES, "empty") if f'"#object-{name}"' in html] == ["a", "grows", "longest"]
    assert html.count("<tr><td>") == len(NAMES) + 1
    assert html.count("<button") > 5


def test_programs_get_every_row_and_what_is_for_one_file_is_refused(tmp_path, solved):
    write_index(tmp_path / "index.hdf", [blank_row(f"object{i}") for i in range(12)], {})
    assert len(command(0, "show", tmp_path, "--csv")[1].splitlines()) == 13
    assert "2 more" in command(0, "show", tmp_path)[1]
    export = ("export", tmp_path, "--format", "graspgen", "-o", tmp_path / "set")
    for *words, option, value in (
        ("show", tmp_path, "--force", 2), ("show", tmp_path, "--by", "e_n"), ("report", tmp_path, "--at", 3),
        (*export, "--top", 3), (*export, "--min", "e_n=1"), (*export, "--model", "pcm"), (*export, "--frame", "f"),
        ("compare", tmp_path, solved),
    ):  # fmt: skip
        code, _, errors = command(0, *words, option, value)
        assert (code, str(option) in errors) == (USAGE, True)
    assert command(0, "view", tmp_path)[0] == USAGE
    for index in (tmp_path, softjaw.open(tmp_path)):
        with pytest.raises(StudyError):
            softjaw.GraspMap(index)


def test_again_nothing_is_solved_another_mesh_is_refused_and_a_signal_stops_in_order_and_the_run_resumes(scene, solved):
    before = {path: path.stat().st_mtime_ns for path in solved.glob("*.hdf") if path.stem != "index"}
    assert here(fake_objects.main, scene, solved)[0] == SOME_FAILED
    assert {path: path.stat().st_mtime_ns for path in before} == before
    stored = solved / "a.hdf"
    whole = stored.read_bytes()
    numbers = contents(stored)
    with h5py.File(stored, "r+") as file:
        file["study/payload/ccm"][...] += 1.0
    assert here(fake_objects.main, scene, solved)[0] == SOME_FAILED
    assert differing(stored, numbers) == []
    stored.write_bytes(whole[:5000])
    assert here(fake_objects.main, scene, solved)[0] == OTHER_FILE
    stored.unlink()
    assert command(0, "export", solved, "--format", "graspgen", "-o", scene.parent / "set")[0] == OTHER_FILE
    assert not (scene.parent / "set").exists()
    assert here(fake_objects.main, scene, solved)[0] == SOME_FAILED
    assert stored.exists()
    for old, new in (("meshes", "moved"), ("moved", "meshes")):
        (scene.parent / old).rename(scene.parent / new)
        scene.write_text(SCENE.replace("meshes/", f"{new}/"))
        assert here(fake_objects.main, scene, solved)[0] == SOME_FAILED
        assert {Path(str(row.mesh.values)).parent.name for row in rows(solved).values()} == {new}
    mesh = scene.parent / "meshes/a.stl"
    content = mesh.read_bytes()
    trimesh.creation.box((0.02, 0.02, 0.02)).export(mesh)
    try:
        assert here(fake_objects.main, scene, solved)[0] == OTHER_FILE
        mesh.unlink()
        (unread := mesh.with_name("unread.stl")).write_bytes(b"")
        code, text, _ = here(fake_objects.main, scene, solved)
        assert (code, "note: 1 of 7" in text) == (SOME_FAILED, True)
        # nothing was left to solve, but the index says what there is now
        assert sorted(rows(solved)) == sorted(path.stem for path in mesh.parent.glob("*.stl"))
        unread.unlink()
    finally:
        mesh.write_bytes(content)
    assert here(fake_objects.main, scene, solved)[0] == SOME_FAILED
    assert rows(solved)["a"].state.values.item() == "complete"
    out = scene.parent / "stopped"
    assert here(fake_objects.main, scene, out, "--stop-after", 40)[0] == STOPPED
    assert "not complete" in open_index(out / "index.hdf").state.values
    assert here(fake_objects.main, scene, out)[0] == SOME_FAILED
    same(out, solved)


@pytest.mark.ranks
def test_a_scene_that_is_wrong_for_all_objects_ends_every_rank(scene, tmp_path):
    words = ("run", scene, "--set", "friction.mu=-1", "-o", tmp_path / "out")
    code, _, errors = command(2, *words)
    assert code == USAGE, errors
    assert "friction.mu" in errors


def test_a_folder_of_which_nothing_can_be_read_has_its_index_with_the_reasons(scene, tmp_path):
    out = tmp_path / "out"
    (tmp_path / "scene.toml").write_text(SCENE.replace("meshes/", f"{scene.parent}/meshes/em"))
    code, _, errors = here(fake_objects.main, tmp_path / "scene.toml", out)
    assert code == SOME_FAILED, errors
    [row] = rows(out).values()
    assert str(row.state.values) == "refused"
    assert "empty" in str(row.reason.values)


@pytest.mark.ranks
def test_two_ranks_give_the_same_bits(scene, solved):
    out = scene.parent / "two"
    assert launch(2, SCRIPT, scene, out)[0] == SOME_FAILED
    same(out, solved)


@pytest.mark.long
@pytest.mark.ranks
@pytest.mark.parametrize("count", [3, 11, 25])
def test_a_kill_amid_any_object_loses_nothing_that_is_finished(scene, solved, count):
    out = scene.parent / f"killed{count}"
    assert launch(2, SCRIPT, scene, out, "--kill-after", count, "--delay", 0.01)[0] != SOME_FAILED
    assert int(re.search(r"(\d+) cases", command(0, "status", out)[1])[1]) >= count - 1  # of one rank alone
    assert launch(2, SCRIPT, scene, out)[0] == SOME_FAILED
    same(out, solved)


@pytest.mark.long
def test_an_object_of_a_folder_has_the_bits_of_a_run_of_its_own(tmp_path):
    text = SCENE + "[gripper]\nelements = [4, 2, 2]\n[accuracy]\nmeshes = 1\n[limit_surface]\nsamples = 80\n"
    (tmp_path / "scene.toml").write_text(text)
    (tmp_path / "meshes").mkdir()
    trimesh.creation.box((0.04, 0.05, 0.06)).export(tmp_path / "meshes/box.stl")
    trimesh.creation.cylinder(0.02, 0.08).export(tmp_path / "meshes/rod.stl")
    scene, out = tmp_path / "scene.toml", tmp_path / "out"
    assert "about 4" in command(0, "plan", scene)[1]
    assert command(0, "run", scene, "-o", out)[0] == DONE
    code, _, errors = command(0, "run", scene, "--set", "friction.mu=0.5", "-o", out)
    assert (code, "(friction.mu is 0.8 there and 0.5 here)" in errors) == (OTHER_FILE, True)
    alone = ("--set", "object.mesh=meshes/rod.stl", "--set", "object.name=rod", "-o", tmp_path / "rod.hdf")
    assert command(0, "run", scene, *alone)[0] == DONE
    # whose header has what was set
    assert differing(out / "rod.hdf", contents(tmp_path / "rod.hdf")) == ["study/header"]
    assert command(0, "report", out)[0] == DONE
    assert (out / "index.html").read_text().count("data:image/png") == 2
    assert command(0, "export", out, "--format", "graspgen", "-o", tmp_path / "set")[0] == DONE


def test_what_has_failed_is_tried_again_once_and_not_in_every_round(scene, tmp_path):
    shutil.copy(scene.parent / "meshes/grows.stl", tmp_path)
    (tmp_path / "scene.toml").write_text(SCENE.replace("meshes/", ""))
    run = (fake_objects.main, tmp_path / "scene.toml", tmp_path / "out", "--retry-failed", "--fail", "5001")
    for first in (42, 2):
        code, text, _ = here(*run)
        counts = [int(line.split()[2]) for line in text.splitlines() if "to solve" in line]
        assert (code, counts[0]) == (SOME_FAILED, first)
        assert counts[1:] == [6, 12, 18] * (first == 42)
    with open_result(tmp_path / "out/grows.hdf") as result:
        lines = sessions(result, running=False)
    assert ["round" in line.split(":")[0] for line in lines] == [False, True, True, True, False]


def test_an_object_is_as_complete_as_the_samples_of_its_uncertain_inputs(tmp_path):
    made = scene_of(BALL, 'uncertainty={ samples = 8, spread = { "friction.mu" = 0.1 } }')
    plan = make_plan(made)

    def case(at):
        values = {"maps/payload": [1.0] * 3, "maps/flags": 0.0, "work/seconds_total": 2.0}
        return "no state" if at == (3, 0, 0, 0) else CaseResult(values)

    with open_result(written(tmp_path / "a.hdf", plan.layout, case, plan.header)) as result:
        row = row_of(result)
    assert (row["cases"], row["done"], row["failed"], row["seconds"]) == (9, 8, 1, 16.0)
    assert (row["reason"], code_of([row])) == ("1 of 9 cases: no state", SOME_FAILED)


def test_an_object_without_a_grasp_some_of_whose_cases_failed_has_the_code_of_those():
    none = blank_row("none", state=NO_GRASP, failed=0)
    assert code_of([none]) == DONE
    assert code_of([none, none | {"failed": 1}]) == SOME_FAILED


def test_a_run_of_one_object_of_a_folder_waits_for_the_folder_and_the_folder_for_it(scene, tmp_path):
    comm, other = MPI.COMM_SELF, tmp_path / "a.hdf"
    for held, wanted in ((tmp_path / "index.hdf", other), (other, other)):
        with locked(held, comm), refusal(IN_USE), locked(wanted, comm):
            pass
    with locked(other, comm):
        assert here(fake_objects.main, scene, tmp_path)[0] == IN_USE
