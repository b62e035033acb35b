"""Words and tables of a report's verdict: the best grasps, how sure they are, and what stands against them."""

from __future__ import annotations

import numpy as np

from softjaw.study.accuracy.uncertainty.verdict import sure
from softjaw.study.accuracy.uncertainty.verdict import verdict as judgement
from softjaw.study.flags import Flag, flags_in
from softjaw.study.result.layout import DONE, FAILED, MISSING
from softjaw.study.show.data import LIMITS, Data, number, shown
from softjaw.study.show.report.page import box, paragraph, table
from softjaw.study.show.report.wall_words import SAFE, wall_sentence, window_text
from softjaw.study.show.tables.ranking import BORNE, largest, passed_over

BEST = 6
LEAST = 1e-4  # relative error below which only a bound is told
CAVEAT = (
    "The paper publishes neither the pad dimensions of its gripper nor the numbers behind its figures. The dimensions "
    "used here stand in the scene below. Absolute numbers of its figures can therefore not be reproduced, only "
    "trends: in the paper, differences between the models grow with curvature, and torque and e_n grow with force."
)
ESTIMATED = "± is the difference to a mesh half as fine, in per cent of the value; the error is usually smaller."
NOT_ESTIMATED = "The error of the mesh was not estimated; accuracy.meshes = 2 in the scene does that."
BANDED = (
    "± is the half-width of the band within which about 95 of 100 cases lie, in per cent of the value; it has the parts"
    " that [uncertainty] in the scene asks for."
)
VALUES = ("quality", "quality_fitted", "e_n", "f_x_max", "f_y_max", "tau_z_max")
HEADS = {
    "quality": "quality", "quality_fitted": "quality, fitted", "e_n": "e_n [mm]", "f_x_max": "max f_x [N]",
    "f_y_max": "max f_y [N]", "tau_z_max": "max tau_z [N mm]",
}  # fmt: skip


def subtitle(data: Data) -> str:
    """File and axes in one line."""
    words = []
    for axis in data.axes:
        unit, factor = shown(axis.units)
        n, low, high = len(axis.values), axis.values.min() * factor, axis.values.max() * factor
        reach = f"{number(low, 4)}" if n == 1 else f"{number(low, 4)} to {number(high, 4)}"
        space = "" if unit in ("", "°") else " "
        plain = axis is data.axes[-3] or axis is data.axes[-2] or axis is data.axes[-1]
        name = f"{data.name(axis)}{'s' * (n > 1)}" if plain else f"value{'s' * (n > 1)} of {data.name(axis)}"
        if axis is data.axes[-3] and data.by_poses:
            words.append(f"{n} candidate{'s' * (n > 1)}")
        elif not (axis is data.axes[-2] and data.by_poses):
            words.append(f"{n} {name} ({reach}{space}{unit})")
    return f"{data.result.path.name}: {' × '.join(words)}"


# --- verdict ---------------------------------------------------------------------------------------------------------


def verdict(data: Data, mu: float | None) -> str:
    """The answer in three sentences, and what stands against trusting it."""
    done, failed, missing = (data.count(state) for state in (DONE, FAILED, MISSING))
    total = data.status.size
    cases = f"{done} of {total} cases are solved, {failed} failed, {missing} are missing."
    if done == total:
        cases = f"All {total} cases are solved." if total > 1 else "It is the only case of this study."
    if data.best is None:
        return box([f"No grasp is solved. {cases}"], "verdict")
    return box([*_best_sentences(data, data.best, mu), cases], "verdict") + _warnings(data, data.best)


def _best_sentences(data: Data, best: tuple[int, ...], mu: float | None) -> list[str]:
    said = {name: number(data.at(name, best) * data.units(name)[2]) for name in VALUES}
    sure = {name: uncertainty(data, name, best) for name in VALUES}
    what = f"quality {said['quality']}{sure['quality']}"
    if data.score != "quality":
        what = "ranked by e_n, for no quality is stored"
    if not np.isfinite(data.at(data.score, best)):
        what = "which has no score"
    alike = data.images(best)
    same = f" The same score at {_listed([data.place(i) for i in alike])}." if alike else ""
    best_of = "Best grasp" if data.grasps > 1 else "Best point of the sweep" if data.sweeps else "The grasp"
    first = (
        f"{best_of} at {number(data.forces[best[-1]])} N per finger: {data.place(best)}, {what}, "
        f"e_n {said['e_n']} mm{sure['e_n']}.{same}"
    )
    friction = f", mu = {mu:g}" if mu is not None else ""
    second = (
        f"There a contact holds up to {said['f_x_max']} N{sure['f_x_max']} along the pad, "
        f"{said['f_y_max']} N{sure['f_y_max']} across it and {said['tau_z_max']} N mm{sure['tau_z_max']} of torque "
        f"about its normal (curved model{friction}; weaker finger)."
    )
    wall = [text for text in (wall_sentence(data, best),) if text]
    return [
        first,
        *_apart(data, best),
        second,
        *_weight(data, best),
        *wall,
        *_planar(data, best),
        *_passed_over(data, best),
        *_other_force(data, best),
    ]


