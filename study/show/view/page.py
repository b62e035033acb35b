"""The view as one page that needs nothing else, neither network nor library; the reader's browser draws it by WebGL.

Lengths are in mm, pressures in kPa. Arrays are packed as base64; equal ones, as images of a grasp have, once.
"""

from __future__ import annotations

import base64
import json
from importlib.resources import files
from typing import Any

import numpy as np

from softjaw.study.flags import flag_words
from softjaw.study.result.layout import DONE, FAILED
from softjaw.study.show.pictures import span
from softjaw.study.show.view import limits
from softjaw.study.show.view.colours import CROSS, CROSSED, FORCE, NEUTRAL, OPEN, PAD, stops
from softjaw.study.show.view.model import View
from softjaw.study.show.view.pads import Pad, pads
from softjaw.study.show.view.surface import crosses

MOST = 48_000_000  # bytes of pads and walls in a page; beyond it, those of the worst grasps are left out
SHOWN = ("quality", "quality_fitted", "e_n", "epsilon", "f_x_max", "f_y_max", "tau_z_max", "safety_factor", "F_N", "S",
         "contact_area", "p_max", "travel", "curvature_loss", "dent", "wall_stress")  # fmt: skip


def page(view: View, index: tuple[int, ...], quantity: str, motion: str) -> str:
    """The page, which opens at a case, a map and a motion."""
    told = payload(view, index, quantity, motion)
    # as text in a script element: nothing in it may end that element
    text = json.dumps(told, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")
    template = files("softjaw.study.show.view").joinpath("viewer.html").read_text(encoding="utf-8")
    script = files("softjaw.study.show.view").joinpath("viewer.js").read_text(encoding="utf-8")
    return template.replace("/*SCRIPT*/", script).replace("/*DATA*/", text)


def payload(view: View, index: tuple[int, ...], quantity: str, motion: str) -> dict[str, Any]:
    """Everything that the page draws, as plain data."""
    data, packs = view.data, _Packs()
    colours = {"none": NEUTRAL, "open": OPEN, "failed": CROSSED, "pad": PAD, "cross": CROSS, "force": FORCE}
    left_out, cases = _cases(view, index, packs)
    notes = [view.note] if view.note else []
    if left_out:
        notes.append(f"pads of the {left_out} worst cases are left out, or the page would be too large")
    return {
        "title": data.title,
        "notes": notes,
        "start": {"candidate": view.candidate(index), "force": index[-1], "quantity": quantity, "motion": motion},
        "forces": [float(f) for f in data.forces],
        "candidates": [data.place(view.index(c, 0)) for c in range(view.candidates)],
        "first": int(np.ravel_multi_index(view.index(0, 0)[:-1], data.shape[:-1])),
        "poses": data.by_poses,
        "state": [view.state(k).tolist() for k in range(len(data.forces))],
        "remarks": _remarks(view),
        "quantities": _quantities(view, quantity),
        "colours": {**colours, "pressure": stops("pressure").tolist()},
        "surface": _surface(view, packs),
        "limit": {"rows": limits.ROWS, "columns": limits.COLUMNS, "radius": _Packs.RADIUS},
        "cases": cases,
        "packs": packs.texts,
    }


class _Packs:
    """Arrays as base64, each content once; `add` gives the number of a pack."""

    RADIUS = 4.0  # of a limit surface, at most, in the unit of its torques and forces

    def __init__(self) -> None:
        self.texts: list[str] = []
        self._numbers: dict[bytes, int] = {}

    def add(self, values: np.ndarray, kind: str) -> int:
        content = np.ascontiguousarray(values, kind).tobytes()
        if content not in self._numbers:
            self._numbers[content] = len(self.texts)
            self.texts.append(base64.b64encode(content).decode())
        return self._numbers[content]

    def scaled(self, values: np.ndarray) -> dict[str, Any]:
        """As 16-bit numbers, and the step between them."""
        step = float(np.abs(values).max(initial=0.0)) / 32767 or 1.0
        return {"pack": self.add(np.round(values / step), "<i2"), "step": step}

    @property
    def size(self) -> int:
        return sum(map(len, self.texts))


def _surface(view: View, packs: _Packs) -> dict[str, Any]:
    """The object's triangles, their candidates, where their corners lie on the wall, and crosses for failed cells."""
    corners, cell = view.surface
    found = {
        "x": packs.add(1e3 * corners[..., :3], "<f4"),
        "normal": packs.add(np.round(127 * corners[..., 3:]), "i1"),
        "cell": packs.add(cell, "<i4"),
    }
    failed = np.flatnonzero((view.data.status[view.point] == FAILED).any(axis=-1))
    angles = view.data.axes[-2].values
    lines = {} if view.data.by_poses else {int(c): crosses(corners, cell, [c], angles) for c in failed}
    found["crosses"] = {c: (1e3 * x).round(4).ravel().tolist() for c, x in lines.items()}
    if view.wall is not None:
        around = np.nan_to_num(view.wall.around, nan=-1.0)
        found |= {"around": packs.add(around, "<f4"), "along": packs.add(np.nan_to_num(view.wall.along), "<f4")}
    return found


def _quantities(view: View, first: str) -> list[dict[str, Any]]:
    """Maps that the page can show, ``first`` among them."""
    data, found = view.data, []
    for name in dict.fromkeys((*SHOWN, first)):
        values = data.map(name)
        if values is None:
            continue
        label, unit, factor = data.units(name)
        here = factor * values[view.point]
        low, high = span(here)
        rows = [[_plain(v) for v in factor * view.over_candidates(values, k)] for k in range(len(data.forces))]
        found.append({"name": name, "label": label, "unit": unit, "low": low, "high": high, "values": rows,
                      "stops": stops(name).tolist()})  # fmt: skip
    return found


def _plain(value: float) -> float | None:
    return float(f"{value:.6g}") if np.isfinite(value) else None


def _remarks(view: View) -> dict[str, str]:
    """Flags of solved cases and reasons of failed ones, keyed by force and candidate."""
    data, messages, found = view.data, view.data.result.messages, {}
    for k in range(len(data.forces)):
        for c in range(view.candidates):
            i = view.index(c, k)
            if data.status[i] == FAILED:
                found[f"{k} {c}"] = f"failed: {messages[i] or 'no reason was given'}"
            elif data.status[i] == DONE and (told := flag_words(int(data.flags[i]))):
                found[f"{k} {c}"] = f"flags: {told}"
    return found


def _cases(view: View, index: tuple[int, ...], packs: _Packs) -> tuple[int, dict[str, Any]]:
    """Pads, wall and limit surface of the solved cases, the best first; and how many were left out."""
    data, found, left_out = view.data, {}, 0
    forces = sorted(range(len(data.forces)), key=lambda k: abs(k - index[-1]))
    listed = [i for k in forces for i in data.order(k) if i[:-3] == view.point]
    size = 0
    for i in dict.fromkeys([index, *listed]):
        if data.status[i] != DONE:
            continue
        if size > MOST:
            left_out += 1
            continue
        before = len(packs.texts)
        both = pads(data, view.gripper, i)
        one: dict[str, Any] = {"pads": [_pad(pad, packs) for pad in both]}
        if (moved := view.displacement(i)) is not None:
            one["wall"] = {**packs.scaled(1e3 * moved[0]), "angle": moved[1]}
        if (body := limits.limit_body(data, i)) is not None:
            radius = packs.add(np.round(np.minimum(body.radius / _Packs.RADIUS, 1.0) * 65535), "<u2")
            one["limit"] = {"radius": radius, "unit": body.unit.tolist(), "finger": body.finger, "fitted": body.fitted}
        found[f"{i[-1]} {view.candidate(i)}"] = one
        size += sum(map(len, packs.texts[before:]))
    return left_out, found


def _pad(pad: Pad, packs: _Packs) -> dict[str, Any]:
    """A pad in its own frame, where the images of a grasp are alike."""
    told: dict[str, Any] = {
        "rotation": pad.rotation.round(9).ravel().tolist(),
        "position": (1e3 * pad.position).round(6).tolist(),
        "frame": pad.frame.round(6).ravel().tolist(),
        "origin": (1e3 * pad.origin).round(6).tolist(),
        "back": (1e3 * pad.own(pad.back)).round(6).ravel().tolist(),
        "lift": round(1e3 * pad.lift, 6),
        "grid": list(pad.front.shape[:2]),
        "front": packs.scaled((1e3 * pad.own(pad.front)).round(6)),
    }
    if pad.pressure is not None:
        told["pressure"] = packs.scaled((1e-3 * pad.pressure).round(9))
    return told
