"""Runs of a fake study under mpirun: the same bits on any number of ranks, and no kill, full disk or bug loses work."""

import os
import shutil
import signal
import time

import h5py
import numpy as np
import pytest

from softjaw.study import messages
from softjaw.study.quantities import DONE, FAILED, MISSING, WIDE
from softjaw.study.result.lock import Lock, holder
from softjaw.study.result.store import open_result, torn_rows
from tests.study import fake_run
from tests.study.launching import contents, differing, done, ended, here, softjaw, start, states, study, wait_for

pytestmark = pytest.mark.ranks


def begun(path):
    return 2 <= done(path) < states(path).size


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    path = tmp_path_factory.mktemp("whole") / "whole.hdf"
    ended(0, path)
    return path


@pytest.fixture(scope="module")
def uninterrupted(whole):
    return contents(whole)


def test_a_killed_rank_loses_nothing_others_go_on_and_what_is_no_grasp_is_never_solved(tmp_path, uninterrupted):
    path = tmp_path / "killed.hdf"
    code, _, _ = study(2, path, "--kill", 20)
    assert code not in (0, 6, 75)
    before = contents(path)
    assert 0 < done(path) < 36
    ended(0, path)
    assert before != uninterrupted
    assert differing(path, uninterrupted) == []
    assert not list(tmp_path.glob("*.lock"))
    assert not list(tmp_path.glob("*.part"))
    # A unit of two candidates: alike on any number of ranks, when it is resumed, and when failures are tried again.
    path = tmp_path / "wide.hdf"
    ended(2, path, "--wide", 3)
    wide = [i for i, s in enumerate(states(path)) if s == WIDE]
    assert len(wide) == 6
    alone = tmp_path / "wide-alone.hdf"
    ended(0, alone, "--wide", 3)
    assert differing(path, contents(alone)) == []
    ended(0, path, "--wide", 3, "--retry-failed")
    assert [i for i, s in enumerate(states(path)) if s != DONE] == wide
    with open_result(path) as result:
        assert set(result.messages.ravel()[wide]) == {"needs more"}
        assert not torn_rows(path, result.layout)
        assert result.sessions[-1]["failed"] == 0
        assert result.sessions[-1]["done"] == result.status.size - 6


def test_a_link_to_a_file_stays_one_and_both_names_have_one_lock(tmp_path, uninterrupted):
    link, path = tmp_path / "link.hdf", tmp_path / "a.hdf"
    link.symlink_to(path)
    ended(0, link)
    assert link.is_symlink()
    assert differing(path, uninterrupted) == []
    lock = Lock(path, "me")
    lock.take_first()
    assert holder(link) == "me"
    code, _, _ = study(0, link, "--retry-failed")
    assert code == messages.IN_USE
    lock.release()


@pytest.mark.long
@pytest.mark.parametrize(("apart", "lost"), [((), [13, 14, 16, 17]), (("--apart",), [13, 16])])
def test_a_case_that_kills_the_process_twice_is_given_up(tmp_path, uninterrupted, apart, lost):
    path = tmp_path / "deadly.hdf"
    ended(0, path, "--kill", 13, *apart, code=-signal.SIGKILL)
    ended(0, path, "--kill", 13, *apart, code=-signal.SIGKILL)
    ended(0, path, "--kill", 13, *apart, code=6)
    # Row 13 and the force above it that depends on it, for both candidates of the unit; everything else is solved.
    assert [i for i, s in enumerate(states(path)) if s == FAILED] == lost
    ended(0, path, "--retry-failed")
    assert differing(path, uninterrupted) == []


@pytest.mark.long
def test_a_failed_case_has_its_reason_and_stops_nobody_nor_other_forces_that_are_apart(tmp_path, uninterrupted):
    path = tmp_path / "failed.hdf"
    ended(2, path, "--fail", 9, "--raises", 25, code=6)
    # The exception ends the load path: its row and the one above, for both candidates.
    assert (states(path) == FAILED).sum() == 5
    with open_result(path) as result:
        assert result.messages.ravel()[9] == "no contact at this force"
        assert np.isnan(result.read("e_n/ccm").ravel()[[9, 25, 26]]).all()
        assert result.read("e_n/ccm").ravel()[10] > 0
    ended(0, path, code=6)
    ended(0, path, "--retry-failed")
    assert differing(path, uninterrupted) == []
    # Divided among ranks; the exception is that of one force, for both candidates of its unit.
    path = tmp_path / "apart.hdf"
    ended(2, path, "--apart", "--fail", 9, "--raises", 25, code=6)
    assert [i for i, s in enumerate(states(path)) if s == FAILED] == [9, 25, 28]
    assert done(path) == 33


