"""Any set of triangles made fit to be met by a finger: points merged, small holes filled, neighbours turned alike.

A finger meets the first surface along its approach, so nothing has to be closed, manifold or turned outwards: which
side of a triangle is met is decided where it is met (`facing_sheet`). What is done here only spares work and smooths
facets: doubled points and triangles become one, specks and shells inside are dropped, triangles that share an edge are
turned alike. Where more than two meet at an edge the two that continue most smoothly are neighbours, the others end
there.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.spatial import cKDTree

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.gap import IntArray, cone_volumes, edges_of
from softjaw.fem.objects.mesh_file import LENGTHS
from softjaw.fem.objects.mesh_holes import border_edges, border_loops, lid_corners, with_holes_filled
from softjaw.fem.objects.triangle_tree import TriangleTree, area_vectors, components
from softjaw.friction.patch import FloatArray

SMALLEST, LARGEST = 1e-3, 2.0  # plausible largest extent of an object that a gripper holds [m]
HUGE_COORDINATE = 1e12  # of a coordinate, in any unit
ROUNDED = 5e-7  # of the largest coordinate: corners this close are one; files hold numbers of single precision (6e-8)
MOST_TRIANGLES, DECIMATED_TO = 500_000, 200_000
COMES_THROUGH = 1e-3  # of a piece's extent: how far another may come through it and still count as inside
UNITS = {name: times / over for name, (times, over) in LENGTHS.items()}


class Neighbours(NamedTuple):
    """Edges of triangles, and which two triangles continue each other there.

    ``edges (e, 2)`` and ``edge_of (m, 3)`` as in `SmoothTriangles`; ``sides (e, 2)``: both triangles' sides, ``3 *
    triangle + corner``, -1 twice where the edge has no such pair; ``at_edge (e,)``: how many triangles meet there.
    """

    edges: IntArray
    edge_of: IntArray
    sides: IntArray
    at_edge: IntArray

    @property
    def paired(self) -> np.ndarray:
        """Edges that two triangles share as neighbours ``(e,)``."""
        return self.sides[:, 0] >= 0


class Triangles(NamedTuple):
    """Points ``(k, 3)`` [m] and triangles, what was mended or left out, and where in the file's frame.

    ``lids (l, 3, 3)`` are triangles over the holes that stay open [m]; ``closed``: whether every piece is a closed
    surface that is turned outwards.
    """

    points: FloatArray
    triangles: IntArray
    notes: tuple[str, ...]
    lids: FloatArray
    closed: bool


def cleaned(points: FloatArray, triangles: IntArray, unit: str = "m") -> Triangles:
    """Triangles of points ``(k, 3)`` in a unit of ``UNITS``, in metres, with notes on what was mended.

    Raises `MeshError`: no triangles with finite coordinates, or an implausible size.
    """
    points, triangles = np.asarray(points, dtype=float), np.asarray(triangles)
    triangles, dropped = _finite(points, triangles)
    # equal points first: STL files repeat every corner, and the tree then has less to search
    points, triangles = np.unique(points[triangles.ravel()], axis=0, return_inverse=True)
    close = cKDTree(points).query_pairs(ROUNDED * np.abs(points).max(), output_type="ndarray")
    points, triangles, merged = _merged(points, triangles.reshape(-1, 3).astype(np.int64), close)
    sewn: list[str] = []
    if len(seams := _side_by_side(points, triangles)):
        points, triangles, sewn = _merged(points, triangles, seams)
        sewn = [f"corners of borders side by side made one: {len(seams)}", *sewn]
    # points that no triangle uses are gone by now and do not count for the size
    _check_size(float(np.ptp(points, axis=0).max()), unit)
    points, triangles, thinned = _with_fewer(points * UNITS[unit], triangles)
    points, triangles, specks = _without_specks(points, triangles)
    points, triangles, filled = with_holes_filled(points, triangles)
    triangles, closed, turned = turned_alike(points, triangles)
    shells: list[str] = []
    if closed:
        points, triangles, shells = _without_shells(points, triangles)
    loops = border_loops(triangles)
    opened = [f"{len(loops)} hole{'s' * (len(loops) > 1)} left open"] if loops else []
    notes = (*dropped, *merged, *sewn, *thinned, *specks, *filled, *opened, *turned, *shells)
    return Triangles(points, triangles, notes, lid_corners(points, loops), closed)


def _finite(points: FloatArray, triangles: IntArray) -> tuple[IntArray, list[str]]:
    # what lies beyond is no coordinate in any unit, and its square overflows
    good = (np.abs(points) < HUGE_COORDINATE).all(axis=1)[triangles].all(axis=1)
    if not good.any():
        raise MeshError("no triangle of the mesh has finite coordinates; repair the file")
    return triangles[good], [] if good.all() else [f"dropped {np.sum(~good)} triangles without finite coordinates"]


def _check_size(extent: float, unit: str) -> None:
    """Refuse an ``extent``, in the file's own numbers, that makes no plausible object in this unit."""
    size = extent * UNITS[unit]
    if (1 - ROUNDED) * SMALLEST <= size <= (1 + ROUNDED) * LARGEST:
        return
    fits = [f'"{name}" ({extent * f * 1e3:.4g} mm)' for name, f in UNITS.items() if 0.02 <= extent * f <= 0.6]
    advice = f"the unit may be {' or '.join(fits)}" if fits else "scale the mesh to the object's true size"
    text = f'an object of {size:.4g} m with unit = "{unit}"? Expected {SMALLEST:g} m to {LARGEST:g} m; {advice}'
    raise MeshError(text)


