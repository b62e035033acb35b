"""Effects: one table of what a case may be simulated with, and what a cheap indicator says of each.

A row is an effect. Its steps lead from a level to the next dearer one. Below ``skip`` of a step's indicator the cheaper
level is good to the target, above ``take`` the dearer one is surely needed; in between the coarse mesh decides, see
`study.case.choosing`. Effects without steps are exact, or cost next to nothing: ``settled`` says so of a solved case.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, nan
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from softjaw.friction.patch import FloatArray
from softjaw.study.case.model import plate_compliance
from softjaw.study.case.result import surely_below
from softjaw.study.quantities import E_N_TARGET, EFFECTS, REASONS

if TYPE_CHECKING:
    from softjaw.study.case.choosing import Candidate
    from softjaw.study.scene import Scene

(
    ONLY, FORCED, BELOW, ABOVE, SYMMETRY, NO_WALL, CHEAP, APART, LITTLE, MUCH, UNDECIDED, FAILED,
) = range(len(REASONS))  # fmt: skip
# In 440 cases (pads, objects, supports, forces up to 13 N) a rigid plate put e_n off by at most 3.5 times the relative
# compliance of the plate that it stood for (where a pad just reaches the middle of a waist).
STIFF_PLATE, SOFT_PLATE = E_N_TARGET / 3.5, 0.05
# In 92 cases friction that acts back moved e_n by at most 0.5 times the traction that it adds, where that was below a
# tenth of the pressure. No traction is so large that it surely moves e_n.
SMALL_TRACTION = E_N_TARGET / 0.5
# Indentation over closing displacement up to which the e_n of a rigid wall was good to 0.5 % (54 cases), and over its
# thickness up to which that of a linear shell was good to 0.3 %. Above, nothing is measured: indentation and stress are
# wanted, too, which a rigid wall has not and e_n does not tell.
STIFF, SMALL_INDENTATION = 0.02, 0.6
SURFACES = {
    "three_motions": "ellipsoid from three motions",
    "axis_aligned": "fitted ellipsoid",
    "full": "fitted ellipsoid",
    "quartic": "convex quartic",
}
MODEL_SIZES = ("full", "half", "quarter")  # by the number of planes of symmetry


class Level(NamedTuple):
    """Level of an effect in one case, and why.

    Attributes
    ----------
    level : str
        Of those that `study.quantities.EFFECTS` lists.
    indicator : float
        NaN where it is not known.
    reason : int
        Index of `study.quantities.REASONS`.
    change, payload_change : float
        Relative change of e_n and of the payload by the dearer of the two levels that were compared last, on the coarse
        mesh; NaN where nothing was measured.
    """

    level: str
    indicator: float = nan
    reason: int = ONLY
    change: float = nan
    payload_change: float = nan


@dataclass(frozen=True)
class Simulated:
    """A solved case: contacts of both fingers, their limit surfaces by friction model, and what solved it."""

    scene: Scene
    contacts: Sequence[Any]
    fits: Sequence[Mapping[str, Any]]
    planes: int
    fingers_solved: int


@dataclass(frozen=True)
class Step:
    """From one level to the next dearer one.

    Parameters
    ----------
    low, high : str
        Levels by their names in a scene.
    indicator : callable
        Of a candidate at its ``k``-th force; NaN where it is not known.
    skip, take : float
        Indicator up to which the effect is surely skipped for a target of 1 % in e_n (the bound grows with the target),
        and beyond which it is surely taken; 0 takes it wherever it is not skipped.
    """

    low: str
    high: str
    indicator: Callable[[Candidate, int], float]
    skip: float
    take: float


@dataclass(frozen=True)
class Row:
    """An effect.

    Parameters
    ----------
    steps : sequence of Step
        From the cheapest level on.
    each_force : bool
        Whether every force has a level of its own; else all have that which the highest one needs.
    settled : callable, optional
        Level of a solved case, for effects whose choice costs nothing.
    """

    steps: Sequence[Step] = ()
    each_force: bool = False
    settled: Callable[[Simulated], Level] | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Levels by their names in a scene, the cheapest first."""
        return (self.steps[0].low, *(step.high for step in self.steps)) if self.steps else ()


# --- indicators -------------------------------------------------------------------------------------------------------


