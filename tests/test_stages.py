"""The tools of the tests: stages that never count as passed what fails, hangs or lacks a tool; mutations; kernels."""

import os
import re
import sys

import pytest

from tests.benchmark import kernels
from tests.blas import STANDS_IN, loaded
from tests.stages import CANNOT_RUN, Stage, fast, report, run, thorough
from tests.tools.mutate import FOLDERS, KINDS, ROOT, Mutation, mutated, mutations, sample

ASKED = os.environ.get("OPENBLAS_CORETYPE", "")
SOURCE = """def area(a, b):
    if a < 0 and b[1]:
        return -a * 2.5
"""


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


def test_every_kind_of_mutation_changes_the_place_that_it_names(tmp_path):
    (tmp_path / "area.py").write_text(SOURCE)
    found = {(m.kind, m.old, m.new) for m in mutations(tmp_path / "area.py", tmp_path)}
    assert {
        ("operator", "a < 0", "(a > 0)"), ("condition", "a < 0 and b[1]", "((a < 0) or (b[1]))"),
        ("condition", "a < 0 and b[1]", "(not (a < 0 and b[1]))"), ("index", "1", "2"), ("sign", "-a", "(+a)"),
        ("constant", "2.5", "5.0"), ("operator", "-a * 2.5", "((-a) / (2.5))"),
    } <= found
    change = Mutation("area.py", 3, 15, "sign", "-a", "(+a)")
    assert mutated(SOURCE, change) == SOURCE.replace("-a", "(+a)")
    with pytest.raises(ValueError, match=r"area\.py:2"):
        mutated(SOURCE, Mutation("area.py", 2, 0, "sign", "-a", "(+a)"))


@pytest.mark.long
def test_a_sample_of_mutations_depends_on_its_seed_alone_and_holds_every_kind():
    mutants = sample(50, seed=1)
    assert mutants == sample(50, seed=1) != sample(50, seed=2)
    assert {m.kind for m in mutants} == set(KINDS)
    for m in mutants:
        assert m.file.startswith(FOLDERS)
        compile(mutated((ROOT / m.file).read_text(), m), m.file, "exec")


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
