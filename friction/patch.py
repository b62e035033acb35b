"""Contact patch: the faces in contact, each with its place, size, orientation and pressure."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

FloatArray = NDArray[np.float64]
NEGLIGIBLE = 1e-9  # share of what there is, or difference [-, m, rad], that is only rounding; for decisions alone
ROUNDING = 64 * np.finfo(float).eps  # of coordinates, which makes an area in proportion to a face's size
CANCEL = 1e-6  # of what a sum of directions could reach: below it they cancel, and rounding could turn it by 1e-9


class NoContactError(ValueError):
    """The patch carries no normal force, so nothing can be said about its friction."""


@dataclass(frozen=True, eq=False)
class ContactPatch:
    """Faces of a contact area in its final, deformed configuration.

    Every array is checked, copied and made read-only; normals are scaled to unit length. All normals point to the
    same side of the patch. Faces without pressure have no effect on any quantity.

    Parameters
    ----------
    centroid : (n, 3) array
        Centres of the faces ``r`` [m].
    area : (n,) array
        Areas ``a >= 0`` [m^2].
    normal : (n, 3) array
        Normals ``n`` of any length but zero [-].
    pressure : (n,) array
        Contact pressures ``p >= 0``, normal to the faces [Pa].
    corners : (n, k, 3) array, optional
        Corners of the faces in order around each [m]; a triangle among quadrilaterals repeats its last corner.

    Raises
    ------
    NoContactError
        If the total normal force is zero.
    ValueError
        If an array has the wrong shape, a value that is not finite, a negative pressure or area, or a zero normal.

    Examples
    --------
    >>> patch = ContactPatch([[0, 0, 0]], [2e-4], [[0, 0, 3]], [5e3])
    >>> patch.normal, patch.load
    (array([[0., 0., 1.]]), array([1.]))
    """

    centroid: FloatArray
    area: FloatArray
    normal: FloatArray
    pressure: FloatArray
    corners: FloatArray | None = None

    def __post_init__(self) -> None:
        n = len(np.atleast_1d(np.asarray(self.pressure, float)))
        checked = {
            "centroid": _finite("centroid", self.centroid, (n, 3)),
            "area": _not_negative("area", self.area, n),
            "normal": _unit(_finite("normal", self.normal, (n, 3))),
            "pressure": _not_negative("pressure", self.pressure, n),
        }
        if self.corners is not None:
            # faces may have any number of corners, but all the same: those with fewer repeat their last
            k = np.shape(self.corners)[1] if np.ndim(self.corners) == 3 else 4
            checked["corners"] = _finite("corners", self.corners, (n, max(k, 3), 3))
        # read-only, because patches are shared between friction models, meshes and files
        for name, array in checked.items():
            array.flags.writeable = False
            object.__setattr__(self, name, array)
        if not self.load.any():
            text = f"the {n} faces of the patch carry zero normal force: press further, or leave this patch out"
            raise NoContactError(text)

    @property
    def load(self) -> FloatArray:
        """Normal force ``p a`` on each face, ``(n,)`` [N]."""
        return self.pressure * self.area

    @cached_property
    def area_vectors(self) -> tuple[FloatArray, FloatArray]:
        """`area_vectors` of the faces, which have corners."""
        assert self.corners is not None
        return area_vectors(self.corners)

    @cached_property
    def loaded(self) -> ContactPatch:
        """The same patch without the faces that carry no force."""
        return self.only(self.load > 0)  # exactly: no load is what the data say, and no result of a calculation

    def only(self, keep: NDArray[np.bool_]) -> ContactPatch:
        """The same patch without the faces that are not to be kept, ``(n,)``; itself if all are."""
        if keep.all():
            return self
        corners = None if self.corners is None else self.corners[keep]
        return ContactPatch(self.centroid[keep], self.area[keep], self.normal[keep], self.pressure[keep], corners)


def _finite(name: str, value: ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    array = np.array(value, dtype=float)
    if array.shape != shape:
        text = f"{name} has shape {array.shape}, expected {shape}: one row per face (the pressures give {shape[0]})"
        raise ValueError(text)
    if not np.isfinite(array).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(array))[0])
        text = f"{name}{list(index)} is {array[index]}: every value must be finite; repair or drop face {index[0]}"
        raise ValueError(text)
    return array


def _not_negative(name: str, value: ArrayLike, n: int) -> FloatArray:
    array = _finite(name, np.atleast_1d(np.asarray(value, float)), (n,))
    if (array < 0).any():
        i = int(np.argmax(array < 0))
        raise ValueError(f"{name}[{i}] is {array[i]}: it must not be negative; clip it to 0 or repair face {i}")
    return array


def _unit(normal: FloatArray) -> FloatArray:
    # Dividing by the largest component first keeps the squares of very long and very short normals in range.
    largest = np.abs(normal).max(axis=1, keepdims=True, initial=0.0)
    if (largest == 0).any():
        i = int(np.argmax(largest == 0))
        raise ValueError(f"normal[{i}] is zero: a face needs a direction; recompute or drop face {i}")
    scaled = normal / largest
    length = np.linalg.norm(scaled, axis=1, keepdims=True)
    # A unit vector is left as it is: dividing again by a length that is 1 but for rounding would change its last bit.
    with np.errstate(over="ignore"):
        unit = np.abs(largest * length - 1) <= 4 * np.finfo(float).eps
    return np.where(unit, normal, scaled / length)


def slivers(twice_area: FloatArray, error: FloatArray) -> NDArray[np.bool_]:
    """Which faces have no area, or none beyond rounding, by their `area_vectors`."""
    return np.linalg.norm(twice_area, axis=1) <= error


def area_vectors(q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Twice the area of each face along its normal, by the order of its corners, and what of it is no area."""
    last = min(3, q.shape[1] - 1)
    size = 2 * np.linalg.norm(q - q.mean(axis=1, keepdims=True), axis=2).max(axis=1)
    error = (NEGLIGIBLE * size + ROUNDING * np.linalg.norm(q, axis=2).max(axis=1)) * size
    return cross(q[:, 2] - q[:, 0], q[:, last] - q[:, 1]), error


def cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Vectors ``a x b (..., 3)`` as numpy's own has them, which takes six times as long for a few."""
    yzx, zxy = [1, 2, 0], [2, 0, 1]
    return a.take(yzx, axis=-1) * b.take(zxy, axis=-1) - a.take(zxy, axis=-1) * b.take(yzx, axis=-1)
