"""The tools of the tests: stages that never count as passed what fails, hangs or lacks a tool; kernels."""

import os
import re
import subprocess

import pytest

from tests.benchmark import kernels
from tests.blas import STANDS_IN, loaded
from tests.study.launching import ROOT

ASKED = os.environ.get("OPENBLAS_CORETYPE", "")


@pytest.mark.parametrize(("command", "word"), [
    ("9 true", "passed"), ('9 sh -c "exit 1"', "FAILED"), ('9 sh -c "exit 77"', "LEFT OUT"), ("9 no-such", "FAILED"),
    ("0.1 sleep 60", "TOO LONG"),
])  # fmt: skip
def test_only_what_ran_to_its_end_has_passed_and_no_other_stage_waits_for_it(command, word):
    words = ["make", "--silent", "--old-file=setup", "test", "STAGES=ranks serial", f"ranks={command}", "serial=9 true"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, timeout=60)
    assert re.findall(r"^(\w+(?: \w+)?) +(ranks|serial) ", done.stdout, re.M) == [(word, "ranks"), ("passed", "serial")]
    assert (done.returncode == 0) == (word == "passed")


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
