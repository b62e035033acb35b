"""Follow the load path of pads on an object: states at growing normal forces, each started from the one before.

Or each from the states of a coarser mesh. With friction that acts back a state depends on its path: that leads through
fixed forces (see `fem.contact.friction`), and every force that is asked for is a branch from the last of them below it,
which leads nowhere else. So it is the same whatever else is asked for, and every mesh has its own path. What is done
where one step does not reach a force depends on the object: `fem.contact.press` is for rigid ones, `fem.shell.grip` for
walls that give way. Every state that is passed on has converged and has been checked.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from softjaw.fem.contact.checks import ALTERNATING, Checks, check
from softjaw.fem.contact.friction import PATH_RESIDUAL, Anchor, load_steps
from softjaw.fem.contact.load_stepping import ASTRAY, RESIDUAL, STRAY, Stepping, Work
from softjaw.fem.contact.problem import ContactPoints, ContactProblem
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.objects.gap import Pose
from softjaw.fem.pad.interpolation import interpolated
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.petsc import NonlinearSolver
from softjaw.friction.patch import FloatArray

ProblemT = TypeVar("ProblemT", bound=ContactProblem)


class Pressed(NamedTuple):
    """A pad in equilibrium on the object at one normal force, with the wall and the other pad that it shares it with.

    ``force, closing``: normal force [N] and closing displacement of the backing plate from first touch [m].
    ``unknowns (n,)``: state of the solver. ``pad``: that it was solved with, the fallback where the pad itself had no
    solution; ``pose``: its frame at first touch, from which a rigid object is seen. ``pressure (contact nodes,)``:
    nominal contact pressure, in the order of ``Pad.contact_nodes`` [Pa]; ``contact_face (contact nodes, 3)``: deformed
    nodes of the contact face, in the pad's frame at first touch [m]; ``points``: position, normal and load of its
    quadrature points. ``work``: effort; that of two pads that are solved at once is counted with the first.
    ``path_dependent``: whether pad or wall has jumped before, so that another load path may lead to another state.
    ``instead``: whether a fallback was taken. ``notes``: which means beside Newton's method on steps of the force it
    took. ``wall``: the wall that gives way; ``other``: the second pad on it.
    """

    force: float
    closing: float
    unknowns: FloatArray
    pad: Pad
    pose: Pose
    pressure: FloatArray
    contact_face: FloatArray
    points: ContactPoints
    checks: Checks
    work: Work
    path_dependent: bool = False
    instead: bool = False
    notes: tuple[str, ...] = ()
    wall: Any = None
    other: Pressed | None = None

    @property
    def fingers(self) -> tuple[Pressed, ...]:
        """The pad, and the other one if there is one."""
        return (self,) if self.other is None else (self, self.other)


class OnPath(NamedTuple):
    """State on the load path: unknowns, force [N], and what is known of the path so far.

    ``jumped`` is whether it has left the path of equilibria before; of a wall ``compliance`` is that of the last step
    [m/N], and ``snapped`` is as in `fem.shell.grip.WallState`.
    """

    x: FloatArray
    force: float
    jumped: bool = False
    compliance: float = 0.0
    snapped: bool = False


class _PathState(NamedTuple, Generic[ProblemT]):
    """State on the path of friction, the effort up to it, and what the next one depends on."""

    at: OnPath
    work: Work
    problem: ProblemT
    others: tuple[Callable[[], ProblemT], ...]
    anchors: tuple[Anchor, ...]


class LoadPath(ABC, Generic[ProblemT]):
    """Pads on one object along a load path.

    ``problems``: make the problem, and the same one with other gaps, the best first, for forces at which it has no
    solution; all number their unknowns alike. ``options``: PETSc options with the prefix ``contact_``. ``stride``: with
    friction the path leads through every ``stride``-th of its forces; 2 tells what its steps leave.
    """

    MOST_ITERATIONS: int  # of Newton's method for one force

    def __init__(
        self, problems: Sequence[Callable[[], ProblemT]], options: dict[str, Any] | None = None, stride: int = 1
    ) -> None:
        self.options = options or {}
        self._fallbacks = self._others = tuple(problems[1:])  # the latter: those that have not been taken yet
        self._wanted = self.problem = problems[0]()
        self._stride, self._path = stride, list[_PathState[ProblemT]]()
        self._end: ConvergenceError | CheckError | None = None  # what ended the path
        self._begin()
        self._set_up()

    def _set_up(self) -> None:
        """Make solver and steps for the problem as it is now."""
        self.solver = NonlinearSolver(self.problem, self.options)
        self._stepping = self._steps()

    @abstractmethod
    def _steps(self) -> Stepping:
        """Steps of the problem as it is now, of which none has been made."""

    def _switch(self, problem: ProblemT) -> None:
        """Continue with another problem; clock, remaining iterations and tolerances stay."""
        seconds, iterations, before = self.solver.seconds, self.solver.iterations_left, self._stepping
        self.solver.destroy()
        self.problem = problem
        self._set_up()
        self.solver.seconds, self.solver.iterations_left = seconds, iterations
        self._stepping.residual, self._stepping.slack = before.residual, before.slack

    def _begin(self) -> None:
        """Nothing has been solved on the load path yet."""

    @abstractmethod
    def _watch(self, x: FloatArray, force: float) -> None:
        """Note a state that the next one starts from."""

    def _begin_afresh(self, state: _PathState[ProblemT] | None = None) -> None:
        """Forget what was solved before but for a ``state``, so that not a bit of what follows depends on the rest."""
        self._begin()
        self._others, problem = (state.others, state.problem) if state else (self._fallbacks, self._wanted)
        problem.forget()
        if self.problem is not problem:
            self._switch(problem)
        self.solver.forget()
        self._stepping = self._steps()
        self.solver.iterations_left = self.MOST_ITERATIONS
        if state:
            assert problem.friction is not None
            problem.friction.anchors, self._stepping.jumped = state.anchors, state.at.jumped
            self._watch(state.at.x, state.at.force)

    def load_path(self, forces: Sequence[float]) -> Iterator[Pressed]:
        """Equilibrium states at ascending normal forces on each whole pad [N].

        Raises `ConvergenceError`, `CheckError`: at the first force without an acceptable state.
        """
        if self.problem.friction is not None:
            yield from map(self.at, forces)
            return
        state = None
        self._begin()
        for force in forces:
            work = Work()
            self.solver.iterations_left = self.MOST_ITERATIONS
            state = self._next(state, force, work)
            yield self._pressed(state, work)

    def at(self, force: float, coarse: Sequence[Pressed] = ()) -> Pressed:
        """State at one normal force on each whole pad [N], whatever else has been solved.

        ``coarse`` are states of a coarser mesh, the nearest first, none above this force. From each one Newton solve is
        tried; from the first that leads to a state on the load path the force is approached, if it is lower. Where none
        does, or the coarser mesh has jumped before, the force is approached from first contact. With friction it is
        approached from the last state of the path below it.

        Raises `ConvergenceError`, `CheckError`: if there is no acceptable state.
        """
        work = Work()
        if self.problem.friction is not None:
            below = self._state_below(force)
            self._begin_afresh(below)
            work = replace(below.work) if below else work
            return self._pressed(self._next(below.at if below else None, force, work), work)
        self._begin_afresh()
        state = self._near(coarse, work)
        if state is None or state.force < force:
            state = self._next(state, force, work)
        return self._pressed(state, work)

    def _state_below(self, force: float) -> _PathState[ProblemT] | None:
        """The last state of the path below a force [N]; None where it begins above."""
        path = self._load_steps(0.0, force)[:-1]
        for goal in path[len(self._path) :]:
            if self._end is not None:
                raise self._end
            before = self._path[-1] if self._path else None
            self._begin_afresh(before)
            # all that has led to the state, so that the effort of a case does not depend on others
            work = replace(before.work) if before else Work()
            self._stepping.residual, self._stepping.slack = PATH_RESIDUAL, self._stepping.passed
            try:
                state = self._next(before.at if before else None, goal, work)
            except (ConvergenceError, CheckError) as error:
                self._end = error
                raise
            assert self.problem.friction is not None
            self._path.append(_PathState(state, work, self.problem, self._others, self.problem.friction.anchors))
        return self._path[len(path) - 1] if path else None

    @abstractmethod
    def _next(self, before: OnPath | None, force: float, work: Work) -> OnPath:
        """State at ``force`` from the one before, or from first contact."""

    def _near(self, coarse: Sequence[Pressed], work: Work) -> OnPath | None:
        """State at the force of the first of a coarser mesh's states that leads to one on the path, checked."""
        for start in coarse:
            # beyond a jump the finer mesh may still be before it
            if not start.path_dependent:
                try:
                    state = self._from(start, work)
                    self._pressed(state, work)
                    return state
                except (ConvergenceError, CheckError):
                    continue
        return None

    def _from(self, start: Pressed, work: Work) -> OnPath:
        """State at the force of a coarser mesh's, by one Newton solve after the load path that led there."""
        near = self._interpolated(start)
        x = self._stepping.from_near(near, start.force, work)
        # displacements and closing only: the bound is a distance in space, which pressures are not
        moved = np.delete(x - near, np.concatenate([np.r_[f.pressures] for f in self.problem.fingers]))
        if np.abs(moved).max() > STRAY * self.problem.thickness:
            work.halvings += 1
            raise ConvergenceError(ASTRAY.format(force=start.force))
        return OnPath(x, start.force, self._stepping.jumped)

    def _interpolated(self, start: Pressed) -> FloatArray:
        x, pads = np.zeros(self.problem.size), start.fingers
        for number, f in enumerate(self.problem.fingers):
            # where the coarser mesh has one finger, the other one is its image in x = 0
            image = np.array([-1.0 if number >= len(pads) else 1.0, 1.0, 1.0])
            pad = pads[min(number, len(pads) - 1)]
            turn = np.einsum("ji,j,ji->i", pad.pose.rotation, image, f.pose.rotation).round()
            x[f.unknowns] = interpolated(pad.pad, pad.unknowns, f.pad, turn)
        return x

    def _load_steps(self, reached: float, force: float) -> Sequence[float]:
        """Forces to go through from one (0: no contact yet) to the next [N]; without friction it does not matter."""
        if self.problem.friction is None:
            return (force,)
        pad = self.problem.fingers[0].pad
        return load_steps(reached, force, pad.modulus_per_thickness * float(np.prod(pad.shape.size)), self._stride)

    def _given_up(self, reached: float, force: float) -> ConvergenceError:
        """The error where no iterations are left, at ``reached`` [N]."""
        text = f"stuck at {reached:.4g} N of {force:.4g} N: given up after {self.MOST_ITERATIONS} Newton iterations"
        return ConvergenceError(text)

    def _pressed(self, state: OnPath, work: Work) -> Pressed:
        """The state, checked."""
        problem, x, steps = self.problem, state.x, self._stepping
        residual = np.abs(problem.residual(x))
        # a solve ends there where the force is so small, see `Stepping.solve`
        tolerance = max(RESIDUAL, problem.rounding / (problem.share * state.force))
        instead, slack = problem.rule != self._wanted.rule, ALTERNATING if steps.off else 0.0
        pads = []
        for k, f in enumerate(problem.fingers):
            contact, unknowns = problem.contact_state(x, k), x[f.unknowns].copy()
            pressure, _, points = contact
            imbalance = float(residual[f.offset : f.closing_dof + 1].max()) / f.pad.share
            checks = check(f.foam, unknowns, contact, imbalance, state.force, tolerance, slack)
            pads.append(Pressed(
                state.force, float(x[f.closing_dof]), unknowns, f.pad, f.pose, pressure,
                (f.pad.nodes + f.pad.displacement(unknowns))[f.pad.contact_nodes], points, checks,
                work if k == 0 else Work(), state.jumped, instead, self._notes(),
            ))  # fmt: skip
        return self._together(state, pads, residual)

    def _together(self, state: OnPath, pads: list[Pressed], residual: FloatArray) -> Pressed:
        """The first of the pads, which knows what it shares the state with."""
        return pads[0]

    def _notes(self) -> tuple[str, ...]:
        """Which means beside Newton's method on steps of the force the last state took."""
        steps, notes = self._stepping, []
        if self.problem.rule != self._wanted.rule:
            notes.append(f"solved with {self.problem.rule} gaps, {self._wanted.rule} ones did not converge")
        if steps.closed:
            notes.append("reached by displacement control")
        if steps.off:
            notes.append(f"the active set alternates, accepted at a residual of {steps.off:.1e} of the force")
        return tuple(notes)

    def destroy(self) -> None:
        """Give the memory back; nothing can be solved any more."""
        self.solver.destroy()
        del self._stepping  # it holds methods of the path, and rings of objects are collected late
