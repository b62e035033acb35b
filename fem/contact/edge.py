"""Where a contact ends inside the faces, and how large its pressure is: what single faces tell to first order only.

Whether a face bears is yes or no, so counted areas move in steps of whole rows. The loads along a line of faces have
moments that converge faster: where the surfaces part smoothly, pressure goes as the root of the distance to the edge,
so the moments of a stretch of loaded faces tell its length ``2 a``. With ``t`` from -1 to 1 along it::

    p = p_0 sqrt(1 - t^2) (1 + c t^2)
    <y^2> = a^2 (2 + c) / (8 + 2 c),   <y^4> / <y^2>^2 = (8 + 5 c) (4 + c) / (4 (2 + c)^2)

``c = 0`` is Hertz's pressure. The fourth moment is noisy on few faces, so it counts as far as the mesh resolves it. A
stretch from a rim of the pad, where pressure need not vanish, to a free edge at the distance ``b`` has
``p = sqrt(1 - s / b) (c_0 + c_1 s)``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import NEGLIGIBLE, ContactPatch

FloatArray = NDArray[np.float64]
RESOLVED = 0.24  # node spacing over half length at which half of the fourth moment counts (Hertz's cylinder)
FLATTEST, STEEPEST = 1.8, 2.4  # of <y^4> / <y^2>^2: an even pressure, and more than any contact has that ends smoothly
EVEN, POINTED = 7.0 / 6.0, 14.0 / 9.0  # bounds of <s^2> / <s>^2 from a rim on: c_0 = 0, and c_1 = -c_0 / b


def contact_area(patch: ContactPatch, faces: tuple[int, int]) -> float:
    """Area of the contact with its edge reconstructed inside the faces [m^2].

    Parameters
    ----------
    patch : ContactPatch
        Of a whole pad as `fem.contact.extract.extract` makes it, with corners.
    faces : (int, int)
        Its faces along length and width.

    Notes
    -----
    Lengths of loaded stretches are added up over the lines along the width and over those along the length. Each sum is
    uncertain by whole lines where the edge runs along them, so each counts by the free edge that its lines cross.
    """
    assert patch.corners is not None
    load, place = patch.load.reshape(faces), patch.centroid.reshape(*faces, 3)
    corners = patch.corners.reshape(*faces, 4, 3)
    along_x, along_y = (_sides(corners, first) for first in (((0, 1), (3, 2)), ((0, 3), (1, 2))))
    rims_y = _rims(corners[:, [0, -1]], ((0, 1), (3, 2)))
    rims_x = _rims(corners[[0, -1]].swapaxes(0, 1), ((0, 3), (1, 2)))
    across = _stretches(load, place, along_y, along_x, rims_y)
    along = _stretches(load.T, place.swapaxes(0, 1), along_x.T, along_y.T, rims_x)
    weights = [float(free @ width) for _, width, free in (across, along)]
    areas = [float(length @ width) for length, width, _ in (across, along)]
    # a face that bears up to all rims has no edge to reconstruct
    return float(np.dot(areas, weights) / sum(weights)) if sum(weights) > 0 else areas[0]


def largest_pressure(patch: ContactPatch, faces: tuple[int, int], per_side: int) -> float:
    """Largest pressure of a quadratic fitted to the loaded faces within two elements of the largest load [Pa].

    Single points of the quadrature swing about the pressure, and more so the fewer faces bear. Where the pressure is
    singular, at a sharp end of the object under the pad, the fit is a mean over these elements and no value at a point.
    ``per_side`` faces lie along a side of an element; other parameters as for `contact_area`.
    """
    load, area = patch.load.reshape(faces), patch.area.reshape(faces)
    place = patch.centroid.reshape(*faces, 3)[..., :2]
    # four faces together hold the whole load of a node, and of Gauss points the mean of an element or between two
    mean = _four(load) / _four(area)
    i, j = divmod(int(mean.argmax()), mean.shape[1])
    near, inner = (_about(i, j, reach * per_side) for reach in (2, 1))
    on = load[near] > NEGLIGIBLE * load.max()
    middle, size = place[i : i + 2, j : j + 2].mean(axis=(0, 1)), np.ptp(place[near], axis=(0, 1))
    root = np.sqrt(area[near][on])
    terms = _terms((place[near][on] - middle) / size)
    # loads tell no coefficient below this part of the largest singular value
    fit, *_ = np.linalg.lstsq(terms * root[:, None], (load / area)[near][on] * root, rcond=1e-6)
    # far from the largest load, and where nothing bears, a quadratic says nothing
    at = place[inner][load[inner] > NEGLIGIBLE * load.max()]
    return float((_terms((at - middle) / size) @ fit).max())


def _about(i: int, j: int, reach: int) -> tuple[slice, slice]:
    """Faces up to ``reach`` to each side of where four meet."""
    return slice(max(i + 1 - reach, 0), i + 1 + reach), slice(max(j + 1 - reach, 0), j + 1 + reach)


def _terms(place: FloatArray) -> FloatArray:
    """Terms of a quadratic at places ``(n, 2)``, ``(n, 6)``."""
    x, y = place.T
    return np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=-1)


def _four(values: FloatArray) -> FloatArray:
    """Sums over two by two neighbouring faces ``(nx - 1, ny - 1)``."""
    return values[:-1, :-1] + values[1:, :-1] + values[:-1, 1:] + values[1:, 1:]


def _sides(corners: FloatArray, sides: tuple[tuple[int, int], ...]) -> FloatArray:
    """Mean length of two opposite sides of every face [m]."""
    return np.mean([np.linalg.norm(corners[..., b, :] - corners[..., a, :], axis=-1) for a, b in sides], axis=0)


def _rims(ends: FloatArray, sides: tuple[tuple[int, int], ...]) -> FloatArray:
    """Middles ``(lines, 2, 3)`` of the outer sides of the first and last face of every line."""
    return np.stack([ends[:, k, list(side)].mean(axis=1) for k, side in enumerate(sides)], axis=1)


def _stretches(
    load: FloatArray, place: FloatArray, side: FloatArray, width: FloatArray, rims: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Loaded stretches of the lines along the second axis of a grid, each ``(stretches,)``.

    ``place (lines, faces, 3)``, ``side`` of the faces along the lines and ``width`` across them [m]. Returned are the
    length with the edges inside the faces [m], the mean width by load [m], and the number of ends that are no rim of
    the pad.
    """
    steps = np.diff(place, axis=1, prepend=rims[:, :1], append=rims[:, 1:])
    from_rim = np.cumsum(np.linalg.norm(steps, axis=2), axis=1)
    on = load > NEGLIGIBLE * load.max()
    beside = np.pad(on, ((0, 0), (1, 1)))
    first, last = on & ~beside[:, :-2], on & ~beside[:, 2:]
    low, high = np.nonzero(first)[1] == 0, np.nonzero(last)[1] == on.shape[1] - 1
    starts = np.flatnonzero(first[on])
    ends = np.flatnonzero(last[on])
    count = ends - starts + 1
    # from the rim that a stretch begins at, if only one does
    reverse = np.repeat(high & ~low, count)
    s = np.where(reverse, (from_rim[:, -1:] - from_rim[:, :-1])[on], from_rim[:, :-1][on])
    force, mean, square = (np.add.reduceat(v, starts) for v in (load[on], load[on] * s, load[on] * s**2))
    mean, square = mean / force, square / force
    z = s - np.repeat(mean, count)
    variance, fourth = (np.add.reduceat(load[on] * z**k, starts) / force for k in (2, 4))
    # two faces share a node, so the closest nodes are two of the smallest faces apart
    spacing, full = 2.0 * np.minimum.reduceat(side[on], starts), np.add.reduceat(side[on], starts)
    length = np.where(low | high, _from_rim(mean, square, spacing), _between_edges(variance, fourth, spacing))
    # the first idle node is not in contact; beside a rim, where pressure may be singular, all but the last ones are
    inner = np.where(low, s[np.maximum(ends - 1, starts)], s[np.minimum(starts + 1, ends)]) * (low | high)
    length = np.where(low & high, full, np.clip(length, inner - 0.5 * spacing, full + spacing))
    return length, np.add.reduceat(load[on] * width[on], starts) / force, 2.0 - low - high


