"""What one case, one rank or one disk can do to a study: fail its own cases, end the run with a sentence, no more."""

from __future__ import annotations

import contextlib
import os
import resource
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

from softjaw.fem.assembly import Pattern
from softjaw.fem.petsc import NonlinearSolver, take_buffers
from softjaw.study.case.result import TimeLimitError
from softjaw.study.doctor import launch_environment
from softjaw.study.messages import CANNOT_WRITE, SOME_FAILED, STOPPED, USAGE, StudyError
from softjaw.study.result.layout import DONE, FAILED, MISSING
from softjaw.study.result.lock import OpenedFile
from softjaw.study.result.store import open_result
from softjaw.study.run import limits
from softjaw.study.run.limits import GRACE, AbandonedError, Stopper, available, limited_memory
from tests.study.launching import ROOT, contents, differing, start, study, wait_for


def wait():
    """A solver that goes on for ever, but comes back to Python now and then."""
    while True:
        time.sleep(0.01)


def test_a_signal_of_a_batch_system_after_the_end_does_not_fail_the_run():
    before = signal.getsignal(signal.SIGUSR1)
    signal.signal(signal.SIGUSR1, signal.SIG_DFL)
    try:
        with Stopper(lambda: None):
            pass
        os.kill(os.getpid(), signal.SIGUSR1)
        assert signal.getsignal(signal.SIGUSR1) != signal.SIG_IGN  # which children would inherit
    finally:
        signal.signal(signal.SIGUSR1, before)


def test_a_case_that_takes_too_long_is_interrupted_and_the_next_one_is_not():
    with Stopper(lambda: None, 0.1) as stopper:
        with pytest.raises(TimeLimitError), stopper.case():
            wait()
        time.sleep(0.15)  # between two cases nothing is raised
        with stopper.case():
            pass
        with pytest.raises(TimeLimitError), stopper.case():
            wait()
    assert signal.getsignal(signal.SIGALRM) == signal.SIG_DFL


def test_an_interruption_that_was_swallowed_comes_again(monkeypatch):
    monkeypatch.setattr("softjaw.study.run.limits.RAISE_AGAIN_S", 0.05)

    def deaf():
        with contextlib.suppress(TimeLimitError):  # as what is raised inside a finaliser is
            wait()
        wait()

    with Stopper(lambda: None, 0.05) as stopper, pytest.raises(TimeLimitError), stopper.case():
        deaf()


def test_a_signal_stops_before_the_time_limit_does(monkeypatch):
    monkeypatch.setitem(GRACE, signal.SIGUSR1, 0.05)
    told = []

    def interrupted():
        os.kill(os.getpid(), signal.SIGUSR1)
        wait()

    with Stopper(lambda: told.append("stop"), 60.0) as stopper, pytest.raises(AbandonedError), stopper.case():
        interrupted()
    assert (told, stopper.name) == (["stop"], "SIGUSR1")


def test_memory_is_bounded_and_the_bound_goes_away():
    before = resource.getrlimit(resource.RLIMIT_AS)
    with limited_memory(0.3, 1):
        np.empty(10**7)  # 80 MB
        with pytest.raises(MemoryError):
            np.empty(10**8)
    assert resource.getrlimit(resource.RLIMIT_AS) == before
    np.empty(10**8)


