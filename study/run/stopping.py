"""Signals and time limits: finish the case in flight if there is time, give it up otherwise, leave in order."""

from __future__ import annotations

import faulthandler
import math
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

from softjaw.study.case.result import TimeLimitError

# Seconds to finish the case in flight. mpirun kills its ranks about two seconds after it was interrupted; USR1 is what
# batch systems are asked to send a minute before the time limit.
GRACE = {signal.SIGUSR1: 30.0, signal.SIGTERM: 0.5, signal.SIGINT: 0.5}
AGAIN = 1.0  # s; what a handler raises inside a finaliser is printed and lost, so it is raised once more


class AbandonedError(BaseException):
    """The case in flight is given up; not an ``Exception``, so that no solver takes it for a failed step."""


class Stopper:
    """Listens to signals between ``with stopper:``; ``name`` is the signal that came, or empty; ``limit`` as below.

    Parameters
    ----------
    on_stop : callable
        Called once, by the first signal.
    limit : float
        Time of a single case [s]. It is looked at whenever the solver comes back to Python, which PETSc does for every
        residual and every tangent.
    last_resort : float, optional
        Time after which this process ends itself because a case never came back to Python [s]; for a process that has
        nobody beside it to notice.
    """

    def __init__(self, on_stop: Callable[[], None], limit: float = math.inf, last_resort: float | None = None) -> None:
        self.name = ""
        self.limit = limit
        self._on_stop, self._last_resort = on_stop, last_resort
        self._solving, self._before = False, {}
        self._leave = self._case_ends = math.inf

    def __enter__(self) -> Stopper:
        """Take the handlers over."""
        self._before = {number: signal.signal(number, self._stop) for number in GRACE}
        self._before[signal.SIGALRM] = signal.signal(signal.SIGALRM, self._alarm)
        return self

    def __exit__(self, *_: object) -> None:
        """Put the earlier handlers back."""
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @property
    def overdue(self) -> float:
        """Seconds since the moment at which everybody should have stopped; negative before, and without a signal."""
        return time.monotonic() - self._leave

    @contextmanager
    def case(self) -> Iterator[None]:
        """Around a solve: here, and only here, an `AbandonedError` or a `TimeLimitError` may be raised."""
        self._case_ends = time.monotonic() + self.limit
        self._set_alarm()
        if self._last_resort is not None:  # in a thread that needs nothing of Python, which may never be back
            faulthandler.dump_traceback_later(self._last_resort, exit=True, file=sys.__stderr__)
        self._solving = True
        try:
            yield
        finally:
            self._solving, self._case_ends = False, math.inf
            self._set_alarm()
            if self._last_resort is not None:
                faulthandler.cancel_dump_traceback_later()

    def _stop(self, number: int, _frame: Any) -> None:
        if self.name:
            self._raise(AbandonedError)
            return
        self.name = signal.Signals(number).name
        self._leave = time.monotonic() + GRACE[signal.Signals(number)]
        self._on_stop()
        self._set_alarm()

    def _set_alarm(self) -> None:
        left = min(self._leave, self._case_ends) - time.monotonic()
        signal.setitimer(signal.ITIMER_REAL, 0 if left == math.inf else max(left, 1e-3), AGAIN)

    def _alarm(self, *_: Any) -> None:
        now = time.monotonic()
        if now >= self._leave:
            self._raise(AbandonedError)
        elif now >= self._case_ends:
            self._raise(TimeLimitError)

    def _raise(self, error: type[BaseException]) -> None:
        if self._solving:
            raise error
