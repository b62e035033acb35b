"""The contact patch of a case: pressure on every face of the pads' fronts, with the contact frame."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.spatial import QhullError, Voronoi

from softjaw.study.result.layout import DONE
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number
from softjaw.study.show.report.page import Picture

ALIKE = 1e-3  # difference of the fingers' pressures over the largest one that is not drawn twice
MOTIONS = ("x", "turn")
ARROWS = 18  # along the pad's longer side, at most
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
    """Pressure and friction on the pads of one case, and the front along its long side; None if it is not stored."""
    if not data.result.layout.patches or data.status[index] != DONE:
        return None
    patch = data.result.patch(data.result.row(*index))
    if {"pressure", "centroid", "area"} - patch.keys() or not np.isfinite(patch["pressure"]).any():
        return None
    pressure = np.nan_to_num(patch["pressure"]) * 1e-3
    fingers = [0] if _alike(pressure) else [0, 1]
    drawn, axes = pictures.figure(10, 2.3 * len(fingers) + 0.2, len(fingers), 3, width_ratios=[1, 1, 0.5])
    top, directed = pressure.max(), False
    try:
        for row, finger in enumerate(fingers):
            place = 1e3 * patch["centroid"][finger]
            frame, corners = _contact_frame(data, index, finger), cells(place[:, :2])
            for panel, motion in zip(axes[row], MOTIONS, strict=False):
                mapped = _front(panel, corners, pressure[finger], top)
                if frame is not None:
                    directed |= _friction(panel, patch, finger, frame, motion)
                    _frame(panel, *frame, 0.28 * np.ptp(place[:, :2], axis=0).min())
            name = f"finger {finger + 1}" if len(fingers) > 1 else "both fingers alike"
            axes[row, 0].set_title(f"{name}: slip along x")
            axes[row, 1].set_title(f"{name}: turn about z")
            axes[row, 1].set_ylabel("")
            _profile(axes[row, 2], place, pressure[finger], top)
            pictures.colour_bar(drawn, mapped, axes[row, 1], "pressure [kPa]", beside=True)
    except ValueError:
        return None
    area, peak = data.at("contact_area", index) * 1e6, float(top)
    said = f"largest pressure {number(peak)} kPa, contact area {number(area)} mm²"
    darts = (
        "Small arrows: friction that the pad's faces feel, each in its own plane, while the object slips along x or "
        "turns about z; their length is its size. " * directed
    )
    caption = (
        f"{data.place(index, force=True)}: {said}. Faces that touch nothing are pale. {darts}x and y are the axes of "
        "the contact frame at its origin (ring); friction is given along them, and about their normal z. Right: the "
        "front across the pad, the object above."
    )
    alt = f"Contact pressure{' and directions of friction' * directed} on the pad, {said}"
    return Picture(pictures.as_webp(drawn), alt, caption, kind="webp")


def _alike(pressure: np.ndarray) -> bool:
    one, two = np.sort(pressure, axis=1)
    return bool(np.abs(one - two).max() <= ALIKE * max(pressure.max(), 1e-300))


def _front(axes: Any, corners: list[np.ndarray], pressure: np.ndarray, top: float) -> Any:
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
    return mapped


def _contact_frame(data: Data, index: tuple[int, ...], finger: int) -> tuple[np.ndarray, np.ndarray] | None:
    """Origin ``(3,)`` [mm] and axes as rows ``(3, 3)`` of the contact frame in the pad's frame; None if not stored."""
    origin, frame = data.values("fingers/frame_origin"), data.values("fingers/frame_axes")
    if origin is None or frame is None:
        return None
    return 1e3 * origin[index][finger], frame[index][finger]


def friction_directions(
    place: np.ndarray, normal: np.ndarray, origin: np.ndarray, frame: np.ndarray, motion: str
) -> np.ndarray:
    """Unit directions ``(n, 3)`` of the friction that faces feel while the object slips along x or turns about z.

    Every face resists in its own plane (curved contact model); zero where the object only lifts off or presses.
    """
    v = np.broadcast_to(frame[0], place.shape) if motion == "x" else np.cross(frame[2], place - origin)
    v = v - np.einsum("ki,ki->k", v, normal)[:, None] * normal
    size = np.linalg.norm(v, axis=1, keepdims=True)
    return np.divide(v, size, out=np.zeros_like(v), where=size > 1e-12)


def _friction(axes: Any, patch: dict[str, np.ndarray], finger: int, frame: Any, motion: str) -> bool:
    """Arrows of some loaded faces; whether there are any."""
    if "normal" not in patch:
        return False
    place, load = 1e3 * patch["centroid"][finger], np.nan_to_num(patch["pressure"][finger] * patch["area"][finger])
    e = friction_directions(place, patch["normal"][finger], *frame, motion)
    some = _spread(place, np.flatnonzero(load > LOADED * load.max(initial=0.0)))
    if not some.size:
        return False
    arrows = (load[some] / load.max())[:, None] * e[some, :2]
    step = np.ptp(place[:, :2], axis=0).max() / ARROWS
    look = {"angles": "xy", "scale_units": "xy", "scale": 0.9 / step, "width": 0.0045, "pivot": "mid", "zorder": 4}
    axes.quiver(*place[some, :2].T, *arrows.T, color="white", edgecolor=pictures.INK, linewidth=0.5, **look)
    return True


def _spread(place: np.ndarray, loaded: np.ndarray) -> np.ndarray:
    """Of the loaded faces one in each square of a coarse grid over the pad, the one nearest to its middle."""
    low, step = place[:, :2].min(axis=0), np.ptp(place[:, :2], axis=0).max() / ARROWS
    share = (place[loaded, :2] - low) / step
    square = np.floor(share - 1e-9).astype(int)
    order = np.lexsort((np.linalg.norm(share - square - 0.5, axis=1), square[:, 1], square[:, 0]))
    first = np.unique(square[order], axis=0, return_index=True)[1]
    return loaded[order[first]]


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
    true = np.ptp(place[:, 2]) > 0.25 * np.ptp(place[:, 1])  # else it would be a line
    axes.set(xlabel="y, across [mm]", ylabel="z [mm]", aspect="equal" if true else "auto")
    axes.set_title("along x" if true else "along x, z stretched")
