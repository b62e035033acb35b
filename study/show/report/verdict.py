"""The answer of a report: where to grasp, how wide and how hard, how sure that is, and what speaks against it."""

from __future__ import annotations

import textwrap
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray as xr

from softjaw.study.flags import BORNE, LOST
from softjaw.study.quantities import DONE, FAILED, MISSING, MODEL_NAMES, MODELS, NO_GRASP, STATES
from softjaw.study.ranking import largest
from softjaw.study.show.best_grasps import answer, best, certainty, safe_range, spoken_line, value_text
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
    lost,
    order,
    place,
    quantity,
    spoken,
)
from softjaw.study.show.status import no_grasps
from softjaw.study.table import as_text, number
from softjaw.study.units import shown_unit

CAVEAT = (
    "The paper publishes neither the pad dimensions of its gripper nor the numbers behind its figures. The dimensions "
    "used here are in the scene below. Absolute numbers of its figures can therefore not be reproduced, only "
    "trends: in the paper, differences between the models grow with curvature, and torque and e_n grow with force."
)
NOT_ESTIMATED = "Errors were not estimated; accuracy.meshes = 2 in the scene does that."
TOP, MOST_REASONS, WIDTH = 5, 10, 120  # of the plain text in the file: grasps, messages, characters
READING = """How to read the file
All values are SI. Every dataset has its unit, its label and its definition as attributes; /study/definitions has all
definitions in one text, with the friction models: ccm lets every face resist in its own plane (curved contact model),
pcm and pcm_projected are planar models with the pressure sum S and with the normal force F_N. NaN: there is no value,
and /study/status/code (0 missing, 1 done, 2 failed) and /study/status/message say why. Candidates are counted over
stations and angles, the angle running fastest. /study/scene is the scene with all settings, /study/provenance/sessions
lists programs and machine. Plots: h5web, silx or NeXpy open at the map of payload; 'softjaw export
--format vtk' writes the object with its maps and the pads with their pressure for ParaView."""
ASCII = {"\N{NO-BREAK SPACE}": " ", "\N{MULTIPLICATION SIGN}": "x", "±": "+-"}


def subtitle(ds: xr.Dataset) -> str:
    """File and axes in one line."""
    parts, axes = [], [str(axis) for axis in ds.status.dims]
    for axis in axes:
        values, unit = axis_values(ds, axis), shown_unit(ds[axis].units)
        n, low = len(values), number(values.min(), 4)
        reach = low if n == 1 else f"{low} to {number(values.max(), 4)}"
        plural = "s" * (n > 1)
        name = f"{spoken(axis)}{plural}" if axis in axes[-3:] else f"value{plural} of {spoken(axis)}"
        if axis == "station" and ds.attrs["poses"]:
            parts.append(f"{n} candidate{plural}")
        elif not (axis == "angle" and ds.attrs["poses"]):
            parts.append(f"{n} {name} ({reach} {unit}".rstrip() + ")")
    return f"{Path(ds.attrs['file']).name}: {' × '.join(parts)}"


def verdict(ds: xr.Dataset) -> list[str]:
    """The answer in sentences, and how many cases it rests on; the table of the best grasps has the numbers."""
    done, failed, missing = (int(np.sum(ds.status.values == state)) for state in (DONE, FAILED, MISSING))
    total, index = ds.status.size, ds.attrs["best"]
    none = "".join(f", {text}" for text in no_grasps(ds.status.values))
    cases = f"{done} of {total} cases are solved, {failed} failed, {missing} are not computed{none}."
    if index is None:
        return [f"No grasp is solved. {cases}"]
    score, k = ds.attrs["score"], index[-1]
    ranks = [candidate_of(ds, i) for i in order(ds, k)]
    alike = [place(ds, i) for i in images(ds, index)]
    more = f"; and {len(alike) - 4} more" * (len(alike) > 4)
    same = [f"The same {score} at {'; '.join(alike[:4])}{more}."] if alike else []
    text = certainty(ds, ranks, score, k)
    sure = [f"{text[:1].upper()}{text[1:]}."] * bool(text)
    return [*same, *sure, *_wall(ds, index), *_planar(ds, index),
            *_other_force(ds, index), cases]  # fmt: skip


def _force(ds: xr.Dataset, index: Index) -> str:
    return f"{number(forces(ds)[index[-1]])} N"


def _wall(ds: xr.Dataset, index: Index) -> list[str]:
    """How a thin wall takes one case, and between which forces it would be safe; empty without a wall."""
    if not np.isfinite(at(ds, "indentation", index)):
        return []
    indentation, stress = (value_text(ds, name, index, 3, unit=True) for name in ("indentation", "wall_stress"))
    forced = {"none": " No solved force both holds the object and leaves the wall undamaged.", "-": ""}
    text = safe_range(ds, index)
    safe = forced.get(text, f" Safe forces there: {text} N.")
    return [f"The wall is indented by {indentation} and its stress reaches {stress}.{safe}"]


