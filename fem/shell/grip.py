"""Press two fingers on a thin-walled object along a load path, each normal force started from the one before.

As in ``fem.contact.press``, with a wall that gives way. Where a wall snaps in, force control jumps or fails; then
displacement control closes the fingers in short steps, and the first state with the wanted force is taken: what a
gripper that closes with a growing force meets first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from softjaw.fem.contact.load_stepping import STRAY, LoadPath, Settings, Stepping, Work, at_once, falls
from softjaw.fem.contact.press import Pressed, pressed
from softjaw.fem.contact.problem import Control, Gap, SpringBed
from softjaw.fem.errors import CheckError, ConvergenceError, SpentError
from softjaw.fem.objects.gap import FloatArray, Pose
from softjaw.fem.pad.interpolation import interpolated
from softjaw.fem.petsc import NonlinearSolver, Seconds
from softjaw.fem.shell import wall_interpolation
from softjaw.fem.shell.creep import creep
from softjaw.fem.shell.grip_problem import GripProblem
from softjaw.fem.shell.opening import Opening
from softjaw.fem.shell.wall_mesh import BodyMesh

LONGEST_STEP = 5e-4  # of the closing displacement under displacement control, while a wall snaps in [m]
SHORTEST_STEP = 1.0 / 16.0  # of that: where less is needed, the wall itself snaps from one state to another
JUMP = 1e-3  # change of closing displacement between two forces that may have passed over a limit [m]
BALANCE = 1e-6  # of the normal force
MOST_CREEPING = 600  # iterations of a wall that creeps for one force
SLOW = 2e-5  # velocity at which it may have come to rest, see ``creep``
# Newton iterations of a step from one state to the next: good ones take 3 to 8, with friction 4 to 14.
LONGEST_SOLVE, WITH_FRICTION = 12, 24
MOST_ITERATIONS = 200  # of Newton's method for one force, with weighted and with nodal gaps each; usual ones take 6
FOLDED = 0.75  # opening below which a wall without a further state counts as collapsed at once,
INDENTED = 0.95  # and after nodal gaps have found none either
ALIKE = 0.05  # part of the force by which the ends of the load path with both kinds of gaps may differ to be the wall's
HARDLY_SHUT = 0.01  # part of the opening: a wall that has closed by less has not jumped
GIVES_WAY = 0.5  # stiffness of the grasp over the mean one so far, below which the wall counts as snapped in
ROUNDING = 1.5e-18  # norm of the residual over the wall's modulus [m^2]: its forces are differences of large numbers


def jumps(low: tuple[float, float], high: tuple[float, float]) -> bool:
    """Whether a wall has jumped between two states on its load path.

    A wall that bends little by little closes about in proportion to the force. A soft pad hides from the closing
    displacement what the wall does.

    Parameters
    ----------
    low, high : (float, float)
        Force [N], the second one larger, and part of the opening that is gone.

    >>> jumps((3.0, 0.05), (5.0, 0.11)), jumps((3.0, 0.05), (5.0, 0.3)), jumps((3.0, 1e-4), (5.0, 1e-3))
    (False, True, False)
    """
    (force, shut), (more, then) = low, high
    return then > HARDLY_SHUT and GIVES_WAY * (then - shut) / (more - force) > shut / force


@dataclass(frozen=True)
class WallState:
    """The wall at one force.

    Parameters
    ----------
    mesh : BodyMesh
    q : (6 k,) array
        State, see ``fem.shell.element`` [m].
    load : (k, 3) array
        Contact forces on the shell's nodes [N].
    reaction : (3,) array
        Force of supports and springs on the whole object [N].
    snapped : bool
        Whether the wall has snapped in before: the force fell while the fingers closed, more force would open them
        (the stiffness of the grasp is negative), the force hardly grew, or the wall closed far more than in proportion.
    opening : float
        Of the wall's inner faces towards each other, see ``fem.shell.opening``: 1 undeformed, 0 where they would meet.
    """

    mesh: BodyMesh
    q: FloatArray
    load: FloatArray
    reaction: FloatArray
    snapped: bool
    opening: float


Parts = tuple[FloatArray, tuple[FloatArray, ...]]  # of a state: that of the shell, and unknowns of the pads


@dataclass(frozen=True)
class Gripped:
    """Both fingers, or the one that symmetry leaves, where they stand, and the wall in equilibrium at one force.

    ``history`` are the states before it that it depends on; none without friction.
    """

    force: float
    fingers: tuple[Pressed, ...]
    poses: tuple[Pose, ...]
    wall: WallState
    history: tuple[Parts, ...] = ()

    @property
    def path_dependent(self) -> bool:
        """Whether the wall has jumped before: another load path may lead to another state."""
        return self.fingers[0].path_dependent


@dataclass(frozen=True)
class _OnPath:
    """State on the load path: unknowns, force [N], and what is known of the path so far.

    ``compliance`` is that of the last step [m/N], ``snapped`` as in `WallState`, ``fell`` whether the force has fallen.
    """

    x: FloatArray
    force: float
    compliance: float
    snapped: bool
    fell: bool


@dataclass
class Grip(LoadPath):
    """Pads on a thin-walled object.

    Parameters
    ----------
    problem : GripProblem
    gaps : sequence of callables
        Of the undeformed object in the frame of each pad, as in ``Press``; contact begins where they are zero.
    mirrors : (bool, bool)
        Whether ``x = 0`` and ``y = 0`` are planes of symmetry that the mesh of the wall ends at.
    options : dict
        PETSc options with the prefix ``contact_``.
    fallback : callable, optional
        Makes the same problem with nodal gaps, for forces at which this one has no solution; its unknowns must be
        numbered alike.
    load_steps : callable
        From one force [N] (0: no contact yet) to the next: the forces to go through, the last of them the next.
    """

    problem: GripProblem
    gaps: Sequence[Gap]
    mirrors: tuple[bool, bool] = (False, False)
    options: dict[str, Any] = field(default_factory=dict)
    settings: Settings = field(default_factory=Settings)
    fallback: Callable[[], GripProblem] | None = None
    load_steps: Callable[[float, float], Sequence[float]] = at_once

    def __post_init__(self) -> None:
        """Set up the solver."""
        self._wanted, self._other, self._peak = self.problem, self.fallback, 0.0
        self._begin()
        super().__post_init__()

    def _set_up(self) -> None:
        fingers = self.problem.fingers
        self.opening = Opening(self.problem.model.shell.mesh)
        self._beds = [SpringBed(f.pad, gap) for f, gap in zip(fingers, self.gaps, strict=True)]
        self.solver = NonlinearSolver(self.problem, self.options)
        self._stepping = self._steps()

    def _steps(self) -> Stepping:
        """Steps of the problem as it is now."""
        fingers = self.problem.fingers
        most = LONGEST_SOLVE if self.problem.memory is None else WITH_FRICTION
        return Stepping(
            self.problem, self.solver, self.settings, fingers[0].pad.shape.size[2], min(f.pad.share for f in fingers),
            self._guess, lambda closing: min(bed.force_scale(closing) for bed in self._beds),
            ROUNDING * self.problem.model.shell.young_modulus + sum(f.pad.rounding for f in fingers),
            None if "contact_snes_max_it" in self.options else most, self._watch,
        )  # fmt: skip

    def _guess(self, closing: float) -> FloatArray:
        """The wall undeformed, the pads as beds of springs."""
        x = np.zeros(self.problem.size)
        for f, bed in zip(self.problem.fingers, self._beds, strict=True):
            x[f.own] = bed.guess(closing)
        return x

    def load_path(self, forces: Sequence[float]) -> Iterator[Gripped]:
        """Equilibrium states at ascending normal forces per finger [N].

        Raises
        ------
        ConvergenceError, CheckError
            At the first force without an acceptable state.
        """
        here = None
        self._begin()
        for force in forces:
            work, elapsed = Work(), self._stopwatch()
            here = self._next(here, force, work)
            yield self._gripped(here, work, elapsed())

    def at(self, force: float, coarse: Sequence[Gripped]) -> Gripped:
        """State at one normal force per finger [N], as `fem.contact.press.Press.at` has it."""
        work, elapsed = Work(), self._stopwatch()
        self._begin_afresh()
        here = self._near(coarse, lambda start: self._from(start, work))
        if here is None or here.force < force:
            here = self._next(here, force, work)
        return self._gripped(here, work, elapsed())

    def _begin(self) -> None:
        """Nothing has been found on the load path yet."""
        self._last: FloatArray | None = None  # state on the path that was found last
        self._crept, self._in_vain = False, 0.0  # whether the wall has crept on, and the last force it crept for [N]

    def _begin_afresh(self) -> None:
        """Forget what was solved before, so that not a bit of what follows depends on it."""
        self._begin()
        self.fallback = self._other
        self._wanted.forget()
        if self.problem is self._wanted:
            self.opening.last = 1.0, 0.0
            self.solver.forget()
            self._stepping = self._steps()
        else:
            self.problem = self._wanted
            self._start_again()
        self.solver.left = MOST_ITERATIONS

    def _from(self, start: Gripped, work: Work) -> _OnPath:
        """State at the force of a coarser mesh's, by one Newton solve."""
        self.problem.begin()
        for before in start.history:
            self.problem.accept(self._interpolated(start, before))
        x0 = self._interpolated(start, (start.wall.q, tuple(own.unknowns for own in start.fingers)))
        force, thickness = start.force, self._stepping.thickness
        x = self._stepping.solve(x0, Control(force=force), work, self._stepping.most)
        moved = np.delete(x - x0, np.concatenate([np.r_[f.pressures] for f in self.problem.fingers]))
        compliance = self._compliance()
        # beyond a limit more force would open the fingers
        if not (np.abs(moved).max() <= STRAY * thickness and compliance > 0.0):
            work.halvings += 1
            raise ConvergenceError(f"the state at {force:.4g} N is not the one that the coarser mesh has come to")
        self._watch(x, force)
        here = _OnPath(x, force, compliance, start.wall.snapped or self._gives_way(x, force, compliance), False)
        self._gripped(here, work, Seconds())
        return here

    def _interpolated(self, start: Gripped, parts: Parts) -> FloatArray:
        """Unknowns of a coarser mesh's state, or of one in its history."""
        x, model, (q, pads) = np.zeros(self.problem.size), self.problem.model, parts
        x[: model.size] = wall_interpolation.interpolated(start.wall.mesh, q, model.shell.mesh)[model.free]
        for k, f in enumerate(self.problem.fingers):
            # where the coarser mesh has one finger, the other one is its image in x = 0
            image = np.array([-1.0 if k >= len(start.fingers) else 1.0, 1.0, 1.0])
            other = min(k, len(start.fingers) - 1)
            own = start.fingers[other]
            turn = np.einsum("ji,j,ji->i", start.poses[other].rotation, image, f.pose.rotation).round()
            x[f.own] = interpolated(own.pad, pads[other], f.pad, turn)
        return x

    def _next(self, here: _OnPath | None, force: float, work: Work) -> _OnPath:
        """State at ``force`` from the one before, or from first contact; where it has none, with nodal gaps."""
        try:
            return self._level(here, force, work)
        except ConvergenceError as error:
            self._refuse_folded(error, INDENTED if self.fallback is None else FOLDED)
            if self.fallback is None:
                raise
        limit = self._peak
        # the unknowns are numbered alike, so the path goes on from the last state
        last, self.problem, self.fallback = self.opening.last, self.fallback(), None
        self._start_again()
        self.opening.last = last
        # what friction remembers belongs to the other problem, so with friction the path begins anew
        if self.problem.memory is not None:
            here = None
        try:
            return self._level(here, force, work)
        except ConvergenceError as again:
            self._refuse_unstable(again, limit)
            self._refuse_folded(again, INDENTED)
            raise

    def _refuse_unstable(self, error: ConvergenceError, limit: float) -> None:
        """Say that a wall seems to give way where the load path ends at the same force with both kinds of gaps.

        ``limit`` is the largest force with the first kind [N]. Which nodes touch depends on the kind, so a Newton
        method that does not find them stops elsewhere with the other one.
        """
        left, _ = self.opening.last
        low, high = sorted([limit, self._peak])
        if left < INDENTED and high - low <= ALIKE * high:
            raise CheckError(
                f"the wall seems to give way at {high:.3g} N on this mesh: with gaps of either kind its load path ends "
                f"there (at {low:.4g} and {high:.4g} N), its opposite sides {1 - left:.0%} of their distance closer; "
                f"press less or take a thicker wall ({error})"
            ) from error

    def _refuse_folded(self, error: ConvergenceError, limit: float) -> None:
        """Say that a wall collapsed where that is why no further state was found, or that it may have."""
        left, force = self.opening.last
        # the opening tells a wall that has collapsed from a solve that failed for another reason
        if left < limit:
            closer = f"its opposite sides have come {1 - left:.0%} of their distance closer"
            if left < FOLDED:
                text = f"the wall collapsed: beyond {force:.3g} N, where {closer}, no equilibrium was found"
            else:
                text = (
                    f"no equilibrium was found beyond {force:.3g} N, where {closer}: either the wall gives way there, "
                    "or Newton's method did not find which nodes touch; try a finer mesh or shorter pads"
                )
            raise CheckError(f"{text} ({error})") from error

    def _level(self, here: _OnPath | None, force: float, work: Work) -> _OnPath:
        """State at ``force`` from the one before, or from first contact."""
        self._peak = 0.0 if here is None else here.force
        try:
            for goal in self.load_steps(self._peak, force):
                self.solver.left = MOST_ITERATIONS
                here = self._climb(here, goal, work)
            assert here is not None
            return here
        except SpentError as error:
            spent = f"given up after {MOST_ITERATIONS} Newton iterations"
            failed = ConvergenceError(f"stuck at {self.opening.last[1]:.4g} N of {force:.4g} N: {spent}")
            failed.__cause__ = error
        except ConvergenceError as error:
            failed = error
        # a second kind of gaps would creep just as long in vain, and friction depends on a way that creeping is not
        if self._last is None or self._in_vain == force or self.problem.memory is not None:
            raise failed
        self._in_vain = force
        try:
            return self._creep(here, force, work)
        except (ConvergenceError, SpentError):
            raise failed from None

    def _creep(self, here: _OnPath | None, force: float, work: Work) -> _OnPath:
        """State at ``force`` that the wall creeps to from the last one on the path."""
        assert self._last is not None
        self.solver.left, slow = MOST_CREEPING, SLOW
        start, (_, reached) = self._last, self.opening.last
        for ahead in creep(self.problem, self.solver, start, force):
            if self.opening(self.problem.wall_state(ahead.x)) <= 0.0:
                raise CheckError(
                    f"the wall collapsed: beyond {reached:.3g} N, where its load path ends, it folds until its "
                    f"opposite sides meet at {force:.4g} N"
                )
            if ahead.speed > slow:
                continue
            try:
                x = self._stepping.solve(ahead.x, Control(force=force), work, self._stepping.most)
                break
            except ConvergenceError:
                slow = 0.2 * ahead.speed
        self._watch(x, force)
        compliance, moved = self._compliance(), self.problem.closing(x) - self.problem.closing(start)
        expected = max(JUMP, 2.0 * (here.compliance if here else 0.0) * (force - reached))
        jumped = not 0.0 <= moved <= expected or compliance < 0.0
        self._crept |= jumped
        snapped = jumped or self._gives_way(x, force, compliance) or bool(here and here.snapped)
        return _OnPath(x, force, compliance, snapped, jumped or bool(here and here.fell))

    def _climb(self, here: _OnPath | None, force: float, work: Work) -> _OnPath:
        """State at ``force`` from the one before, or from first contact, as far as the iterations last."""
        if here is None:
            self.problem.begin()
            closing = float(np.mean([bed.closing(force) for bed in self._beds]))
            x, reached = self._stepping.first(closing, force, work)
            self.problem.accept(x)
            # foam gets stiffer, so this is more than what comes
            here = _OnPath(x, reached, self.problem.closing(x) / reached, False, False)
        x, reached = here.x, here.force
        ahead, fell = self._step_to(x, reached, force, here.compliance, work)
        compliance = self._compliance()
        slope, gives_way = np.inf, self._gives_way(ahead, force, compliance)
        # a state at which more force would open the fingers lies beyond a limit, even if no step saw the force fall
        fell |= compliance < 0.0
        # the first contact may have more force than the first level asks for: no slope yet
        if force > reached:
            slope = (self.problem.closing(ahead) - self.problem.closing(x)) / (force - reached)
            gives_way |= GIVES_WAY * slope > self.problem.closing(x) / reached
            gives_way |= jumps((reached, self._shut(x)), (force, self._shut(ahead)))
        return _OnPath(ahead, force, slope, here.snapped or fell or gives_way, here.fell or fell)

    def _step_to(
        self, x: FloatArray, reached: float, force: float, compliance: float, work: Work
    ) -> tuple[FloatArray, bool]:
        """State at ``force``, and whether a limit was passed between it and the one at ``reached`` [N]."""
        # twice what the slope so far foretells; a snap goes much further
        expected = max(JUMP, 2.0 * compliance * (force - reached))
        # a wall that has crept before will creep again: no search for what lies between its states
        if self._crept:
            return self._stepping.solve(x, Control(force=force), work, self._stepping.most), False
        before = self.problem.memory
        try:
            ahead = self._stepping.step_to(x, reached, force, work, by_displacement=False)
            if self.problem.closing(ahead) - self.problem.closing(x) <= expected:
                return ahead, False
        except ConvergenceError:
            pass
        # a jump over a limit converges too, so the length of the step decides, not Newton's method alone
        forces: list[float] = []
        self.problem.memory = before
        ahead = self._stepping.displacement_control(x, force, work, LONGEST_STEP, forces, SHORTEST_STEP)
        return ahead, falls([reached, *forces])

    def _watch(self, x: FloatArray, force: float) -> None:
        self.problem.accept(x)
        self.opening.watch(self.problem.wall_state(x), force)
        self._last = x
        self._peak = max(self._peak, force)

    def _gives_way(self, x: FloatArray, force: float, compliance: float) -> bool:
        """Whether the force grows much more slowly with the closing displacement here than it has done so far.

        Pads on a rigid object get stiffer as they spread. Walls in front of soft pads have a plateau instead of a limit
        when they snap in, and no force falls there.
        """
        return bool(compliance * force > self.problem.closing(x) / GIVES_WAY)

    def _shut(self, x: FloatArray) -> float:
        """How much of the wall's opening is gone."""
        return 1.0 - self.opening(self.problem.wall_state(x))

    def _compliance(self) -> float:
        """Change of the closing displacement per force where the last solve has ended [m/N]."""
        fingers = self.problem.fingers
        load = np.zeros(self.problem.size)
        load[[f.closing_dof for f in fingers]] = [f.pad.share for f in fingers]
        return self.problem.closing(self.solver.answer(load))

    def _gripped(self, here: _OnPath, work: Work, seconds: Seconds) -> Gripped:
        """State of all parts, checked."""
        x, force, problem, residual = here.x, here.force, self.problem, np.abs(self.problem.residual(here.x))
        fingers = []
        for k, f in enumerate(problem.fingers):
            left_over = residual[f.offset : f.closing_dof + 1].max() / f.pad.share
            # both fingers are solved at once: their effort is counted with the first
            part = seconds if k == 0 else Seconds()
            fingers.append(pressed(
                f.foam, x[f.own].copy(), problem.contact_state(x, k), left_over, force, self.settings,
                work if k == 0 else Work(), part, here.fell, problem is not self._wanted,
            ))  # fmt: skip
        load, q = problem.wall_load(x), problem.wall_state(x)
        worst = residual[: problem.model.size].max(initial=0.0)
        if not worst <= max(BALANCE, self.settings.residual) * force:
            raise CheckError(
                f"the state at {force:.4g} N converged but is wrong: a node of the wall is out of balance "
                f"by {worst:.3g} N"
            )
        self._check_balance(fingers, load, force)
        mesh, poses = problem.model.shell.mesh, tuple(f.pose for f in problem.fingers)
        wall = WallState(mesh, q, load, self._reaction(load), here.snapped, self.opening(q))
        before = tuple((problem.wall_state(y), tuple(y[f.own] for f in problem.fingers)) for y in problem.history(x))
        return Gripped(force, tuple(fingers), poses, wall, before)

    def _check_balance(self, fingers: Sequence[Pressed], load: FloatArray, force: float) -> None:
        """Refuse a state in which the wall does not bear what the pads press with."""
        pads = sum(f.pose.rotation @ p.points.force for f, p in zip(self.problem.fingers, fingers, strict=True))
        off = np.abs(pads - load.sum(axis=0)).max()
        if not off <= BALANCE * force:
            raise CheckError(
                f"the state at {force:.4g} N converged but is wrong: pads and wall are out of balance by {off:.3g} N"
            )

    def _reaction(self, load: FloatArray) -> FloatArray:
        """Force of the supports on the whole object: it balances the contact forces of both fingers [N]."""
        # forces across a plane of symmetry cancel with those of the other half; the others add up
        mirrored = np.array([*self.mirrors, False])
        return np.where(mirrored, 0.0, -load.sum(axis=0)) * 2.0 ** mirrored.sum()
