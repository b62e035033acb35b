"""What a triangle mesh has to be before a distance to it means anything: closed, simple, turned outwards.

Small defects are mended with a note that says what and where; no point moves. A hole that is large but leaves inside
and outside decided gets a lid, which matters only under a pad (`facing_sheet`).

Triangles that cross each other are found pair by pair where their boxes meet, exactly up to rounding.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.gap import FloatArray, IntArray, edges_of
from softjaw.fem.objects.mesh_file import LENGTHS, MOST_TRIANGLES
from softjaw.fem.objects.mesh_holes import named_place, without_holes

MOST_PIECES = 50
SMALLEST, LARGEST = 1e-3, 2.0  # plausible largest extent of an object that a gripper holds [m]
TOLERATED_CROSSINGS = 1e-3  # share of crossing triangle pairs that is a scan's blemish, not a wrong shape
DEBRIS = 0.02  # loose pieces below this share of the object's diagonal are dropped
ROUNDED = 5e-7  # of the largest coordinate: corners this close are one; files hold numbers of single precision (6e-8)
FLAT = 1e-6  # volume of a piece over its area and size, below which it has no inside
SURE = 1e-3  # winding numbers this close to 0 and 1 are those of points outside and inside; others lie on the surface
MOSTLY = 0.9  # share of corners inside another piece from which a piece that crosses it counts as inside
MOST_ASKED = 100  # corners of a piece that are asked whether they lie in another
UNITS = {name: times / over for name, (times, over) in LENGTHS.items()}


@njit(cache=True)
def _side(a, b, c, d, noise):
    """Six times the volume of the tetrahedron (a, b, c, d), and a bound below which its sign is rounding."""
    u, v, w = b - a, c - a, d - a
    t_0 = w[0] * (u[1] * v[2] - u[2] * v[1])
    t_1 = w[1] * (u[2] * v[0] - u[0] * v[2])
    t_2 = w[2] * (u[0] * v[1] - u[1] * v[0])
    U, V, W = np.sqrt((u * u).sum()), np.sqrt((v * v).sum()), np.sqrt((w * w).sum())
    volume = t_0 + t_1 + t_2
    # a corner off by the noise changes the volume by that times the areas of the faces
    return 0 if abs(volume) <= noise * (U * V + V * W + W * U) else (1 if volume > 0 else -1)


@njit(cache=True)
def _pierces(p, q, a, b, c, noise):
    """Whether the segment from p to q crosses the inside of the triangle; touching does not count."""
    if _side(a, b, c, p, noise) * _side(a, b, c, q, noise) >= 0:
        return False
    s = _side(p, q, a, b, noise)
    return s != 0 and _side(p, q, b, c, noise) == s and _side(p, q, c, a, noise) == s


@njit(cache=True)
def _cross(points, t, u, noise):
    """Whether two triangles cross: an edge of one without a corner in common pierces the other."""
    for one, other in ((t, u), (u, t)):
        a, b, c = points[other[0]], points[other[1]], points[other[2]]
        for k in range(3):
            i, j = one[k], one[(k + 1) % 3]
            shared = False
            for m in other:
                shared = shared or m == i or m == j
            if not shared and _pierces(points[i], points[j], a, b, c, noise):
                return True
    return False


@njit(cache=True)
def _swept(points, triangles, lower, upper, order, axis, most, noise):
    """Crossing pairs, by a sweep along ``axis`` over the triangles' boxes."""
    found = np.empty((most, 2), np.int64)
    count = 0
    b, c = (axis + 1) % 3, (axis + 2) % 3
    for m in range(len(order)):
        i = order[m]
        for k in range(m + 1, len(order)):
            j = order[k]
            if lower[j, axis] > upper[i, axis]:
                break
            if lower[j, b] > upper[i, b] or upper[j, b] < lower[i, b]:
                continue
            if lower[j, c] > upper[i, c] or upper[j, c] < lower[i, c]:
                continue
            if _cross(points, triangles[i], triangles[j], noise):
                found[count, 0], found[count, 1] = i, j
                count += 1
                if count == most:
                    return found
    return found[:count]


