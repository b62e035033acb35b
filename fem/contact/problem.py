"""Frictionless contact of a pad with a rigid object as a mixed complementarity problem.

Unknowns ``x = [q | delta | l]``: free displacements, closing of the backing plate, and one pressure
``p_i = kappa l_i`` per node of the contact face, with ``kappa = E / thickness`` so that all unknowns are lengths. The
residual is::

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

from softjaw.fem.assembly import Pattern, add_up, gather, pairs, shifted
from softjaw.fem.pad import foam as kernel
from softjaw.fem.pad.foam import Foam
from softjaw.fem.pad.mesh import Pad

FloatArray = NDArray[np.float64]
Gap = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]
IDLE = 1e-9  # of the largest pressure: a node that bears less is taken as idle
NO_DIRECTIONS = np.empty((0, 3))
BISECTIONS = 60
STIFF_VOLUME = 0.45  # Poisson's ratio above which shortened columns are a worse start than columns that only move


def borne(pressure: FloatArray, active: NDArray[np.bool_]) -> FloatArray:
    """Nodal pressures ``(n,)`` [Pa] without what is none: of idle nodes, and what rounding leaves of active ones.

    Whether a node below `IDLE` of the largest pressure bears anything is not decided by the solve, whose tolerance is
    about as large. Tension is kept, for the checks to see.
    """
    some = active & (pressure > IDLE * pressure.max(initial=0.0))
    return np.where(some, pressure, np.minimum(pressure, 0.0))


@dataclass
class Control:
    """What drives the pad: the normal force on the whole pad [N], or the closing displacement [m] without ``force``."""

    force: float | None = None
    closing: float = 0.0


@dataclass(frozen=True)
class ContactPoints:
    """Quadrature points of the meshed contact face in the pad's frame.

    Parameters
    ----------
    position, normal : (faces, points, 3) arrays
        Deformed points [m] and the object's outward normals there.
    depth : float
        How far the deepest Gauss point of the contact face is inside the object [m]; the solve keeps nodes outside,
        each by itself or with the weighted mean round it, not every point.
    load : (faces, points) array
        Contact pressure times reference area [N].
    friction : (faces, points, 3) array, optional
        Tangential force on the pad [N]; None without friction.
    """

    position: FloatArray
    normal: FloatArray
    depth: float
    load: FloatArray
    friction: FloatArray | None = None

    @property
    def force(self) -> FloatArray:
        """Contact force of the meshed part on the object ``(3,)`` [N]."""
        normal = np.einsum("fq,fqi->i", self.load, self.normal)
        return -normal if self.friction is None else -normal - self.friction.sum(axis=(0, 1))


class PressedPad:
    """A pad whose contact face touches something, and which unknowns of the whole problem are its own.

    Parameters
    ----------
    pad : Pad
    offset : int
        Its first unknown.

    Attributes
    ----------
    own, pressures : slice
        Its unknowns, and those of them that are pressures over ``kappa`` [m].
    nodes : (facets, k) array
        Number, among the nodes of the contact face, of the nodes of every facet.
    local_dofs, dofs : (facets, 3, k) arrays
        Displacements of these nodes, numbered by the pad and in the whole problem; -1 is fixed.
    """

    def __init__(self, pad: Pad, offset: int = 0) -> None:
        self.pad, self.foam, self.offset = pad, Foam(pad), offset
        self.own = slice(offset, offset + pad.size)
        self.closing_dof = offset + pad.closing_dof
        self.pressures = slice(self.closing_dof + 1, offset + pad.size)
        self.kappa, self.area = pad.modulus_per_thickness, pad.node_area
        self.nodes = pad.pressure_index[pad.face_nodes]
        self.local_dofs = np.ascontiguousarray(pad.dofs[pad.face_nodes].transpose(0, 2, 1))
        self.dofs = shifted(self.local_dofs, offset)
        self.pressure_dofs = shifted(pad.closing_dof + 1 + self.nodes, offset)

    def pressure(self, x: FloatArray) -> FloatArray:
        """Nominal pressures of the contact face's nodes at the whole state ``x`` [Pa]."""
        return self.kappa * x[self.pressures]

    def points(self, x: FloatArray, N: FloatArray | None = None) -> FloatArray:
        """Points of the deformed contact face in the pad's frame ``(facets, points, 3)`` [m].

        ``N (points, k)`` are the facets' shape functions there; by default the points are those of the quadrature.
        """
        corners = (self.pad.nodes + self.pad.displacement(x[self.own]))[self.pad.face_nodes]
        return np.einsum("qa,fai->fqi", self.pad.face_N if N is None else N, corners)

    def nodal(self, values: FloatArray) -> FloatArray:
        """Sums ``(n,)`` over the facets of values ``(facets, k)`` at their nodes."""
        return np.asarray(np.bincount(self.nodes.ravel(), values.ravel(), len(self.area)), dtype=float)

    def active(self, length: FloatArray, weighted_gap: FloatArray) -> NDArray[np.bool_]:
        """Active set ``(n,)`` of the unknowns ``length = p / kappa`` [m] and the weighted gaps [m^3]."""
        return self.area * length - weighted_gap > 0.0

    def contact_rows(self, length: FloatArray, weighted_gap: FloatArray) -> FloatArray:
        """Residual of complementarity ``(n,)`` [N]: zero where pressure or gap is and the other is not negative."""
        pressed = self.area * length
        return self.kappa * (pressed - np.maximum(0.0, pressed - weighted_gap))

    def loads(self, pressure: FloatArray) -> FloatArray:
        """Pressure times reference area of the quadrature points ``(facets, points)`` [N]."""
        return self.pad.face_area * (pressure[self.nodes] @ self.pad.face_N.T)