def _apart(data: Data, best: tuple[int, ...]) -> list[str]:
    """Whether the best grasp is better than those that follow beyond the errors."""
    order = [i[:-1] for i in data.order(best[-1]) if not data.lost[i] and np.isfinite(data.at(data.score, i))]
    places = [tuple(np.delete(index, -1)) for index in np.ndindex(data.shape[:-1])]
    flat = [int(np.ravel_multi_index(index, data.shape[:-1])) for index in order]
    units = "m" * (data.score == "e_n")
    told = judgement(sure(data.dataset, data.score, best[-1]), flat, places, units).replace("+-", "±")
    return [f"{told[0].upper()}{told[1:]}."] if told else []


def _weight(data: Data, index: tuple[int, ...]) -> list[str]:
    """How many times its own weight the object could have, where its mass is known."""
    factor = data.at("safety_factor", index)
    if not np.isfinite(factor):
        return []
    what = f"The grasp holds {number(factor)} times the object's weight at this force (curved model)"
    return [f"{what}." if factor >= 1 else f"{what}: it would lose the object."]


def uncertainty(data: Data, name: str, index: tuple[int, ...]) -> str:
    """How far off a value may be, where the file knows: the one place that says so in verdict, tables and maps."""
    error, band = data.at(f"{name}_error", index), data.values(f"derived/{name}_band")
    if band is not None:
        error = band[tuple(index)] / abs(data.at(name, index))
    if not np.isfinite(error):
        return ""
    share = "<\u00a00.01" if error < LEAST else number(100 * error, 2)
    return f" ±\u00a0{share}\u00a0%"


def value(data: Data, name: str, index: tuple[int, ...], digits: int = 4) -> str:
    """A map's value in the unit people read, with its uncertainty where that is known."""
    found = data.at(name, index)
    return number(found * data.units(name)[2], digits) + uncertainty(data, name, index)


def head(data: Data, name: str) -> str:
    """A map in the head of a column."""
    return HEADS.get(name) or data.label(name)


def _planar(data: Data, index: tuple[int, ...]) -> list[str]:
    """What the planar model that the scene prefers would claim."""
    model, words = data.planar, []
    for name, label in (("quality", "quality"), ("e_n", "e_n")):
        curved, planar = data.at(name, index), data.at(name, index, model)
        if np.isfinite(curved) and np.isfinite(planar) and curved:
            change = 100 * (planar / curved - 1)
            words.append(f"{number(abs(change), 2)} % {'more' if change > 0 else 'less'} {label}" if abs(change) >= 0.05
                         else f"the same {label}")  # fmt: skip
    return [f"A planar contact model ({model}) would claim {' and '.join(words)}."] if words else []


def _other_force(data: Data, best: tuple[int, ...]) -> list[str]:
    """Where the score per unit of normal force is largest, if that is at another force."""
    tops = [i for k in range(len(data.forces)) for i in data.order(k)[:1] if not data.lost[i] or i == best]
    top = tops[largest(np.array([data.at(data.score, i) for i in tops]))]
    if top[-1] == best[-1] or not data.at(data.score, top) > data.at(data.score, best) * (1 + 1e-3):
        return []
    most = number(data.at(data.score, top) * data.units(data.score)[2])
    unit = data.units(data.score)[1]
    what = "quality, a score per unit of normal force," if data.score == "quality" else data.score
    return [f"Over all forces {what} is largest at {data.place(top, force=True)}: {most} {unit}".rstrip() + "."]


def _passed_over(data: Data, best: tuple[int, ...]) -> list[str]:
    """Why the brightest place of the map is not the best grasp: those that cannot be used stand last."""
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
    """What is to be said of the candidate that was asked for; empty where none was."""
    index = data.chosen
    if index is None:
        return ""
    which = f"Chosen candidate {np.ravel_multi_index(index[:-1], data.shape[:-1])}: {data.place(index, force=True)}"
    if data.status[index] == FAILED:
        return box([f"{which}, failed: {data.result.messages[index] or 'no reason was given'}"], "warn")
    if data.status[index] != DONE:
        return box([f"{which}, is not solved yet."], "warn")
    order = data.order(index[-1])
    said = ", ".join(f"{head(data, name)} {value(data, name, index, 3)}" for name in ("quality", "e_n"))
    flags = "".join(f" {flag.word}: {flag.sentence}." for flag in _flags(data, index))
    text = f"{which}: {said}, place {order.index(index) + 1} of {len(order)} at this force.{flags}"
    return box([text + (" It is the best one." if index == data.best else "")], "verdict")


