"""Frictionless contact of a pad with a rigid object as a mixed complementarity problem.

Unknowns ``x = [q | delta | l]``: free displacements, closing of the sheet, and one pressure ``p_i = kappa l_i`` per
node of the front, with ``kappa = E / thickness`` so that all unknowns are lengths.  The residual is::

    R_q     = r_int(u) - int N_a p n dA                       u = u(q, delta), p = sum N_i p_i, n = grad g
    R_delta = sum of r_int over the bonded back - F           (force)  or  s (delta - closing)   (closing)
    R_l     = kappa [A_i l_i - max(0, A_i l_i - G_i)]         G_i = int N_i g dA   (active set)
              kappa G_i   with   l_i >= 0                     (complementarity)

All rows are forces [N].  ``A_i = int N_i dA``, all integrals are over the reference area, and ``p`` is the nominal
pressure.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.pad import foam as kernel
from softjaw.fem.pad.foam import Foam, gather
from softjaw.fem.pad.mesh import Pad

FloatArray = NDArray[np.float64]
Gap = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
IDLE = 1e-9  # of the largest pressure: a node that bears less is taken as idle
NO_DIRECTIONS = np.empty((0, 3))
BISECTIONS = 60
STIFF_VOLUME = 0.45  # Poisson's ratio above which squeezed columns are a worse start than columns that only move


def borne(pressure: FloatArray, active: NDArray[np.bool_]) -> FloatArray:
    """Nodal pressures ``(n,)`` [Pa] without what is none: of idle nodes, and what rounding leaves of active ones.

    Whether a node below `IDLE` of the largest pressure bears anything is not decided by the solve, whose tolerance is
    about as large. Tension is kept, for the checks to see.
    """
    some = active & (pressure > IDLE * pressure.max(initial=0.0))
    return np.where(some, pressure, np.minimum(pressure, 0.0))


@dataclass
class Control:
    """What drives the sheet: the normal force on the whole pad [N], or the closing [m] where ``force`` is None."""

    force: float | None = None
    closing: float = 0.0


@dataclass(frozen=True)
class ContactPoints:
    """Quadrature points of the meshed front in the pad's frame.

    Parameters
    ----------
    position, normal : (faces, points, 3) arrays
        Deformed points [m] and the object's outward normals there.
    gap : (faces, points) array
        Signed distance to the object [m]; the solve makes its weighted mean at a node non-negative, not every value.
    load : (faces, points) array
        Contact pressure times reference area [N].
    friction : (faces, points, 3) array, optional
        Tangential force on the pad [N]; None without friction.
    """

    position: FloatArray
    normal: FloatArray
    gap: FloatArray
    load: FloatArray
    friction: FloatArray | None = None

    @property
    def force(self) -> FloatArray:
        """Contact force of the meshed part on the object ``(3,)`` [N]."""
        normal = np.einsum("fq,fqi->i", self.load, self.normal)
        return -normal if self.friction is None else -normal - self.friction.sum(axis=(0, 1))


class ContactProblem:
    """Residual and tangent of one pad pressed on one object; ``gap`` takes points of the pad's frame.

    Implements the protocol ``fem.petsc.Problem``.
    """

    def __init__(self, pad: Pad, gap: Gap) -> None:
        self.pad, self.gap, self.control, self.complementarity = pad, gap, Control(closing=0.0), False
        self.foam = Foam(pad)
        self.size = pad.size
        self.kappa = pad.modulus_per_thickness
        self.area = pad.node_area
        self.closing_stiffness = self.kappa * self.area.sum()
        self._by_force: bool | None = None  # whether the last tangent was that under force control
        self.closing_step = 0.1 * pad.shape.size[2]  # longest change of closing displacement in one iteration
        self._pressures = slice(pad.closing_dof + 1, pad.size)
        self._allocate()
        self._describe_entries()

    def _allocate(self) -> None:
        """Work arrays, so that nothing is allocated in an iteration."""
        m, face = self.pad.face_nodes.shape
        self._weighted, self._force = np.empty((m, face)), np.empty((m, 3, face))
        self._K_uu = np.empty((m, 3, face, 3, face))
        self._K_ul = np.empty((m, face, 3, face))
        self._none = np.empty((0, 0, 0, 0, 0)), np.empty((0, 0, 0, 0))

    def _describe_entries(self) -> None:
        """Row and column of every entry that ``tangent`` returns, in its order."""
        pad = self.pad
        face = pad.dofs[pad.face_nodes].transpose(0, 2, 1)
        pressure = pad.closing_dof + 1 + pad.pressure_index[pad.face_nodes]
        own = np.arange(pad.closing_dof, pad.size, dtype=np.int32)
        rows, columns = [self.foam.rows], [self.foam.columns]
        for first, second in (
            (face[:, :, :, None, None], face[:, None, None, :, :]),
            (face[:, None, :, :], pressure[:, :, None, None]),
            (pressure[:, :, None, None], face[:, None, :, :]),
            (own, own),
        ):
            pair = np.broadcast_arrays(first, second)
            rows.append(pair[0].ravel())
            columns.append(pair[1].ravel())
        self.rows, self.columns = np.concatenate(rows).astype(np.int32), np.concatenate(columns).astype(np.int32)
        self._ends = np.cumsum([len(r) for r in rows])
        self._values = np.zeros(self.rows.size)
        self._K_uu = self._parts()[1].reshape(self._K_uu.shape)
        self._face_dofs = face.ravel()
        self._face_pressures = pad.pressure_index[pad.face_nodes]

    def _parts(self) -> list[FloatArray]:
        """Views of the values: elements, face stiffness, force by pressure, gap by displacement, own diagonal."""
        return np.split(self._values, self._ends[:-1])

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Pressures are not negative; nothing else is bounded."""
        lower = np.full(self.size, -np.inf)
        lower[self._pressures] = 0.0
        return lower, np.full(self.size, np.inf)

    def _contact(self, x: FloatArray, tangent: bool) -> FloatArray:
        """Evaluate the contact face at ``x``; returns the weighted gap of every node of the front [m^3]."""
        pad = self.pad
        corners = (pad.nodes + pad.displacement(x))[pad.face_nodes]
        points = np.einsum("qa,fai->fqi", pad.face_N, corners)
        gap, normal, hessian = self.gap(points.reshape(-1, 3))
        shape = points.shape[:2]
        self._points, self._normal, self._gap = points, normal.reshape(*shape, 3), gap.reshape(shape)
        self._hessian = hessian.reshape(*shape, 3, 3)
        kernel.contact(
            pad.face_N, pad.face_area, self.kappa * x[self._pressures][self._face_pressures], self._gap,
            self._normal, self._hessian, self._weighted, self._force,
            *((self._K_uu, self._K_ul) if tangent else self._none),
        )  # fmt: skip
        return np.bincount(self._face_pressures.ravel(), self._weighted.ravel(), len(self.area))

    def _active(self, x: FloatArray, weighted_gap: FloatArray) -> NDArray[np.bool_]:
        return self.area * x[self._pressures] - weighted_gap > 0.0

    def residual(self, x: FloatArray) -> FloatArray:
        """Residual of all rows ``(size,)`` [N]; NaN where an element is inverted, so that the step is refused."""
        pad = self.pad
        R, smallest = self.foam.force(x)
        if not smallest > 0.0:
            return np.full(self.size, np.nan)
        weighted_gap = self._contact(x, tangent=False)
        R += gather(self._face_dofs, self._force, self.size)
        if self.control.force is None:
            R[pad.closing_dof] = self.closing_stiffness * (x[pad.closing_dof] - self.control.closing)
        else:
            R[pad.closing_dof] -= self.control.force * pad.share
        if self.complementarity:
            R[self._pressures] = self.kappa * weighted_gap
        else:
            pressed = self.area * x[self._pressures]
            self._pressing = pressed - weighted_gap > 0.0
            R[self._pressures] = self.kappa * (pressed - np.maximum(0.0, pressed - weighted_gap))
        return R

    def tangent(self, x: FloatArray) -> FloatArray:
        """Entries of the tangent in the order of ``rows`` and ``columns``."""
        elements, _, by_pressure, by_displacement, own = self._parts()
        self.foam.stiffness(x, elements)
        weighted_gap = self._contact(x, tangent=True)
        by_pressure[:] = -self.kappa * self._K_ul.ravel()
        own[:] = 0.0
        if self.complementarity:
            by_displacement[:] = self.kappa * self._K_ul.ravel()
        else:
            active = self._held = self._active(x, weighted_gap)
            by_displacement[:] = (self.kappa * active[self._face_pressures][:, :, None, None] * self._K_ul).ravel()
            own[1:] = np.where(active, 0.0, self.kappa * self.area)
        self._by_force = self.control.force is not None
        if not self._by_force:
            elements[self.foam.closing_entries] = 0.0
            own[0] = self.closing_stiffness
        return self._values

    def path_tangent(self, x: FloatArray, answer: Callable[[FloatArray], FloatArray]) -> FloatArray | None:
        """Change of the unknowns per normal force on the whole pad ``(size,)`` [m/N], along the path through ``x``.

        ``answer`` solves with the factors of the last tangent, which is that at ``x`` or close to it. None where the
        force does not grow with the closing displacement, or a tangent under displacement control cannot tell.
        """
        if self._by_force is None:  # nothing has been factorised yet
            return None
        load = np.zeros(self.size)
        load[self.pad.closing_dof] = 1.0
        found = answer(load)
        if not found[self.pad.closing_dof] > 0.0:
            return None
        if self._by_force:
            return self.pad.share * found
        along = found / found[self.pad.closing_dof]
        h = 1e-6 * self.pad.shape.size[2]
        rise = (self.sheet_force(x + h * along) - self.sheet_force(x - h * along)) / (2.0 * h)
        return along / rise if rise > 0.0 else None

    def symmetric_tangent(self, x: FloatArray) -> tuple[FloatArray, int]:
        """Entries of the symmetric tangent under force control, and the number of nodes in contact.

        It is that of ``R_u`` with the rows ``-kappa G_i`` of these nodes, whose pressures are the multipliers; those of
        the others are left out. So it has one negative eigenvalue per node in contact, and more if ``x`` is unstable.
        """
        before = self.control, self._held, self._by_force  # the latter two tell of the factors at hand
        self.control = Control(force=1.0)
        entries, held = self.tangent(x), self._held
        self.control, self._held, self._by_force = before
        _, _, by_pressure, by_displacement, _ = self._parts()
        by_displacement *= -1.0
        by_pressure[~np.repeat(held[self._face_pressures], by_pressure.size // self._face_pressures.size)] = 0.0
        return entries, int(np.count_nonzero(held))

    def largest_strain(self, x: FloatArray) -> float:
        """Largest principal strain of the foam."""
        return self.foam.strains(x, NO_DIRECTIONS)[1]

    def keep(self, x: FloatArray, first: bool) -> bool:
        """Whether the last tangent may serve once more (see ``fem.petsc.Problem``).

        Not after a change of control or of the active set: it would leave pressures that are not quite zero.
        """
        return self._by_force == (self.control.force is not None) and np.array_equal(self._pressing, self._held)

    def shorten(self, x: FloatArray, step: FloatArray) -> float:
        """Factor that keeps the change of closing displacement and the squeezing of every element within reason."""
        return self.foam.shorten(x, step, self.closing_step)

    def accept(self, x: FloatArray) -> None:
        """Told every state that the next one starts from; without friction the way to a state does not matter."""

    def sheet_force(self, x: FloatArray) -> float:
        """Normal force on the whole pad that the sheet must exert at ``x`` [N]."""
        return self.foam.sheet_force(x)

    @property
    def closing_dof(self) -> int:
        """Number of the unknown that is the sheet's closing displacement; before it come the displacements."""
        return self.pad.closing_dof

    def closing(self, x: FloatArray) -> float:
        """Closing displacement of the sheet [m]."""
        return float(x[self.pad.closing_dof])

    def contact_state(self, x: FloatArray) -> tuple[FloatArray, FloatArray, ContactPoints]:
        """Nodal pressures ``(n,)`` [Pa], mean gaps of the nodes ``(n,)`` [m] and the state of the quadrature points."""
        weighted_gap = self._contact(x, tangent=False)
        pressure = borne(self.kappa * x[self._pressures], self._active(x, weighted_gap))
        load = self.pad.face_area * (pressure[self._face_pressures] @ self.pad.face_N.T)
        return pressure, weighted_gap / self.area, ContactPoints(self._points, self._normal, self._gap, load)


class SpringBed:
    """Columns of foam of modulus E between the sheet and the object; ``gap`` as in ``fem.contact.press.Press``."""

    def __init__(self, pad: Pad, gap: Gap) -> None:
        self.pad, self.gap = pad, gap

    @cached_property
    def height(self) -> FloatArray:
        """Distance along the approach from every node of the undeformed front to the object, roughly ``(n,)`` [m]."""
        gap, normal, _ = self.gap(self.pad.nodes[self.pad.front_nodes])
        return np.maximum(gap, 0.0) / np.maximum(-normal[:, 2], 0.2)

    def force(self, closing: float) -> float:
        """Normal force on the whole pad [N]."""
        pressure = self.pad.modulus_per_thickness * np.maximum(0.0, closing - self.height)
        return float(self.pad.node_area @ pressure) / self.pad.share

    def force_scale(self, closing: float) -> float:
        """Force that a residual at this closing displacement is judged by, never zero [N]."""
        one_node = self.pad.modulus_per_thickness * self.pad.node_area.max() * abs(closing)
        return max(self.force(closing), 1e-3 * one_node)

    def closing(self, force: float) -> float:
        """Closing displacement at which the bed carries the force [m]."""
        low, high = 0.0, 1e-3 * self.pad.shape.size[2]
        while self.force(high) < force and high < 10 * self.pad.shape.size[2]:
            high *= 2.0
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.force(middle) < force else (low, middle)
        return high

    def guess(self, closing: float) -> FloatArray:
        """Vector of unknowns: columns shortened affinely, so that no element starts inverted, and their pressures."""
        pad = self.pad
        squeeze = np.clip(closing - self.height, 0.0, 0.6 * pad.shape.size[2])
        u = np.zeros(pad.dofs.shape)
        u[:, 2] = closing
        if pad.material.poisson_ratio <= STIFF_VOLUME:
            u[:, 2] -= squeeze[self._column] * (1.0 + pad.nodes[:, 2] / pad.shape.size[2])
        x = np.zeros(pad.size)
        x[pad.dofs[pad.dofs >= 0]] = u[pad.dofs >= 0]
        x[pad.closing_dof] = closing
        x[pad.closing_dof + 1 :] = squeeze
        return x

    @cached_property
    def _column(self) -> NDArray[np.int64]:
        """For every node the index, in ``front_nodes``, of the front's node above it (columns are straight)."""
        front = self.pad.nodes[self.pad.front_nodes].reshape(*self.pad.front_grid, 3)
        x, y = front[:, 0, 0], front[0, :, 1]
        i = np.abs(self.pad.nodes[:, 0, None] - x).argmin(axis=1)
        j = np.abs(self.pad.nodes[:, 1, None] - y).argmin(axis=1)
        return i * len(y) + j
