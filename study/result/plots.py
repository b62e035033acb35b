"""How NeXus viewers find a plot in a result file: groups with their signals, axes and the slice that is shown first.

``map`` is where they open. It repeats two maps with the axes turned so that stations run to the right and angles up,
which viewers that always draw the last two axes show at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from softjaw.study.quantities import FIRST, MODELS
from softjaw.study.result.layout import Layout

EVEN = 1e-6  # relative difference of steps that makes an axis uneven


def view_slice(layout: Layout, order: Sequence[int]) -> list[str]:
    """Which axes a viewer shows first (``.``) and where it stands on the others: the highest force, else 0."""
    last = len(layout.shape) - 1
    return ["." if i in layout.shown else str(layout.shape[i] - 1 if i == last else 0) for i in order]


def axes_of(layout: Layout, order: Sequence[int]) -> dict[str, Any]:
    """Names of the axes in an order, as NeXus wants them.

    silx takes an axis of exactly two values for a linear calibration and draws nothing: no axis (``.``) is better
    there. Beside an uneven axis it draws dots instead, and then needs both.
    """
    values = [np.asarray(layout.axes[i].values, float) for i in order]
    even = all(np.ptp(np.diff(v)) <= EVEN * np.ptp(v) for v in values[-2:] if len(v) > 2)
    names = ["." if len(v) == 2 and even else layout.names[i] for v, i in zip(values, order, strict=True)]
    return {"axes": names, **{f"{name}_indices": i for i, name in enumerate(names) if name != "."}}


def _plot(layout: Layout, order: Sequence[int]) -> dict[str, Any]:
    return {"NX_class": "NXdata", **axes_of(layout, order), "default_slice": view_slice(layout, order)}


def groups(layout: Layout) -> dict[str, dict[str, Any]]:
    """Every group below ``/study`` with its attributes; NXdata groups draw themselves in NeXus viewers."""
    plot = _plot(layout, range(len(layout.shape)))
    first = {"signal": FIRST[0], "auxiliary_signals": list(FIRST[1:]), "title": "grasp map, curved model"}
    found: dict[str, dict[str, Any]] = {"map": {**_plot(layout, layout.seen), **first}}
    for q in layout.quantities:
        if q.group != "maps":
            continue
        several = {"signal": MODELS[0], "auxiliary_signals": list(layout.models[1:])}
        signal = several if q.by_model else {"signal": q.name}
        found[q.name] = {**plot, **signal, "title": q.label, "definition": q.definition}
    found["status"] = {**plot, "signal": "code", "title": "state of the cases"}
    collections = ["axes", "candidates", "provenance", *{q.group for q in layout.quantities} - {"status"}]
    collections += ["derived"] * bool(layout.derived)
    collections += ["checksums"] * (layout.version > 3)
    found.update({name: {"NX_class": "NXcollection"} for name in sorted(collections) if name != "maps"})
    return found
