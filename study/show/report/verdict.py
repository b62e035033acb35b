"""The answer of a report: where to grasp, how wide and how hard, how sure that is, and what stands against it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softjaw.study.flags import Flag, flags_in
from softjaw.study.result.layout import DONE, FAILED, MISSING
from softjaw.study.show.data import Data, number, shown
from softjaw.study.show.tables.certainty import sure
from softjaw.study.show.tables.certainty import verdict as judgement
from softjaw.study.show.tables.ranking import BORNE, largest, passed_over

LEAST = 1e-4  # relative error below which only a bound is given
CAVEAT = (
    "The paper publishes neither the pad dimensions of its gripper nor the numbers behind its figures. The dimensions "
    "used here stand in the scene below. Absolute numbers of its figures can therefore not be reproduced, only "
    "trends: in the paper, differences between the models grow with curvature, and torque and e_n grow with force."
)
ESTIMATED = "± is the difference to a mesh half as fine, in per cent of the value; the error is usually smaller."
NOT_ESTIMATED = "The error of the mesh was not estimated; accuracy.meshes = 2 in the scene does that."
WITH_INTERVALS = (
    "± is the half-width of the interval within which about 95 of 100 cases lie, in per cent of the value; it has the"
    " parts that [uncertainty] in the scene asks for."
)
VALUES = ("quality", "quality_fitted", "e_n", "f_x_max", "f_y_max", "tau_z_max")


def subtitle(data: Data) -> str:
    """File and axes in one line."""
    words, last = [], len(data.axes) - 3
    for position, axis in enumerate(data.axes):
        unit, factor = shown(axis.units)
        n, low, high = len(axis.values), axis.values.min() * factor, axis.values.max() * factor
        reach = number(low, 4) if n == 1 else f"{number(low, 4)} to {number(high, 4)}"
        space, plural = "" if unit in ("", "°") else " ", "s" * (n > 1)
        name = f"{data.name(axis)}{plural}" if position >= last else f"value{plural} of {data.name(axis)}"
        if position == last and data.by_poses:
            words.append(f"{n} candidate{plural}")
        elif not (position == last + 1 and data.by_poses):
            words.append(f"{n} {name} ({reach}{space}{unit})")
    return f"{Path(data.ds.attrs['file']).name}: {' × '.join(words)}"


def verdict(data: Data, mu: float | None) -> list[str]:
    """The answer in sentences, and how many cases it rests on."""
    done, failed, missing = (data.count(state) for state in (DONE, FAILED, MISSING))
    total = data.status.size
    cases = f"{done} of {total} cases are solved, {failed} failed, {missing} are missing."
    if done == total:
        cases = f"All {total} cases are solved." if total > 1 else "It is the only case of this study."
    if data.best is None:
        return [f"No grasp is solved. {cases}"]
    best = data.best
    first = [_best(data, best), *_apart(data, best), _carried(data, best, mu), *_weight(data, best)]
    wall = [said] if (said := wall_sentence(data, best)) else []
    return [*first, *wall, *_planar(data, best), *_passed_over(data, best), *_other_force(data, best), cases]


def key_values(data: Data) -> list[tuple[str, str]]:
    """What a reader wants at once: where, how wide, how hard, and how good that is."""
    best = data.best
    if best is None:
        return []
    pairs = [("where", data.place(best)), ("how hard", f"{number(data.forces[best[-1]])}\u00a0N per finger")]
    if np.isfinite(data.at("contact_distance", best)):
        opening = 1e3 * data.at("contact_distance", best)
        pairs.insert(1, ("how wide (opening at first touch)", f"{number(opening, 4)}\u00a0mm"))
    if data.bound("force_high") is not None:
        pairs.append(("safe forces [N]", safe_range(data, best)))
    names = {"quality": "grasp quality", "e_n": "e_n [mm]", "safety_factor": "safety factor"}
    pairs += [(text, value(data, n, best, 3)) for n, text in names.items() if np.isfinite(data.at(n, best))]
    return pairs


def _best(data: Data, best: tuple[int, ...]) -> str:
    what = f"quality {value(data, 'quality', best, 3)}"
    if data.score != "quality":
        what = "ranked by e_n, for no quality is stored"
    if not np.isfinite(data.at(data.score, best)):
        what = "which has no score"
    alike = data.images(best)
    same = f" The same score at {listed([data.place(i) for i in alike])}." if alike else ""
    name = "Best grasp" if data.grasps > 1 else "Best point of the sweep" if data.sweeps else "The grasp"
    return (
        f"{name} at {number(data.forces[best[-1]])} N per finger: {data.place(best)}, {what}, "
        f"e_n {value(data, 'e_n', best, 3)}{' mm' * bool(np.isfinite(data.at('e_n', best)))}.{same}"
    )


def _carried(data: Data, best: tuple[int, ...], mu: float | None) -> str:
    f_x, f_y, tau = (value(data, name, best, 3) for name in ("f_x_max", "f_y_max", "tau_z_max"))
    friction = f", mu = {mu:g}" if mu is not None else ""
    return (
        f"There a contact carries up to f_x = {f_x} N along the pad, f_y = {f_y} N across it and tau_z = {tau} N mm of"
        f" torque about its normal (CCM{friction}; weaker finger)."
    )


def _apart(data: Data, best: tuple[int, ...]) -> list[str]:
    """Whether the best grasp is better than those that follow beyond the errors."""
    order = [i[:-1] for i in data.order(best[-1]) if not data.lost[i] and np.isfinite(data.at(data.score, i))]
    places = [tuple(np.delete(index, -1)) for index in np.ndindex(data.shape[:-1])]
    flat = [int(np.ravel_multi_index(index, data.shape[:-1])) for index in order]
    units = "m" * (data.score == "e_n")
    said = judgement(sure(data.ds, data.score, best[-1]), flat, places, units).replace("+-", "±")
    return [f"{said[0].upper()}{said[1:]}."] if said else []


def _weight(data: Data, index: tuple[int, ...]) -> list[str]:
    """How many times its own weight the object could have, where its mass is known."""
    factor = data.at("safety_factor", index)
    if not np.isfinite(factor):
        return []
    what = f"The grasp holds {number(factor)} times the object's weight at this force (CCM)"
    return [f"{what}." if factor >= 1 else f"{what}: it would lose the object."]


def wall_sentence(data: Data, index: tuple[int, ...]) -> str:
    """How a thin wall takes one case, and between which forces it would be safe; empty without a wall."""
    if not np.isfinite(data.at("indentation", index)):
        return ""
    indentation, stress = (
        f"{value(data, name, index, 3)} {data.units(name)[1]}" for name in ("indentation", "wall_stress")
    )
    said = f"The wall is dented by {indentation} and its stress reaches {stress}."
    low, high = (data.bound(name) for name in ("force_low", "force_high"))
    if high is None or not np.isfinite(high[index[:-1]]):
        return said
    top, bottom = float(high[index[:-1]]), None if low is None else float(low[index[:-1]])
    if bottom is not None and not bottom <= top:
        return f"{said} No solved force both holds the object and leaves the wall undamaged."
    upper = f"at least {number(top)} N" if top >= data.forces[-1] * (1 - 1e-9) else f"{number(top)} N"
    if bottom is None:
        return f"{said} The wall bears {upper} per finger there."
    return f"{said} Safe forces there: {number(bottom)} N, which holds the object, to {upper}, which its wall bears."


def safe_range(data: Data, index: tuple[int, ...]) -> str:
    """The safe force range of one candidate in few characters; a plus: the wall bears the largest solved force."""
    low, high = (data.bound(name) for name in ("force_low", "force_high"))
    top = float("nan") if high is None else float(high[index[:-1]])
    bottom = 0.0 if low is None else float(low[index[:-1]])
    if not np.isfinite(top):
        return "–"
    more = "+" if top >= data.forces[-1] * (1 - 1e-9) else ""
    if not bottom <= top:
        return "none"
    below = "≤ " if low is None and not more else "" if low is None else f"{number(bottom)}–"
    return f"{below}{number(top)}{more}"


def uncertainty(data: Data, name: str, index: tuple[int, ...]) -> str:
    """How far off a value may be, where the file knows: the one place that says so in verdict, tables and maps."""
    error, interval = data.at(f"{name}_error", index), data.values(f"derived/{name}_interval")
    if interval is not None:
        error = interval[tuple(index)] / abs(data.at(name, index))
    if not np.isfinite(error):
        return ""
    share = "<\u00a00.01" if error < LEAST else number(100 * error, 2)
    return f" ±\u00a0{share}\u00a0%"


def value(data: Data, name: str, index: tuple[int, ...], digits: int = 4) -> str:
    """A map's value in the unit people read, with its uncertainty where that is known."""
    return number(data.at(name, index) * data.units(name)[2], digits) + uncertainty(data, name, index)


