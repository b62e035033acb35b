"""Limits of a run: signals and time of a case, and the memory that a rank may take.

A case in flight is finished if there is time and given up otherwise; one that asks for more memory than its rank's
share fails by itself, before the system kills the run. A run that has too little to start with says so: some libraries
ask for ever for memory that they do not get.
"""

from __future__ import annotations

import faulthandler
import math
import resource
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from softjaw.study.case.result import TimeLimitError
from softjaw.study.messages import USAGE, StudyError

# Seconds to finish the case in flight. mpirun kills its ranks about two seconds after it was interrupted; USR1 is what
# batch systems are asked to send a minute before the time limit.
GRACE = {signal.SIGUSR1: 30.0, signal.SIGTERM: 0.5, signal.SIGINT: 0.5}
PATIENCE = 2.0  # of the time limit, after which a process that has not even heard its own alarm ends itself
RAISE_AGAIN_S = 1.0  # s; what a handler raises inside a finaliser is printed and lost, so it is raised once more
PROGRAM_BYTES = 1.2e9  # bytes of addresses for the program with its libraries, which take 0.97, and the smallest cases
SIGNS = ("Cannot allocate memory", "failed to map segment")  # of a file or library that finds no memory
MIN_RANK_BYTES = 1e9  # bytes for the cases of a rank: with less than that, nothing could be solved at all
SHARE_HANDED_OUT = 0.9  # of the free memory; the rest is for the file's pages and for other programs
CGROUPS = Path("/sys/fs/cgroup")


class AbandonedError(BaseException):
    """The case in flight is given up; not an ``Exception``, so that no solver takes it for a failed step."""


early: set[int] = set()  # signals that came when no `Stopper` listened


def remember(number: int, _frame: Any) -> None:
    """Keep a signal for the next `Stopper`."""
    early.add(number)


def listen() -> None:
    """From now on a batch system's signal ends no process: the next `Stopper` acts on it."""
    signal.signal(signal.SIGUSR1, remember)


class Stopper:
    """Listens to signals between ``with stopper:``; ``name`` is the signal that came, or empty; ``limit`` as below.

    ``on_stop``: called once, by the first signal. ``limit``: time of a single case [s]. It is looked at whenever the
    solver comes back to Python, which PETSc does for every residual and every tangent. ``last_resort``: whether
    this process ends itself, and says where it was, if a case does not come back to Python for far longer than that.
    """

    def __init__(self, on_stop: Callable[[], None], limit: float = math.inf, last_resort: bool = False) -> None:
        self.name, self.limit, self._solving = "", limit, False
        # a short limit leaves time for alarms that were lost, too
        last = max(PATIENCE * limit, limit + 5 * RAISE_AGAIN_S) if last_resort and limit < math.inf else None
        self._on_stop, self._last_resort = on_stop, last
        self._before: dict[signal.Signals, Any] = {}
        self._leave = self._case_ends = math.inf
        self._raised: type[BaseException] | None = None

    def __enter__(self) -> Stopper:
        """Take the handlers over, and act on what came before."""
        self._before = {number: signal.signal(number, self._stop) for number in GRACE}
        self._before[signal.SIGALRM] = signal.signal(signal.SIGALRM, self._alarm)
        while early:
            self._stop(early.pop(), None)
        return self

    def __exit__(self, *_: object) -> None:
        """Put the earlier handlers back."""
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in self._before.items():
            # A batch system may send it when all is solved, and by default it would make the finished run a failed one.
            late = number == signal.SIGUSR1 and handler == signal.SIG_DFL
            # not SIG_IGN, which programs started from here would inherit
            signal.signal(number, remember if late else handler)

    @contextmanager
    def case(self) -> Iterator[None]:
        """Around a solve: here, and only here, an `AbandonedError` or a `TimeLimitError` may be raised."""
        self._case_ends = time.monotonic() + self.limit
        self._set_alarm()
        if self._last_resort is not None:  # in a thread that needs nothing of Python, which may never be back
            faulthandler.dump_traceback_later(self._last_resort, exit=True, file=sys.__stderr__ or sys.stderr)
        self._solving, self._raised = True, None
        try:
            yield
        except Exception as error:
            if self._raised is not None:  # compiled loops wrap what a signal raises in them
                raise self._raised from error
            raise
        finally:
            # First of all: an alarm that comes from here on belongs to no case.
            self._solving, self._case_ends = False, math.inf
            self._set_alarm()
            if self._last_resort is not None:
                faulthandler.cancel_dump_traceback_later()

    def _stop(self, number: int, _frame: Any) -> None:
        if self.name:
            # A second signal does not wait for the grace that the first one gave.
            self._raise(AbandonedError)
            return
        self.name = signal.Signals(number).name
        self._leave = time.monotonic() + GRACE[signal.Signals(number)]
        self._on_stop()
        self._set_alarm()

    def _set_alarm(self) -> None:
        seconds = min(self._leave, self._case_ends) - time.monotonic()
        # A timer of 0 would be off, so a moment that has passed already gets a millisecond.
        signal.setitimer(signal.ITIMER_REAL, 0 if seconds == math.inf else max(seconds, 1e-3), RAISE_AGAIN_S)

    def _alarm(self, *_: Any) -> None:
        now = time.monotonic()
        if now >= self._leave:
            self._raise(AbandonedError)
        elif now >= self._case_ends:
            self._raise(TimeLimitError)

    def _raise(self, error: type[BaseException]) -> None:
        # Outside of a solve, as amid a write, an exception would leave half a row.
        if self._solving:
            self._raised = error
            raise error


