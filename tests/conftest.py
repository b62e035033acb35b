"""What all tests share. Those marked ``ranks`` start mpirun themselves; none has to run under it."""

from __future__ import annotations

import os
from types import SimpleNamespace

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: bits must not depend on the machine's cores

import pytest


@pytest.fixture
def every_rank_speaks():
    """Each test is on its own rank."""


@pytest.fixture(scope="session")
def comm():
    """The one rank that runs the tests."""
    return SimpleNamespace(rank=0, size=1, bcast=lambda value, root=0: value)


@pytest.fixture
def shared_path(tmp_path):
    """A temporary folder."""
    return tmp_path


@pytest.fixture
def once():
    """Call a function."""
    return lambda function, *arguments: function(*arguments)
