"""Following the path of equilibria of a pad on a rigid object, step by step, so that no force leads off it.

Where a force has several equilibria, Newton's method finds the one that its start leads to. So the start has to be
near: a step of the force is as long as the tangent of the path foretells at most `LONGEST` of travel, and its state has
to lie within `STRAY` of what the tangent foretells, else the step is halved. Both are parts of the pad's thickness and
do not depend on the forces that were asked for. Neither may the largest strain grow by more than `FOLD` while the force
hardly does (`FOLDS`): then the foam folds somewhere. Foam that is strained further than `STRAINED` may buckle: there a
state counts only if it is stable, that is if the tangent on the free displacements, the nodes in contact held to the
object, is positive definite.

Where even a step of `SHORTEST` leaves the path, the pad jumps: the path ends at a limit, folds or forks. With weighted
gaps this is an error, because nodal gaps often know of no jump; else the state beyond is taken and ``jumped`` is set:
this state and those that follow depend on the way to them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fem.contact import Control
from fem.errors import ConvergenceError
from fem.stepping import FloatArray, State, Stepping, Work

LONGEST = 0.2  # foretold travel of one step
STRAY = 0.1  # distance of a node or the sheet from where it was foretold; good steps of practice keep to 0.06
SHORTEST = 0.025  # foretold travel of a step that is not halved again
FEWEST = 1.0 / 1024.0  # part of a step that is not halved again where nothing is foretold
FOLD, FOLDS = 0.1, 3.0  # growth of the largest strain in a step, and over that of the force's logarithm (usual: 0.2)
FIRST = 0.25  # travel at which the first contact is looked for, at most
STRAINED = 0.4  # largest strain from which on a state is checked for stability


@dataclass(frozen=True)
class _Place:
    """A state on the path: unknowns, force [N], largest strain, and change of the unknowns per force if known [m/N]."""

    x: FloatArray
    force: float
    strain: float
    tangent: FloatArray | None


@dataclass
class Following(Stepping):
    """Steps that stay on the path; parameters and attributes as for `fem.stepping.Stepping`."""

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
            allowed = min(1.0, LONGEST / max(self._foretold(here, force - reached), 1e-300))
            goal = min(1.0, done + cut * allowed)
            target = force if goal == 1.0 else reached + goal * (force - reached)
            try:
                x = self.solve(here.x, Control(force=target), work, self.most)
            except ConvergenceError:
                cut *= 0.5
                if cut < self.settings.min_step:
                    if not walk:
                        raise
                    return self._walked(here, force, work)
                continue
            strain = self.problem.largest_strain(x)
            if self._leaves(here, x, target, strain):
                if cut > FEWEST and not self._foretold(here, target - here.force) <= SHORTEST:
                    cut, work.cuts = 0.5 * cut, work.cuts + 1
                    continue
                self._jump(target, walk)
            self.watch(x, target)
            done, cut = goal, min(1.0, 2.0 * cut) if allowed < 1.0 else cut
            here = _Place(x, target, strain, self._tangent(x) if done < 1.0 else None)
        return here.x

    def _begin(self, x: FloatArray, reached: float, work: Work) -> _Place:
        """Place at ``reached`` [N] on the path of this problem; the state there may be another one's."""
        try:
            if not self.solver.is_at(x):
                x = self.solve(x, Control(force=reached), work, self.most)
        except ConvergenceError:
            return _Place(x, reached, self.problem.largest_strain(x), None)
        return _Place(x, reached, self.problem.largest_strain(x), self._tangent(x))

    def _tangent(self, x: FloatArray) -> FloatArray | None:
        return self.problem.path_tangent(x, self.solver.answer)

    def _foretold(self, here: _Place, step: float) -> float:
        """Travel over the thickness that the tangent foretells for a step [N]; NaN where it is not known."""
        return np.nan if here.tangent is None else abs(self.problem.travel(here.tangent) * step) / self.thickness

    def _leaves(self, here: _Place, x: FloatArray, force: float, strain: float) -> bool:
        """Whether the state ``x`` is not the one that the path leads to."""
        if here.tangent is not None:
            off = (x - here.x - (force - here.force) * here.tangent)[: self.problem.travel_dof + 1]
            if np.abs(off).max() > STRAY * self.thickness:
                return True
        if strain - here.strain > max(FOLD, FOLDS * abs(np.log(force / here.force))):
            return True
        if strain <= STRAINED:
            return False
        entries, held = self.problem.symmetric_tangent(x)
        return self.solver.negative_eigenvalues(entries) > held

    def _jump(self, force: float, walk: bool) -> None:
        """Note that the path was left on the way to a force [N], or refuse it where there is another way."""
        if not walk:
            raise ConvergenceError(f"the pad jumps at {force:.4g} N")
        self.jumped = True

    def _walked(self, here: _Place, force: float, work: Work) -> FloatArray:
        """State at ``force`` by way of the travel; the force may fall on the way, which it does beyond a limit."""
        forces = [here.force]
        x = self.walk(here.x, force, work, STRAY * self.thickness, forces)
        self.jumped |= bool((np.diff(forces) < 0.0).any())
        return x