def _side_by_side(points: FloatArray, triangles: IntArray) -> IntArray:
    """Pairs of corners of borders that a seam between two sheets of one body leaves ``(p, 2)``."""
    border = border_edges(triangles)
    shortest = np.full(len(points), np.inf)
    np.minimum.at(shortest, border, np.linalg.norm(np.subtract(*points[border.T]), axis=1)[:, None])
    corners = np.unique(border)
    # of the extent, and of an edge: two corners of one sheet are farther apart
    pairs = corners[cKDTree(points[corners]).query_pairs(3e-4 * np.ptp(points), output_type="ndarray")]
    return pairs[np.linalg.norm(np.subtract(*points[pairs.T]), axis=1) < 0.3 * shortest[pairs].min(axis=1)]


def _merged(points: FloatArray, triangles: IntArray, pairs: IntArray) -> tuple[FloatArray, IntArray, list[str]]:
    """``pairs (p, 2)`` of points as one, unused points left out, collapsed and doubled triangles dropped."""
    notes = []
    if len(pairs):
        group = components(pairs, len(points))
        points, triangles = _used(points, np.unique(group, return_index=True)[1][group][triangles])
    a, b, c = triangles.T
    proper = (a != b) & (b != c) & (c != a)
    if not proper.any():
        raise MeshError("the mesh is empty: all its triangles have collapsed to lines or points")
    if not proper.all():
        notes.append(f"dropped {np.sum(~proper)} triangles without area")
    triangles = triangles[proper]
    # in the file's order, so that a sound mesh keeps its triangles as they are
    first = np.sort(np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)[1])
    if len(first) < len(triangles):
        notes.append(f"dropped {len(triangles) - len(first)} duplicate triangles")
    return *_used(points, triangles[first]), notes


def _used(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray]:
    """The mesh without the points that no triangle uses."""
    used, inverse = np.unique(triangles, return_inverse=True)
    return points[used], inverse.reshape(-1, 3).astype(np.int64)


def decimated(points: FloatArray, triangles: IntArray, count: int) -> tuple[FloatArray, IntArray]:
    """About ``count`` triangles in place of more."""
    import pyvista as pv  # loading VTK takes a quarter of a start, and few meshes need it
    from vtkmodules.vtkFiltersCore import vtkQuadricDecimation

    # on a flat face every edge costs nothing; a trace of regularisation keeps one point from taking them all, slowly
    few = vtkQuadricDecimation(regularize=True, regularization=1e-6, target_reduction=1 - count / len(triangles))
    few.SetInputData(pv.PolyData.from_regular_faces(points, triangles))
    few.Update()
    mesh = pv.wrap(few.GetOutput())
    return np.asarray(mesh.points, dtype=float), mesh.regular_faces.astype(np.int64)


