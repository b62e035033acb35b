"""Centre line of a triangle surface: the middles of its sections across the axis z, joined smoothly.

A section is cut into its loops; the largest is the object there, so a handle beside a mug or a cavity inside it does
not pull the line off. A centroid of a loop is exact for its polygon. The line is a smoothing spline through the
centroids; its tangent is the local axis that pads are turned about.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.gap import IntArray
from softjaw.fem.objects.traced_outline import largest_loops, smooth_spline
from softjaw.friction.patch import FloatArray

HEIGHTS = 161  # at which sections are cut
FEWEST = 8  # of them that enclose an area


@dataclass(frozen=True, eq=False)
class CentreLine:
    """Middle of an object over the height.

    ``middle (k, 2)``: smoothed centroids of the largest loops at heights ``z (k,)`` [m]; ``loops (k,)``: closed loops
    that enclose material; more than one: the object has arms there.
    """

    z: FloatArray
    middle: FloatArray
    loops: IntArray

    @cached_property
    def _curve(self) -> CubicSpline:
        return CubicSpline(self.z, self.middle)

    def remark(self, z: float, half: float) -> str:
        """What is doubtful where a pad reaches ``half`` [m] to both sides of a height, if anything."""
        if not self.z[0] <= z <= self.z[-1]:
            return "the centre line of the object's sections ends before the station and is extended straight"
        if self.radius(z - half, z + half) < half:
            return "the centre line of the object's sections bends in a radius below half the pad's length"
        if self.loops[np.abs(self.z - z).argmin()] > 1:
            return "the object's section has several parts, the pads stand about the largest"
        return ""

    def radius(self, low: float, high: float) -> float:
        """Smallest radius [m] in which the line bends between two heights."""
        z = self.z[(self.z >= low) & (self.z <= high)]
        if not len(z):
            return np.inf
        velocity, acceleration = (np.column_stack([self._curve(z, k), np.full(len(z), 2.0 - k)]) for k in (1, 2))
        curvature = np.linalg.norm(np.cross(velocity, acceleration), axis=1) / np.linalg.norm(velocity, axis=1) ** 3
        return float(1.0 / curvature.max()) if curvature.any() else np.inf

    def straightened(self, x: FloatArray, sense: float = 1.0) -> FloatArray:
        """Points ``(..., 3)`` shifted across z so that the line becomes the axis; ``sense`` -1 shifts them back."""
        moved = x.copy()
        moved[..., :2] -= sense * self._curve(np.clip(x[..., 2], self.z[0], self.z[-1]))
        return moved

    def at(self, z: float) -> tuple[FloatArray, FloatArray]:
        """Place ``(3,)`` [m] and unit tangent ``(3,)`` at a height; beyond the ends the line continues straight."""
        inside = float(np.clip(z, self.z[0], self.z[-1]))
        slope = self._curve(inside, 1)
        tangent = np.array([*slope, 1.0])
        return np.array([*(self._curve(inside) + (z - inside) * slope), z]), tangent / np.linalg.norm(tangent)


def centre_line(points: FloatArray, triangles: IntArray, wavelength: float) -> CentreLine:
    """Centre line of a surface whose axis is z.

    ``points, triangles (n, 3), (m, 3)``: the surface [m]; outward, small holes do no harm; ``wavelength``: waves of the
    line that are shorter are smoothed out [m]; half a pad is a good choice.

    Raises `MeshError`: where hardly any section encloses an area.
    """
    low, high = points[:, 2].min(), points[:, 2].max()
    # share of the height: nearer to the ends a section is the object's rounding, its middle is continued
    margin = 0.02 * (high - low)
    z = np.linspace(low + margin, high - margin, HEIGHTS)
    middle, loops = largest_loops(points, triangles, z)
    known = np.isfinite(middle[:, 0])
    if np.count_nonzero(known) < FEWEST:
        raise MeshError(
            f"{np.count_nonzero(known)} of {HEIGHTS} sections are closed, expected at least {FEWEST}:"
            " choose another axis, or give poses"
        )
    smooth = smooth_spline(z[known], middle[known], wavelength, (z[known][0], z[known][-1]))
    inside = (z >= z[known][0]) & (z <= z[known][-1])
    z, middle = z[inside], smooth(z[inside])
    # share of the line's height: one that stays so near to the axis z is the axis, but for noise of a scan
    return CentreLine(z, middle * (np.abs(middle).max() > 3e-3 * (z[-1] - z[0])), loops[inside])
