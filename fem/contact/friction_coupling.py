"""Friction that acts back on the contact: tangential traction while the pad is pressed, with stick and slip.

At every quadrature point of the contact face a traction ``t`` resists what the point moves along the object's surface::

    d = t_0 - k (x - x_0)             x_0, t_0: of the last accepted state, k: stiffness of the regularised stick
    t = P d                where |P d| <= mu p, P = I - n n^T     (stick)
    t = mu p P d / |P d|   elsewhere                              (slip)

A point that was open at the last state starts without traction. So the result depends on the load path, as friction
does; `load_steps` divides the forces finely enough. The tangent is exact.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.assembly import gather
from softjaw.fem.contact.problem import IDLE, ContactPoints, ContactProblem, Gap
from softjaw.fem.pad.mesh import Pad

FloatArray = NDArray[np.float64]
Path = tuple[FloatArray, ...]  # accepted states, the first one first
# Stiffness of stick in units of E / thickness: three times as much moves e_n by up to 0.05 % and takes a third more
# Newton iterations.
STICK = 30.0
# Of the force from step to step, and of the first force at the first step: steps of 1.2 from 0.01 move e_n by up to
# 0.5 %, in a waist by 1 %. Growth by 2 moves it by up to 2 % there, a start at 0.1 by 0.3 %.
GROWTH, START = 1.5, 0.02
BACKWARDS = 0.5  # of the last step of Newton's method: what takes more of it back is halved
MOST_DAMPED = 0.125  # of a step of Newton's method


def load_steps(reached: float, force: float) -> list[float]:
    """Forces to go through from ``reached`` (0: nothing yet) to ``force`` [N], each at most `GROWTH` times the last.

    >>> load_steps(2.0, 4.0)
    [2.8284271247461903, 4.0]
    """
    low = reached or START * force
    # a tiny part less, or rounding of the logarithms would add a step where the ratio is an exact power
    steps = max(1, math.ceil(math.log(force / low) / math.log(GROWTH) - 1e-9))
    between = [low * (force / low) ** (k / steps) for k in range(1, steps)]
    return [*([] if reached else [low]), *between, force]


def stick_or_slip(
    normal: FloatArray, d: FloatArray, mu: float, pressure: FloatArray, derivatives: bool
) -> tuple[FloatArray, ...]:
    """Traction of points and, if wanted, its derivatives; see the module's formulas.

    Parameters
    ----------
    normal, d : (..., 3) arrays
        Unit normals, and tractions that would stick [Pa].
    mu : float
    pressure : (...) array
        Nominal pressures, none negative [Pa].

    Returns
    -------
    t : (..., 3) array
        Traction [Pa].
    by_d, by_normal : (..., 3, 3) arrays
        Its derivatives [-], [Pa].
    by_pressure : (..., 3) array
        [-]
    """
    most = mu * pressure
    across = np.einsum("...i,...i->...", normal, d)[..., None]
    trial = d - across * normal
    size = np.linalg.norm(trial, axis=-1)
    # at zero pressure nothing sticks, and a point without a trial traction has no direction to slip in
    slips = (size > most)[..., None]
    along = trial / np.where(size > 0.0, size, 1.0)[..., None]
    t = np.where(slips, most[..., None] * along, trial)
    if not derivatives:
        return (t,)
    share = np.where(slips[..., 0], most / np.where(size > 0.0, size, 1.0), 1.0)[..., None, None]
    eye = np.eye(3)

    def kept(D: FloatArray) -> FloatArray:
        # the length of a slipping point's traction is given, so only the change across it counts
        return share * np.where(slips[..., None], D - along[..., :, None] * (along[..., None, :] @ D), D)

    by_d = kept(eye - normal[..., :, None] * normal[..., None, :])
    # the tangent plane turns as the point slides, wherever the surface is curved
    by_normal = kept(-across[..., None] * eye - normal[..., :, None] * d[..., None, :])
    return t, by_d, by_normal, np.where(slips & (most > 0.0)[..., None], mu * along, 0.0)


def followed(path: Path, x: FloatArray) -> Path:
    """The accepted states of a load path with one more."""
    # a state is accepted as the end of one step, and again as the start of the next
    return path if path and np.array_equal(x, path[-1]) else (*path, x.copy())


def leading_to(path: Path, x: FloatArray) -> Path:
    """The accepted states before ``x``: what its tractions depend on."""
    return tuple(state for state in path if not np.array_equal(state, x))


class Damping:
    """Shortens steps of Newton's method that take most of the last one back.

    A point that slips to and fro beyond its place would make the method alternate for ever, with the same nodes in
    contact and the same points slipping.

    Parameters
    ----------
    moved : index
        The unknowns that are displacements.
    """

    def __init__(self, moved: slice | NDArray[np.int64]) -> None:
        self.moved = moved
        self.forget()

    def forget(self) -> None:
        """Begin another solve."""
        # the last step and where it led to: nowhere yet
        self._step: FloatArray = np.zeros(0)
        self._reached: FloatArray | None = None
        self._damping = 1.0

    def shortened(self, x: FloatArray, step: FloatArray, factor: float) -> float:
        """Factor of the step from ``x``, at most the one given."""
        if self._reached is None or not np.array_equal(x, self._reached):  # another solve has begun
            self._damping = 1.0
        else:
            before, now = self._step, step[self.moved]
            back = before @ now < -BACKWARDS * (before @ before)
            self._damping = max(0.5 * self._damping, MOST_DAMPED) if back else min(2.0 * self._damping, 1.0)
        factor = min(factor, self._damping)
        self._step, self._reached = factor * step[self.moved], x - factor * step
        return factor


class CoupledProblem(ContactProblem):
    """A pad pressed on an object with friction coefficient ``mu``; for the rest a `ContactProblem`."""

    symmetric = False  # slip grows with the pressure, but no pressure with slip

    def __init__(self, pad: Pad, gap: Gap, mu: float) -> None:
        super().__init__(pad, gap)
        self.mu, self.stick = mu, STICK * self.kappa
        self.forget()

    def forget(self) -> None:
        """Begin another load path: nothing has touched yet."""
        shape = self.pad.face_area.shape
        self._at, self._before = np.zeros((*shape, 3)), np.zeros((*shape, 3))
        self._closed = np.zeros(shape, dtype=bool)
        self._damping = Damping(slice(0, self.pad.closing_dof + 1))
        self._path: Path = ()

    def accept(self, x: FloatArray) -> None:
        """Go on from the state ``x``: its points and tractions are those that later ones are measured from."""
        # stick is measured from accepted states, not from iterates: a step that is repeated starts from the same place
        self._contact(x, tangent=False)
        self._before = self._traction(x)[0]
        pressure = self._pressure(x)
        self._at, self._closed = self._points.copy(), pressure > IDLE * pressure.max(initial=0.0)
        self._damping.forget()
        self._path = followed(self._path, x)

    def history(self, x: FloatArray) -> Path:
        """States that were accepted before ``x``: what its tractions depend on."""
        return leading_to(self._path, x)

    def residual(self, x: FloatArray) -> FloatArray:
        """As that of the frictionless problem, with the tractions' forces on the pad."""
        R = super().residual(x)
        # the contact face was not evaluated for a refused step: tractions would be those of another state
        if np.isnan(R[0]):
            return R
        pad = self.pad
        force = np.einsum("fq,qa,fqi->fia", pad.face_area, pad.face_N, self._traction(x)[0])
        return R - gather(self.dofs, force, self.size)

    def _evaluate_entries(self, x: FloatArray) -> None:
        super()._evaluate_entries(x)
        N, weight = self.pad.face_N, self.pad.face_area
        _, by_place, by_pressure = self._traction(x, derivatives=True)
        # products of shape functions times what each point adds: two matrices, of which one is the same for all facets
        (m, points), k = weight.shape, N.shape[1]
        NN = np.einsum("qa,qb->abq", N, N).reshape(k * k, points)
        K = (NN @ (weight[..., None, None] * by_place).reshape(m, points, 9)).reshape(m, k, k, 3, 3)
        self._K_uu -= K.transpose(0, 3, 1, 4, 2)
        # slip grows with the pressure, which makes the tangent unsymmetric
        entries = self._parts()[2]
        by_node = (NN @ (weight[..., None] * by_pressure)).reshape(m, k, k, 3)
        entries -= self.kappa * by_node.transpose(0, 2, 3, 1).ravel()

    def keep(self, x: FloatArray, first: bool) -> bool:
        """As that of the frictionless problem, but every accepted state changes the tangent."""
        return not first and super().keep(x, first)

    def shorten(self, x: FloatArray, step: FloatArray) -> float:
        """As that of the frictionless problem, and as `Damping` has it."""
        return self._damping.shortened(x, step, super().shorten(x, step))

    def contact_state(self, x: FloatArray) -> tuple[FloatArray, FloatArray, ContactPoints]:
        """As that of the frictionless problem, with the friction forces of the points."""
        pressure, gap, p = super().contact_state(x)
        friction = self.pad.face_area[..., None] * self._traction(x)[0]
        return pressure, gap, ContactPoints(p.position, p.normal, p.depth, p.load, friction)

    def _pressure(self, x: FloatArray) -> FloatArray:
        """Nominal pressures of the points ``(faces, points)`` [Pa], negative ones of quadratic faces cut off."""
        return np.maximum(self.pressure(x)[self.nodes] @ self.pad.face_N.T, 0.0)

    def _traction(self, x: FloatArray, derivatives: bool = False) -> tuple[FloatArray, ...]:
        """Traction on the pad ``(faces, points, 3)`` [Pa] where `_contact` was evaluated, and its derivatives.

        They are those by the points' places ``(..., 3, 3)`` [Pa/m] and by the pressure ``(..., 3)`` [-].
        """
        # the gradient of a sampled distance is not quite a unit vector, and only one makes I - n n^T a projection
        length = np.linalg.norm(self._normal, axis=-1)[..., None]
        n, closed = self._normal / length, self._closed[..., None]
        # a point that was open has stuck nowhere that its motion could be measured from
        d = np.where(closed, self._before - self.stick * (self._points - self._at), 0.0)
        t, *changes = stick_or_slip(n, d, self.mu, self._pressure(x), derivatives)
        if not derivatives:
            return (t,)
        by_d, by_normal, by_pressure = changes
        turns = (np.eye(3) - n[..., :, None] * n[..., None, :]) @ self._hessian / length[..., None]
        return t, np.where(closed[..., None], -self.stick * by_d, 0.0) + by_normal @ turns, by_pressure
