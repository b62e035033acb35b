"""Frictionless contact of one or two pads with a thin-walled object, as one mixed complementarity problem.

Unknowns ``x = [q | pad 1 | pad 2]``: those of the wall (``wall_model``) and, per pad,
``[u | delta | l]`` as in ``fem.contact.problem``. With the pads' points facing the deformed wall (``facing``) the
residual is::

    R_u     = r_int(u) - int N_a p n dA                          p = sum N_i kappa l_i
    R_q     = r_int(q) + int N_a p n dA                          on both numbers that move the outer face
    R_l     = kappa [A_i l_i - max(0, A_i l_i - G_i)]            G_i = int N_i g dA
    R_delta = force on the backing plate - F                             (force)
              k (sum of the closings - their goal), and the difference of the plates' forces   (closing displacement)

All rows are forces [N]. Both pads press with the same force, each with a closing displacement of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.assembly import Pattern, add_up, gather, pairs, shifted
from softjaw.fem.contact.problem import ContactPoints, Control, PressedPad, borne
from softjaw.fem.objects.gap import FloatArray, Pose
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.shell.facing import FAR, Facing, Wall, face
from softjaw.fem.shell.wall_kernel import contact_forces, contact_tangent
from softjaw.fem.shell.wall_model import NonlinearWall

IntArray = NDArray[np.int32]
LONGEST_CLOSING = 1e-3  # of one iteration [m]
CARRIED = 0.3  # part of a node's area that must face the wall for the node to carry load


class Finger(PressedPad):
    """One pad, where it stands and what it can touch.

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
        super().__init__(pad, offset)
        self.pose, self.wall = pose, wall
        self.R = np.ascontiguousarray(pose.rotation)
        self.foam_entries = shifted(self.foam.rows, offset), shifted(self.foam.columns, offset)

    def object_points(self, x: FloatArray) -> FloatArray:
        """Quadrature points of the contact face in the object's frame ``(n, 3)`` [m]."""
        return self.pose.to_object(self.points(x).reshape(-1, 3))


@dataclass
class Evaluated:
    """What the contact of one finger came to."""

    facing: Facing
    lam: FloatArray
    weighted: FloatArray
    active: NDArray[np.bool_]
    force: FloatArray
    traction: FloatArray | None = None  # of friction on the pad's points (n, 3), in the object's frame [Pa]