def neglected_traction(state: Any, mu: float) -> float:
    """Share of the pressure sum that friction would add across it, if every point of the face stuck or slid [-].

    A point that moved by ``d`` along the object's surface would be held back by ``min(mu p, E d / thickness)``, as a
    column of foam is that is sheared by ``d``. A slope shows here too: there the whole pad moves along the surface.
    """
    pad, points = state.pad, state.points
    start = np.einsum("qa,fai->fqi", pad.face_N, pad.nodes[pad.face_nodes])
    moved = points.position - start
    along = moved - np.einsum("fqi,fqi->fq", moved, points.normal)[..., None] * points.normal
    stick = pad.modulus_per_thickness * pad.face_area * np.linalg.norm(along, axis=-1)
    # A point that is pulled has no pressure that friction could act on.
    load = np.maximum(points.load, 0.0)
    return float(np.minimum(mu * load, stick).sum() / load.sum())


def _traction(candidate: Candidate, k: int) -> float:
    """`neglected_traction` on the coarse mesh, of the finger where it is larger."""
    seen = candidate.seen(candidate.scene, candidate.forces, k)
    return nan if seen is None else max(neglected_traction(c.state, c.mu) for c in seen)


def may_bend(scene: Scene) -> bool:
    """Whether some candidates may be simulated with an elastic backing plate."""
    if scene.gripper.tilt_stiffness_nm_per_rad is not None:  # of a plate that is rigid itself
        return False
    if scene.effects.sheet != "auto":
        return scene.effects.sheet == "elastic"
    bound = STIFF_PLATE * (scene.accuracy.target or E_N_TARGET) / E_N_TARGET
    return not surely_below(plate_compliance(scene.gripper), bound)


def dropped_share(wrench: FloatArray, rho: float) -> float:
    """Mean share of a wrench that its three components f_z, tau_x and tau_y make up, of ``wrench (m, 6)``."""
    w = wrench / [1, 1, 1, rho, rho, rho]
    return float((np.linalg.norm(w[:, 2:5], axis=1) / np.linalg.norm(w, axis=1)).mean())


# --- effects that are exact, or free ----------------------------------------------------------------------------------


def _forced(case: Simulated, name: str, otherwise: int) -> int:
    """The reason of a level: the scene's word, or ``otherwise`` where it leaves the choice."""
    return otherwise if getattr(case.scene.effects, name) == "auto" else FORCED


def _model_size(case: Simulated) -> Level:
    return Level(MODEL_SIZES[case.planes], reason=_forced(case, "model_size", SYMMETRY))


def _fingers(case: Simulated) -> Level:
    """One finger where a plane of symmetry lies between two that press on one wall."""
    if case.fingers_solved == 1:
        return Level("one", reason=SYMMETRY)
    return Level("two", reason=ONLY)


def _friction(case: Simulated) -> Level:
    S, F_N = (sum(getattr(c.limits["ccm"], name) for c in case.contacts) for name in ("S", "F_N"))
    return Level("ccm", 1.0 - F_N / S, CHEAP)


def _wrench(case: Simulated) -> Level:
    dropped = max(dropped_share(own["ccm"].wrench, own["ccm"].rho) for own in case.fits)
    wanted = case.scene.effects.wrench
    return Level("3-D" if wanted == "auto" else wanted, dropped, _forced(case, "wrench", APART))


def _limit_surface(case: Simulated) -> Level:
    """An ellipsoid, whose quality is 5 to 10 % off, only where the scene asks for it."""
    model = case.scene.limit_surface.model
    error = float(np.max([own["ccm"].fit_error.Erad for own in case.fits]))
    return Level(SURFACES[model], error, CHEAP if model == "quartic" else FORCED)


# --- the table, in the order of choosing ------------------------------------------------------------------------------

ROWS: dict[str, Row] = {
    "sheet": Row((Step("rigid", "elastic", lambda c, _: c.plate_compliance, STIFF_PLATE, SOFT_PLATE),)),
    "object": Row(
        (
            Step("rigid", "linear_shell", lambda c, _: c.indentation[0], STIFF, 0.0),
            Step("linear_shell", "nonlinear_shell", lambda c, _: c.indentation[1], SMALL_INDENTATION, 0.0),
        ),
    ),
    "friction_pressure_coupling": Row(
        (Step("none", "tangential", _traction, SMALL_TRACTION, inf),),
        each_force=True,
    ),
    "model_size": Row(settled=_model_size),
    "fingers": Row(settled=_fingers),
    "friction": Row(settled=_friction),
    "wrench": Row(settled=_wrench),
    "limit_surface": Row(settled=_limit_surface),
}


def level_named(effect: str, name: str) -> str:
    """Level as `study.quantities` lists it, by its name in a scene.

    >>> level_named("sheet", "elastic")
    'elastic plate'
    """
    return EFFECTS[effect][ROWS[effect].names.index(name)]


def settled(case: Simulated) -> dict[str, Level]:
    """Levels of a solved case whose choice costs nothing."""
    return {name: row.settled(case) for name, row in ROWS.items() if row.settled is not None}
