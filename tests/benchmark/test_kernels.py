"""The benchmark of the kernels runs, and its accuracies are those that it promises."""

import re

import pytest

from tests.benchmark import kernels


@pytest.mark.long
def test_every_kernel_has_a_time_and_an_accuracy(capsys):
    for part in (kernels.friction, kernels.limit_surfaces, kernels.scores):
        part()
    kernels.linearised((8,))
    lines = [line for line in capsys.readouterr().out.splitlines() if "|" in line]
    rows = [line.split("|") for line in lines if not line.startswith("kernel ")]
    assert len(rows) >= 22
    for kernel, figure, *rest in rows:
        assert re.fullmatch(r"\d[\d.e+]* (M pairs/s|s|ms|us|ns)", figure.strip()), kernel
        assert rest[-1].strip(), kernel
        assert "nan" not in rest[-1], kernel