class ContactProblem(PressedPad):
    """Residual and tangent of one pad pressed on one object; ``gap`` takes points of the pad's frame.

    Implements the protocol ``fem.petsc.Problem``.
    """

    symmetric, condensed = True, False

    def __init__(self, pad: Pad, gap: Gap) -> None:
        super().__init__(pad)
        self.gap, self.control, self.complementarity = gap, Control(closing=0.0), False
        self.size, self.non_negative = pad.size, self.pressures
        # makes the closing row a force like all others, so that one norm judges them
        self.closing_stiffness = self.kappa * self.area.sum()
        self._by_force: bool | None = None  # whether the last tangent was that under force control
        self.closing_step = 0.1 * pad.shape.size[2]  # longest change of closing displacement in one iteration
        self._build_pattern()

    def _build_pattern(self) -> None:
        """Work arrays, so that nothing is allocated in an iteration, and the place of every entry of the tangent."""
        m, k = self.nodes.shape
        self._weighted, self._force = np.empty((m, k)), np.empty((m, 3, k))
        self._K_ul = np.empty((m, k, 3, k))
        self._none = np.empty((0, 0, 0, 0, 0)), np.empty((0, 0, 0, 0))
        face, pressure = self.local_dofs, self.pressure_dofs
        # the diagonal of closing and pressures: an idle node has nothing else in its row
        own = np.arange(self.pad.closing_dof, self.size, dtype=np.int32)
        parts = (
            (self.foam.rows, self.foam.columns),
            pairs(face[:, :, :, None, None], face[:, None, None, :, :]),
            pairs(face[:, None, :, :], pressure[:, :, None, None]),
            pairs(pressure[:, :, None, None], face[:, None, :, :]),
            (own, own),
        )
        rows, columns = (np.concatenate(index) for index in zip(*parts, strict=True))
        self.pattern = Pattern(self.size, rows, columns)
        self._slots = self.pattern.slots(rows, columns)
        self._ends = np.cumsum([len(part[0]) for part in parts])
        self._closing_entries = np.flatnonzero(self.foam.columns == self.closing_dof)
        self._values = np.zeros(rows.size)
        self._K_uu = self._parts()[1].reshape(m, 3, k, 3, k)

    def _parts(self) -> list[FloatArray]:
        """Views of the values: elements, face stiffness, force by pressure, gap by displacement, own diagonal."""
        return np.split(self._values, self._ends[:-1])

    def _contact(self, x: FloatArray, tangent: bool) -> FloatArray:
        """Evaluate the contact face at ``x``; returns the weighted gap of every node of the contact face [m^3]."""
        points = self.points(x)
        gap, normal, hessian = self.gap(points.reshape(-1, 3))
        shape = points.shape[:2]
        self._points, self._normal, self._gap = points, normal.reshape(*shape, 3), gap.reshape(shape)
        self._hessian = hessian.reshape(*shape, 3, 3)
        kernel.contact(
            self.pad.face_N, self.pad.face_area, self.pressure(x)[self.nodes], self._gap,
            self._normal, self._hessian, self._weighted, self._force,
            *((self._K_uu, self._K_ul) if tangent else self._none),
        )  # fmt: skip
        return self.nodal(self._weighted)

    def residual(self, x: FloatArray) -> FloatArray:
        """Residual of all rows ``(size,)`` [N]; NaN where an element is inverted, so that the step is refused."""
        R, smallest = self.foam.force(x)
        if not smallest > 0.0:
            return np.full(self.size, np.nan)
        weighted_gap, length = self._contact(x, tangent=False), x[self.pressures]
        R += gather(self.dofs, self._force, self.size)
        if self.control.force is None:
            R[self.closing_dof] = self.closing_stiffness * (x[self.closing_dof] - self.control.closing)
        else:
            R[self.closing_dof] -= self.control.force * self.pad.share
        # vinewtonrsls keeps the pressures at their bounds itself; it needs the gap alone
        if self.complementarity:
            R[self.pressures] = self.kappa * weighted_gap
        else:
            self._active_set = self.active(length, weighted_gap)
            R[self.pressures] = self.contact_rows(length, weighted_gap)
        return R

    def tangent(self, x: FloatArray) -> None:
        """Fill ``pattern.values`` with the tangent at ``x``, or its symmetric form if ``condensed``."""
        self._evaluate_entries(x)
        if self.condensed:
            self._closing_column = self._condense()
        self._add_up(self.pattern.values)

    def _add_up(self, values: FloatArray) -> None:
        values[:] = 0.0
        add_up(self._slots, self._values, values)

    def _evaluate_entries(self, x: FloatArray) -> None:
        """Entries of the tangent, not added up yet."""
        elements, _, by_pressure, by_displacement, own = self._parts()
        self.foam.stiffness(x, elements)
        weighted_gap = self._contact(x, tangent=True)
        by_pressure[:] = -self.kappa * self._K_ul.ravel()
        own[:] = 0.0
        if self.complementarity:
            by_displacement[:] = self.kappa * self._K_ul.ravel()
        else:
            active = self._tangent_set = self.active(x[self.pressures], weighted_gap)
            by_displacement[:] = (self.kappa * active[self.nodes][:, :, None, None] * self._K_ul).ravel()
            own[1:] = np.where(active, 0.0, self.kappa * self.area)
        self._by_force = self.control.force is not None
        if not self._by_force:
            # this row holds the control instead of the foam's force on the backing plate
            elements[self.foam.closing_entries] = 0.0
            own[0] = self.closing_stiffness

    def _condense(self) -> FloatArray:
        """Make the entries symmetric; returns what was the column of the closing displacement, 0 under force control.

        Rows of nodes in contact change their sign. Idle pressures, and a closing that is given, have nothing but a
        diagonal in their rows, so their part of a step is known beforehand (`right_side`) and their columns go.
        """
        elements, _, by_pressure, by_displacement, _ = self._parts()
        by_displacement *= -1.0
        by_pressure[~np.repeat(self._tangent_set[self.nodes], by_pressure.size // self.nodes.size)] = 0.0
        if self._by_force:
            return np.zeros(self.size)
        rows, column = self.foam.rows[self._closing_entries], elements[self._closing_entries]
        elements[self._closing_entries] = 0.0
        return gather(rows, column, self.size)

    def right_side(self, R: FloatArray) -> FloatArray:
        """Right-hand side ``(size,)`` with which the condensed tangent has the step that belongs to the residual."""
        right, active = R.copy(), self._tangent_set
        idle = np.where(active, 0.0, R[self.pressures] / (self.kappa * self.area))
        if idle.any():
            right += gather(self.dofs, self.kappa * np.einsum("faib,fa->fib", self._K_ul, idle[self.nodes]), self.size)
        right[self.pressures] = np.where(active, -1.0, 1.0) * R[self.pressures]
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
        before = self.control, self._tangent_set, self._by_force  # the latter two belong to the factors at hand
        # any force will do: the kind of control enters the tangent, its value does not
        self.control = Control(force=1.0)
        self._evaluate_entries(x)
        # pressures are multipliers with the sign that makes the matrix symmetric
        self._condense()
        active = self._tangent_set
        self.control, self._tangent_set, self._by_force = before
        # not into the pattern's own values, which stay those of the last tangent
        values = np.empty_like(self.pattern.values)
        self._add_up(values)
        return values, int(np.count_nonzero(active))

    def largest_strain(self, x: FloatArray) -> float:
        """Largest principal strain of the foam."""
        return self.foam.strains(x, NO_DIRECTIONS)[1]

    def keep(self, x: FloatArray, first: bool) -> bool:
        """Whether the last tangent may serve once more (see ``fem.petsc.Problem``).

        Not after a change of control or of the active set: that would leave pressures that are not quite zero.
        """
        same_control = self._by_force == (self.control.force is not None)
        return same_control and np.array_equal(self._active_set, self._tangent_set)

    def shorten(self, x: FloatArray, step: FloatArray) -> float:
        """Factor that keeps the change of closing displacement and the compression of every element within reason."""
        return self.foam.shorten(x, step, self.closing_step)

    def forget(self) -> None:
        """Begin another load path; without friction it does not matter."""

    def accept(self, x: FloatArray) -> None:
        """Note a state that the next one starts from; without friction the load path does not matter."""

    def history(self, x: FloatArray) -> tuple[FloatArray, ...]:
        """States that ``x`` depends on, the first one first."""
        return ()

    def normal_force(self, x: FloatArray) -> float:
        """Normal force on the whole pad that the backing plate must exert at ``x`` [N]."""
        return self.foam.normal_force(x)

    def closing(self, x: FloatArray) -> float:
        """Closing displacement of the backing plate [m]."""
        return float(x[self.closing_dof])

    def contact_state(self, x: FloatArray) -> tuple[FloatArray, FloatArray, ContactPoints]:
        """Nodal pressures ``(n,)`` [Pa], mean gaps of the nodes ``(n,)`` [m] and the state of the quadrature points."""
        weighted_gap = self._contact(x, tangent=False)
        pressure = borne(self.pressure(x), self.active(x[self.pressures], weighted_gap))
        # nodal gaps are closed at nodes, so it is between them that the contact face may be inside
        between = self.gap(self.points(x, self.pad.between_N).reshape(-1, 3))[0]
        depth = max(0.0, -float(between.min()))
        points = ContactPoints(self._points, self._normal, depth, self.loads(pressure))
        return pressure, weighted_gap / self.area, points


class SpringBed:
    """Columns of foam of modulus E between plate and object; ``gap`` as in ``fem.contact.press.Press``."""

    def __init__(self, pad: Pad, gap: Gap) -> None:
        self.pad, self.gap = pad, gap

    @cached_property
    def height(self) -> FloatArray:
        """Distance along the approach from the undeformed contact nodes to the object, roughly ``(n,)`` [m]."""
        gap, normal, _ = self.gap(self.pad.nodes[self.pad.contact_nodes])
        # along the approach, not along the normal; 0.2 bounds it where the object turns away from the pad
        return np.maximum(gap, 0.0) / np.maximum(-normal[:, 2], 0.2)

    def force(self, closing: float) -> float:
        """Normal force on the whole pad [N]."""
        pressure = self.pad.modulus_per_thickness * np.maximum(0.0, closing - self.height)
        return float(self.pad.node_area @ pressure) / self.pad.share

    def force_scale(self, closing: float) -> float:
        """Force that a residual at this closing displacement is judged by, never zero [N]."""
        # before the bed touches its force is zero and would be no scale
        one_node = self.pad.modulus_per_thickness * self.pad.node_area.max() * abs(closing)
        return max(self.force(closing), 1e-3 * one_node)

    def closing(self, force: float) -> float:
        """Closing displacement at which the bed carries the force [m]."""
        low, high = 0.0, 1e-3 * self.pad.shape.size[2]
        # bounded, because a bed beside the object never carries the force
        while self.force(high) < force and high < 10 * self.pad.shape.size[2]:
            high *= 2.0
        # bisection: the bed's force is monotonous but has kinks wherever a column touches
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.force(middle) < force else (low, middle)
        return high

    def guess(self, closing: float) -> FloatArray:
        """Vector of unknowns: columns shortened affinely, so that no element starts inverted, and their pressures."""
        pad = self.pad
        # at most 0.6 of the thickness: the start has to be a valid state, not a good one
        shortening = np.clip(closing - self.height, 0.0, 0.6 * pad.shape.size[2])
        u = np.zeros(pad.dofs.shape)
        u[:, 2] = closing
        # foam that hardly changes its volume would start with huge stresses
        if pad.material.poisson_ratio <= STIFF_VOLUME:
            u[:, 2] -= shortening[self._column] * (1.0 + pad.nodes[:, 2] / pad.shape.size[2])
        x = np.zeros(pad.size)
        x[pad.dofs[pad.dofs >= 0]] = u[pad.dofs >= 0]
        x[pad.closing_dof] = closing
        x[pad.closing_dof + 1 :] = shortening
        return x

    @cached_property
    def _column(self) -> NDArray[np.int64]:
        """For every node the index, in ``contact_nodes``, of the node above it (columns are straight)."""
        face = self.pad.nodes[self.pad.contact_nodes].reshape(*self.pad.contact_grid, 3)
        x, y = face[:, 0, 0], face[0, :, 1]
        # the nearest line, not an equal one: nodes inside elements are off their line by rounding
        i = np.abs(self.pad.nodes[:, 0, None] - x).argmin(axis=1)
        j = np.abs(self.pad.nodes[:, 1, None] - y).argmin(axis=1)
        return i * len(y) + j
