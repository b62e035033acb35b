"""Effects: one table of what a case may be simulated with, and the choice of their levels for one candidate.

The steps of an effect lead from a level to the next dearer one. Below ``skip`` of a step's indicator the cheaper
level is good to the target, above ``take`` the dearer one is surely needed. In between the candidate is solved on the
coarse mesh with and without the effect, and what that changes in payload, quality and e_n decides: the cheaper level is
taken where each change is surely below the target, ``accuracy.target`` or 1 %; the change is then a part of the errors.
Indicator and changes belong to one force: nothing depends on the other forces, or on which rank they are solved.
Effects without steps are exact, or cost next to nothing: ``settled`` says so of a solved case.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property, partial
from math import inf, nan
from typing import Any, NamedTuple

import numpy as np

from softjaw.fem.contact.problem import SpringBed
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.friction.patch import FloatArray, NoContactError
from softjaw.study.case.build import forces_apart
from softjaw.study.case.errors import grasp_values
from softjaw.study.case.limit_surface import SurfaceFit
from softjaw.study.case.model import contact_rules, pad_of, plate_compliance
from softjaw.study.case.pressing import PressedContact, grasp_of
from softjaw.study.case.result import surely_below
from softjaw.study.case.solver import CandidateSolver, Levels, Solution, Solved, join_notes
from softjaw.study.case.wall import estimated_indentation, thin_body
from softjaw.study.flags import Flag
from softjaw.study.quantities import E_N_TARGET, EFFECTS, REASONS
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import COARSE

COUPLING = "friction_pressure_coupling"  # of which every force has a level of its own; else all have the highest one's

(
    ONLY, FORCED, BELOW, ABOVE, SYMMETRY, NO_WALL, CHEAP, APART, LITTLE, MUCH, UNDECIDED, FAILED, SCREENED,
) = range(len(REASONS))  # fmt: skip
# In 440 cases (pads, objects, supports, forces up to 13 N) a rigid plate put e_n off by at most 3.5 times the relative
# compliance of the plate that it stood for (where a pad just reaches the middle of a waist).
STIFF_PLATE, SOFT_PLATE = E_N_TARGET / 3.5, 0.05
# In 92 cases friction that acts back moved e_n by at most 0.5 times the traction that it adds, where that was below a
# tenth of the pressure. No traction is so large that it surely moves e_n.
SMALL_TRACTION = E_N_TARGET / 0.5
# Indentation over closing displacement up to which the e_n of a rigid wall was good to 0.5 % (54 cases), and over its
# thickness up to which dents and stresses of a linear shell are good to 1.2 %, closing to 0.8 % and e_n to 0.2 % (16
# cases: a quarter of the ratio, a seventh, a thirtieth). Above, nothing is measured: indentation and stress are wanted,
# too, which a rigid wall has not and e_n does not tell; and a linear wall takes as long as a nonlinear one.
STIFF_WALL, SMALL_INDENTATION = 0.02, 0.05
RIGID_CLOSES = 1.35  # times that indentation a rigid wall closed less at most, in 14 cases
# Part of the largest change on the coarse mesh that is doubted: the fine one shifts where a change passes through zero.
DOUBT = 0.3
# What may be raised where a contact is smaller than a coarse element: that says nothing, and harms no case.
TOO_SMALL = (ArithmeticError, ConvergenceError, CheckError, NoContactError)
CHANGE_OF = {"e_n": "change", "payload": "payload_change", "quality": "quality_change"}  # fields of a `Level`
LEFT_OUT = "friction that acts back on the pressure was not solved ({reason})"


class Level(NamedTuple):
    """Level of an effect in one case, and why.

    ``level``: of those that `study.quantities.EFFECTS` lists. ``indicator``: NaN where it is not known. ``reason``:
    index of `study.quantities.REASONS`. ``change, payload_change, quality_change``: relative change of e_n, payload and
    quality by the dearer of the two levels that were compared last, on the coarse mesh; NaN where nothing was measured.
    """

    level: str
    indicator: float = nan
    reason: int = ONLY
    change: float = nan
    payload_change: float = nan
    quality_change: float = nan


class Step(NamedTuple):
    """From one level to the next dearer one.

    ``low, high``: levels by their names in a scene. ``indicator``: of a choice at the ``k``-th force; NaN where it is
    not known. ``skip, take``: indicator up to which the effect is surely skipped for a target of 1 % in e_n (the bound
    grows with the target), and beyond which it is surely taken; 0 takes it wherever it is not skipped.
    """

    low: str
    high: str
    indicator: Callable[[EffectChoice, int], float]
    skip: float
    take: float


# --- indicators -------------------------------------------------------------------------------------------------------


def neglected_traction(state: Any, mu: float) -> float:
    """Share of the pressure sum that friction would add across it, if every point of the face stuck or slid [-].

    A point that moved by ``d`` along the object's surface would be held back by ``min(mu p, E d / thickness)``, as a
    column of foam is that is sheared by ``d``. A slope shows here too: there the whole pad moves along the surface.
    """
    pad, points = state.pad, state.points
    moved = points.position - np.einsum("qa,fai->fqi", pad.face_N, pad.nodes[pad.face_nodes])
    along = moved - np.einsum("fqi,fqi->fq", moved, points.normal)[..., None] * points.normal
    stick = pad.modulus_per_thickness * pad.face_area * np.linalg.norm(along, axis=-1)
    # A point that is pulled has no pressure that friction could act on.
    load = np.maximum(points.load, 0.0)
    return float(np.minimum(mu * load, stick).sum() / load.sum())


def _plate(choice: EffectChoice, _: int) -> float:
    """Compliance of the backing plate over that of the pad."""
    return plate_compliance(choice.solver.scene.gripper)


def _traction(choice: EffectChoice, k: int) -> float:
    """`neglected_traction` on the coarse mesh, of the finger where it is larger."""
    solution = choice.coarse(k, choice.levels)
    return max(neglected_traction(c.state, c.mu) for c in solution.contacts) if solution else nan


def dropped_share(wrench: FloatArray, rho: float) -> float:
    """Mean share of a wrench that its three components f_z, tau_x and tau_y make up, of ``wrench (m, 6)``."""
    w = wrench / [1, 1, 1, rho, rho, rho]
    return float((np.linalg.norm(w[:, 2:5], axis=1) / np.linalg.norm(w, axis=1)).mean())


# --- effects that are exact, or free ----------------------------------------------------------------------------------


def settled(scene: Scene, solution: Solution, fits: Sequence[Mapping[str, SurfaceFit]]) -> dict[str, Level]:
    """Levels of a solved case whose choice costs nothing; ``fits`` are both fingers' limit surfaces."""
    S, F_N = (sum(getattr(c.limits["ccm"], name) for c in solution.contacts) for name in ("S", "F_N"))
    curved = [finger["ccm"] for finger in fits]
    wrench, surface = scene.effects.wrench, scene.limit_surface.model
    dropped = max(dropped_share(fit.wrench, fit.rho) for fit in curved)
    error = float(np.max([fit.fit_error.Erad for fit in curved]))
    kind = EFFECTS["limit_surface"][2 if surface == "quartic" else surface != "three_motions"]
    reason = SYMMETRY if scene.effects.model_size == "auto" else FORCED
    return {
        "model_size": Level(EFFECTS["model_size"][-1 - solution.fingers.planes], reason=reason),
        # one where a plane of symmetry lies between two that press on one wall
        "fingers": Level("one", reason=SYMMETRY) if solution.fingers.fingers_solved == 1 else Level("two"),
        "friction": Level("ccm", 1.0 - F_N / S, CHEAP),
        "wrench": Level("3-D", dropped, APART) if wrench == "auto" else Level(wrench, dropped, FORCED),
        # an ellipsoid, whose quality is 5 to 10 % off, only where the scene asks for it
        "limit_surface": Level(kind, error, CHEAP if surface == "quartic" else FORCED),
    }


