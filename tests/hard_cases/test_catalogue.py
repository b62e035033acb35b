"""Catalogues are run from the command line: a small one, and the whole one that is shipped."""

from __future__ import annotations

import pytest

from tests.hard_cases.test_verdicts import HARD, catalogue
from tests.study.launching import launch

COARSE = "gripper = { elements = [4, 2, 2] }\n"
CASES = (
    f'name = "right"\nkind = "k"\n{COARSE}remark = "coarse"',
    f'name = "half"\nkind = "k"\n{COARSE}remark = "coarse"\neffects.model_size = "half"\n'
    'same_as = { case = "right", within = 1e-8 }',
    'name = "refused"\nkind = "k"\nfriction.mu = 11\nexpect = "refused"\nreason = "friction.mu: found 11"',
    f'name = "wrong"\nkind = "k"\n{COARSE}expect = "failed"\nreason = "collapsed"',
)


def verdicts(output):
    """Last word of every line of the table, by case."""
    lines = output.splitlines()
    start = next(k for k, line in enumerate(lines) if line.startswith("class"))
    return {line.split()[1]: line.split()[-1] for line in lines[start + 1 : lines.index("", start)]}


@pytest.mark.launches
@pytest.mark.parametrize("ranks", [0, pytest.param(2, marks=pytest.mark.long)])
def test_a_catalogue_is_solved_judged_and_printed_again(once, shared_path, ranks):
    folder = shared_path / "out"

    def run(*words):
        path = catalogue(shared_path, *CASES)
        return launch(ranks, "-m", "softjaw", "run", path, "-o", folder, *words)

    code, output, errors = once(run)
    assert code == 6
    assert not errors or ranks  # mpirun has something to say of every exit code but 0
    assert verdicts(output) == {"right": "ok", "half": "ok", "refused": "ok", "wrong": "WRONG"}
    assert "WRONG wrong: solved, but failed is right" in output
    assert sorted(p.name for p in folder.iterdir()) == ["half.hdf", "right.hdf", "wrong.hdf"]
    if ranks:
        again, repeated, _ = once(run)
        table = output[output.index("class ") :]
        assert (again, repeated[repeated.index("class ") :]) == (6, table)


@pytest.mark.long
@pytest.mark.launches
def test_every_hard_case_comes_to_what_is_right_for_it(once, shared_path):
    """Runs for minutes; what a case comes to does not depend on the machine, but for its limit of time."""
    import subprocess
    import sys

    from softjaw.study.environment import launch_environment
    from tests.study.launching import ROOT

    words = [sys.executable, "-m", "softjaw", "run", str(HARD), "-o", str(shared_path / "hard")]
    done = once(
        lambda: subprocess.run(words, env=launch_environment(), cwd=ROOT, capture_output=True, text=True, timeout=3600)
    )
    assert done.returncode == 0, done.stdout[done.stdout.index("WRONG") :]
    assert set(verdicts(done.stdout).values()) == {"ok"}


@pytest.mark.long
@pytest.mark.launches
def test_files_of_other_scenes_are_told_of_and_no_rank_waits(once, shared_path):
    path = catalogue(shared_path, *CASES[:2])
    words = ("-m", "softjaw", "run", path, "-o", shared_path / "out")
    assert once(launch, 2, *words)[0] == 0
    code, output, _ = once(launch, 2, *words, "--set", "friction.mu=0.5")
    assert code == 6
    assert "WRONG right: refused, but solved is right" in output
    assert "made from another scene" in output
