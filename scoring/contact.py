"""A soft contact somewhere on the object: where it presses, and the loads it can carry per unit normal force."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.scoring.polytope import polytope_volume

FloatArray = NDArray[np.float64]


class Body(Protocol):
    """Limit surface in ``(f_x, f_y, tau_z)`` per unit normal force, with 0 inside or on it.

    A body that has ``vertices (k, 3)`` counts as their hull, one of ``degree`` 2 as an ellipsoid about 0.
    """

    @property
    def volume(self) -> float:
        """Volume."""

    @property
    def shadow_area(self) -> float:
        """Area of the shadow on the first two coordinates."""

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, 3) -> (m,)``."""


@dataclass(frozen=True, eq=False)
class EllipsoidBody:
    """Axis-aligned ellipsoid; an axis along which nothing is carried has length 0.

    Parameters
    ----------
    semi_axes : (3,) array
        ``(f_x, f_y, tau_z)`` per unit normal force [-, -, m].

    Examples
    --------
    >>> EllipsoidBody([1.0, 2.0, 0.0]).support([[0, 1, 0], [0, 0, 1]]).tolist()
    [2.0, 0.0]
    """

    semi_axes: FloatArray
    degree = 2

    def __post_init__(self) -> None:
        """Refuse what is no length."""
        axes = _vector("semi_axes", self.semi_axes)
        if (axes < 0).any():
            raise ValueError(
                f"semi_axes is {axes.tolist()}: no semi-axis can be negative; take 0 where none is carried"
            )
        object.__setattr__(self, "semi_axes", axes)

    @property
    def volume(self) -> float:
        """Volume ``4/3 pi f_x f_y tau_z``."""
        return 4 / 3 * math.pi * float(self.semi_axes.prod())

    @property
    def shadow_area(self) -> float:
        """Area ``pi f_x f_y`` of the shadow on the plane of the forces."""
        return math.pi * float(self.semi_axes[0] * self.semi_axes[1])

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, 3) -> (m,)``."""
        return np.linalg.norm(np.atleast_2d(np.asarray(t, float)) * self.semi_axes, axis=1)


@dataclass(frozen=True, eq=False)
class PolytopeBody:
    """Hull of wrenches, such as samples of a limit surface or the vertices of a linearised one.

    Parameters
    ----------
    vertices : (k, 3) array
        ``(f_x, f_y, tau_z)`` per unit normal force [-, -, m]; 0 must not lie outside.
    """

    vertices: FloatArray

    def __post_init__(self) -> None:
        """Refuse what is no set of wrenches."""
        points = np.array(self.vertices, dtype=float)
        if points.ndim != 2 or points.shape[1] != 3 or len(points) == 0 or not np.isfinite(points).all():
            raise ValueError(f"vertices has shape {points.shape}: expected finite wrenches, (k, 3)")
        points.flags.writeable = False
        object.__setattr__(self, "vertices", points)

    @cached_property
    def _sizes(self) -> tuple[float, float]:
        return polytope_volume(self.vertices)

    @property
    def volume(self) -> float:
        """Volume of the hull."""
        return self._sizes[0]

    @property
    def shadow_area(self) -> float:
        """Area of the hull's shadow on the plane of the forces."""
        return self._sizes[1]

    def support(self, t: ArrayLike) -> FloatArray:
        """Largest ``w . t`` over the body, ``(m, 3) -> (m,)``."""
        return (np.atleast_2d(np.asarray(t, float)) @ self.vertices.T).max(axis=1)


@dataclass(frozen=True, eq=False)
class SoftContact:
    """A finger's contact with the object.

    Parameters
    ----------
    position : (3,) array
        Origin of the contact frame [m].
    axes : (3, 3) array
        Rows x, y, N: unit vectors of a right-handed frame; the finger presses along N, into the object.
    body : Body
        Limit surface in that frame, per unit normal force.
    """

    position: FloatArray
    axes: FloatArray
    body: Body

    def __post_init__(self) -> None:
        """Refuse a frame that is none."""
        object.__setattr__(self, "position", _vector("position", self.position))
        axes = np.array(self.axes, dtype=float)
        if axes.shape != (3, 3) or not np.isfinite(axes).all():
            raise ValueError(f"axes has shape {axes.shape}: expected three rows x, y, N of finite numbers")
        if np.abs(axes @ axes.T - np.eye(3)).max() > 1e-9 or np.linalg.det(axes) < 0:
            raise ValueError(
                f"axes is {axes.tolist()}: rows x, y, N must be perpendicular unit vectors with x cross y = N; "
                "contact_axes(N, hint) gives such rows"
            )
        axes.flags.writeable = False
        object.__setattr__(self, "axes", axes)

    def wrench_map(
        self, object_length: float, contact_length: float, centre_of_mass: ArrayLike = (0.0, 0.0, 0.0)
    ) -> FloatArray:
        """Wrenches on the object of a unit normal force, ``f_x``, ``f_y`` and ``tau_z``.

        Parameters
        ----------
        object_length : float
            Length by which the torques of forces are divided [m].
        contact_length : float
            Length by which the torque about the contact's normal is divided [m].
        centre_of_mass : (3,) array
            Point about which torques are taken [m].

        Returns
        -------
        (6, 4) array
            Columns as named above; rows are three forces and three torques [-].
        """
        for name, length in (("object_length", object_length), ("contact_length", contact_length)):
            if not 0 < length < math.inf:
                raise ValueError(f"{name} is {length}: it must be a positive length in metres")
        arm = (self.position - _vector("centre_of_mass", centre_of_mass)) / object_length
        x, y, N = self.axes
        C = np.zeros((6, 4))
        for column, force in enumerate((N, x, y)):
            C[:3, column], C[3:, column] = force, np.cross(arm, force)
        C[3:, 3] = N / contact_length
        return C

    def cone_support(self, C: FloatArray, u: ArrayLike) -> FloatArray:
        """Largest ``u . w`` of the wrenches for normal forces in [0, 1], ``(m, 6) -> (m,)``; ``C`` is a wrench map."""
        felt = np.atleast_2d(np.asarray(u, float)) @ C
        return np.maximum(0.0, felt[:, 0] + self.body.support(felt[:, 1:]))


def contact_axes(N: ArrayLike, hint: ArrayLike) -> FloatArray:
    """Rows x, y, N of a contact frame whose x is the hint, projected on the plane across N.

    Parameters
    ----------
    N : (3,) array
        Direction in which the finger presses, of any length.
    hint : (3,) array
        Direction near x, not parallel to N.

    Examples
    --------
    >>> contact_axes([2, 0, 0], hint=[1, 0, 1]).tolist()
    [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]
    """
    normal, towards = _vector("N", N), _vector("hint", hint)
    length = np.linalg.norm(normal)
    if length == 0:
        raise ValueError("N is zero: a contact presses in some direction")
    normal = normal / length
    x = towards - (towards @ normal) * normal
    if np.linalg.norm(x) <= 1e-9 * np.linalg.norm(towards):
        raise ValueError(f"hint {towards.tolist()} is parallel to N: take a direction across it")
    x = x / np.linalg.norm(x)
    return np.vstack([x, np.cross(normal, x), normal])


def _vector(name: str, value: ArrayLike | Sequence[float]) -> FloatArray:
    vector = np.array(value, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"{name} is {vector.tolist()}: expected three finite numbers")
    vector.flags.writeable = False
    return vector
