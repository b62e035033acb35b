"""Fig. 5 of the paper: candidates on an object, one asymmetric contact, and the wrenches that both models allow."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study import pictures
from softjaw.study.scene import load_scene
from softjaw.study.show.data import Data, number
from softjaw.study.show.figures import JOBS, WIDTH
from softjaw.study.show.outline import read_scene, shape_outline
from softjaw.study.show.stored_surface import StoredSurface, circle, stored_surface
from softjaw.study.show.view import solids
from softjaw.study.show.view.model import FORCE, NEUTRAL, View
from softjaw.study.show.view.pads import Pad, pads

MAP = "bottle"  # the scene whose candidates are shown
MODELS = ("pcm", "ccm")
PLANES = ((0, 1), (1, 2))
NAMES = ("f_x", "f_y", "tau_z")
UNITS = ("N", "N", "N mm")
MILLI = np.array([1.0, 1.0, 1e3])
MARK = 0.8  # radius of a candidate's mark [mm]
TURN = 144  # directions in a plane


def candidates(data: Data) -> tuple[Any, str]:
    """(a) The candidates of a map on its object, and the pressure on a pad at one of them."""
    index = (0, 0, len(data.forces) - 1)
    view, both = View(data, ()), pads(data, read_scene(data.ds.attrs["scene"]).gripper, index)
    pad, top = both[0], 1e-3 * max(float(p.pressure.max()) for p in both)
    marks, up = candidate_marks(), np.array([0.0, 0.0, 1.0])

    def whole(plotter: Any) -> None:
        solids.surface(plotter, 1e3 * view.surface.points, view.surface.triangles, color=NEUTRAL)
        solids.dots(plotter, 1e3 * marks, MARK, color=FORCE)
        for one in both:
            solids.block(plotter, one)
            solids.pressures(plotter, one, top)

    drawn, axes = pictures.figure(WIDTH, 3.5, 1, 2, width_ratios=[1, 1.7])
    seen = -0.5 * pad.approach + 0.85 * np.cross(up, pad.approach) + 0.2 * up
    pictures.placed(
        axes[0, 0], solids.rendered(whole, seen, up, (1100, 1300)), f"(a) {len(marks) // 2} candidates, one grasp"
    )
    mapped = _front(axes[0, 1], pad, top)
    name = f"station {number(1e3 * data.axes[-3].values[0])} mm, {number(data.forces[index[-1]])} N"
    axes[0, 1].set_title(f"pressure on its pad: {name}")
    pictures.colour_bar(drawn, mapped, axes[0, 1], "pressure [kPa]", beside=True)
    off = 1e3 * np.linalg.norm(pad.own(pad.origin)[:2])
    return drawn, f"the contact's origin lies {number(off)} mm from the middle of the pad: pressure is not symmetric"


def candidate_marks() -> np.ndarray:
    """Where the fingers of the map's candidates touch ``(2 c, 3)`` [m]."""
    scene = load_scene(JOBS / f"{MAP}.toml")
    found = []
    for angle in scene.candidates.angles:
        z, half = shape_outline(scene.object, angle)
        stations = np.array(scene.candidates.station_values)
        reach = np.interp(stations, z, half)
        for sign in (1.0, -1.0):
            found.append(np.stack([sign * reach * np.cos(angle), sign * reach * np.sin(angle), stations], axis=1))
    return np.concatenate(found)


def _front(axes: Any, pad: Pad, top: float) -> Any:
    """The pad's front in its own frame, with the contact frame and the pad's middle."""
    corners, loaded = 1e3 * pad.own(pad.quads().reshape(-1, 3)).reshape(-1, 4, 3)[..., :2], pad.loaded.ravel()
    pale = {"cmap": "Greys", "vmin": 0, "vmax": 12, "edgecolor": "#d5dade"}
    pictures.polygons(axes, corners[~loaded], np.zeros((~loaded).sum()), **pale).set_zorder(0)
    style = {"cmap": pictures.COLOURS["pressure"], "vmin": 0.0, "vmax": top}
    mapped = pictures.polygons(axes, corners[loaded], 1e-3 * pad.pressure.ravel()[loaded], **style)
    origin, frame = 1e3 * pad.own(pad.origin)[:2], pad.frame @ pad.rotation
    for name, direction in zip("xy", frame[:2], strict=True):
        pictures.arrow(axes, origin, origin + 8 * direction[:2])
        axes.text(*(origin + 10 * direction[:2]), name, ha="center", va="center")
    axes.plot(*origin, "o", ms=5, mfc="white", mec=pictures.INK)
    axes.plot(0, 0, "+", ms=9, mew=1.4, color=pictures.INK)
    axes.annotate("middle of the pad", (0, 0), (0, -3), textcoords="data", ha="center", va="top", fontsize=8)
    low, high = corners.min(axis=(0, 1)) - 1, corners.max(axis=(0, 1)) + 1
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set(xlabel="along the pad [mm]", ylabel="across the pad [mm]")
    return mapped


