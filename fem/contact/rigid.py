"""Contact of a pad with a rigid object: the tangent of `fem.contact.problem`, also in a symmetric form."""

from collections.abc import Callable
from copy import copy
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from softjaw.fem.assembly import IntArray, Pattern, gather, pairs
from softjaw.fem.contact.problem import ContactProblem, Control, Evaluated, Finger, Gap
from softjaw.fem.pad.mesh import Pad
from softjaw.friction.patch import FloatArray

NO_DIRECTIONS = np.empty((0, 3))


# `_entries` of the pads in use: all candidates of a scene share a few
_ENTRIES: WeakKeyDictionary[Pad, tuple[Pattern, IntArray, IntArray]] = WeakKeyDictionary()


def _entries(finger: Finger) -> tuple[Pattern, IntArray, IntArray]:
    """Pattern of the tangent, place in it of every entry, and where each kind of them ends."""
    face, pressure = finger.local_dofs, finger.pressure_dofs
    # the diagonal of closing and pressures: an idle node has nothing else in its row
    diagonal = np.arange(finger.closing_dof, finger.pad.size, dtype=np.int32)
    parts = (
        (finger.foam.rows, finger.foam.columns),
        pairs(face[:, :, :, None, None], face[:, None, None, :, :]),
        pairs(face[:, None, :, :], pressure[:, :, None, None]),
        pairs(pressure[:, :, None, None], face[:, None, :, :]),
        (diagonal, diagonal),
    )
    rows, columns = (np.concatenate(index) for index in zip(*parts, strict=True))
    pattern = Pattern(finger.pad.size, rows, columns)
    return pattern, pattern.slots(rows, columns), np.cumsum([len(part[0]) for part in parts])


