"""Kills, hangs and full disks under mpirun: no result is lost, only the case itself fails, and every file goes on."""

import os
import random
import shutil
import signal
import subprocess
import time
from itertools import pairwise
from pathlib import Path

import h5py
import numpy as np
import pytest

from softjaw.study.messages import CANNOT_WRITE, SOME_FAILED, STOPPED
from softjaw.study.quantities import DONE, FAILED, MISSING
from softjaw.study.result.lock import holder
from softjaw.study.result.store import open_result, torn_rows
from tests.study.launching import contents, differing, done, ended, start, states, wait_for

pytestmark = [pytest.mark.long, pytest.mark.ranks]
VICTIMS = ("one rank", "all ranks", "mpirun")
KILLS, ALL_KILLS = 6, 50  # of each file at most, and of all files at least
OPTIONS = ("--stations", 14, "--retry-failed")  # two kills in one case would mark it as deadly
GROWING = ("--stations", 5, "--grow", "--retry-failed")


def kill(process, victim, chance):
    """End some of it at once, then see the rest out; whether there was somebody to kill."""
    children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    ranks = [int(pid) for pid in children.read_text().split()] if process.poll() is None else []
    chosen = {"one rank": chance.sample(ranks, min(1, len(ranks))), "all ranks": ranks, "mpirun": [process.pid]}[victim]
    for pid in chosen if ranks else ():
        os.kill(pid, signal.SIGKILL)
    process.communicate(timeout=60)
    return bool(ranks)


def done_rows(path):
    """Rows that are marked done; each must match its checksum, and ordinary tools must open the file."""
    if not path.exists():
        return set()
    with h5py.File(path, "r") as file:
        assert file.attrs["default"]
    for tool in (["h5ls", "-r"], ["h5dump", "-d", "/study/status/code"]):
        if shutil.which(tool[0]):
            assert subprocess.run([*tool, path], capture_output=True, timeout=60).returncode == 0
    with open_result(path) as result:
        layout, codes = result.layout, result.codes.ravel()
    assert torn_rows(path, layout) == []
    return set(np.flatnonzero(codes == DONE).tolist())


def killed_again_and_again(path, number, chance, options):
    """Kill a study several times, then let it finish; how many kills met it, and rows done when they did."""
    met, progress = 0, [set()]
    for k in range(KILLS):
        process = start(2 + number % 2, path, *options, "--delay", 0.12)  # six seconds of work
        if k or number % 3:  # in the middle of the work, else anywhere from the start on
            before = done(path)
            wait_for(lambda: process.poll() is not None or done(path) > before)  # noqa: B023
            time.sleep(chance.uniform(0.0, 0.3))
        else:
            time.sleep(chance.uniform(0.1, 1.2))
        met += kill(process, VICTIMS[(number + k) % 3], chance)
        wait_for(lambda: not holder(path))  # ranks outlive their mpirun
        progress.append(done_rows(path))
    ended(0, path, *options)
    return met, progress


@pytest.mark.parametrize(("options", "kills"), [(OPTIONS, ALL_KILLS), (GROWING, 7)], ids=["stations", "growing"])
def test_no_kill_loses_a_result(tmp_path, options, kills):
    """Rows of a study that grows have other numbers after each round: only how many are done can be compared."""
    expected, chance = whole(tmp_path, *options), random.Random(20240721)
    with open_result(tmp_path / "whole.hdf") as result:
        assert sum(map(len, result.layout.added)) == (6 if options is GROWING else 0)
    met, kept, number = 0, 0, 0
    while met < kills:
        path = tmp_path / f"{number}.hdf"
        hits, progress = killed_again_and_again(path, number, chance, options)
        for before, after in pairwise(progress):
            assert before <= after or (options is GROWING and len(before) <= len(after)), f"{path}: {before - after}"
        assert differing(path, expected) == []
        assert not list(tmp_path.glob("*.grown*"))
        met, kept, number = met + hits, kept + len(progress[-1]), number + 1
        assert number < ALL_KILLS, "most runs were over before they could be killed"
    print(f"{met} kills of {number} files, {kept} results kept over them")
    assert options is GROWING or kept > 5 * number


def whole(folder, *words):
    ended(0, folder / "whole.hdf", *words)
    return contents(folder / "whole.hdf")


@pytest.mark.parametrize(("how", "ranks", "text"), [
    ("hang", 2, "not solved within 3 s"),
    ("greedy", 2, "more memory than run.memory_gb leaves to a rank"),
])  # fmt: skip
def test_one_case_fails_with_its_reason_and_the_others_go_on(tmp_path, how, ranks, text):
    path = tmp_path / f"{how}.hdf"
    ended(ranks, path, f"--{how}", 13, *([] if how == "greedy" else ["--limit", 3]), code=SOME_FAILED)
    with open_result(path) as result:
        codes, messages = result.status.ravel(), result.messages.ravel()
    # the case, the force above it, and both for the other candidate of the unit
    assert [row for row, code in enumerate(codes) if code == FAILED] == [13, 14, 16, 17]
    assert (codes[[row for row in range(36) if row not in (13, 14, 16, 17)]] == DONE).all()
    assert messages[13].startswith(text)
    ended(0, path, "--retry-failed")
    assert differing(path, whole(tmp_path)) == []


@pytest.mark.parametrize("ranks", [0, 3])
def test_a_rank_that_hangs_ends_the_run_and_the_case_is_given_up_the_third_time(tmp_path, ranks):
    path = tmp_path / "stuck.hdf"
    for _ in range(2):
        errors = ended(ranks, path, "--stuck", 13, "--limit", 1, code=1)
        assert "Timeout (0:00:06)!" in errors  # five seconds beyond the limit; and where it was in Python
    ended(ranks, path, "--stuck", 13, "--limit", 1, code=SOME_FAILED)
    assert [row for row, code in enumerate(states(path)) if code == FAILED] == [13, 14, 16, 17]


@pytest.mark.parametrize(("how", "ranks"), [("unplug", 0), ("unplug", 3), ("remove", 0), ("remove", 2)])
def test_a_place_that_gets_lost_ends_the_run_with_one_sentence(tmp_path, how, ranks):
    path = tmp_path / "lost.hdf"
    errors = ended(ranks, path, f"--{how}", 13, code=CANNOT_WRITE)
    assert errors.count("error: ") == 1  # Open MPI adds lines of its own
    assert "Traceback" not in errors
    if how == "unplug":
        assert done(path)
    ended(2, path)
    assert differing(path, whole(tmp_path)) == []


@pytest.mark.parametrize("name", ["SIGTERM", "SIGUSR1"])
def test_ranks_leave_in_order_when_mpirun_is_told_to_stop(tmp_path, name):
    """mpirun answers TERM with 1, whatever its ranks say, and kills them after some two seconds: they are quicker."""
    path = tmp_path / "stopped.hdf"
    process = start(2, path, "--hang", 14, "--delay", 0.1)
    wait_for(lambda: path.exists() and states(path)[13] == DONE)
    began = time.monotonic()
    process.send_signal(getattr(signal, name))
    if name == "SIGUSR1":  # a second signal: there is no time after all
        time.sleep(0.3)
        process.send_signal(signal.SIGUSR1)
    process.communicate(timeout=60)
    assert process.returncode == (1 if name == "SIGTERM" else STOPPED)
    assert time.monotonic() - began < 20  # the case would take a minute
    with open_result(path) as result:
        assert result.sessions[0]["reason"].startswith("stopped by SIG")
        missing = result.status.ravel() == MISSING
        assert not result.read("status/attempts").ravel()[missing].any()
    ended(0, path)
    assert differing(path, whole(tmp_path)) == []