# --- the table, in the order of choosing ------------------------------------------------------------------------------

STEPS: dict[str, tuple[Step, ...]] = {
    "sheet": (Step("rigid", "elastic", _plate, STIFF_PLATE, SOFT_PLATE),),
    "object": (
        Step("rigid", "linear_shell", lambda c, _: max(c.indentation[0], c.indentation[2]), STIFF_WALL, 0.0),
        Step("linear_shell", "nonlinear_shell", lambda c, _: c.indentation[1], SMALL_INDENTATION, 0.0),
    ),
    COUPLING: (Step("none", "tangential", _traction, SMALL_TRACTION, inf),),
}


def level_named(effect: str, name: str) -> str:
    """Level as `study.quantities` lists it, by its name in a scene.

    >>> level_named("sheet", "elastic")
    'elastic plate'
    """
    steps = STEPS[effect]
    return EFFECTS[effect][[steps[0].low, *(step.high for step in steps)].index(name)]


# --- the choice -------------------------------------------------------------------------------------------------------


class EffectChoice:
    """Levels of the effects of one candidate, chosen where its scene leaves them open; solves its cases at them.

    ``levels``: those that all forces have.
    """

    def __init__(self, solver: CandidateSolver) -> None:
        self.solver, self.count = solver, len(solver.forces)
        self.target = solver.scene.accuracy.target or E_N_TARGET
        self._wanted = {name: getattr(solver.scene.effects, name) for name in Levels._fields}
        if solver.scene.gripper.tilt_stiffness_nm_per_rad is not None:
            self._wanted["sheet"] = "rigid"  # a plate that tilts is
        cheapest = {name: STEPS[name][0].low for name in Levels._fields}
        self.levels = Levels(*(cheapest[n] if level == "auto" else level for n, level in self._wanted.items()))
        self._chosen: dict[tuple[str, int], Level] = {}
        for name in Levels._fields:
            if name != COUPLING:
                self.level(name, self.count - 1)

    def level(self, name: str, k: int) -> Level:
        """Level of one effect with steps at the ``k``-th force."""
        k = k if name == COUPLING else self.count - 1
        if (name, k) not in self._chosen:
            self._chosen[name, k] = self._choose(name, k)
        return self._chosen[name, k]

    def _choose(self, name: str, k: int) -> Level:
        """Choose the level of one effect at the ``k``-th force; what all forces share is noted in ``levels``."""
        wanted, steps = self._wanted[name], STEPS[name]
        if name == "object" and not self.solver.walled:
            return Level(level_named(name, steps[0].low), reason=NO_WALL)
        if wanted != "auto":
            # of a force by itself the solved state tells it, see `effects_at`: nothing is solved for it here
            indicator = nan if name == COUPLING else steps[-1].indicator(self, k)
            return Level(level_named(name, wanted), indicator, FORCED)
        # what is stated is the last step's indicator, whichever step was decided last
        return self._at(name, k)._replace(indicator=steps[-1].indicator(self, k))

    def _at(self, name: str, k: int) -> Level:
        """Level of one effect at the ``k``-th force: each step is skipped, taken, or measured."""
        for step in STEPS[name]:
            measured = partial(self.changes, name, step, k)
            # a wall's dents and stresses are no part of the target
            target = min(self.target, E_N_TARGET) if name == "object" else self.target
            level = decided(name, step, step.indicator(self, k), measured, target)
            if level.level == level_named(name, step.low):
                break
            if name != COUPLING:
                self.levels = self.levels._replace(**{name: step.high})
        return level

    def changes(self, name: str, step: Step, k: int) -> tuple[float, float, float]:
        """Relative changes of e_n, payload and quality by one step at the ``k``-th force on the coarse mesh.

        NaN where they are not known. Of effects that all forces share: at the force where they are largest.
        """
        forces = [k] if name == COUPLING else range(self.count)
        # what is not known at some force may be the largest
        return max((self._compared(name, step, i) for i in forces), key=lambda c: np.nan_to_num(largest(c), nan=inf))

    def _compared(self, name: str, step: Step, k: int) -> tuple[float, float, float]:
        pair = [solution.contacts for solution in self._coarse_pair(name, step, k)]
        # on a few elements e_n follows from their size, and what other gaps change is no measure of the effect
        if not pair or any(
            a.on_few_elements or b.on_few_elements or a.nodal_instead != b.nodal_instead
            for a, b in zip(*pair, strict=True)
        ):
            return nan, nan, nan
        low, high = (self._judged(contacts) for contacts in pair)
        e_n, payload, score = (b / a - 1.0 if a > 0 else nan for a, b in zip(low, high, strict=True))
        return e_n, payload, score

    def _coarse_pair(self, name: str, step: Step, k: int) -> tuple[Solution, Solution] | tuple[()]:
        """Solutions on the coarse mesh without and with a step; empty where one of them does not exist."""
        low = self.coarse(k, self.levels._replace(**{name: step.low}))
        high = low and self.coarse(k, self.levels._replace(**{name: step.high}))
        return (low, high) if low and high else ()

    def _judged(self, contacts: Sequence[PressedContact]) -> tuple[float, float, float]:
        """e_n of the weaker finger [m], payload [kg] and quality, NaN where unknown."""
        e_n = min(c.limits["ccm"].e_n for c in contacts)
        try:
            values = grasp_values(tuple(contacts), self.solver.settings)
        except (*TOO_SMALL, RuntimeError, ValueError):  # a contact without torque has no hull
            return e_n, nan, nan
        return e_n, *values["maps/payload"], *values["maps/quality"]

    def coarse(self, k: int, levels: Levels) -> Solution | None:
        """What the ``k``-th force has on the coarse mesh; None where it has nothing."""
        try:
            return self.solver.solve(k, COARSE, levels)
        except TOO_SMALL:
            return None

    @cached_property
    def indentation(self) -> tuple[float, float, float]:
        """Indentation of a linear wall at the highest force over the closing displacement and over its thickness.

        The third reaches `STIFF_WALL` at half the allowed dent or strength: what is solved may be twice the estimate.
        """
        if not self.solver.walled:
            return nan, nan, nan
        scene, fingers, force = self.solver.at_levels(self.levels), self.solver.fingers, self.solver.forces[-1]
        grasp = grasp_of(scene, fingers)
        pad = pad_of(scene, grasp.pad_symmetry, contact_rules(scene, walled=True)[0], coarser=False)
        closing = SpringBed(pad, fingers[0].gap).closing(force)
        # foam gets stiffer: a small pad closes a third as far as a bed of springs
        plain = self.levels._replace(object="rigid", friction_pressure_coupling="none")
        if self._wanted["object"] == "auto" and (rigid := self.coarse(self.count - 1, plain)):
            closing = min(closing, *(contact.state.closing for contact in rigid.contacts))
        body, dent = thin_body(scene.object), getattr(scene.object, "allowed_dent", None)
        indentation, ratio, stress = estimated_indentation(body, grasp, scene, closing, force)
        borne = max(indentation / (dent or inf), stress / (body.material.yield_strength or inf))
        return indentation / closing, ratio, 2.0 * STIFF_WALL * borne

    # --- cases at the levels that were chosen -------------------------------------------------------------------------

    def case(self, k: int) -> Solved:
        """A case, with friction that acts back where it was chosen and can be solved; raises as `CandidateSolver`."""
        level, note = self.level(COUPLING, k), ""
        solved: Solved | None = None
        if level.reason != FORCED and level.level == level_named(COUPLING, "tangential"):
            coupled = self.levels._replace(friction_pressure_coupling="tangential")
            try:
                # a wall whose coarse load path with friction has ended: the fine one takes long to end, too
                if self.levels.object.endswith("shell") and forces_apart(self.solver.scene):
                    self.solver.solve(k, COARSE, coupled)
                solved = self.solver.case(k, coupled, self._share_left_out(k))
            except (ConvergenceError, CheckError) as error:
                self._chosen[COUPLING, k] = level._replace(level=level_named(COUPLING, "none"), reason=FAILED)
                note = LEFT_OUT.format(reason=error)
        solved = solved or self.solver.case(k, self.levels, self._share_left_out(k))
        left_out = self._left_out(k) if solved.coarse else []
        both = (self._coarse_pair(name, STEPS[name][0], k) for name in left_out)
        pairs = [*solved.pairs, *((*pair, 1.0) for pair in both if pair)]
        return solved._replace(pairs=pairs, note=join_notes(note, solved.note))

    def _left_out(self, k: int) -> list[str]:
        """Effects whose dearer level was measured and left out."""
        return [name for name in ("sheet", COUPLING) if self.level(name, k).reason == LITTLE]

    def _share_left_out(self, k: int) -> float:
        """What effects that were left out add to the error of the quantity that ``accuracy.target`` is for."""
        field = CHANGE_OF[self.solver.scene.accuracy.target_of]
        return self.skipped_share(k) + sum(abs(getattr(self.level(name, k), field)) for name in self._left_out(k))

    def effects_at(self, k: int, contacts: Sequence[PressedContact]) -> dict[str, Level]:
        """Levels of the effects that are chosen at the ``k``-th force, whose contacts are solved."""
        levels = {name: self.level(name, k) for name in Levels._fields}
        if levels[COUPLING].reason == FORCED:
            indicator = max(neglected_traction(c.state, c.mu) for c in contacts)
            levels[COUPLING] = levels[COUPLING]._replace(indicator=indicator)
        return levels

    def skipped_share(self, k: int) -> float:
        """What friction that its indicator left out may change of any number, as a share."""
        level = self.level(COUPLING, k)
        return E_N_TARGET / SMALL_TRACTION * level.indicator if level.reason == BELOW else 0.0

    def closes_less(self) -> float:
        """By what share fingers close less on a wall that is taken as rigid, because its indicator said so."""
        level = self.level("object", self.count - 1)
        stiff = level.level == level_named("object", "rigid") and level.reason == BELOW
        return RIGID_CLOSES * self.indentation[0] if stiff else 0.0

    def flags_at(self, k: int) -> Flag:
        """Flag of a case that lacks an effect that moves its numbers by more than the target."""
        return Flag.LEFT_OUT if self.level(COUPLING, k).reason == FAILED else Flag(0)


def largest(changes: Sequence[float]) -> float:
    """The largest of some changes in size; NaN where the first, that of e_n, is not known.

    >>> largest((0.01, -0.02, nan))
    0.02
    """
    return nan if np.isnan(changes[0]) else float(np.nanmax(np.abs(changes)))


def decided(
    name: str, step: Step, indicator: float, measured: Callable[[], tuple[float, float, float]], target: float
) -> Level:
    """Level of an effect by one step: skipped or taken by its indicator, else by what is measured.

    ``measured`` gives the relative changes of e_n, payload and quality; it is called only where the indicator leaves
    the level open. ``target`` is the relative error that is good enough.
    """
    low, high = (level_named(name, level) for level in (step.low, step.high))
    if surely_below(indicator, step.skip * target / E_N_TARGET):
        return Level(low, indicator, BELOW)
    if indicator > step.take:
        return Level(high, indicator, ABOVE)
    changes = measured()
    change = largest(changes)
    if surely_below((1.0 + DOUBT) * change, target):
        return Level(low, indicator, LITTLE, *changes)
    # undecided takes the dearer level, which is right in both cases
    return Level(high, indicator, MUCH if change > target else UNDECIDED, *changes)
