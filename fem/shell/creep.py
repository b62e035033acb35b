"""A wall that creeps to equilibrium where Newton's method does not find the next state: pseudo-transient continuation.

Wall and pads are given a resistance to their velocity, ``D dx/dt + R(x) = 0`` with ``D`` the area of a node times the
pad's modulus per thickness, in implicit steps of growing or shrinking length (Kelley and Keyes, SIAM J. Numer. Anal.
35, 1998). The energy falls along the way, so it ends in a stable state: the one nearby where only the active set did
not settle, and where a gripper that keeps its force comes to where a wall snaps from one state into another. A step
takes a few Newton iterations and need not converge; what comes of the whole is judged by an ordinary solve.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from softjaw.fem.contact.problem import Control
from softjaw.fem.errors import ConvergenceError
from softjaw.fem.objects.gap import FloatArray
from softjaw.fem.petsc import NonlinearSolver
from softjaw.fem.shell.grip_problem import GripProblem

FIRST, SHORTEST = 0.25, 1e-5  # step of time, in units of D over the pad's modulus per thickness and area
MOVE, FARTHEST = 4e-4, 1.2e-3  # of a node in one step: wanted, and the most that is taken [m]
SLOWLY, ALTERNATES, STAYS = 0.25, 1e-2, 0.05  # part of the wanted move, residual over the force and over the one before
ITERATIONS = 2  # of a step
NEAR, LOOSE = 1e-6, 30.0  # residual over the force at which a step ends early, and up to which it is taken
SHORTER = 0.4  # part of a step that is tried after one that was not taken


@dataclass(frozen=True)
class Creeping:
    """A state on the way: unknowns, and the largest velocity of a node [m per unit of time]."""

    x: FloatArray
    speed: float


def creep(problem: GripProblem, solver: NonlinearSolver, x: FloatArray, force: float) -> Iterator[Creeping]:
    """States that the wall creeps through from ``x`` at the normal force [N], without an end; the caller stops.

    Raises
    ------
    ConvergenceError
        When a step of `SHORTEST` does not serve.
    SpentError
        When the solver has no iterations left.
    """
    own, time = slice(problem.model.size), FIRST
    resistance = _resistance(problem)
    while time > SHORTEST:
        problem.control, problem.damping = Control(force=force), (resistance / time, x.copy())
        try:
            ahead, norm, fall = solver.approach(x, NEAR * force, ITERATIONS)
        finally:
            problem.damping = None
        move = float(np.abs((ahead - x)[own]).max())
        # `not <=`: NaN is not taken
        if not (norm <= LOOSE * force and move <= FARTHEST):
            time *= SHORTER
            continue
        x = ahead
        yield Creeping(x, move / time)
        # little moves, little is out of balance, but it stays so: the active set alternates, which resistance settles
        if move < SLOWLY * MOVE and NEAR < norm / force < ALTERNATES and fall > STAYS:
            time *= SHORTER
        else:
            time *= float(np.clip(MOVE / max(move, 1e-12), 0.5, 2.0))
    raise ConvergenceError(f"the wall does not creep on at {force:.4g} N")


def _resistance(problem: GripProblem) -> FloatArray:
    """Of every unknown [N/m]: none of directors, closing displacements and pressures."""
    found, first = np.zeros(problem.size), problem.model.first
    area = np.broadcast_to(problem.model.shell.node_area[:, None], first.shape)
    found[first[first >= 0]] = problem.fingers[0].kappa * area[first >= 0]
    for f in problem.fingers:
        # a node of the foam counts as much as one of its contact face would, were the face all there is
        found[f.offset : f.closing_dof] = f.kappa * f.area.sum() / f.pad.closing_dof
    return found
