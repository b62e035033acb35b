"""Shell mesh of a thin-walled body: a grid of angles and of places along the outline, on the axis triangles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from softjaw.fem.assembly import IntArray
from softjaw.fem.objects.outer_surface import OuterSurface
from softjaw.fem.shell.element import ShellMesh, folded, grid_elements
from softjaw.friction.patch import NEGLIGIBLE, FloatArray

Thickness = float | Sequence[tuple[float, float]]  # of a wall [m], or pairs (z, thickness)
LINE_SAMPLES = 4000  # of the wanted element size along a line
GROWTH = 0.25  # of the element size, per distance from the gripped regions
TURN = np.radians(25.0)  # largest turn of the outline within one element
SECTION_SAMPLES = 721  # angles at which the curvature of sections is judged
MOST_BENT = 0.8  # thickness over the radius of curvature at the edge of a lid


class MeshSize(NamedTuple):
    """How fine a wall's mesh is; the gripped regions lie at the angles 0 and pi about the axis.

    ``around, along``: element sizes in the gripped regions [m]; ``coarse``: largest element size elsewhere [m];
    ``heights``: range of z that pads touch [m]; ``half_width``: half the width of a gripped region round the body [m].
    """

    around: float = 0.0015
    along: float = 0.0025
    coarse: float = 0.006
    heights: tuple[float, float] = (0.0, 0.0)
    half_width: float = 0.012

    def halved(self) -> MeshSize:
        """Half as many elements in every direction."""
        return self._replace(around=2 * self.around, along=2 * self.along, coarse=2 * self.coarse)


def limited(x: FloatArray, h: FloatArray, growth: float) -> FloatArray:
    """Largest sizes below ``h (n,)`` at the even places ``x (n,)`` that grow by at most ``growth`` per length."""
    # two sweeps of a running minimum, left to right and back, are exact for sizes on a line
    drift = growth * x
    rising = np.minimum.accumulate(h - drift) + drift
    return np.minimum(rising, np.minimum.accumulate((h + drift)[::-1])[::-1] - drift)


def divided(start: float, end: float, x: FloatArray, h: FloatArray, multiple: int = 1) -> FloatArray:
    """Ascending places from ``start`` to ``end`` whose distances follow the sizes ``h (n,)`` given at ``x (n,)``.

    The number of intervals is a multiple of ``multiple``.
    """
    fine = np.linspace(start, end, LINE_SAMPLES)
    density = 1.0 / np.interp(fine, x, h)
    count = np.concatenate([[0.0], np.cumsum(0.5 * (density[1:] + density[:-1]) * np.diff(fine))])
    # rounding just above a whole number of intervals must not add one
    n = multiple * max(1, int(np.ceil((count[-1] - 1e-6) / multiple)))
    places = np.interp(np.arange(n + 1) * count[-1] / n, count, fine)
    # exactly, so that neighbouring runs share their line
    places[[0, -1]] = start, end
    return places


def along(
    surface: OuterSurface, size: MeshSize, open_bottom: bool, open_top: bool, marks: Sequence[float] = ()
) -> FloatArray:
    """Grid lines along the outline, with one on the edge of each flat lid and at each of the places ``marks``."""
    begin = surface.wall[0] if open_bottom else 0.0
    end = surface.wall[1] if open_top else surface.end
    low, high = (surface.station(z) for z in size.heights)
    x = np.linspace(begin, end, LINE_SAMPLES)
    off = np.maximum(np.maximum(low - x, x - high), 0.0)
    bend = np.abs(surface.curve.curvature(x))
    # fine where pads touch, and wherever the outline bends: facets must follow a rounded edge
    h = np.minimum(np.minimum(size.along + GROWTH * off, size.coarse), TURN / np.maximum(bend, 1e-9))
    h = limited(x, h, GROWTH)
    edges = sorted({edge for edge in (*surface.flat, *marks) if begin + NEGLIGIBLE < edge < end - NEGLIGIBLE})
    runs = [divided(a, b, x, h) for a, b in pairwise([begin, *edges, end])]
    return np.concatenate([*(run[:-1] for run in runs), runs[-1][-1:]])


def around(surface: OuterSurface, size: MeshSize, symmetry: tuple[bool, bool]) -> FloatArray:
    """Grid lines round the body; the sizes are true at the middle of the gripped heights."""
    begin = -0.5 * np.pi if symmetry[0] and not symmetry[1] else 0.0
    end = begin + 2.0 * np.pi * 0.5 ** sum(symmetry)
    s = surface.station(0.5 * sum(size.heights))
    fine = np.linspace(0, 4 * np.pi, 2881) - 2 * np.pi
    speed = np.linalg.norm(surface.jets(fine, s)[:, 1], axis=1)
    arc = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(fine))])
    turn = np.interp(0.0, fine, arc) - np.interp(-2 * np.pi, fine, arc)
    middles = np.interp([0.0, np.pi], fine, arc)

    first, last = (float(place) for place in np.interp([begin, end], fine, arc))
    x = np.linspace(first, last, LINE_SAMPLES)
    # the short way round the body
    off = np.abs((x[:, None] - middles + 0.5 * turn) % turn - 0.5 * turn).min(axis=1)
    h = np.minimum(size.around + GROWTH * np.maximum(off - size.half_width, 0.0), size.coarse)
    theta = np.interp(divided(first, last, x, h, 4 >> sum(symmetry)), arc, fine)
    # exactly, because nodes on planes of symmetry are identified by their angle
    theta[[0, -1]] = begin, end
    return theta


@dataclass(frozen=True)
class BodyMesh(ShellMesh):
    """Mesh of a body with its parameters.

    Element ``i * n + j`` lies between ``theta`` lines i, i + 1 of m + 1 and ``s`` lines j, j + 1 of n + 1; its corners
    are ``number[[i, i + 1, i + 1, i], [j, j, j + 1, j + 1]]``. The last row of ``number`` of a whole body is the first
    again, nodes on the axis are one node. ``symmetry``: whether x = 0 and y = 0 are planes of symmetry and only one
    side is meshed; ``symmetric (6 k,)``: numbers that these planes fix.
    """

    surface: OuterSurface
    theta: FloatArray
    s: FloatArray
    number: IntArray
    symmetry: tuple[bool, bool]
    symmetric: FloatArray

    @property
    def closed(self) -> bool:
        """Whether theta runs once round."""
        return not any(self.symmetry)

    @property
    def share(self) -> float:
        """Part of the body that is meshed: 1, 1/2 or 1/4."""
        return 0.5 ** sum(self.symmetry)

    @property
    def foot(self) -> IntArray:
        """Nodes by which a body touches a table: the rim of its flat bottom."""
        return np.unique(self.number[:, np.abs(self.s - self.surface.flat[0]).argmin()])


def body_mesh(
    surface: OuterSurface,
    thickness: Thickness,
    size: MeshSize,
    symmetry: tuple[bool, bool] = (False, False),
    *,
    open_top: bool = True,
    open_bottom: bool = False,
    base_thickness: float | None = None,
) -> BodyMesh:
    """Mesh of the wall inside a surface; its outer face lies on the surface.

    ``thickness`` [m] may be pairs (z, thickness) between which it is interpolated; ``symmetry``: planes x = 0 and y =
    0, of which the half y >= 0 or x >= 0, or the quarter, is meshed; ``open_top, open_bottom``: whether the mesh ends
    at the last or begins at the first given section instead of on the axis; ``base_thickness`` of the flat bottom [m],
    the rim above it changes over to the wall's.

    Raises `ValueError`: for a wall that is too thick for its curvature, or a base where nothing is flat.
    """
    s = along(surface, size, open_bottom, open_top, _steps(surface, thickness))
    theta = around(surface, size, symmetry)
    number, first = _numbers(surface, theta, s, closed=not any(symmetry))
    t, p = theta[first[0]], s[first[1]]
    D = 0.5 * _wall(surface, thickness, base_thickness, p)[:, None] * surface.normals(t, p)
    X = surface.jets(t, p)[:, 0] - D
    elements, planes = grid_elements(number), _planes(symmetry, theta, number, len(X))
    if (fold := folded(X, D, elements)).any():
        raise ValueError(
            f"the wall folds near z = {1e3 * X[elements[fold.argmax(), 0], 2]:.4g} mm, where an edge is too sharp for "
            'its thickness; make it thinner, give the edge its own points, or open_ends = "both"'
        )
    return BodyMesh(X, D, elements, surface, theta, s, number, symmetry, planes)


def _steps(surface: OuterSurface, thickness: Thickness) -> list[float]:
    """Places on the wall where a given thickness changes its slope: the mesh needs a line there."""
    if isinstance(thickness, float):
        return []
    low, high = surface.heights
    return [surface.station(z) for z, _ in thickness if low + NEGLIGIBLE < z < high - NEGLIGIBLE]


def _numbers(surface: OuterSurface, theta: FloatArray, s: FloatArray, *, closed: bool) -> tuple[IntArray, IntArray]:
    """Node on each crossing, and the (theta, s) line numbers ``(2, k)`` of every node's first crossing."""
    m, n = len(theta), len(s)
    key = np.arange(m * n).reshape(m, n)
    if closed:
        # the last line of a whole body is its first one
        key[-1] = key[0]
    for end, j in ((0.0, 0), (surface.end, n - 1)):
        if s[j] == end:
            # all angles meet in one node on the axis, and its elements become triangles
            key[:, j] = key[0, j]
    first, number = np.unique(key, return_inverse=True)
    return number.reshape(m, n).astype(np.int32), np.stack([first // n, first % n])


def _wall(surface: OuterSurface, thickness: Thickness, base: float | None, s: FloatArray) -> FloatArray:
    """Thickness ``(n,)`` at the places s."""
    table = np.array([(0.0, thickness)] if isinstance(thickness, float) else thickness)
    z = surface.curve.derivative(s)[:, 0]
    t = np.interp(z, table[:, 0], table[:, 1])
    if base is not None:
        if surface.flat[0] == 0.0:
            raise ValueError("base_thickness needs a body with a flat bottom; give pairs (z, thickness) instead")
        # over the rounded rim: a step of the thickness would be a step of the inner face
        part = np.clip((surface.wall[0] - s) / max(surface.wall[0] - surface.flat[0], 1e-12), 0.0, 1.0)
        t = part * base + (1.0 - part) * t
    bend = surface.curve.curvature(s)
    # the edges of lids are rounded by the program: a thick wall is thinner there, where nobody grasps it
    lids = (s < surface.wall[0]) | (s > surface.wall[1])
    t = np.where(lids & (bend * t > MOST_BENT), MOST_BENT / np.maximum(bend, NEGLIGIBLE), t)
    _refuse_bent(bend, t, z, "the outline's")
    return t


def _refuse_bent(bend: FloatArray, t: FloatArray, z: FloatArray, whose: str) -> None:
    """Refuse a wall of thickness ``t`` at heights ``z`` that reaches its centre of curvature: it has no inner face."""
    k = int(np.argmax(bend * t))
    if bend[k] * t[k] > 1.0 - 1e-6:
        raise ValueError(
            f"the wall is {1e3 * t[k]:.4g} mm thick at z = {1e3 * z[k]:.4g} mm, where {whose} radius of curvature "
            f"is only {1e3 / bend[k]:.4g} mm; round it more or make the wall thinner"
        )


def refuse_thick_sections(surface: OuterSurface, thickness: Thickness) -> None:
    """Refuse a wall that is thicker than its sections are round: its inner face would run through the axis or fold.

    Raises `ValueError`. That of the outline is judged where a wall is meshed; a mesh round the body may miss corners.
    """
    at, s = np.meshgrid(np.linspace(0.0, 2 * np.pi, SECTION_SAMPLES), np.linspace(*surface.wall, 65))
    at, s, step = at.ravel(), s.ravel(), 1e-4
    along_it = surface.jets(at, s)[:, 1]
    turn = (surface.normals(at + step, s) - surface.normals(at - step, s)) / (2.0 * step)
    # on the axis, where sections are points, lines round the body have no direction and the outline tells
    bend = np.einsum("ni,ni->n", turn, along_it) / np.maximum(np.einsum("ni,ni->n", along_it, along_it), NEGLIGIBLE**2)
    _refuse_bent(bend, _wall(surface, thickness, None, s), surface.curve.derivative(s)[:, 0], "its section's")


def _planes(symmetry: tuple[bool, bool], theta: FloatArray, number: IntArray, nodes: int) -> FloatArray:
    """Numbers ``(6 nodes,)`` that the planes of symmetry fix."""
    fixed = np.zeros((nodes, 6), dtype=bool)
    for axis in (0, 1):
        if symmetry[axis]:
            on = np.abs(np.cos(theta) if axis == 0 else np.sin(theta)) < 1e-9
            fixed[np.unique(number[on]), axis] = fixed[np.unique(number[on]), 3 + axis] = True
    return fixed.ravel()


def interpolated(coarse: BodyMesh, q: FloatArray, fine: BodyMesh) -> FloatArray:
    """State ``(6 k,)`` on one mesh from that on another, ``q (6 n,)``: cubic splines along the grid lines [m].

    Either may be the half or quarter that symmetry leaves.
    """
    lines, values = all_round(coarse, q.reshape(-1, 6)[coarse.number])
    # splines, for a kink between two nodes would be a bend that the thin wall resists with all its stiffness
    around = CubicSpline(lines, values, bc_type="periodic")(fine.theta)
    state = np.empty((len(fine.X), 6))
    state[fine.number] = CubicSpline(coarse.s, around, axis=1)(fine.s)
    # directors keep their length: a thickness that splines have changed would be a large stress
    director = fine.D + state[:, 3:]
    length = np.linalg.norm(fine.D, axis=1) / np.linalg.norm(director, axis=1)
    state[:, 3:] = length[:, None] * director - fine.D
    return state.ravel()


def all_round(mesh: BodyMesh, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Grid lines once round the body and the values ``(lines, n, 6)`` on them, images where it is not meshed."""
    lines = mesh.theta
    for plane in (0, 1):
        if mesh.symmetry[plane]:
            sign = np.ones(6)
            sign[[plane, 3 + plane]] = -1.0
            # x = 0 is the last line of every mesh that ends there; what is complete to both sides of it ends at y = 0
            lines = np.concatenate([lines, 2.0 * lines[-1] - lines[-2::-1]])
            values = np.concatenate([values, sign * values[-2::-1]])
    return lines, values
