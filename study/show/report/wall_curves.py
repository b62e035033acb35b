"""Force over travel and over the dent of every station: where a wall gives way, and where it snaps in."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.flags import Flag
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number
from softjaw.study.show.report.page import Picture

MOST_LINES = 40


def force_curves(data: Data, index: tuple[int, ...], allowed: float | None) -> Picture | None:
    """Force over travel and over the dent; ``allowed`` is the dent that the scene allows [m]."""
    travel, dent = data.map("travel"), data.map("dent")
    if dent is None or travel is None or len(data.forces) < 2:
        return None
    cut = (*index[:-3], slice(None), index[-2], slice(None))
    snapped = (data.flags & Flag.SNAPPED > 0)[cut]
    drawn, axes = pictures.figure(10, 3.3, 1, 2, gap=0.16, sharey=True)
    panels = ((travel, "travel of the pads"), (dent, "dent"))
    for panel, (found, text) in zip(axes[0], panels, strict=True):
        for i in _others(data, index):
            _line(panel, data.forces, 1e3 * found[cut][i], snapped[i], {"color": "#aeb6bc", "lw": 0.9}, "o")
        own = {"color": pictures.MODEL_STYLE["curved"]["color"], "lw": 1.8, "zorder": 4}
        _line(panel, data.forces, 1e3 * found[cut][index[-3]], snapped[index[-3]], own, "o")
        panel.set(xlabel=f"{text} [mm]", xlim=(0, None), ylim=(0, None))
    if allowed is not None and 1e3 * allowed < axes[0, 1].get_xlim()[1]:
        axes[0, 1].axvline(1e3 * allowed, color="#c05a00", lw=1, ls="--", zorder=1)
    axes[0, 0].set_ylabel("force per finger [N]")
    rule = f" Dashed, upright: the allowed dent, {1e3 * allowed:g} mm." if allowed is not None else ""
    which = "candidates" if data.by_poses else "stations at this angle"
    others = f" Grey: the other {which}." if _others(data, index) else ""
    caption = (
        f"Dark: {data.place(index)}.{others} Points are solved forces. A wall that gives way evenly makes straight"
        " lines; one that softens bends them to the right. Diamonds, after a dotted line: the wall has snapped in on"
        f" the way there.{rule}"
    )
    alt = f"Normal force over travel and dent. At {data.place(index, force=True)} the dent is {_mm(dent[index])} mm."
    return Picture(pictures.as_svg(drawn), alt, caption)


def _mm(value: float) -> str:
    return number(1e3 * float(value))


def _others(data: Data, index: tuple[int, ...]) -> list[int]:
    """Some other stations, evenly spread."""
    here = [i for i in range(data.shape[-3]) if i != index[-3]]
    step = -(-len(here) // MOST_LINES) if here else 1
    return here[::step]


def _line(panel: Any, forces: np.ndarray, x: np.ndarray, snapped: np.ndarray, look: dict[str, Any], mark: str) -> None:
    """One line from the origin through the solved forces, dotted where the wall snapped in on the way."""
    known = np.isfinite(x)
    X, F, S = (np.concatenate([[0], a[known]]) for a in (x, forces, snapped.astype(int)))
    first = int(S.argmax()) if S.any() else len(X)
    plain = {"marker": mark, "ms": 3.2, **look}
    panel.plot(X[:first], F[:first], markevery=slice(1, None), **plain)
    if first < len(X):
        panel.plot(X[first - 1 : first + 1], F[first - 1 : first + 1], ls=":", **look)
        panel.plot(X[first:], F[first:], **{**plain, "marker": "D", "ms": 4.2})
