"""How a study would run on many ranks: measured times of its cases, replayed by the rules that hand out the work.

The replay follows `schedule`: ladders with the highest expected cost first, dealt out to the nodes in turn, and
inside a node by a counter that serves one rank at a time. Every case ends with its writes: one after another for the
rank, and through a file system that serves all ranks in the order in which they come.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.run.plan import by_cost
from softjaw.study.run.progress import duration

STATE_WRITES = 5  # of a case besides its values: begun, state, its checksum, and the maps that are seen first
NOTHING = 0.05  # share of the time below which something does not count as the limit
GOOD = 0.8


@dataclass(frozen=True)
class Ladder:
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


def replayed(ladders: Sequence[Ladder], ranks: int, machine: Machine) -> float:
    """Seconds until the last case is stored.

    >>> replayed([Ladder((1.0, 1.0), 2.0), Ladder((3.0,), 3.0)], 2, Machine(2, 0.0, 0.0, 0.0))
    3.0
    """
    order = by_cost([ladder.cost for ladder in ladders])
    nodes = -(-ranks // machine.per_node)
    taken, counter, disk, last = [0] * nodes, [0.0] * nodes, 0.0, 0.0
    # moment, rank, the ladder's cases that are still to be solved (none: take another ladder)
    events: list[tuple[float, int, int, int]] = [(0.0, rank, -1, 0) for rank in range(ranks)]
    while events:
        now, rank, current, k = heapq.heappop(events)
        node = rank // machine.per_node
        if current >= 0:  # case k - 1 is solved: store it
            served = ladders[current].served
            disk = max(disk, now) + served * machine.service
            now = max(now + served * machine.write, disk) if machine.service else now + served * machine.write
            last = max(last, now)
        if current < 0 or k == len(ladders[current].seconds):
            now = counter[node] = max(now, counter[node]) + machine.claim
            position = node + taken[node] * nodes
            taken[node] += 1
            if position >= len(order):
                continue
            current, k = order[position], 0
        heapq.heappush(events, (now + ladders[current].seconds[k], rank, current, k + 1))
    return last


def replay(ladders: Sequence[Ladder], ranks: int, machine: Machine) -> Replay:
    """Time, efficiency against one rank that neither waits nor writes, and what limits it."""
    whole = sum(sum(ladder.seconds) for ladder in ladders)
    time = replayed(ladders, ranks, machine)
    unwritten = replayed(ladders, ranks, replace(machine, write=0.0, service=0.0))
    free = replayed(ladders, ranks, replace(machine, claim=0.0, write=0.0, service=0.0))
    longest = max(sum(ladder.seconds) for ladder in ladders)
    shares = {
        "file system": time - unwritten,
        "counter": unwritten - free,
        "longest ladder": max(longest - whole / ranks, 0.0),
        "division of ladders": free - max(longest, whole / ranks),
    }
    worst = max(shares, key=lambda name: shares[name])
    return Replay(ranks, time, whole / ranks / time, worst if shares[worst] > NOTHING * time else "-")


def segmented(ladders: Sequence[Ladder], parts: int) -> list[Ladder]:
    """The same work with every ladder cut in parts; a part begins by a climb that is taken to cost one more case."""
    cut = []
    for ladder in ladders:
        for i, own in enumerate(np.array_split(np.array(ladder.seconds), min(parts, len(ladder.seconds)))):
            seconds = (float(own[0]) * (2 if i else 1), *map(float, own[1:]))
            cut.append(Ladder(seconds, ladder.cost * len(own) / len(ladder.seconds), ladder.served))
    return cut


def measured_ladders(result: Any) -> list[Ladder]:
    """Ladders of a finished file; `StudyError` where cases are missing."""
    from softjaw.study.case import sweep
    from softjaw.study.scene import parse_scene

    scene = parse_scene(result.scene, check_files=False)
    seconds = result.read("work/seconds_total").ravel()
    found = []
    for unit in sweep.units(scene, lambda point: point.axis_symmetry):
        times = seconds[list(unit.rows[0])]
        if np.isfinite(times).any():  # the forces above a failed one were not tried
            found.append(Ladder(tuple(map(float, times[np.isfinite(times)])), unit.cost, len(unit.rows)))
    if not found:
        raise StudyError(OTHER_FILE, f"{result.path}: no case was timed yet; run the study first")
    return found


def scaling_text(path: Path, options: Any) -> str:
    """Answer of ``softjaw scale``."""
    from softjaw.study.result.store import open_result

    with open_result(path) as result:
        ladders = measured_ladders(result) * options.repeat
        columns, rows, parts = result.layout.columns, result.layout.rows * options.repeat, len(result.layout.parts)
    row = sum(int(np.prod(c.shape)) * c.dtype.itemsize for c in columns)
    writes = len(columns) + parts + STATE_WRITES
    service = max(writes / options.writes_per_s, row / (1e6 * options.mb_per_s))
    machine = Machine(options.per_node, 1e-6 * options.claim_us, 1e-3 * options.write_ms * writes, service)
    replays = [replay(ladders, n, machine) for n in options.ranks]
    return "\n".join(
        [*_head(path, options, ladders, rows, writes, row), *_table(replays), *_advice(ladders, replays, machine)]
    )


def _head(path: Path, options: Any, ladders: list[Ladder], rows: int, writes: int, row: int) -> Iterator[str]:
    times = [sum(ladder.seconds) for ladder in ladders]
    again = f", {options.repeat} times" if options.repeat > 1 else ""
    yield f"{path}{again}: {rows} cases in {len(ladders)} ladders, {duration(sum(times))} of solving"
    yield f"  ladders    {min(times):.3g} to {max(times):.3g} s, {np.mean(times):.3g} s in the mean"
    yield f"  a case     {writes} writes of {row / 1e3:.3g} kB together, {options.write_ms:g} ms each"
    yield f"  machine    {options.per_node} ranks per node; {options.claim_us:g} us for one look at a node's counter"
    yield f"  files      {options.writes_per_s:g} writes/s and {options.mb_per_s:g} MB/s from all ranks together"
    yield "  left out   starting the ranks, and cores that share caches and memory"


def _table(replays: list[Replay]) -> Iterator[str]:
    yield f"{'ranks':>6}  {'time':>13}  {'efficiency':>10}  limit"
    for r in replays:
        yield f"{r.ranks:>6}  {duration(r.seconds):>13}  {r.efficiency:>10.1%}  {r.limit}"


def _advice(ladders: list[Ladder], replays: list[Replay], machine: Machine) -> Iterator[str]:
    good = [r.ranks for r in replays if r.efficiency >= GOOD]
    yield f"at least {GOOD:.0%} efficient up to {max(good)} ranks" if good else f"nowhere {GOOD:.0%} efficient"
    bound = next((r for r in replays if r.limit == "longest ladder"), None)
    most = max(len(ladder.seconds) for ladder in ladders)
    if bound and most > 1:
        tried = {parts: replayed(segmented(ladders, parts), bound.ranks, machine) for parts in range(2, most + 1)}
        parts = min(tried, key=lambda p: tried[p])
        gain = f"after {duration(tried[parts])} instead of {duration(bound.seconds)}"
        helps = f"in {parts} parts would end {gain}" if tried[parts] < 0.95 * bound.seconds else "would not help"
        yield f"on {bound.ranks} ranks, ladders cut {helps}, if a part's climb to its first force costs one more case"
