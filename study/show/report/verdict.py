"""The answer of a report: where to grasp, how wide and how hard, how sure that is, and what speaks against it."""

from __future__ import annotations

import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from softjaw.study.flags import BORNE, flags_in
from softjaw.study.quantities import DEFINITIONS, MISSING, MODEL_NAMES, MODELS
from softjaw.study.ranking import judge
from softjaw.study.result.read import axes_of
from softjaw.study.result.store import value_text
from softjaw.study.show.best_grasps import best_text
from softjaw.study.show.grasps import Index, at, flagged, reason_lines, spoken
from softjaw.study.show.status import state_counts
from softjaw.study.table import number

if TYPE_CHECKING:
    import xarray as xr  # slow to load, and a run needs it at its end only

CAVEAT = (
    "The paper publishes neither its gripper's pad dimensions nor the numbers behind its figures. The dimensions are in"
    " the scene below. Only trends can be compared: models differ more with curvature, torque and e_n grow with force."
)
TOP, MOST_REASONS, WIDTH = 5, 10, 120  # of the plain text in the file: grasps, messages, characters
READING = f"""How to read the file
{DEFINITIONS} status/code: 0 missing, 1 done, 2 failed.
Every dataset has its unit, its label and its definition as attributes. Candidates are counted over stations and angles,
the angle running fastest. /study/scene has all settings.
h5web, silx and NeXpy plot the maps; 'softjaw export --format vtk' writes files for ParaView."""
ASCII = str.maketrans({"\N{MULTIPLICATION SIGN}": "x", "±": "+-"})


def subtitle(ds: xr.Dataset) -> str:
    """File and axes in one line."""
    parts, poses = [], ds.attrs["poses"]
    for k, axis in enumerate(axes_of(ds), start=-ds.status.ndim):
        n, ends = len(axis.values), (int(f(axis.values)) for f in (np.argmin, np.argmax))
        if axis.name == "station" and poses:
            parts.append(f"{n} candidate{'s' * (n > 1)}")
        elif axis.name != "angle" or not poses:
            reach = " to ".join(dict.fromkeys(value_text(axis, i) for i in ends))
            name = spoken(axis.name)
            known = f"{name}s" if k >= -3 else f"values of {name}"  # a swept key may have any name
            parts.append(f"{n} {known if n > 1 else name} ({reach})")
    return f"{Path(ds.attrs['file']).name}: {' × '.join(parts)}"


def verdict(ds: xr.Dataset) -> list[str]:
    """What the planar model claims, and how many cases the answer rests on; tables have the numbers."""
    cases = f"{state_counts(ds.status.values)}."
    index = ds.attrs["best"]
    return [f"No grasp is solved. {cases}"] if index is None else [*_planar(ds, index), cases]


def _planar(ds: xr.Dataset, index: Index) -> list[str]:
    """What the planar model that the scene prefers would claim."""
    claims, planar = [], MODELS[1]
    for name in ("quality", "e_n"):
        change = 100 * (at(ds, name, index, planar) / (at(ds, name, index) or np.nan) - 1)
        if np.isfinite(change):
            more = f"{number(abs(change), 2)} % {'more' if change > 0 else 'less'}"
            claims.append(f"{more if abs(change) >= 0.05 else 'the same'} {name}")
    return [f"A planar contact model ({MODEL_NAMES[planar]}) would claim {' and '.join(claims)}."] if claims else []


def warnings(ds: xr.Dataset) -> list[str]:
    """What speaks against trusting the best grasp."""
    index, texts = ds.attrs["best"], []
    if missing := int(np.sum(ds.status.values == MISSING)):
        texts.append(f"This study is unfinished: {missing} cases are not computed, so a better grasp may be found.")
    if index is None:
        return texts
    if reasons := [flag.sentence for flag in flags_in(int(ds.flags.values[index])) if flag & BORNE]:
        texts.append(f"Every grasp at this force carries a warning. Best one: {'; '.join(reasons)}.")
    if failed := flagged(ds, index):
        texts.append(f"The best case does not pass its checks: {', '.join(failed)}.")
    stations = ds.station.values
    if len(stations) > 2 and not ds.attrs["poses"] and index[-3] in (int(stations.argmin()), int(stations.argmax())):
        texts.append("The best station is the first or last one that was tried; a better one may lie beyond.")
    return texts


def plain_report(ds: xr.Dataset) -> str:
    """The report in the file itself, for whoever has only the file and a tool that prints HDF5."""
    named, ds = ds.attrs["title"], judge(ds)
    size = subtitle(ds).partition(": ")[2]
    grasps = best_text(ds, WIDTH, top=TOP) if ds.attrs["best"] else ""
    blocks = [[*verdict(ds), *warnings(ds)], [grasps], reason_lines(ds)[:MOST_REASONS], [READING]]
    parts = [f"{named}: {size}" if named else size, *map("\n".join, blocks)]
    parts.append(CAVEAT.replace("the scene below", "/study/scene"))
    # h5dump escapes these signs; their names are longer, so they come before the lines are filled
    lines = "\n\n".join(filter(None, parts)).translate(ASCII).splitlines()
    return "\n".join(textwrap.fill(x, WIDTH) if len(x) > WIDTH else x for x in lines) + "\n"
