"""What all tests share. Those marked ``ranks`` start mpirun themselves; none has to run under it."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: bits must not depend on the machine's cores

import pytest

from softjaw.study import pipeline


@pytest.fixture(autouse=True)
def nothing_solved(monkeypatch):
    """Each test begins without what others have solved."""
    monkeypatch.setattr(pipeline, "SOLVERS", {})
