"""Cases of a result file as CSV and JSON: maps, contact frames, poses and limit surfaces, one row for each."""

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from softjaw.study.flags import OF_FILE, flags_in
from softjaw.study.quantities import FINGERS, MONOMIALS, STATES, Axis
from softjaw.study.result.layout import DONE
from softjaw.study.result.read import axes_of, maps_in, values_of
from softjaw.study.table import Column, Table, plain
from softjaw.study.table import as_csv as rendered

XYZ, WRENCH = ("x", "y", "z"), ("f_x", "f_y", "tau_z")
NINE, SQUARE = (tuple(f"{row}_{column}" for row in names for column in names) for names in (XYZ, WRENCH))
FORCES = ("N", "N", "N m")
MEANING = {
    "pose": "x = pose_rotation x_pad + pose_origin at first touch, in the frame of the object's own file",
    "frame": "contact frame in the same frame: origin, and rows x, y, N with N into the object",
    "semi_axes": "largest f_x, f_y, tau_z: the ellipsoid from three motions",
    "fitted surface": "P(f_x, f_y, tau_z) = 1: divide a wrench by unit, then P is the quartic of coefficients (of "
    + ", ".join(MONOMIALS)
    + ") or the quadratic form of matrix, whichever is there",
    "finger1": "stands at the angle and presses along -(cos, sin, 0); finger2 comes from the opposite side",
}


def cases(
    ds: xr.Dataset, model: str = "ccm", which: Iterable[tuple[int, ...]] | None = None
) -> Iterator[dict[str, Any]]:
    """Cases by their indices, or every case: place, state, message, flags, maps in one friction model, both fingers.

    Arrays are numpy arrays, NaN where a case has no result.
    """
    axes, status, messages = axes_of(ds), ds.status.values, ds.message.values
    maps = {name: np.where(status == DONE, values_of(ds, name, model), np.nan) for name in maps_in(ds)}
    labels, flags, fingers = ds.label.values, ds.flags.values, _fingers(ds, model)
    for index in np.ndindex(status.shape) if which is None else which:
        yield {
            "place": {axis.name: float(axis.values[i]) for axis, i in zip(axes, index, strict=True)},
            "label": str(labels[index[-3:-1]]), "state": STATES[status[index]], "message": str(messages[index]),
            "flags": int(flags[index]), "maps": {name: values[index] for name, values in maps.items()},
            "fingers": [{name: values[index][f] for name, (values, *_) in fingers.items()} for f in range(FINGERS)],
        }  # fmt: skip


def _spoken_place(axes: Iterable[Axis], case: dict[str, Any]) -> dict[str, Any]:
    """Where a case is along the axes, with the texts and lists of a sweep as they are."""
    place = case["place"]
    return place | {axis.name: axis.options[int(place[axis.name])] for axis in axes if axis.options}


def _fingers(ds: xr.Dataset, model: str) -> dict[str, tuple[np.ndarray, str | tuple[str, ...], tuple[str, ...]]]:
    """By name of what a finger has: values over axes and finger, unit of every component, names of the components.

    In the frame of the object's own file.
    """
    of_model = ds.sel(model=model)
    R, o = ds.finger_pose_rotation.values, ds.finger_pose_origin.values
    S, rho = ds.finger_S.values, ds.limit_surface_rho.values
    muS = ds.finger_f_x_max.sel(model="pcm").values  # the planar model's friction is mu S in every direction
    unit = muS[..., None] * np.stack([np.ones_like(rho), np.ones_like(rho), rho], axis=-1)
    limits = (("f_x_max", "N"), ("f_y_max", "N"), ("tau_z_max", "N m"))
    fitted = (("coefficients", MONOMIALS), ("matrix", SQUARE), ("certificate", ()))
    return {
        "pose_origin": (o, "m", XYZ), "pose_rotation": (R, "", NINE),
        "frame_origin": (np.einsum("...ij,...j->...i", R, ds.finger_frame_origin.values) + o, "m", XYZ),
        "frame_axes": (ds.finger_frame_axes.values @ np.swapaxes(R, -1, -2), "", NINE),
        **{name: (of_model[f"finger_{name}"].values, force, ()) for name, force in limits},
        "S": (S, "N", ()), "F_N": (ds.finger_F_N.values, "N", ()),
        "semi_axes": (of_model.limit_surface_semi_axes.values * S[..., None], FORCES, WRENCH),
        "unit": (unit, FORCES, WRENCH),
        **{name: (of_model[f"limit_surface_{name}"].values, "", parts) for name, parts in fitted},
    }  # fmt: skip


def as_json(ds: xr.Dataset, model: str = "ccm", listed: Iterable[dict[str, Any]] | None = None) -> str:
    """One object: file, units, meanings, and a list of cases (`listed`, or all); SI units, null where there is nothing.

    ``flags`` are those of the file, ``flag_words`` also those that the safe force range adds to listed cases.
    """
    axes = axes_of(ds)
    units: dict[str, Any] = {axis.name: axis.units for axis in axes} | maps_in(ds)
    units |= {name: unit for name, (_, unit, _) in _fingers(ds, model).items()}
    rows = []
    for case in cases(ds, model) if listed is None else listed:
        place, words = _spoken_place(axes, case), [flag.word for flag in flags_in(case["flags"])]
        case = {**case, "flags": case["flags"] & OF_FILE}
        del case["place"]
        rows.append(place | plain(case) | {"flag_words": words})
    about = {"file": Path(ds.file).name, "model": model, "units": units, "meaning": MEANING}
    return json.dumps({**about, "cases": rows}, indent=1)


def as_csv(ds: xr.Dataset, model: str = "ccm", listed: Iterable[dict[str, Any]] | None = None) -> str:
    """One line for each case (`listed`, or all), each component of the fingers' arrays in a column of its own."""
    axes = axes_of(ds)
    columns = [Column(axis.name, axis.units) for axis in axes]
    columns += [Column(name) for name in ("label", "state", "message", "flags")]
    columns += [Column(name, unit) for name, unit in maps_in(ds).items()]
    of_finger = []
    for name, (_, unit, parts) in _fingers(ds, model).items():
        units = [unit] * max(len(parts), 1) if isinstance(unit, str) else unit
        names = [f"{name}.{part}" for part in parts] or [name]
        of_finger += [Column(n, u) for n, u in zip(names, units, strict=True)]
    columns += [c._replace(name=f"finger{f}.{c.name}") for f in (1, 2) for c in of_finger]
    rows = []
    for case in cases(ds, model) if listed is None else listed:
        row = {**_spoken_place(axes, case), **case["maps"], **case, "flags": case["flags"] & OF_FILE}
        for f, finger in enumerate(case["fingers"], start=1):
            flat = (float(v) for part in finger.values() for v in np.ravel(part))
            row |= {f"finger{f}.{c.name}": v for c, v in zip(of_finger, flat, strict=True)}
        rows.append(row)
    return rendered(Table("", columns, rows))