def crossing_pairs(points: FloatArray, triangles: IntArray, most: int = 10_000) -> IntArray:
    """Pairs ``(c, 2)`` of triangles that cross, at most ``most``; touching and overlap in one plane do not count."""
    corners = points[triangles]
    lower, upper = corners.min(axis=1), corners.max(axis=1)
    # along the longest side the fewest boxes overlap
    axis = int(np.ptp(points, axis=0).argmax())
    order, noise = np.argsort(lower[:, axis], kind="stable"), ROUNDED * np.abs(points).max()
    return _swept(points, triangles, lower, upper, order, axis, most, noise)


class SoundMesh(NamedTuple):
    """Closed mesh in metres, oriented outwards.

    Attributes
    ----------
    points : (k, 3) array
        Corners [m].
    triangles : (m, 3) array of int
        Corners of each triangle.
    notes : tuple of str
        What was mended or tolerated, and where in the file's frame.
    lids : (l,) array of int
        Triangles that close a large hole.
    crossing : str
        The note on parts that cross each other; empty if there are none.
    """

    points: FloatArray
    triangles: IntArray
    notes: tuple[str, ...]
    lids: IntArray
    crossing: str


def sound_mesh(points: FloatArray, triangles: IntArray, unit: str = "m") -> SoundMesh:
    """Mesh in metres, points merged, closed, oriented outwards, and notes on what was mended or tolerated.

    Mended: doubled points and triangles, collapsed triangles, orientation, small holes, specks of debris, shells inside
    the object. Tolerated: a few crossing triangles, closed parts that cross each other, larger holes, which get lids.
    Refused: all else that leaves inside and outside undefined, also where they are undecided: pieces without volume,
    and pieces whose corners all lie on another one.

    Parameters
    ----------
    points : (k, 3) array
        Corners, in ``unit``.
    triangles : (m, 3) array of int
        Corners of each triangle.
    unit : str
        One of ``UNITS``.

    Raises
    ------
    MeshError
        With one sentence on the first thing found.
    """
    points, triangles = np.asarray(points, dtype=float), np.asarray(triangles)
    if unit not in UNITS:
        raise MeshError(f"the mesh's unit must be one of {', '.join(UNITS)}, found {unit!r}")
    _check_numbers(points, triangles)
    points, triangles, notes = _merged(points, triangles)
    # points that no triangle uses are gone by now and do not count for the size
    _check_size(float(np.ptp(points, axis=0).max()), unit)
    points = points * UNITS[unit]
    given = len(triangles)
    points, triangles, lids, closed = without_holes(points, triangles)
    neighbours = _closed(triangles)
    triangles, turned = _oriented(points, triangles, *neighbours)
    # the given triangles alone: those that close holes are not the user's to mend
    crossings = crossing_pairs(points, triangles[:given])
    piece = _pieces(points, triangles)
    apart = piece[crossings[:, 0]] != piece[crossings[:, 1]]
    notes += _folded(points, triangles[:given], crossings[~apart])
    parts = _crossing_parts(points, triangles, crossings[apart], piece)
    points, triangles, lids, dropped = _outer_pieces(points, triangles, lids, piece, piece[crossings[apart]])
    told = (*notes, *closed, *turned, *([parts] if parts else []), *dropped)
    return SoundMesh(points, triangles, told, np.flatnonzero(lids), parts)


def _pieces(points: FloatArray, triangles: IntArray) -> IntArray:
    """Number ``(m,)`` of the connected piece of each triangle."""
    edges = triangles[:, [0, 1, 1, 2]].reshape(-1, 2)
    links = coo_array((np.ones(len(edges)), edges.T), shape=(len(points), len(points)))
    return connected_components(links, directed=False)[1][triangles[:, 0]]


def _folded(points: FloatArray, triangles: IntArray, crossings: IntArray) -> list[str]:
    """A note on a few pairs ``(c, 2)`` that cross within one piece; more leave its inside undefined."""
    if len(crossings) > TOLERATED_CROSSINGS * len(triangles):
        raise MeshError(
            f"the mesh intersects itself: {len(crossings)} pairs of triangles cross, the first near "
            f"{named_place(points[triangles[crossings[0, 0]]].mean(axis=0))}; unite its parts into one outer surface "
            "(a boolean union or remeshing does it)"
        )
    return [f"{len(crossings)} pairs among {len(triangles)} triangles cross; tolerated"] if len(crossings) else []


