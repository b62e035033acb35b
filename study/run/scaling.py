"""How a study would run on many ranks: measured times of its cases, divided as a run divides them, and its writes.

Every case ends with its writes: one after another for the rank, and through a file system that serves all ranks in the
order in which they come. The counter that hands out the work takes 20 us a load path, which is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.result.layout import Layout
from softjaw.study.run.plan import Plan, makespan, measured_seconds
from softjaw.study.run.progress import duration

WRITE_S = 1.5e-5  # seconds of one write of a rank, measured on one machine with a local disk
WRITES_PER_S, BYTES_PER_S = 5e4, 1e9  # what a file system is assumed to take from all ranks together
GOOD_EFFICIENCY = 0.8


def scaled(seconds: ArrayLike, served: ArrayLike, ranks: int, write: float, service: float) -> tuple[float, str]:
    """Seconds until the last case is stored, and what keeps that from being shorter.

    Parameters
    ----------
    seconds, served : (n,) arrays
        Of load paths, or of forces that ranks may divide: time of solving [s], and rows that are stored.
    ranks : int
    write, service : float
        Time that the writes of a row take from its rank, and from the file system [s].

    Examples
    --------
    >>> scaled([4.0] * 64, [4] * 64, 64, 0.0, 0.0), scaled([4.0] * 64, [4] * 64, 64, 0.1, 0.1)
    ((4.0, '-'), (25.6, 'file system'))
    """
    work, files = np.asarray(seconds) + write * np.asarray(served), service * float(np.sum(served))
    time, even, longest = makespan(work.tolist(), ranks), work.sum() / ranks, work.max()
    if files > time:
        return files, "file system"
    # share of the time below which something does not count as the limit
    limits = {"longest load path": longest - even, "division of load paths": time - max(longest, even)}
    worst = max(limits, key=lambda name: limits[name])
    return time, worst if limits[worst] > 0.05 * time else "-"


def row_writes(layout: Layout) -> tuple[float, float, str]:
    """Time that the writes of a case take from its rank, and from the file system [s], and what they are, in words."""
    columns = layout.columns
    # besides its values: begun, checksums, state
    size, writes = sum(int(np.prod(c.shape)) * c.dtype.itemsize for c in columns), len(columns) + 3
    text = f"{writes} writes of {size / 1e3:.3g} kB together, {1e3 * WRITE_S:g} ms each"
    return WRITE_S * writes, max(writes / WRITES_PER_S, size / BYTES_PER_S), text


def _measured(plan: Plan, seconds: NDArray[np.float64]) -> list[tuple[float, int]]:
    """Time of each load path, or of its forces where ranks may divide them, from the cases' ``(rows,)``, and rows."""
    parts = []
    for unit in plan.tried:
        times = seconds[list(unit.rows[0])]
        times = times[np.isfinite(times)]  # the forces above a failed one were not tried
        each = times if unit.apart else [times.sum()] * bool(times.size)
        parts += [(float(t), len(unit.rows) * (1 if unit.apart else times.size)) for t in each]
    return parts


def scaling_text(plan: Plan, path: Path, ranks: Sequence[int], repeat: int) -> str:
    """Time and efficiency of a finished study, or of one with ``repeat`` times its candidates, on so many ranks.

    Raises
    ------
    StudyError
        If the file at ``path`` holds no times of this plan.
    """
    known = measured_seconds(plan.layout, path)
    parts = [] if known is None else _measured(plan, known) * repeat
    if not parts:
        raise StudyError(OTHER_FILE, f"{path}: no case was timed yet; run the study first, or give -n one number")
    seconds, served = np.transpose(parts)
    write, service, text = row_writes(plan.layout)
    lines, good = [f"{'ranks':>6}  {'time':>13}  {'efficiency':>10}  limit"], [0]
    for n in ranks:
        time, limit = scaled(seconds, served, n, write, service)
        efficiency = seconds.sum() / n / time
        lines.append(f"{n:>6}  {duration(time):>13}  {efficiency:>10.1%}  {limit}")
        good += [n] * (efficiency >= GOOD_EFFICIENCY)
    return "\n".join([
        f"{path}: {plan.layout.rows * repeat} cases in {len(parts)} parts, {duration(seconds.sum())} of solving",
        f"  parts      {seconds.min():.3g} to {seconds.max():.3g} s, {seconds.mean():.3g} s in the mean",
        f"  a case     {text}",
        f"  assumed    {WRITES_PER_S:g} writes/s and {BYTES_PER_S / 1e6:g} MB/s to one file",
        "  left out   starting the ranks, and cores that share caches and memory",
        *lines,
        f"at least {GOOD_EFFICIENCY:.0%} efficient up to {max(good)} ranks",
    ])  # fmt: skip
