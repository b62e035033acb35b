"""Who solves what: every unit once, the expensive ones first, nothing new after a stop; and the seconds of a plan."""

import io
import re
from itertools import chain
from types import SimpleNamespace

import numpy as np
import pytest
from numba import njit

from softjaw.study import pipeline
from softjaw.study.case.result import CaseFailure
from softjaw.study.quantities import DONE, MISSING, SLIPS, WIDE
from softjaw.study.run import estimate
from softjaw.study.run.estimate import FIRST_FORCE_FACTOR, timed
from softjaw.study.run.load_path import settle
from softjaw.study.run.plan import make_plan, plan_rows
from softjaw.study.run.progress import Progress
from softjaw.study.run.shares import Share, costliest_first, makespan, shares
from tests.study.launching import ROOT, children_seconds, launch
from tests.study.scenes import OVAL, scene_of

CLAIMS = """
from mpi4py import MPI
from softjaw.study.run.schedule import Claims
import time
comm = MPI.COMM_WORLD
node = comm.Split({color}) if {color} is not None else None
claims = Claims(comm, [1] * {count}, node)
mine = []
for position in claims:
    mine.append(position)
    time.sleep(0.002 * (1 + 99 * (comm.rank == 0)))
    if position == {stop}:
        claims.stop()
everybody = comm.gather(mine)
stopped = comm.gather(claims.stopped)
claims.free()
if comm.rank == 0:
    print(everybody, stopped)
"""

def claims(ranks, **values):
    """Positions of each rank, and whether each saw a stop."""
    code, output, errors = launch(ranks, "-c", CLAIMS.format(**{"color": None, "stop": -1, **values}))
    assert code == 0, errors
    return eval(output.strip().replace("] [", "], ["))


@pytest.mark.ranks
def test_every_position_goes_to_one_rank_a_slow_one_takes_fewer_nodes_in_turn_and_a_stop_reaches_all():
    taken, _ = claims(3, count=60)
    assert sorted(list(chain(*taken))) == list(range(60))
    assert all(own == sorted(own) for own in taken)
    assert len(taken[0]) < 20  # of equal shares
    # Ranks 0 and 2 share one memory, rank 1 has its own: even positions there, odd ones here.
    taken, _ = claims(3, count=21, color="comm.rank % 2")
    assert sorted(taken[0] + taken[2]) == list(range(0, 21, 2))
    assert taken[1] == list(range(1, 21, 2))
    taken, _ = claims(3, count=1)
    assert list(chain(*taken)) == [0]
    taken, stopped = claims(2, count=100_000, stop=20)
    assert stopped == [True, True]
    assert 20 < len(list(chain(*taken))) < 200


def test_expensive_first_is_as_good_as_the_bound_of_list_scheduling():
    """Graham: longest first needs at most 4/3 - 1/(3 n) of the best; the best is at least mean and largest cost."""
    random = np.random.default_rng(1)
    for n in (2, 3, 8):
        costs = list(random.random(40))
        best = max(sum(costs) / n, max(costs))
        assert best <= makespan(costs, n) <= (4 / 3 - 1 / (3 * n)) * best
    assert makespan([1.0, 2.0, 4.0], 1) == pytest.approx(7.0)
    assert makespan([1.0, 2.0, 4.0], 5) == pytest.approx(4.0)
    listed = costliest_first(Share(unit, (0, 1)) for unit in units_of([2.0, 3.0, 2.0]))
    assert [share.unit.index for share in listed] == [1, 0, 2]


def units_of(costs, forces=6, apart=True):
    rows = np.arange(len(costs) * 2 * forces).reshape(len(costs), 2, forces).tolist()
    return [
        SimpleNamespace(index=i, rows=own, cost=cost, apart=apart, state=0, finest=())
        for i, (own, cost) in enumerate(zip(rows, costs, strict=True))
    ]


def divided(made, ranks, codes=None):
    found = shares(made, np.zeros(sum(len(r) for u in made for r in u.rows)) if codes is None else codes, ranks)
    return [(own.unit.index, own.forces) for own in found]


