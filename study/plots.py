"""How NeXus viewers find a plot in a result file: groups with their signals, axes and the slice that is shown first."""

from __future__ import annotations

from typing import Any

from study.layout import Layout
from study.quantity import MODELS


def view_slice(layout: Layout) -> list[str]:
    """Which two axes a viewer shows first (``.``) and where it stands on the others: the highest force, else 0."""
    names, shape = layout.names, layout.shape
    preference = [n for n in ("station", "angle", *names) if n in names]
    shown = [n for n in dict.fromkeys(preference) if shape[names.index(n)] > 1][:2] or list(names[-1:])
    last = {"normal_force": shape[-1] - 1}
    return ["." if n in shown else str(last.get(n, 0)) for n in names]


def groups(layout: Layout) -> dict[str, dict[str, Any]]:
    """Every group below ``/study`` with its attributes; NXdata groups draw themselves in NeXus viewers."""
    # silx takes an axis of exactly two values for a linear calibration and draws nothing: no axis is better there.
    names, shape = layout.names, layout.shape
    plot = {
        "NX_class": "NXdata",
        "axes": ["." if k == 2 else n for n, k in zip(names, shape, strict=True)],
        "default_slice": view_slice(layout),
        **{f"{n}_indices": i for i, (n, k) in enumerate(zip(names, shape, strict=True)) if k != 2},
    }
    found: dict[str, dict[str, Any]] = {}
    for q in layout.quantities:
        if q.group != "maps":
            continue
        several = {"signal": MODELS[0], "auxiliary_signals": list(layout.models[1:])}
        signal = several if q.by_model else {"signal": q.name}
        found[q.name] = {**plot, **signal, "title": q.long_name, "definition": q.definition}
    found["status"] = {**plot, "signal": "code", "title": "state of the cases"}
    collections = ["axes", "candidates", "provenance", "effects", *{q.group for q in layout.quantities}]
    collections += ["patch"] * layout.patches + ["derived"] * bool(layout.derived)
    found.update({name: {"NX_class": "NXcollection"} for name in sorted(collections) if name != "maps"})
    return found
