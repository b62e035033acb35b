"""The answer of a report: where to grasp, how wide and how hard, how sure that is, and what speaks against it."""

from __future__ import annotations

import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from softjaw.study.flags import BORNE, LOST
from softjaw.study.quantities import BY_KEY, DONE, FAILED, MISSING, MODEL_NAMES, NO_GRASP, STATES
from softjaw.study.ranking import largest, passed_over
from softjaw.study.show.grasps import (
    Index,
    at,
    axis_values,
    candidate_of,
    flagged,
    flags_of,
    forces,
    grouped,
    images,
    judge,
    label_of,
    lost,
    number,
    order,
    place,
    quantity,
    spoken,
    unit_of,
)
from softjaw.study.show.tables.answer import answer, force_to_use
from softjaw.study.show.tables.certainty import sure
from softjaw.study.show.tables.certainty import verdict as judgement
from softjaw.study.show.tables.show import as_text
from softjaw.study.show.tables.show import best as best_table
from softjaw.study.show.tables.status import no_grasps

LEAST = 1e-4  # relative error below which this one is shown
NBSP = "\u00a0"
ROUNDING = 1e-9  # of the largest force, by which a bound may miss it
CAVEAT = (
    "The paper publishes neither the pad dimensions of its gripper nor the numbers behind its figures. The dimensions "
    "used here are in the scene below. Absolute numbers of its figures can therefore not be reproduced, only "
    "trends: in the paper, differences between the models grow with curvature, and torque and e_n grow with force."
)
ESTIMATED = "± is the error estimate from two meshes, in per cent of the value; the error is usually smaller."
NOT_ESTIMATED = "The error of the mesh was not estimated; accuracy.meshes = 2 in the scene does that."
WITH_INTERVALS = (
    "± is the half-width of the interval in which 95 % of the samples of the uncertain inputs lie, in per cent of the"
    " value; [uncertainty] in the scene lists these inputs."
)
VALUES = ("payload", "quality", "quality_fitted", "e_n", "f_x_max", "f_y_max", "tau_z_max")
# of the plain text in the file
TOP, MOST_REASONS, MOST_PLACES, WIDTH = 5, 10, 3, 120
READING = """How to read the file
All values are SI. Every dataset has its unit, its label and its definition as attributes; /study/definitions has all
definitions in one text, with the friction models: ccm lets every face resist in its own plane (curved contact model),
pcm and pcm_projected are planar models with the pressure sum S and with the normal force F_N. NaN: there is no value,
and /study/status/code (0 missing, 1 done, 2 failed) and /study/status/message say why. Candidates are counted over
stations and angles, the angle running fastest. /study/scene is the scene with all settings, /study/provenance/sessions
lists programs and machine. Plots: h5web, silx or NeXpy open at the map of quality; 'softjaw export
--format vtk' writes the object with its maps and the pads with their pressure for ParaView."""


def subtitle(ds: xr.Dataset) -> str:
    """File and axes in one line."""
    parts, axes = [], [str(axis) for axis in ds.status.dims]
    for axis in axes:
        values, unit = axis_values(ds, axis), unit_of(ds[axis].units)[0]
        n, low = len(values), number(values.min(), 4)
        reach = low if n == 1 else f"{low} to {number(values.max(), 4)}"
        space, plural = "" if unit in ("", "°") else " ", "s" * (n > 1)
        name = f"{spoken(axis)}{plural}" if axis in axes[-3:] else f"value{plural} of {spoken(axis)}"
        if axis == "station" and ds.attrs["poses"]:
            parts.append(f"{n} candidate{plural}")
        elif not (axis == "angle" and ds.attrs["poses"]):
            parts.append(f"{n} {name} ({reach}{space}{unit})")
    return f"{Path(ds.attrs['file']).name}: {' × '.join(parts)}"


def verdict(ds: xr.Dataset, mu: float | None) -> list[str]:
    """The answer in sentences, and how many cases it rests on."""
    done, failed, missing = (int(np.sum(ds.status.values == state)) for state in (DONE, FAILED, MISSING))
    total, best = ds.status.size, ds.attrs["best"]
    none = "".join(f", {text}" for text in no_grasps(ds.status.values))
    cases = f"{done} of {total} cases are solved, {failed} failed, {missing} are not computed{none}."
    if done == total:
        cases = f"All {total} cases are solved." if total > 1 else "It is the only case of this study."
    if best is None:
        return [f"No grasp is solved. {cases}"]
    told = answer(ds, best)
    first = [f"{told[0].upper()}{told[1:]}.", _best(ds, best), *_apart(ds, best), _carried(ds, best, mu)]
    wall = [text] if (text := wall_sentence(ds, best)) else []
    return [*first, *wall, *_planar(ds, best), *_passed_over(ds, best), *_other_force(ds, best), cases]


