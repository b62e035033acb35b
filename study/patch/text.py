"""The answer about patches as people read it: lengths in mm, angles in degrees, flags as sentences."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import numpy as np

from softjaw.study.patch.answer import DEFINITIONS, UNITS, Answer, as_record
from softjaw.study.quantities import MODELS
from softjaw.study.units import shown, shown_unit

FRICTION = ("f_x_max", "f_y_max", "tau_z_max", "tau_pure", "e_n", "e_n_projected")
SCORES = ("quality", "epsilon")
NAMES = {
    "three_motions": "ellipsoid, three motions",
    "axis_aligned": "ellipsoid, axis-aligned",
    "full": "ellipsoid, full",
    "quartic": "convex quartic",
}


def as_text(answer: Answer) -> str:
    """A block for each patch, one for the grasp, what the words mean and what the reader should know."""
    record = as_record(answer)
    blocks = [_patch_block(patch, answer.mu) for patch in record["patches"]]
    grasp = record["grasp"]
    if grasp is None:
        blocks.append(["no grasp is scored: add --distance MM for two such contacts that face each other, "
                       "or --other FILE"])  # fmt: skip
    else:
        blocks.append(_grasp_block(grasp))
    blocks.append([line for text in record["remarks"] for line in _wrapped(f"note: {text}")])
    told = {word: text for word, text in DEFINITIONS.items() if grasp or word not in SCORES}
    blocks.append([line for word, text in told.items() for line in _wrapped(f"{word}: {text}")])
    return "\n\n".join("\n".join(lines) for lines in blocks if lines)


def _patch_block(patch: dict[str, Any], mu: float) -> list[str]:
    lost = 100 * (1 - patch["F_N"] / patch["S"])
    frame = patch["frame"]
    rows = [
        ("S", f"{patch['S']:.4g} N"),
        ("F_N", f"{patch['F_N']:.4g} N, {lost:.3g} % less than S"),
        ("contact", f"{1e6 * patch['area']:.4g} mm^2, rho {1e3 * patch['rho']:.4g} mm, "
                    f"largest pressure {1e-3 * patch['pressure']:.4g} kPa"),
        ("origin", f"{_vector(1e3 * frame['origin'])} mm"),
        *((f"axis {name}", _vector(axis)) for name, axis in zip("xyN", frame["axes"], strict=True)),
    ]  # fmt: skip
    faces = f"{patch['faces']} face{'s' * (patch['faces'] > 1)}"
    head = f"{patch['file']}: {faces}, {patch['loaded_faces']} under pressure, mu = {mu:g}"
    return [head, *(f"  {name:<8} {text}" for name, text in rows), "", *_friction_table(patch), "",
            *_surface_table(patch["limit_surface"]["curved"])]  # fmt: skip


def _friction_table(patch: dict[str, Any]) -> list[str]:
    rows = [["friction", *MODELS]]
    for name in FRICTION:
        values = [shown(patch["friction"][model][name], UNITS[name]) for model in MODELS]
        rows.append([f"{name} [{shown_unit(UNITS[name])}]", *map(_number, values)])
    return _aligned(rows)


def _surface_table(surfaces: dict[str, Any]) -> list[str]:
    exact = surfaces["exact"]["volume"]
    rows = [["limit surface (curved)", "volume / exact", "E_rad [%]", "E_dir [deg]"]]
    for name, title in NAMES.items():
        found = surfaces[name]
        errors = [("E_rad", 100.0), ("E_dir", np.degrees(1.0))]
        volume = "-" if not exact else f"{found['volume'] / exact:.4f}"
        rows.append([title, volume, *("-" if found[key] is None else f"{f * found[key]:.3g}" for key, f in errors)])
    return _aligned(rows)


def _grasp_block(grasp: dict[str, Any]) -> list[str]:
    apart, whole, own = (f"{1e3 * grasp[key]:.4g} mm" for key in ("distance", "object_length", "contact_length"))
    rows = [[f"grasp ({NAMES[grasp['surface']]})", *MODELS]]
    found = [grasp["score"][model] for model in MODELS]
    rows += [["quality", *(_number(scored["quality"]) for scored in found)]]
    rows += [["epsilon", *(_between(*scored["epsilon"]) for scored in found)]]
    return [*_aligned(rows), f"  contacts {apart} apart, torques over object length {whole} and contact length {own}"]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join([row[0].ljust(widths[0]), *(c.rjust(w) for c, w in zip(row[1:], widths[1:], strict=True))])
            for row in rows]  # fmt: skip


def _wrapped(text: str) -> list[str]:
    return wrap(text, 110, subsequent_indent="  ", break_long_words=False, break_on_hyphens=False)


def _vector(v: np.ndarray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in np.where(np.abs(v) < 1e-9, 0.0, v)) + ")"


def _between(lower: float, upper: float) -> str:
    return _number(lower) if upper <= 1.001 * lower + 1e-9 else f"{lower:.3g} to {upper:.3g}"


def _number(value: float) -> str:
    return "-" if not np.isfinite(value) else f"{value:.4g}"