def _crossing_parts(points: FloatArray, triangles: IntArray, crossings: IntArray, piece: IntArray) -> str:
    """A note on closed parts that cross at these pairs ``(c, 2)`` of triangles; empty without any.

    Their inside is that of all together, and a finger sees what lies outside of all.
    """
    if not len(crossings):
        return ""
    return (
        f"{len(np.unique(piece[crossings]))} closed parts cross each other, at {len(crossings)} pairs of triangles, the"
        f" first near {named_place(points[triangles[crossings[0, 0]]].mean(axis=0))}; together they are the object"
    )


def _check_numbers(points: FloatArray, triangles: IntArray) -> None:
    """Refuse what would crash or silently spoil everything after it."""
    if points.ndim != 2 or points.shape[1:] != (3,) or not len(points) or not len(triangles):
        raise MeshError("the mesh is empty: it holds no triangles; export it as a surface mesh")
    if len(triangles) > MOST_TRIANGLES:
        raise MeshError(
            f"the mesh has {len(triangles)} triangles, more than {MOST_TRIANGLES}; decimate it, to about a "
            "tenth of the pad's element size nothing is lost"
        )
    astray = (triangles < 0) | (triangles >= len(points))
    if astray.any():
        raise MeshError(
            f"a triangle refers to point {triangles[astray][0]}, but there are only {len(points)} (counted "
            "from 0); the file is damaged, export it again"
        )
    bad = ~np.isfinite(points).all(axis=1)
    if bad.any():
        raise MeshError(
            f"{bad.sum()} of {len(points)} points have a coordinate that is not a finite number, "
            f"the first is point {np.flatnonzero(bad)[0]} (counted from 0); repair the file"
        )


def _check_size(extent: float, unit: str) -> None:
    """Refuse an ``extent``, in the file's own numbers, that makes no plausible object in this unit."""
    size = extent * UNITS[unit]
    if (1 - ROUNDED) * SMALLEST <= size <= (1 + ROUNDED) * LARGEST:
        return
    fits = [f'"{name}" ({extent * f * 1e3:.4g} mm)' for name, f in UNITS.items() if 0.02 <= extent * f <= 0.6]
    advice = f"the unit should be {' or '.join(fits)}" if fits else "scale the mesh to the object's true size"
    raise MeshError(
        f'an object of {size:.4g} m? With unit = "{unit}" its largest extent lies outside '
        f"{SMALLEST:g} m to {LARGEST:g} m; {advice}"
    )


def _merged(points: FloatArray, triangles: IntArray) -> tuple[FloatArray, IntArray, list[str]]:
    """Points within rounding of each other as one, unused ones left out, collapsed and doubled triangles dropped."""
    # equal points first: STL files repeat every corner, and the tree then has less to search
    points, inverse = np.unique(points[triangles.ravel()], axis=0, return_inverse=True)
    triangles = inverse.reshape(-1, 3).astype(np.int64)
    close = cKDTree(points).query_pairs(ROUNDED * np.abs(points).max(), output_type="ndarray")
    notes = []
    if len(close):
        links = coo_array((np.ones(len(close)), close.T), shape=(len(points), len(points)))
        group = connected_components(links, directed=False)[1]
        first = np.unique(group, return_index=True)[1]
        used, inverse = np.unique(first[group][triangles], return_inverse=True)
        points, triangles = points[used], inverse.reshape(-1, 3).astype(np.int64)
    a, b, c = triangles.T
    whole = (a != b) & (b != c) & (c != a)
    if not whole.any():
        raise MeshError("the mesh is empty: all its triangles have collapsed to lines or points")
    if not whole.all():
        notes.append(f"dropped {np.sum(~whole)} triangles without area")
    triangles = triangles[whole]
    # in the file's order, so that a sound mesh keeps its triangles as they are
    first = np.sort(np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)[1])
    if len(first) < len(triangles):
        notes.append(f"dropped {len(triangles) - len(first)} duplicate triangles")
    used, inverse = np.unique(triangles[first], return_inverse=True)
    return points[used], inverse.reshape(-1, 3).astype(np.int64), notes


