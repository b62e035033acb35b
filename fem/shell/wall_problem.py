"""Contact of one or two pads with a wall that gives way: wall, pads' places on it, and the tangent.

With the pads' points facing the deformed wall (``fem.shell.facing``) its rows in `fem.contact.problem` are::

    R_q = r_int(q) + int N_a (p n - t) dA      on both numbers that move the outer face

Friction drags a point along the material point of the wall that it faced in the last accepted state::

    d = t_0 - k [(x - x_0) - sum N_a0 (v_a - v_a0)]       t from d by the law of stick and slip, along the director n

so the motion is relative to a wall that moves, and linear in all unknowns. The wall bears ``-t`` where the point faces
it now. The tangent is exact.
"""

from collections.abc import Sequence
from copy import copy

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.assembly import IntArray, Pattern, gather, pairs
from softjaw.fem.contact.friction import Anchor
from softjaw.fem.contact.problem import ContactProblem, Control, Evaluated, Finger, Gap
from softjaw.fem.objects.gap import Pose
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.shell.facing import Facing, Wall, face
from softjaw.fem.shell.wall_kernel import add_blocks, changes, force_blocks
from softjaw.fem.shell.wall_model import NonlinearWall
from softjaw.friction.patch import FloatArray

# Norm of the residual over modulus, thickness, extent and the root of the unknowns: its forces are differences of large
# numbers.
ROUNDING = 4e-16
BEYOND = 2e-3  # by which the wall is continued for points that slide across a rim [m]


