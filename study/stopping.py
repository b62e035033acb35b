"""Signals: finish the case in flight if there is time, give it up otherwise, and leave in an orderly way."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

# Seconds to finish the case in flight. mpirun kills its ranks about two seconds after it was interrupted; USR1 is what
# batch systems are asked to send a minute before the time limit.
GRACE = {signal.SIGUSR1: 30.0, signal.SIGTERM: 0.5, signal.SIGINT: 0.5}


class AbandonedError(BaseException):
    """The case in flight is given up; not an ``Exception``, so that no solver takes it for a failed step."""


class Stopper:
    """Listens to signals between ``with stopper:``; ``name`` is the signal that came, or empty."""

    def __init__(self, on_stop: Callable[[], None]) -> None:
        self.name = ""
        self._on_stop, self._solving, self._before = on_stop, False, {}

    def __enter__(self) -> Stopper:
        """Take the handlers over."""
        self._before = {number: signal.signal(number, self._stop) for number in GRACE}
        self._before[signal.SIGALRM] = signal.signal(signal.SIGALRM, self._abandon)
        return self

    def __exit__(self, *_: object) -> None:
        """Put the earlier handlers back."""
        signal.setitimer(signal.ITIMER_REAL, 0)
        for number, handler in self._before.items():
            signal.signal(number, handler)

    @contextmanager
    def case(self) -> Iterator[None]:
        """Around a solve: here, and only here, a signal may raise `AbandonedError`."""
        self._solving = True
        try:
            yield
        finally:
            self._solving = False

    def _stop(self, number: int, _frame: Any) -> None:
        if self.name:
            self._abandon()
            return
        self.name = signal.Signals(number).name
        self._on_stop()
        signal.setitimer(signal.ITIMER_REAL, GRACE[signal.Signals(number)])

    def _abandon(self, *_: Any) -> None:
        if self._solving:
            self._solving = False
            raise AbandonedError
