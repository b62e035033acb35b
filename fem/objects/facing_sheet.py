"""The part of a mesh that faces a finger, as an open sheet of small triangles, and the signed distance to it.

A pad that comes along the approach a, and gives way sideways as it is pressed, reaches what straight lines reach whose
direction lies within ``CONE`` of a. So the object *for this finger* is the set of points that no such line reaches from
outside: cavities, inner walls, and whatever lies behind the surface that the finger sees, are its inside. ``g`` is the
signed distance to the border of this set. Where the border is the object's own surface (the sheet) g is exact for the
smooth triangles; the rest of the border are shadow lines behind the object, which start where the surface turns away
from a by more than 90 degrees + ``CONE`` and are located to half a step of the grid.

The lines are tried in 1 + 8 + 8 directions: a itself and two cones round it, placed so that the mirror images of the
pad's frame map them onto each other. A triangle that only slanted lines reach and that has the seen surface close
behind its back is the back of a thin wall (the inside of a bowl's rim) and is left out.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.ndimage import distance_transform_edt, gaussian_filter

from softjaw.fem.objects.gap import Pose
from softjaw.fem.objects.smooth_triangles import SmoothTriangles
from softjaw.fem.objects.splines import between
from softjaw.fem.objects.triangle_tree import DEPTH, TriangleTree, first_hit, hits
from softjaw.friction.patch import FloatArray

CONE = np.radians(30.0)
BOX_MARGIN = 0.5  # of the box's depth: triangles so far beside the box still count
COARSE = 4  # steps of the grid between samples that are taken far from the sheet
STAIRS = 1.5  # steps of the grid over which shadow lines are smoothed


def lines_of_sight(pose: Pose) -> FloatArray:
    """Directions ``(17, 3)`` in the object's frame; the approach comes first."""
    ring = np.arange(8) * np.pi / 4
    rows = [[0.0, 0.0, 1.0]]
    for tilt in (CONE, CONE / 2):
        rows += [[np.sin(tilt) * np.cos(phi), np.sin(tilt) * np.sin(phi), np.cos(tilt)] for phi in ring]
    return np.array(rows) @ pose.rotation.T


