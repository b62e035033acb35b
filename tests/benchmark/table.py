"""Lines of the benchmark's table, and times of repeated work."""

import time
from collections.abc import Callable


def fastest(work: Callable[[], object], seconds: float = 1.0) -> float:
    """Shortest of the times that ``work`` takes when it is repeated for so long [s]."""
    work()
    times, end = [], time.perf_counter() + seconds
    while time.perf_counter() < end or len(times) < 3:
        start = time.perf_counter()
        work()
        times.append(time.perf_counter() - start)
    return min(times)


def line(what: str, figure: str, goal: str = "") -> None:
    print(f"{what:<62} | {figure:>16} | {goal}".rstrip(" |"), flush=True)


def title(text: str) -> None:
    print(f"\n{text}", flush=True)
    line("what", "figure", "goal")


def span(seconds: float) -> str:
    for size, unit in ((1.0, "s"), (1e-3, "ms"), (1e-6, "us")):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