# --- memory -----------------------------------------------------------------------------------------------------------


@contextmanager
def limited_memory(setting: float | str, ranks: int) -> Iterator[None]:
    """Bound the address space of this process by what it has now plus its share of what is free.

    ``setting``: memory of a rank in GB, or its share of what is free now, or no bound; ``ranks``: processes that share
    the memory of this machine. ``RLIMIT_AS`` bounds addresses, of which libraries reserve more than they use; so what
    stands there before the first case does not count.
    """
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    if setting != "none":
        # With almost nothing free a case still gets a chance; the system has the last word.
        auto = setting == "auto"
        share = max(SHARE_HANDED_OUT * available() / ranks, MIN_RANK_BYTES) if auto else 1e9 * float(setting)
        # A huge setting must not overflow what the system takes.
        wanted = _own_addresses() + int(min(share, 2.0**60))
        resource.setrlimit(resource.RLIMIT_AS, (wanted if hard == resource.RLIM_INFINITY else min(wanted, hard), hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def require_room() -> None:
    """`StudyError` where the limit of addresses leaves no room for the program itself."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    # With less than this some libraries hang instead of failing, so the run is refused before.
    if limit != resource.RLIM_INFINITY and limit < PROGRAM_BYTES:
        raise StudyError(USAGE, no_room(f"softjaw with its libraries takes {PROGRAM_BYTES / 1e9:g} GB for small cases"))


def no_room(reason: str) -> str:
    """A sentence for memory that was missing outside of a case."""
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    text = "unlimited" if limit == resource.RLIM_INFINITY else f"limited to {limit / 1e9:.2f} GB"
    return (
        f"out of memory: addresses of a process are {text} (ulimit -v); {reason}; raise the limit to 2 GB or more, or "
        "ask the batch system for more memory"
    )


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an error says that memory was missing, whatever its type."""
    # Libraries report missing memory by errors of other types, whose text tells.
    return isinstance(error, MemoryError) or any(sign in str(error) for sign in SIGNS)


def available() -> float:
    """Memory that can be had on this machine, or inside the control group that a batch system has put us into [B]."""
    free = [1024.0 * int(line.split()[1]) for line in _lines(Path("/proc/meminfo")) if line.startswith("MemAvailable")]
    return max(min([*free, *_groups_free()], default=float("inf")), 0.0)


def _groups_free() -> Iterator[float]:
    """What the control groups of this process leave, in both versions; pages of files can be dropped."""
    for line in _lines(Path("/proc/self/cgroup")):
        _, controllers, path = line.split(":", 2)
        if controllers in ("", "memory"):
            root = CGROUPS / controllers
            version_1 = "memory.limit_in_bytes", "memory.usage_in_bytes"
            names = version_1 if controllers else ("memory.max", "memory.current")
            group = root / path.strip().lstrip("/")
            # A limit may be set on any group above; the tightest one counts.
            for folder in (group, *(f for f in group.parents if f.is_relative_to(root))):
                numbers = [_lines(folder / name)[:1] for name in names]
                if all(n and n[0].strip().isdigit() for n in numbers):
                    yield float(numbers[0][0]) - float(numbers[1][0]) + _file_pages(folder)


def _file_pages(group: Path) -> float:
    counts = {name: float(value) for name, value in map(str.split, _lines(group / "memory.stat"))}
    # Version 1 counts pages of groups below under total_ only.
    return sum(counts.get(f"total_{name}", counts.get(name, 0.0)) for name in ("inactive_file", "active_file"))


def _own_addresses() -> int:
    """Size of this process's address space [B]."""
    pages = _lines(Path("/proc/self/statm"))
    return int(pages[0].split()[0]) * resource.getpagesize() if pages else 0


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text().splitlines()
    except OSError:
        return []
