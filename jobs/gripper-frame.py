"""How the frames of pads and gripper lie at an upright object, as a picture: docs/gripper-frame.png.

    python jobs/gripper-frame.py -o docs/gripper-frame.png

Pads and gripper stand where `study.case.candidates` and `study.export.selection` put them, at angle 0 and roll 0.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study import pictures
from softjaw.study.case.poses import axis_poses
from softjaw.study.export.selection import gripper_frame

RADIUS, HEIGHT, LONG, SHORT, DEPTH = 20.0, 74.0, 30.0, 24.0, 75.0  # [mm]
LOOKS = {"x": "#c05a00", "y": "#2a8c82", "z": "#12436d"}
VIEW = np.array([[0.94, -0.34, 0.0], [0.13, 0.36, 0.92]])  # from space to the paper
PANELS = (
    ("pads (pulled apart) and object", "", ""),
    ("isaac_grasp, moveit: closing y\napproach minus-x", "y", "minus-x"),
    ("graspgen: closing x\napproach minus-x", "x", "minus-x"),
    ("closing y\napproach y", "y", "y"),
)


def line(axes: Any, points: Any, **look: Any) -> None:
    """A line through points ``(n, 3)``."""
    axes.plot(*(VIEW @ np.asarray(points).T), **{"color": pictures.SOFT, "lw": 1.0, **look})


def frame(axes: Any, origin: Any, rotation: Any, name: str, beside: tuple[float, float] = (0, 0)) -> None:
    """Three arrows with letters at their ends, and a name beside their origin."""
    for axis, letter in zip(np.asarray(rotation).T, "xyz", strict=True):
        tail, tip = VIEW @ origin, VIEW @ (origin + 20 * axis)
        look = {"arrowstyle": "-|>", "color": LOOKS[letter], "lw": 1.8, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", tip, tail, arrowprops=look)
        axes.text(*(VIEW @ (origin + 24 * axis)), letter, color=LOOKS[letter], ha="center", va="center")
    x, y = VIEW @ origin
    axes.text(x + beside[0], y + beside[1], name, fontsize=7.5)


def cylinder(axes: Any) -> None:
    """The object: a cylinder that stands on its file's z axis."""
    t = np.linspace(0, 2 * np.pi, 80)
    ends = [np.column_stack([RADIUS * np.cos(t), RADIUS * np.sin(t), 0 * t + z]) for z in (-HEIGHT / 2, HEIGHT / 2)]
    widest = np.abs(VIEW[0] @ ends[0].T).argmax()
    for points in (*ends, [end[widest] for end in ends], [end[(widest + 40) % 79] for end in ends]):
        line(axes, points)


def hand(axes: Any, pads: Any, R: Any, o: Any) -> None:
    """Palm and fingers behind the pads, the way to their middle, and the gripper's frame."""
    palm = o + 0.2 * DEPTH * R[:, 2]
    for rotation, pad in pads:
        back = pad - 6 * rotation[:, 2]
        line(axes, [back, back - 0.8 * DEPTH * R[:, 2], palm], lw=2.6)
    line(axes, [o + 29 * R[:, 2], o + DEPTH * R[:, 2]], ls=":", color=pictures.INK)
    x, y = VIEW @ (o + 0.73 * DEPTH * R[:, 2])
    axes.text(x - 4, y, "depth", fontsize=7.5, ha="right", va="center")
    frame(axes, o, R, "gripper", (5, 5) if R[2, 2] < -0.5 else (5, -8))


def draw() -> bytes:
    """The picture as PNG."""
    pads = [(pose.rotation, -RADIUS * pose.rotation[:, 2]) for pose in axis_poses(0.0, 0.0, 0.0)]
    case = {"fingers": [{"pose_rotation": R, "pose_origin": o} for R, o in pads]}
    with pictures.style():
        drawn, grid = pictures.figure(11.0, 4.3, 1, len(PANELS))
        for axes, (title, closing, approach) in zip(grid[0], PANELS, strict=True):
            cylinder(axes)
            for k, (R, o) in enumerate(pads, start=1):
                o = o if closing else o - 37 * R[:, 2]
                corners = [o + R @ [x * LONG / 2, y * SHORT / 2, 0] for x, y in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
                axes.fill(*(VIEW @ np.array(corners).T), color="#b9c6d3", alpha=0.75, lw=0.8, ec=pictures.INK)
                if not closing:
                    axes.text(*(VIEW @ (o - 23 * R[:, 0])), f"finger {k}", fontsize=7.5, ha="center", va="top")
                    frame(axes, o, R, "")
            if closing:
                hand(axes, pads, *gripper_frame(case, approach, closing, DEPTH))
            else:
                frame(axes, np.zeros(3), np.eye(3), "object", (-14, -9))
            axes.set_title(title, fontsize=9)
            axes.set(xlim=(-66, 66), ylim=(-54, 92), aspect="equal")
            axes.set_axis_off()
        return pictures.as_png(drawn)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="How the frames of pads and gripper lie, as a picture.")
    parser.add_argument("-o", dest="out", type=Path, required=True, help="PNG to write")
    parser.parse_args().out.write_bytes(draw())
