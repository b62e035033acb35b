"""What one case, one rank or one disk can do to a study: fail its own cases, end the run with a sentence, no more."""

import contextlib
import gc
import os
import resource
import signal
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp

from softjaw.fem.assembly import Pattern
from softjaw.fem.petsc import NonlinearSolver, take_buffers
from softjaw.study.case.result import TimeLimitError
from softjaw.study.messages import CANNOT_WRITE, USAGE, StudyError
from softjaw.study.result.lock import OpenedFile
from softjaw.study.run import limits
from softjaw.study.run.limits import GRACE, AbandonedError, Stopper, available, limited_memory, listen
from tests.study.launching import launch, refusal


def wait():
    """A solver that goes on for ever, but comes back to Python now and then."""
    while True:
        time.sleep(0.01)


def wrapped():
    """What compiled loops make of an interruption."""
    try:
        wait()
    except BaseException as error:
        raise SystemError("a result with an exception set") from error


def test_what_takes_too_long_is_interrupted_but_not_the_next():
    with Stopper(lambda: None, 0.1) as stopper:
        with pytest.raises(TimeLimitError), stopper.case():
            wait()
        time.sleep(0.15)  # between two cases nothing is raised
        with stopper.case():
            pass
        with pytest.raises(TimeLimitError), stopper.case():
            wait()
        with pytest.raises(TimeLimitError), stopper.case():
            wrapped()
        with pytest.raises(SystemError), stopper.case():
            raise SystemError
    assert signal.getsignal(signal.SIGALRM) == signal.SIG_DFL


@pytest.mark.parametrize("begin", [listen, lambda: Stopper(lambda: None).__enter__().__exit__()])
def test_a_signal_before_or_between_sessions_ends_no_process_and_stops_the_next_session(begin):
    before = signal.getsignal(signal.SIGUSR1)
    signal.signal(signal.SIGUSR1, signal.SIG_DFL)
    told = []
    try:
        begin()
        os.kill(os.getpid(), signal.SIGUSR1)
        assert signal.getsignal(signal.SIGUSR1) != signal.SIG_IGN  # which children would inherit
        with Stopper(lambda: told.append("stop")) as stopper:
            pass
        with Stopper(lambda: told.append("again")) as next_one:
            pass
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert (stopper.name, next_one.name, told) == ("SIGUSR1", "", ["stop"])


def test_an_interruption_that_was_swallowed_comes_again_and_a_signal_stops_before_the_time_limit(monkeypatch):
    monkeypatch.setattr("softjaw.study.run.limits.RAISE_AGAIN_S", 0.05)

    def deaf():
        with contextlib.suppress(TimeLimitError):  # as what is raised inside a finaliser is
            wait()
        wait()

    with Stopper(lambda: None, 0.05) as stopper, pytest.raises(TimeLimitError), stopper.case():
        deaf()
    monkeypatch.setitem(GRACE, signal.SIGUSR1, 0.05)
    told = []

    def interrupted():
        os.kill(os.getpid(), signal.SIGUSR1)
        wait()

    with Stopper(lambda: told.append("stop"), 60.0) as stopper, pytest.raises(AbandonedError), stopper.case():
        interrupted()
    assert (told, stopper.name) == (["stop"], "SIGUSR1")


def test_memory_is_bounded_the_bound_goes_away_and_linear_algebra_is_not_let_loose_without_room():
    before = resource.getrlimit(resource.RLIMIT_AS)
    gc.collect()  # what earlier tests left would make room
    with limited_memory(0.3, 1):
        np.empty(10**7)  # 80 MB
        with pytest.raises(MemoryError):
            np.empty(4 * 10**8)  # more than this process can have given back meanwhile
    assert resource.getrlimit(resource.RLIMIT_AS) == before
    np.empty(4 * 10**8)
    called = []
    with limited_memory(0.05, 1), pytest.raises(MemoryError):
        take_buffers(lambda: called.append(1))
    take_buffers(lambda: called.append(2))
    assert called == [2]


@pytest.mark.parametrize("kilobytes", [300_000, 850_000, pytest.param(1_100_000, marks=pytest.mark.long)])
def test_a_run_with_too_few_addresses_says_so_at_once(tmp_path, kilobytes):
    """From 0.8 to 0.92 GB the run's first product in BLAS asked for memory for ever; below, and above, it crashed."""
    bytes_ = 1024 * kilobytes
    words = ("-m", "softjaw", "run", "jobs/smoke.toml", "-o", tmp_path / "out.hdf")
    code, _, errors = launch(0, *words, preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (bytes_, bytes_)))
    assert code == USAGE
    assert len(errors.splitlines()) == 1
    assert not list(tmp_path.iterdir())


def solved_without_memory(limit):
    """Whether factors of 36^3 unknowns of a Laplacian, more than 100 MB, found too little and then enough."""
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
    try:
        with limited_memory(limit, 1):
            solver.solve(np.zeros(problem.size), 1e-6)
    except MemoryError:
        x, _ = solver.solve(np.zeros(problem.size), 1e-6)
        return bool(np.linalg.norm(A @ x - 1.0) < 1e-6)
    return False


@pytest.mark.long
def test_factors_that_find_no_memory_say_so_and_the_next_solve_works():
    """MUMPS alone would call the system one that diverged. A new process holds no memory of other tests."""
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as alone:
        assert alone.submit(solved_without_memory, 0.02).result()


def test_the_share_of_a_rank_follows_its_control_group_and_a_file_that_was_moved_is_noticed(tmp_path, monkeypatch):
    files = {"memory.max": "8000000000", "memory.current": "7000000000", "memory.stat": "inactive_file 3000000000\n"}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    monkeypatch.setattr(limits, "CGROUPS", tmp_path)
    ask = limits._lines
    asked = {"/proc/self/cgroup": ["0::/"], "/proc/meminfo": ["MemAvailable:   9000000 kB"]}
    monkeypatch.setattr(limits, "_lines", lambda path: asked.get(str(path)) or ask(path))
    assert available() == pytest.approx(4e9)  # 8 - 7 + 3 GB; the machine itself would have 9.2
    (tmp_path / "memory.max").write_text("max\n")
    assert available() == pytest.approx(1024 * 9e6)
    path = tmp_path / "out.hdf"
    path.write_text("1")
    standing = OpenedFile(path)
    standing.check()
    path.rename(tmp_path / "moved.hdf")
    with pytest.raises(StudyError):
        standing.check()
    path.write_text("2")
    with refusal(CANNOT_WRITE):
        standing.check()
    with refusal(CANNOT_WRITE, match="No space"), standing.writing():
        raise OSError("No space left on device")
