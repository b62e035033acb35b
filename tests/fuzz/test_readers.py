"""Files that are nearly right: a reader takes them or says in one sentence what is wrong, and does nothing else."""

import os
import resource
import traceback
import warnings
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.mesh_file import read_triangles
from softjaw.study.messages import UNPRINTABLE
from softjaw.study.scene import SceneError, load_scene
from tests.fuzz.edits import edited, edits, renumber, repeat_line
from tests.fuzz.hostile_meshes import hostile
from tests.fuzz.readers import QUICK, Reader
from tests.study.launching import ROOT

SECONDS, ROOM = 30, 2**30  # of CPU, three times what the slowest takes, and bytes beyond what the tests have already
CHECKS = {"deadline": None, "database": None, "suppress_health_check": list(HealthCheck)}
EVERY = pytest.mark.parametrize("reader", QUICK.values(), ids=QUICK)


def complaint(reader, path):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            reader.read(path)
        except reader.errors as error:
            return wrong_words(str(error), path)
        except BaseException:
            return traceback.format_exc()
    return ""


def wrong_words(text, path):
    lines = text.splitlines()
    if not 0 < len(lines) <= 300 or max(map(len, lines)) > 1000 or UNPRINTABLE.search(text):
        return f"no clear sentence: {text!r}"
    named = path.name in text or path.stem in text or "--set" in text
    return "" if named else f"the file is not named: {text!r}"


def complaint_apart(reader, path):
    end, other = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(end)
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        resource.setrlimit(resource.RLIMIT_AS, (pages * resource.getpagesize() + ROOM, resource.RLIM_INFINITY))
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS + 1))
        os.write(other, b"." + complaint(reader, path).encode()[-4000:])
        os._exit(0)
    os.close(other)
    with os.fdopen(end, "rb") as pipe:
        told = pipe.read()
    status = os.waitpid(child, 0)[1]
    return told[1:].decode() if told else f"it ended by signal {os.WTERMSIG(status)}"


@EVERY
@settings(max_examples=6, derandomize=True, **CHECKS)
@given(data=st.data())
def test_a_spoilt_file_is_read_or_refused(tmp_path, reader, data):
    path = tmp_path / reader.name
    path.write_bytes(edited(reader.content, data.draw(edits(reader.kinds))))
    wrong = complaint(reader, path)
    assert not wrong, wrong


def test_a_corner_at_infinity_of_a_polygon_ends_without_a_warning(tmp_path):
    reader, path = QUICK["ASCII STL"], tmp_path / "mesh.stl"
    path.write_bytes(edited(reader.content, [(renumber, 1.0, 1), (repeat_line, 0.6875, 1)]))
    assert b"-inf" in path.read_bytes()
    assert not complaint(reader, path)


@EVERY
def test_the_file_that_is_spoilt_is_a_good_one(tmp_path, reader):
    path = tmp_path / reader.name
    path.write_bytes(reader.content)
    found = reader.read(path)
    if path.stem == "mesh":  # the octahedron of 30 mm
        assert (len(found.points), len(found.triangles)) == (6, 8)
        assert found.gap(np.array([[0.0, 0.0, 0.03]]))[0][0] == pytest.approx(-0.03 / np.sqrt(3), rel=1e-6)


@pytest.mark.long
@EVERY
def test_many_spoilt_files_are_read_or_refused_in_time_and_in_little_memory(tmp_path, reader):
    path = tmp_path / reader.name
    path.write_bytes(reader.content)
    reader.read(path)  # and everything is imported

    @settings(max_examples=100, derandomize=True, **CHECKS)
    @given(found=edits(reader.kinds))
    def judged(found):
        path.write_bytes(edited(reader.content, found))
        wrong = complaint_apart(reader, path)
        assert not wrong, wrong

    judged()


@pytest.mark.long
def test_hostile_meshes_are_read_or_refused_in_time_and_in_little_memory(tmp_path):
    wrong = {}
    read_triangles(ROOT / "jobs" / "objects" / "flask.stl")  # and everything is imported
    for name, content in hostile().items():
        path = tmp_path / name
        path.write_bytes(content)
        ending = Reader(name, content, (), read_triangles, (MeshError,))
        if complaint := complaint_apart(ending, path):
            wrong[name] = complaint[-1500:]
    assert not wrong, "\n\n".join(f"{name}: {text}" for name, text in wrong.items())


@pytest.mark.parametrize(
    "text", ["=", "a=b=c", "\x1b[2J=1", "x.y=" + "[" * 3000, "load.normal_force_n=[1e999]", "." * 99]
)
def test_an_override_is_taken_or_refused(tmp_path, text):
    path = tmp_path / "scene.toml"
    path.write_bytes(QUICK["scene"].content)
    with pytest.raises(SceneError) as refused:
        load_scene(path, [text])
    assert not wrong_words(str(refused.value), path)
