"""A small study for one run: pad and wall are refined together, from coarse upward, until a mesh meets the target.

It has to meet it on probes, the hardest contact among them, and then on cases that it was not chosen by.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.accuracy.cost.choose import Choice, allowed, explicit, nothing
from softjaw.study.accuracy.cost.errors import flagged, flags_of, places, unsure
from softjaw.study.accuracy.cost.extrapolate import limit
from softjaw.study.accuracy.cost.file import CostStudy
from softjaw.study.accuracy.cost.knobs import Knob, Level, contact_knobs, weight, with_level
from softjaw.study.accuracy.cost.measure import Measured, measure_once
from softjaw.study.accuracy.cost.probes import Probe, demanding, held_out, probes_at
from softjaw.study.accuracy.cost.study import plain, setting_of
from softjaw.study.case import sweep
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]
FORMAL = 2.0  # highest order that is believed
ALIKE = 1e-6  # errors that differ by less of themselves are equal
FEWEST = 3  # meshes: two coarse ones can agree by chance
MOST_WEIGHT = 40.0  # no mesh is more than so many times as heavy as the scene's own


def ladder(scene: Scene) -> list[Level]:
    """Meshes of pad and wall together, the coarsest first; only what the scene leaves open changes."""
    given = explicit(scene)
    own = plain(scene)
    knobs = {k.name: k for k in contact_knobs(own)[0]}
    kind = "pad mesh, hex27" if own.gripper.element == "hex27" else "pad mesh, hex8"
    pads = _open(knobs.get(kind), given)
    walls = _open(knobs.get("wall mesh"), given) or _open(knobs.get("object grid"), given)
    if not pads or not walls:
        made = pads or sorted(walls, key=lambda level: -level.size)
    else:
        made = [_joined(pad, wall) for pad, wall in zip(pads, sorted(walls, key=lambda v: -v.size), strict=False)]
    most = MOST_WEIGHT * weight(own)
    return [level for level in made if weight(with_level(own, level)) <= most]


def _open(knob: Knob | None, given: Mapping[str, Any]) -> list[Level]:
    return [level for level in knob.levels if allowed(level, _without_kind(given))] if knob else []


def _without_kind(given: Mapping[str, Any]) -> dict[str, Any]:
    """The kind of elements stays that of the scene, so that it need not be told apart."""
    return {key: value for key, value in given.items() if key != "gripper.element"}


def _joined(pad: Level, wall: Level) -> Level:
    return Level(f"{pad.name}; wall {wall.name}", pad.values + wall.values, pad.size)


def quick_probes(scene: Scene) -> tuple[list[Probe], list[Probe], int]:
    """Probes at the lowest and the highest force, the cases that the choice is tried on, and all cases of the run."""
    units, forces = sweep.units(scene, lambda point: point.axis_symmetry), scene.load.normal_force
    found = probes_at(scene, demanding(units), tuple(dict.fromkeys((forces[0], forces[-1]))))
    return found, held_out(scene, found), len(units) * len(forces)


@dataclass(frozen=True)
class Judged:
    """What meshes are worth, the coarsest first.

    Attributes
    ----------
    levels : list of Level
        Those that solve every case that any mesh solves.
    cases : list of str
        In words.
    error : (levels, cases) array
        Relative distance of e_n from the limit of all meshes, and the doubt of that limit: the largest of this mesh
        and all finer ones. NaN where that is not known.
    good : (levels,) array of bool
        Whether a mesh keeps the target, and neither it nor a finer one is flagged.
    flagged : (levels,) array of bool
        Whether a mesh carries a flag that the finest does not.
    known : bool
        Whether no case is flagged as coarse on the finest mesh too, so that its error is not known.
    told : str
        How the limit was found, and what stands against trusting it.
    """

    levels: list[Level]
    cases: list[str]
    error: FloatArray
    good: NDArray[np.bool_]
    flagged: NDArray[np.bool_]
    known: bool
    told: str

    @property
    def chosen(self) -> int | None:
        """The coarsest good mesh, if there is one."""
        return int(self.good.argmax()) if self.good.any() else None

    @property
    def best(self) -> int:
        """The most accurate mesh without a flag that the finest does not carry; of equals the coarsest."""
        worst = np.where(self.flagged, np.inf, np.nanmax(self.error, axis=1))
        return int(np.argmax(worst <= worst.min() * (1 + ALIKE)))


def judge(levels: Sequence[Level], found: Sequence[Sequence[Measured]], target: float) -> Judged:
    """Judge meshes by what was measured on them, ``found[level][probe]``."""
    values = np.array([np.concatenate([m.values[:, 0] for m in own]) for own in found])
    flags = np.array([flags_of(own) for own in found])
    names = places(found[0])
    alive = np.isfinite(values).any(axis=0)
    sound = np.isfinite(values[:, alive]).all(axis=1)
    kept = [level for level, own in zip(levels, sound, strict=True) if own]
    last = flags[sound][-1] if kept else np.zeros(len(names), np.int64)
    sure = alive & ~unsure(last)
    told = [f"{level.name} failed on a probe" for level, own in zip(levels, sound, strict=True) if not own]
    told += [f"no mesh solves {name}" for name, own in zip(names, alive, strict=True) if not own]
    told += [f"even the finest mesh is flagged at {names[k]}" for k in np.flatnonzero(alive & ~sure)]
    error = np.full((len(kept), len(names)), np.nan)
    if len(kept) < FEWEST or not sure.any():
        told.append(f"only {len(kept)} meshes could be solved on the probes" * (len(kept) < FEWEST))
        none = np.zeros(len(kept), bool)
        return Judged(kept, names, error, none, none, False, "; ".join(filter(None, told)))
    own = values[np.ix_(sound, sure)]
    end = limit([level.size for level in kept], own, FORMAL)
    error[:, sure] = _no_luck((np.abs(own - end.value) + end.doubt) / np.abs(end.value))
    carried = flagged(flags[sound], last)[:, sure].any(axis=1)
    told += [f"{level.name} is flagged where the finest mesh is not" for level in np.array(kept, object)[carried]]
    good = (np.nanmax(error, axis=1) <= target) & ~_no_luck(carried)
    told.insert(0, f"no order seen: {end.remark}" if end.remark else f"observed order {end.order:.1f}")
    return Judged(kept, names, error, good, carried, bool((sure | ~alive).all()), "; ".join(told))


def _no_luck(errors: NDArray[Any]) -> NDArray[Any]:
    """Errors ``(levels, ...)`` that are no smaller than those of any finer level: chance may make one small."""
    return np.maximum.accumulate(errors[::-1])[::-1]


def quick_choice(
    scene: Scene, study: CostStudy, found: Sequence[Probe], others: Sequence[Probe], cases: int,
    save: Callable[[], None], solve: Callable[[str, Probe, Level], Measured] = measure_once,
) -> Choice:  # fmt: skip
    """Climb the meshes until one meets the target; what ``study`` holds already is not solved again.

    A mesh that meets it on ``found`` is tried on ``others``, which from then on count like the probes.
    """
    target, own, levels = float(scene.accuracy.e_n), plain(scene), ladder(scene)
    if len(levels) < FEWEST:
        remark = "the scene gives the mesh itself, so nothing is left to choose and its error is not known"
        return nothing(target, remark)

    def solved(level: Level, probes: Iterable[Probe]) -> list[Measured]:
        setting = setting_of(own, level)
        for probe in probes:
            if (setting, probe.label) not in study.measured:
                study.add(solve(setting, probe, level))
                save()
        return [study.measured[setting, probe.label] for probe in probes]

    probes = list(found)
    for count in range(FEWEST, len(levels) + 1):
        judged = judge(levels[:count], [solved(level, probes) for level in levels[:count]], target)
        if judged.chosen is not None and len(probes) == len(found):
            probes += others
            judged = judge(levels[:count], [solved(level, probes) for level in levels[:count]], target)
        if judged.known and judged.chosen is not None and judged.chosen < len(judged.levels) - 1:
            break
    return _told(study, own, judged, sum(len(p.forces) for p in found), target, cases)


def _told(study: CostStudy, own: Scene, judged: Judged, on_probes: int, target: float, cases: int) -> Choice:
    if not np.isfinite(judged.error).any():
        return nothing(target, judged.told)
    i = judged.best if judged.chosen is None else judged.chosen
    level, error = judged.levels[i], judged.error[i]
    seconds = float(np.mean([m.seconds for m in study.of(setting_of(own, level))]))
    text = f"largest error at {judged.cases[int(np.nanargmax(error))]}; {judged.told}"
    text += f"; choosing took as long as {study.spent / seconds:.0f} of the run's {cases} cases"
    if judged.chosen is None:
        text = f"no mesh that was tried keeps the target, this is the best that was reached; {text}"
    elif not judged.known:
        text = f"kept but where even the finest mesh is flagged, so that the error is not known; {text}"
    parts = error[:on_probes], error[on_probes:]
    measured, rest = (float(np.nanmax(e)) if np.isfinite(e).any() else math.nan for e in parts)
    return Choice(dict(level.values), target, float(np.nanmax(error)), measured, seconds, text, rest,
                  met=judged.chosen is not None and judged.known)  # fmt: skip
