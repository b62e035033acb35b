"""What a run says when it ends."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.quantities import DONE, MISSING
from softjaw.study.result.read import dataset
from softjaw.study.show.tables.columns import terminal_width
from softjaw.study.show.tables.show import as_text, best
from softjaw.study.show.tables.status import counts, reasons, time_split


def summary(result: Any) -> str:
    """What a run says at its end: counts, reasons of failures, where the time went, best grasps, the file."""
    width = terminal_width()
    table = [as_text(best(dataset(result), whole_lines=True), width)] if np.any(result.status == DONE) else []
    again = "; run the same command again to resume" if np.any(result.status == MISSING) else ""
    lines = [counts(result), *reasons(result, width), *time_split(result), *table]
    return "\n".join([*lines, f"results are in {result.path}{again}"])
