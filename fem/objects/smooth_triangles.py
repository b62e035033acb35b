"""Facets made smooth: curved point-normal triangles (Vlachos, 2001) below a crease angle, cut into small flat ones.

Every corner of a triangle has the mean normal of the faces that reach it across smooth edges, those that turn by less
than the crease angle and do not end long facets. A face counts by its angle times its squared area, so that a large
flat face stays flat beside the narrow facets of its rounding. An edge becomes a cubic that leaves its ends at right
angles to their normals; where the edge is a crease, along the line in which the two tangent planes meet. A cubic
belongs to the edge, not to a triangle, so neighbours stay joined without gaps. The mesh's own points stay where they
are.

For facets of length h on a surface of radius R the error falls from h^2 / (8 R) to about 0.02 h^4 / R^3.
"""

from typing import NamedTuple

import numpy as np

from softjaw.fem.objects.gap import IntArray, edges_of
from softjaw.fem.objects.triangle_tree import area_vectors, components, corner_angles
from softjaw.fem.objects.triangles import neighbours
from softjaw.friction.patch import FloatArray

CREASE_ANGLE = 30.0  # [deg]: edges that turn by less are taken for facets of a smooth surface
STEEPEST_EDGE = 0.7  # an edge that leaves its tangent plane by more (sine) is kept straight: its normal is no use
SHARP = 60.0  # [deg]: edges that turn by less may still be facets of something round
FLAT = np.radians(0.5)  # turn below which two triangles are one facet
# An edge across which both facets are so many times as wide as it is long, and would bulge so many times as much as at
# their other edges, is a real one where that is more than so much [m]; see `_at_ends`. No round numbers, at which
# rounding would tell edges of one kind apart.
SLENDER, OUTSTANDING, BULGE = 3.9, 7.9, 2.9e-4