def _planar(ds: xr.Dataset, index: Index) -> list[str]:
    """What the planar model that the scene prefers would claim."""
    claims, planar = [], MODELS[1]
    for name in ("quality", "e_n"):
        change = 100 * (at(ds, name, index, planar) / (at(ds, name, index) or np.nan) - 1)
        if np.isfinite(change):
            more = f"{number(abs(change), 2)} % {'more' if change > 0 else 'less'}"
            claims.append(f"{more if abs(change) >= 0.05 else 'the same'} {name}")
    return [f"A planar contact model ({MODEL_NAMES[planar]}) would claim {' and '.join(claims)}."] if claims else []


def _other_force(ds: xr.Dataset, best_case: Index) -> list[str]:
    """Where the score is largest, if that is at another force; a payload grows with it, which says nothing."""
    score = ds.attrs["score"]
    tops = [i for k in range(len(forces(ds))) for i in order(ds, k)[:1] if not lost(ds, i) or i == best_case]
    top = tops[largest(np.array([at(ds, score, i) for i in tops]))]
    # relative difference of scores worth a sentence
    higher = at(ds, score, top) > at(ds, score, best_case) * (1 + 1e-3)
    if score == "payload" or top[-1] == best_case[-1] or not higher:
        return []
    what = "quality, a score per unit of normal force," if score == "quality" else score
    return [f"Over all forces {what} is largest at {place(ds, top, force=True)}: "
            f"{value_text(ds, score, top, unit=True)}."]  # fmt: skip


def chosen(ds: xr.Dataset) -> str:
    """What there is to say of the candidate that was asked for; empty where none was."""
    index = ds.attrs["chosen"]
    if index is None:
        return ""
    which = f"Chosen candidate {candidate_of(ds, index)}: {place(ds, index, force=True)}"
    state, message = ds.status.values[index], ds.message.values[index] or "no reason was given"
    if state == FAILED or state in NO_GRASP:
        return f"{which}, {STATES[state]}: {message}"
    if state != DONE:
        return f"{which}, is not solved yet."
    ranked = order(ds, index[-1])
    values = ", ".join(f"{quantity(ds, n)[0]} {value_text(ds, n, index, 3, unit=True)}" for n in ("quality", "e_n"))
    flags = "".join(f" {flag.word}: {flag.sentence}." for flag in flags_of(ds, index))
    text = f"{which}: {values}, place {ranked.index(index) + 1} of {len(ranked)} at this force.{flags}"
    return text + (" It is the best one." if index == ds.attrs["best"] else "")


def warnings(ds: xr.Dataset) -> list[str]:
    """What speaks against trusting the best grasp."""
    index, status, found = ds.attrs["best"], ds.status.values, []
    if missing := int(np.sum(status == MISSING)):
        found.append(f"This study is unfinished: {missing} cases are not computed, so a better grasp may be found.")
    if index is None:
        return found
    above = (status[..., index[-1] + 1 :] == DONE, ds["flags"].values[..., index[-1] + 1 :] & LOST == 0)
    if index[-1] < status.shape[-1] - 1 and not (above[0] & above[1]).any():
        what = "grasp is safe" if above[0].any() else "case is solved"
        found.append(f"No {what} above {_force(ds, index)}; all comparisons are made there.")
    if reasons := [flag.sentence for flag in flags_of(ds, index) if flag & BORNE]:
        found.append(f"Every grasp at this force carries a warning. Best one: {'; '.join(reasons)}.")
    if failed := flagged(ds, index):
        found.append(f"The best case does not pass its checks: {', '.join(failed)}.")
    if message := str(ds.message.values[index]):
        found.append(f"Note on the best case: {message}.")
    if ds.attrs["score"] in ds and f"{ds.attrs['score']}_error" not in ds and "quality_interval" not in ds:
        found.append(NOT_ESTIMATED)
    stations = ds.station.values
    if len(stations) > 2 and not ds.attrs["poses"] and index[-3] in (int(stations.argmin()), int(stations.argmax())):
        found.append("The best station is the first or last one that was tried; a better one may lie beyond.")
    return found


def plain_report(ds: xr.Dataset) -> str:
    """The report in the file itself, for whoever has only the file and a tool that prints HDF5.

    What it is, the best grasps, failures with their reasons, and how to read the numbers.
    """
    named, ds = ds.attrs["title"], judge(ds)
    size = subtitle(ds).partition(": ")[2]
    table = [as_text(replace(best(ds, top=TOP, lines=True), notes=()), WIDTH)] if ds.attrs["best"] else []
    lines = answer(ds, ds.attrs["best"]) if ds.attrs["best"] else {}
    told = [f"{name}: {spoken_line(*value)}" for name, value in lines.items()]
    reasons = [reason.text(lambda index: place(ds, index, force=True)) for reason in grouped(ds)[:MOST_REASONS]]
    parts = [f"{named}: {size}" if named else size, "\n".join([*told, *verdict(ds), *warnings(ds)]), *table,
             "\n".join(reasons), READING, CAVEAT.replace("the scene below", "/study/scene")]  # fmt: skip
    text = "\n\n".join(part for part in parts if part)
    # h5dump escapes these signs; their names are longer, so they come before the lines are filled
    for sign, name in ASCII.items():
        text = text.replace(sign, name)
    return "\n".join(textwrap.fill(x, WIDTH) if len(x) > WIDTH else x for x in text.splitlines()) + "\n"