def _planar(data: Data, index: tuple[int, ...]) -> list[str]:
    """What the planar model that the scene prefers would claim."""
    words = []
    for name in ("quality", "e_n"):
        curved, planar = data.at(name, index), data.at(name, index, data.planar)
        if np.isfinite(curved) and np.isfinite(planar) and curved:
            change = 100 * (planar / curved - 1)
            more = f"{number(abs(change), 2)} % {'more' if change > 0 else 'less'}"
            words.append(f"{more if abs(change) >= 0.05 else 'the same'} {name}")
    return [f"A planar contact model (PCM, {data.planar}) would claim {' and '.join(words)}."] if words else []


def _other_force(data: Data, best: tuple[int, ...]) -> list[str]:
    """Where the score per unit of normal force is largest, if that is at another force."""
    tops = [i for k in range(len(data.forces)) for i in data.order(k)[:1] if not data.lost[i] or i == best]
    top = tops[largest(np.array([data.at(data.score, i) for i in tops]))]
    if top[-1] == best[-1] or not data.at(data.score, top) > data.at(data.score, best) * (1 + 1e-3):
        return []
    most = f"{number(data.at(data.score, top) * data.units(data.score)[2])} {data.units(data.score)[1]}".rstrip()
    what = "quality, a score per unit of normal force," if data.score == "quality" else data.score
    return [f"Over all forces {what} is largest at {data.place(top, force=True)}: {most}."]


