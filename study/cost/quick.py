"""A small study for one run: pad and wall are refined together, from coarse upward, until a mesh meets the target.

No more is solved than the answer needs: the mesh that is chosen and one finer, on as many probes as a share of the
run's own time pays for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from study.case import sweep
from study.cost.choose import Choice, allowed, explicit
from study.cost.extrapolate import limit
from study.cost.file import CostStudy
from study.cost.knobs import Knob, Level, contact_knobs, weight, with_level
from study.cost.measure import Measured, measure_once
from study.cost.probes import Probe, probes
from study.cost.study import plain, setting_of
from study.scene import Scene

FloatArray = NDArray[np.float64]
SHARE = 0.05  # of the run's time that choosing may take
PESSIMISTIC, FORMAL = 1.5, 2.0  # orders taken where none is seen, and at most
FEWEST = 3  # meshes: two coarse ones can agree by chance
SOLVED = 9.0  # time of the three coarsest meshes over that of the coarsest, about
MOST_PROBES, MOST_WEIGHT = 3, 40.0  # and no mesh more than so many times as heavy as the scene's own


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


def errors_of(sizes: Sequence[float], values: FloatArray) -> tuple[FloatArray, str]:
    """Largest relative error ``(levels,)`` of every level against the limit of all, and how the limit was found.

    Where no order is seen, the last step is taken to shrink with the order of a contact's edge.
    """
    found = limit(sizes, values, FORMAL)
    goal, told = found.value, f"observed order {found.order:.1f}"
    beyond = 0.0
    if found.remark:
        goal = values[-1]
        ratio = (sizes[-2] / sizes[-1]) ** PESSIMISTIC
        beyond = np.abs(values[-1] - values[-2]) / goal / (ratio - 1.0)
        told = f"no order seen: {found.remark}; {PESSIMISTIC:g} assumed"
    return (np.abs(values - goal) / np.abs(goal) + beyond).max(axis=1), told


def quick_probes(scene: Scene) -> tuple[list[Probe], int]:
    """As many probes as a share of the run pays for, and the cases of the run.

    They are solved at the lowest and the highest force; a single case at the lowest force on the smallest of three
    contacts, where errors are largest.
    """
    units = sweep.units(scene, lambda point: point.axis_symmetry)
    cases = len(units) * len(scene.load.normal_force)
    paid = int(SHARE * cases / SOLVED)
    found = probes(scene, count=MOST_PROBES)[: max(1, paid // 2)]
    both = (0, -1) if paid > 1 else (0,)
    return [Probe(p.label, p.unit, tuple(dict.fromkeys(p.forces[i] for i in both))) for p in found], cases


def quick_choice(
    scene: Scene, study: CostStudy, found: Sequence[Probe], cases: int, save: Callable[[], None],
    solve: Callable[[str, Probe, Level], Measured] = measure_once,
) -> Choice:  # fmt: skip
    """Climb the meshes until one is within the target; what ``study`` holds already is not solved again."""
    target, own, levels = float(scene.accuracy.e_n), plain(scene), ladder(scene)
    if len(levels) < FEWEST:
        remark = "the scene gives the mesh itself, so nothing is left to choose and its error is not known"
        return Choice({}, target, math.nan, math.nan, math.nan, remark)
    values: list[FloatArray] = []
    kept: list[Level] = []
    seconds: list[float] = []
    error, told, failed = np.empty(0), "", list[str]()
    for level in levels:
        setting = setting_of(own, level)
        for probe in found:
            if (setting, probe.label) not in study.measured:
                study.add(solve(setting, probe, level))
                save()
        row = np.concatenate([m.values[:, 0] for m in study.of(setting)])
        if not np.isfinite(row).all():
            failed.append(level.name)
            continue
        values.append(row)
        kept.append(level)
        seconds.append(float(np.mean([m.seconds for m in study.of(setting)])))
        if len(kept) >= FEWEST:
            error, told = errors_of([v.size for v in kept], np.array(values))
            if error[:-1].min() <= target:
                break
    if len(kept) < FEWEST:
        told = f"only {len(kept)} meshes could be solved on the probes, so errors are not known"
        return Choice({}, target, math.nan, math.nan, math.nan, told)
    return _told(study, kept, error, seconds, told, target, cases, failed)


def _told(study, kept, error, seconds, told, target, cases, failed) -> Choice:
    good = np.flatnonzero(error <= target)
    i = int(good[0]) if good.size else len(kept) - 1
    share = study.spent / (cases * seconds[i])
    text = f"{told}; choosing took {share:.0%} of the {cases} cases' time"
    if share > SHARE:
        text += f", more than {SHARE:.0%}, because so small a map does not pay for a smaller study"
    if failed:
        text += f"; {', '.join(failed)} failed on a probe"
    if not good.size:
        text += "; no mesh that was tried meets the target, this is the finest"
    return Choice(dict(kept[i].values), target, float(error[i]), float(error[i]), seconds[i], text)