@pytest.mark.parametrize("ranks", [1, 2, 3, 4, 20])
def test_every_missing_force_is_in_one_share(ranks):
    made = units_of([3.0, 1.0, 2.0])
    codes = np.zeros(36)
    codes[[0, 6, 1]] = 1  # force 0 for both candidates of the first unit, force 1 for one of them
    found = divided(made, ranks, codes)
    expected = [(i, k) for i in range(3) for k in range(6) if (i, k) != (0, 0)]
    assert sorted((i, k) for i, forces in found for k in forces) == expected
    assert all(forces == tuple(sorted(forces)) for _, forces in found)


def test_one_candidate_is_divided_evenly_many_only_at_the_end_and_load_paths_never():
    [one] = units_of([1.0])
    assert divided([one], 1) == [(0, (0, 1, 2, 3, 4, 5))]
    assert divided([one], 2) == [(0, (0, 2, 4)), (0, (1, 3, 5))]
    assert [len(forces) for _, forces in divided([one], 4)] == [2, 2, 1, 1]
    assert len(divided([one], 50)) == 6
    assert [len(forces) for _, forces in divided(units_of([1.0] * 35), 2)] == [6] * 33 + [3] * 4
    # a candidate that takes longer than all others together
    assert divided(units_of([100.0, 1.0]), 2)[:2] == [(0, (0, 2, 4)), (0, (1, 3, 5))]
    whole = (0, 1, 2, 3, 4, 5)
    assert divided(units_of([1.0], apart=False), 2) == [(0, whole)]


@pytest.mark.parametrize("ranks", [2, 3, 4, 8])
def test_ranks_are_busy_to_the_end(ranks):
    """However costs lie, the longest share is at most one force more than an even part of one candidate."""
    costs = np.random.default_rng(ranks).uniform(1, 3, 12)
    found = shares(units_of(costs), np.zeros(144), ranks)
    even = costs.sum() / ranks
    assert makespan([own.cost for own in found], ranks) <= 1.1 * even
    assert makespan(costs, ranks) >= even


def test_a_plan_gives_the_time_on_every_number_of_ranks(tmp_path):
    scene = scene_of(OVAL)
    *_, text = plan_rows(make_plan(scene), scene, tmp_path / "a.hdf", (1, 4))
    assert " on 1 rank, " in text
    assert " on 4 ranks for all cases" in text


def test_a_case_that_an_earlier_run_left_out_is_missing_once_it_is_asked_for():
    rows, forgotten = np.array([DONE, SLIPS, SLIPS, WIDE]), []
    # nothing is torn, and so nothing tidied
    writer = SimpleNamespace(codes=rows.copy, attempts=lambda: np.ones(4, int), forget=forgotten.append)
    wanted = {(0, 1): MISSING, (2,): SLIPS, (3,): WIDE}
    units = [SimpleNamespace(rows=(rows,), state=state, apart=False, reason="") for rows, state in wanted.items()]
    assert settle(writer, units, [], False).tolist() == [DONE, MISSING, SLIPS, WIDE]
    assert forgotten == [1]


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


def test_neither_compiling_nor_cases_of_earlier_sessions_count():
    run = Run()
    assert run.at(30.0, 2) == "2/100 done"  # 30 s of compiling
    assert run.at(31.0, 12) == "12/100 done"  # ten cases, but one second
    assert run.at(40.0, 20) == "20/100 done, 0.556 s/case, 44 s left"  # 18 cases in 10 s; 80 are left
    assert run.at(70.0, 82) == "82/100 done, 0.5 s/case, 9.0 s left"
    run = Run(already=50)
    assert run.at(9.0, 51) == "51/100 done"
    assert run.at(19.0, 61) == "61/100 done, 1 s/case, 39 s left"


@pytest.mark.parametrize(("cases", "enough"), [(20, 5), (1000, 30), (100_000, 50)])
def test_a_rest_is_foretold_after_enough_cases(cases, enough):
    run = Run(cases)
    run.at(1.0, 1)
    assert "left" not in run.at(20.0, enough)
    assert "left" in run.at(20.0, enough + 1)