def _passed_over(data: Data, best: tuple[int, ...]) -> list[str]:
    """Why the brightest place of the map is not the best grasp: those that cannot be used come last."""
    order = data.order(best[-1])
    scores = np.array([data.at(data.score, i) for i in order])
    better, why = passed_over(scores, np.array([data.flags[i] for i in order], int))
    if not better:
        return []
    highest = order[better[0]]
    place, top = data.place(highest), number(data.at(data.score, highest) * data.units(data.score)[2])
    count = "One grasp scores" if len(better) == 1 else f"{len(better)} grasps score"
    return [f"{count} higher at this force (the highest {top}, {place}) but cannot be used: {why}."]


def chosen(data: Data) -> str:
    """What there is to say of the candidate that was asked for; empty where none was."""
    index = data.chosen
    if index is None:
        return ""
    which = f"Chosen candidate {np.ravel_multi_index(index[:-1], data.shape[:-1])}: {data.place(index, force=True)}"
    if data.status[index] == FAILED:
        return f"{which}, failed: {data.messages[index] or 'no reason was given'}"
    if data.status[index] != DONE:
        return f"{which}, is not solved yet."
    order = data.order(index[-1])
    said = ", ".join(f"{data.label(name)} {value(data, name, index, 3)}" for name in ("quality", "e_n"))
    flags = "".join(f" {flag.word}: {flag.sentence}." for flag in flags_of(data, index))
    text = f"{which}: {said}, place {order.index(index) + 1} of {len(order)} at this force.{flags}"
    return text + (" It is the best one." if index == data.best else "")


def warnings(data: Data) -> list[str]:
    """What stands against trusting the best grasp."""
    best, found = data.best, []
    if data.unfinished:
        missing = data.count(MISSING)
        found.append(f"This study is unfinished: {missing} cases are missing, so a better grasp may be found.")
    if best is None:
        return found
    if best[-1] < len(data.forces) - 1:
        above = "grasp is safe" if np.any(data.status[..., best[-1] + 1 :] == DONE) else "case is solved"
        found.append(f"No {above} above {number(data.forces[best[-1]])} N; all comparisons are made there.")
    if reasons := [flag.sentence for flag in flags_of(data, best) if flag & BORNE]:
        found.append(f"Every grasp at this force carries a warning. Best one: {'; '.join(reasons)}.")
    if flagged := data.flagged(best):
        found.append(f"The best case does not pass its checks: {', '.join(flagged)}.")
    if note := str(data.messages[best]):
        found.append(f"Note on the best case: {note}.")
    stations = data.axes[-3].values
    if len(stations) > 2 and not data.by_poses and best[-3] in (int(stations.argmin()), int(stations.argmax())):
        found.append("The best station is the first or last one that was tried; a better one may lie beyond.")
    return found


def meaning(data: Data) -> str:
    """What the numbers behind ± are; empty where nothing is solved."""
    if data.best is None:
        return ""
    if data.values("derived/quality_interval") is not None:
        return WITH_INTERVALS
    return ESTIMATED if any(uncertainty(data, name, data.best) for name in VALUES) else NOT_ESTIMATED


def listed(words: list[str], most: int = 4) -> str:
    """The first few words, and how many more there are."""
    return "; ".join(words[:most]) + (f"; and {len(words) - most} more" if len(words) > most else "")


def flags_of(data: Data, index: tuple[int, ...]) -> list[Flag]:
    """Flags of a case."""
    return flags_in(int(data.flags[tuple(index)]))
