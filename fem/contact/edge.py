"""Where a contact ends inside the faces, and how large its pressure is: what single faces tell to first order only.

Whether a face bears is yes or no, so counted areas move in steps of whole rows. The loads along a line of faces have
moments that converge faster: where the surfaces part smoothly, pressure goes as the root of the distance to the edge,
so the moments of a stretch of loaded faces tell its length ``2 a``. With ``t`` from -1 to 1 along it::

    p = p_0 sqrt(1 - t^2) (1 + c t^2)
    <y^2> = a^2 (2 + c) / (8 + 2 c),   <y^4> / <y^2>^2 = (8 + 5 c) (4 + c) / (4 (2 + c)^2)

``c = 0`` is Hertz's pressure. Under a pad much thinner than the contact is wide pressure goes as the depth, as
``1 - t^2``, whose ratio is 15 / 7, and foam that gets stiffer makes it steeper. At an edge of the object pressure rises
before it falls, and the fourth moment is small. A mesh that does not resolve how the edge is rounded meets it as a
sharp one, with::

    p = p_0 (1 - t^2)^q
    <y^2> = a^2 / (2 q + 3),   <y^4> / <y^2>^2 = 3 (2 q + 3) / (2 q + 5)

``q = 0`` is an even pressure, ``q = -1/2`` that of a punch. The fourth moment is noisy on few faces, so it counts as
far as the mesh resolves it, in place of what is expected. A stretch that such edges would lead to a rim of the pad or
beyond, where pressure need not vanish, ends there; to its free edge at the distance ``b`` it has
``p = sqrt(1 - s / b) (c_0 + c_1 s)``.
"""

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import NEGLIGIBLE, ContactPatch, FloatArray

# Node spacing over half length at which half of the fourth moment counts: of Hertz's cylinder, and of a box's face; and
# at which an edge of the object is half a sharp one, half a round one.
RESOLVED, EDGE_RESOLVED, ROUND = 0.24, 0.5, 0.1
THIN = 2.0  # half width of the contact over the pad's thickness at which pressure is half Hertz's, half the depth's
FLATTEST, STEEPEST = 1.5, 2.4  # of <y^4> / <y^2>^2: a punch's, and more than any contact has that ends smoothly
EVEN, POINTED = 7.0 / 6.0, 14.0 / 9.0  # bounds of <s^2> / <s>^2 from a rim on: c_0 = 0, and c_1 = -c_0 / b


def contact_area(patch: ContactPatch, faces: tuple[int, int], thickness: float) -> float:
    """Area of the contact with its edge reconstructed inside the faces [m^2].

    ``patch``: of a whole pad as `fem.contact.extract.extract` makes it, with corners; ``faces``: its faces along length
    and width; ``thickness``: of the pad [m].

    A face bears as far as both lines of faces through it say, that along the width and that along the length: a line
    beside an edge that it runs along is loaded as a whole, and only those across it tell how much of it bears.
    """
    assert patch.corners is not None
    load, area, place = patch.load.reshape(faces), patch.area.reshape(faces), patch.centroid.reshape(*faces, 3)
    corners = patch.corners.reshape(*faces, 4, 3)
    # corners run round each face from the lowest x and y
    low_x, high_x, low_y, high_y = (corners[..., pair, :].mean(axis=-2) for pair in ([0, 3], [1, 2], [0, 1], [3, 2]))
    across = _bearing(load, place, low_y, high_y, thickness)
    along = _bearing(load.T, place.swapaxes(0, 1), low_x.swapaxes(0, 1), high_x.swapaxes(0, 1), thickness).T
    return float((np.minimum(across, along) * area).sum())


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


def _bearing(
    load: FloatArray, place: FloatArray, low: FloatArray, high: FloatArray, thickness: float
) -> FloatArray:  # fmt: skip
    """Share of each face ``(lines, faces)`` that bears by the line through it along the second axis.

    ``low, high (lines, faces, 3)`` are the middles of both sides of a face that the line crosses.
    """
    along = high - low
    side = np.linalg.norm(along, axis=2)
    upper = np.cumsum(side, axis=1)
    lower = upper - side
    s = lower + np.einsum("ijc,ijc->ij", place - low, along) / side
    on = load > NEGLIGIBLE * load.max()
    beside = np.pad(on, ((0, 0), (1, 1)))
    first, last = on & ~beside[:, :-2], on & ~beside[:, 2:]
    starts, ends = np.flatnonzero(first[on]), np.flatnonzero(last[on])
    # two faces share a node, so the closest nodes are two of the smallest faces apart
    spacing = 2.0 * np.minimum.reduceat(side[on], starts)
    lengths = np.broadcast_to(upper[:, -1:], on.shape)[first]
    at_rims = np.nonzero(first)[1] == 0, np.nonzero(last)[1] == on.shape[1] - 1
    begin, end = _edges(load[on], s[on], starts, ends, spacing, lengths, at_rims, thickness)
    # where the middle by load is not that of the stretch, one edge lies beyond the loaded faces
    free = (begin > 0.0) & (end < lengths)
    shift = np.maximum(lower[first] - begin, 0.0) - np.maximum(end - upper[last], 0.0)
    begin, end = (np.repeat(edge + free * shift, ends - starts + 1) for edge in (begin, end))
    share = np.zeros(load.shape)
    share[on] = (np.minimum(upper[on], end) - np.maximum(lower[on], begin)) / side[on]
    return np.clip(share, 0.0, 1.0)