def _closed(triangles: IntArray) -> tuple[IntArray, IntArray, IntArray]:
    """Pairs of triangles that share an edge ``(e,)``, ``(e,)``, and whether they run through it in the same sense."""
    edges = edges_of(triangles)
    forward = edges[:, 0] < edges[:, 1]
    unique, inverse, count = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True, return_counts=True)
    if (count > 2).any():
        raise MeshError(
            f"the mesh is not manifold: at {np.sum(count > 2)} edges more than two triangles meet; remove "
            "the inner walls or doubled triangles there"
        )
    if (count == 1).any():
        raise MeshError(
            f"the mesh is not closed: {np.sum(count == 1)} of its {len(unique)} edges border on one "
            "triangle only; fill the holes in a mesh editor, or give the object as a profile"
        )
    order = np.argsort(inverse.ravel(), kind="stable").reshape(-1, 2)
    return order[:, 0] // 3, order[:, 1] // 3, forward[order[:, 0]] == forward[order[:, 1]]


def _oriented(
    points: FloatArray, triangles: IntArray, i: IntArray, j: IntArray, clash: IntArray
) -> tuple[IntArray, list[str]]:
    """Triangles turned so that neighbours agree and every piece encloses a positive volume."""
    n = len(triangles)
    # every triangle counts twice, as given and turned; an edge links the copies that agree
    mirrored = np.where(clash, n, 0)
    ends = np.r_[i, i + n], np.r_[j + mirrored, j + n - mirrored]
    links = coo_array((np.ones(2 * len(i)), ends), shape=(2 * n, 2 * n))
    _, label = connected_components(links, directed=False)
    # both copies in one part: a walk over the surface comes back turned
    if (label[:n] == label[n:]).any():
        raise MeshError("the mesh has only one side (like a Moebius strip), so it has no inside; rebuild it as a solid")
    flip = label[:n] > label[n:]
    triangles = np.where(flip[:, None], triangles[:, ::-1], triangles)
    piece = np.unique(np.minimum(label[:n], label[n:]), return_inverse=True)[1].ravel()
    volume = np.asarray(np.bincount(piece, _volumes(points, triangles)), dtype=float)
    _refuse_flat(points, triangles, piece, volume)
    inverted = volume < 0
    triangles = np.where(inverted[piece][:, None], triangles[:, ::-1], triangles)
    turned = int(np.sum(flip != inverted[piece]))
    return np.ascontiguousarray(triangles), [f"turned {turned} of {n} triangles outwards"] if turned else []


def _refuse_flat(points: FloatArray, triangles: IntArray, piece: IntArray, volume: FloatArray) -> None:
    """Refuse pieces, specks aside, that enclose nothing: which of their sides is the outer one is not decided."""
    a, b, c = points[triangles].transpose(1, 0, 2)
    area = np.bincount(piece, np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)
    low, high = np.full((2, len(area), 3), np.inf)
    np.minimum.at(low, piece, points[triangles].min(axis=1))
    np.minimum.at(high, piece, -points[triangles].max(axis=1))
    size = np.linalg.norm(-high - low, axis=1)
    flat = (np.abs(volume) <= FLAT * area * size) & (size >= DEBRIS * size.max())
    if flat.any():
        raise MeshError(
            f"a piece of the mesh, {size[flat][0]:.4g} m large, encloses no volume: its two sides coincide; "
            "give the object as a solid"
        )


def _volumes(points: FloatArray, triangles: IntArray) -> FloatArray:
    """Signed volumes ``(m,)`` of the tetrahedra from the bounding box's centre to each triangle [m^3]."""
    # about the middle: an origin far away would cost digits
    a, b, c = (points[triangles] - 0.5 * (points.min(axis=0) + points.max(axis=0))).transpose(1, 0, 2)
    return np.einsum("ij,ij->i", a, np.cross(b, c)) / 6


