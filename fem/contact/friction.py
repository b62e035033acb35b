"""Friction that acts back on the contact: tangential traction while the pad is pressed, with stick and slip.

At every quadrature point of the contact face a traction ``t`` resists what the point moves along the object's surface
(on a wall: along the material point that it faced in the last accepted state)::

    d = t_0 - k (x - x_0)             x_0, t_0: of the last accepted state, k: stiffness of the regularised stick
    t = P d                where |P d| <= mu p, P = I - n n^T     (stick)
    t = mu p P d / |P d|   elsewhere                              (slip)

A point that was open at the last state starts without traction. So the result depends on the load path, as friction
does, and the path is part of the problem: it leads through the forces ``F_j = j^4 F_1`` with ``F_1`` a part of the
pad's stiffness, and from the last of them to the force that is wanted. Neither other forces nor the mesh change it. The
tangent is exact.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.friction.patch import FloatArray

# Stiffness of stick in units of E / thickness: three times as much moves e_n by up to 0.05 % and takes a third more
# Newton iterations.
STICK = 30.0
# F_1 over modulus times area of a pad. On balls, cylinders, boxes and slopes the path leaves 0.2 % of payload and e_n,
# in a waist up to 5 % where the pad just reaches its middle; with j^3 half of that, for half more solves.
FIRST_FORCE, POWER = 1e-4, 4
PATH_RESIDUAL = 1e-5  # of the force: a state of the path changes those beyond by less than this
# Part of the change since the iterate before by which the first iterations of a solve judge stick and slip. On scanned
# meshes points would slip to and fro in them: so solves take a sixth fewer iterations there, elsewhere up to 3 more.
SHARES = (0.1, 0.5)


def load_steps(reached: float, force: float, stiffness: float, stride: int = 1) -> list[float]:
    """Forces to go through from ``reached`` (0: nothing yet) to ``force`` [N]; every ``stride``-th one of the path.

    ``stiffness`` is modulus times area of a pad [N].

    >>> load_steps(0.0, 0.3, 100.0), load_steps(0.2, 0.3, 100.0)
    ([0.01, 0.16, 0.3], [0.3])
    """
    # what lies nearer than rounding is the force itself
    last = int(((1.0 - 1e-9) * force / (FIRST_FORCE * stiffness)) ** (1.0 / POWER)) // stride
    path = (FIRST_FORCE * stiffness * (stride * j) ** POWER for j in range(1, last + 1))
    return [*(f for f in path if f > reached * (1.0 + 1e-9)), force]


def stick_or_slip(
    normal: FloatArray, d: FloatArray, mu: float, pressure: FloatArray, derivatives: bool,
    before: FloatArray | None = None, share: float = 1.0,
) -> tuple[FloatArray, ...]:  # fmt: skip
    """Traction ``t (..., 3)`` of points [Pa] and, if wanted, its derivatives; see the module's formulas.

    ``normal, d (..., 3)``: unit normals, and tractions that would stick [Pa]; ``pressure (...)``: nominal pressures,
    none negative [Pa]; ``before (..., 3)``: tractions of the iterate before [Pa], by which slip is judged and directed
    with a ``share`` of the change to ``d``. Derivatives are by ``d`` [-] and by the normal [Pa] ``(..., 3, 3)``, and by
    the pressure ``(..., 3)`` [-].
    """
    most = mu * pressure
    judged = d if before is None else before + share * (d - before)

    def in_plane(vector: FloatArray) -> FloatArray:
        return vector - np.einsum("...i,...i->...", normal, vector)[..., None] * normal

    trial = in_plane(d)
    slip = trial if before is None else in_plane(judged)
    size = np.linalg.norm(slip, axis=-1)
    # at zero pressure nothing sticks, and a point without a trial traction has no direction to slip in
    slips = (size > most)[..., None]
    along = slip / np.where(size > 0.0, size, 1.0)[..., None]
    t = np.where(slips, most[..., None] * along, trial)
    if not derivatives:
        return (t,)
    ratio = np.where(slips[..., 0], most / np.where(size > 0.0, size, 1.0), 1.0)[..., None, None]
    eye = np.eye(3)

    def across_slip(D: FloatArray) -> FloatArray:
        # the length of a slipping point's traction is given, so only the change across it counts
        return ratio * np.where(slips[..., None], D - along[..., :, None] * (along[..., None, :] @ D), D)

    by_d = np.where(slips[..., None], share, 1.0) * across_slip(eye - normal[..., :, None] * normal[..., None, :])
    # the tangent plane turns as the point slides, wherever the surface is curved
    v = np.where(slips, judged, d)
    across = np.einsum("...i,...i->...", normal, v)[..., None, None]
    by_normal = across_slip(-across * eye - normal[..., :, None] * v[..., None, :])
    return t, by_d, by_normal, np.where(slips & (most > 0.0)[..., None], mu * along, 0.0)


class Anchor(NamedTuple):
    """Last accepted state of one finger's points, in the frame of what it touches.

    ``at, traction (n, 3)``: places of the points, on a wall less its displacement where they faced it [m], and
    tractions [Pa]; ``closed (n,)``: whether the point pressed; ``nodes, N (n, 4)``: nodes of the wall's elements that
    they faced and shape functions there; a rigid object has none.
    """

    at: FloatArray
    traction: FloatArray
    closed: NDArray[np.bool_]
    nodes: Any = None
    N: Any = None


class Friction:
    """What friction knows of the load path: where it is measured from; and of a solve: its last step.

    A point that slips to and fro beyond its place would make Newton's method alternate for ever, with the same nodes in
    contact and the same points slipping. So steps that take most of the last one back are shortened.

    ``mu``: friction coefficient; ``stick``: stiffness of stick in units of E / thickness; ``anchors``: last accepted
    state of each finger, replaced and never changed, so that whoever keeps it can put it back; ``moved``: index of the
    unknowns that are displacements; ``before (n, 3)``: tractions with which the last step was made [Pa].
    """

    anchors: tuple[Anchor, ...]

    def __init__(self, mu: float, moved: Any) -> None:
        self.mu, self.stick, self.moved = mu, STICK, moved
        self._iteration, self.before = 0, np.empty((0, 3))

    def judging(self, x: FloatArray) -> tuple[FloatArray, float]:
        """Tractions of the iterate before ``x`` and the share of the change since with which this one is judged."""
        if not self.goes_on(x):
            self._iteration, self.before = 0, self.anchors[0].traction
        share = SHARES[self._iteration] if self._iteration < len(SHARES) else 1.0
        self._iteration += 1
        return self.before, share

    def accept(self, anchors: Sequence[Anchor]) -> None:
        """Measure what follows from these states, and begin another solve."""
        self.anchors = tuple(anchors)
        # the last step and where it led to: nowhere yet
        self._step: FloatArray = np.zeros(0)
        self._reached: FloatArray | None = None
        self._damping = 1.0

    def goes_on(self, x: FloatArray) -> bool:
        """Whether the last step led to ``x``; else another solve has begun."""
        return self._reached is not None and np.array_equal(x, self._reached)

    def shortened(self, x: FloatArray, step: FloatArray, factor: float) -> float:
        """Factor of the step from ``x``, at most the one given."""
        if not self.goes_on(x):
            self._damping = 1.0
        else:
            before, now = self._step, step[self.moved]
            # a step that takes back more than half of the last one is halved
            back = before @ now < -0.5 * (before @ before)
            # at most eight times shorter
            self._damping = max(0.5 * self._damping, 0.125) if back else min(2.0 * self._damping, 1.0)
        factor = min(factor, self._damping)
        self._step, self._reached = factor * step[self.moved], x - factor * step
        return factor
