"""Every case of a result file for planners: maps, contact frames, poses and limit surfaces, one row per case."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterator
from typing import Any

import numpy as np

from softjaw.study.flags import flags_in
from softjaw.study.quantities import MODELS, MONOMIALS
from softjaw.study.show.tables.columns import cell

STATES = ("missing", "done", "failed")
XYZ, WRENCH = ("x", "y", "z"), ("f_x", "f_y", "tau_z")
NINE = tuple(f"{row}_{column}" for row in XYZ for column in XYZ)
# Name, unit of every component, names of the components; of each finger, in the object's frame.
FINGER = (
    ("pose_origin", "m", XYZ),
    ("pose_rotation", "", NINE),
    ("frame_origin", "m", XYZ),
    ("frame_axes", "", NINE),
    ("f_x_max", "N", ()),
    ("f_y_max", "N", ()),
    ("tau_z_max", "N m", ()),
    ("S", "N", ()),
    ("F_N", "N", ()),
    ("semi_axes", ("N", "N", "N m"), WRENCH),
    ("unit", ("N", "N", "N m"), WRENCH),
    ("coefficients", "", MONOMIALS),
    ("matrix", "", tuple(f"{row}_{column}" for row in WRENCH for column in WRENCH)),
    ("certificate", "", ()),
)
MEANING = {
    "pose": "x_object = pose_rotation x_pad + pose_origin at first touch",
    "frame": "contact frame in the object's frame: origin, and rows x, y, N with N into the object",
    "semi_axes": "largest f_x, f_y, tau_z: the ellipsoid from three motions",
    "fitted surface": "P(f_x, f_y, tau_z) = 1: divide a wrench by unit, then P is the quartic of coefficients (of "
    + ", ".join(MONOMIALS)
    + ") or the quadratic form of matrix, whichever is there",
    "finger1": "stands at the angle and presses along -(cos, sin, 0); finger2 comes from the opposite side",
}


def cases(result: Any, model: str = "curved") -> Iterator[dict[str, Any]]:
    """Every case: place, state, message, flags, maps in one friction model, and both fingers.

    Arrays are numpy arrays, NaN where a case has no result.
    """
    maps = {name: _map(result, name, model) for name in _units(result)}
    flags = np.nan_to_num(maps.pop("flags")).astype(int)
    status, messages, labels = result.status, result.messages, result.labels
    fingers = _fingers(result, model)
    for index in np.ndindex(result.layout.shape):
        done = STATES[status[index]] == "done"
        yield {
            "place": {axis.name: float(axis.values[i]) for axis, i in zip(result.axes, index, strict=True)},
            "label": str(labels[index[-3:-1]]),
            "state": STATES[status[index]],
            "message": str(messages[index]),
            "flags": int(flags[index]) if done else 0,
            "maps": {name: values[index] if done else np.nan for name, values in maps.items()},
            "fingers": [
                {name: values[index][f] if done else np.full_like(values[index][f], np.nan)
                 for name, values in fingers.items()} for f in range(2)
            ],
        }  # fmt: skip


def _units(result: Any) -> dict[str, str]:
    """Name and unit of every map, and of what is derived for every case, or for all forces of a candidate together."""
    derived = {d.name: d.units for d in result.layout.derived if len(d.axes) >= len(result.axes) - 1 and not d.shape}
    return {q.name: q.unit for q in result.layout.quantities if q.group == "maps"} | derived


def _map(result: Any, name: str, model: str) -> np.ndarray:
    q = next((q for q in result.layout.quantities if q.group == "maps" and q.name == name), None)
    if q is None:
        found = result.derived(name)
        return found if found.shape == result.layout.shape else np.broadcast_to(found[..., None], result.layout.shape)
    return result.map(name, model if q.by_model else None)


def _fingers(result: Any, model: str) -> dict[str, np.ndarray]:
    """What `FINGER` lists, over axes and finger."""
    m = MODELS.index(model)
    R, o = result.fingers("pose_rotation"), result.fingers("pose_origin")
    S, rho = result.fingers("S"), result.read("limit_surface/rho")
    limits = {name: result.fingers(name) for name in ("f_x_max", "f_y_max", "tau_z_max")}
    muS = limits["f_x_max"][..., MODELS.index("flat")]  # the planar model's friction is mu S in every direction
    found = {
        "pose_origin": o,
        "pose_rotation": R,
        "frame_origin": np.einsum("...ij,...j->...i", R, result.fingers("frame_origin")) + o,
        "frame_axes": result.fingers("frame_axes") @ np.swapaxes(R, -1, -2),
        **{name: values[..., m] for name, values in limits.items()},
        "S": S,
        "F_N": result.fingers("F_N"),
        "semi_axes": result.read("limit_surface/semi_axes")[..., m, :] * S[..., None],
        "unit": muS[..., None] * np.stack([np.ones_like(rho), np.ones_like(rho), rho], axis=-1),
        **{n: result.read(f"limit_surface/{n}")[..., m, :] for n in ("coefficients",)},
        "matrix": result.read("limit_surface/matrix")[..., m, :, :],
        "certificate": result.read("limit_surface/certificate")[..., m],
    }
    return {name: found[name] for name, _, _ in FINGER}


def as_json(result: Any, model: str = "curved") -> str:
    """One object: file, units, meanings, and a list of cases; SI units, null where there is nothing."""
    units = {axis.name: axis.units for axis in result.axes}
    units |= _units(result)
    units |= {name: unit for name, unit, _ in FINGER}
    rows = []
    for case in cases(result, model):
        place, words = case.pop("place"), [flag.word for flag in flags_in(case["flags"])]
        rows.append(place | {k: _plain(v) for k, v in case.items()} | {"flag_words": words})
    about = {"file": result.path.name, "model": model, "units": units, "meaning": MEANING}
    return json.dumps({**about, "cases": rows}, indent=1)


def as_csv(result: Any, model: str = "curved") -> str:
    """One line for each case, SI units in the header, empty where there is nothing."""
    maps = {name: unit for name, unit in _units(result).items() if name != "flags"}
    head = [_head(axis.name, axis.units) for axis in result.axes]
    head += ["label", "state", "message", "flags", *(_head(*pair) for pair in maps.items())]
    for f in (1, 2):
        for name, unit, parts in FINGER:
            each = [unit] * len(parts) if isinstance(unit, str) else unit
            names = [f"finger{f}.{name}.{part}" for part in parts] or [f"finger{f}.{name}"]
            head += [_head(n, u) for n, u in zip(names, each or [unit], strict=True)]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(head)
    for case in cases(result, model):
        flat = [float(v) for values in case["fingers"] for part in values.values() for v in np.ravel(part)]
        numbers = [*(float(case["maps"][name]) for name in maps), *flat]
        lead = [*case["place"].values(), cell(case["label"]), case["state"], cell(case["message"]), case["flags"]]
        writer.writerow([*lead, *("" if np.isnan(v) else repr(v) for v in numbers)])
    return text.getvalue().rstrip("\n")


def _head(name: str, unit: Any) -> str:
    return f"{name} [{unit}]" if unit else name


def _plain(value: Any) -> Any:
    """A value as JSON takes it: nested lists, None for what is not there; an array without any number is None."""
    if isinstance(value, dict):
        return {key: _plain(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_plain(v) for v in value]
    if isinstance(value, str | int):
        return value
    numbers = np.asarray(value, float)
    if not numbers.ndim:
        return float(numbers) if np.isfinite(numbers) else None
    return [_plain(v) for v in numbers] if np.isfinite(numbers).any() else None
