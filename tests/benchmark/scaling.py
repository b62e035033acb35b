"""Time of studies of 10^3 to 10^6 cases on 1 to 4096 ranks: ``python -m tests.benchmark.scaling RESULT FIGURE.png``."""

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

from softjaw.study.result.store import open_result
from softjaw.study.run.shares import makespan

RANKS = [4**k for k in range(7)]
CASES = (10**3, 10**4, 10**5, 10**6)
WRITE_S = 1.5e-5  # seconds of one write of a rank, measured on one machine with a local disk
WRITES_PER_S, BYTES_PER_S = 5e4, 1e9  # what a file system is assumed to take from all ranks together


def main(result: Path, figure: Path) -> None:
    mpl.use("Agg")
    from matplotlib import pyplot as plt

    with open_result(result) as file:
        seconds, columns = file.read("work/seconds_total").ravel(), file.layout.columns
    # besides its values: begun, checksums, state
    size, writes = sum(int(np.prod(c.share)) * c.dtype.itemsize for c in columns), len(columns) + 3
    service = max(writes / WRITES_PER_S, size / BYTES_PER_S)
    seconds = np.sort(seconds[np.isfinite(seconds)])[::-1]
    _, axes = plt.subplots(figsize=(6, 4))
    for cases in CASES:
        # beyond 10^5 cases all that counts is a sum: a tenth of them takes a tenth of the time
        part = max(cases // 10**5, 1)
        some = np.resize(seconds, cases // part)
        work = (some + WRITE_S * writes).tolist()
        times = [part * max(makespan(work, ranks), service * len(some)) for ranks in RANKS]
        print(f"{cases:>8} cases", *(f"{t:12.0f} s" for t in times))
        axes.loglog(RANKS, times, "o-", label=f"{cases:,} cases")
    axes.set(xlabel="ranks", ylabel="time [s]", title=f"{seconds.mean():.2g} s a case, one file")
    axes.legend()
    axes.grid(True, which="both", alpha=0.3)
    plt.savefig(figure, dpi=80, bbox_inches="tight")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