def _warnings(data: Data, best: tuple[int, ...]) -> str:
    found = []
    if data.unfinished:
        missing = data.count(MISSING)
        found.append(f"This study is unfinished: {missing} cases are missing, so a better grasp may be found.")
    if best[-1] < len(data.forces) - 1:
        above = "grasp is safe" if np.any(data.status[..., best[-1] + 1 :] == DONE) else "case is solved"
        found.append(f"No {above} above {number(data.forces[best[-1]])} N; all comparisons are made there.")
    if reasons := [flag.sentence for flag in _flags(data, best) if flag & BORNE]:
        found.append(f"Of all grasps at this force none is without a fault; of the best: {'; '.join(reasons)}.")
    if flagged := data.flagged(best):
        found.append(f"The best case does not pass its checks: {', '.join(flagged)}.")
    if note := str(data.result.messages[best]):
        found.append(f"Note on the best case: {note}.")
    stations = data.axes[-3].values
    if len(stations) > 2 and not data.by_poses and best[-3] in (int(stations.argmin()), int(stations.argmax())):
        found.append("The best station is the first or last one that was tried; a better one may lie beyond.")
    html = box(found, "warn") if found else ""
    return html + paragraph(_meaning(data, best), "note")


def _meaning(data: Data, best: tuple[int, ...]) -> str:
    """What the numbers behind ± are."""
    if data.values("derived/quality_band") is not None:
        return BANDED
    return ESTIMATED if any(uncertainty(data, name, best) for name in VALUES) else NOT_ESTIMATED


def _listed(words: list[str], most: int = 4) -> str:
    return "; ".join(words[:most]) + (f"; and {len(words) - most} more" if len(words) > most else "")


def best_tables(data: Data) -> str:
    """The best grasps at the force shown, and the best one at each force."""
    order = data.order(data.k)
    if not order:
        return ""
    last = f"e_n {data.planar} [mm]" if data.bound("force_high") is None else "safe forces [N]"
    heads = ["grasp", *(HEADS[name] for name in VALUES), last, "checks and remarks"]
    chosen: list[tuple[int, ...]] = []
    merged: set[tuple[int, ...]] = set()
    for index in order:
        if index not in merged and len(chosen) < BEST:
            chosen.append(index)
            merged |= set(_turned(data, index))
    rows = [[_with_angles(data, index), *_row(data, index)] for index in chosen]
    force = number(data.forces[data.k])
    caption = f"Best grasps at {force} N per finger, candidates solved: {len(order)} (curved model)"
    html = table(caption, heads, rows, texts=(0,), wide=(len(heads) - 1,), first=True)
    if len(data.forces) > 1:
        rows = []
        for k, force in enumerate(data.forces):
            found = data.order(k)[:1]
            values = _row(data, found[0]) if found else ["–"] * (len(heads) - 2) + ["not solved"]
            rows.append([number(force), data.place(found[0]) if found else "–", *values])
        heads = ["force [N]", *heads]
        html += table("Best grasp at each force", heads, rows, wide=(1, len(heads) - 1))
    tops = [index for k in range(len(data.forces)) for index in data.order(k)[:1]]
    html += paragraph(SAFE, "note") if data.bound("force_high") is not None else ""
    words = {flag.word: flag.sentence for index in (*chosen, *tops) for flag in _flags(data, index)}
    return html + "".join(paragraph(f"{word}: {meaning}.", "note") for word, meaning in words.items())


def _turned(data: Data, index: tuple[int, ...]) -> list[tuple[int, ...]]:
    """The same place under other angles, with the same score."""
    return [i for i in data.images(index) if i[:-2] == index[:-2]]


def _with_angles(data: Data, index: tuple[int, ...]) -> str:
    angles = [number(np.degrees(data.axes[-2].values[i[-2]]), 4) + "°" for i in _turned(data, index)]
    return data.place(index) + (f" (and {_listed(angles)})" if angles else "")


def _flags(data: Data, index: tuple[int, ...]) -> list[Flag]:
    return flags_in(int(data.flags[tuple(index)]))


def _row(data: Data, index: tuple[int, ...]) -> list[str]:
    values = [value(data, name, index) for name in VALUES]
    known = any(np.isfinite(data.check(name, index)) for name in LIMITS)
    checks = data.flagged(index) or ["passed" if known else "not stored"]
    remarks = ", ".join([*checks, *(flag.word for flag in _flags(data, index))])
    planar = number(data.at("e_n", index, data.planar) * 1e3, 4)
    return [*values, planar if data.bound("force_high") is None else window_text(data, index), remarks]
