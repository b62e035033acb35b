"""What a file from elsewhere must not do: reach other files, give orders to a terminal or page, end the program."""

import os
import shutil
from contextlib import suppress

import h5py
import pytest

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.mesh_file import read_triangles
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.study.messages import OTHER_FILE, UNPRINTABLE, USAGE, StudyError
from softjaw.study.result.store import open_result
from softjaw.study.scene import SceneError, load_scene, parse_scene
from tests.fuzz.lies import LIES, SCENE
from tests.fuzz.readers import QUICK, obj, ply, stl
from tests.study.formula_results import make, sealed
from tests.study.launching import softjaw

MESH = SCENE.replace('shape = "sphere"\nradius_mm = 30', 'shape = "mesh"\nmesh = "FILE"\nunit = "mm"')
TABLE = QUICK["table"].content


def told(*words):
    code, output, errors = softjaw(0, *words)
    assert not UNPRINTABLE.search(output + errors)
    assert code != 70, errors
    assert (code == 0) == (not errors), errors
    assert all(line.startswith("error: ") for line in errors.splitlines())
    return code, output + errors


@pytest.mark.parametrize(("name", "content"), [
    ("b.obj", obj().replace(b"f 1/1", b"f 0")), ("c.obj", obj().replace(b"f 1/1 3 5", b"f 1 3")),
    ("d.obj", obj().replace(b"f 1/1", b"f 99999999999999999999")),
    ("e.obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf -1 -2 -3\nv 0 0 1\nf -1 -2 -3\nf 1 2 4\nf 1 3 4\n"),
    ("f.obj", obj().replace(b"f 1/1", b"f -99")), ("g.obj", "".join(map(chr, range(200, 400))).encode("utf-16")),
    ("a.ply", ply(True).replace(b"face 8", b"face 9")),
    ("b.ply", ply(True).replace(b"vertex 6", b"vertex 99999999999")),
    ("c.ply", ply(True).replace(b"uchar int", b"int int")), ("d.ply", ply(True).replace(b"float z", b"float y")),
    ("e.ply", ply(False).replace(b"3 0 2 4", b"2 0 2 4")), ("f.ply", ply(False).replace(b"30 0 0\n", b"30\n")),
    ("g.ply", ply(True)[:-20]), ("h.ply", ply(False)[:-20]), ("i.ply", b"\n\nend_header\n"),
    ("a.stl", stl(False).replace(b"vertex", b"vertec", 1)), ("b.stl", stl(False)[:-40]),
    ("c.stl", stl(True)[:80] + b"\xff" * 4), ("a.off", b"OFF\n99999999999 99999999999 0\n0 0 0\n"),
    ("b.off", b"OFF\n3 9 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"), ("c.off", b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 9\n"),
])  # fmt: skip
def test_meshes_that_ended_the_program_once_are_refused(tmp_path, name, content):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(MeshError, match=name):
        MeshObject.from_file(path, "mm")


def test_a_pipe_is_no_mesh_table_or_result(tmp_path):
    """It would be waited for without end."""
    for name in ("a.stl", "a.csv", "a.hdf"):
        os.mkfifo(tmp_path / name)
    with pytest.raises(MeshError, match=r"a\.stl"):
        read_triangles(tmp_path / "a.stl")
    assert told("patch", tmp_path / "a.csv")[0] == told("status", tmp_path / "a.hdf")[0] == OTHER_FILE


@pytest.mark.long
def test_a_mesh_elsewhere_is_read_and_its_place_is_shown_and_kept(tmp_path):
    inner = tmp_path / "scenes"
    inner.mkdir()
    (tmp_path / "body.stl").write_bytes(stl(True))
    (inner / "scene.toml").write_text(MESH.replace("FILE", "../body.stl").replace("[0]", "[30]"))
    said = "".join(told("check", inner / "scene.toml")[1].split())  # however the lines are broken
    assert f"mesh{tmp_path / 'body.stl'}candidates" in said
    assert f'mesh = "{tmp_path / "body.stl"}"' in load_scene(inner / "scene.toml").effective_toml()


@pytest.mark.parametrize("name", ["\\u001b[2J", "\\u009b2J", "a\\nb", "\\u202e", "\\u2028"])
def test_names_hold_no_orders_for_a_terminal(name):
    with pytest.raises(SceneError, match="name"):
        parse_scene(SCENE.replace("[object]", f'[object]\nname = "{name}"'))


def test_nothing_of_a_scene_is_run():
    for option in ("contact_snes_python_type", "contact_ksp_view", "options_file"):
        with pytest.raises(SceneError):
            parse_scene(SCENE + f'[petsc]\n{option} = "python:os.system"\n')
    with pytest.raises(SceneError, match="found"):
        parse_scene(SCENE.replace("30", "__import__('os')"))


@pytest.mark.parametrize(("old", "new", "words"), [
    (b"\n1,0", b'\n"1,0', "a finite number"), (b"\n1,0,0", b"\n1,0,99999999999", "at most 1000 m"),
    (b",7\n", b",1e300\n", "at most 1e+12 Pa"), (b"1.25", b"1e300", "at most 10000 m^2"),
    (b"0.1", b"1e300", "a length of 1"), (b"0,0.1,1,7", b"1e-320,0,0,7", "a length of 1"), (b"1.25", b"1e308", "area"),
    (b"x_mm", b"x_mm\x1b[2J", "x_mm"),
])  # fmt: skip
def test_tables_that_ended_the_program_once_are_refused(tmp_path, old, new, words):
    path = tmp_path / "patch.csv"
    path.write_bytes(TABLE.replace(old, new, 1))
    code, text = told("patch", path, "--distance", "60")
    assert (code, words in text) == (USAGE, True), text


def commands(path, other, page):
    yield from ((*words, path) for words in (("status",), ("show", "--csv"), ("export", "--csv")))
    yield ("compare", path, other)
    yield ("view", path, "--html", page)


@pytest.mark.long
@pytest.mark.parametrize("lie", LIES)
def test_a_result_file_that_lies_is_read_or_refused(tmp_path, lie):
    path, other, page = make(tmp_path / "a.hdf"), tmp_path / "other.hdf", tmp_path / "page.html"
    shutil.copy(path, other)
    with h5py.File(path, "r+") as file:
        LIES[lie](file)
    with suppress(Exception):  # with the right checksums where there is still something to sum up
        sealed(path)
    for words in commands(path, other, page):
        code, said = told(*words)
        assert code == 0 or str(path) in said, said
        assert "root:" not in said  # /etc/passwd
    if page.exists():
        assert "<script>alert" not in page.read_text()


def test_a_file_that_hdf5_breaks_on_is_refused(tmp_path):
    path = make(tmp_path / "a.hdf")
    content = bytearray(path.read_bytes())
    content[1000:3000] = b"\xff" * 2000
    path.write_bytes(content)
    with pytest.raises(StudyError, match=r"a\.hdf"), open_result(path):
        pass