def _edges(
    load: FloatArray, s: FloatArray, starts: NDArray[np.intp], ends: NDArray[np.intp], spacing: FloatArray,
    lengths: FloatArray, at_rims: tuple[NDArray[np.bool_], NDArray[np.bool_]], thickness: float,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Both edges of loaded stretches [m], from the loads of their faces at distances ``s`` from a rim [m].

    ``starts, ends`` of the stretches among the faces, ``lengths`` of their lines [m].
    """
    force = np.add.reduceat(load, starts)
    mean = np.add.reduceat(load * s, starts) / force
    z = s - np.repeat(mean, ends - starts + 1)
    variance, fourth = (np.add.reduceat(load * z**k, starts) / force for k in (2, 4))
    half = 0.5 * _between_edges(variance, fourth, spacing, thickness)
    # a quarter of the spacing from a rim: an even pressure on few faces ends a little before it
    low, high = (rim & (to - half < 0.25 * spacing) for rim, to in zip(at_rims, (mean, lengths - mean), strict=True))
    # the first idle node is not in contact; beside a rim, where pressure may be singular, all but the last ones are
    b = np.maximum(_from_rim(mean, variance + mean**2, spacing), s[np.maximum(ends - 1, starts)] - 0.5 * spacing)
    from_other = _from_rim(lengths - mean, variance + (lengths - mean) ** 2, spacing)
    c = np.minimum(lengths - from_other, s[np.minimum(starts + 1, ends)] + 0.5 * spacing)
    begin = np.where(low, 0.0, np.where(high, c, mean - half))
    return begin, np.where(high, lengths, np.where(low, b, mean + half))


def _between_edges(variance: FloatArray, fourth: FloatArray, spacing: FloatArray, thickness: float) -> FloatArray:
    """Length of stretches with two free edges [m], from the central moments of their loads [m^2, m^4]."""
    # the load of one node alone is spread over the node's share of the face
    variance = np.maximum(variance, spacing**2 / 12.0)
    half = 2.0 * np.sqrt(variance)  # of Hertz's contact
    coarse = spacing / half
    beyond = np.clip(fourth / variance**2, FLATTEST, STEEPEST) - 2.0  # what Hertz's pressure has
    edged = beyond < 0.0
    thin = ~edged / (1.0 + (THIN * thickness / half) ** 4)
    resolved = np.where(edged, EDGE_RESOLVED, RESOLVED * (1.0 + thin))
    k = 2.0 + thin / 7.0 + (beyond - thin / 7.0) / (1.0 + (coarse / resolved) ** 4)
    a, b, c = 4.0 * k - 5.0, 16.0 * k - 28.0, 16.0 * k - 32.0
    shape = (-b + np.sqrt(np.maximum(b**2 - 4.0 * a * c, 0.0))) / (2.0 * a)
    smooth = (8.0 + 2.0 * shape) / (2.0 + shape)  # a^2 / <y^2>
    sharp = edged / (1.0 + (ROUND / coarse) ** 4)
    return 2.0 * np.sqrt(variance * (smooth + sharp * (2.0 * k / (3.0 - k) - smooth)))


def _from_rim(mean: FloatArray, square: FloatArray, spacing: FloatArray) -> FloatArray:
    """Length of stretches from a rim to a free edge [m], from the moments of their loads about the rim [m, m^2]."""
    # as between edges: a node on the rim alone has the share of one side
    mean = np.maximum(mean, spacing / 4.0)
    ratio = np.clip(square / mean**2, EVEN + 1e-6, POINTED)
    # <s> / b = (14 + 8 c) / (35 + 14 c) and <s^2> / b^2 = (24 + 16 c) / (105 + 42 c) with c = c_1 b / c_0
    a, b, c = 192.0 * ratio - 224.0, 672.0 * ratio - 896.0, 588.0 * ratio - 840.0
    shape = (-b + np.sqrt(np.maximum(b**2 - 4.0 * a * c, 0.0))) / (2.0 * a)
    return mean * (35.0 + 14.0 * shape) / (14.0 + 8.0 * shape)
