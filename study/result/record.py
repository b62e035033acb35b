"""The row of one case as an ordered list of arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.case.result import CaseResult
from softjaw.study.quantities import EFFECTS, MODELS
from softjaw.study.result.layout import Layout


def text_bytes(text: str, length: int) -> bytes:
    """UTF-8 of at most ``length`` bytes, on one line, without a broken last letter."""
    return " ".join(text.split()).encode()[:length].decode(errors="ignore").encode()


def blank(layout: Layout, message: str = "") -> list[np.ndarray]:
    """A row without values, as a failed case leaves it."""
    row = [np.full(c.shape, c.fill, c.dtype) for c in layout.columns]
    row[-1] = np.array(text_bytes(message, layout.message), layout.columns[-1].dtype)
    return row


def record(layout: Layout, result: CaseResult) -> list[np.ndarray]:
    """The row of a solved case, aligned with ``layout.columns``; what the result does not give stays empty.

    Raises
    ------
    ValueError
        A key or a shape that is not in ``study.quantities``: a bug of the caller, not a failed case.
    """
    given = _flattened(layout, result)
    row = blank(layout, result.message)
    for i, column in enumerate(layout.columns[:-1]):
        if column.key not in given:
            continue
        value = np.asarray(given.pop(column.key), column.dtype)
        if value.shape != column.shape:
            raise ValueError(f"'{column.key}' of a case has shape {value.shape}, its quantity says {column.shape}")
        row[i] = value
    if given:
        raise ValueError(f"a case gives {', '.join(sorted(given))}, which study.quantities does not list")
    return row


def _flattened(layout: Layout, result: CaseResult) -> dict[str, Any]:
    given = dict(result.values)
    for q in layout.quantities:
        if q.group == "maps" and q.by_model and q.key in given:
            values = np.asarray(given.pop(q.key), float)
            if values.shape != (len(MODELS),):
                raise ValueError(f"'{q.key}' of a case has shape {values.shape}, expected one for each of {MODELS}")
            given.update({f"{q.key}/{model}": value for model, value in zip(MODELS, values, strict=True)})
    if layout.patches and result.patch is not None:
        given.update({f"patch/{name}": value for name, value in result.patch.items()})
    for name, (level, indicator, reason) in result.effects.items():
        index = EFFECTS.get(name, ()).index(level) if isinstance(level, str) else level
        parts = {"level": index, "indicator": indicator, "reason": reason}
        given.update({f"effects/{name}_{part}": value for part, value in parts.items()})
    return given
