"""Grid lines of a thin-walled body's mesh: fine where pads touch, coarser with the distance from there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from softjaw.fem.objects.outer_surface import OuterSurface
from softjaw.fem.objects.pose import FloatArray

SAMPLES = 4000  # of the wanted element size along a line
TURN = np.radians(25.0)  # largest turn of the outline within one element


@dataclass(frozen=True)
class MeshSize:
    """How fine a mesh is.

    Parameters
    ----------
    angles : tuple of float
        Middles of the gripped regions about the axis [rad].
    heights : (float, float)
        Range of z that pads touch [m].
    half_width : float
        Half the width of a gripped region round the body [m].
    around, along : float
        Element sizes in the gripped regions [m].
    coarse : float
        Largest element size elsewhere [m].
    growth : float
        Increase of the size per distance from the gripped regions [-].
    """

    angles: tuple[float, ...] = (0.0, np.pi)
    heights: tuple[float, float] = (0.0, 0.0)
    half_width: float = 0.012
    around: float = 0.0015
    along: float = 0.0025
    coarse: float = 0.006
    growth: float = 0.25

    def __post_init__(self) -> None:
        """Refuse sizes that are no sizes."""
        for name in ("half_width", "around", "along", "coarse", "growth"):
            if not getattr(self, name) > 0:
                raise ValueError(f"{name} must be positive, found {getattr(self, name)}")
        if not self.heights[0] <= self.heights[1]:
            raise ValueError(f"heights must be (low, high), found {self.heights}")


def limited(x: FloatArray, h: FloatArray, growth: float) -> FloatArray:
    """Largest sizes below ``h (n,)`` at the even places ``x (n,)`` that grow by at most ``growth`` per length."""
    drift = growth * x
    rising = np.minimum.accumulate(h - drift) + drift
    return np.minimum(rising, np.minimum.accumulate((h + drift)[::-1])[::-1] - drift)


def divided(start: float, end: float, x: FloatArray, h: FloatArray, multiple: int = 1) -> FloatArray:
    """Ascending places from ``start`` to ``end`` whose distances follow the sizes ``h (n,)`` given at ``x (n,)``.

    The number of intervals is a multiple of ``multiple``.
    """
    fine = np.linspace(start, end, SAMPLES)
    density = 1.0 / np.interp(fine, x, h)
    count = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(fine))])
    n = multiple * max(1, int(np.ceil((count[-1] - 1e-6) / multiple)))
    places = np.interp(np.arange(n + 1) * count[-1] / n, count, fine)
    places[[0, -1]] = start, end
    return places


def along(
    surface: OuterSurface, size: MeshSize, open_bottom: bool, open_top: bool, hole: float, marks: Sequence[float] = ()
) -> FloatArray:
    """Grid lines along the outline, with one on the edge of each flat lid and at each of the places ``marks``."""
    begin = surface.wall[0] if open_bottom else hole
    end = surface.wall[1] if open_top else surface.end
    if hole > 0 and not (hole < surface.flat[0] and not open_bottom):
        raise ValueError(f"a hole of radius {hole:g} m needs a flat bottom that is larger")
    low, high = (surface.station(z) for z in size.heights)
    x = np.linspace(begin, end, SAMPLES)
    off = np.maximum(np.maximum(low - x, x - high), 0.0)
    bend = np.abs(surface.curve.curvature(x))
    h = np.minimum(np.minimum(size.along + size.growth * off, size.coarse), TURN / np.maximum(bend, 1e-9))
    h = limited(x, h, size.growth)
    edges = sorted({edge for edge in (*surface.flat, *marks) if begin + 1e-9 < edge < end - 1e-9})
    runs = [divided(a, b, x, h) for a, b in pairwise([begin, *edges, end])]
    return np.concatenate([*(run[:-1] for run in runs), runs[-1][-1:]])


def around(surface: OuterSurface, size: MeshSize, symmetry: tuple[bool, bool]) -> FloatArray:
    """Grid lines round the body; the sizes are true at the middle of the gripped heights."""
    begin, end = {
        (False, False): (size.angles[0], size.angles[0] + 2 * np.pi),
        (False, True): (0.0, np.pi),
        (True, False): (-0.5 * np.pi, 0.5 * np.pi),
        (True, True): (0.0, 0.5 * np.pi),
    }[tuple(bool(plane) for plane in symmetry)]
    s = surface.station(0.5 * sum(size.heights))
    fine = np.linspace(0, 4 * np.pi, 2881) - 2 * np.pi
    speed = np.linalg.norm(surface.jets(fine, s)[:, 1], axis=1)
    arc = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))])
    turn = np.interp(0.0, fine, arc) - np.interp(-2 * np.pi, fine, arc)
    middles = np.interp(np.mod(size.angles, 2 * np.pi), fine, arc)

    ends = np.interp([begin, end], fine, arc)
    x = np.linspace(*ends, SAMPLES)
    off = np.abs((x[:, None] - middles + 0.5 * turn) % turn - 0.5 * turn).min(axis=1)
    h = np.minimum(size.around + size.growth * np.maximum(off - size.half_width, 0.0), size.coarse)
    theta = np.interp(divided(*ends, x, h, 4 >> sum(symmetry)), arc, fine)
    theta[[0, -1]] = begin, end
    return theta
