"""Tests under another kernel of OpenBLAS run under it: the variable reaches every copy, and the kernel changes."""

from __future__ import annotations

import os

import pytest

from tests.blas import STANDS_IN, loaded

ASKED = os.environ.get("OPENBLAS_CORETYPE", "")


@pytest.mark.skipif(not ASKED, reason="no kernel is asked for")
def test_the_kernel_that_was_asked_for_is_in_use():
    kernels = set(loaded().values())
    assert kernels
    assert kernels <= {ASKED, STANDS_IN.get(ASKED)}
