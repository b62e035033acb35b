"""Following the path of equilibria of a pad on a rigid object, step by step, so that no force leads off it.

Where a force has several equilibria, Newton's method finds the one that its start leads to. So the start has to be
near: a step of the force is as long as the tangent of the path foretells at most `LONGEST` of travel, and its state has
to lie within `STRAY` of what the tangent foretells, else the step is halved. Both are parts of the pad's thickness and
do not depend on the forces that were asked for. Steps in which the largest strain grows by more than `FOLD` are halved,
too; where it grows while the force hardly does (`FOLDING`, `FOLDS`), the foam folds somewhere. Foam that is strained
further than `STRAINED` may buckle: there a stable state has to lead to a stable one, whose tangent on the free
displacements, the nodes in contact held to the object, is positive definite.

Where even a step of `SHORTEST` leads from a stable state to an unstable one, the path forks: its states go on and are
taken, but a pad that is disturbed may leave them. Where such a step leaves the path, the pad jumps: the path ends at a
limit or folds. With weighted gaps this is an error, because nodal gaps often know of no jump; else the state beyond is
taken. In both cases ``jumped`` is set: this state and those that follow depend on the way to them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from softjaw.fem.contact.load_stepping import FloatArray, State, Stepping, Work, falls
from softjaw.fem.contact.problem import Control
from softjaw.fem.errors import ConvergenceError

LONGEST = 0.2  # foretold travel of one step
STRAY = 0.1  # distance of a node or the sheet from where it was foretold; good steps of practice keep to 0.06
SHORTEST = 0.025  # foretold travel of a step that is not halved again
LEAST = 0.01  # foretold travel of a step that is given up where Newton's method does not converge
FEWEST = 1.0 / 1024.0  # part of a step that is not halved again where nothing is foretold
FOLD = 0.25  # growth of the largest strain in one step; good steps of practice keep to 0.15
FOLDING, FOLDS = 0.1, 3.0  # the same, and over the growth of the force's logarithm, where 0.2 is usual
FIRST = 0.25  # travel at which the first contact is looked for, at most
STRAINED = 0.5  # largest strain from which on a state is checked for stability


@dataclass(frozen=True)
class _Place:
    """A state on the path: unknowns, force [N], largest strain, stability, and the tangent.

    That is the change of the unknowns per force [m/N], None where it is not known.
    """

    x: FloatArray
    force: float
    strain: float
    stable: bool
    tangent: FloatArray | None


@dataclass
class Following(Stepping):
    """Steps that stay on the path; parameters and attributes as for `fem.contact.load_stepping.Stepping`."""

    _last: _Place | None = None

    def first(self, travel: float, force: float, work: Work) -> State:
        """As `Stepping.first`, not further in than where a first contact is certain to be on the path."""
        return super().first(min(travel, FIRST * self.thickness), force, work)

    def climb(self, x: FloatArray, reached: float, force: float, work: Work, *, walk: bool = True) -> FloatArray:
        """As `Stepping.climb`, along the path."""
        if self.problem.complementarity:  # the factors at hand are those of a part of the tangent
            return super().climb(x, reached, force, work, walk=walk)
        here = self._begin(x, reached, work)
        done, cut = 0.0, 1.0
        while done < 1.0:
            allowed = self._allowed(here, force - reached)
            goal = min(1.0, done + cut * allowed)
            target = force if goal == 1.0 else reached + goal * (force - reached)
            try:
                x = self.solve(here.x, Control(force=target), work, self.most)
            except ConvergenceError:
                cut *= 0.5
                if cut < self.settings.min_step and not self._foretold(here, 0.5 * (target - here.force)) > LEAST:
                    if not walk:
                        raise
                    return self._walked(here, force, work)
                continue
            ahead = self._place(x, target, None)
            leaves, forks = self._leaves(here, ahead), here.stable and not ahead.stable
            if leaves or forks or ahead.strain - here.strain > FOLD:
                if cut > FEWEST and not self._foretold(here, target - here.force) <= SHORTEST:
                    cut, work.cuts = 0.5 * cut, work.cuts + 1
                    continue
                if leaves:
                    self._jump(target, walk)
                self.jumped |= forks
            self.watch(x, target)
            done, cut = goal, min(1.0, 2.0 * cut) if allowed < 1.0 else cut
            here = replace(ahead, tangent=self._tangent(x)) if done < 1.0 else ahead
        self._last = here
        return here.x

    def _begin(self, x: FloatArray, reached: float, work: Work) -> _Place:
        """Place at ``reached`` [N] on the path of this problem; the state there may be another one's."""
        known = self.solver.is_at(x)
        if known and self._last is not None and self._last.x is x:
            return replace(self._last, tangent=self._tangent(x))
        if not known:
            try:
                x, known = self.solve(x, Control(force=reached), work, self.most), True
            except ConvergenceError:
                pass
        here = self._place(x, reached, self._tangent(x) if known else None)
        self.jumped |= not here.stable
        return here

    def _place(self, x: FloatArray, force: float, tangent: FloatArray | None) -> _Place:
        strain = self.problem.largest_strain(x)
        return _Place(x, force, strain, strain <= STRAINED or self._stable(x), tangent)

    def _tangent(self, x: FloatArray) -> FloatArray | None:
        """Tangent of the path at the state at which the last solve ended."""
        return self.problem.path_tangent(x, self.solver.answer)

    def _stable(self, x: FloatArray) -> bool:
        entries, held = self.problem.symmetric_tangent(x)
        return self.solver.negative_eigenvalues(entries) == held

    def _allowed(self, here: _Place, step: float) -> float:
        """Part of a step [N] that may be made at once; all of it where nothing is foretold."""
        foretold = self._foretold(here, step)
        return LONGEST / foretold if foretold > LONGEST else 1.0

    def _foretold(self, here: _Place, step: float) -> float:
        """Travel over the thickness that the tangent foretells for a step [N]; NaN where it is not known."""
        return np.nan if here.tangent is None else abs(self.problem.travel(here.tangent) * step) / self.thickness

    def _leaves(self, here: _Place, ahead: _Place) -> bool:
        """Whether the state ``ahead`` is not the one that the path leads to from ``here``."""
        if here.tangent is not None:
            off = (ahead.x - here.x - (ahead.force - here.force) * here.tangent)[: self.problem.travel_dof + 1]
            if np.abs(off).max() > STRAY * self.thickness:
                return True
        grown = ahead.strain - here.strain
        return grown > max(FOLDING, FOLDS * abs(np.log(ahead.force / here.force)))

    def _jump(self, force: float, walk: bool) -> None:
        """Note that the path was left on the way to a force [N], or refuse it where there is another way."""
        if not walk:
            raise ConvergenceError(f"the pad jumps at {force:.4g} N")
        self.jumped = True

    def _walked(self, here: _Place, force: float, work: Work) -> FloatArray:
        """State at ``force`` by way of the travel; the force may fall on the way, which it does beyond a limit."""
        forces = [here.force]
        x = self.walk(here.x, force, work, STRAY * self.thickness, forces)
        self.jumped |= falls(forces)
        return x