class WallProblem(ContactProblem):
    """One pad (where a plane of symmetry lies between the fingers) or two on a wall, whose unknowns come first."""

    longest_closing = 1e-3

    def __init__(
        self, model: NonlinearWall, pads: Sequence[tuple[Pad, Gap, Pose, Wall]], mu: float | None = None
    ) -> None:
        self.model = model
        # stiffness (size,) [N/m] that ties displacements to those of a state (size,), see ``creep``
        self.damping: tuple[FloatArray, FloatArray] | None = None
        fingers: list[Finger] = []
        for pad, gap, pose, wall in pads:
            fingers.append(Finger(pad, gap, fingers[-1].unknowns.stop if fingers else model.size, pose, wall))
        super().__init__(fingers, mu)
        self._damped_by: tuple[FloatArray, FloatArray] | None = None  # of the last tangent
        self._first_places = [f.wall.places(self._object_points(f, np.zeros(self.size))) for f in fingers]
        self._bare = self._built()
        self._values = [np.zeros(len(f.foam.rows)) for f in fingers]
        self.forget()

    def forget(self) -> None:
        """See `ContactProblem`."""
        super().forget()
        # kept from call to call: where a point was is the best start for where it is now
        self.places = [places.copy() for places in self._first_places]
        pattern, self._wall_slots, self._foam_slots, self._balance_slots = self._bare
        self.pattern, self._met_before = copy(pattern), [set[tuple[int, ...]]() for _ in self.fingers]

    @property
    def control(self) -> Control:
        """What drives the fingers; setting it begins a new solve, whose first tangent of the wall is the plain one."""
        return self._control

    @control.setter
    def control(self, control: Control) -> None:
        self._control = control
        self._before: FloatArray | None = None

    @property
    def rounding(self) -> float:
        """See `ContactProblem`."""
        shell = self.model.shell
        area = shell.mesh.thickness.max() * np.abs(shell.mesh.X).max()
        return float(ROUNDING * shell.young_modulus * area * np.sqrt(shell.size)) + super().rounding

    def _object_points(self, f: Finger, x: FloatArray) -> FloatArray:
        """Quadrature points of a contact face in the object's frame ``(n, 3)`` [m]."""
        return f.pose.to_object(f.points(x).reshape(-1, 3))

    def _built(self) -> tuple[Pattern, IntArray, list[IntArray], IntArray]:
        """Pattern of all but the couplings between pads and wall, which come as pads touch, and the parts' slots."""
        rows, columns = zip(self.model.entries, *map(self._pad_entries, self.fingers), strict=True)
        pattern = Pattern(self.size, np.concatenate(rows), np.concatenate(columns))
        # the last finger holds the first one's back in the row of its own closing, if they are two
        first, last = self.fingers[0], self.fingers[-1]
        back = first.foam_entries[1][first.foam.closing_entries][: None if last is not first else 0]
        balance = pattern.slots(np.full_like(back, last.closing_dof), back)
        foams = [pattern.slots(*f.foam_entries) for f in self.fingers]
        return pattern, pattern.slots(*self.model.entries), foams, balance

    def _pad_entries(self, f: Finger) -> tuple[IntArray, IntArray]:
        moved, pressed = pairs(f.dofs[:, :, :, None], f.pressure_dofs[:, None, None, :])
        rows, columns = [f.foam_entries[0], moved, pressed], [f.foam_entries[1], pressed, moved]
        if f is self.fingers[-1] and f is not self.fingers[0]:
            # its closing row may hold the balance of both backing plates
            first = self.fingers[0]
            back = first.foam_entries[1][first.foam.closing_entries]
            rows += [np.full_like(back, f.closing_dof), np.array([first.closing_dof], np.int32)]
            columns += [back, np.array([f.closing_dof], np.int32)]
        return np.concatenate(rows), np.concatenate(columns)

    def _met(self, k: int, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, Facing]:
        f = self.fingers[k]
        points = self._object_points(f, x)
        facing = face(f.wall, points, self.places[k], *self.model.outer(x[: self.model.size]), BEYOND)
        return points, facing.gap, facing.normal, facing

    def evaluate(self, x: FloatArray) -> list[Evaluated]:
        """See `ContactProblem`; the forces on the wall's nodes are noted [N]."""
        contacts = super().evaluate(x)
        self._wall_force = np.zeros((len(self.model.first), 3))
        for c in contacts:
            np.add.at(self._wall_force, c.surface.nodes, c.surface.N[..., None] * c.load[:, None, :])
        return contacts

    def residual(self, x: FloatArray) -> FloatArray:
        """See `ContactProblem`."""
        R = super().residual(x)
        if np.isnan(R[-1]):
            return R
        R[: self.model.size] = self.model.residual(x[: self.model.size], self._wall_force)
        if self.damping is not None:
            stiffness, before = self.damping
            R += stiffness * (x - before)
        return R

    def tangent(self, x: FloatArray) -> None:
        """Fill ``pattern.values`` with the tangent at ``x``; the pattern grows by what newly touches."""
        q = x[: self.model.size].copy()
        wall = self.model.tangent(q, self._before)
        self._before, self._by_force, self._damped_by = q, self.control.force is not None, self.damping
        contacts = self.evaluate(x)
        self._tangent_set = np.concatenate([c.active for c in contacts])
        for f, values in zip(self.fingers, self._values, strict=True):
            f.foam.stiffness(x[f.unknowns], values)
        self._couple(contacts)
        self._fill(wall, contacts)
        for k, c in enumerate(contacts):
            self._add_contact(k, x, c)

    def keep(self, x: FloatArray, first: bool) -> bool:
        """See `ContactProblem`."""
        keeps = self._damped_by is self.damping and super().keep(x, first)
        if keeps and first:
            self._before = x[: self.model.size].copy()  # the wall's next tangent counts its step from here
        return keeps

    def _fill(self, wall: FloatArray, contacts: list[Evaluated]) -> None:
        """Entries of wall, foam, idle pressures and control."""
        values = self.pattern.values
        values[:] = gather(self._wall_slots, wall, values.size)
        if self.damping is not None:
            tied = np.flatnonzero(self.damping[0])
            values[self.pattern.slots(tied, tied)] += self.damping[0][tied]
        for f, slots, foam, c in zip(self.fingers, self._foam_slots, self._values, contacts, strict=True):
            values += gather(slots, foam, values.size)
            idle = np.flatnonzero(~c.active)
            index = f.closing_dof + 1 + idle
            values[self.pattern.slots(index, index)] += f.kappa * f.area[idle]
        if self.control.force is None:
            self._fill_closing_rows(values)

    def _fill_closing_rows(self, values: FloatArray) -> None:
        """Under displacement control the first row holds the mean closing, the second the balance of both plates."""
        first, last = self.fingers[0], self.fingers[-1]
        back = self._foam_slots[0][first.foam.closing_entries]
        if last is not first:
            values[self.pattern.start[last.closing_dof] : self.pattern.start[last.closing_dof + 1]] /= last.pad.share
            balance = -self._values[0][first.foam.closing_entries] / first.pad.share
            values += gather(self._balance_slots, balance, values.size)
        values[back[back >= 0]] = 0.0
        closings = np.array([f.closing_dof for f in self.fingers])
        mean = self.pattern.slots(np.full_like(closings, first.closing_dof), closings)
        values[mean] = self.closing_stiffness / len(closings)

    def _add_contact(self, k: int, x: FloatArray, c: Evaluated) -> None:
        """Add the contact of the ``k``-th finger to the tangent."""
        f, pick = self.fingers[k], self._engaged(self.fingers[k], c)
        if not len(pick):
            return
        facet, point = np.divmod(pick, f.pad.face_N.shape[0])
        facing = Facing(*(values[pick] for values in c.surface))
        N, area = f.pad.face_N[point], f.faced[facet, point]
        D, dn = changes(N, f.R, facing)
        pressure = (c.lam[facet] * N).sum(axis=1)
        force, by_lam = pressure[:, None] * facing.normal, facing.normal
        change = pressure[:, None, None] * dn
        nodes, old = self.wall_dofs(facing.nodes), np.empty((len(pick), 3, 0))
        before = np.empty((len(pick), 0), np.int32)
        if self.friction is not None:
            anchor, loaded = self.friction.anchors[k], self._dragged(k, f, c)[pick]
            slip = self.traction(k, x, c, derivatives=True)
            t, by_motion, by_normal, by_pressure = (v[pick] * loaded.reshape(-1, *[1] * (v.ndim - 1)) for v in slip)
            force, by_lam, pad = force + t, by_lam + by_pressure, slice(3 * N.shape[1])
            change += by_normal @ dn
            change[:, :, pad] += by_motion @ D[:, :, pad]
            dragged = -np.einsum("na,ndc->ndac", anchor.N[pick], by_motion).reshape(len(pick), 3, 12)
            old = np.concatenate([dragged, dragged], axis=2)
            before = np.where(loaded[:, None], self.wall_dofs(anchor.nodes[pick]), -1)
        moved = np.concatenate([f.dofs[facet].reshape(len(pick), -1), nodes], axis=1)
        unknowns = np.concatenate([moved, f.pressure_dofs[facet], before], axis=1)
        change = np.concatenate([change, f.kappa * by_lam[:, :, None] * N[:, None], old], axis=2)
        forces = area[:, None, None] * force_blocks(N, f.R, facing, D, force, change)
        gaps = (f.kappa * area[:, None] * N)[:, :, None] * (facing.e[:, None] @ D)
        rows = np.where(c.active[f.nodes[facet]], f.pressure_dofs[facet], -1)
        stored = self.pattern.start, self.pattern.column, self.pattern.values
        add_blocks(forces, moved, unknowns, *stored)
        add_blocks(gaps, rows, moved, *stored)

    def _engaged(self, f: Finger, c: Evaluated) -> IntArray:
        """Points that face the wall, of facets that already press or that the next iteration may close: few."""
        presses = (c.active[f.nodes] | (c.lam != 0.0)).any(axis=1)
        return np.flatnonzero(np.repeat(presses, f.pad.face_N.shape[0]) & c.faces)

    def _couple(self, contacts: list[Evaluated]) -> None:
        """Give the facets that press a place in the pattern with the wall's nodes that they face."""
        new = [self._meetings(k, c) - met for k, (c, met) in enumerate(zip(contacts, self._met_before, strict=True))]
        if not any(new):
            return
        parts = list[tuple[IntArray, IntArray]]()
        for f, met, meetings in zip(self.fingers, self._met_before, new, strict=True):
            met |= meetings
            parts += self._couplings(f, np.array(sorted(meetings), np.int32).reshape(-1, 9))
        rows, columns = map(np.concatenate, zip(*parts, strict=True))
        moved = self.pattern.grow(rows, columns)

        def move(slots: IntArray) -> IntArray:
            return np.where(slots >= 0, moved[slots], -1).astype(np.int32)

        self._wall_slots, self._foam_slots = move(self._wall_slots), [move(slots) for slots in self._foam_slots]
        self._balance_slots = move(self._balance_slots)

    def _meetings(self, k: int, c: Evaluated) -> set[tuple[int, ...]]:
        """Facets of the ``k``-th finger that press, each with the four nodes of the wall that a point of it faces.

        Behind them the four that friction drags the point along, -1 where it does not.
        """
        f = self.fingers[k]
        pick = self._engaged(f, c)
        before = np.full((len(pick), 4), -1)
        if self.friction is not None:
            dragged = self._dragged(k, f, c)[pick]
            before[dragged] = self.friction.anchors[k].nodes[pick[dragged]]
        meetings = np.column_stack([pick // f.pad.face_N.shape[0], c.surface.nodes[pick], before])
        return set(map(tuple, meetings.tolist()))

    def _couplings(self, f: Finger, meetings: IntArray) -> list[tuple[IntArray, IntArray]]:
        """Rows and columns of the entries that contact and friction may have between facets and nodes ``(n, 9)``."""
        facet, now, before = meetings[:, 0], meetings[:, 1:5], meetings[:, 5:]
        moved, on_wall = f.dofs.reshape(len(f.dofs), -1)[facet], self.wall_dofs(now)
        on_pad = np.concatenate([moved, f.pressure_dofs[facet]], axis=1)
        along = np.where(before[:, :1] >= 0, self.wall_dofs(before), -1)
        pair = pairs(on_pad[:, :, None], on_wall[:, None, :])
        drag = pairs(np.concatenate([moved, on_wall], axis=1)[:, :, None], along[:, None, :])
        return [pair, (pair[1], pair[0]), pairs(on_wall[:, :, None], on_wall[:, None, :]), drag]

    def wall_dofs(self, nodes: IntArray) -> IntArray:
        """Unknowns ``(n, 24)`` that move the outer face at nodes ``(n, 4)`` of the wall, -1 where fixed."""
        first, second = (part[nodes].reshape(len(nodes), 12) for part in (self.model.first, self.model.second))
        return np.concatenate([first, second], axis=1)

    # -- friction that acts back --------------------------------------------------------------------------------------

    def _damped(self) -> NDArray[np.int64]:
        pads = (np.arange(f.offset, f.closing_dof) for f in self.fingers)
        return np.concatenate([np.arange(self.model.size), *pads])

    def _anchor(self, f: Finger, x: FloatArray, c: Evaluated) -> Anchor:
        faced = super()._anchor(f, x, c)._replace(nodes=c.surface.nodes, N=c.surface.N)
        return faced._replace(at=faced.at - self._displaced(x, faced))

    def _moved(self, x: FloatArray, c: Evaluated, anchor: Anchor) -> FloatArray:
        return super()._moved(x, c, anchor) - self._displaced(x, anchor)

    def _displaced(self, x: FloatArray, anchor: Anchor) -> FloatArray:
        """Displacements ``(n, 3)`` of the wall's material points that the pad's points faced last [m]."""
        v, _ = self.model.outer(x[: self.model.size])
        return np.asarray(np.einsum("na,nai->ni", anchor.N, v[anchor.nodes]))

    def _dragged(self, k: int, f: Finger, c: Evaluated) -> NDArray[np.bool_]:
        """Points whose traction changes with anything."""
        assert self.friction is not None
        return self.friction.anchors[k].closed & c.faces & (self.point_pressure(f, c) > 0.0)

    # -- states -------------------------------------------------------------------------------------------------------

    def wall_load(self, x: FloatArray) -> FloatArray:
        """Contact forces on the wall's nodes ``(k, 3)`` [N]."""
        self.evaluate(x)
        # the kernel adds what enters the residual, the negative of the load
        return -self._wall_force

    def wall_state(self, x: FloatArray) -> FloatArray:
        """State of the whole shell ``(6 k,)`` [m]."""
        return self.model.state(x[: self.model.size])
