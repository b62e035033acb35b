"""The tools of the tests: stages that never count as passed what fails, hangs or lacks a tool; kernels."""

import os
import re
import sys

import pytest

from tests.benchmark import kernels
from tests.blas import STANDS_IN, loaded
from tests.stages import CANNOT_RUN, Stage, fast, report, run, thorough

ASKED = os.environ.get("OPENBLAS_CORETYPE", "")


def ends(code, **keys):
    return Stage("it", (sys.executable, "-c", f"raise SystemExit({code})"), 1, **keys)


@pytest.mark.parametrize(("stage", "passed", "code"), [
    (ends(0), True, 0), (ends(1), False, 1), (ends(CANNOT_RUN), None, 2),
    (ends(0, needs=("no-such-program",)), None, 2), (Stage("it", ("sleep", "60"), 0.001), False, 1),
])  # fmt: skip
def test_only_what_ran_to_its_end_has_passed(stage, passed, code):
    outcome = run(stage)
    assert outcome.passed is passed
    assert report("test", [run(ends(0)), outcome]) == code


def test_a_test_has_one_stage():
    names = [stage.name for stage in (*fast(), *thorough())]
    assert len(set(names)) == len(names)
    assert {"serial", "ranks", "long", "long-ranks", "slurm"} <= set(names)


@pytest.mark.skipif(not ASKED, reason="no kernel is asked for")
def test_the_kernel_that_was_asked_for_is_in_use():
    kernels = set(loaded().values())
    assert kernels
    assert kernels <= {ASKED, STANDS_IN.get(ASKED)}


@pytest.mark.long
def test_every_kernel_has_a_time(capsys):
    kernels.every_kernel(0.01)
    rows = [line.split("|") for line in capsys.readouterr().out.splitlines() if re.search(r"\| +\d", line)]
    assert len(rows) == 12
    assert all(re.fullmatch(r" +\d[\d.e+]* (s|ms|us|ns) *", figure) for _, figure, *_ in rows)