class RigidProblem(ContactProblem):
    """One pad pressed on one rigid object; ``gap`` takes points of the pad's frame."""

    condensed, stepped = False, False

    def __init__(self, pad: Pad, gap: Gap, mu: float | None = None) -> None:
        self.pad, self.closing_dof = pad, pad.closing_dof
        self.longest_closing = 0.1 * pad.shape.size[2]
        self._evaluated: tuple[FloatArray, Any, list[Evaluated]] = (np.empty(0), None, [])
        super().__init__([Finger(pad, gap)], mu)
        [self.finger] = self.fingers
        self.foam, self.non_negative = self.finger.foam, self.finger.pressures
        self._slip_force: FloatArray | float = 0.0
        self.symmetric = mu is None  # slip grows with the pressure, but no pressure with slip
        self._build_pattern()

    def _damped(self) -> slice:
        return slice(0, self.closing_dof + 1)

    def _build_pattern(self) -> None:
        """Work arrays, so that nothing large is allocated in an iteration, and the place of every entry."""
        if self.pad not in _ENTRIES:
            _ENTRIES[self.pad] = _entries(self.finger)
        pattern, self._slots, self._ends = _ENTRIES[self.pad]
        self.pattern = copy(pattern)
        self.pattern.values = np.zeros_like(pattern.values)
        self._closing_entries = np.flatnonzero(self.foam.columns == self.closing_dof)
        self._values = np.zeros(self._slots.size)

    def _parts(self) -> list[FloatArray]:
        """Views of the values: elements, face stiffness, force by pressure, gap by displacement, diagonal."""
        return np.split(self._values, self._ends[:-1])

    def evaluate(self, x: FloatArray) -> list[Evaluated]:
        """See `ContactProblem`; the last state is kept, for a tangent follows the residual of the same one."""
        at, since, contacts = self._evaluated
        anchors = self.friction and self.friction.anchors
        if since is not anchors or not np.array_equal(at, x):
            contacts = super().evaluate(x)
            self._evaluated = x.copy(), anchors, contacts
        return contacts

    def _met(self, k: int, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        points = self.finger.points(x).reshape(-1, 3)
        return points, *self.finger.gap(points)

    def steepness(self, c: Evaluated) -> FloatArray:
        """See `ContactProblem`: the gradient of a sampled distance is not quite a unit vector, least so at ridges."""
        return np.asarray(np.linalg.norm(c.normal, axis=-1))

    def _lowest_gap(self, f: Finger, x: FloatArray, c: Evaluated) -> float:
        # nodal gaps are closed at nodes, so it is between them that the contact face may be inside
        return float(f.gap(f.points(x, self.pad.between_N).reshape(-1, 3))[0].min())

    def tangent(self, x: FloatArray) -> None:
        """Fill ``pattern.values`` with the tangent at ``x``, or its symmetric form if ``condensed``."""
        self._evaluate_entries(x)
        if self.condensed:
            self._closing_column = self._condense()
        self.pattern.values[:] = self._added_up()

    def _added_up(self) -> FloatArray:
        return gather(self._slots, self._values, self.pattern.values.size)

    def _evaluate_entries(self, x: FloatArray) -> None:
        """Entries of the tangent, not added up yet."""
        elements, face, by_pressure, by_displacement, diagonal = self._parts()
        self.foam.stiffness(x, elements)
        [c], f = self.evaluate(x), self.finger
        pressure = (c.lam @ self.pad.face_N.T).ravel()[:, None, None]
        # where nothing presses a Hessian may not exist
        by_place = -pressure * np.where(pressure == 0.0, 0.0, c.surface)
        self._K_ul = by_lam = self._products(c.normal).transpose(0, 1, 3, 2)
        if self.friction is not None:
            slip_by_place, slip_by_lam = self._slip(x, c)
            by_place -= slip_by_place
            by_lam = by_lam + self._products(slip_by_lam).transpose(0, 1, 3, 2)
        face[:] = self._products(by_place).transpose(0, 3, 1, 4, 2).ravel()
        by_pressure[:] = -f.kappa * by_lam.ravel()
        diagonal[:] = 0.0
        self._tangent_set = c.active
        if self.complementarity:
            by_displacement[:] = f.kappa * self._K_ul.ravel()
        else:
            by_displacement[:] = (f.kappa * c.active[f.nodes][:, :, None, None] * self._K_ul).ravel()
            diagonal[1:] = np.where(c.active, 0.0, f.kappa * f.area)
        self._by_force = self.control.force is not None
        if self.control.force is None:
            # this row holds the control instead of the foam's force on the backing plate
            elements[self.foam.closing_entries] = 0.0
            diagonal[0] = self.closing_stiffness

    def _products(self, values: FloatArray) -> FloatArray:
        """Integrals ``(m, k, k, ...)`` of values ``(n, ...)`` at the points times two shape functions of the facet."""
        N, weight = self.pad.face_N, self.pad.face_area
        (m, points), k = weight.shape, N.shape[1]
        # two matrices, of which one is the same for all facets
        NN = np.einsum("qa,qb->abq", N, N).reshape(k * k, points)
        weighted = weight[..., None] * values.reshape(m, points, -1)
        return (NN @ weighted).reshape(m, k, k, *values.shape[1:])

    def _slip(self, x: FloatArray, c: Evaluated) -> tuple[FloatArray, FloatArray]:
        """Derivatives of friction's traction by place and pressure of the point; the tangent is not symmetric."""
        assert self.friction is not None
        assert c.traction is not None
        before, share = self.friction.judging(x) if self.stepped else (None, 1.0)
        t, by_motion, by_normal, by_pressure = self.traction(0, x, c, True, before, share)
        if self.stepped:
            self.friction.before = t
            # the step is that of these tractions, the residual has its own
            weight = self.pad.face_area
            off = weight[..., None] * (c.traction - t).reshape(*weight.shape, 3)
            self._slip_force = gather(self.finger.dofs, np.einsum("qa,fqi->fia", self.pad.face_N, off), self.size)
        length, n = self.steepness(c)[:, None], self.unit_normal(c)
        # of the unit normal and of the pressure by the point's place
        turns = (np.eye(3) - n[..., :, None] * n[..., None, :]) @ c.surface / length[..., None]
        grows = (self.point_pressure(self.finger, c)[:, None] * n / length)[..., None, :] @ c.surface
        return by_motion + by_normal @ turns + by_pressure[..., None] * grows, by_pressure * length

    def _condense(self) -> FloatArray:
        """Make the entries symmetric; returns what was the column of the closing displacement, 0 under force control.

        Rows of nodes in contact change their sign. Idle pressures, and a closing that is given, have nothing but a
        diagonal in their rows, so their part of a step is known beforehand (`right_side`) and their columns go.
        """
        elements, _, by_pressure, by_displacement, _ = self._parts()
        nodes = self.finger.nodes
        by_displacement *= -1.0
        by_pressure[~np.repeat(self._tangent_set[nodes], by_pressure.size // nodes.size)] = 0.0
        if self.control.force is not None:
            return np.zeros(self.size)
        rows, column = self.foam.rows[self._closing_entries], elements[self._closing_entries]
        elements[self._closing_entries] = 0.0
        return gather(rows, column, self.size)

    def right_side(self, R: FloatArray) -> FloatArray:
        """Right-hand side ``(size,)`` with which the tangent has the step that belongs to the residual."""
        if not self.condensed:
            # once: the next step may be made with the same factors
            right, self._slip_force = R + self._slip_force, 0.0
            return right
        right, active, f = R.copy(), self._tangent_set, self.finger
        idle = np.where(active, 0.0, R[f.pressures] / (f.kappa * f.area))
        if idle.any():
            right += gather(f.dofs, f.kappa * np.einsum("faib,fa->fib", self._K_ul, idle[f.nodes]), self.size)
        right[f.pressures] = np.where(active, -1.0, 1.0) * R[f.pressures]
        if not self._by_force:
            right -= self._closing_column * (R[self.closing_dof] / self.closing_stiffness)
        return right

    def path_tangent(self, x: FloatArray, answer: Callable[[FloatArray], FloatArray]) -> FloatArray | None:
        """Change of the unknowns per normal force on the whole pad ``(size,)`` [m/N], along the path through ``x``.

        ``answer`` solves with the factors of the last tangent, which is that at ``x`` or close to it. None where the
        force does not grow with the closing displacement, or a tangent under displacement control cannot tell.
        """
        if self._by_force is None:  # nothing has been factorised yet
            return None
        load = np.zeros(self.size)
        load[self.closing_dof] = 1.0
        change = answer(load)
        # beyond a limit point the closing grows while the force falls: nothing can be foretold by force
        if not change[self.closing_dof] > 0.0:
            return None
        if self._by_force:
            return self.pad.share * change
        # the factors are those of another control: they give the direction, and a central difference the force
        along = change / change[self.closing_dof]
        # small against the bends of the path, large against rounding of the force
        h = 1e-6 * self.pad.shape.size[2]
        rise = (self.normal_force(x + h * along) - self.normal_force(x - h * along)) / (2.0 * h)
        return along / rise if rise > 0.0 else None

    def symmetric_tangent(self, x: FloatArray) -> tuple[FloatArray, int]:
        """Values of the symmetric tangent under force control, in ``pattern``, and the number of nodes in contact.

        It is that of ``R_u`` with the rows ``-kappa G_i`` of these nodes, whose pressures are the multipliers; those of
        the others are left out. So it has one negative eigenvalue per node in contact, and more if ``x`` is unstable.
        """
        # the second and third belong to the factors at hand
        before = self.control, self._tangent_set, self._by_force, self.stepped
        # any force will do: the kind of control enters the tangent, its value does not
        self.control, self.stepped = Control(force=1.0), False
        self._evaluate_entries(x)
        # pressures are multipliers with the sign that makes the matrix symmetric
        self._condense()
        active = self._tangent_set
        self.control, self._tangent_set, self._by_force, self.stepped = before
        # not into the pattern's own values, which stay those of the last tangent
        return self._added_up(), int(np.count_nonzero(active))

    def largest_strain(self, x: FloatArray) -> float:
        """Largest principal strain of the foam."""
        return self.foam.strains(x, NO_DIRECTIONS)[1]
