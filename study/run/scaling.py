"""How a study would run on many ranks: measured times of its cases, replayed by the rules that hand out the work.

The replay follows `schedule`: load paths with the highest expected cost first, dealt out to the nodes in turn, and
inside a node by a counter that serves one rank at a time. Every case ends with its writes: one after another for the
rank, and through a file system that serves all ranks in the order in which they come.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.result.layout import Layout
from softjaw.study.run.plan import Plan, measured_seconds
from softjaw.study.run.progress import duration
from softjaw.study.run.shares import by_cost

GOOD_EFFICIENCY = 0.8
# Measured on one machine with a local disk: a look at a node's counter [s], and one write of a rank [s].
CLAIM, WRITE = 2e-5, 1.5e-5
# Assumed: ranks that share a node, and what a file system takes from all ranks together, in writes/s and bytes/s.
PER_NODE, WRITES_PER_S, BYTES_PER_S = 64, 5e4, 1e9


@dataclass(frozen=True)
class LoadPath:
    """Seconds of each case, the cost that the plan expects, and how many candidates the results are written for."""

    seconds: tuple[float, ...]
    cost: float
    served: int = 1


@dataclass(frozen=True)
class Machine:
    """Ranks on a node, seconds of one look at the counter, and what writing a case takes from rank and file system."""

    per_node: int
    claim: float
    write: float
    service: float


@dataclass(frozen=True)
class Replay:
    """Time until the last rank is done, and the name of what keeps it from being shorter."""

    ranks: int
    seconds: float
    efficiency: float
    limit: str


def replayed(paths: Sequence[LoadPath], ranks: int, machine: Machine) -> float:
    """Seconds until the last case is stored.

    >>> replayed([LoadPath((1.0, 1.0), 2.0), LoadPath((3.0,), 3.0)], 2, Machine(2, 0.0, 0.0, 0.0))
    3.0
    """
    order = by_cost([path.cost for path in paths])
    # Rounded up: a node that is not full is a node too.
    nodes = -(-ranks // machine.per_node)
    taken, counter, disk, last = [0] * nodes, [0.0] * nodes, 0.0, 0.0
    # moment, rank, the load path's cases that are still to be solved (none: take another)
    events: list[tuple[float, int, int, int]] = [(0.0, rank, -1, 0) for rank in range(ranks)]
    while events:
        now, rank, current, k = heapq.heappop(events)
        node = rank // machine.per_node
        if current >= 0:  # case k - 1 is solved: store it
            served = paths[current].served
            disk = max(disk, now) + served * machine.service
            now = max(now + served * machine.write, disk) if machine.service else now + served * machine.write
            last = max(last, now)
        if current < 0 or k == len(paths[current].seconds):
            # The counter serves one rank at a time, so a claim waits for the one before.
            now = counter[node] = max(now, counter[node]) + machine.claim
            position = node + taken[node] * nodes
            taken[node] += 1
            if position >= len(order):
                continue
            current, k = order[position], 0
        heapq.heappush(events, (now + paths[current].seconds[k], rank, current, k + 1))
    return last


def replay(paths: Sequence[LoadPath], ranks: int, machine: Machine) -> Replay:
    """Time, efficiency against one rank that neither waits nor writes, and what limits it."""
    whole = sum(sum(path.seconds) for path in paths)
    time = replayed(paths, ranks, machine)
    unwritten = replayed(paths, ranks, replace(machine, write=0.0, service=0.0))
    free = replayed(paths, ranks, replace(machine, claim=0.0, write=0.0, service=0.0))
    longest = max(sum(path.seconds) for path in paths)
    shares = {
        "file system": time - unwritten,
        "counter": unwritten - free,
        # Against an even share: only what is longer than that holds up the end.
        "longest load path": max(longest - whole / ranks, 0.0),
        "division of load paths": free - max(longest, whole / ranks),
    }
    worst = max(shares, key=lambda name: shares[name])
    # share of the time below which something does not count as the limit
    return Replay(ranks, time, whole / ranks / time, worst if shares[worst] > 0.05 * time else "-")


def measured_paths(plan: Plan, seconds: NDArray[np.float64]) -> list[LoadPath]:
    """Load paths of a plan, or its forces where ranks may divide them, with the times of its cases ``(rows,)`` [s].

    NaN is a case without a time.
    """
    paths = []
    for unit in plan.tried:
        times = seconds[list(unit.rows[0])]
        taken = tuple(map(float, times[np.isfinite(times)]))  # the forces above a failed one were not tried
        if unit.apart:
            paths += [LoadPath((t,), unit.cost / len(times), len(unit.rows)) for t in taken]
        elif taken:
            paths.append(LoadPath(taken, unit.cost, len(unit.rows)))
    return paths


def row_size(layout: Layout) -> tuple[int, int]:
    """Bytes of a case, and in how many writes they go into the file."""
    columns = layout.columns
    # besides its values: begun, checksums, state
    return sum(int(np.prod(c.shape)) * c.dtype.itemsize for c in columns), len(columns) + 3


def machine_of(layout: Layout) -> Machine:
    """What is assumed of a cluster that solves cases of a layout."""
    row, writes = row_size(layout)
    return Machine(PER_NODE, CLAIM, WRITE * writes, max(writes / WRITES_PER_S, row / BYTES_PER_S))


def scaling_text(plan: Plan, path: Path, ranks: Sequence[int], repeat: int = 1) -> str:
    """Time and efficiency of a finished study, or of one with ``repeat`` times its candidates, on so many ranks.

    Raises
    ------
    StudyError
        If the file at ``path`` holds no times of this plan.
    """
    seconds = measured_seconds(plan.layout, path)
    paths = [] if seconds is None else measured_paths(plan, seconds) * repeat
    if not paths:
        raise StudyError(OTHER_FILE, f"{path}: no case was timed yet; run the study first, or give -n one number")
    row, writes = row_size(plan.layout)
    machine = machine_of(plan.layout)
    replays = [replay(paths, n, machine) for n in ranks]
    times = [sum(load_path.seconds) for load_path in paths]
    rows = plan.layout.rows * repeat
    head = [
        f"{path}: {rows} cases in {len(paths)} load paths, {duration(sum(times))} of solving",
        f"  load paths {min(times):.3g} to {max(times):.3g} s, {np.mean(times):.3g} s in the mean",
        f"  a case     {writes} writes of {row / 1e3:.3g} kB together, {1e3 * WRITE:g} ms each",
        f"  assumed    {PER_NODE} ranks per node, {WRITES_PER_S:g} writes/s and {BYTES_PER_S / 1e6:g} MB/s to one file",
        "  left out   starting the ranks, and cores that share caches and memory",
    ]
    good = [r.ranks for r in replays if r.efficiency >= GOOD_EFFICIENCY]
    share = f"{GOOD_EFFICIENCY:.0%} efficient"
    advice = f"at least {share} up to {max(good)} ranks" if good else f"never {share}"
    return "\n".join([*head, *_table(replays), advice])


def _table(replays: list[Replay]) -> Iterator[str]:
    yield f"{'ranks':>6}  {'time':>13}  {'efficiency':>10}  limit"
    for r in replays:
        yield f"{r.ranks:>6}  {duration(r.seconds):>13}  {r.efficiency:>10.1%}  {r.limit}"
