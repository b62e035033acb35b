"""Kill -9 of one rank, of all ranks and of mpirun at random moments: no result is lost and every file goes on."""

from __future__ import annotations

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

from softjaw.study.result.layout import DONE
from softjaw.study.result.lock import holder
from softjaw.study.result.store import open_result, torn_rows
from tests.study.launching import contents, differing, start, study, wait_for

pytestmark = [pytest.mark.long, pytest.mark.ranks]
VICTIMS = ("one rank", "all ranks", "mpirun")
KILLS, ALL_KILLS = 6, 50  # of each file at most, and of all files at least
OPTIONS = ("--stations", 14, "--retry-failed")  # two kills in one case would mark it as deadly


def ranks_of(process):
    """Processes that an mpirun has started."""
    return [int(pid) for pid in Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text().split()]


def kill(process, victim, chance):
    """End some of it at once, then see the rest out; whether there was somebody to kill."""
    ranks = ranks_of(process) if process.poll() is None else []
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


def count_done(path):
    if not path.exists():
        return 0
    with open_result(path) as result:
        return int((result.status == DONE).sum())


def killed_again_and_again(path, number, chance, options=OPTIONS):
    """Kill a study several times, then let it finish; how many kills met it, and rows done when they did."""
    met, progress = 0, [set()]
    for k in range(KILLS):
        process = start(2 + number % 2, path, *options, "--delay", 0.12)  # six seconds of work
        if k or number % 3:  # in the middle of the work, else anywhere from the start on
            before = count_done(path)
            wait_for(lambda: process.poll() is not None or count_done(path) > before)  # noqa: B023
            time.sleep(chance.uniform(0.0, 0.3))
        else:
            time.sleep(chance.uniform(0.1, 1.2))
        met += kill(process, VICTIMS[(number + k) % 3], chance)
        wait_for(lambda: not holder(path))  # ranks outlive their mpirun
        progress.append(done_rows(path))
    code, _, errors = study(0, path, *options)
    assert code == 0, errors
    return met, progress


def test_no_kill_loses_a_result_of_a_study_that_gets_more_stations(tmp_path):
    """Rows have other numbers after each round, so only how many are done can be compared."""
    options, whole = ("--stations", 5, "--grow", "--retry-failed"), tmp_path / "whole.hdf"
    code, _, errors = study(0, whole, *options)
    assert code == 0, errors
    with open_result(whole) as result:
        assert 2 <= len(result.layout.added) <= sum(map(len, result.layout.added)) == 6
    expected = contents(whole)

    def campaign():
        chance, met = random.Random(7), 0
        for number in range(3):
            path = tmp_path / f"{number}.hdf"
            hits, progress = killed_again_and_again(path, number, chance, options)
            assert all(len(before) <= len(after) for before, after in pairwise(progress))
            assert differing(path, expected) == []
            assert not list(tmp_path.glob("*.grown*"))
            met += hits
        return met

    assert campaign() > 6


def test_no_kill_loses_a_result(tmp_path):
    seed = 20240721
    whole = tmp_path / "whole.hdf"
    assert study(0, whole, *OPTIONS)[0] == 0
    expected = contents(whole)

    def campaign():
        chance, met, kept, number = random.Random(seed), 0, 0, 0
        while met < ALL_KILLS:
            path = tmp_path / f"{number}.hdf"
            hits, progress = killed_again_and_again(path, number, chance)
            for before, after in pairwise(progress):
                assert before <= after, f"rows {sorted(before - after)} of {path} were lost"
            assert differing(path, expected) == []
            met, kept, number = met + hits, kept + len(progress[-1]), number + 1
            assert number < ALL_KILLS, "most runs were over before they could be killed"
        return met, kept, number

    met, kept, files = campaign()
    print(f"{met} kills of {files} files, {kept} results kept over them")
    assert kept > 5 * files
