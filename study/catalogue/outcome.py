"""What a case came to: read from its result file, so that a table can be printed again without solving."""

from __future__ import annotations

from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study.catalogue.model import MAPS
from softjaw.study.result.layout import DONE, FAILED
from softjaw.study.result.store import open_result

CHECKS = {"force_balance": max, "tension": max, "penetration": max, "min_det_f": min, "acoustic": min}


@dataclass(frozen=True)
class Outcome:
    """A case as it was found.

    Parameters
    ----------
    refused : str
        Why it was not begun, or nothing.
    forces, done : (n,) arrays
        Force of every row [N], and whether it was solved.
    messages : tuple of str
        Remark or reason of every row.
    iterations, cuts : int
        Newton iterations and step cuts of the solved rows, both fingers.
    seconds : float
        Of solving.
    checks : dict
        The worst value of every check over rows and fingers.
    maps, errors : dict
        Values of the solved rows by quantity; their mesh errors, where two meshes were solved.
    """

    refused: str = ""
    forces: np.ndarray = field(default_factory=lambda: np.zeros(0))
    done: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))
    messages: tuple[str, ...] = ()
    missing: int = 0
    iterations: int = 0
    cuts: int = 0
    seconds: float = 0.0
    checks: dict[str, float] = field(default_factory=dict)
    maps: dict[str, np.ndarray] = field(default_factory=dict)
    errors: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def found(self) -> str:
        """Word for the outcome."""
        if self.refused:
            return "refused"
        if self.missing or not self.done.size:
            return "missing"
        return "solved" if self.done.all() else "failed"

    @property
    def text(self) -> str:
        """The outcome in a column of a table."""
        some = self.found == "failed" and self.done.any()
        return f"failed, {self.done.sum()} of {self.done.size} solved" if some else self.found


def outcome(path: Path) -> Outcome:
    """Outcome of the case whose result file is ``path``."""
    if not path.exists():
        return Outcome()
    with open_result(path) as result:
        codes, messages = result.status.ravel(), tuple(map(str, result.messages.ravel()))
        done = codes == DONE
        forces = np.broadcast_to(result.axes[-1].values, result.status.shape).ravel()
        checks = {name: _values(result.checks(name), done) for name in CHECKS}
        has = {d.path.split("/")[2] for d in result.layout.datasets}
        return Outcome(
            "", forces, done, messages, int(((codes != DONE) & (codes != FAILED)).sum()),
            *(int(np.nansum(_values(result.work(name), done))) for name in ("newton_iterations", "cuts")),
            _seconds(result, done),
            {name: float(CHECKS[name](values.ravel())) for name, values in checks.items() if values.size},
            {name: _map(result, name, done) for name in MAPS if name in has},
            {name: _map(result, f"{name}_error", done) for name in MAPS if f"{name}_error" in has},
        )  # fmt: skip


def _values(values: np.ndarray, done: np.ndarray) -> np.ndarray:
    """Of the solved rows, whatever follows the axes kept: ``(rows, ...)``."""
    return values.reshape(done.size, -1)[done]


def _map(result: Any, name: str, done: np.ndarray) -> np.ndarray:
    by_model = name in MAPS and MAPS[name].by_model
    return result.map(name, "curved" if by_model else None).ravel()[done]


def _seconds(result: Any, done: np.ndarray) -> float:
    """Time of solving; where a row failed, that of the runs, to a second."""
    if done.all():
        return float(np.nansum(result.work("seconds_total")))
    spans = [[datetime.fromisoformat(s[key]) for key in ("start", "stop")] for s in result.sessions if s["stop"]]
    return sum((stop - start).total_seconds() for start, stop in spans)
