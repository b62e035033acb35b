"""A wall that gives way between two fingers: how far it still is open, and how it creeps to equilibrium.

Where Newton's method does not find the next state, pseudo-transient continuation may: wall and pads are given a
resistance to their velocity, ``D dx/dt + R(x) = 0`` with ``D`` the area of a node times the pad's modulus per
thickness, in implicit steps of growing or shrinking length (Kelley and Keyes, SIAM J. Numer. Anal. 35, 1998). The
energy falls along the way, so it ends in a stable state: the one nearby where only the active set did not settle, and
where a gripper that keeps its force comes to where a wall snaps from one state into another. A step takes a few Newton
iterations and need not converge; what comes of it is judged by an ordinary solve.
"""

from collections.abc import Iterator

import numpy as np
from scipy.spatial import cKDTree

from softjaw.fem.contact.problem import Control
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.petsc import NonlinearSolver
from softjaw.fem.shell.wall_mesh import BodyMesh
from softjaw.fem.shell.wall_problem import WallProblem
from softjaw.friction.patch import FloatArray

FIRST_STEP, SHORTEST_STEP = 0.25, 1e-5  # step of time, in units of D over the pad's modulus per thickness and area
MOVE, FARTHEST = 4e-4, 1.2e-3  # of a node in one step: wanted, and the most that is taken [m]
SLOWLY, ALTERNATES, STAYS = 0.25, 1e-2, 0.05  # part of the wanted move, residual over the force and over the one before
SETTLED, LOOSE = 1e-6, 30.0  # residual over the force at which a step ends early, and up to which it is taken


class Opening:
    """How far the two halves of a wall still are apart along the approach, as a part of their undeformed distance.

    The grasp frame's x axis is the approach, so a node is compared with the one that it looks at along x: its own image
    where x = 0 is a plane of symmetry, else the nearest across from it. An indentation turns back at its deepest place,
    where it is level; so the node that lies nearest there is good enough. ``last``: opening and force [N] of the last
    state that was watched.
    """

    def __init__(self, mesh: BodyMesh) -> None:
        # inner faces meet before the middle surfaces do
        self._inner = mesh.X - mesh.D
        x = self._inner[mesh.number, 0]
        # nodes near the plane between the fingers are left out
        bound = np.maximum(0.3 * np.abs(x).max(axis=0), 1e-6)
        self._near = np.unique(mesh.number[x > bound])
        back = np.unique(mesh.number[x < -bound])
        nearest = cKDTree(self._inner[back, 1:]).query(self._inner[self._near, 1:])[1]
        self._across = None if mesh.symmetry[0] else back[nearest]
        self._undeformed = self._apart(np.zeros(mesh.X.size * 2))
        self.last = 1.0, 0.0

    def __call__(self, q: FloatArray) -> float:
        """Opening at the state ``q (6 k,)`` of the shell, where it is smallest: 1 undeformed, 0 where walls meet."""
        return float((self._apart(q) / self._undeformed).min())

    def _apart(self, q: FloatArray) -> FloatArray:
        parts = q.reshape(-1, 6)
        x = self._inner[:, 0] + parts[:, 0] - parts[:, 3]
        return x[self._near] - (-x[self._near] if self._across is None else x[self._across])

    def watch(self, q: FloatArray, force: float) -> None:
        """Note the state at a force [N] of the fingers; `CheckError` if the walls have met at a lower force."""
        opening = self(q)
        if opening > 0.0:
            self.last = opening, force
            return
        # no force in between: the opening falls ever faster, and other forces may have got further on other paths
        at = self.last[1]
        where = f"between {at:.3g} and {force:.3g} N" if 0.0 < at < force else f"at {force:.3g} N"
        raise CheckError(f"the wall collapsed: its opposite sides meet {where}")


def creep(
    problem: WallProblem, solver: NonlinearSolver, x: FloatArray, force: float
) -> Iterator[tuple[FloatArray, float]]:
    """States that the wall creeps through from ``x`` at the normal force [N], and the largest velocity of a node.

    There is no end: the caller stops. Raises `ConvergenceError`: when a step of `SHORTEST_STEP` does not serve;
    `SpentError`: when the solver has no iterations left.
    """
    wall, time = slice(problem.model.size), FIRST_STEP
    resistance = _resistance(problem)
    while time > SHORTEST_STEP:
        problem.control, problem.damping = Control(force=force), (resistance / time, x.copy())
        try:
            ahead, norm, fall = solver.approach(x, SETTLED * force, 2)
        finally:
            problem.damping = None
        move = float(np.abs((ahead - x)[wall]).max())
        # `not <=`: NaN is not taken
        if not (norm <= LOOSE * force and move <= FARTHEST):
            time *= 0.4
            continue
        x = ahead
        yield x, move / time
        # little moves, little is out of balance, but it stays so: the active set alternates, which resistance settles
        if move < SLOWLY * MOVE and SETTLED < norm / force < ALTERNATES and fall > STAYS:
            time *= 0.4
        else:
            time *= float(np.clip(MOVE / max(move, 1e-12), 0.5, 2.0))
    raise ConvergenceError(f"the wall does not creep on at {force:.4g} N")


def _resistance(problem: WallProblem) -> FloatArray:
    """Of every unknown [N/m]: none of directors, closing displacements and pressures."""
    resistance, first = np.zeros(problem.size), problem.model.first
    area = np.broadcast_to(problem.model.shell.node_area[:, None], first.shape)
    resistance[first[first >= 0]] = problem.fingers[0].kappa * area[first >= 0]
    for f in problem.fingers:
        # a node of the foam counts as much as one of its contact face would, were the face all there is
        resistance[f.offset : f.closing_dof] = f.kappa * f.area.sum() / f.pad.closing_dof
    return resistance
