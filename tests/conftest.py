"""What tests need to work on one rank and under mpirun: sharing the tests, asserting together, sharing a folder."""

from __future__ import annotations

import os
import time
from types import SimpleNamespace

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: bits must not depend on the machine's cores

import pytest

from softjaw.study.messages import RANK

LAUNCHED = ("OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_RANK")


def _alone() -> SimpleNamespace:
    return SimpleNamespace(
        rank=0, size=1, allgather=lambda x: [x], bcast=lambda x, root=0: x, Barrier=lambda: None, barrier=lambda: None
    )


def _world():
    """All ranks that run the tests; a stand-in of one rank where nobody started MPI."""
    if not any(name in os.environ for name in LAUNCHED):
        return _alone()
    from mpi4py import MPI

    return MPI.COMM_WORLD


def pytest_addoption(parser):
    parser.addoption("--every-rank", action="store_true", help="under mpirun every rank runs all tests")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config, items):
    """Under mpirun the ranks share the tests, but run together those that use ``comm``, at the end.

    One rank alone is stricter than all of them at once: a test that needs the others without saying so hangs.
    """
    world = _world()
    if world.size == 1 or config.getoption("--every-rank"):
        return
    together = [item for item in items if "comm" in item.fixturenames]
    single = [item for item in items if "comm" not in item.fixturenames]
    mine = single[world.rank :: world.size]
    config.hook.pytest_deselected(items=[item for k, item in enumerate(single) if k % world.size != world.rank])
    items[:] = mine + together


@pytest.fixture
def every_rank_speaks(monkeypatch):
    """Under mpirun only the first rank prints; with this each rank can look at its own answers."""
    for name in RANK:
        monkeypatch.delenv(name, raising=False)


@pytest.fixture(scope="session")
def comm():
    """All ranks, for what they do together."""
    return _world()


@pytest.fixture
def agree(comm):
    """Assert on all ranks at once, so that no rank waits for one that failed."""

    def check(ok: bool, message: str = "") -> None:
        failed = [rank for rank, good in enumerate(comm.allgather(bool(ok))) if not good]
        assert not failed, f"failed on ranks {failed}: {message}"

    return check


@pytest.fixture
def shared_path(comm, tmp_path):
    """One temporary folder for all ranks."""
    return comm.bcast(tmp_path)


@pytest.fixture
def once(comm):
    """Call a function on rank 0 only and give what it returns to all ranks, or raise there what it raised.

    The other ranks sleep meanwhile: the programs that such a function starts need their cores.
    """

    def call(function, *arguments):
        answer = (None, None)
        if comm.rank == 0:
            try:
                answer = (function(*arguments), None)
            except Exception as error:
                answer = (None, error)
        if comm.size > 1:
            arrived = comm.Ibarrier()
            while not arrived.Test():
                time.sleep(0.02)
        value, error = comm.bcast(answer)
        if error is not None:
            raise error
        return value

    return call