def _outer_pieces(
    points: FloatArray, triangles: IntArray, lids: np.ndarray, owner: IntArray, crossing: IntArray
) -> tuple[FloatArray, IntArray, np.ndarray, list[str]]:
    """Mesh without debris and without shells inside another piece: the object is grasped from outside.

    ``owner`` ``(m,)`` numbers the pieces, of which ``crossing (c, 2)`` cross each other.
    """
    numbers, owner = np.unique(owner, return_inverse=True)
    count, crossing = len(numbers), np.searchsorted(numbers, crossing)
    if count == 1:
        return points, triangles, lids, []
    if count > MOST_PIECES:
        raise MeshError(f"the mesh consists of {count} separate pieces; keep the object's outer surface only")
    crosses = np.zeros((count, count), dtype=bool)
    crosses[crossing[:, 0], crossing[:, 1]] = crosses[crossing[:, 1], crossing[:, 0]] = True
    pieces = [triangles[owner == k] for k in range(count)]
    size = np.array([np.linalg.norm(np.ptp(points[piece.ravel()], axis=0)) for piece in pieces])
    speck = size < DEBRIS * size.max()

    def inside(k: int, m: int) -> bool:
        return (_lies_mostly_inside if crosses[k, m] else _lies_inside)(points, pieces[k], pieces[m])

    inner = np.array([any(inside(k, m) for m in np.flatnonzero(~speck) if m != k) for k in range(count)])
    keep = ~speck & ~inner
    if not keep.any():
        raise MeshError("pieces of the mesh lie inside each other; keep the object's outer surface only")
    lids = lids[keep[owner]]
    used, inverse = np.unique(triangles[keep[owner]], return_inverse=True)
    notes = [
        f"dropped {number} {kind}"
        for number, kind in ((speck.sum(), "specks of debris"), ((inner & ~speck).sum(), "shells inside the object"))
        if number
    ]
    return points[used], inverse.reshape(-1, 3).astype(np.int64), lids, notes


def _lies_inside(points: FloatArray, piece: IntArray, other: IntArray) -> bool:
    """Whether a piece lies inside another, by the first of its corners that does not lie on the other."""
    corners = np.unique(piece)
    # a corner that lies on the other piece is neither outside nor inside: ask the next one
    for corner in corners[:: 1 + len(corners) // MOST_ASKED]:
        if abs((turns := winding_number(points[corner], points, other)) - 0.5) > 0.5 - SURE:
            return turns > 0.5
    raise MeshError(
        "two pieces of the mesh lie on each other: all corners of one are on the other; unite them into one surface, "
        "or leave one out"
    )


def _lies_mostly_inside(points: FloatArray, piece: IntArray, other: IntArray) -> bool:
    """Whether a piece that crosses another lies inside it but for a few places, as the inner wall of a scan may."""
    corners = np.unique(piece)
    asked = points[corners[:: 1 + len(corners) // MOST_ASKED]]
    return float(np.mean([winding_number(x, points, other) > 0.5 for x in asked])) > MOSTLY


def winding_number(x: FloatArray, points: FloatArray, triangles: IntArray) -> float:
    """How often a closed mesh surrounds the point ``x (3,)``: 1 inside, 0 outside (solid angle over 4 pi)."""
    a, b, c = (points[triangles] - x).transpose(1, 0, 2)
    A, B, C = (np.linalg.norm(v, axis=1) for v in (a, b, c))
    dot = lambda u, v: np.einsum("ij,ij->i", u, v)  # noqa: E731
    lower = A * B * C + dot(a, b) * C + dot(b, c) * A + dot(c, a) * B
    # a triangle on which x lies up to rounding is seen under half a turn or its negative: it counts as neither
    side, noise = dot(a, np.cross(b, c)), ROUNDED * np.abs(points).max() * (A * B + B * C + C * A)
    on = (np.abs(side) <= noise) & (lower <= SURE * A * B * C + noise)
    return float(np.where(on, 0.0, np.arctan2(side, lower)).sum() / (2 * np.pi))
