"""Choosing the levels of all effects of one candidate: by an indicator where it suffices, else on the coarse mesh.

The loop goes through the rows of `study.case.effects.ROWS`. Where an indicator leaves it open, the candidate is solved
on the coarse mesh with and without the effect, and what that changes in e_n decides: the cheaper level is taken where
the change is surely below the target, ``accuracy.target`` or 1 %. The coarse load paths lead through all forces of the
scene from the lowest one on, and both the indicator and the change belong to one force: nothing depends on which forces
are wanted, or on which rank they are solved.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property
from math import nan
from typing import Any

import numpy as np

from softjaw.fem.contact.problem import SpringBed
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.friction.patch import NoContactError
from softjaw.study.case import effects
from softjaw.study.case.build import build_object, forces_apart, has_wall
from softjaw.study.case.effects import ROWS, Level, Row, Step, level_named, neglected_traction
from softjaw.study.case.evaluate import settings_of
from softjaw.study.case.finer import Finer
from softjaw.study.case.model import Finger, contact_rules, pad_of, plate_compliance
from softjaw.study.case.result import surely_below
from softjaw.study.case.solving import OnRigid, PressedContact, Solved, Solver, grasp_of, refuse_along_axis, solver
from softjaw.study.case.task import payload_alone
from softjaw.study.case.wall import estimated_indentation, thin_body
from softjaw.study.flags import Flag
from softjaw.study.quantities import E_N_TARGET
from softjaw.study.scene import Scene

COUPLING = "friction_pressure_coupling"
# What a change of e_n on the coarse mesh is believed to: a part of how it differs at the next forces, and of the change
# of the payload. In 100 cases of a bottle and 88 of other shapes no effect was skipped then that moves e_n on the fine
# mesh by more than 1.3 %. With 0.25 of the difference one was, by 2.3 %, without any two, by up to 18 %: at forces of
# the bottle between changes of either sign.
BESIDE, OF_PAYLOAD = 0.4, 0.1
# What may be raised where a contact is smaller than a coarse element: that says nothing, and harms no case.
BEYOND = (ArithmeticError, ConvergenceError, CheckError, NoContactError)
SAMPLES = 100  # motions whose wrenches bound the payload; both levels err alike
LEFT_OUT = "friction that acts back on the pressure was not solved ({reason})"


def at_levels(scene: Scene, **levels: str) -> Scene:
    """The scene with these levels of its effects."""
    # values that the scene itself could have, so nothing is checked again
    return scene.model_copy(update={"effects": scene.effects.model_copy(update=levels)})


class Candidate:
    """A candidate with the levels that its scene leaves open chosen, and what solves it at them.

    Parameters
    ----------
    scene : Scene
    fingers : list of Finger
        Both at first touch.
    poses : two Pose
    forces : sequence of float, optional
        Those of the scene, or others [N]; rising.

    Attributes
    ----------
    scene : Scene
        With the levels that all forces have.
    levels : dict
        For each effect that is chosen its `Level` at every force.
    """

    def __init__(
        self, scene: Scene, fingers: list[Finger], poses: Sequence[Any], forces: Sequence[float] | None = None
    ) -> None:
        if scene.gripper.tilt_stiffness_nm_per_rad is not None:  # of a plate that is rigid itself
            scene = at_levels(scene, sheet="rigid")
        self.asked, self.fingers, self.poses = scene, fingers, poses
        self.forces = tuple(scene.load.normal_force if forces is None else forces)
        self.walled: bool = has_wall(scene.object)
        if self.walled:
            refuse_along_axis(fingers)
        self.target = scene.accuracy.target or E_N_TARGET
        self._coarse: dict[tuple[Any, ...], Solver] = {}
        self._finer: dict[Solver, Finer] = {}
        self._changes: dict[tuple[str, str, int], tuple[float, float]] = {}
        cheapest = {name: row.names[0] for name, row in ROWS.items() if row.steps}
        own = {name: getattr(scene.effects, name) for name in cheapest}
        self.scene = at_levels(scene, **{name: cheapest[name] if v == "auto" else v for name, v in own.items()})
        self.levels = {name: self._chosen(name, row) for name, row in ROWS.items() if row.steps}

    @property
    def apart(self) -> bool:
        """Whether its forces are independent of each other."""
        return forces_apart(self.scene)

    # --- what the table asks for --------------------------------------------------------------------------------------

    @cached_property
    def plate_compliance(self) -> float:
        """Of the backing plate over that of the pad."""
        return plate_compliance(self.scene.gripper)

    @cached_property
    def indentation(self) -> tuple[float, float]:
        """Indentation of a linear wall at the highest force over the closing displacement, and over its thickness."""
        if not self.walled:
            return nan, nan
        held = grasp_of(self.scene, self.fingers, False)
        pad = pad_of(self.scene, held.pad_symmetry, contact_rules(self.scene, walled=True)[0], False)
        closing = SpringBed(pad, self.fingers[0].gap).closing(self.forces[-1])
        indentation, ratio = estimated_indentation(
            thin_body(self.scene.object), held, self.scene, closing, self.forces[-1]
        )
        return indentation / closing, ratio

    def coarse(self, scene: Scene, forces: Sequence[float]) -> Solver:
        """The candidate on the coarse mesh at the levels of a scene, for these forces."""
        # each load path has a solver of its own, or what one needed would change the other
        levels = (getattr(scene.effects, name) for name, row in ROWS.items() if row.steps)
        key = (*levels, scene.accuracy.contact, *forces)
        if key not in self._coarse:
            self._coarse[key] = solver(scene, self.fingers, self.poses, coarser=True)
        return self._coarse[key]

    def seen(self, scene: Scene, forces: Sequence[float], k: int) -> list[PressedContact] | None:
        """Contacts at the ``k``-th of some forces on the coarse mesh; None where it has none."""
        try:
            return self.coarse(scene, forces).seen(forces, k)
        except BEYOND:
            return None

    # --- the loop -----------------------------------------------------------------------------------------------------

    def _chosen(self, name: str, row: Row) -> list[Level]:
        """Level of one effect at every force; what all forces share is noted in the scene."""
        wanted, count = getattr(self.asked.effects, name), len(self.forces)
        if name == "object" and not self.walled:
            return [Level(level_named(name, row.names[0]), reason=effects.NO_WALL)] * count
        if wanted != "auto":
            # of a force by itself the solved state tells it, see `effects_at`: nothing is solved for it here
            indicator = nan if row.each_force else row.steps[-1].indicator(self, count - 1)
            return [Level(level_named(name, wanted), indicator, effects.FORCED)] * count
        found = [self._at(name, row, k) for k in (range(count) if row.each_force else [count - 1])]
        # what is stated is the last step's indicator, whichever step was decided last
        stated = [own._replace(indicator=row.steps[-1].indicator(self, k)) for k, own in enumerate(found)]
        return stated if row.each_force else stated * count

    def _at(self, name: str, row: Row, k: int) -> Level:
        """Level of one effect at the ``k``-th force: each step is skipped, taken, or measured."""
        for step in row.steps:
            found = self._step(name, row, step, k)
            if found.level == level_named(name, step.low):
                return found
            if not row.each_force:
                self.scene = at_levels(self.scene, **{name: step.high})
        return found

    def _step(self, name: str, row: Row, step: Step, k: int) -> Level:
        low, high = (level_named(name, level) for level in (step.low, step.high))
        indicator = step.indicator(self, k)
        if surely_below(indicator, step.skip * self.target / E_N_TARGET):
            return Level(low, indicator, effects.BELOW)
        if indicator > step.take:
            return Level(high, indicator, effects.ABOVE)
        change, payload = self.change(name, step, k)
        doubt = self._doubt(name, step, k)
        if surely_below(abs(change) + doubt, self.target):
            return Level(low, indicator, effects.LITTLE, change, payload)
        # undecided takes the dearer level, which is right in both cases
        above = abs(change) > self.target
        return Level(high, indicator, effects.MUCH if above else effects.UNDECIDED, change, payload)

    def _doubt(self, name: str, step: Step, k: int) -> float:
        """How far the measured change of e_n may be off: the coarse mesh shifts the forces at which it passes zero."""
        change, payload = self.change(name, step, k)
        beside = [i for i in (k - 1, k + 1) if ROWS[name].each_force and 0 <= i < len(self.forces)]
        differs = [BESIDE * abs(change - self.change(name, step, i)[0]) for i in beside]
        # where nothing is known there is nothing to doubt the change by
        return float(np.nanmax([0.0, OF_PAYLOAD * abs(payload), *differs]))

    def change(self, name: str, step: Step, k: int) -> tuple[float, float]:
        """Relative change of e_n and payload by one step at the ``k``-th force on the coarse mesh; NaN: not known."""
        if (name, step.high, k) not in self._changes:
            self._changes[name, step.high, k] = self._compared(name, step, k)
        return self._changes[name, step.high, k]

    def _compared(self, name: str, step: Step, k: int) -> tuple[float, float]:
        """As `change`; of effects that all forces share the change at the force where e_n changes most."""
        if ROWS[name].each_force:
            return self._compared_at(name, step, k)
        each = [self._compared_at(name, step, i) for i in range(len(self.forces))]
        # what is not known at some force may be the largest
        return max(each, key=lambda found: np.inf if np.isnan(found[0]) else abs(found[0]))

    def _compared_at(self, name: str, step: Step, k: int) -> tuple[float, float]:
        low, high = (self.seen(at_levels(self.scene, **{name: own}), self.forces, k) for own in (step.low, step.high))
        if low is None or high is None:
            return nan, nan
        both = list(zip(low, high, strict=True))
        # on a few elements e_n follows from their size, and what other gaps change is no measure of the effect
        if any(a.on_few_elements or b.on_few_elements or a.nodal_instead != b.nodal_instead for a, b in both):
            return nan, nan
        (e_n, held), (other, other_held) = map(self._measured, (low, high))
        return other / e_n - 1.0 if e_n > 0 else nan, other_held / held - 1.0 if held > 0 else nan

    def _measured(self, contacts: Sequence[PressedContact]) -> tuple[float, float]:
        """e_n of the weaker finger [m] and payload [kg], NaN where that cannot be told."""
        e_n = min(c.limits["ccm"].e_n for c in contacts)
        task = settings_of(self.scene, build_object(self.scene.object)).task
        assert task is not None
        try:
            return e_n, payload_alone(contacts, SAMPLES, task)["maps/payload"]
        except (*BEYOND, RuntimeError, ValueError):  # a contact without torque has no hull
            return e_n, nan

    # --- solving at the levels that were chosen -----------------------------------------------------------------------

    @cached_property
    def solver(self) -> Solver:
        """At the levels that all forces have."""
        return self._solver(self.scene)

    @cached_property
    def coupled(self) -> Solver:
        """The same with friction that acts back."""
        return self._solver(at_levels(self.scene, **{COUPLING: "tangential"}))

    def _solved(self, own: Solver, k: int) -> Solved:
        """Contacts at one force, on a finer mesh where the target asks for it and the object is rigid."""
        found = own.level(self.forces, k)
        if self.asked.accuracy.target is None or not isinstance(own, OnRigid):
            return found
        if own not in self._finer:
            self._finer[own] = Finer(own.scene, self.fingers, self.poses)
        return self._finer[own].known_to_target(found, self.forces[k])

    def _solver(self, scene: Scene) -> Solver:
        """On the scene's meshes; what has been solved on the coarse one already is not solved again."""
        coarse = None if self.asked.accuracy.meshes == 1 else self.coarse(scene, self.forces)
        return solver(scene, self.fingers, self.poses, coarse)

    def load_path(self, forces: Sequence[float]) -> Iterator[Solved]:
        """See `Solver.load_path`; of the forces that levels were chosen for."""
        assert tuple(forces) == self.forces
        for _, outcome in self.solve(range(len(forces))):
            if not isinstance(outcome, Solved):
                raise outcome
            yield outcome

    def solve(self, wanted: Iterable[int]) -> Iterator[tuple[int, Solved | ConvergenceError | CheckError]]:
        """Contacts or failure at the wanted forces, by number, as `Solver.levels` gives them."""
        for k in wanted:
            try:
                yield k, self._level(k)
            except (ConvergenceError, CheckError) as error:
                yield k, error

    def _level(self, k: int) -> Solved:
        """Contacts at one force, with friction that acts back where it was chosen and can be solved."""
        level = self.levels[COUPLING][k]
        if level.reason == effects.FORCED or level.level != level_named(COUPLING, "tangential"):
            return self._solved(self.solver, k)
        try:
            self._refuse_lost(k)
            return self._solved(self.coupled, k)
        except (ConvergenceError, CheckError) as error:
            without = level_named(COUPLING, "none")
            self.levels[COUPLING][k] = level._replace(level=without, reason=effects.FAILED)
            found = self._solved(self.solver, k)
            note = "; ".join(text for text in (LEFT_OUT.format(reason=error), found.note) if text)
            return replace(found, note=note)

    def _refuse_lost(self, k: int) -> None:
        """Refuse friction on a wall whose coarse load path with it has ended: the fine one takes long to end, too."""
        coarse = self.coupled.coarse
        if isinstance(self.coupled, OnRigid) or coarse is None:
            return
        if lacking := [path.ended for path in coarse.followed(self.forces) if path.state(k) is None]:
            raise ConvergenceError(f"on the coarse mesh {lacking[0]}")

    def effects_at(self, k: int, contacts: Sequence[PressedContact]) -> dict[str, Level]:
        """Levels of the effects that are chosen at the ``k``-th force, whose contacts are solved."""
        found = {name: levels[k] for name, levels in self.levels.items()}
        own = found[COUPLING]
        if own.reason == effects.FORCED:
            indicator = max(neglected_traction(c.state, c.mu) for c in contacts)
            found[COUPLING] = own._replace(indicator=indicator)
        return found

    def flags_at(self, k: int) -> Flag:
        """Flag of a case that lacks an effect that moves its e_n by more than the target."""
        left_out = self.levels[COUPLING][k].reason == effects.FAILED
        return Flag.LEFT_OUT if left_out else Flag(0)

    def destroy(self) -> None:
        """Give the factors' memory back."""
        # a solver that was never needed is not made to be given back
        made = (vars(self).get(name) for name in ("solver", "coupled"))
        for own in (*made, *self._coarse.values(), *self._finer.values()):
            if own is not None:
                own.destroy()