class SmoothTriangles(NamedTuple):
    """Bezier points of every edge ``(e,)`` of a mesh.

    ``edges (e, 2)``: points of each, the smaller number first; ``edge_of (m, 3)``: edge from corner 0, 1, 2 of each
    triangle to the next one; ``inner (e, 2, 3)``: inner Bezier points [m]; ``crease (e,)``: edges that stay sharp;
    ``turn (e,)``: angle between their two triangles [rad].
    """

    points: FloatArray
    triangles: IntArray
    edges: IntArray
    edge_of: IntArray
    inner: FloatArray
    crease: np.ndarray
    turn: FloatArray

    def doubtful(self, width: float) -> tuple[IntArray, FloatArray]:
        """Creases that may be facets of a smooth surface: those ``(k,)`` below `SHARP` between wide triangles.

        The second array ``(k,)`` is how far that surface would lie from the facets [m]. ``width`` is what both
        triangles measure at least across their edge [m].
        """
        area = area_vectors(self.points, self.triangles)
        _, narrower = _measures(self.points, area, self.edges, self.edge_of)
        creases = np.flatnonzero(self.crease & (self.turn < np.radians(SHARP)) & (narrower >= width))
        # an arc over chords of this length that turn by this angle
        return creases, narrower[creases] * self.turn[creases] / 8.0

    def bulge(self, which: IntArray) -> FloatArray:
        """How far the middle of each edge of the triangles ``which`` lies from its chord, ``(k,)`` [m]."""
        edges = np.unique(self.edge_of[which])
        middle = 0.375 * (self.inner[edges].sum(axis=1) - self.points[self.edges[edges]].sum(axis=1))
        return np.linalg.norm(middle, axis=1)

    def pieces_for(self, which: IntArray, tolerance: float) -> int:
        """Pieces of an edge with which flat triangles follow the smooth ones to ``tolerance`` [m], within limits."""
        # not the largest: a single bad triangle of a scan must not refine them all
        bulge = float(np.quantile(self.bulge(which), 0.99, method="higher"))
        # triangles of one refined sheet
        most = min(8, int(np.sqrt(250_000 / len(which))))  # pieces of an edge
        return int(np.clip(np.ceil(np.sqrt(bulge / tolerance) - 1e-6), 1, max(most, 1)))

    def refined(self, which: IntArray, n: int) -> tuple[FloatArray, IntArray]:
        """Points and triangles of the smooth triangles ``which (k,)``, each cut into ``n ** 2``."""
        i, j = (v.ravel() for v in np.meshgrid(np.arange(n + 1), np.arange(n + 1), indexing="ij"))
        i, j = i[i + j <= n], j[i + j <= n]
        weights = np.stack([n - i - j, i, j], axis=1)  # of the corners, times n
        chosen = self.triangles[which]
        used, corner = np.unique(chosen, return_inverse=True)
        lines, line = np.unique(self.edge_of[which], return_inverse=True)
        corner, line = corner.reshape(-1, 3), line.reshape(-1, 3)
        number = np.empty((len(which), len(weights)), np.int64)
        inside = (weights > 0).all(axis=1)
        first = len(used) + len(lines) * (n - 1)
        number[:, inside] = first + np.arange(len(which) * inside.sum()).reshape(len(which), -1)
        for k in range(3):
            number[:, weights[:, k] == n] = corner[:, k : k + 1]
            on = np.flatnonzero((weights[:, (k + 2) % 3] == 0) & (weights[:, k] > 0) & (weights[:, (k + 1) % 3] > 0))
            # from the end with the smaller number, so that both triangles of an edge find the same points
            forward = (chosen[:, k] < chosen[:, (k + 1) % 3])[:, None]
            place = np.where(forward, weights[on, (k + 1) % 3], weights[on, k])
            number[:, on] = len(used) + line[:, k : k + 1] * (n - 1) + place - 1
        x = [self.points[used], self._on_edges(lines, n), self._inside(which, weights[inside] / n)]
        cut = {pair: k for k, pair in enumerate(zip(i.tolist(), j.tolist(), strict=True))}
        small = [(cut[a, b], cut[a + 1, b], cut[a, b + 1]) for a, b in cut if a + b < n]
        small += [(cut[a + 1, b], cut[a + 1, b + 1], cut[a, b + 1]) for a, b in cut if a + b < n - 1]
        return np.concatenate(x), number[:, np.array(small)].reshape(-1, 3)

    def _on_edges(self, lines: IntArray, n: int) -> FloatArray:
        """Inner points of the edges, ``n - 1`` of each, from the end with the smaller number."""
        t = (np.arange(1, n) / n)[None, :, None]
        ends, inner = self.points[self.edges[lines]][:, :, None], self.inner[lines][:, :, None]
        u = 1 - t
        x = u**3 * ends[:, 0] + 3 * u * u * t * inner[:, 0] + 3 * u * t * t * inner[:, 1] + t**3 * ends[:, 1]
        return x.reshape(-1, 3)

    def _inside(self, which: IntArray, weights: FloatArray) -> FloatArray:
        """Points ``(k * w, 3)`` of the triangles at barycentric ``weights (w, 3)``."""
        P, chosen = self.points[self.triangles[which]], self.triangles[which]
        forward = chosen < np.roll(chosen, -1, axis=1)
        inner = self.inner[self.edge_of[which]]
        inner = np.where(forward[:, :, None, None], inner, inner[:, :, ::-1])  # from each corner to the next one
        # with this middle point a quadratic triangle comes out exactly
        middle = 1.5 * inner.mean(axis=(1, 2)) - 0.5 * P.mean(axis=1)
        x = 6 * np.einsum("w,kd->kwd", weights.prod(axis=1), middle)
        for k in range(3):
            a, b = weights[:, k], weights[:, (k + 1) % 3]
            x += np.einsum("w,kd->kwd", a**3, P[:, k])
            x += np.einsum("w,kd->kwd", 3 * a * a * b, inner[:, k, 0])
            x += np.einsum("w,kd->kwd", 3 * a * b * b, inner[:, k, 1])
        return x.reshape(-1, 3)


