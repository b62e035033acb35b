"""The contact patch of a case: pressure on every face of the pads' fronts, with the contact frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import QhullError, Voronoi

from study import pictures
from study.layout import DONE
from study.report.data import Data, number
from study.report.page import Picture

ALIKE = 1e-3  # difference of the fingers' pressures over the largest one that is not drawn twice
LOADED = 1e-9  # share of the largest pressure below which a face counts as free


def cells(points: np.ndarray) -> list[np.ndarray]:
    """The part of the plane that is nearest to each of the points ``(n, 2)``, within half a face of their outline.

    Raises
    ------
    ValueError
        For fewer than four points, or points on one line.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    if len(points) < 4 or not np.isfinite(points).all() or np.any(high - low <= 0):
        raise ValueError(f"{len(points)} faces make no patch")
    rim = 0.5 * np.sqrt(np.prod(high - low) / len(points))
    low, high = low - rim, high + rim
    mirrored = [points]
    for axis in range(2):
        for border in (low[axis], high[axis]):
            image = points.copy()
            image[:, axis] = 2 * border - image[:, axis]
            mirrored.append(image)
    try:
        found = Voronoi(np.concatenate(mirrored))
    except QhullError as error:
        raise ValueError("the faces make no patch") from error
    return [found.vertices[found.regions[found.point_region[i]]] for i in range(len(points))]


def patch_picture(data: Data, index: tuple[int, ...]) -> Picture | None:
    """Pressure on the pads of one case, from the front and along the pad's long side; None if it is not stored."""
    if not data.result.layout.patches or data.status[index] != DONE:
        return None
    patch = data.result.patch(data.result.row(*index))
    if {"pressure", "centroid", "area"} - patch.keys() or not np.isfinite(patch["pressure"]).any():
        return None
    pressure = np.nan_to_num(patch["pressure"]) * 1e-3
    fingers = [0] if _alike(pressure) else [0, 1]
    heights = 3.1 * len(fingers) + 0.2
    drawn, axes = pictures.figure(10, heights, len(fingers), 2, width_ratios=[1.9, 1])
    top = pressure.max()
    try:
        for row, finger in enumerate(fingers):
            place = 1e3 * patch["centroid"][finger]
            mapped = _front(data, axes[row, 0], index, finger, place, pressure[finger], top)
            _profile(axes[row, 1], place, pressure[finger], top)
            name = f"finger {finger + 1}" if len(fingers) > 1 else "both fingers carry the same"
            axes[row, 0].set_title(f"pad front, {name}")
            axes[row, 1].set_title("seen along x, the object above")
            pictures.colour_bar(drawn, mapped, axes[row, 0], "pressure [kPa]", beside=True)
    except ValueError:
        return None
    area, peak = data.at("contact_area", index) * 1e6, float(top)
    said = f"largest pressure {number(peak)} kPa, contact area {number(area)} mm²"
    caption = (
        f"{data.place(index, force=True)}: {said}. Faces that touch nothing are pale. The arrows are the axes x and y "
        "of the contact frame at its origin; friction is given along them, and about their normal z."
    )
    return Picture(pictures.as_svg(drawn), f"Contact pressure on the pad, {said}", caption)


def _alike(pressure: np.ndarray) -> bool:
    one, two = np.sort(pressure, axis=1)
    return bool(np.abs(one - two).max() <= ALIKE * max(pressure.max(), 1e-300))


def _front(data: Data, axes: Any, index: Any, finger: int, place: np.ndarray, pressure: np.ndarray, top: float) -> Any:
    corners = cells(place[:, :2])
    loaded = pressure > LOADED * top
    free = [corners[i] for i in np.flatnonzero(~loaded)]
    if free:
        pale = {"cmap": "Greys", "vmin": 0, "vmax": 12, "edgecolor": "#d5dade"}
        pictures.polygons(axes, free, np.zeros(len(free)), **pale).set_zorder(0)
    touching = [corners[i] for i in np.flatnonzero(loaded)]
    style = {"cmap": pictures.COLOURS["pressure"], "vmin": 0.0, "vmax": top or 1.0}
    mapped = pictures.polygons(axes, touching, pressure[loaded], **style)
    low, high = np.concatenate(corners).min(axis=0), np.concatenate(corners).max(axis=0)
    room = 0.02 * (high - low).max()
    axes.set(xlim=(low[0] - room, high[0] + room), ylim=(low[1] - room, high[1] + room), aspect="equal")
    axes.set(xlabel="x, along the pad [mm]", ylabel="y, across [mm]")
    origin, frame = data.values("fingers/frame_origin"), data.values("fingers/frame_axes")
    if origin is not None and frame is not None:
        _frame(axes, 1e3 * origin[index][finger], frame[index][finger], 0.28 * min(high - low))
    return mapped


def _frame(axes: Any, origin: np.ndarray, frame: np.ndarray, length: float) -> None:
    for name, direction in zip("xy", frame[:2], strict=True):
        tip = origin[:2] + length * direction[:2]
        pictures.arrow(axes, origin[:2], tip)
        outside = origin[:2] + 1.22 * length * direction[:2]
        box = {"boxstyle": "circle,pad=0.12", "facecolor": "white", "edgecolor": "none", "alpha": 0.85}
        axes.text(*outside, name, ha="center", va="center", fontsize=8, bbox=box)
    axes.plot(*origin[:2], "o", ms=4, mfc="white", mec=pictures.INK)


def _profile(axes: Any, place: np.ndarray, pressure: np.ndarray, top: float) -> None:
    loaded = pressure > LOADED * top
    axes.plot(place[~loaded, 1], place[~loaded, 2], ".", color="#b9c0c6", ms=3)
    order = np.flatnonzero(loaded)[np.argsort(pressure[loaded])]
    axes.scatter(place[order, 1], place[order, 2], c=pressure[order], s=9, cmap=pictures.COLOURS["pressure"], vmin=0,
                 vmax=top or 1.0)  # fmt: skip
    axes.set(xlabel="y, across [mm]", ylabel="z [mm]", aspect="equal")
