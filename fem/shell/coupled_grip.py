"""Friction that acts back between pads and a thin wall, with stick and slip as in ``fem.contact.friction_coupling``.

A point of a pad is dragged along the material point of the wall that it faced in the last accepted state::

    d = t_0 - k [(x - x_0) - sum N_a0 (v_a - v_a0)]       t from d by the law of stick and slip, along the director n

so the motion is relative to a wall that moves, and linear in all unknowns. The wall bears ``-t`` where the point faces
it now. The tangent is exact.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from softjaw.fem.assembly import pairs
from softjaw.fem.contact.friction_coupling import STICK, Damping, Path, followed, leading_to, stick_or_slip
from softjaw.fem.contact.problem import IDLE
from softjaw.fem.objects.gap import FloatArray, Pose
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.shell.facing import FAR, Wall
from softjaw.fem.shell.grip_problem import Evaluated, Finger, GripProblem
from softjaw.fem.shell.wall_kernel import add_row, changes, number
from softjaw.fem.shell.wall_model import NonlinearWall

IntArray = NDArray[np.int32]


@dataclass(frozen=True)
class _Anchor:
    """Last accepted state of one finger's points, in the object's frame.

    Attributes
    ----------
    at, wall, traction : (n, 3) arrays
        Places of the points [m], displacements of the wall's material points that they faced [m], tractions [Pa].
    nodes, N : (n, 4) arrays
        Where these lie on the wall.
    closed : (n,) array of bool
        Whether the point pressed.
    """

    at: FloatArray
    wall: FloatArray
    traction: FloatArray
    nodes: IntArray
    N: FloatArray
    closed: NDArray[np.bool_]


@dataclass(frozen=True)
class _Memory:
    """What friction depends on: the last accepted state of each finger, and all of them on the way."""

    anchors: tuple[_Anchor, ...]
    path: Path


class CoupledGripProblem(GripProblem):
    """One or two pads on a deformable wall, with friction coefficient ``mu``; for the rest a `GripProblem`."""

    def __init__(self, model: NonlinearWall, pads: Sequence[tuple[Pad, Pose, Wall]], mu: float) -> None:
        self.mu = mu
        super().__init__(model, pads)

    def forget(self) -> None:
        """See `GripProblem`."""
        super().forget()
        self.begin()

    def begin(self) -> None:
        """Begin another load path: nothing has touched yet."""
        anchors = []
        for f in self.fingers:
            n, nowhere = f.pad.face_area.size, np.zeros((f.pad.face_area.size, 3))
            none = np.zeros((n, 4), np.int32), np.zeros((n, 4)), np.zeros(n, dtype=bool)
            anchors.append(_Anchor(nowhere, nowhere, nowhere, *none))
        self.memory: _Memory = _Memory(tuple(anchors), ())
        moved = np.concatenate([np.arange(self.model.size), *(np.r_[f.offset : f.closing_dof] for f in self.fingers)])
        self._damping = Damping(moved)

    def accept(self, x: FloatArray) -> None:
        """Go on from the state ``x``: its points and tractions are those that later ones are measured from."""
        contacts, (v, _) = self._contact(x, self._no_force()), self.model.outer(x[: self.model.size])
        anchors = []
        for f, c in zip(self.fingers, contacts, strict=True):
            assert c.traction is not None
            pressure, wall = self._pressure(f, c), c.facing
            closed = (pressure > IDLE * pressure.max(initial=0.0)) & (wall.gap < FAR)
            moved = np.einsum("na,nai->ni", wall.N, v[wall.nodes])
            anchors.append(_Anchor(f.object_points(x), moved, c.traction, wall.nodes, wall.N, closed))
        self.memory = _Memory(tuple(anchors), followed(self.memory.path, x))
        self._damping.forget()

    def history(self, x: FloatArray) -> Path:
        """States that were accepted before ``x``: what its tractions depend on."""
        return leading_to(self.memory.path, x)

    def _contact(self, x: FloatArray, wall_force: FloatArray) -> list[Evaluated]:
        """As that of the frictionless problem, with the tractions' forces."""
        contacts = super()._contact(x, wall_force)
        for k, (f, c) in enumerate(zip(self.fingers, contacts, strict=True)):
            t, area = self._traction(k, x, c)[0], f.pad.face_area
            c.traction = t
            own = (t @ f.R).reshape(*area.shape, 3)
            c.force -= np.einsum("fq,qa,fqi->fia", area, f.pad.face_N, own)
            np.add.at(wall_force, c.facing.nodes, (area.ravel()[:, None] * c.facing.N)[..., None] * t[:, None, :])
        return contacts

    def _pressure(self, f: Finger, c: Evaluated) -> FloatArray:
        """Nominal pressures of the points ``(n,)`` [Pa], negative ones of quadratic faces cut off."""
        return np.maximum(c.lam @ f.pad.face_N.T, 0.0).ravel()

    def _traction(self, k: int, x: FloatArray, c: Evaluated, derivatives: bool = False) -> tuple[FloatArray, ...]:
        """Traction on the points of one pad ``(n, 3)`` [Pa] in the object's frame, and its derivatives.

        They are those by the motion along the wall ``(n, 3, 3)`` [Pa/m], by the director ``(n, 3, 3)`` [Pa] and by the
        pressure ``(n, 3)`` [-].
        """
        f, anchor = self.fingers[k], self.memory.anchors[k]
        v, _ = self.model.outer(x[: self.model.size])
        stick = STICK * f.kappa
        # what faces no wall any more has no tangent plane either
        held = (anchor.closed & (c.facing.gap < FAR))[:, None]
        moved = f.object_points(x) - anchor.at - np.einsum("na,nai->ni", anchor.N, v[anchor.nodes]) + anchor.wall
        d = np.where(held, anchor.traction - stick * moved, 0.0)
        t, *found = stick_or_slip(c.facing.normal, d, self.mu, self._pressure(f, c), derivatives)
        if not derivatives:
            return (t,)
        by_d, by_normal, by_pressure = found
        return t, -stick * by_d, by_normal, by_pressure

    def _held(self, k: int, f: Finger, c: Evaluated) -> NDArray[np.bool_]:
        """Points whose traction changes with anything."""
        return self.memory.anchors[k].closed & (c.facing.gap < FAR) & (self._pressure(f, c) > 0.0)

    def _add_contact(self, k: int, x: FloatArray, c: Evaluated) -> bool:
        complete = super()._add_contact(k, x, c)
        f, anchor, facing, pattern = self.fingers[k], self.memory.anchors[k], c.facing, self.pattern
        t, by_motion, by_normal, by_pressure = self._traction(k, x, c, derivatives=True)
        return complete & _friction_tangent(
            f.pad.face_N, f.pad.face_area, self._held(k, f, c), t, by_motion, by_normal, by_pressure, f.kappa,
            facing.gap, facing.normal, facing.nodes, facing.N, facing.H, facing.G, facing.A, anchor.nodes, anchor.N,
            f.R, f.dofs, f.pressure_dofs, self.model.first, self.model.second, pattern.start, pattern.column,
            pattern.values,
        )  # fmt: skip

    def _couplings(self, k: int, f: Finger, c: Evaluated) -> list[tuple[IntArray, IntArray]]:
        """As that of the frictionless problem, and with the nodes of the wall that points are dragged along."""
        held = self._held(k, f, c)
        faces = np.repeat(np.arange(len(f.nodes)), f.pad.face_N.shape[0])[held]
        own = f.dofs.reshape(len(f.nodes), -1)[faces]
        here, there = (self.wall_dofs(nodes[held]) for nodes in (c.facing.nodes, self.memory.anchors[k].nodes))
        rows = np.concatenate([own, here], axis=1)
        return [*super()._couplings(k, f, c), pairs(rows[:, :, None], there[:, None, :])]

    def keep(self, x: FloatArray, first: bool) -> bool:
        """As that of the frictionless problem, but every accepted state changes the tangent."""
        return not first and super().keep(x, first)

    def shorten(self, x: FloatArray, step: FloatArray) -> float:
        """As that of the frictionless problem, and as `Damping` has it."""
        return self._damping.shortened(x, step, super().shorten(x, step))


