"""Outline of a triangle mesh: where its upright wall begins and ends, its centre line, and the lids that close it.

Horizontal rays from a centre line find where it leaves the mesh. Noisy samples are smoothed by a low pass of sixth
order, along a line by a C2 spline and round a ring by its waves: a wave of length ``l`` keeps the share
``1 / (1 + (wavelength / l)^6)`` of its height, one of twice the wavelength 98 %, half of it 2 %.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline
from scipy.sparse import csc_array, diags_array
from scipy.sparse.linalg import splu

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.gap import IntArray
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.fem.objects.profile import Curve
from softjaw.fem.objects.revolution import Revolution
from softjaw.fem.objects.triangle_tree import components
from softjaw.friction.patch import FloatArray

LEVELS = 400  # heights of the first look at a mesh
FEW = 64  # rays per height of that look
STEEP = 1.0  # slope dr/dz from which a surface counts as bottom or top, not as wall
STEEPEST = 4.0  # slope up to which the outline is followed by its length


def sections(points: FloatArray, triangles: IntArray, z: FloatArray) -> tuple[FloatArray, IntArray]:
    """Segments ``(m, 2, 2)`` of the cuts at heights ``z (k,)``, counterclockwise about the material [m].

    Returned with the number ``(m,)`` of each one's cut. Points at a height itself count as above it, so the segments
    close up whatever a cut passes through.
    """
    order = np.argsort(z)
    first, last = (
        np.searchsorted(z[order], end, side="right")
        for end in (points[triangles, 2].min(axis=1), points[triangles, 2].max(axis=1))
    )
    which, place = _spread(first, last - first)
    cut, corner = order[place], triangles[which]
    above = points[corner, 2] >= z[cut][:, None]
    # the corner that is alone on its side, and the two others in the triangle's order
    alone = np.where(above.sum(axis=1) == 1, above.argmax(axis=1), above.argmin(axis=1))
    row = np.arange(len(cut))
    a, b, c = (corner[row, (alone + k) % 3] for k in range(3))
    ends = np.stack([_crossing(points, a, b, z[cut]), _crossing(points, a, c, z[cut])], axis=1)
    return np.where(above[row, alone][:, None, None], ends, ends[:, ::-1]), cut


def _spread(first: IntArray, many: IntArray) -> tuple[IntArray, IntArray]:
    """Pairs (i, first[i] + j) for j below ``many[i]``."""
    which = np.repeat(np.arange(len(many)), many)
    return which, first[which] + np.arange(len(which)) - np.repeat(np.cumsum(many) - many, many)


def _crossing(points: FloatArray, i: IntArray, j: IntArray, z: FloatArray) -> FloatArray:
    """Places ``(m, 2)`` at which edges pass the heights; equal for both triangles of an edge to the last bit."""
    i, j = np.minimum(i, j), np.maximum(i, j)
    p, q = points[i], points[j]
    t = (z - p[:, 2]) / (q[:, 2] - p[:, 2])
    return p[:, :2] + t[:, None] * (q - p)[:, :2]


def largest_loops(points: FloatArray, triangles: IntArray, z: FloatArray) -> tuple[FloatArray, IntArray]:
    """Centroids ``(k, 2)`` of the largest loop at every height (NaN: none), and how many loops enclose material."""
    segments, cut = sections(points, triangles, z)
    middle, count = np.full((len(z), 2), np.nan), np.zeros(len(z), dtype=np.int64)
    for k in range(len(z)):
        areas, centroids = _loops(segments[cut == k])
        if len(areas) and areas.max() > 0.0:
            # share of the largest loop's area: what is smaller is noise of a mesh, not an arm
            middle[k], count[k] = centroids[areas.argmax()], np.count_nonzero(areas > 5e-3 * areas.max())
    return middle, count


def _loops(segments: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Areas ``(l,)``, positive round material, and centroids ``(l, 2)`` of the loops of segments ``(m, 2, 2)``."""
    # segments of neighbouring triangles share their end points to the last bit, so loops are found without a tolerance
    ends, number = np.unique(segments.reshape(-1, 2), axis=0, return_inverse=True)
    of_end = components(number.reshape(-1, 2), len(ends))
    loops, loop = of_end.max(initial=-1) + 1, of_end[number.reshape(-1, 2)[:, 0]]
    p, q = segments[:, 0], segments[:, 1]
    base = np.stack([np.bincount(of_end, ends[:, i], loops) / np.bincount(of_end, minlength=loops) for i in (0, 1)], 1)
    p, q = p - base[loop], q - base[loop]  # about its own middle: far from the axis areas would cancel
    cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
    area = 0.5 * np.bincount(loop, cross, loops)
    moment = np.stack([np.bincount(loop, cross * (p + q)[:, i], loops) for i in (0, 1)], axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return area, base + moment / (6.0 * area[:, None])


def cast(
    points: FloatArray, triangles: IntArray, z: FloatArray, centre: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Distance ``(k, n)`` from centres ``(k, 2)`` at heights ``z (k,)`` to the last and to the first crossing [m].

    Along ``count`` rays at even angles, the first along x; NaN where a ray meets nothing. Both are the same all round
    if the section is star-shaped about its centre.
    """
    segments, cut = sections(points, triangles, z)
    which, ray, distance = _hits(segments - centre[cut][:, None], count)
    place, size = cut[which] * count + ray, len(z) * count
    hits = np.bincount(place, minlength=size)
    order = np.lexsort([distance, place])
    place, distance = place[order], distance[order]
    # at a height where every ray starts in a cavity, the first crossing of each is the inner wall
    hollow = ((hits.reshape(-1, count) % 2 == 0) & (hits.reshape(-1, count) > 0)).all(axis=1)
    outside = ~hollow[place // count] | np.insert(place[1:] == place[:-1], 0, False)
    place, distance = place[outside], distance[outside]
    outer, inner = np.full(size, -np.inf), np.full(size, np.inf)
    np.maximum.at(outer, place, distance)
    np.minimum.at(inner, place, distance)
    outer[hits == 0] = inner[hits == 0] = np.nan
    return outer.reshape(-1, count), inner.reshape(-1, count)


def _hits(segments: FloatArray, count: int) -> tuple[IntArray, IntArray, FloatArray]:
    """Segments of ``(m, 2, 2)`` and numbers of the rays that cross them, with the distance from the origin [m]."""
    angle = np.arctan2(segments[..., 1], segments[..., 0]) * (count / (2 * np.pi))
    # half-open intervals of ray numbers: where two segments meet, a ray crosses only one of them
    first = np.ceil(angle).astype(np.int64)
    # a segment across the jump of the angle goes the short way round
    first[:, 1] -= np.round((angle[:, 1] - angle[:, 0]) / count).astype(np.int64) * count
    which, ray = _spread(first.min(axis=1), np.abs(first[:, 1] - first[:, 0]))
    c, s = np.cos(2 * np.pi / count * ray), np.sin(2 * np.pi / count * ray)
    p, d = segments[which, 0], (segments[:, 1] - segments[:, 0])[which]
    across = c * d[:, 1] - s * d[:, 0]
    distance = (p[:, 0] * d[:, 1] - p[:, 1] * d[:, 0]) / np.where(across == 0, np.inf, across)
    return which, ray % count, np.abs(distance)


def smooth_spline(x: FloatArray, y: FloatArray, wavelength: float, ends: tuple[float, float]) -> BSpline:
    """C2 cubic spline on ``ends`` near the samples ``y (n, ...)`` at ``x (n,)``, given at roughly even steps.

    It minimises ``sum (y - f)^2 + (wavelength / 2 pi)^6 integral f'''^2 dx / step``: parabolas stay, gaps are bridged.
    """
    pieces = max(4, int(np.ceil((ends[1] - ends[0]) * 4 / wavelength)))  # four knots per wavelength
    width = (ends[1] - ends[0]) / pieces
    knots = ends[0] + width * np.arange(-3, pieces + 4)
    # exactly, because rounding of the sum would leave the last samples outside
    knots[[3, -4]] = ends
    B = csc_array(BSpline.design_matrix(np.clip(x, *ends), knots, 3))
    n = B.shape[1]
    D = diags_array([-1.0, 3.0, -3.0, 1.0], offsets=[0, 1, 2, 3], shape=(n - 3, n))
    step = float(np.median(np.diff(x)))
    weight = width / step * (wavelength / (2 * np.pi * width)) ** 6
    right = B.T @ np.reshape(y, (len(x), -1))
    c = splu(csc_array(B.T @ B + weight * (D.T @ D))).solve(np.ascontiguousarray(right))
    return BSpline(knots, c.reshape(n, *np.shape(y)[1:]), 3, extrapolate=True)


def smooth_rings(values: FloatArray, waves: FloatArray, count: int) -> FloatArray:
    """Rings ``(k, count)`` without the waves of ``values (k, n)`` that fit in more than ``waves (k,)`` times."""
    order = np.arange(count // 2)  # what the new ring cannot show is left out, so it does not come back as long waves
    share = 1.0 / (1.0 + (order / waves[:, None]) ** 6)
    spectrum = np.fft.rfft(values, axis=1)[:, : count // 2] * share
    return np.fft.irfft(spectrum, n=count, axis=1) * (count / values.shape[1])


class Wall(NamedTuple):
    """Upright part of a mesh: first and last height, those of the lids, centres and mean radius [m].

    ``centre`` gives ``(k, 2)`` by height and order of the derivative.
    """

    ends: tuple[float, float]
    lids: tuple[float, float]
    centre: Callable
    radius: float


def find_wall(mesh: MeshObject, facet: float, tolerance: float) -> Wall:
    """Wall of a mesh, between the part that counts as its bottom and the part that counts as its top.

    Folds below the size ``facet`` of the triangles do not matter, centres within ``tolerance`` of the axis are on it.
    """
    low, high = (float(v) for v in mesh.bounds[:, 2])
    z = low + (np.arange(LEVELS) + 0.5) * (high - low) / LEVELS
    centre = np.nan_to_num(largest_loops(mesh.points, mesh.triangles, z)[0])
    outer, inner = cast(mesh.points, mesh.triangles, z, centre, FEW)
    r = np.nan_to_num(outer).mean(axis=1)
    # share of the height may be folded at either end, as a hollow bottom is, and count as bottom or top
    at_end = np.abs(z - 0.5 * (low + high)) > 0.4 * (high - low)
    bad, slope = folded(outer, inner, facet).any(axis=1) & at_end, np.gradient(r, z)
    first, last = _run(bad | (slope > STEEP)), len(z) - 1 - _run((bad | (slope < -STEEP))[::-1])
    rim = Revolution.rim  # left to the rounding of the edge
    ends = max(z[min(first, len(z) - 1)], low + rim), min(z[max(last, 0)], high - rim)
    # share of the height has to be wall
    if ends[1] - ends[0] < 0.3 * (high - low):
        raise MeshError(
            f"the mesh has no upright wall: of z = {low:.4g} m to {high:.4g} m only {ends[0]:.4g} m to "
            f"{max(ends):.4g} m is neither bottom nor top; check the mesh's axis, or treat the object as rigid"
        )
    inside = (z >= ends[0]) & (z <= ends[1])
    radius = float(r[inside].mean())
    return Wall(ends, (low, high), _centre_line(z[inside], centre[inside], ends, 2 * radius, tolerance), radius)


def folded(outer: FloatArray, inner: FloatArray, facet: float) -> NDArray[np.bool_]:
    """Rays ``(k, n)`` that miss the surface or cross it at places further apart than a facet; as `cast` gives them."""
    return ~(outer - inner <= facet)


def _run(flags: NDArray[np.bool_]) -> int:
    """Length of the run of True at the beginning."""
    return int(len(flags) if flags.all() else np.argmin(flags))


def _centre_line(
    z: FloatArray, centre: FloatArray, ends: tuple[float, float], wavelength: float, tolerance: float
) -> Callable:
    """Smooth line through centres ``(k, 2)``, upright beyond the ends and exactly on the axis where nearly so."""
    # a centre off the axis by noise alone would cost the planes of symmetry
    centre = np.where(np.abs(centre).max(axis=0) <= tolerance, 0.0, centre)
    reach = ends[0] - wavelength, ends[1] + wavelength
    f = continued(z, centre, wavelength, reach)

    def value(height: FloatArray, order: int = 0) -> FloatArray:
        inside = (height >= reach[0]) & (height <= reach[1])
        return np.where((inside | (order == 0))[:, None], f(np.clip(height, *reach), nu=order), 0.0)

    return value


def continued(x: FloatArray, y: FloatArray, wavelength: float, ends: tuple[float, float]) -> BSpline:
    """Smooth spline near samples that goes over to the first and the last one beyond them."""
    step = float(np.median(np.diff(x)))
    # half a wavelength without samples lets the spline bend over to the level part
    before = np.arange(ends[0], x[0] - 0.5 * wavelength, step)
    after = np.arange(ends[1], x[-1] + 0.5 * wavelength, -step)[::-1]
    values = np.concatenate([np.repeat(y[:1], len(before), axis=0), y, np.repeat(y[-1:], len(after), axis=0)])
    return smooth_spline(np.concatenate([before, x, after]), values, wavelength, ends)


def by_length(z: FloatArray, r: FloatArray) -> FloatArray:
    """Places ``s (k,)`` of heights along an outline; a ledge steeper than ``STEEPEST`` gets less than its length."""
    slope = np.clip(np.diff(r) / np.diff(z), -STEEPEST, STEEPEST)
    return np.concatenate([[0.0], np.cumsum(np.diff(z) * np.hypot(1.0, slope))])


def curve_of(z: BSpline, r: BSpline) -> Curve:
    """Outline of two splines on the same knots."""
    breaks = z.t[3:-3]
    powers = [np.stack([f(breaks[:-1], nu=k) / g for k, g in enumerate((1, 1, 2, 6))], axis=1) for f in (z, r)]
    return Curve(breaks - breaks[0], np.stack(powers, axis=1))