def smooth_triangles(points: FloatArray, triangles: IntArray, crease_angle: float = CREASE_ANGLE) -> SmoothTriangles:
    """Smooth version of triangles; edges that turn by more than ``crease_angle`` [deg], or have no two sides, stay."""
    pairs, joined = edges_of(triangles), neighbours(points, triangles)
    paired, ends = joined.paired, joined.edges
    # an edge without a pair is seen as a side and itself
    first_side = np.zeros(len(ends), np.int64)
    first_side[joined.edge_of.ravel()[::-1]] = np.arange(len(pairs))[::-1]
    halves = np.where(paired[:, None], joined.sides, first_side[:, None])
    area = area_vectors(points, triangles)
    normal = area / np.maximum(np.linalg.norm(area, axis=1), 1e-300)[:, None]
    cosine = np.einsum("ed,ed->e", normal[halves[:, 0] // 3], normal[halves[:, 1] // 3])
    alike = pairs[halves[:, 0], 0] != pairs[halves[:, 1], 0]
    # an edge at the very angle is a crease, whatever rounding makes of it
    # margin of the cosine: files of single precision turn edges of one angle, as of 12 facets, by less
    crease = ~paired | ~alike | (cosine < np.cos(np.radians(crease_angle)) + 1e-5)
    turn = np.where(paired, np.arccos(np.clip(np.where(alike, cosine, -cosine), -1.0, 1.0)), np.pi)
    length, narrower = _measures(points, area, ends, joined.edge_of)
    if crease_angle <= CREASE_ANGLE:  # whoever raises the angle wants such edges round
        opposite = triangles.ravel()[_following(_following(halves[:, 1]))]
        inwards = np.einsum("ed,ed->e", normal[halves[:, 0] // 3], points[opposite] - points[ends[:, 0]]) < 0
        along = (points[ends[:, 1]] - points[ends[:, 0]]) / np.maximum(length, 1e-300)[:, None]
        crease |= _at_ends(length, narrower, np.where(inwards, turn, -turn), along, halves // 3, ~crease)
    corner_normals = _corner_normals(points, triangles, area, normal, halves[~crease])
    inner = np.empty((len(ends), 2, 3))
    for end in (0, 1):
        # either side's corner at this end: an edge's two sides run through it in opposite senses
        starts = pairs[halves, 0] == ends[:, end : end + 1]
        corner = np.where(starts, halves, _following(halves))
        p, q = points[ends[:, end]], points[ends[:, 1 - end]]
        tangent = _tangent(q - p, corner_normals[corner[:, 0]], corner_normals[corner[:, 1]])
        # where several surfaces end nobody knows how the edge continues
        inner[:, end] = p + np.where((paired | (joined.at_edge == 1))[:, None], tangent, q - p) / 3
    folded = _folded(points, triangles, normal, ends, joined.edge_of, inner) & crease
    inner[folded] = points[ends[folded]] + (points[ends[folded, ::-1]] - points[ends[folded]]) / 3
    return SmoothTriangles(points, triangles, ends, joined.edge_of, inner, crease, turn)


def _folded(
    points: FloatArray, triangles: IntArray, normal: FloatArray, ends: IntArray, edge_of: IntArray, inner: FloatArray
) -> np.ndarray:
    """Whether edges ``(e,)``, as they curve, leave a corner beyond the next side of a triangle, which then folds.

    The rim of a hole in a flat face does so where a narrow triangle meets it at a grazing angle.
    """
    first, corners = (ends[edge_of, 0] == triangles)[..., None], points[triangles]
    leaving = np.where(first, inner[edge_of, 0], inner[edge_of, 1]) - corners
    arriving = np.roll(np.where(first, inner[edge_of, 1], inner[edge_of, 0]), 1, axis=1) - corners
    over = np.einsum("mkd,md->mk", np.cross(leaving, arriving), normal) < 0.0
    folded = np.zeros(len(ends), dtype=bool)
    folded[edge_of[over]] = folded[np.roll(edge_of, 1, axis=1)[over]] = True
    return folded


def _measures(
    points: FloatArray, area: FloatArray, edges: IntArray, edge_of: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Length of each edge ``(e,)`` and what the narrower triangle measures across it [m]; ``area``: `area_vectors`."""
    twice = np.linalg.norm(area, axis=1)
    length = np.linalg.norm(np.diff(points[edges], axis=1)[:, 0], axis=1)
    narrower = np.full(len(edges), np.inf)
    np.minimum.at(narrower, edge_of, twice[:, None] / np.maximum(length[edge_of], 1e-300))
    return length, narrower


def _at_ends(
    length: FloatArray, narrower: FloatArray, bend: FloatArray, along: FloatArray, sides: IntArray, smooth: np.ndarray
) -> np.ndarray:
    """Which of the ``smooth (e,)`` edges are real ones at the ends of long facets, as of a straight shank and a cone.

    Whoever cuts a round surface into facets makes them as fine as it bends: one that were round there would bulge far
    more than at its other edges. ``bend (e,)``: turn of an edge, negative where it is hollow [rad]; ``along (e,
    3)``: its direction; ``sides (e, 2)``: both of its triangles.
    """
    count, flat = int(sides.max()) + 1, smooth & (np.abs(bend) < FLAT)
    facet = components(sides[flat], count)
    edges = np.flatnonzero(smooth & ~flat)
    # where two facets meet, whatever number of edges that has
    facets, joint = np.unique(np.sort(facet[sides[edges]], axis=1), axis=0, return_inverse=True)
    joint, each = joint.ravel(), narrower[edges] * np.abs(bend[edges]) / 8.0
    bulge, bends, lines = np.zeros(len(facets)), np.zeros(len(facets)), np.zeros((len(facets), 3))
    np.maximum.at(bulge, joint, each)
    bends[joint], lines[joint] = bend[edges], along[edges]
    following = _next_joints(facets, bulge)
    round_ = _in_a_row(following, bends, lines)
    alone = (following < 0).all(axis=1)  # neither facet has another smooth joint: a handle of six sides and its tip
    real = np.zeros(len(smooth), dtype=bool)
    while True:  # of a cone between two straight walls the next end shows
        elsewhere = np.append(bulge, 0.0)[following].min(axis=1)
        slender = (narrower[edges] > SLENDER * length[edges]) | alone[joint]
        ends = (each > np.maximum(OUTSTANDING * elsewhere, BULGE)[joint]) & slender
        ends &= ~round_[joint] & ~real[edges]
        if not ends.any():
            return real
        real[edges[ends]] = True
        bulge[joint[ends]] = 0.0
        following = _next_joints(facets, bulge)


def _next_joints(facets: IntArray, bulge: FloatArray) -> IntArray:
    """Of both ``facets (k, 2)`` of every joint the other joint that bulges most, ``(k, 2)``; -1 where there is none."""
    flat, number = facets.ravel(), np.repeat(np.arange(len(facets)), 2)
    order = np.lexsort([-bulge[number], flat])
    starts = np.searchsorted(flat[order], flat)
    first, second = (np.append(order, order[-1:])[np.minimum(starts + k, len(order))] for k in (0, 1))
    other = np.where(number[first] == number, second, first)
    return np.where((flat[other] == flat) & (number[other] != number), number[other], -1).reshape(-1, 2)


def _in_a_row(following: IntArray, bends: FloatArray, lines: FloatArray) -> np.ndarray:
    """Which joints are among three in a row that bend the same way, by less than 3 times one another: a round surface.

    ``following``: `_next_joints`; ``lines (k, 3)``: directions of the joints, of which those of a row are much alike.
    """
    ratio = np.append(bends, 0.0)[following] / bends[:, None]
    alike = (ratio > 0.34) & (ratio < 1 / 0.34) & (np.abs(np.einsum("ksd,kd->ks", lines[following], lines)) > 0.7)
    beyond = np.where(following >= 0, alike.sum(axis=1)[following], 0)
    return alike.all(axis=1) | (alike & (beyond > 1)).any(axis=1)


def _following(halves: IntArray) -> IntArray:
    """The next side of the same triangle, of sides numbered 3 * triangle + corner."""
    return 3 * (halves // 3) + (halves % 3 + 1) % 3


def _corner_normals(
    points: FloatArray, triangles: IntArray, area: FloatArray, normal: FloatArray, smooth: IntArray
) -> FloatArray:
    """Unit normal ``(3 m, 3)`` at each triangle's corners: the mean over the faces joined across smooth edges."""
    before, after = smooth.T
    links = np.concatenate([np.stack([before, _following(after)], 1), np.stack([_following(before), after], 1)])
    group = components(links, triangles.size)
    weight = (corner_angles(points, triangles) * np.einsum("md,md->m", area, area)[:, None]).ravel()
    total = np.stack([np.bincount(group, weight * np.repeat(normal[:, d], 3)) for d in range(3)], axis=1)
    return (total / np.maximum(np.linalg.norm(total, axis=1), 1e-300)[:, None])[group]


def _tangent(chord: FloatArray, first: FloatArray, second: FloatArray) -> FloatArray:
    """Part of the ``chord (e, 3)`` that lies in the tangent planes with the normals of both sides of an edge."""
    length = np.linalg.norm(chord, axis=1)[:, None]
    off = np.abs(np.stack([np.einsum("ed,ed->e", chord, n) for n in (first, second)])).max(axis=0)
    steep = off > STEEPEST_EDGE * length[:, 0]
    line = np.cross(first, second)
    sine = np.linalg.norm(line, axis=1)
    line /= np.maximum(sine, 1e-300)[:, None]
    plane = chord - np.einsum("ed,ed->e", chord, first)[:, None] * first
    common = np.einsum("ed,ed->e", chord, line)[:, None] * line
    # sine of the angle below which two normals at a crease have no line in common
    tangent = np.where((sine > 0.02)[:, None], common, plane)
    flat = steep | (np.linalg.norm(tangent, axis=1)[:, None] < (1 - STEEPEST_EDGE) * length)[:, 0]
    return np.where(flat[:, None], chord, tangent)
