"""Sections through a deformed wall and both pads, beside the undeformed outline: true to scale."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.study.quantities import ALONG, AROUND
from softjaw.study.result.layout import DONE
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number
from softjaw.study.show.outline import undeformed
from softjaw.study.show.report.page import Picture
from softjaw.study.show.tables.ranking import largest

LEVEL = 0.05  # of an approach along the object's axis, beyond which sections would not show both fingers
FINE = 180  # points of a ring
PAD, WALL = "#dfe4e8", "#12436d"


@dataclass(frozen=True)
class Cut:
    """Plane of a section through the axis (``upright``) or across it: what its points need of the object's frame."""

    upright: bool
    angle: float
    height: float

    def flat(self, x: np.ndarray) -> np.ndarray:
        """Coordinates ``(..., 2)`` in the plane [mm]: the approach is drawn upwards in both."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        along, beside = x[..., 0] * c + x[..., 1] * s, x[..., 1] * c - x[..., 0] * s
        return 1e3 * np.stack([x[..., 2] if self.upright else -beside, along], axis=-1)

    def off(self, x: np.ndarray) -> np.ndarray:
        """Distance of points from the plane [m]."""
        c, s = np.cos(self.angle), np.sin(self.angle)
        return x[..., 1] * c - x[..., 0] * s if self.upright else x[..., 2] - self.height

    def outline(self, place: np.ndarray) -> np.ndarray:
        """Line of a wall ``(AROUND, ALONG, 3)`` in the plane, ``(n, 2)`` [mm]."""
        if self.upright:  # the angles begin at finger 1
            return self.flat(np.concatenate([place[AROUND // 2, ::-1], place[0]]))
        return self.flat(_ring(place, self.height))


def shape_picture(data: Data, scene: Any, index: tuple[int, ...]) -> Picture | None:
    """Best case, and the one with the deepest dent; None where no deformed wall is stored."""
    places = data.result.read("wall/place") if data.walled else None
    cases = [i for i in dict.fromkeys((index, _deepest(data))) if i and _stored(data, places, i)]
    found = {i: _drawing(data, scene, i, places[i].reshape(AROUND, ALONG, 3)) for i in cases}
    cases, drawings = [i for i in found if found[i]], [one for one in found.values() if one]
    if not cases:
        return None
    boxes = [_box([one[k] for one in drawings]) for k in (0, 1)]
    tall, wide = max(b[1] for b in boxes), [b[0] for b in boxes]
    height = min(max(8.4 * tall / sum(wide), 1.8), 4.2)
    drawn, axes = pictures.figure(10, (height + 0.62) * len(cases), len(cases), 2, width_ratios=wide, gap=0.12)
    for row, (case, one) in enumerate(zip(cases, drawings, strict=True)):
        for panel, lines in zip(axes[row], one, strict=True):
            _draw(panel, lines)
        axes[row, 0].set_title(f"{data.place(case, force=True)}: dent {number(1e3 * data.at('dent', case))} mm")
        axes[row, 1].set_title(f"across the axis at {1e3 * _finger(data, case)[1][2]:.4g} mm")
        axes[row, 0].set(xlabel="along the axis [mm]", ylabel="along the approach [mm]")
        axes[row, 1].set(xlabel="across the approach [mm]")
    return Picture(pictures.as_svg(drawn), _alt(data, cases), _caption(data, cases, scene))


def _alt(data: Data, cases: list[tuple[int, ...]]) -> str:
    said = "; ".join(f"{data.place(i, force=True)}: {number(1e3 * data.at('dent', i))} mm" for i in cases)
    return f"Sections through the deformed wall and both pads. Depth of the dent at {said}."


def _caption(data: Data, cases: list[tuple[int, ...]], scene: Any) -> str:
    second = " Below: the deepest dent of all solved cases." if len(cases) > 1 else ""
    front = "with their pressed fronts" if data.result.layout.patches else "as blocks, for no patches are stored"
    pads = f" Grey: the pads, {front}." if scene is not None else ""
    return (
        "Sections through the outer face of the wall, along the object's axis through both fingers and across it at the"
        f" middle of the pads. Blue: deformed, dashed: undeformed; nothing is exaggerated.{pads} Dent: largest inward"
        f" displacement of the wall, less its motion as a whole.{second}"
    )


def _deepest(data: Data) -> tuple[int, ...] | None:
    dent = data.map("dent")
    return None if dent is None else tuple(int(i) for i in np.unravel_index(largest(dent), dent.shape))


def _stored(data: Data, places: np.ndarray | None, index: tuple[int, ...]) -> bool:
    """Whether the file has the deformed wall of a case."""
    return places is not None and data.status[index] == DONE and bool(np.isfinite(places[index]).all())


def _finger(data: Data, index: tuple[int, ...], finger: int = 0) -> tuple[np.ndarray, np.ndarray, float]:
    """Rotation, origin at first touch [m] and travel [m] of a pad."""
    return tuple(data.result.fingers(name)[index][finger] for name in ("pose_rotation", "pose_origin", "travel"))


def _drawing(data: Data, scene: Any, index: tuple[int, ...], after: np.ndarray) -> tuple[dict[str, Any], ...] | None:
    """Lines of both sections of a case."""
    rotation, origin, _ = _finger(data, index)
    approach = rotation[:, 2]
    if abs(approach[2]) > LEVEL:
        return None
    angle = float(np.arctan2(-approach[1], -approach[0]))
    before, sections = undeformed(scene, index, angle), []
    for upright in (True, False):
        cut = Cut(upright, angle, float(origin[2]))
        pads = [_pad(data, scene, index, finger, cut) for finger in (0, 1)] if scene else []
        lines = {"after": cut.outline(after), "pads": pads, "closed": not upright}
        sections.append(lines | ({} if before is None else {"before": cut.outline(before)}))
    return tuple(sections)


def _ring(place: np.ndarray, height: float) -> np.ndarray:
    """The wall at a height, all round ``(FINE + 1, 3)``."""
    from scipy.interpolate import CubicSpline

    knots, closed = np.arange(AROUND + 1) / AROUND, np.concatenate([place, place[:1]])
    fine = CubicSpline(knots, closed, bc_type="periodic")(np.linspace(0, 1, FINE + 1))
    z = fine[..., 2]
    j = (np.abs(z[:, :-1] + z[:, 1:] - 2 * height) - np.abs(np.diff(z))).argmin(axis=1)  # the segment that crosses
    low, high = (fine[np.arange(len(fine)), j + k] for k in (0, 1))
    rise = high[:, 2] - low[:, 2]
    share = np.clip((height - low[:, 2]) / np.where(np.abs(rise) > 1e-12, rise, 1.0), 0.0, 1.0)
    return low + share[:, None] * (high - low)


def _pad(data: Data, scene: Any, index: tuple[int, ...], finger: int, cut: Cut) -> np.ndarray:
    """Outline of a pad in the plane of a section ``(n, 2)`` [mm]: its moved back and its pressed front."""
    rotation, origin, travel = _finger(data, index, finger)
    size = np.array(scene.gripper.pad_size)
    main = np.array([0.0, 0.0, 1.0]) if cut.upright else np.array([-np.sin(cut.angle), np.cos(cut.angle), 0.0])
    line = rotation.T @ main  # direction of the section in the pad's frame
    axis = int(np.abs(line[:2]).argmax())
    front = _front(data, scene, index, finger, axis)
    back = np.zeros((2, 3))
    back[:, axis], back[:, 2] = np.array([0.5, -0.5]) * size[axis], travel - size[2]
    return cut.flat(np.concatenate([front, back]) @ rotation.T + origin)


def _front(data: Data, scene: Any, index: tuple[int, ...], finger: int, axis: int) -> np.ndarray:
    """Line of a pad's front along one of its axes, through the faces beside its middle ``(n, 3)`` [m]."""
    from softjaw.study.case.build import pad_shape

    ends = np.zeros((2, 3))
    ends[:, axis] = np.array([-0.5, 0.5]) * scene.gripper.pad_size[axis]
    count = pad_shape(scene.gripper).patch_faces
    if not data.result.layout.patches or count[0] * count[1] != data.result.layout.faces:
        return ends
    place = data.result.patch(data.result.row(*index))["centroid"][finger]
    if not np.isfinite(place).all():
        return ends
    rows = 1 if count[1 - axis] % 2 else 2
    line = place[np.argsort(np.abs(place[:, 1 - axis]), kind="stable")[: rows * count[axis]]]
    return line[np.argsort(line[:, axis])] * [axis == 0, axis == 1, 1]


def _draw(panel: Any, lines: dict[str, Any]) -> None:
    for pad in lines["pads"]:
        panel.fill(*pad.T, facecolor=PAD, edgecolor=pictures.SOFT, lw=0.7, zorder=1)
    if "before" in lines:
        panel.plot(*lines["before"].T, color=pictures.SOFT, lw=0.9, ls=(0, (4, 2)), zorder=2)
    panel.plot(*lines["after"].T, color=WALL, lw=1.5, zorder=3)
    panel.set_aspect("equal")


def _box(sections: list[dict[str, Any]]) -> np.ndarray:
    """Width and height of what sections show [mm]."""
    points = np.concatenate([p for one in sections for p in (one["after"], *one["pads"])])
    return np.ptp(points, axis=0)