def key_values(ds: xr.Dataset) -> list[tuple[str, str]]:
    """What a reader wants at once: where, how wide, how hard, and how good that is."""
    best = ds.attrs["best"]
    if best is None:
        return []
    low, error = force_to_use(ds, best)
    hard = f"{number(low)}{f' ± {number(error, 2)}' * bool(np.isfinite(error))} N" if low > 0 else _force(ds, best)
    pairs = [("where", place(ds, best)), ("how hard", f"{hard.replace(' ', NBSP)} per finger")]
    if np.isfinite(opening := at(ds, "opening", best)):
        pairs.insert(1, ("how wide (opening at first touch)", f"{number(1e3 * opening, 4)}\u00a0mm"))
    if "force_high" in ds:
        pairs.append(("safe forces [N]", safe_range(ds, best)))
    names = {"payload": f"holds at {_force(ds, best)} [g]", "quality": "grasp quality", "e_n": "e_n [mm]"}
    return pairs + [(text, value(ds, n, best, 3)) for n, text in names.items() if np.isfinite(at(ds, n, best))]


def _force(ds: xr.Dataset, index: Index) -> str:
    return f"{number(forces(ds)[index[-1]])} N"


def _best(ds: xr.Dataset, best: Index) -> str:
    score, lengths = ds.attrs["score"], ds.status.shape
    what = f"quality {value(ds, 'quality', best, 3)}"
    if score == "e_n":
        what = "ranked by e_n, for no quality is stored"
    if not np.isfinite(at(ds, score, best)):
        what = "which has no score"
    alike = images(ds, best)
    same = f" The same score at {listed([place(ds, i) for i in alike])}." if alike else ""
    swept = "Best point of the sweep" if max(lengths[:-3], default=1) > 1 else "The grasp"
    name = "Best grasp" if max(lengths[-3:-1]) > 1 else swept
    e_n = f"e_n {value(ds, 'e_n', best, 3, 'mm' * bool(np.isfinite(at(ds, 'e_n', best))))}"
    by = "the force to use" if score == "payload" and "force_low" in ds else f"{score} at this force"
    ranked = f"ranked by {by}, {ds.attrs['why']}" * bool(score != "e_n")
    text = f"{name} at {_force(ds, best)} per finger: {place(ds, best)}, {what}, {e_n}"
    return f"{'; '.join(filter(None, [text, ranked]))}.{same}"


def _carried(ds: xr.Dataset, best: Index, mu: float | None) -> str:
    units = {"f_x_max": "N", "f_y_max": "N", "tau_z_max": "N mm"}
    f_x, f_y, tau = (value(ds, name, best, 3, unit) for name, unit in units.items())
    friction = f", mu = {mu:g}" if mu is not None else ""
    return (
        f"There a contact carries up to f_x = {f_x} along the pad, f_y = {f_y} across it and a torque tau_z ="
        f" {tau} about its normal (CCM{friction}; weaker finger)."
    )


def _apart(ds: xr.Dataset, best: Index) -> list[str]:
    """Whether the best grasp is better than those that follow beyond the errors."""
    score, shape = ds.attrs["score"], ds.status.shape[:-1]
    usable = [candidate_of(ds, i) for i in order(ds, best[-1]) if not lost(ds, i) and np.isfinite(at(ds, score, i))]
    places = [tuple(np.delete(index, -1)) for index in np.ndindex(shape)]
    text = judgement(sure(ds, score, best[-1]), usable, places, ds[score].attrs.get("units", "")).replace("+-", "±")
    return [f"{text[0].upper()}{text[1:]}."] if text else []


def bounds(ds: xr.Dataset, index: Index) -> tuple[float | None, float]:
    """Minimum holding force (None without a mass) and maximum force before damage (NaN if unknown) of a candidate."""
    low, high = (float(ds[n].values[index[:-1]]) if n in ds else None for n in ("force_low", "force_high"))
    return low, float("nan") if high is None else high


def _open_above(ds: xr.Dataset, high: float) -> bool:
    """Whether the wall bears the largest solved force."""
    return bool(high >= forces(ds)[-1] * (1 - ROUNDING))


