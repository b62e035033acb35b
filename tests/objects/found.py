"""What became of an object or a scene: candidates by state, reasons of failures, best pose, time."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
import xarray as xr

from softjaw.study.quantities import DONE, FAILED, MISSING, STATES
from softjaw.study.result.read import open as read
from tests.objects.reasons import reason_of

SOLVED, LOST, UNTRIED = STATES[DONE], STATES[FAILED], STATES[MISSING]
TRIED = (SOLVED, LOST, UNTRIED)  # of the states of candidates; the others were recognised before a solve


@dataclass
class Found:
    """An object with all its candidates.

    Parameters
    ----------
    name, kind : str
    seconds : float
        CPU time of all processes from the file of the object to its map [s].
    states : dict
        Number of candidates by state; a candidate is complete if all its forces are.
    failures : list of (str, str)
        Candidate with force, and why it failed: the first force of each.
    best : str
        Label, quality and flags of the best grasp.
    refused : str
        Why there is no result, or no whole one.
    """

    name: str
    kind: str
    seconds: float = 0.0
    states: dict[str, int] = field(default_factory=dict)
    failures: list[tuple[str, str]] = field(default_factory=list)
    best: str = ""
    refused: str = ""

    def count(self, *states: str) -> int:
        """Number of candidates in these states."""
        return sum(self.states.get(state, 0) for state in states)

    @property
    def messages(self) -> list[str]:
        """A message for each candidate that failed, and one for an object that was refused or stopped."""
        return [message for _, message in self.lost]

    @property
    def lost(self) -> list[tuple[str, str]]:
        """Where, and the message, of each failure."""
        return [*self.failures, *([("whole", self.refused)] if self.refused else [])]

    @property
    def why(self) -> str:
        """Classes of the failures with their numbers."""
        return ", ".join(f"{n} {name}" for name, n in Counter(reason_of(m).name for m in self.messages).items())

    def save(self, file: Path) -> None:
        """Write as JSON."""
        file.write_text(json.dumps(asdict(self), indent=1))

    @staticmethod
    def load(file: Path) -> Found:
        """Read what `save` wrote."""
        return Found(**json.loads(file.read_text()))


def candidate_state(states: np.ndarray) -> int:
    """State of a candidate by those of its forces: failed if one failed, missing if one is missing.

    >>> candidate_state(np.array([DONE, DONE, FAILED])), candidate_state(np.array([DONE, DONE]))
    (2, 1)
    """
    return next((code for code in (FAILED, MISSING) if code in states), int(states[-1]))


def of_file(file: Path) -> tuple[dict[str, int], list[tuple[str, str]]]:
    """Numbers of candidates by state, and the failures, of a result file."""
    ds: xr.Dataset = read(file)
    forces = ds.normal_force.values
    status, message = (ds[name].values.reshape(-1, len(forces)) for name in ("status", "message"))
    labels = ds.label if "label" in ds.coords else ds.station
    places = xr.broadcast(labels, ds.status)[0].transpose(*ds.status.dims).values[..., 0].ravel()
    states: Counter[str] = Counter()
    failures = []
    for place, row, told in zip(places, status, message, strict=True):
        states[STATES[candidate_state(row)]] += 1
        lost = np.flatnonzero(row == FAILED)
        if lost.size:
            failures.append((f"{place}, {forces[lost[0]]:g} N", str(told[lost[0]])))
    return dict(states), failures
