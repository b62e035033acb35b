"""Tests under another kernel of OpenBLAS run under it: the variable reaches every copy, and the kernel changes."""

from __future__ import annotations

import os
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from softjaw.study.doctor import launch_environment
from tests.blas import loaded, usable

ASK = "from tests.blas import loaded; print(*(f'{file}|{kernel}' for file, kernel in loaded().items()), sep='\\n')"


@cache
def kernels_of(**environment):
    """Kernel of every copy of OpenBLAS in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-c", ASK], capture_output=True, text=True, check=True, cwd=Path(__file__).parent.parent,
        env={**launch_environment(), **environment},
    )  # fmt: skip
    return dict(line.split("|") for line in done.stdout.splitlines() if "|" in line)


ASKED = "OPENBLAS_CORETYPE" in os.environ


@pytest.mark.skipif(not ASKED, reason="no kernel is asked for")
def test_the_kernel_that_was_asked_for_is_in_use():
    assert set(loaded().values()) == {os.environ["OPENBLAS_CORETYPE"]}


@pytest.mark.launches
@pytest.mark.skipif(ASKED, reason="a kernel is asked for")
@pytest.mark.parametrize("kernel", usable())
def test_a_kernel_can_be_asked_for(kernel):
    own = kernels_of()
    if not own:
        pytest.skip("no OpenBLAS here")
    asked = kernels_of(OPENBLAS_CORETYPE=kernel)
    assert asked.keys() == own.keys()
    assert set(asked.values()) == {kernel}
