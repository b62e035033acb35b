"""Write flask.stl beside this file: a waisted flask of rounded oblong section, 120 mm high, in millimetres.

Run from the repository's root: ``python -m jobs.objects.make_flask`` or ``python jobs/objects/make_flask.py``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import trimesh

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1]))

from softjaw.fem.objects.gap import grid_triangles  # noqa: E402  (only found once the path is known)
from softjaw.fem.objects.shapes import Revolution  # noqa: E402  (only found once the path is known)

PROFILE_MM = [
    (0, 0), (0, 8), (0, 16), (0, 24), (4, 29.5), (15, 31), (30, 30), (45, 27), (58, 25.5), (70, 26.5), (80, 27),
    (88, 24), (94, 18), (99, 13.5), (105, 12), (110, 12), (115, 12), (119, 11), (120, 8), (120, 4), (120, 0),
]  # fmt: skip
WIDTH, DEPTH = 1.15, 0.80  # the section's semi-axes in units of the profile's radius
EXPONENT = 2.5  # of the superellipse |x / a|^n + |y / b|^n = 1; 2 is an ellipse, more is squarer
ROWS, COLUMNS = 34, 56


def flask() -> tuple[np.ndarray, np.ndarray]:
    """Points ``(k, 3)`` [mm] and triangles ``(m, 3)``, counterclockwise from outside."""
    curve = Revolution(np.array(PROFILE_MM) * 1e-3, beyond=True).curve
    s = _even_in_length_and_turn(curve, ROWS)
    z, r = 1e3 * curve.derivative(s).T
    t = np.linspace(0, 2 * np.pi, COLUMNS, endpoint=False)
    c, d = (np.sign(f) * np.abs(f) ** (2 / EXPONENT) for f in (np.cos(t), np.sin(t)))
    x = np.stack(np.broadcast_arrays(WIDTH * r[1:-1, None] * c, DEPTH * r[1:-1, None] * d, z[1:-1, None]), axis=-1)
    points = np.concatenate([x.reshape(-1, 3), [[0, 0, z[0]], [0, 0, z[-1]]]])
    i, last = np.arange(COLUMNS), (ROWS - 3) * COLUMNS
    j = (i + 1) % COLUMNS
    bottom = np.stack([j, i, 0 * i + len(points) - 2], axis=1)
    top = np.stack([last + i, last + j, 0 * i + len(points) - 1], axis=1)
    return points, np.concatenate([bottom, grid_triangles(ROWS - 2, COLUMNS, closed=True), top])


def _even_in_length_and_turn(curve, rows: int) -> np.ndarray:
    """Parameters of ``rows`` points whose steps shrink where the curve bends."""
    s = np.linspace(0, curve.breaks[-1], 4001)
    density = 1 + 0.010 * np.abs(curve.curvature(s))
    total = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]))])
    return np.interp(np.linspace(0, total[-1], rows), total, s)


if __name__ == "__main__":
    trimesh.Trimesh(*flask(), process=False).export(HERE / "flask.stl")