def _with_fewer(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray, list[str]]:
    """A mesh of very many triangles with fewer, and how far that moved its points."""
    if len(triangles) <= MOST_TRIANGLES:
        return points, triangles, []
    few, coarse = decimated(points, triangles, DECIMATED_TO)
    moved = np.abs(TriangleTree(few, coarse).signed(points[:: max(1, len(points) // 100_000)])[0]).max()
    text = f"decimated from {len(triangles)} to {len(coarse)} triangles, its surface moved by {1e3 * moved:.2g} mm"
    return few, coarse, [text]


def pieces_of(points: FloatArray, triangles: IntArray) -> IntArray:
    """Number ``(m,)`` of the connected piece of each triangle, from 0 on."""
    edges = triangles[:, [0, 1, 1, 2]].reshape(-1, 2)
    return np.unique(components(edges, len(points))[triangles[:, 0]], return_inverse=True)[1].ravel()


@njit(cache=True)
def lowest_and_highest(points, triangles, a, b):
    """Lowest and highest z of triangles over the rectangle ``|x| <= a, |y| <= b``; infinite where there are none."""
    low, high = np.inf, -np.inf
    p = np.empty((3, 3))
    for t in range(len(triangles)):
        for k in range(3):
            for d in range(3):
                p[k, d] = points[triangles[t, k], d]
        if min(p[0, 0], p[1, 0], p[2, 0]) > a or max(p[0, 0], p[1, 0], p[2, 0]) < -a:
            continue
        if min(p[0, 1], p[1, 1], p[2, 1]) > b or max(p[0, 1], p[1, 1], p[2, 1]) < -b:
            continue
        for k in range(3):
            x, y, z = p[k]
            if abs(x) <= a and abs(y) <= b:
                low, high = min(low, z), max(high, z)
            dx, dy, dz = p[(k + 1) % 3] - p[k]
            for side in (-1.0, 1.0):  # where an edge crosses the sides of the rectangle
                u = (side * a - x) / dx if dx != 0.0 else -1.0
                v = (side * b - y) / dy if dy != 0.0 else -1.0
                if 0.0 <= u <= 1.0 and abs(y + u * dy) <= b:
                    low, high = min(low, z + u * dz), max(high, z + u * dz)
                if 0.0 <= v <= 1.0 and abs(x + v * dx) <= a:
                    low, high = min(low, z + v * dz), max(high, z + v * dz)
        (x, y, z), u, v = p[0], p[1] - p[0], p[2] - p[0]
        area = u[0] * v[1] - u[1] * v[0]
        for i in (-a, a):
            for j in (-b, b):
                if area != 0.0:  # seen from its edge a triangle has no height of its own: its neighbours have it
                    r, q = ((i - x) * v[1] - (j - y) * v[0]) / area, (u[0] * (j - y) - u[1] * (i - x)) / area
                    if r >= -1e-12 and q >= -1e-12 and r + q <= 1.0 + 1e-12:
                        low, high = min(low, z + r * u[2] + q * v[2]), max(high, z + r * u[2] + q * v[2])
    return low, high


def _areas(points: FloatArray, triangles: IntArray) -> FloatArray:
    return np.linalg.norm(area_vectors(points, triangles), axis=1) / 2


def _sizes(points: FloatArray, triangles: IntArray, piece: IntArray) -> FloatArray:
    """Diagonals of the pieces' bounding boxes [m]."""
    low, high = np.full((2, piece.max() + 1, 3), np.inf)
    np.minimum.at(low, piece, points[triangles].min(axis=1))
    np.minimum.at(high, piece, -points[triangles].max(axis=1))
    return np.linalg.norm(-high - low, axis=1)


def _without_specks(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray, list[str]]:
    """The mesh without loose specks, which scans leave beside the object and a pad would meet first."""
    piece = pieces_of(points, triangles)
    size, area = _sizes(points, triangles, piece), np.bincount(piece, _areas(points, triangles))
    speck = size < 0.02 * size.max()  # share of the object's diagonal: loose pieces below it are dropped ...
    # ... unless they make up more than this share of the area
    if not speck.any() or area[speck].sum() > 0.02 * area.sum():
        return points, triangles, []
    return *_used(points, triangles[~speck[piece]]), [f"dropped {speck.sum()} specks of debris"]


def neighbours(points: FloatArray, triangles: IntArray, as_given: bool = False) -> Neighbours:
    """Edges, and the two triangles at each that are neighbours: of many, the two that turn least into each other.

    ``as_given``: two that are turned alike come first. Faces of solids that touch along an edge may lie in one plane.
    """
    sides = edges_of(triangles)
    ordered = np.sort(sides, axis=1)
    key, first, edge, count = np.unique(
        ordered[:, 0] * len(points) + ordered[:, 1], return_index=True, return_inverse=True, return_counts=True
    )
    edge = edge.ravel()
    order, start = np.argsort(edge, kind="stable"), np.concatenate([[0], np.cumsum(count)[:-1]])
    pair = np.full((len(key), 2), -1)
    two = count == 2
    pair[two] = np.stack([order[start[two]], order[start[two] + 1]], axis=1)
    area = area_vectors(points, triangles)
    normal = area / np.maximum(np.linalg.norm(area, axis=1), 1e-300)[:, None]
    for n in range(3, 9):  # triangles at one edge, among which neighbours are looked for
        if (many := np.flatnonzero(count == n)).size:
            pair[many] = _smoothest(order[start[many][:, None] + np.arange(n)], sides, normal, as_given)
    return Neighbours(ordered[first], edge.reshape(-1, 3), pair, count)


def _smoothest(at: IntArray, sides: IntArray, normal: FloatArray, as_given: bool) -> IntArray:
    """Of the sides ``(k, n)`` at each edge the two ``(k, 2)`` that are neighbours."""
    i, j = np.triu_indices(at.shape[1], 1)
    p, q = at[:, i], at[:, j]
    cosine = np.einsum("knd,knd->kn", normal[p // 3], normal[q // 3])
    # two that run through the edge in opposite senses are turned alike
    best = np.where(sides[p, 0] != sides[q, 0], cosine, -cosine - 3.0 * as_given).argmax(axis=1)
    row = np.arange(len(at))
    return np.stack([p[row, best], q[row, best]], axis=1)


def turned_alike(points: FloatArray, triangles: IntArray) -> tuple[IntArray, bool, list[str]]:
    """Triangles turned as their neighbours and outwards, whether all pieces are closed, and a note on those turned."""
    joined, n = neighbours(points, triangles, as_given=True), len(triangles)
    i, j = joined.sides[joined.paired].T
    sides = edges_of(triangles)
    clash = sides[i, 0] == sides[j, 0]
    i, j = i // 3, j // 3
    # every triangle counts twice, as given and turned; an edge links the copies that agree
    mirrored = np.where(clash, n, 0)
    label = components(np.stack([np.r_[i, i + n], np.r_[j + mirrored, j + n - mirrored]], axis=1), 2 * n)
    # both copies in one part: a surface of one side, which stays as it is given
    one_sided = label[:n] == label[n:]
    flip = (label[:n] > label[n:]) & ~one_sided
    triangles = np.where(flip[:, None], triangles[:, ::-1], triangles)
    piece = np.unique(np.minimum(label[:n], label[n:]), return_inverse=True)[1].ravel()
    volume = np.asarray(np.bincount(piece, cone_volumes(points, triangles)), dtype=float)
    # volume of a piece over its area and size, below which it has no inside
    flat = np.abs(volume) <= 1e-6 * np.bincount(piece, _areas(points, triangles)) * _sizes(points, triangles, piece)
    inverted = (volume < 0) & ~flat
    triangles = np.where(inverted[piece][:, None], triangles[:, ::-1], triangles)
    turned = flip != inverted[piece]
    # as many triangles run through each edge in the one sense as in the other
    up = (sides[:, 0] < sides[:, 1]) != np.repeat(turned, 3)
    balanced = not np.bincount(joined.edge_of.ravel(), np.where(up, 1.0, -1.0)).any()
    closed = bool(balanced and not one_sided.any() and not flat.any())
    notes = [f"turned {turned.sum()} of {n} triangles"] if turned.any() else []
    return np.ascontiguousarray(triangles), closed, notes


def _without_shells(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray, list[str]]:
    """A closed mesh without the closed pieces that lie inside another one: nobody meets them, and they fill no less."""
    piece = pieces_of(points, triangles)
    count = piece.max() + 1
    if count == 1 or count > 50:  # pieces that are compared with each other, to find those inside others
        return points, triangles, []
    parts = [triangles[piece == k] for k in range(count)]
    inner = np.array([any(_inside(points, part, other) for other in parts if other is not part) for part in parts])
    if not inner.any() or inner.all():
        return points, triangles, []
    return *_used(points, triangles[~inner[piece]]), [f"dropped {inner.sum()} shell{'s'[: inner.sum() - 1]} inside"]


def _inside(points: FloatArray, piece: IntArray, other: IntArray) -> bool:
    """Whether a piece lies inside another, but for a few places where it touches that from within."""
    corners, sides = points[np.unique(piece)], edges_of(piece)
    within = np.ptp(points[other], axis=(0, 1)) * COMES_THROUGH
    low, high = points[other].min(axis=(0, 1)) - within, points[other].max(axis=(0, 1)) + within
    if (corners < low).any() or (corners > high).any():
        return False
    # middles of sides too, each once: between corners that lie inside a side may run outside
    middles = points[sides[sides[:, 0] < sides[:, 1]]].mean(axis=1)
    signed = TriangleTree(points, other).signed(np.concatenate([corners, middles]))[0]
    return bool(signed.max() < within.max() and np.mean(signed < -ROUNDED * np.abs(points).max()) > 0.9)