@pytest.mark.parametrize("name", ["SIGTERM", pytest.param("SIGINT", marks=pytest.mark.long)])
def test_a_signal_stops_in_order_and_the_same_command_goes_on(tmp_path, uninterrupted, name):
    path = tmp_path / f"{name}.hdf"
    process = start(0, path, "--delay", 0.15)
    wait_for(lambda: begun(path))
    process.send_signal(getattr(signal, name))
    process.communicate(timeout=60)
    assert process.returncode == 75
    assert (states(path) == MISSING).sum() > 0
    with open_result(path) as result:
        assert result.sessions[0]["reason"].startswith(f"stopped by {name}")
        assert not result.read("status/attempts")[result.status == MISSING].any()
    ended(0, path)
    assert differing(path, uninterrupted) == []


def test_a_case_that_takes_too_long_is_abandoned_without_time_and_another_scene_refused(tmp_path, whole, uninterrupted):
    path = tmp_path / "hangs.hdf"
    process = start(0, path, "--hang", 14)
    wait_for(lambda: begun(path) and states(path)[13] == DONE)
    began = time.monotonic()
    process.terminate()
    process.communicate(timeout=60)
    assert process.returncode == 75
    assert time.monotonic() - began < 10  # the case would take a minute
    with open_result(path) as result:
        assert result.status.ravel()[14] == MISSING
        assert result.read("status/attempts").ravel()[14] == 0
    path = tmp_path / "scene.hdf"
    shutil.copy(whole, path)
    errors = ended(0, path, "--digest", "other", code=3)
    assert errors.count("error: ") == 1
    assert differing(path, uninterrupted) == []


@pytest.mark.parametrize("ranks", [0, pytest.param(2, marks=pytest.mark.long)])
def test_a_second_run_at_the_same_time_is_refused_and_status_can_be_asked(tmp_path, ranks):
    path = tmp_path / "busy.hdf"
    process = start(ranks, path, "--delay", 1.0)
    wait_for(lambda: begun(path))
    told = softjaw(0, "status", path)
    code, _, _ = study(0, path)
    process.send_signal(signal.SIGUSR1)
    process.communicate(timeout=60)
    assert (told[0], code, process.returncode) == (0, 4, 75)


@pytest.mark.parametrize(("place", "ranks", "words"), [
    ("/proc/softjaw.hdf", 2, ()), ("x.hdf", 0, ("--file-limit", 300_000)),  # space is asked for before all cases
    pytest.param("a_file/x.hdf", 0, (), marks=pytest.mark.long), pytest.param("", 0, (), marks=pytest.mark.long),
])  # fmt: skip
def test_a_place_that_cannot_be_written_or_is_too_small_is_told_once_on_all_ranks(tmp_path, place, ranks, words):
    (tmp_path / "a_file").write_text("")
    errors = ended(ranks, tmp_path / place, *words, code=5)
    assert errors.count("error: ") == 1
    assert not list(tmp_path.glob("*.part"))


@pytest.mark.parametrize("ranks", [0, pytest.param(2, marks=pytest.mark.long)])
def test_a_torn_row_is_solved_again(tmp_path, whole, uninterrupted, ranks):
    path = tmp_path / "torn.hdf"
    shutil.copy(whole, path)
    with h5py.File(path, "r+") as file:
        file["study/fingers/f_x_max"][2, 1, 0, 1, 2] += 1e-12
        file["study/patch/normal"][5, 0, 0, 0, 3, 1] = 0.0
    ended(ranks, path)
    assert differing(path, uninterrupted) == []


def test_a_bug_outside_a_case_ends_all_ranks_what_is_done_stays_and_a_finished_file_too(tmp_path, uninterrupted, whole):
    path = tmp_path / "bug.hdf"
    errors = ended(2, path, "--bug", 2, code=70)
    assert "ZeroDivisionError" in errors
    ended(0, path)
    assert differing(path, uninterrupted) == []
    path = tmp_path / "twice.hdf"
    shutil.copy(whole, path)
    ended(0, path, "--fail", 3)
    assert path.read_bytes() == whole.read_bytes()
    assert differing(path, uninterrupted) == []
    with open_result(path) as result:
        assert [s["reason"] for s in result.sessions] == ["complete"]
        assert [s["ranks"] for s in result.sessions] == [1]
        assert "numpy" in result.sessions[0]["versions"]


def test_a_signal_in_the_last_case_of_a_round_stops_before_the_next(tmp_path, monkeypatch):
    solved, path, last = [], fake_run.fake_path, 27  # cases of the first round

    def signalled(options):
        inner = path(options)

        def solve_unit(unit, wanted):
            for case in inner(unit, wanted):
                solved.append(case)
                if len(solved) == last:
                    os.kill(os.getpid(), signal.SIGUSR1)
                yield case

        return solve_unit

    monkeypatch.setattr(fake_run, "fake_path", signalled)
    assert here(fake_run.main, tmp_path / "a.hdf", "--grow")[0] == messages.STOPPED
    assert len(solved) == last
    assert here(fake_run.main, tmp_path / "a.hdf", "--grow")[0] == messages.DONE
    assert len(solved) > last