def wrench_spaces(data: Data, sharp: Data) -> tuple[Any, str]:
    """(b) Shadows of both models' wrench spaces and their distance, for the contact of (a) and a sharp cylinder."""
    cases = (
        ("the contact of (a)", data, (0, 0, len(data.forces) - 1)),
        (f"elliptic cylinder, a/b = {number(_sharpest(sharp)[1])}", sharp, _sharpest(sharp)[0]),
    )
    drawn, axes = pictures.figure(WIDTH, 5.0, 2, 3, gap=0.06)
    words = []
    for row, (name, file, index) in zip(axes, cases, strict=True):
        known = {model: stored_surface(file, index, 0, model) for model in MODELS}
        for panel, (i, j) in zip(row, PLANES, strict=False):
            _shadows(panel, known, i, j)
        gaps = _gaps(row[2], known)
        row[0].set_title(f"{name}, {number(file.forces[index[-1]])} N")
        words.append(f"{name}: up to {number(gaps, 2)} % of what the flat model claims is missing")
    axes[0, 0].set_title(f"(b) {axes[0, 0].get_title(loc='left')}")
    named = [pair for k in (0, 2) for pair in zip(*axes[0, k].get_legend_handles_labels(), strict=True)]
    drawn.legend(*zip(*named, strict=True), loc="outside lower center", ncols=len(named), frameon=False, fontsize=8)
    return drawn, "; ".join(words)


def _sharpest(data: Data) -> tuple[tuple[int, ...], float]:
    ratio = data.bound("b_over_a")
    return (int(ratio.argmin()), 0, 0, len(data.forces) - 1), 1 / float(ratio.min())


def _shadows(panel: Any, known: dict[str, StoredSurface], i: int, j: int) -> None:
    for model, found in known.items():
        outline = found.outline(i, j, TURN) * (found.unit * MILLI)[[i, j]]
        closed = np.vstack([outline, outline[:1]])
        style = {k: v for k, v in pictures.MODEL_STYLE[model].items() if k != "marker"}
        panel.plot(*closed.T, **style, label={"ccm": "curved (CCM)", "pcm": "flat (PCM)"}[model])
    panel.set(xlabel=f"{NAMES[i]} [{UNITS[i]}]", ylabel=f"{NAMES[j]} [{UNITS[j]}]")
    if (i, j) == (0, 1):
        panel.set_aspect("equal", adjustable="datalim")


def _gaps(panel: Any, known: dict[str, StoredSurface]) -> float:
    """Share of the flat model's claim that is missing, over the direction in each plane; the largest [%]."""
    looks = ({"ls": "-"}, {"ls": "--"}, {"ls": ":"})
    largest = 0.0
    for (i, j), look in zip(((0, 1), (0, 2), (1, 2)), looks, strict=True):
        t = circle(i, j, TURN)[: TURN // 2 + 1]
        # along a motion the wrench resists as much as the body reaches: its support
        reach = {model: np.einsum("ki,ki->k", found.wrenches(t), t) for model, found in known.items()}
        gap = 100 * (1 - reach["ccm"] / reach["pcm"])
        largest = max(largest, float(gap.max()))
        panel.plot(np.linspace(0, 180, len(gap)), gap, color=pictures.INK, label=f"{NAMES[i]} to {NAMES[j]}", **look)
    panel.set(xlabel="direction in the plane [°]", ylabel="1 - curved / flat [%]", xlim=(0, 180), ylim=(0, None))
    panel.set_xticks([0, 45, 90, 135, 180])
    return largest