@pytest.mark.parametrize("kilobytes", [300_000, 850_000, pytest.param(1_100_000, marks=pytest.mark.long)])
def test_a_run_with_too_few_addresses_says_so_at_once(tmp_path, kilobytes):
    """From 0.8 to 0.92 GB the run's first product in BLAS asked for memory for ever; below, and above, it crashed."""
    bytes_ = 1024 * kilobytes
    done = subprocess.run(
        [sys.executable, "-m", "softjaw", "run", "jobs/smoke.toml", "-o", tmp_path / "out.hdf"], cwd=ROOT,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (bytes_, bytes_)), env=launch_environment(),
        capture_output=True, text=True, timeout=60, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    assert done.returncode == USAGE
    assert len(done.stderr.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_libraries_of_linear_algebra_are_not_let_loose_without_room():
    called = []
    with limited_memory(0.05, 1), pytest.raises(MemoryError):
        take_buffers(lambda: called.append(1))
    take_buffers(lambda: called.append(2))
    assert called == [2]


@pytest.mark.long
def test_factors_that_find_no_memory_say_so_and_the_next_solve_works():
    """36^3 unknowns of a Laplacian take more than 100 MB; MUMPS alone would call the system one that diverged."""
    second = sp.diags([-1.0, 2.0, -1.0], [-1, 0, 1], shape=(36, 36))
    A = sp.kronsum(sp.kronsum(second, second), second).tocoo()
    rows, columns = A.row.astype(np.int32), A.col.astype(np.int32)
    pattern = Pattern(A.shape[0], rows, columns)
    pattern.values[pattern.slots(rows, columns)] = A.data
    problem = SimpleNamespace(
        size=A.shape[0], pattern=pattern, residual=lambda x: A @ x - 1.0, tangent=lambda x: None,
        shorten=lambda x, step: 1.0,
    )  # fmt: skip
    solver = NonlinearSolver(problem)
    with limited_memory(0.02, 1), pytest.raises(MemoryError):
        solver.solve(np.zeros(problem.size), 1e-6)
    x, _ = solver.solve(np.zeros(problem.size), 1e-6)
    assert np.linalg.norm(A @ x - 1.0) < 1e-6
    solver.destroy()


def test_the_share_of_a_rank_follows_the_machine_and_its_control_group(tmp_path, monkeypatch):
    files = {"memory.max": "8000000000", "memory.current": "7000000000", "memory.stat": "inactive_file 3000000000\n"}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(limits, "CGROUPS", tmp_path)
    ask = limits._lines
    asked = {"/proc/self/cgroup": ["0::/"], "/proc/meminfo": ["MemAvailable:   9000000 kB"]}
    monkeypatch.setattr(limits, "_lines", lambda path: asked.get(str(path)) or ask(path))
    assert available() == 4e9  # 8 - 7 + 3 GB; the machine itself would have 9.2
    (tmp_path / "memory.max").write_text("max\n")
    assert available() == 1024 * 9e6


def test_a_file_that_was_moved_or_replaced_is_noticed(tmp_path):
    path = tmp_path / "out.hdf"
    path.write_text("1")
    standing = OpenedFile(path)
    standing.check()
    path.rename(tmp_path / "moved.hdf")
    with pytest.raises(StudyError):
        standing.check()
    path.write_text("2")
    with pytest.raises(StudyError) as refusal:
        standing.check()
    assert refusal.value.code == CANNOT_WRITE
    with pytest.raises(StudyError, match=r"cannot be written any more \(No space.*the same command again"):
        with standing.writing():
            raise OSError("No space left on device")


# --- under mpirun ----------------------------------------------------------------------------------------------------


def states(path):
    with open_result(path) as result:
        return result.status.ravel(), result.messages.ravel()


def whole(folder, *words):
    """What an undisturbed run writes."""
    assert study(0, folder / "whole.hdf", *words)[0] == 0
    return contents(folder / "whole.hdf")


@pytest.mark.long
@pytest.mark.ranks
@pytest.mark.parametrize(
    ("how", "ranks", "text"),
    [
        ("hang", 2, "not solved within 3 s"),
        ("stuck", 3, "did not come back to Python within 6 s, so its rank was given up"),
        ("greedy", 2, "more memory than run.memory_gb leaves to a rank"),
    ],
)
def test_one_case_fails_with_its_reason_and_the_others_go_on(tmp_path, how, ranks, text):
    path = tmp_path / f"{how}.hdf"
    code, _, errors = study(ranks, path, f"--{how}", 13, *([] if how == "greedy" else ["--limit", 3]))
    assert code == SOME_FAILED, errors
    codes, messages = states(path)
    # the case, the force above it, and both for the other candidate of the unit
    assert [row for row, code in enumerate(codes) if code == FAILED] == [13, 14, 16, 17]
    assert (codes[[row for row in range(36) if row not in (13, 14, 16, 17)]] == DONE).all()
    assert messages[13].startswith(text)
    assert study(0, path, "--retry-failed")[0] == 0
    assert differing(path, whole(tmp_path)) == []


@pytest.mark.long
@pytest.mark.ranks
def test_a_single_process_that_hangs_ends_itself_and_gives_the_case_up_the_third_time(tmp_path):
    path = tmp_path / "alone.hdf"
    for _ in range(2):
        code, _, errors = study(0, path, "--stuck", 13, "--limit", 1)
        assert code == 1
        assert "Timeout (0:00:02)!" in errors  # and where it was in Python
    assert study(0, path, "--stuck", 13, "--limit", 1)[0] == SOME_FAILED
    assert [row for row, code in enumerate(states(path)[0]) if code == FAILED] == [13, 14, 16, 17]


@pytest.mark.long
@pytest.mark.ranks
@pytest.mark.parametrize(("how", "ranks"), [("unplug", 0), ("unplug", 3), ("remove", 0), ("remove", 2)])
def test_a_place_that_gets_lost_ends_the_run_with_one_sentence(tmp_path, how, ranks):
    path = tmp_path / "lost.hdf"
    code, _, errors = study(ranks, path, f"--{how}", 13)
    assert code == CANNOT_WRITE, errors
    assert errors.count("error: ") == 1  # Open MPI adds lines of its own
    assert "Traceback" not in errors
    if how == "unplug":
        assert (states(path)[0] == DONE).any()
    assert study(2, path)[0] == 0
    assert differing(path, whole(tmp_path)) == []


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 3 MB."""

    def mount():
        words = ["mount", "-t", "tmpfs", "-o", "size=3m", "tmpfs", tmp_path]
        return subprocess.run(words, capture_output=True).returncode == 0

    if not mount():
        pytest.skip("no right to mount a small file system")
    yield tmp_path
    subprocess.run(["umount", "-l", tmp_path], check=True)


def fill(folder):
    """Take all space that is left."""
    with contextlib.suppress(OSError), (folder / "filler").open("wb", buffering=0) as file:
        while file.write(b"x" * 4096):
            pass


@pytest.mark.long
@pytest.mark.ranks
def test_a_file_system_that_did_not_reserve_the_space_ends_the_run_and_keeps_what_is_stored(small_disk):
    """The file's space is given back by hand, as a file system that copies on write would have to take it anew."""
    path = small_disk / "holes.hdf"

    def run():
        process = start(2, path, "--delay", 0.15)
        wait_for(lambda: path.exists() and (states(path)[0] == DONE).sum() >= 6)
        process.send_signal(signal.SIGUSR1)
        process.communicate(timeout=60)
        before = states(path)[0]
        subprocess.run(["cp", "--sparse=always", path, small_disk / "sparse"], check=True)
        (small_disk / "sparse").replace(path)
        fill(small_disk)
        refused = study(2, path)
        after = states(path)[0]
        (small_disk / "filler").unlink()
        return before, refused, after, study(2, path)

    before, (code, _, errors), after, (last, _, _) = run()
    assert code == CANNOT_WRITE, errors
    assert "Traceback" not in errors
    assert (after[before == DONE] == DONE).all()
    assert last == 0


@pytest.mark.long
@pytest.mark.ranks
def test_a_file_system_that_turns_read_only_is_told_once(small_disk):
    path = small_disk / "readonly.hdf"

    def run():
        assert study(0, path)[0] == 0
        subprocess.run(["mount", "-o", "remount,ro", small_disk], check=True)
        answers = study(2, path), study(2, small_disk / "new.hdf")
        subprocess.run(["mount", "-o", "remount,rw", small_disk], check=True)
        return answers

    for code, _, errors in run():
        assert code == CANNOT_WRITE, errors
        assert errors.count("error: ") == 1
        assert "Read-only file system" in errors


@pytest.mark.long
@pytest.mark.ranks
@pytest.mark.parametrize("name", ["SIGTERM", "SIGUSR1"])
def test_ranks_leave_in_order_when_mpirun_is_told_to_stop(tmp_path, name):
    """mpirun answers TERM with 1, whatever its ranks say, and kills them after some two seconds: they are quicker."""
    path = tmp_path / "stopped.hdf"

    def stop():
        process = start(2, path, "--hang", 14, "--delay", 0.1)
        wait_for(lambda: path.exists() and states(path)[0][13] == DONE)
        began = time.monotonic()
        process.send_signal(getattr(signal, name))
        if name == "SIGUSR1":  # a second signal: there is no time after all
            time.sleep(0.3)
            process.send_signal(signal.SIGUSR1)
        process.communicate(timeout=60)
        return process.returncode, time.monotonic() - began

    code, seconds = stop()
    assert code == (1 if name == "SIGTERM" else STOPPED)
    assert seconds < 20  # the case would take a minute
    with open_result(path) as result:
        assert result.sessions[0]["reason"].startswith("stopped by SIG")
        missing = result.status.ravel() == MISSING
        assert not result.read("status/attempts").ravel()[missing].any()
    assert study(0, path)[0] == 0
    assert differing(path, whole(tmp_path)) == []
