"""``softjaw patch``: from files and options to the answer, as text with lengths in mm, as JSON or as a picture."""

import json
from argparse import Namespace
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.friction.patch import FloatArray
from softjaw.lsfit.surface import PLANES, shadow_outline
from softjaw.study.messages import USAGE, StudyError, with_ending, write_file
from softjaw.study.patch.answer import (
    DEFINITIONS,
    FRICTION,
    SCORES,
    SURFACES,
    UNITS,
    EvaluatedPatch,
    as_record,
    grasp_record,
    read_patch,
)
from softjaw.study.patch.patch_reader import Reading
from softjaw.study.quantities import MODELS
from softjaw.study.scene import Scene, load_scene
from softjaw.study.table import Column, Row, Table, as_text, number, plain, with_unit, wrapped
from softjaw.study.units import shown, shown_unit

PICTURES = (".png", ".svg")
LINE = 110  # characters
FRICTION_COEFFICIENT, ALONG_PAD = 0.8, np.array([1.0, 0.0, 0.0])
AXES, SHOWN = ("f_x / S", "f_y / S", "tau_z / S [mm]"), np.array([1.0, 1.0, 1e3])
LOOK: dict[str, dict[str, Any]] = {
    "exact": {"color": "#1d2429", "linewidth": 2.2},
    "three_motions": {"color": "#c05a00", "linestyle": "--"},
    "axis_aligned": {"color": "#8a5a9e", "linestyle": "-."},
    "full": {"color": "#2a8c82", "linestyle": ":"},
    "quartic": {"color": "#12436d", "linestyle": (0, (6, 2))},
}


def patch(options: Namespace) -> str:
    """Judge a pressure field from elsewhere: read, evaluate and score; the text or the JSON of it."""
    if options.other and options.distance:
        raise StudyError(USAGE, "--distance: found beside --other, which gives the distance itself; remove one of them")
    scored = options.other or options.distance
    for name in ("object_length", "contact_length"):
        if getattr(options, name) and not scored:
            option = f"--{name.replace('_', '-')}"
            raise StudyError(USAGE, f"{option}: found without a grasp to score; add --distance MM or --other FILE")
    if options.picture:
        with_ending("-o", options.picture, *PICTURES)
    reading = Reading(options.unit, options.pressure_unit, options.pressure_name, options.flip_normals)
    mu, long_side = options.mu or FRICTION_COEFFICIENT, options.long_side
    if options.deformed:
        # solves: PETSc would slow down all other answers
        from softjaw.study.patch.deformed_face import solve_deformed

        scene = _scene_of(options)
        mu, long_side = options.mu or scene.friction.mu, ALONG_PAD if long_side is None else long_side
        read = [solve_deformed(options.file, options.unit, scene)]
    elif options.scene:
        text = f"SCENE: found '{options.scene}', expected none; add --deformed if the file holds a deformed face"
        raise StudyError(USAGE, text)
    else:
        read = [read_patch(file, reading) for file in (options.file, options.other) if file]
    patches = [EvaluatedPatch(patch, mu, long_side) for patch in read]
    grasp = None
    if scored:
        lengths = (options.distance, options.object_length, options.contact_length)
        metres = [None if mm is None else 1e-3 * mm for mm in lengths]
        grasp = grasp_record(patches[0], patches[1] if options.other else None, options.surface, *metres)
    if options.picture:
        write_picture(patches, options.surface, Path(options.picture))
    record = as_record(patches, grasp)
    return json.dumps(plain(record), indent=2, allow_nan=False) if options.form else record_text(record)


def _scene_of(options: Namespace) -> Scene:
    """The scene whose pad has a deformed face; options that say something else are refused."""
    if not options.scene:
        text = f"found no scene with the pad; write softjaw patch --deformed {options.file} SCENE.toml"
        raise StudyError(USAGE, f"--deformed: {text}")
    for name in ("other", "pressure_unit", "pressure_name", "flip_normals"):
        if getattr(options, name):
            option = f"--{name.replace('_', '-')}"
            raise StudyError(USAGE, f"{option}: found with --deformed, which solves for the pressure; remove one")
    return load_scene(Path(options.scene))


def record_text(record: dict[str, Any]) -> str:
    """A block for each patch, one for the grasp, notes and definitions."""
    grasp = record["grasp"]
    blocks = [_patch_block(patch, record["mu"]) for patch in record["patches"]]
    blocks.append(_grasp_block(grasp) if grasp else ["no grasp is scored: add --distance MM, or --other FILE"])
    blocks.append([wrapped(f"note: {text}", LINE, more="  ") for text in record["notes"]])
    blocks.append([wrapped(f"{word}: {text}", LINE, more="  ") for word, text in DEFINITIONS.items()
                   if grasp or word not in SCORES])  # fmt: skip
    return "\n\n".join("\n".join(lines) for lines in blocks if lines)


