"""Contact patches on the faces of a pad: their pieces, holes and loaded rims, and the same patch on other faces."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from softjaw.fem.pad.shape import PadShape
from softjaw.friction.patch import ContactPatch
from softjaw.study.quantities import RIMS

FloatArray = NDArray[np.float64]


def topology(pressure: ArrayLike, faces: tuple[int, int]) -> dict[str, int]:
    """Pieces, holes and loaded rims of a patch.

    Parameters
    ----------
    pressure : (n,) array
        Of all faces of the pad, those across its width running fastest; without pressure a face is not loaded.
    faces : (int, int)
        Faces along the pad's length and across its width.

    Returns
    -------
    dict
        ``pieces`` (faces that touch at a corner belong together), ``holes`` (not loaded, with load all round) and
        ``rims``, a sum of `study.quantities.RIMS`.

    Examples
    --------
    >>> topology([1, 1, 1, 1, 0, 1, 1, 1, 1, 0, 0, 0], (4, 3))
    {'pieces': 1, 'holes': 1, 'rims': 13}
    """
    p = np.asarray(pressure, float).reshape(faces)
    # share of the largest pressure, up to which a face is not loaded: rounding must not make pieces
    loaded = p > 1e-6 * p.max()
    pieces = ndimage.label(loaded, np.ones((3, 3)))[1]
    # Padded, so that all that is not loaded and reaches a rim is one region, which is no hole.
    holes = ndimage.label(np.pad(~loaded, 1, constant_values=True))[1] - 1
    rows = (loaded[0], loaded[-1], loaded[:, 0], loaded[:, -1])
    rims = sum(bit for bit, row in zip(RIMS, rows, strict=True) if row.any())
    return {"pieces": pieces, "holes": holes, "rims": rims}


def of_fingers(contacts: Sequence[Any], faces: tuple[int, int]) -> dict[str, list[int]]:
    """`topology` of the patches of both fingers, keyed as in ``study.quantities``."""
    fingers = [topology(contact.patch.pressure, faces) for contact in contacts]
    return {f"fingers/{name}": [finger[name] for finger in fingers] for name in ("pieces", "holes", "rims")}


def on_faces(contact: Any, shape: PadShape) -> dict[str, FloatArray]:
    """Patch of a contact on the faces of a pad with the scene's mesh, keyed as a file has it."""
    patch, pad = contact.patch, contact.state.pad
    if pad.shape == shape:
        return {name: getattr(patch, name) for name in ("pressure", "area", "centroid", "normal")}
    edges = [[_edges(mesh, axis, pad.side_weights) for axis in (0, 1)] for mesh in (pad.shape, shape)]
    shares = [_shares(*lines) for lines in zip(*edges, strict=True)]
    return joined(patch, shares[0], shares[1])


def joined(patch: ContactPatch, along: FloatArray, across: FloatArray) -> dict[str, FloatArray]:
    """A patch on other faces, which get shares ``(faces, faces of the patch)`` of its own along length and width.

    Loads and areas are divided by these, so that sums over the patch, and moments of its loads, stay as they are;
    position and normal are means by load, or by area where there is none.
    """

    def summed(values: FloatArray) -> FloatArray:
        grid = values.reshape(along.shape[1], across.shape[1], -1)
        return np.einsum("ai,bj,ijc->abc", along, across, grid).reshape(-1, *values.shape[1:])

    def mean(values: FloatArray) -> FloatArray:
        by_load, by_area = summed(forces[:, None] * values), summed(patch.area[:, None] * values)
        return np.where(load[:, None] > 0, by_load / np.where(load > 0, load, 1.0)[:, None], by_area / area[:, None])

    forces = patch.pressure * patch.area
    load, area = summed(forces), summed(patch.area)
    normal = mean(patch.normal)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    # where those on both sides of an edge cancel, the approach is between them
    normal = np.where(length > 0, normal / np.where(length > 0, length, 1.0), [0.0, 0.0, 1.0])
    return {"pressure": load / area, "area": area, "centroid": mean(patch.centroid), "normal": normal}


def _edges(shape: PadShape, axis: int, weights: FloatArray) -> FloatArray:
    """Edges of the faces of a patch along an axis of the undeformed pad [m]."""
    lines = shape.lines(axis, False)
    inside = lines[:-1, None] + np.diff(lines)[:, None] * (np.cumsum(weights) - weights)
    return np.append(inside.ravel(), lines[-1])


def _shares(edges: FloatArray, others: FloatArray) -> FloatArray:
    """Which part ``(n, m)`` of each of ``m`` intervals between edges lies in each of ``n`` between others."""
    low, high = np.maximum(edges[:-1], others[:-1, None]), np.minimum(edges[1:], others[1:, None])
    parts = np.maximum(high - low, 0.0)
    return parts / parts.sum(axis=0)
