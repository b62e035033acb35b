"""Seconds of a study: of load paths that are solved to time them.

What a load path takes depends on symmetry, friction that acts back, meshes that the accuracy asks for and the machine:
nothing foretells it as well as the paths themselves. The first one that is timed also loads what all solve with.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from softjaw.friction.patch import FloatArray
from softjaw.study.case.result import CaseFailure
from softjaw.study.quantities import LISTED
from softjaw.study.run.limits import require_room
from softjaw.study.scene.sections import FINEST

TIMED = "judged by a few load paths that were solved for it"  # what a time follows from
TIMED_S = 7.0  # seconds of the processor after which no further load path is begun
END_S = 2.0  # seconds to pack a file and list its grasps
FIRST_FORCE_FACTOR = 2.0  # times as long the first force takes, which begins with a coarse step
MOST_PROMISING = 3  # sampled grasps that are solved as well as listed ones
ROUNDS = 1.6  # of the grasps that a list shows: with those that fall out of it


def timed(
    units: Sequence[Any], budget: float = TIMED_S, inputs: int = 1, failed: list[str] | None = None
) -> tuple[list[float], float]:
    """Expected time of each unit of work [s], by a few that are solved here, and what the first one has loaded [s].

    The results are thrown away. After ``budget`` [s] a path is left in the middle. Loops that had to be compiled are
    kept for the run: then all is timed once more. ``inputs``: as `Layout.inputs`, as often grasps are solved. Reasons
    of cases that have no result are added to ``failed``.
    """
    failed = [] if failed is None else failed
    if not units:
        return [], 0.0
    require_room()
    from numba.core.event import TimingListener, install_listener  # slow to load, as the solver

    from softjaw.study.pipeline import SOLVERS, solve_unit

    with install_listener("numba:compile", compiling := TimingListener()):
        times = _timed(units, budget, inputs, solve_unit, failed)
    if not compiling.done:
        return times
    SOLVERS.clear()  # what is solved already would take no time
    failed.clear()
    return _timed(units, budget, inputs, solve_unit, failed)


def _timed(
    units: Sequence[Any], budget: float, inputs: int, solve_unit: Callable, failed: list[str]
) -> tuple[list[float], float]:
    """See `timed`; what the first case loads counts for no unit."""
    seconds, first_case, spent = np.full(len(units), np.nan), np.nan, 0.0
    n = len(units)  # the middle first; the first few lie far apart: multiples of the golden section
    order = list(dict.fromkeys(int((0.5 + 0.618034 * k) % 1.0 * n) for k in range(4 * n)))
    first = order[0]
    for i in order:
        times: list[float] = []
        for took in _times(solve_unit(units[i]), len(units[i].rows[0]), failed):
            times.append(took)
            if np.isnan(first_case):
                first_case = took
                continue
            # the second case tells how much of the first one was no loading
            spent += took if spent else took + min(first_case, FIRST_FORCE_FACTOR * took)
            if spent > budget:
                break
        seconds[i] = _path(times, len(units[i].rows[0]), stopped=spent > budget, loads=i == first)
        if spent > budget:
            break
    forces = len(units[first].rows[0])
    if np.isfinite(seconds).sum() > 1 and forces == 1:
        seconds[first] = np.nan
    each = _by_cost(units, seconds)
    loads = max(first_case - FIRST_FORCE_FACTOR * each[first] / (forces - 1 + FIRST_FORCE_FACTOR), 0.0)
    if units[first].finest:  # of sampled grasps
        listed = min(LISTED * inputs, len(units)) / len(units)
        each += ROUNDS * _listed(units[:MOST_PROMISING], budget, solve_unit) * listed
    return each.tolist(), float(loads)


def _path(times: Sequence[float], forces: int, *, stopped: bool, loads: bool) -> float:
    """Time of a load path of which the first forces took ``times`` [s]; it ended by itself unless ``stopped``."""
    if len(times) < forces and not stopped:
        return sum(times)  # it failed
    further = sum(times[1:]) / (len(times) - 1) if len(times) > 1 else times[0] / FIRST_FORCE_FACTOR
    first = FIRST_FORCE_FACTOR * further if loads else times[0]
    return first + sum(times[1:]) + further * (forces - len(times))


def _times(cases: Iterator[Any], count: int, failed: list[str]) -> Iterator[float]:
    """Time of each case of a load path [s], up to one that fails."""
    before = time.process_time()
    for _ in range(count):
        try:
            _, result = next(cases)
            failed += [result.message] if isinstance(result, CaseFailure) else []
        except Exception:  # whatever a case dies of, the run says it
            yield time.process_time() - before
            return
        now = time.process_time()
        yield now - before
        before = now


def _listed(units: Sequence[Any], budget: float, solve_unit: Callable) -> float:
    """Mean time of a listed grasp in rounds [s]: one force, on ever finer meshes until the accuracy is met.

    Sampled grasps come with the most promising first.
    """
    times, begin, last = list[float](), time.process_time(), len(units[0].finest) - 1
    for unit in units:
        with suppress(Exception):
            list(solve_unit(replace(unit, finest=(FINEST,) * (last + 1)), (last,)))
        times.append(time.process_time() - begin - sum(times))
        if sum(times) > budget:
            break
    # with a mass the least force that holds it lies between two
    return (2 if units[0].scene.object.mass_g is not None and last else 1) * sum(times) / len(times)


def _by_cost(units: Sequence[Any], seconds: FloatArray) -> FloatArray:
    """Times ``(units,)`` [s] of which some are known; the others follow from those by their cost."""
    costs, known = np.array([unit.cost for unit in units]), np.isfinite(seconds)
    return np.where(known, seconds, seconds[known].sum() / costs[known].sum() * costs)