@njit(cache=True)
def _seen(which, normals, sides, directions, spacing, rotation, origin, lower, upper, lift, nodes):
    """How each triangle is seen at some place in the box: 2 straight, 1 on a slant, 0 not at all; negative: its back.

    ``sides`` is 2 where backs of triangles can be seen, too.
    """
    corners = nodes[0]
    stack, spot, backwards = np.empty(DEPTH, np.int64), np.empty(3), -directions
    visibility, hides = np.zeros(len(which), np.int64), np.zeros(len(directions), np.int64)
    for m in range(len(which)):
        p, normal = corners[which[m]], normals[which[m]]
        longest = 0.0
        for k in range(3):
            longest = max(longest, ((p[(k + 1) % 3] - p[k]) ** 2).sum())
        # many spots on a large triangle: a part of it may be hidden by another piece
        # places along one side of a triangle that are looked at
        n = min(max(int(np.ceil(np.sqrt(longest) / spacing)), 1), 40)
        for i in range(n * n):
            b, c = (i // n + 1.0 / 3.0) / n, (i % n + 1.0 / 3.0) / n
            if abs(visibility[m]) == 2 or b + c >= 1.0:
                continue
            for s in range(sides):
                sign, inside = 1.0 - 2.0 * s, abs(visibility[m]) < 2
                for d in range(3):
                    spot[d] = p[0, d] + b * (p[1, d] - p[0, d]) + c * (p[2, d] - p[0, d]) + sign * lift * normal[d]
                # component by component: an array of three takes as long to make as a line takes to follow
                for d in range(3):
                    y = 0.0
                    for k in range(3):
                        y += (spot[k] - origin[k]) * rotation[k, d]
                    inside = inside and lower[d] <= y <= upper[d]
                if not inside:
                    continue
                for k in range(len(directions)):
                    # seen on a slant already: only the straight line, which comes first, can tell more
                    if visibility[m] != 0 and k > 0:
                        break
                    back = backwards[k]
                    # a line at a smaller sine to a triangle runs along it and does not see it
                    if sign * (normal[0] * back[0] + normal[1] * back[1] + normal[2] * back[2]) < 0.01:
                        continue
                    # what hid the spot before mostly hides this one, too
                    if hides[k] != which[m] and 0.0 < hits(spot, back, corners, hides[k]) < np.inf:
                        continue
                    hit = first_hit(spot, back, 0.0, which[m], True, nodes, stack)[1]
                    if hit >= 0:
                        hides[k] = hit
                    else:
                        visibility[m] = sign * (2 if k == 0 else 1)
                        break
    return visibility


class FacingSheet(NamedTuple):
    """What a finger sees of a ``mesh`` along ``directions (k, 3)``, away from it: small triangles of its surface."""

    sheet: TriangleTree
    mesh: TriangleTree
    directions: FloatArray

    def signed(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Signed distance ``(n,)`` [m] to the sheet and its unit gradient ``(n, 3)``; in a shadow it is negative."""
        g, normal, border = self.sheet.signed(x)
        if border.any():
            # pseudo-normals fail at the border of an open sheet, so lines of sight decide the sign
            out = np.zeros(np.count_nonzero(border), dtype=bool)
            for direction in self.directions:
                hidden = np.flatnonzero(~out)
                out[hidden] = np.isinf(self.mesh.along(x[border][hidden], -direction))
            turn = np.where(out == (g[border] >= 0), 1.0, -1.0)
            g[border] *= turn
            normal[border] *= turn[:, None]
        return g, normal

    def sampled(self, x: FloatArray, step: float) -> FloatArray:
        """Signed distance at the points ``(n_0, n_1, n_2, 3)`` of an even grid, to shadow lines as well [m].

        Far from the sheet every ``COARSE``-th sample is taken and the rest interpolated; the grid has to end on one.
        """
        part = (slice(None, None, COARSE),) * 3
        known = self.signed(x[part].reshape(-1, 3))[0].reshape(x[part].shape[:3])
        known = _with_shadows(known, COARSE * step, STAIRS / COARSE)
        g = between(known, COARSE)
        # contact is decided near the sheet, so no sample is interpolated there
        near = np.abs(g) < 3 * step  # steps from the sheet within which every sample is taken
        g[near] = self.signed(x[near])[0]
        return _with_shadows(g, step, STAIRS)


def _with_shadows(g: FloatArray, step: float, stairs: float) -> FloatArray:
    """Distances ``g`` to the sheet, on an even grid, no larger than those to the shadow lines between the samples.

    The shadow lines come out in stairs of the grid; where they are nearest, and the sheet is not near, these are
    smoothed over ``stairs`` steps.
    """
    shadow = np.zeros(g.shape, dtype=bool)
    for axis in range(3):
        first, second = (tuple([slice(None)] * axis + [part]) for part in (slice(None, -1), slice(1, None)))
        # a sign that changes farther from the sheet than the sheet could explain
        change = ((g[first] < 0) != (g[second] < 0)) & (np.abs(g[first]) + np.abs(g[second]) > (1 + 1e-6) * step)
        shadow[first] |= change
        shadow[second] |= change
    if not shadow.any():
        return g
    # the shadow line runs between two marked samples, half a step from either
    away = step * (distance_transform_edt(~shadow) + 0.5)
    bound = np.where(g < 0, -1.0, 1.0) * np.minimum(np.abs(g), away)
    rough = np.clip(np.abs(g) / step - 1.0, 0.0, 1.0) * np.clip((np.abs(g) - away) / step, 0.0, 1.0)
    return bound + rough * (gaussian_filter(bound, stairs, mode="nearest") - bound)


def facing_sheet(
    smooth: SmoothTriangles, mesh: TriangleTree, closed: bool, pose: Pose, box: FloatArray, step: float
) -> FacingSheet:
    """What a finger at ``pose`` sees of triangles in the ``box (2, 3)`` of its frame [m].

    A little beside it, too. ``closed``: whether they are closed surfaces that are turned outwards; the backs of others
    count as well. ``step`` is that of the grid on which the distance is to be sampled [m].
    """
    depth = box[1, 2] - box[0, 2]
    lower, upper = box[0] - BOX_MARGIN * depth, box[1] + BOX_MARGIN * depth
    y = pose.to_pad(mesh.points)[mesh.triangles]
    near = np.flatnonzero(((y.max(axis=1) >= lower) & (y.min(axis=1) <= upper)).all(axis=1))
    normals = mesh.face_normals
    # share of the mesh's size: how far above a triangle a line of sight starts
    lines, lift = lines_of_sight(pose), 1e-7 * float(np.ptp(mesh.points, axis=0).max())
    R = np.ascontiguousarray(pose.rotation)
    how = _seen(near, normals, 1 if closed else 2, lines, 2 * step, R, pose.origin, lower, upper, lift, mesh.nodes)
    side = np.ones(len(normals))
    side[near[how < 0]] = -1.0
    straight = np.zeros(len(normals), dtype=bool)
    straight[near[np.abs(how) == 2]] = True
    slanted = near[np.abs(how) == 1]
    far, hit = mesh.behind(slanted, side[slanted, None] * normals[slanted], lift)
    # without a hit the index is -1, which does no harm: the distance is infinite then
    # share of the box's depth: a wall thinner than this has one side only
    slanted = slanted[~(straight[hit] & (far < (1 / 3) * depth))]
    chosen = np.union1d(np.flatnonzero(straight), slanted)
    # nothing faces the finger here, and the whole mesh keeps the distance defined
    if not len(chosen):
        return FacingSheet(mesh, mesh, lines)
    # share of the grid's step: how well flat pieces follow the smooth triangles
    pieces = smooth.pieces_for(chosen, (1 / 200) * step)
    x, small = smooth.refined(chosen, pieces)
    back = np.repeat(side[chosen] < 0, pieces**2)
    return FacingSheet(TriangleTree(x, np.where(back[:, None], small[:, ::-1], small)), mesh, lines)