def wall_sentence(ds: xr.Dataset, index: Index) -> str:
    """How a thin wall takes one case, and between which forces it would be safe; empty without a wall."""
    if not np.isfinite(at(ds, "indentation", index)):
        return ""
    indentation, stress = (
        f"{value(ds, name, index, 3)} {quantity(ds, name)[1]}" for name in ("indentation", "wall_stress")
    )
    text = f"The wall is indented by {indentation} and its stress reaches {stress}."
    low, high = bounds(ds, index)
    if not np.isfinite(high):
        return text
    if low is not None and not low <= high:
        return f"{text} No solved force both holds the object and leaves the wall undamaged."
    upper = f"{'at least ' * _open_above(ds, high)}{number(high)} N"
    if low is None:
        return f"{text} The wall bears {upper} per finger there."
    return f"{text} Safe forces there: {number(low)} N, which holds the object, to {upper}, which its wall bears."


def safe_range(ds: xr.Dataset, index: Index) -> str:
    """The safe force range of one candidate in few characters; a plus: the wall bears the largest solved force."""
    low, high = bounds(ds, index)
    if not np.isfinite(high):
        return "–"
    if not (low or 0.0) <= high:
        return "none"
    more = "+" * _open_above(ds, high)
    below = "≤ " * (not more) if low is None else f"{number(low)}–"
    return f"{below}{number(high)}{more}"


def uncertainty(ds: xr.Dataset, name: str, index: Index) -> str:
    """How far off a value may be, where the file knows: the one place for it in verdict, tables and maps."""
    q, size = BY_KEY.get(f"maps/{name}"), abs(at(ds, name, index))
    error = at(ds, q.of_error.name, index) if q and q.error else np.nan
    if f"{name}_interval" in ds:
        error = at(ds, f"{name}_interval", index) / size
    elif q and q.error == "absolute":
        error /= size
    if not np.isfinite(error):
        return ""
    return f" ±\u00a0{number(100 * max(error, LEAST), 2)}\u00a0%"


def value(ds: xr.Dataset, name: str, index: Index, digits: int = 4, unit: str = "") -> str:
    """A map's value in the displayed unit, with its uncertainty where that is known; ``unit`` is written behind it."""
    own = number(at(ds, name, index) * quantity(ds, name)[2], digits)
    return own + f" {unit}" * bool(unit) + uncertainty(ds, name, index)


def _planar(ds: xr.Dataset, index: Index) -> list[str]:
    """What the planar model that the scene prefers would claim."""
    claims, planar = [], ds.attrs["planar"]
    for name in ("quality", "e_n"):
        change = 100 * (at(ds, name, index, planar) / (at(ds, name, index) or np.nan) - 1)
        if np.isfinite(change):
            more = f"{number(abs(change), 2)} % {'more' if change > 0 else 'less'}"
            claims.append(f"{more if abs(change) >= 0.05 else 'the same'} {name}")
    return [f"A planar contact model ({MODEL_NAMES[planar]}) would claim {' and '.join(claims)}."] if claims else []


def _other_force(ds: xr.Dataset, best: Index) -> list[str]:
    """Where the score per unit of normal force is largest, if that is at another force."""
    score = ds.attrs["score"]
    tops = [i for k in range(len(forces(ds))) for i in order(ds, k)[:1] if not lost(ds, i) or i == best]
    top = tops[largest(np.array([at(ds, score, i) for i in tops]))]
    if top[-1] == best[-1] or not at(ds, score, top) > at(ds, score, best) * (1 + 1e-3):
        return []
    _, unit, factor = quantity(ds, score)
    if score == "payload":  # it grows with the force, which says nothing
        return []
    what = "quality, a score per unit of normal force," if score == "quality" else score
    most = f"{number(at(ds, score, top) * factor)} {unit}".rstrip()
    return [f"Over all forces {what} is largest at {place(ds, top, force=True)}: {most}."]


def _passed_over(ds: xr.Dataset, best: Index) -> list[str]:
    """Why the brightest place of the map is not the best grasp: those that cannot be used come last."""
    ranked, score = order(ds, best[-1]), ds.attrs["score"]
    flags = np.array([ds["flags"].values[i] for i in ranked], int)
    better, why = passed_over(np.array([at(ds, score, i) for i in ranked]), flags)
    if not better:
        return []
    highest = ranked[better[0]]
    top = number(at(ds, score, highest) * quantity(ds, score)[2])
    count = "One grasp scores" if len(better) == 1 else f"{len(better)} grasps score"
    return [f"{count} higher at this force (the highest {top}, {place(ds, highest)}) but cannot be used: {why}."]


