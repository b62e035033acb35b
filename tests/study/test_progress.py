"""The line that tells how far a run has come."""

from __future__ import annotations

import io

import numpy as np
import pytest

from softjaw.study.result.layout import DONE, MISSING
from softjaw.study.run.progress import Progress


class Run:
    """A run of 100 equal cases whose clock stands where the test puts it."""

    def __init__(self, cases=100, already=0):
        self.now, self.codes = 0.0, np.full(cases, MISSING)
        self.codes[:already] = DONE
        self.progress = Progress(np.ones(cases), self.codes, io.StringIO(), live=False, clock=lambda: self.now)

    def at(self, now, done):
        self.now = now
        self.codes = np.where(np.arange(len(self.codes)) < done, DONE, MISSING)
        return self.progress.line(self.codes)


def test_compiling_is_not_taken_for_solving():
    run = Run()
    assert run.at(30.0, 2) == "2/100 done"  # 30 s of compiling
    assert run.at(31.0, 12) == "12/100 done"  # ten cases, but one second
    assert run.at(40.0, 20) == "20/100 done, 0.556 s/case, 44 s left"  # 18 cases in 10 s; 80 are left
    assert run.at(70.0, 82) == "82/100 done, 0.5 s/case, 9.0 s left"


@pytest.mark.parametrize(("cases", "enough"), [(20, 5), (1000, 30), (100_000, 50)])
def test_a_rest_is_foretold_after_enough_cases(cases, enough):
    run = Run(cases)
    run.at(1.0, 1)
    assert "left" not in run.at(20.0, enough)
    assert "left" in run.at(20.0, enough + 1)


def test_cases_of_earlier_sessions_do_not_count():
    run = Run(already=50)
    assert run.at(9.0, 51) == "51/100 done"
    assert run.at(19.0, 61) == "61/100 done, 1 s/case, 39 s left"