@njit(cache=True)
def _friction_tangent(N, area, held, traction, by_motion, by_normal, by_pressure, kappa, gap, normal, nodes, wall_N, H,
                      G, A, old_nodes, old_N, R, pad_dofs, pressures, first, second, start, column,
                      values) -> Any:  # fmt: skip
    """Add what friction on one pad adds to the tangent; whether all entries had a place.

    Parameters as in `fem.shell.wall_kernel.contact_tangent`; ``held (n,)`` are the points whose traction counts, and
    ``old_nodes``, ``old_N`` where their material points lie on the wall.
    """
    points, k = N.shape
    t = 3 * k  # local order: pad (component, node), wall first, wall second, pressures, old place first, second
    old = t + 24 + k
    M, change = np.empty((t + 12, t + 48 + k)), np.empty((3, t + 48 + k))
    dof = np.empty(t + 48 + k, np.int64)
    D, dn, dA = np.empty((3, t + 24)), np.empty((3, t + 24)), np.empty((4, 3, t + 24))
    complete = True
    for m in range(held.size):
        if not held[m]:
            continue
        f, q = m // points, m % points
        changes(N[q], gap[m], nodes[m], wall_N[m], H[m], G[m], A[m], R, D, dn, dA)
        change[:] = 0.0
        for d in range(3):
            for j in range(t + 24):
                for c in range(3):
                    change[d, j] += by_normal[m, d, c] * dn[c, j]
                    if j < t:
                        change[d, j] += by_motion[m, d, c] * D[c, j]
            for a in range(4):
                for c in range(3):
                    dragged = -old_N[m, a] * by_motion[m, d, c]
                    change[d, old + 3 * a + c] = change[d, old + 12 + 3 * a + c] = dragged
            for i in range(k):
                change[d, t + 24 + i] = kappa * N[q, i] * by_pressure[m, d]
        w = area[f, q]
        for j in range(t + 48 + k):
            for c in range(3):
                own = R[0, c] * change[0, j] + R[1, c] * change[1, j] + R[2, c] * change[2, j]
                for b in range(k):
                    M[c * k + b, j] = -w * N[q, b] * own
            for a in range(4):
                share = 0.0
                if j < t + 24:
                    for c in range(3):
                        share += normal[m, c] * dA[a, c, j]
                for c in range(3):
                    M[t + 3 * a + c, j] = w * (wall_N[m, a] * change[c, j] + share * traction[m, c])
        number(pad_dofs[f], pressures[f], first, second, nodes[m], dof)
        for a in range(4):
            for c in range(3):
                dof[old + 3 * a + c] = first[old_nodes[m, a], c]
                dof[old + 12 + 3 * a + c] = second[old_nodes[m, a], c]
        for r in range(t + 24):
            if dof[r] < 0:
                continue
            # what moves the outer face carries the same force
            local = r if r < t + 12 else r - 12
            complete &= add_row(dof[r], M[local], dof, start, column, values)
    return complete
