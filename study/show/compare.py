"""Two result files side by side: which settings and cases differ, and which differences exceed the stated errors."""

from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from softjaw.friction.patch import FloatArray
from softjaw.study.case.result import TIE
from softjaw.study.messages import OTHER_FILE, USAGE, StudyError, fault_of
from softjaw.study.quantities import FORCE_RANGE, MAIN, NUMERIC_MAPS
from softjaw.study.ranking import falling
from softjaw.study.result.layout import DONE
from softjaw.study.result.read import axes_of, stated_error, values_of
from softjaw.study.scene.text import changes, value_texts
from softjaw.study.show.overview import listed
from softjaw.study.table import PAPER, Column, Row, Table, as_text, with_unit, wrapped
from softjaw.study.units import shown, shown_unit

Pair = tuple[xr.Dataset, xr.Dataset]
SAME_AXES = 0.9986  # cosine of the angle between axes of one grasp: 3 deg
SAME_PLACE = 1e-3  # distance of the middles of the pads of one grasp, which edges and meshes move by less [m]


def compare(first: xr.Dataset, second: xr.Dataset, quantity: str = "e_n", model: str = "ccm") -> Table:
    """Every common case of one map of two result files (``a`` and ``b``), and counts for all maps as facts.

    A difference exceeds the errors if it is larger than the sum of both: half-widths of intervals, or else errors of
    the mesh. ``quantity``: map to be listed case by case. Raises `StudyError`: different kinds of axes, nothing in
    common, or an unknown quantity.
    """
    axes, pair = _matched(first, second)
    with fault_of(f"{first.file}, {second.file}: a stored scene cannot be read", ValueError, code=OTHER_FILE):
        changed = changes(first.scene, second.scene)
    in_a, in_b = (ds.status.values == DONE for ds in pair)
    states = {"solved in both": in_a & in_b, "only in a": in_a & ~in_b, "only in b": ~in_a & in_b,
              "in neither": ~in_a & ~in_b}  # fmt: skip
    names = [n for n in (*(q.name for q in NUMERIC_MAPS), *FORCE_RANGE) if n in first and n in second]
    if quantity not in names:
        raise StudyError(USAGE, f"--quantity: found '{quantity}', expected one of: {', '.join(names)}")
    units = first[quantity].units
    values = _values(pair, quantity, model)
    *few, station, angle, force = axes
    poses = not axes[station]["units"]
    rows: list[Row] = []
    for index in np.ndindex(in_a.shape):
        place: Row = {name: float(axis["common"][i]) for (name, axis), i in zip(axes.items(), index, strict=True)}
        place["label"] = str(pair[0].label.values[index[-3:-1]])
        rows.append(place | {name: array[index] for name, array in values.items()})
    hidden = [name for name in (*few, station, angle) if len(axes[name]["common"]) < 2]
    hidden += [station, angle] * poses + [force] * (quantity in FORCE_RANGE)
    columns = [Column(name, axis["units"], digits=5, display=name not in hidden) for name, axis in axes.items()]
    columns += [Column("label", wrap=24)] * poses
    judged = any(value is not None for value in values["beyond_error"].ravel())
    columns += [Column("a", units), Column("b", units), Column("difference", units, "b-a"), Column("relative"),
                Column("error", units, "errors", digits=2, display=judged),
                Column("beyond_error", "", "exceeds\nerrors", display=judged)]  # fmt: skip
    facts = {"files": {"a": str(first.file), "b": str(second.file)}, "axes": axes,
             "settings": [{"key": key, "a": a, "b": b} for key, a, b in changed],
             "states": {words: int(cases.sum()) for words, cases in states.items()}, "quantity": quantity,
             "summary": [_summary(name, _values(pair, name, model), first[name].units) for name in names
                         if name in MAIN or name == quantity]}  # fmt: skip
    return Table("", columns, rows, _verdict(pair, quantity, model, values), facts, "cases")


