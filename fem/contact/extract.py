"""The contact patch of a pressed pad: small faces of the deformed contact face, unfolded to the whole pad.

Every hexahedron of the contact face gives as many faces as the contact has quadrature points on it (2 x 2, or 3 x 3 for
triquadratic ones).  A face takes point, normal and load from its quadrature point, so that sums over the patch are
the integrals of the solution: the loads add up to ``S``, their components along the approach to the normal force.
"""

from collections.abc import Sequence

import numpy as np

from softjaw.fem.contact.path import Pressed
from softjaw.fem.contact.problem import ContactPoints
from softjaw.fem.pad.mesh import Pad, along_side, face_rule
from softjaw.friction.patch import ContactPatch, FloatArray


def extract(pad: Pad, pressed: Pressed, rule: str = "") -> ContactPatch:
    """Patch of the whole pad at this state, in the pad's frame at first touch.

    Its faces are those of the quadrature points that the state was solved with, or of another of `fem.pad.mesh.RULES`.

    ``centroid`` is the deformed quadrature point, ``normal`` the object's there (pointing into the object), ``area``
    that of the deformed face and ``pressure`` the load over that area.  Faces are numbered along the width
    first, and their number does not depend on symmetry.
    """
    position, normal, load, side_weights = _points(pad, pressed.points, rule)
    load = _unfold(pad, _as_grid(pad, _non_negative(load)[..., None]), False)[..., 0].ravel()
    nodes = pressed.contact_face.reshape(*pad.contact_grid, 3)
    # each quadrature point owns the part of the facet that its weight represents, so areas and loads belong together
    for axis in range(2):
        nodes = _subdivide(nodes, axis, side_weights)
    nodes = _unfold(pad, nodes, shared=True)
    corners = np.stack([nodes[:-1, :-1], nodes[1:, :-1], nodes[1:, 1:], nodes[:-1, 1:]], axis=2).reshape(-1, 4, 3)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]), axis=1)
    return ContactPatch(
        centroid=_unfold(pad, _as_grid(pad, position), False).reshape(-1, 3),
        area=area,
        normal=-_unfold(pad, _as_grid(pad, normal), False).reshape(-1, 3),
        pressure=load / area,
        corners=corners,
    )


def turned(pad: Pad, patch: ContactPatch, signs: Sequence[float]) -> ContactPatch:
    """Patch of a pad in a frame whose axes have the other sign where ``signs (3,)`` has.

    So ``(-1, -1, 1)`` is a pad that was solved turned by half a turn about its approach, and ``(1, -1, 1)`` the other
    finger's where a plane of symmetry lies between them.
    """
    faces, back = pad.shape.patch_faces, [axis for axis in range(2) if signs[axis] < 0]

    def ordered(values: FloatArray) -> FloatArray:
        return np.flip(values.reshape(*faces, *values.shape[1:]), back).reshape(values.shape)

    # corners run round each face from the lowest x and y
    corners = np.flip([[0, 3], [1, 2]], back)[[0, 1, 1, 0], [0, 0, 1, 1]]
    return ContactPatch(
        ordered(patch.centroid) * signs, ordered(patch.area), ordered(patch.normal) * signs, ordered(patch.pressure),
        None if patch.corners is None else ordered(patch.corners)[:, corners] * signs,
    )  # fmt: skip


def _points(pad: Pad, points: ContactPoints, rule: str) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Positions, unit normals and loads at the quadrature points of a rule, and its weights along a side of a face."""
    if not rule:
        return points.position, points.normal, points.load, pad.side_weights
    N, weights = face_rule(pad.shape.per_side, rule)
    # position and pressure are polynomials in each face, and the rule has as many points as these have coefficients
    to_rule = N @ np.linalg.inv(pad.face_N)
    position, normal = (np.einsum("pq,fqi->fpi", to_rule, field) for field in (points.position, points.normal))
    solved = np.outer(pad.side_weights, pad.side_weights).ravel()
    load = np.outer(weights, weights).ravel() * (points.load / solved @ to_rule.T)
    return position, normal / np.linalg.norm(normal, axis=2, keepdims=True), load, weights


def _non_negative(load: FloatArray) -> FloatArray:
    """Loads ``(faces, points)`` without the negative parts of quadratic pressures; each hexahedron keeps its sum."""
    clipped = np.maximum(load, 0.0)
    # quadratic pressures dip below zero beside a steep rise: the sum of a facet is right, its parts need not be
    total = clipped.sum(axis=1, keepdims=True)
    return clipped * (np.maximum(load.sum(axis=1, keepdims=True), 0.0) / np.where(total > 0, total, 1.0))


def _as_grid(pad: Pad, values: FloatArray) -> FloatArray:
    """Values at the quadrature points ``(faces, points, c)`` as one grid over the meshed contact face ``(i, j, c)``."""
    nx, ny = (n // 2 if half else n for n, half in zip(pad.shape.elements, pad.symmetry, strict=False))
    k = pad.shape.per_side
    return values.reshape(nx, ny, k, k, -1).transpose(0, 2, 1, 3, 4).reshape(nx * k, ny * k, -1)


def _subdivide(grid: FloatArray, axis: int, weights: FloatArray) -> FloatArray:
    """Node positions along an axis replaced by corners of faces: sides are cut in proportion to the weights."""
    grid = np.moveaxis(grid, axis, 0)
    parts = len(weights)
    order = parts - 1  # of the shape functions along a side
    fine = along_side(parts, np.cumsum(weights) - weights)
    elements = np.stack([grid[k : len(grid) - order + k : order] for k in range(parts)], axis=1)
    inside = np.einsum("sk,nk...->ns...", fine, elements).reshape(-1, *grid.shape[1:])
    return np.moveaxis(np.concatenate([inside, grid[-1:]]), 0, axis)


def _unfold(pad: Pad, grid: FloatArray, shared: bool) -> FloatArray:
    """Mirror a grid ``(i, j, c)`` to the whole pad, vectors with sign; ``shared``: the first row is on the mirror."""
    for axis in range(2):
        if pad.symmetry[axis]:
            mirrored = np.flip(grid, axis).copy()
            if grid.shape[2] == 3:
                # vectors change sign across the mirror, loads do not; only vectors have three components here
                mirrored[..., axis] *= -1.0
            grid = np.concatenate([np.delete(mirrored, -1, axis) if shared else mirrored, grid], axis)
    return grid