def chosen(ds: xr.Dataset) -> str:
    """What there is to say of the candidate that was asked for; empty where none was."""
    index = ds.attrs["chosen"]
    if index is None:
        return ""
    which = f"Chosen candidate {candidate_of(ds, index)}: {place(ds, index, force=True)}"
    if ds.status.values[index] == FAILED:
        return f"{which}, failed: {ds.message.values[index] or 'no reason was given'}"
    if (state := ds.status.values[index]) in NO_GRASP:
        return f"{which}, is no grasp, {STATES[state]}: {ds.message.values[index]}."
    if ds.status.values[index] != DONE:
        return f"{which}, is not solved yet."
    ranked = order(ds, index[-1])
    values = ", ".join(f"{label_of(ds, name)} {value(ds, name, index, 3)}" for name in ("quality", "e_n"))
    flags = "".join(f" {flag.word}: {flag.sentence}." for flag in flags_of(ds, index))
    text = f"{which}: {values}, place {ranked.index(index) + 1} of {len(ranked)} at this force.{flags}"
    return text + (" It is the best one." if index == ds.attrs["best"] else "")


def warnings(ds: xr.Dataset) -> list[str]:
    """What speaks against trusting the best grasp."""
    best, status, found = ds.attrs["best"], ds.status.values, []
    if missing := int(np.sum(status == MISSING)):
        found.append(f"This study is unfinished: {missing} cases are not computed, so a better grasp may be found.")
    if best is None:
        return found
    above = (status[..., best[-1] + 1 :] == DONE, ds["flags"].values[..., best[-1] + 1 :] & LOST == 0)
    if best[-1] < status.shape[-1] - 1 and not (above[0] & above[1]).any():
        what = "grasp is safe" if above[0].any() else "case is solved"
        found.append(f"No {what} above {_force(ds, best)}; all comparisons are made there.")
    if reasons := [flag.sentence for flag in flags_of(ds, best) if flag & BORNE]:
        found.append(f"Every grasp at this force carries a warning. Best one: {'; '.join(reasons)}.")
    if failed := flagged(ds, best):
        found.append(f"The best case does not pass its checks: {', '.join(failed)}.")
    if note := str(ds.message.values[best]):
        found.append(f"Note on the best case: {note}.")
    stations = ds.station.values
    if len(stations) > 2 and not ds.attrs["poses"] and best[-3] in (int(stations.argmin()), int(stations.argmax())):
        found.append("The best station is the first or last one that was tried; a better one may lie beyond.")
    return found


def meaning(ds: xr.Dataset) -> str:
    """What the numbers behind ± are; empty where nothing is solved."""
    if ds.attrs["best"] is None:
        return ""
    if "quality_interval" in ds:
        return WITH_INTERVALS
    return ESTIMATED if any(uncertainty(ds, name, ds.attrs["best"]) for name in VALUES) else NOT_ESTIMATED


def listed(texts: list[str], most: int = 4) -> str:
    """The first few texts, and how many more there are."""
    return "; ".join(texts[:most]) + (f"; and {len(texts) - most} more" if len(texts) > most else "")


def plain_report(ds: xr.Dataset, mu: float | None) -> str:
    """The report in the file itself, for whoever has only the file and a tool that prints HDF5.

    What it is, the best grasps, failures with their reasons, and how to read the numbers.
    """
    named, ds = ds.attrs["title"], judge(ds)
    size = subtitle(ds).partition(": ")[2]
    found = replace(best_table(ds, top=TOP, whole_lines=True), answer="")  # it stands above
    table = [as_text(found, WIDTH)] if ds.attrs["best"] else []
    notes = "\n".join(line for state in (FAILED, *NO_GRASP, DONE) for line in _notes(ds, state))
    answer = "\n".join([*verdict(ds, mu), *warnings(ds), meaning(ds)]).strip()
    parts = [f"{named}: {size}" if named else size, answer, *table, notes, READING,
             CAVEAT.replace("the scene below", "/study/scene")]  # fmt: skip
    whole = "\n\n".join(part for part in parts if part).replace("\xa0", " ")
    # h5dump escapes these signs; their names are longer, so they come before the lines are filled
    whole = whole.replace("\N{DEGREE SIGN}", " deg").replace("\N{MULTIPLICATION SIGN}", "x")
    return "\n".join(textwrap.fill(x, WIDTH) if len(x) > WIDTH else x for x in whole.splitlines()) + "\n"


def _notes(ds: xr.Dataset, state: int) -> list[str]:
    """Why cases have no result, or notes on solved ones: one line for messages that differ in numbers only."""
    word, lines = "noted" if state == DONE else STATES[state], []
    for count, text, where in grouped(ds, state)[:MOST_REASONS]:
        places = "; ".join(place(ds, index, force=True) for index in where[:MOST_PLACES])
        lines.append(f"{word} {count} x {text} [{places}{'; ...' * (count > MOST_PLACES)}]")
    return lines