def compare_text(table: Table, top: int = 10, width: int = PAPER) -> str:
    """What differs, in lines of at most ``width`` characters; the ``top`` largest differences (0: all) case by case."""
    facts, quantity = table.facts, str(table.facts["quantity"])
    texts = ((row["key"], *value_texts(row["a"], row["b"])) for row in facts["settings"])
    settings = [dict(zip(("key", "a", "b"), words, strict=True)) for words in texts]
    heads = [Column("key", label="setting", wrap=width // 2), Column("a"), Column("b")]
    lines = [f"{letter}: {file}" for letter, file in facts["files"].items()]
    lines.append(as_text(Table("", heads, settings), width) or "settings: no difference")
    lines.append(f"common cases: {', '.join(f'{n} {words}' for words, n in facts['states'].items() if n)}")
    lines += [wrapped(line, width, more="  ") for name, axis in facts["axes"].items() for line in _left_out(name, axis)]
    columns = [Column("quantity", wrap=30), Column("mean_a", label="mean\na"), Column("mean_b", label="mean\nb"),
               Column("mean", label="mean b-a\n[%]"), Column("largest", label="largest\n[%]"),
               Column("exceed", label="exceed\nerrors")]  # fmt: skip
    summary = Table("", columns, [_shown_summary(row) for row in facts["summary"] if row["compared"]])
    known = [row for row in table.rows if np.isfinite(row["difference"])]
    if not known:
        return "\n".join([*lines, "", "no case is solved in both"])
    listed = [known[i] for i in falling(np.abs([row["difference"] for row in known]))][: top or None]
    percent = [row | {"relative": 100 * row["relative"]} for row in listed]
    units = next(column.unit for column in table.columns if column.name == "a")
    title = f"{with_unit(quantity, shown_unit(units))}: {len(listed)} of {len(known)} differences, "
    heads = [c._replace(label="b-a\n[%]") if c.name == "relative" else c for c in table.columns]
    cases = replace(table, title=f"{title}the largest first", columns=heads, rows=percent)
    return "\n".join([*lines, "", as_text(summary, width), "", as_text(cases, width)])


# --- axes ------------------------------------------------------------------------------------------------------------


def _matched(first: xr.Dataset, second: xr.Dataset) -> tuple[dict[str, Row], Pair]:
    """Values of every axis that both files have, and that only one has; the common cases of both."""
    both = axes_of(first), axes_of(second)
    kinds = [[(axis.name, axis.units) for axis in axes] for axes in both]
    if kinds[0] != kinds[1]:
        words = [", ".join(with_unit(*axis) for axis in kind) for kind in kinds]
        text = f"the maps have different axes: {words[0]} in {first.file}, {words[1]} in {second.file}"
        raise StudyError(USAGE, f"{text}; compare files with the same kind of candidates and the same swept keys")
    axes: dict[str, Row] = {}
    pair = first, second
    for a, b in zip(*both, strict=True):
        scale = max(np.abs(a.values).max(), np.abs(b.values).max(), 1e-300)
        # relative difference of coordinates that is only rounding
        same = np.abs(a.values[:, None] - b.values) <= 1e-9 * scale
        if a.options and b.options:  # the numbers are those of texts
            same = np.array(a.options)[:, None] == np.array(b.options)
        # poses, of which samplers may have found others
        if a.name == "station" and not a.units and "finger_pose_origin" in first and "finger_pose_origin" in second:
            same = _same_poses(first, second, same)
        only = a.values[~same.any(axis=1)], b.values[~same.any(axis=0)]
        if not same.any():
            raise StudyError(USAGE, f"{first.file} and {second.file} have no common {a.name}: nothing to compare")
        at = np.nonzero(same)
        pair = pair[0].isel({a.name: at[0]}), pair[1].isel({a.name: at[1]})
        axes[a.name] = {"units": a.units, "common": a.values[at[0]], "only_a": only[0], "only_b": only[1]}
    return axes, pair


def _same_poses(first: xr.Dataset, second: xr.Dataset, numbers: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Which poses of two files ``(n, m)`` are one grasp; fingers may be exchanged, and pads turned by half.

    Where one was not solved that is not known, and the ``numbers (n, m)`` that are alike tell.
    """
    places = []
    for ds in (first, second):
        rest = [*ds.status.dims[:-3], *ds.status.dims[-2:]]  # along which a pose is the same wherever it is known
        R = ds.finger_pose_rotation.isel(finger=0).max(rest).values
        places.append((ds.finger_pose_origin.mean("finger").max(rest).values, R[..., 2], R[..., 0]))
    (x, *axes), (y, *others) = places
    apart = np.linalg.norm(x[:, None] - y, axis=-1)
    same = apart <= SAME_PLACE
    for u, v in zip(axes, others, strict=True):
        same &= np.abs(u @ v.T) > SAME_AXES
    same |= np.isnan(apart) & numbers
    same &= same.cumsum(axis=1) == 1  # each once
    return np.asarray(same & (same.cumsum(axis=0) == 1))


def _left_out(name: str, axis: dict[str, Any]) -> list[str]:
    only = {letter: shown(axis[f"only_{letter}"], axis["units"]).tolist() for letter in "ab"}
    unit = shown_unit(axis["units"])
    return [f"{name} only in {letter}, left out: {listed(values, unit)}" for letter, values in only.items() if values]


# --- differences -----------------------------------------------------------------------------------------------------


def _values(pair: Pair, name: str, model: str) -> dict[str, NDArray[Any]]:
    """Columns of a map over the common cases; NaN where a file has no result, None where an error is unknown."""
    a, b = (values_of(ds, name, model) for ds in pair)
    if name in FORCE_RANGE:  # known once for all forces
        b = np.where(np.arange(b.shape[-1]) > 0, np.nan, b)
    error = sum(np.full(a.shape, np.nan) if e is None else e for e in (_error(ds, name, model) for ds in pair))
    change, size = b - a, np.abs(a)
    beyond = (np.abs(change) > error + TIE * size).astype(object)
    beyond[~(np.isfinite(change) & np.isfinite(error))] = None
    relative = np.divide(change, size, out=np.full(size.shape, np.nan), where=size > 0)
    return {"a": a, "b": b, "difference": change, "relative": relative, "error": error, "beyond_error": beyond}


def _error(ds: xr.Dataset, name: str, model: str) -> FloatArray | None:
    """Error of a map in its unit; None where the file has none, as for models other than CCM."""
    if "model" in ds[name].dims and model != "ccm":
        return None
    parts = [values_of(ds, f"{name}_interval")] if f"{name}_interval" in ds else []
    stated = stated_error(ds, name)
    return None if stated is None else np.sqrt(sum(part**2 for part in [*parts, stated]))


def _summary(name: str, values: dict[str, NDArray[Any]], units: str = "") -> Row:
    """Means, mean and largest relative difference of a map, and how many differences exceed the errors."""
    a, b, change, relative = (values[k] for k in ("a", "b", "difference", "relative"))
    both, judged = np.isfinite(change), [value for value in values["beyond_error"].ravel() if value is not None]
    row: Row = {"quantity": name, "units": units, "compared": int(both.sum()), "judged": len(judged)}
    row["beyond_error"] = sum(map(bool, judged))
    if both.any():
        row |= {"mean_a": float(a[both].mean()), "mean_b": float(b[both].mean())}
        row["mean"] = float(change[both].mean() / max(np.abs(a[both]).mean(), 1e-300))
        row["largest"] = float(np.nanmax(np.abs(relative))) if np.isfinite(relative).any() else np.nan
    return row


def _shown_summary(row: Row) -> Row:
    means = {name: float(shown(row[name], row["units"])) for name in ("mean_a", "mean_b")}
    exceed = f"{row['beyond_error']} of {row['judged']}" if row["judged"] else "-"
    shares = {name: round(100 * row[name], 2) for name in ("mean", "largest")}
    return means | shares | {"quantity": with_unit(row["quantity"], shown_unit(row["units"])), "exceed": exceed}


def _verdict(pair: Pair, name: str, model: str, values: dict[str, Any]) -> list[str]:
    """How many differences of the quantity that was asked for exceed the errors; or which file states none."""
    row = _summary(name, values)
    silent = " or ".join(x for x, ds in zip("ab", pair, strict=True) if _error(ds, name, model) is None)
    if not row["compared"]:
        return []
    if silent:
        return [f"no error of {name} in {silent}; accuracy.meshes = 2 in its scene gives that of many maps"]
    open_ = row["compared"] - row["judged"]
    more = f", {open_} could not be judged" * (open_ > 0)
    both = f"exceed the errors of both files together{more}"
    return [f"{row['beyond_error']} of {row['judged']} differences of {name} {both}"]
