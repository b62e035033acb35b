"""What all tests share. Those marked ``ranks`` start mpirun themselves; none has to run under it."""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy: bits must not depend on the machine's cores


import pytest

from softjaw.study import pipeline
from softjaw.study.case import sampler


@pytest.fixture(autouse=True)
def nothing_solved(monkeypatch):
    """Each test begins without what others have solved."""
    monkeypatch.setattr(pipeline, "SOLVERS", {})


@pytest.fixture
def plans_in_no_time(monkeypatch):
    """Of plans what they solve to time it is no matter, and few places tell whether there is a sampled grasp."""
    monkeypatch.setattr(pipeline, "solve_unit", lambda unit, *_: enumerate(unit.rows[0]))
    monkeypatch.setattr(sampler, "SAMPLES", 6)