def _between_edges(variance: FloatArray, fourth: FloatArray, spacing: FloatArray) -> FloatArray:
    """Length of stretches with two free edges [m], from the central moments of their loads [m^2, m^4]."""
    # the load of one node alone is spread over the node's share of the face
    variance = np.maximum(variance, spacing**2 / 12.0)
    kurtosis = fourth / variance**2
    trust = 1.0 / (1.0 + (spacing / (2.0 * np.sqrt(variance)) / RESOLVED) ** 4)
    k = 2.0 + trust * (np.clip(kurtosis, FLATTEST, STEEPEST) - 2.0)
    a, b, c = 4.0 * k - 5.0, 16.0 * k - 28.0, 16.0 * k - 32.0
    shape = (-b + np.sqrt(np.maximum(b**2 - 4.0 * a * c, 0.0))) / (2.0 * a)
    return 2.0 * np.sqrt(variance * (8.0 + 2.0 * shape) / (2.0 + shape))


def _from_rim(mean: FloatArray, square: FloatArray, spacing: FloatArray) -> FloatArray:
    """Length of stretches from a rim to a free edge [m], from the moments of their loads about the rim [m, m^2]."""
    # as between edges: a node on the rim alone has the share of one side
    mean = np.maximum(mean, spacing / 4.0)
    ratio = np.clip(square / mean**2, EVEN + 1e-6, POINTED)
    # <s> / b = (14 + 8 c) / (35 + 14 c) and <s^2> / b^2 = (24 + 16 c) / (105 + 42 c) with c = c_1 b / c_0
    a, b, c = 192.0 * ratio - 224.0, 672.0 * ratio - 896.0, 588.0 * ratio - 840.0
    shape = (-b + np.sqrt(np.maximum(b**2 - 4.0 * a * c, 0.0))) / (2.0 * a)
    return mean * (35.0 + 14.0 * shape) / (14.0 + 8.0 * shape)