@pytest.fixture
def paths(monkeypatch):
    """Load paths that take as long as the test says, each from its first force, on a clock that only they move."""
    clock, solved = [100.0], []

    def solve_unit(unit, wanted=None):
        solved.append(unit.index)
        clock[0] += 50.0 if len(solved) == 1 else 0.0  # what the first one loads
        for k, seconds in enumerate(unit.seconds):
            if seconds is None:
                raise ArithmeticError
            clock[0] += seconds
            yield k, None

    monkeypatch.setattr(pipeline, "solve_unit", solve_unit)
    monkeypatch.setattr(estimate.time, "process_time", lambda: clock[0])
    return solved


def units_that_take(*seconds):
    return [
        SimpleNamespace(index=i, rows=(range(len(s)),), cost=float(i + 1), seconds=s, finest=())
        for i, s in enumerate(seconds)
    ]


def test_a_plan_times_paths_that_lie_far_apart_and_what_the_first_one_loads_is_none_of_theirs(paths):
    units = units_that_take(*([2.0 * (i + 1), 1.0 * (i + 1)] for i in range(9)))
    each, loads = timed(units, budget=60.0)
    assert each == pytest.approx([3.0 * (i + 1) for i in range(9)])  # by cost
    assert paths[0] == 4
    assert 1 < len(paths) < 9
    assert max(paths[:3]) - min(paths[:3]) >= 4
    assert loads == pytest.approx(50.0)
    assert timed(units, budget=60.0)[1] == pytest.approx(0.0)


def test_what_was_solved_while_loops_were_compiled_is_solved_again_to_time_it(monkeypatch):
    known = []

    def solve_unit(*_):
        known.append(len(pipeline.SOLVERS))
        if len(known) == 1:
            njit(lambda x: x + 1)(1)
        pipeline.SOLVERS[len(known)] = None
        yield 0, None

    monkeypatch.setattr(pipeline, "solve_unit", solve_unit)
    timed(units_that_take([1.0]))
    assert known == [0, 0]


def test_a_path_is_left_when_the_time_is_up_and_one_that_fails_counts_what_it_took(paths):
    assert timed([], 10.0) == ([], 0.0)
    [left], _ = timed(units_that_take([7.0, 4.0, 6.0, 4.0, 4.0]), budget=15.0)
    assert left == pytest.approx((FIRST_FORCE_FACTOR + 4) * 5.0)
    [_, took], _ = timed(units_that_take([2.0, None, 5.0], [2.0, 1.0, 1.0])[::-1])
    assert took == pytest.approx(2.0)


def test_a_plan_says_which_of_the_cases_that_it_solves_fail(monkeypatch, tmp_path):
    monkeypatch.setattr(pipeline, "solve_unit", lambda unit, *_: iter([(0, CaseFailure("no contact"))]))
    scene = scene_of(OVAL)
    *_, failed = plan_rows(make_plan(scene), scene, tmp_path / "a.hdf", [1])
    assert failed.split()[-2:] == ["no", "contact"]


@pytest.mark.long
@pytest.mark.parametrize("job", ["smoke", "box-poses", "flask-mesh", "sampled", "mug"])
def test_a_plan_is_within_two_fifths_of_what_the_run_takes(job, tmp_path):
    out, scene = ("-o", str(tmp_path / "a.hdf")), str(ROOT / "jobs" / f"{job}.toml")
    code, text, errors = launch(1, "-m", "softjaw", "plan", scene, "-n", "1", *out)
    assert code == 0, errors
    minutes, seconds = re.search(r"about (?:(\d+) min )?([\d.]+) s on 1 rank", " ".join(text.split())).groups()
    before = children_seconds()
    assert launch(1, "-m", "softjaw", "run", scene, *out)[0] == 0
    assert 0.6 < (60 * int(minutes or 0) + float(seconds)) / (children_seconds() - before) < 1.4
