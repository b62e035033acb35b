"""Press two fingers on a thin-walled object along a load path.

As in ``fem.contact.press``, with a wall that gives way. Where a wall snaps in, force control jumps or fails; then
displacement control closes the fingers in short steps, and the first state with the wanted force is taken: what a
gripper that closes with a growing force meets first.
"""

from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from softjaw.fem.contact.load_stepping import RESIDUAL, Stepping, Work, falls
from softjaw.fem.contact.path import LoadPath, OnPath, Pressed
from softjaw.fem.contact.problem import Control
from softjaw.fem.errors import CheckError, ConvergenceError, SpentError
from softjaw.fem.shell.opening import Opening, creep
from softjaw.fem.shell.wall_mesh import BodyMesh, interpolated
from softjaw.fem.shell.wall_problem import WallProblem
from softjaw.friction.patch import FloatArray

LONGEST_STEP, SHORTEST_STEP = 5e-4, 1.0 / 16.0  # of the closing [m] while a wall snaps in; part of it, or it jumps
JUMP = 1e-3  # change of closing displacement between two forces that may have passed over a limit [m]
WALL_BALANCE = 1e-6  # of the normal force
# Newton iterations of a step from one state to the next: good ones take 3 to 8, with friction 4 to 14.
LONGEST_SOLVE, WITH_FRICTION = 12, 24
# opening below which a wall without a further state counts as collapsed at once, and after nodal gaps have failed too
FOLDED, INDENTED = 0.75, 0.95
GIVES_WAY = 0.5  # stiffness of the grasp over the mean one so far, below which the wall counts as snapped in
CLOSED = 0.01  # part of the opening: a wall that has closed by less has not snapped in


def jumps(low: tuple[float, float], high: tuple[float, float]) -> bool:
    """Whether a wall has jumped between two states on its load path.

    A wall that bends little by little closes about in proportion to the force. A soft pad hides from the closing
    displacement what the wall does.

    ``low, high``: force [N], the second one larger, and part of the opening that is gone.

    >>> jumps((3.0, 0.05), (5.0, 0.11)), jumps((3.0, 0.05), (5.0, 0.3)), jumps((3.0, 1e-4), (5.0, 1e-3))
    (False, True, False)
    """
    (force, shut), (more, then) = low, high
    return then > CLOSED and GIVES_WAY * (then - shut) / (more - force) > shut / force


class WallState(NamedTuple):
    """The wall at one force: its mesh, state ``q (6 k,)`` [m] and contact forces ``load (k, 3)`` on its nodes [N].

    ``snapped``: whether the wall has snapped in before, so that the force fell while the fingers closed, more force
    would open them, the force hardly grew, or the wall closed far more than in proportion; ``opening``: see
    ``fem.shell.opening``.
    """

    mesh: BodyMesh
    q: FloatArray
    load: FloatArray
    snapped: bool
    opening: float


