"""Frictionless contact of one or two pads with a thin-walled object, as one mixed complementarity problem.

Unknowns ``x = [q | pad 1 | pad 2]``: those of the wall (``wall_model``) and, per pad,
``[u | delta | l]`` as in ``fem.contact.problem``. With the pads' points facing the deformed wall (``facing``) the
residual is::

    R_u     = r_int(u) - int N_a p n dA                          p = sum N_i kappa l_i
    R_q     = r_int(q) + int N_a p n dA                          on both numbers that move the outer face
    R_l     = kappa [A_i l_i - max(0, A_i l_i - G_i)]            G_i = int N_i g dA
    R_delta = force on the sheet - F                             (force)
              k (sum of the closings - their goal), and the difference of the sheets' forces   (closing displacement)

All rows are forces [N]. Both pads press with the same force, each with a closing displacement of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.contact.pattern import Pattern, add_up
from softjaw.fem.contact.problem import ContactPoints, Control, borne
from softjaw.fem.objects.gap import FloatArray, Pose
from softjaw.fem.pad.foam import Foam, gather
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.shell.facing import FAR, Facing, Wall, face
from softjaw.fem.shell.wall_kernel import contact_forces, contact_tangent
from softjaw.fem.shell.wall_model import WallModel

IntArray = NDArray[np.int32]
LONGEST_CLOSING = 1e-3  # of one iteration [m]
CARRIED = 0.3  # part of a node's area that must face the wall for the node to carry load


class Finger:
    """One pad, where it stands and which unknowns of the whole problem are its own.

    Parameters
    ----------
    pad : Pad
    pose : Pose
        The pad's frame at first touch of the undeformed wall.
    wall : Wall
        The part of the outer face that it can touch.
    offset : int
        Its first unknown.
    """

    def __init__(self, pad: Pad, pose: Pose, wall: Wall, offset: int) -> None:
        self.pad, self.pose, self.wall, self.offset = pad, pose, wall, offset
        self.foam = Foam(pad)
        self.own = slice(offset, offset + pad.size)
        self.closing = offset + pad.closing_dof
        self.kappa = pad.modulus_per_thickness
        self.R = np.ascontiguousarray(pose.rotation)
        self.local_dofs = np.ascontiguousarray(pad.dofs[pad.face_nodes].transpose(0, 2, 1))  # (faces, 3, k)
        self.dofs = _shift(self.local_dofs, offset)
        self.pressures = _shift(pad.closing_dof + 1 + pad.pressure_index[pad.face_nodes], offset)
        self.nodes = pad.pressure_index[pad.face_nodes]

    def pressure(self, x: FloatArray) -> FloatArray:
        """Nominal pressures of the front's nodes at the whole state ``x`` [Pa]."""
        return self.kappa * x[self.own][self.pad.closing_dof + 1 :]

    def points(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Quadrature points of the front in the pad's frame ``(faces, points, 3)`` and the object's ``(n, 3)`` [m]."""
        pad = self.pad
        corners = (pad.nodes + pad.displacement(x[self.own]))[pad.face_nodes]
        own = np.einsum("qa,fai->fqi", pad.face_N, corners)
        return own, self.pose.to_object(own.reshape(-1, 3))


@dataclass
class _Evaluated:
    """What the contact of one finger came to."""

    facing: Facing
    lam: FloatArray
    weighted: FloatArray
    active: NDArray[np.bool_]
    force: FloatArray


class GripProblem:
    """Residual and tangent of one or two pads on a deformable wall (see ``fem.petsc.Problem``).

    Parameters
    ----------
    model : WallModel
        The wall; its unknowns come first.
    pads : sequence of (Pad, Pose, Wall)
        One where a plane of symmetry lies between the fingers, else two; with what each can touch.
    """

    complementarity = False

    def __init__(self, model: WallModel, pads: Sequence[tuple[Pad, Pose, Wall]]) -> None:
        self.model = model
        self.fingers: list[Finger] = []
        self.size = model.size
        for pad, pose, wall in pads:
            self.fingers.append(Finger(pad, pose, wall, self.size))
            self.size += pad.size
        self.stiffness = sum(f.kappa * f.pad.node_area.sum() for f in self.fingers)
        self.control = Control(closing=0.0)
        self.places = [f.wall.places(f.points(np.zeros(self.size))[1]) for f in self.fingers]
        self._build_pattern()

    @property
    def control(self) -> Control:
        """What drives the sheets; setting it begins a new solve, whose first tangent of the wall is the plain one."""
        return self._control

    @control.setter
    def control(self, control: Control) -> None:
        self._control, self._before = control, None

    def _build_pattern(self) -> None:
        """Everything but the couplings between pads and wall, which come as pads touch."""
        rows, columns = [], []
        for part in (self.model.entries(), *map(self._own_entries, self.fingers)):
            rows.append(part[0])
            columns.append(part[1])
        self.pattern = Pattern(self.size, np.concatenate(rows), np.concatenate(columns))
        self._wall_slots = self.pattern.slots(*self.model.entries())
        self._foam_slots = [self.pattern.slots(*self._foam_entries(f)) for f in self.fingers]
        self._values = [np.zeros(len(f.foam.rows)) for f in self.fingers]
        if len(self.fingers) == 2:
            f = self.fingers[0]
            columns = self._foam_entries(f)[1][f.foam.closing_entries]
            self._balance_slots = self.pattern.slots(np.full_like(columns, self.fingers[1].closing), columns)

    def _foam_entries(self, f: Finger) -> tuple[IntArray, IntArray]:
        return _shift(f.foam.rows, f.offset), _shift(f.foam.columns, f.offset)

    def _own_entries(self, f: Finger) -> tuple[IntArray, IntArray]:
        rows, columns = self._foam_entries(f)
        pair = [a.ravel() for a in np.broadcast_arrays(f.dofs[:, :, :, None], f.pressures[:, None, None, :])]
        rows, columns = np.concatenate([rows, pair[0], pair[1]]), np.concatenate([columns, pair[1], pair[0]])
        if f is self.fingers[-1] and f is not self.fingers[0]:  # its closing row may hold the balance of both sheets
            other = self.fingers[0]
            back = _shift(other.foam.columns[other.foam.closing_entries], other.offset)
            rows = np.concatenate([rows, np.full_like(back, f.closing), [other.closing]])
            columns = np.concatenate([columns, back, [f.closing]])
        return rows.astype(np.int32), columns.astype(np.int32)

    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """No bounds: the complementarity is in the residual."""
        return np.full(self.size, -np.inf), np.full(self.size, np.inf)

    def _contact(self, x: FloatArray, wall_force: FloatArray) -> list[_Evaluated]:
        """Evaluate the contact of all fingers; adds to the forces on the wall's nodes."""
        v, w = self.model.outer(x[: self.model.size])
        found = []
        for f, places in zip(self.fingers, self.places, strict=True):
            facing = face(f.wall, f.points(x)[1], places, v, w)
            pad, lam = f.pad, f.pressure(x)[f.nodes]
            (weighted, part), force = np.empty((2, *f.nodes.shape)), np.empty((len(f.nodes), 3, f.nodes.shape[1]))
            contact_forces(
                pad.face_N, pad.face_area, lam, facing.gap, facing.normal, facing.nodes, facing.N, f.R,
                weighted, part, force, wall_force,
            )  # fmt: skip
            gaps, faced = (np.bincount(f.nodes.ravel(), sums.ravel(), len(pad.node_area)) for sums in (weighted, part))
            gaps = np.where(faced > CARRIED * pad.node_area, gaps, FAR * pad.node_area)
            active = pad.node_area * (f.pressure(x) / f.kappa) - gaps > 0.0
            found.append(_Evaluated(facing, lam, gaps, active, force))
        return found

    def residual(self, x: FloatArray) -> FloatArray:
        """Residual of all rows ``(size,)`` [N]; NaN where an element is inverted, so that the step is refused."""
        R, wall_force = np.zeros(self.size), self._no_force()
        try:
            contacts = self._contact(x, wall_force)
        except ArithmeticError:
            return np.full(self.size, np.nan)
        self._pressing = np.concatenate([c.active for c in contacts])
        R[: self.model.size] = self.model.residual(x[: self.model.size], wall_force)
        for f, c in zip(self.fingers, contacts, strict=True):
            own, smallest = f.foam.force(x[f.own])
            if not smallest > 0.0:
                return np.full(self.size, np.nan)
            own += gather(f.local_dofs, c.force, f.pad.size)
            pressed = f.pad.node_area * x[f.own][f.pad.closing_dof + 1 :]
            own[f.pad.closing_dof + 1 :] = f.kappa * (pressed - np.maximum(0.0, pressed - c.weighted))
            R[f.own] = own
        self._drive(x, R)
        return R

    def _drive(self, x: FloatArray, R: FloatArray) -> None:
        """Rows of the travels; they hold the forces on the sheets so far."""
        one, last = self.fingers[0], self.fingers[-1]
        if self.control.force is not None:
            for f in self.fingers:
                R[f.closing] -= self.control.force * f.pad.share
            return
        if last is not one:
            R[last.closing] = R[last.closing] / last.pad.share - R[one.closing] / one.pad.share
        closing = np.mean([x[f.closing] for f in self.fingers])
        R[one.closing] = self.stiffness * (closing - self.control.closing)

    def tangent(self, x: FloatArray) -> FloatArray:
        """Fill ``pattern.values`` with the tangent at ``x``; the pattern grows by what newly touches."""
        q = x[: self.model.size].copy()
        wall = self.model.tangent(q, self._before)
        self._before, self._by_force = q, self.control.force is not None
        contacts = self._contact(x, self._no_force())
        self._held = np.concatenate([c.active for c in contacts])
        for f, values in zip(self.fingers, self._values, strict=True):
            f.foam.stiffness(x[f.own], values)
        while True:
            self._fill(wall, contacts)
            if all([self._add_contact(f, c) for f, c in zip(self.fingers, contacts, strict=True)]):
                return self.pattern.values
            self._grow(contacts)

    def keep(self, x: FloatArray, first: bool) -> bool:
        """Whether the last tangent may serve once more, as in ``fem.contact.problem``."""
        if self._by_force != (self.control.force is not None) or not np.array_equal(self._pressing, self._held):
            return False
        if first:
            self._before = x[: self.model.size].copy()  # the wall's next tangent counts its step from here
        return True

    def _fill(self, wall: FloatArray, contacts: list[_Evaluated]) -> None:
        """Entries of wall, foam, idle pressures and control."""
        values = self.pattern.values
        values[:] = 0.0
        add_up(self._wall_slots, wall, values)
        for f, slots, own, c in zip(self.fingers, self._foam_slots, self._values, contacts, strict=True):
            add_up(slots, own, values)
            idle = np.flatnonzero(~c.active)
            index = f.offset + f.pad.closing_dof + 1 + idle
            values[self.pattern.slots(index, index)] += f.kappa * f.pad.node_area[idle]
        if self.control.force is None:
            self._fill_closing_rows(values)

    def _fill_closing_rows(self, values: FloatArray) -> None:
        """Under displacement control the first row holds the mean closing, the second the balance of both sheets."""
        one, last = self.fingers[0], self.fingers[-1]
        back = self._foam_slots[0][one.foam.closing_entries]
        if last is not one:
            values[self.pattern.start[last.closing] : self.pattern.start[last.closing + 1]] /= last.pad.share
            add_up(self._balance_slots, -self._values[0][one.foam.closing_entries] / one.pad.share, values)
        values[back[back >= 0]] = 0.0
        closings = np.array([f.closing for f in self.fingers])
        values[self.pattern.slots(np.full_like(closings, one.closing), closings)] = self.stiffness / len(closings)

    def _add_contact(self, f: Finger, c: _Evaluated) -> bool:
        pad, facing, pattern = f.pad, c.facing, self.pattern
        return contact_tangent(
            pad.face_N, pad.face_area, c.lam, c.active[f.nodes], f.kappa, facing.gap, facing.normal, facing.e,
            facing.nodes, facing.N, facing.H, facing.G, facing.A, f.R, f.dofs, f.pressures, self.model.first,
            self.model.second, pattern.start, pattern.column, pattern.values,
        )  # fmt: skip

    def _grow(self, contacts: list[_Evaluated]) -> None:
        """Couple the faces that press with the wall's nodes that they face."""
        rows, columns = [], []
        for f, c in zip(self.fingers, contacts, strict=True):
            points = f.pad.face_N.shape[0]
            near = (c.active[f.nodes] | (c.lam != 0.0)).any(axis=1)
            faces = np.repeat(np.arange(len(f.nodes)), points)
            pick = near[faces] & (c.facing.gap < FAR)
            own = np.concatenate([f.dofs.reshape(len(f.nodes), -1), f.pressures], axis=1)[faces[pick]]
            nodes = c.facing.nodes[pick]
            other = np.concatenate([self.model.first[nodes], self.model.second[nodes]], axis=2).reshape(len(nodes), -1)
            pair = [a.ravel() for a in np.broadcast_arrays(own[:, :, None], other[:, None, :])]
            among = [a.ravel() for a in np.broadcast_arrays(other[:, :, None], other[:, None, :])]
            rows += [*pair, among[0]]
            columns += [*pair[::-1], among[1]]
        moved = self.pattern.grow(np.concatenate(rows), np.concatenate(columns))
        if moved is None:
            raise AssertionError("the contact has entries that its pattern cannot hold; this is a bug")

        def move(slots: IntArray) -> IntArray:
            return np.where(slots >= 0, moved[slots], -1).astype(np.int32)

        self._wall_slots, self._foam_slots = move(self._wall_slots), [move(slots) for slots in self._foam_slots]
        if len(self.fingers) == 2:
            self._balance_slots = move(self._balance_slots)

    def shorten(self, x: FloatArray, step: FloatArray) -> float:
        """Factor that keeps the change of the travels and the squeezing of every element within reason."""
        return min(f.foam.shorten(x[f.own], step[f.own], LONGEST_CLOSING) for f in self.fingers)

    def contact_state(self, x: FloatArray, number: int) -> tuple[FloatArray, FloatArray, ContactPoints]:
        """Of one finger, in the pad's frame: nodal pressures ``(n,)`` [Pa], mean gaps ``(n,)`` [m], quadrature."""
        f = self.fingers[number]
        c = self._contact(x, self._no_force())[number]
        own, _ = f.points(x)
        normal = np.where(c.facing.gap[:, None] < FAR, c.facing.normal @ f.R, [0.0, 0.0, -1.0]).reshape(own.shape)
        gap = c.facing.gap.reshape(own.shape[:2])
        pressure = borne(f.pressure(x), c.active)
        load = np.where(gap < FAR, f.pad.face_area * (pressure[f.nodes] @ f.pad.face_N.T), 0.0)
        return pressure, c.weighted / f.pad.node_area, ContactPoints(own, normal, gap, load)

    def _no_force(self) -> FloatArray:
        return np.zeros((len(self.model.first), 3))

    def wall_load(self, x: FloatArray) -> FloatArray:
        """Contact forces on the wall's nodes ``(k, 3)`` [N]."""
        force = self._no_force()
        self._contact(x, force)
        return -force

    def wall_state(self, x: FloatArray) -> FloatArray:
        """State of the whole shell ``(6 k,)`` [m]."""
        return self.model.state(x[: self.model.size])

    def sheet_force(self, x: FloatArray) -> float:
        """Normal force on the sheets [N], mean of the fingers."""
        return float(np.mean([f.foam.sheet_force(x[f.own]) for f in self.fingers]))

    def closing(self, x: FloatArray) -> float:
        """Closing displacement of the sheets [m], mean of the fingers."""
        return float(np.mean([x[f.closing] for f in self.fingers]))


def _shift(index: IntArray, offset: int) -> IntArray:
    """Unknowns of a part as unknowns of the whole; fixed ones stay fixed."""
    return np.where(index >= 0, index + offset, -1).astype(np.int32)
