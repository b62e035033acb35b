"""The benchmark of the kernels runs."""

import re

import pytest

from tests.benchmark import kernels


@pytest.mark.long
def test_every_kernel_has_a_time(capsys):
    kernels.every_kernel(0.01)
    rows = [line.split("|") for line in capsys.readouterr().out.splitlines() if re.search(r"\| +\d", line)]
    assert len(rows) == 12
    assert all(re.fullmatch(r" +\d[\d.e+]* (s|ms|us|ns) *", figure) for _, figure, *_ in rows)