class Grip(LoadPath[WallProblem]):
    """Pads on a thin-walled object: ``problems`` with weighted gaps, and with nodal ones if those have no solution."""

    MOST_ITERATIONS = 200  # with weighted and with nodal gaps each; usual ones take 6

    def _begin(self) -> None:
        self._last: FloatArray | None = None  # state on the path that was solved last
        self._crept, self._in_vain = False, 0.0  # whether the wall has crept on, and the last force it crept for [N]
        self._peak = 0.0

    def _begin_afresh(self, state: Any = None) -> None:
        self.opening.last = 1.0, 0.0
        super()._begin_afresh(state)

    def _set_up(self) -> None:
        self.opening = Opening(self.problem.model.shell.mesh)
        super()._set_up()

    def _steps(self) -> Stepping:
        most = LONGEST_SOLVE if self.problem.friction is None else WITH_FRICTION
        return Stepping(
            self.problem, self.solver, None if "contact_snes_max_it" in self.options else most,
            self._watch,
        )  # fmt: skip

    def _from(self, start: Pressed, work: Work) -> OnPath:
        """As `LoadPath._from`; refused where more force would open the fingers, which is beyond a limit."""
        state, compliance = super()._from(start, work), self._compliance()
        x, force = state.x, state.force
        if not compliance > 0.0:
            work.halvings += 1
            raise ConvergenceError(f"the state at {force:.4g} N lies beyond a limit")
        self._watch(x, force)
        return OnPath(x, force, False, compliance, start.wall.snapped or self._gives_way(x, force, compliance))

    def _interpolated(self, start: Pressed) -> FloatArray:
        x, model, wall = super()._interpolated(start), self.problem.model, start.wall
        x[: model.size] = interpolated(wall.mesh, wall.q, model.shell.mesh)[model.free]
        return x

    def _next(self, before: OnPath | None, force: float, work: Work) -> OnPath:
        """State at ``force`` from the one before, or from first contact; where it has none, with nodal gaps."""
        self._stepping.closed = False
        try:
            return self._level(before, force, work)
        except ConvergenceError as error:
            self._refuse_folded(error, FOLDED if self._others else INDENTED)
            if not self._others:
                raise
        # the unknowns are numbered alike, so the path continues from the last state
        limit, last, problem = self._peak, self.opening.last, self._others[0]
        self._others = self._others[1:]
        self._switch(problem())
        self.opening.last = last
        # what friction remembers belongs to the other problem, so with friction the path begins anew
        if self.problem.friction is not None:
            before = None
        try:
            return self._level(before, force, work)
        except ConvergenceError as again:
            self._refuse_unstable(again, limit)
            self._refuse_folded(again, INDENTED)
            raise

    def _refuse_unstable(self, error: ConvergenceError, limit: float) -> None:
        """Say that a wall seems to give way where the load path ends at the same force with both kinds of gaps.

        ``limit`` is the largest force with the first kind [N]. Which nodes touch depends on the kind, so a Newton
        method that does not find them stops elsewhere with the other one.
        """
        opening, _ = self.opening.last
        low, high = sorted([limit, self._peak])
        # part of the force by which the ends of the load path with both kinds of gaps may differ
        if opening < INDENTED and high - low <= 0.05 * high:
            raise CheckError(
                f"the wall seems to give way on this mesh: with gaps of either kind its load path ends ({low:.4g} and "
                f"{high:.4g} N), its opposite sides {1 - opening:.0%} closer; press less or thicken the wall ({error})"
            ) from error

    def _refuse_folded(self, error: ConvergenceError, limit: float) -> None:
        """Say that a wall collapsed where that is why no further state was found, or that it may have."""
        opening, force = self.opening.last
        # the opening tells a wall that has collapsed from a solve that failed for another reason
        if opening < limit:
            text = f"no equilibrium found beyond {force:.3g} N, where opposite sides are {1 - opening:.0%} closer"
            if opening < FOLDED:
                raise CheckError(f"the wall collapsed: {text} ({error})") from error
            causes = "the wall gives way there, or Newton's method did not find which nodes touch"
            raise CheckError(f"{text}: {causes}; try a finer mesh or shorter pads ({error})") from error

    def _level(self, state: OnPath | None, force: float, work: Work) -> OnPath:
        """State at ``force`` from the one before, or from first contact."""
        self._peak = 0.0 if state is None else state.force
        try:
            for goal in self._load_steps(self._peak, force):
                self.solver.iterations_left = self.MOST_ITERATIONS
                state = self._step_on(state, goal, work)
            assert state is not None
            return state
        except SpentError as error:
            failed = self._given_up(self.opening.last[1], force)
            failed.__cause__ = error
        except ConvergenceError as error:
            failed = error
        # a second kind of gaps would creep just as long in vain, and friction depends on a way that creeping is not
        if self._last is None or self._in_vain == force or self.problem.friction is not None:
            raise failed
        self._in_vain = force
        try:
            return self._creep(state, force, work)
        except (ConvergenceError, SpentError):
            raise failed from None

    def _creep(self, before: OnPath | None, force: float, work: Work) -> OnPath:
        """State at ``force`` that the wall creeps to from the last one on the path."""
        assert self._last is not None
        # iterations of a wall that creeps for one force
        self.solver.iterations_left, slow = 600, 2e-5  # velocity at which it may have come to rest, see ``creep``
        start, (_, reached) = self._last, self.opening.last
        for ahead, speed in creep(self.problem, self.solver, start, force):
            if self.opening(self.problem.wall_state(ahead)) <= 0.0:
                text = f"the wall collapsed: its load path ends at {reached:.3g} N; its sides meet at {force:.4g} N"
                raise CheckError(text)
            if speed > slow:
                continue
            try:
                x = self._stepping.solve(ahead, Control(force=force), work, self._stepping.most)
                break
            except ConvergenceError:
                slow = 0.2 * speed
        self._watch(x, force)
        compliance, moved = self._compliance(), self.problem.closing(x) - self.problem.closing(start)
        expected = max(JUMP, 2.0 * (before.compliance if before else 0.0) * (force - reached))
        jumped = not 0.0 <= moved <= expected or compliance < 0.0
        self._crept |= jumped
        snapped = jumped or self._gives_way(x, force, compliance) or bool(before and before.snapped)
        return OnPath(x, force, jumped or bool(before and before.jumped), compliance, snapped)

    def _step_on(self, state: OnPath | None, force: float, work: Work) -> OnPath:
        """State at ``force`` from the one before, or from first contact, as far as the iterations last."""
        if state is None:
            self.problem.begin()
            x, reached = self._stepping.first(self.problem.closing_of_bed(force), force, work)
            self.problem.accept(x)
            # foam gets stiffer, so this is more than what comes
            state = OnPath(x, reached, False, self.problem.closing(x) / reached)
        x, reached = state.x, state.force
        ahead, fell = self._step_to(x, reached, force, state.compliance, work)
        compliance = self._compliance()
        slope, gives_way = np.inf, self._gives_way(ahead, force, compliance)
        # a state at which more force would open the fingers lies beyond a limit, even if no step saw the force fall
        fell |= compliance < 0.0
        # the first contact may have more force than the first level asks for: no slope yet
        if force > reached:
            slope = (self.problem.closing(ahead) - self.problem.closing(x)) / (force - reached)
            gives_way |= GIVES_WAY * slope > self.problem.closing(x) / reached and self._shut(ahead) > CLOSED
            gives_way |= jumps((reached, self._shut(x)), (force, self._shut(ahead)))
        return OnPath(ahead, force, state.jumped or fell, slope, state.snapped or fell or gives_way)

    def _step_to(
        self, x: FloatArray, reached: float, force: float, compliance: float, work: Work
    ) -> tuple[FloatArray, bool]:
        """State at ``force``, and whether a limit was passed between it and the one at ``reached`` [N]."""
        # twice what the slope so far foretells; a snap goes much further
        expected = max(JUMP, 2.0 * compliance * (force - reached))
        # a wall that has crept before will creep again: no search for what lies between its states
        if self._crept:
            return self._stepping.solve(x, Control(force=force), work, self._stepping.most), False
        friction = self.problem.friction
        before = None if friction is None else friction.anchors
        with suppress(ConvergenceError):
            ahead = self._stepping.step_to(x, reached, force, work, by_displacement=False)
            if self.problem.closing(ahead) - self.problem.closing(x) <= expected:
                return ahead, False
        # a jump over a limit converges too, so the length of the step decides, not Newton's method alone
        forces: list[float] = []
        if friction is not None and before is not None:
            friction.anchors = before
        ahead = self._stepping.displacement_control(x, force, work, LONGEST_STEP, forces, SHORTEST_STEP)
        return ahead, falls([reached, *forces])

    def _watch(self, x: FloatArray, force: float) -> None:
        self.problem.accept(x)
        self.opening.watch(self.problem.wall_state(x), force)
        self._last = x
        self._peak = max(self._peak, force)

    def _gives_way(self, x: FloatArray, force: float, compliance: float) -> bool:
        """Whether the force grows much more slowly with the closing displacement here than it has done so far.

        First touch is known to some micrometres: before the wall has closed that is much of the closing displacement.

        Pads on a rigid object get stiffer as they spread. Walls under soft pads have a plateau instead of a limit
        when they snap in, and no force falls there.
        """
        return bool(compliance * force > self.problem.closing(x) / GIVES_WAY) and self._shut(x) > CLOSED

    def _shut(self, x: FloatArray) -> float:
        """How much of the wall's opening is gone."""
        return 1.0 - self.opening(self.problem.wall_state(x))

    def _compliance(self) -> float:
        """Change of the closing displacement per force where the last solve has ended [m/N]."""
        fingers = self.problem.fingers
        load = np.zeros(self.problem.size)
        load[[f.closing_dof for f in fingers]] = [f.pad.share for f in fingers]
        return self.problem.closing(self.solver.answer(load))

    def _together(self, state: OnPath, pads: list[Pressed], residual: FloatArray) -> Pressed:
        """Both pads and the wall, checked."""
        force, problem = state.force, self.problem
        load, q = problem.wall_load(state.x), problem.wall_state(state.x)
        worst = residual[: problem.model.size].max(initial=0.0)
        if not worst <= max(WALL_BALANCE, RESIDUAL) * force:
            text = f"the state at {force:.4g} N converged but is wrong: a wall node is out of balance by {worst:.3g} N"
            raise CheckError(text)
        wall = WallState(problem.model.shell.mesh, q, load, state.snapped, self.opening(q))
        first, *others = (pad._replace(wall=wall) for pad in pads)
        return first._replace(other=others[0]) if others else first