class GripProblem:
    """Residual and tangent of one or two pads on a deformable wall (see ``fem.petsc.Problem``).

    Parameters
    ----------
    model : NonlinearWall or LinearWall
        The wall; its unknowns come first.
    pads : sequence of (Pad, Pose, Wall)
        One where a plane of symmetry lies between the fingers, else two; with what each can touch.
    """

    complementarity, non_negative = False, slice(0)  # the active set is part of the residual, whatever the solver
    memory: Any = None  # what friction knows of the last accepted state

    def __init__(self, model: NonlinearWall, pads: Sequence[tuple[Pad, Pose, Wall]]) -> None:
        self.model = model
        self.fingers: list[Finger] = []
        self.size = model.size
        for pad, pose, wall in pads:
            self.fingers.append(Finger(pad, pose, wall, self.size))
            self.size += pad.size
        self.stiffness = sum(f.kappa * f.area.sum() for f in self.fingers)
        self.control = Control(closing=0.0)
        # stiffness (size,) [N/m] that ties displacements to those of a state (size,), see ``creep``
        self.damping: tuple[FloatArray, FloatArray] | None = None
        self._first_places = [f.wall.places(f.object_points(np.zeros(self.size))) for f in self.fingers]
        self._bare = self._built()
        self._values = [np.zeros(len(f.foam.rows)) for f in self.fingers]
        self.forget()

    def forget(self) -> None:
        """Be as a new problem, so that not a bit of what follows depends on what was evaluated before."""
        # kept from call to call: where a point was is the best start for where it is now
        self.places = [places.copy() for places in self._first_places]
        pattern, self._wall_slots, self._foam_slots, self._balance_slots = self._bare
        self.pattern = copy(pattern)

    @property
    def control(self) -> Control:
        """What drives the fingers; setting it begins a new solve, whose first tangent of the wall is the plain one."""
        return self._control

    @control.setter
    def control(self, control: Control) -> None:
        self._control = control
        self._before: FloatArray | None = None

    def _built(self) -> tuple[Pattern, IntArray, list[IntArray], IntArray]:
        """Pattern of all but the couplings between pads and wall, which come as pads touch, and the parts' slots."""
        rows, columns = zip(self.model.entries, *map(self._own_entries, self.fingers), strict=True)
        pattern = Pattern(self.size, np.concatenate(rows), np.concatenate(columns))
        # the last finger holds the first one's back in the row of its own closing, if they are two
        one, last = self.fingers[0], self.fingers[-1]
        back = one.foam_entries[1][one.foam.closing_entries][: None if last is not one else 0]
        balance = pattern.slots(np.full_like(back, last.closing_dof), back)
        foams = [pattern.slots(*f.foam_entries) for f in self.fingers]
        return pattern, pattern.slots(*self.model.entries), foams, balance

    def _own_entries(self, f: Finger) -> tuple[IntArray, IntArray]:
        one, other = pairs(f.dofs[:, :, :, None], f.pressure_dofs[:, None, None, :])
        rows, columns = [f.foam_entries[0], one, other], [f.foam_entries[1], other, one]
        if f is self.fingers[-1] and f is not self.fingers[0]:
            # its closing row may hold the balance of both backing plates
            first = self.fingers[0]
            back = first.foam_entries[1][first.foam.closing_entries]
            rows += [np.full_like(back, f.closing_dof), np.array([first.closing_dof], np.int32)]
            columns += [back, np.array([f.closing_dof], np.int32)]
        return np.concatenate(rows), np.concatenate(columns)

    def _contact(self, x: FloatArray, wall_force: FloatArray) -> list[Evaluated]:
        """Evaluate the contact of all fingers; adds to the forces on the wall's nodes."""
        v, w = self.model.outer(x[: self.model.size])
        contacts = []
        for f, places in zip(self.fingers, self.places, strict=True):
            facing = face(f.wall, f.object_points(x), places, v, w)
            pad, lam = f.pad, f.pressure(x)[f.nodes]
            (weighted, part), force = np.empty((2, *f.nodes.shape)), np.empty((len(f.nodes), 3, f.nodes.shape[1]))
            contact_forces(
                pad.face_N, pad.face_area, lam, facing.gap, facing.normal, facing.nodes, facing.N, f.R,
                weighted, part, force, wall_force,
            )  # fmt: skip
            # a node that hangs over the rim with most of its area would put all of its pressure on the rest
            gaps = np.where(f.nodal(part) > CARRIED * f.area, f.nodal(weighted), FAR * f.area)
            contacts.append(Evaluated(facing, lam, gaps, f.active(x[f.pressures], gaps), force))
        return contacts

    def residual(self, x: FloatArray) -> FloatArray:
        """Residual of all rows ``(size,)`` [N]; NaN where an element is inverted, so that the step is refused."""
        if not np.isfinite(x).all():
            return np.full(self.size, np.nan)
        R, wall_force = np.zeros(self.size), self._no_force()
        try:
            contacts = self._contact(x, wall_force)
        # a point without a place on the wall: refuse the step, a shorter one will find it
        except ArithmeticError:
            return np.full(self.size, np.nan)
        self._active_set = np.concatenate([c.active for c in contacts])
        R[: self.model.size] = self.model.residual(x[: self.model.size], wall_force)
        for f, c in zip(self.fingers, contacts, strict=True):
            own, smallest = f.foam.force(x[f.own])
            if not smallest > 0.0:
                return np.full(self.size, np.nan)
            R[f.own] = own + gather(f.local_dofs, c.force, f.pad.size)
            R[f.pressures] = f.contact_rows(x[f.pressures], c.weighted)
        self._drive(x, R)
        if self.damping is not None:
            stiffness, before = self.damping
            R += stiffness * (x - before)
        return R

    def _drive(self, x: FloatArray, R: FloatArray) -> None:
        """Rows of the closing displacements; they hold the forces on the backing plates so far."""
        one, last = self.fingers[0], self.fingers[-1]
        if self.control.force is not None:
            for f in self.fingers:
                R[f.closing_dof] -= self.control.force * f.pad.share
            return
        if last is not one:
            # forces of whole pads, whatever part of each is meshed
            R[last.closing_dof] = R[last.closing_dof] / last.pad.share - R[one.closing_dof] / one.pad.share
        closing = np.mean([x[f.closing_dof] for f in self.fingers])
        R[one.closing_dof] = self.stiffness * (closing - self.control.closing)

    def tangent(self, x: FloatArray) -> None:
        """Fill ``pattern.values`` with the tangent at ``x``; the pattern grows by what newly touches."""
        q = x[: self.model.size].copy()
        wall = self.model.tangent(q, self._before)
        self._before, self._by_force, self._damped = q, self.control.force is not None, self.damping
        contacts = self._contact(x, self._no_force())
        self._tangent_set = np.concatenate([c.active for c in contacts])
        for f, values in zip(self.fingers, self._values, strict=True):
            f.foam.stiffness(x[f.own], values)
        # adding the contact may find entries without a place; the pattern grows and all is filled once more
        while True:
            self._fill(wall, contacts)
            if all([self._add_contact(k, x, c) for k, c in enumerate(contacts)]):
                return
            self._grow(contacts)

    def keep(self, x: FloatArray, first: bool) -> bool:
        """Whether the last tangent may serve once more, as in ``fem.contact.problem``."""
        same_control = self._by_force == (self.control.force is not None) and self._damped is self.damping
        if not same_control or not np.array_equal(self._active_set, self._tangent_set):
            return False
        if first:
            self._before = x[: self.model.size].copy()  # the wall's next tangent counts its step from here
        return True

    def _fill(self, wall: FloatArray, contacts: list[Evaluated]) -> None:
        """Entries of wall, foam, idle pressures and control."""
        values = self.pattern.values
        values[:] = 0.0
        add_up(self._wall_slots, wall, values)
        if self.damping is not None:
            tied = np.flatnonzero(self.damping[0])
            values[self.pattern.slots(tied, tied)] += self.damping[0][tied]
        for f, slots, own, c in zip(self.fingers, self._foam_slots, self._values, contacts, strict=True):
            add_up(slots, own, values)
            idle = np.flatnonzero(~c.active)
            index = f.closing_dof + 1 + idle
            values[self.pattern.slots(index, index)] += f.kappa * f.area[idle]
        if self.control.force is None:
            self._fill_closing_rows(values)

    def _fill_closing_rows(self, values: FloatArray) -> None:
        """Under displacement control the first row holds the mean closing, the second the balance of both plates."""
        one, last = self.fingers[0], self.fingers[-1]
        back = self._foam_slots[0][one.foam.closing_entries]
        if last is not one:
            values[self.pattern.start[last.closing_dof] : self.pattern.start[last.closing_dof + 1]] /= last.pad.share
            add_up(self._balance_slots, -self._values[0][one.foam.closing_entries] / one.pad.share, values)
        values[back[back >= 0]] = 0.0
        closings = np.array([f.closing_dof for f in self.fingers])
        values[self.pattern.slots(np.full_like(closings, one.closing_dof), closings)] = self.stiffness / len(closings)

    def _add_contact(self, k: int, x: FloatArray, c: Evaluated) -> bool:
        """Add the contact of the ``k``-th finger to the tangent; whether the pattern has a place for all entries."""
        f, facing, pattern = self.fingers[k], c.facing, self.pattern
        pad = f.pad
        return contact_tangent(
            pad.face_N, pad.face_area, c.lam, c.active[f.nodes], f.kappa, facing.gap, facing.normal, facing.e,
            facing.nodes, facing.N, facing.H, facing.G, facing.A, f.R, f.dofs, f.pressure_dofs, self.model.first,
            self.model.second, pattern.start, pattern.column, pattern.values,
        )  # fmt: skip

    def _grow(self, contacts: list[Evaluated]) -> None:
        """Couple the faces that press with the wall's nodes that they face."""
        each = [self._couplings(k, f, c) for k, (f, c) in enumerate(zip(self.fingers, contacts, strict=True))]
        rows, columns = zip(*(part for own in each for part in own), strict=True)
        moved = self.pattern.grow(np.concatenate(rows), np.concatenate(columns))
        if moved is None:
            raise AssertionError("the contact has entries that its pattern cannot hold; this is a bug")

        def move(slots: IntArray) -> IntArray:
            return np.where(slots >= 0, moved[slots], -1).astype(np.int32)

        self._wall_slots, self._foam_slots = move(self._wall_slots), [move(slots) for slots in self._foam_slots]
        self._balance_slots = move(self._balance_slots)

    def _couplings(self, k: int, f: Finger, c: Evaluated) -> list[tuple[IntArray, IntArray]]:
        """Rows and columns of the entries that the contact of the ``k``-th finger may have."""
        faces = np.repeat(np.arange(len(f.nodes)), f.pad.face_N.shape[0])
        # facets that already press, or that the next iteration may close
        pick = (c.active[f.nodes] | (c.lam != 0.0)).any(axis=1)[faces] & (c.facing.gap < FAR)
        own = np.concatenate([f.dofs.reshape(len(f.nodes), -1), f.pressure_dofs], axis=1)[faces[pick]]
        other = self.wall_dofs(c.facing.nodes[pick])
        pair = pairs(own[:, :, None], other[:, None, :])
        return [pair, (pair[1], pair[0]), pairs(other[:, :, None], other[:, None, :])]

    def wall_dofs(self, nodes: IntArray) -> IntArray:
        """Unknowns ``(n, 24)`` that move the outer face at nodes ``(n, 4)`` of the wall, -1 where fixed."""
        both = np.concatenate([self.model.first[nodes], self.model.second[nodes]], axis=2)
        return both.reshape(len(nodes), 24)

    def shorten(self, x: FloatArray, step: FloatArray) -> float:
        """Factor that keeps the change of closing displacements and the compression of every element within reason."""
        return min(f.foam.shorten(x[f.own], step[f.own], LONGEST_CLOSING) for f in self.fingers)

    def begin(self) -> None:
        """Begin another load path; without friction it does not matter."""

    def accept(self, x: FloatArray) -> None:
        """Note a state that the next one starts from; without friction the load path does not matter."""

    def history(self, x: FloatArray) -> tuple[FloatArray, ...]:
        """States that ``x`` depends on, the first one first."""
        return ()

    def contact_state(self, x: FloatArray, number: int) -> tuple[FloatArray, FloatArray, ContactPoints]:
        """Of one finger, in the pad's frame: nodal pressures ``(n,)`` [Pa], mean gaps ``(n,)`` [m], quadrature."""
        f = self.fingers[number]
        c = self._contact(x, self._no_force())[number]
        own = f.points(x)
        # a point that faces no wall gets the approach, so that the patch has no face without a normal
        normal = np.where(c.facing.gap[:, None] < FAR, c.facing.normal @ f.R, [0.0, 0.0, -1.0]).reshape(own.shape)
        gap = c.facing.gap.reshape(own.shape[:2])
        pressure = borne(f.pressure(x), c.active)
        # a node may carry load over the rim, but its points beyond it press on nothing
        load = np.where(gap < FAR, f.loads(pressure), 0.0)
        friction = None if c.traction is None else f.pad.face_area[..., None] * (c.traction @ f.R).reshape(own.shape)
        return pressure, c.weighted / f.area, ContactPoints(own, normal, max(0.0, -float(gap.min())), load, friction)

    def _no_force(self) -> FloatArray:
        return np.zeros((len(self.model.first), 3))

    def wall_load(self, x: FloatArray) -> FloatArray:
        """Contact forces on the wall's nodes ``(k, 3)`` [N]."""
        force = self._no_force()
        self._contact(x, force)
        # the kernel adds what enters the residual, the negative of the load
        return -force

    def wall_state(self, x: FloatArray) -> FloatArray:
        """State of the whole shell ``(6 k,)`` [m]."""
        return self.model.state(x[: self.model.size])

    def normal_force(self, x: FloatArray) -> float:
        """Normal force on the backing plates [N], mean of the fingers."""
        return float(np.mean([f.foam.normal_force(x[f.own]) for f in self.fingers]))

    def closing(self, x: FloatArray) -> float:
        """Closing displacement of the backing plates [m], mean of the fingers."""
        return float(np.mean([x[f.closing_dof] for f in self.fingers]))
