"""A soft contact somewhere on the object: where it presses, and the loads it can carry per unit normal force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.scoring.bodies import Body

FloatArray = NDArray[np.float64]


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
        # a left-handed frame would turn the torque about the normal round
        if np.abs(axes @ axes.T - np.eye(3)).max() > 1e-9 or np.linalg.det(axes) < 0:
            raise ValueError(
                f"axes is {axes.tolist()}: rows x, y, N must be perpendicular unit vectors with x cross y = N; "
                "contact_axes(N, hint) gives such rows"
            )
        axes.flags.writeable = False
        object.__setattr__(self, "axes", axes)

    def wrench_map(
        self, object_length: ArrayLike, contact_length: float, centre_of_mass: ArrayLike = (0.0, 0.0, 0.0)
    ) -> FloatArray:
        """Wrenches on the object of a unit normal force, ``f_x``, ``f_y`` and ``tau_z``.

        Parameters
        ----------
        object_length : float or (3,) array
            Length by which the arms of forces are divided, or one along each of x, y and z [m].
        contact_length : float
            Length by which the torque about the contact's normal is divided [m].
        centre_of_mass : (3,) array
            Point about which torques are taken [m].

        Returns
        -------
        (6, 4) array
            Columns as named above; rows are three forces and three torques [-].
        """
        lengths = np.asarray(object_length, float)
        for name, length in (("object_length", lengths), ("contact_length", np.asarray(contact_length, float))):
            if not np.all((length > 0) & np.isfinite(length)):
                raise ValueError(f"{name} is {length}: it must be a positive length in metres")
        arm = (self.position - _vector("centre_of_mass", centre_of_mass)) / lengths
        x, y, N = self.axes
        C, forces = np.zeros((6, 4)), np.array([N, x, y])
        C[:3, :3], C[3:, :3] = forces.T, np.cross(arm, forces).T
        C[3:, 3] = N / contact_length
        return C


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
    # a hint along N leaves rounding, whose direction means nothing
    if np.linalg.norm(x) <= 1e-9 * np.linalg.norm(towards):
        raise ValueError(f"hint {towards.tolist()} is parallel to N: take a direction across it")
    x = x / np.linalg.norm(x)
    return np.vstack([x, np.cross(normal, x), normal])


def _vector(name: str, value: ArrayLike | Sequence[float]) -> FloatArray:
    # a copy, as the caller's array is to stay writeable
    vector = np.array(value, dtype=float)
    if vector.shape != (3,) or not np.isfinite(vector).all():
        raise ValueError(f"{name} is {vector.tolist()}: expected three finite numbers")
    vector.flags.writeable = False
    return vector