def _patch_block(patch: dict[str, Any], mu: float) -> list[str]:
    lost, frame = 100 * (1 - patch["F_N"] / patch["S"]), patch["frame"]
    rows = [
        ("S", f"{patch['S']:.4g} N"),
        ("F_N", f"{patch['F_N']:.4g} N, {lost:.3g} % less than S"),
        ("contact", f"{1e6 * patch['area']:.4g} mm^2, rho {1e3 * patch['rho']:.4g} mm, "
                    f"largest pressure {1e-3 * patch['pressure']:.4g} kPa"),
        ("origin", f"{_vector(1e3 * frame['origin'])} mm"),
        *((f"axis {name}", _vector(axis)) for name, axis in zip("xyN", frame["axes"], strict=True)),
    ]  # fmt: skip
    friction: list[Row] = []
    for name in FRICTION:
        values = {model: float(shown(patch["friction"][model][name], UNITS[name])) for model in MODELS}
        friction.append({"friction": with_unit(name, shown_unit(UNITS[name])), **values})
    table = Table("", [Column("friction", wrap=40), *map(Column, MODELS)], friction)
    faces = f"{patch['faces']} face{'s' * (patch['faces'] > 1)}"
    head = f"{patch['file']}: {faces}, {patch['loaded_faces']} under pressure, mu = {mu:g}"
    return [head, *(f"  {name:<8} {text}" for name, text in rows), "", as_text(table, LINE), "",
            as_text(_surface_table(patch["limit_surface"]["ccm"]), LINE)]  # fmt: skip


def _surface_table(surfaces: dict[str, Any]) -> Table:
    exact = surfaces["exact"]["volume"]
    columns = [Column("kind", label="limit surface (ccm)", wrap=40), Column("volume", label="volume / exact"),
               Column("E_rad", label="E_rad [%]", digits=3), Column("E_dir", "rad", digits=3)]  # fmt: skip
    rows = []
    for kind, title in SURFACES.items():
        surface = surfaces[kind]
        error = None if surface["E_rad"] is None else 100 * surface["E_rad"]
        volume = surface["volume"] / exact if exact else None
        rows.append({"kind": title, "volume": volume, "E_rad": error, "E_dir": surface["E_dir"]})
    return Table("", columns, rows)


def _grasp_block(grasp: dict[str, Any]) -> list[str]:
    apart, arms, torques = (f"{1e3 * grasp[key]:.4g} mm" for key in ("distance", "object_length", "contact_length"))
    columns = [Column("score", label=f"grasp ({SURFACES[grasp['surface']]})", wrap=60), *map(Column, MODELS)]
    scores = {model: grasp["score"][model] for model in MODELS}
    rows: list[Row] = [{"score": "quality"} | {model: float(score["quality"]) for model, score in scores.items()}]
    rows.append({"score": "epsilon"} | {model: _between(*score["epsilon"]) for model, score in scores.items()})
    lengths = f"  contacts {apart} apart, torques over object length {arms} and contact length {torques}"
    return [as_text(Table("", columns, rows), LINE), lengths]


def _vector(v: FloatArray) -> str:
    return "(" + ", ".join(f"{x:.4g}" for x in np.where(np.abs(v) < 1e-9, 0.0, v)) + ")"


def _between(lower: float, upper: float) -> str:
    return number(lower, 4) if upper <= 1.001 * lower + 1e-9 else f"{lower:.3g} to {upper:.3g}"


# --- picture ----------------------------------------------------------------------------------------------------------


def write_picture(patches: Sequence[EvaluatedPatch], kind: str, path: Path) -> None:
    """Shadows of all patches' limit surfaces, exact and fitted, one row each; the ending chooses the format."""
    from softjaw.study import pictures  # loads matplotlib, which the text does not need

    with pictures.style():
        drawn, axes = pictures.figure(9.0, 3.1 * len(patches), len(patches), len(PLANES))
        for row, patch in zip(axes, patches, strict=True):
            for place, plane in zip(row, PLANES, strict=True):
                place.axhline(0, color=pictures.SOFT, linewidth=0.4)
                place.axvline(0, color=pictures.SOFT, linewidth=0.4)
                for name in dict.fromkeys(["exact", "three_motions", kind]):
                    points = patch.surface("ccm", name).support_points
                    outline = shadow_outline(points, *plane, 360, patch.contact.rho) * SHOWN[[*plane]]
                    place.plot(*outline.T, label=name.replace("_", " "), **LOOK[name])
                place.set(xlabel=AXES[plane[0]], ylabel=AXES[plane[1]])
            row[0].set_title(f"{Path(patch.read.file).name}: shadows, ccm, mu = {patch.contact.mu:g}")
        axes[0, 0].legend(*axes[0, 0].get_legend_handles_labels(), frameon=False, fontsize=7.5, loc="center")
        data = {".png": pictures.as_png, ".svg": pictures.as_svg}[path.suffix.lower()](drawn)
    write_file(path, data)
