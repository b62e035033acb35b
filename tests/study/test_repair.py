"""Damaged result files: what is good is found, and a copy of it goes on to the same bits."""

from __future__ import annotations

import shutil
import subprocess
from types import SimpleNamespace

import h5py
import numpy as np
import pytest

from softjaw.study.exits import CANNOT_WRITE, IN_USE, OTHER_FILE, StudyError
from softjaw.study.result import repair as repairing
from softjaw.study.result.layout import DONE, MISSING
from softjaw.study.result.record import record
from softjaw.study.result.repair import repair
from softjaw.study.result.store import ResultWriter, create, open_result
from softjaw.study.run.lock import Lock
from tests.study.fake_run import fake_plan, fake_result
from tests.study.launching import contents, differing, launch

ROWS = 36


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A file of the fake study in which row 5 failed and row 7 was never solved; each rank writes its own."""
    path = tmp_path_factory.mktemp("finished") / "whole.hdf"
    plan = fake_plan()
    create(path, plan.layout, plan.header)
    writer = ResultWriter(path, plan.layout, None)
    for row in range(ROWS):
        if row == 5:
            writer.fail(row, "no contact at this force")
        elif row != 7:
            writer.write(row, record(plan.layout, fake_result(row)))
    writer.close()
    return path


@pytest.fixture
def damaged(tmp_path, finished, monkeypatch):
    """A copy to be spoiled; its scene is none that could be parsed, so the plan is handed in."""
    monkeypatch.setattr(repairing, "_plan", lambda result: fake_plan())
    return shutil.copy(finished, tmp_path / "out.hdf")


def states(path):
    with open_result(path) as result:
        return result.status.ravel()


def without(finished, rows):
    """What a file must hold in which these rows were never solved."""
    expected = states(finished)
    expected[list(rows)] = MISSING
    return expected


def test_a_sound_file_is_left_alone(damaged):
    before = damaged.read_bytes()
    told = repair(damaged)
    assert told.startswith(f"{damaged}: 34 of 36 cases good, 1 failed, 1 missing\n")
    assert "there is nothing to repair" in told
    repair(damaged, write=True)
    assert [p.name for p in damaged.parent.iterdir()] == ["out.hdf"]
    assert damaged.read_bytes() == before


def test_rows_that_do_not_match_their_checksum_become_missing_ones(damaged, finished):
    with h5py.File(damaged, "r+") as file:
        file["study/patch/normal"][30, 0, 3, 1] += 1e-9
        file["study/fingers/f_x_max"][2, 1, 0, 1, 2] = 7.0  # row 15
    before = damaged.read_bytes()
    assert "2 cases marked done do not match their checksums (rows 15, 30)" in repair(damaged)
    repair(damaged, write=True)
    assert damaged.read_bytes() == before
    made = damaged.with_suffix(".repaired.hdf")
    assert (states(made) == without(finished, [15, 30])).all()
    with open_result(made) as result, open_result(finished) as whole:
        assert np.isnan(result.fingers("f_x_max")[2, 1, 0]).all()
        kept = result.status == DONE
        assert (result.map("e_n", "curved")[kept] == whole.map("e_n", "curved")[kept]).all()


@pytest.mark.parametrize("share", [0.98, pytest.param(0.6, marks=pytest.mark.long)])
def test_what_is_left_of_a_file_that_was_cut_off_is_kept(damaged, finished, share):
    with damaged.open("r+b") as file:
        file.truncate(int(share * damaged.stat().st_size))
    with pytest.raises(StudyError, match="truncated"), open_result(damaged):
        pass
    assert "cut off" in repair(damaged)
    repair(damaged, in_place=True)
    assert (states(damaged) == states(finished)).all()  # rows stand at the front of the file
    assert damaged.with_name("out.hdf.backup").stat().st_size == int(share * finished.stat().st_size)
    with open_result(damaged) as result:
        assert "eccentricity" in result.definitions.lower()


@pytest.mark.parametrize(
    "what", ["empty", "text", pytest.param("head only", marks=pytest.mark.long), "another scene's"]
)
def test_what_cannot_be_repaired_is_said_and_kept(damaged, what, monkeypatch):
    monkeypatch.setattr(repairing, "PATIENCE", 3.0)  # HDF5 turns for ever in a head without a body
    content = {"empty": b"", "text": b"my notes " * 20, "head only": damaged.read_bytes()[:5000]}
    if what in content:
        damaged.write_bytes(content[what])
    else:
        other = SimpleNamespace(layout=fake_plan(stations=3).layout, header=fake_plan().header)
        monkeypatch.setattr(repairing, "_plan", lambda result: other)
        with h5py.File(damaged, "r+") as file:
            file["study/patch/normal"][30] = 0.0
    before = damaged.read_bytes()
    with pytest.raises(StudyError, match="repaired") as refusal:
        repair(damaged, in_place=True)
    assert refusal.value.code == OTHER_FILE
    assert "restore it from a copy" in str(refusal.value)
    assert damaged.read_bytes() == before
    assert [p.name for p in damaged.parent.iterdir()] == ["out.hdf"]


def test_leftovers_of_a_killed_run_are_named_and_removed(damaged):
    left = [damaged.with_name("out.hdf.lock"), damaged.with_name("out.hdf.part")]
    for path in left:
        path.write_text("left")
    assert "left over" in repair(damaged)
    assert all(path.exists() for path in left)
    repair(damaged, write=True)
    assert not any(path.exists() for path in left)
    left[1].write_text("left")
    damaged.unlink()
    with pytest.raises(StudyError, match=r"only out.hdf.part, in which nothing was solved yet; run again"):
        repair(damaged)


def test_a_file_in_use_and_an_earlier_repair_are_not_touched(damaged):
    lock = Lock(damaged, "host here, process 1, 1 ranks")
    lock.take_first()
    with pytest.raises(StudyError, match="in use by a run") as refusal:
        repair(damaged, write=True)
    assert refusal.value.code == IN_USE
    lock.release()
    damaged.with_suffix(".repaired.hdf").write_text("mine")
    with pytest.raises(StudyError, match="exists already") as refusal:
        repair(damaged, write=True)
    assert refusal.value.code == CANNOT_WRITE


@pytest.mark.long
@pytest.mark.launches
def test_a_real_file_that_was_cut_off_or_repacked_goes_on_to_the_same_bits(once, shared_path):
    whole, cut = shared_path / "whole.hdf", shared_path / "cut.hdf"

    def spoil():
        assert launch(0, "-m", "softjaw", "run", "jobs/smoke.toml", "-o", whole)[0] == 0
        cut.write_bytes(whole.read_bytes()[: int(0.3 * whole.stat().st_size)])
        assert launch(0, "-m", "softjaw", "run", "jobs/smoke.toml", "-o", cut)[0] == OTHER_FILE
        assert launch(0, "-m", "softjaw", "repair", cut, "--in-place")[0] == 0
        return launch(0, "-m", "softjaw", "run", "jobs/smoke.toml", "-o", cut)

    code, output, errors = once(spoil)
    assert code == 0, errors
    assert "resumed, 0 of 4 cases" in output
    assert once(differing, cut, once(contents, whole)) == []
    if shutil.which("h5repack"):
        packed = shared_path / "packed.hdf"

        def pack():
            subprocess.run(["h5repack", "-f", "GZIP=4", whole, packed], check=True, capture_output=True)
            assert launch(0, "-m", "softjaw", "run", "jobs/smoke.toml", "-o", packed)[0] == OTHER_FILE
            assert launch(0, "-m", "softjaw", "repair", packed, "--write")[0] == 0
            return launch(0, "-m", "softjaw", "run", "jobs/smoke.toml", "-o", shared_path / "packed.repaired.hdf")

        assert once(pack)[0] == 0
        assert once(differing, shared_path / "packed.repaired.hdf", once(contents, whole)) == []


@pytest.mark.long
@pytest.mark.launches
def test_the_command_says_in_one_line_why_it_cannot(once, shared_path):
    once((shared_path / "x.hdf").write_text, "my notes")
    code, _, errors = once(launch, 0, "-m", "softjaw", "repair", shared_path / "x.hdf")
    assert code == OTHER_FILE
    assert errors.count("error: ") == len(errors.splitlines()) == 1
