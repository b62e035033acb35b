"""What the indicators of `[effects]` are worth: indicator against true error of e_n in many cases, table and picture.

    python jobs/effects.py results/effects.csv             solve every case at both levels of every effect (10 minutes)
    python jobs/effects.py results/effects.csv -o e.png    draw the table that is there and print its summary

`auto` skips an effect where its indicator is small; a skip is wrong where the error is larger than 2 %.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Iterator
from itertools import cycle
from pathlib import Path

import numpy as np

from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.wrench import friction_wrench
from softjaw.scoring.bodies import polytope_volume
from softjaw.study import pictures
from softjaw.study.case import effects, model, wall
from softjaw.study.case.build import build_object
from softjaw.study.case.contact import Contact
from softjaw.study.case.limit_surface import SurfaceFit, fit_surface
from softjaw.study.case.solving import Solver, solver
from softjaw.study.case.sweep import units
from softjaw.study.scene import Scene, load_scene, parse_scene
from softjaw.study.scene.sections import LimitSurface

TARGET = 0.02  # relative error of e_n that a skip may have
FLOOR, LEAST, MOST = 1e-6, 1e-5, 100.0  # errors, and indicators, beyond are drawn there
HULL = 3000  # motions whose wrenches stand for the limit surface itself
ROUND = 'shape = "elliptic_cylinder"\nsemi_axis_a_mm = {}\nsemi_axis_b_mm = {}\nlength_mm = 160'
TURNED = 'shape = "revolution"\nprofile_mm = {}'
RIGID = {  # object, or the file of a scene, and stations
    **{f"ball {r} mm": (f'shape = "sphere"\nradius_mm = {r}', "[0]") for r in (15, 25, 40, 80)},
    **{f"cylinder {a} x {b} mm": (ROUND.format(a, b), "[0]")
       for a, b in ((8, 8), (14, 14), (25, 20), (20, 40), (60, 60))},
    "box": ('shape = "box"\nsize_mm = [50, 40, 120]\nedge_radius_mm = 4', "[0]"),
    "plane": ('shape = "plane"\nthickness_mm = 40', "[0]"),
    "cone": (TURNED.format("[[0, 30], [50, 30], [100, 20], [150, 12]]"), "[60, 80, 110]"),
    "bottle": ("jobs/bottle-rigid.toml", "[45, 60, 85, 130, 140, 150, 160]"),
    "slight waist": (TURNED.format("[[0, 40], [30, 40], [60, 39.7], [90, 40], [120, 40]]"), "[50, 60]"),
}  # fmt: skip
FORCES = "load.normal_force_n=[0.05, 0.5, 3, 10]"
PADS = (
    ("gripper.shear_modulus_kpa=40", "friction.mu=0.8"),
    ("gripper.shear_modulus_kpa=20", "friction.mu=0.3", "gripper.pad_thickness_mm=10"),
    ("gripper.shear_modulus_kpa=80", "friction.mu=0.02", 'gripper.material="neo_hookean"', "gripper.poisson_ratio=0.3"),
)
SHEETS = ((2.0, 200.0), (1.0, 5.0), (0.53, 200.0), (2.0, 3.0), (1.0, 70.0))  # mm, GPa
CUP, BOTTLE = "jobs/cup.toml", "jobs/bottle.toml"
WALLS = {  # file, wall, modulus [GPa], stations, forces
    **{f"cup {t} mm, {E} GPa": (CUP, f"wall_profile_mm=[[0, {t}], [110, {t}]]", E, "[50]", "[0.5, 2, 4]")
       for t, E in ((0.45, 1.3), (1.0, 1.3), (1.0, 10), (1.0, 70))},
    **{f"bottle {t} mm, {E} GPa": (BOTTLE, f"wall_mm={t}", E, "[50, 70, 150]", "[1, 3, 7, 13]")
       for t, E in ((0.4, 2.0), (0.8, 2.0), (0.8, 20), (1.5, 20), (1.5, 70))},
}  # fmt: skip
COARSE = ("accuracy.wall_around_mm=4", "accuracy.wall_along_mm=6", "accuracy.wall_coarse_mm=12",
          "gripper.elements=[10, 6, 4]")  # fmt: skip
SHELLS = "object: linear or nonlinear shell"
PANELS = {  # of an effect: threshold, and what the axis says
    "object: rigid or shell": (wall.STIFF, "indentation / closing displacement"),
    SHELLS: (wall.SMALL_INDENTATION, "indentation / wall thickness"),
    "sheet": (effects.STIFF_SHEET, "compliance over that of the pad"),
    "friction": (TARGET, "1 - F_N / S"),
    "friction-pressure coupling": (effects.SMALL_TRACTION, "traction left out / pressure"),
    "limit surface": (0.0, "radial fit error"),  # quality, not e_n; the quartic is never skipped
}
EXACT = "model size"
SURFACES = {"three_motions": "s", "full": "^", "quartic": "o"}  # and how they are drawn
WORDS = {"friction": "could be skipped", "friction-pressure coupling": "not flagged"}  # auto always or never has these
LEGEND = """filled: skipped by auto; open: simulated
upright line: indicator up to which auto skips
dashed line: target, 2 %
shaded: wrong skips; nothing may lie there
friction: planar model (auto is always curved)
coupling: open cases are flagged in the result
limit surface: from three motions (squares),
fitted ellipsoids (triangles), quartics (circles)"""
Row = tuple[str, str, float, float]  # effect, case, indicator, error


def solvers(scene: Scene, **levels: str) -> Iterator[Solver]:
    """Solvers of a scene's candidates at some levels of effects."""
    scene = scene.with_values({f"effects.{name}": level for name, level in levels.items()})
    for unit in units(scene, lambda point: build_object(point.object).axis_symmetry):
        obj, poses = build_object(scene.object), unit.candidate.poses
        solving = solver(scene, [model.approach(obj, pose, scene.gripper.pad_size) for pose in poses], poses)
        yield solving
        solving.destroy()


def climb(scene: Scene, **levels: str) -> dict[tuple[int, float], list[Contact]]:
    """Contacts by candidate and force; ladders end where they have no solution."""
    found = {}
    for n, solving in enumerate(solvers(scene, **levels)):
        try:
            for force, outcome in zip(scene.load.normal_force, solving.ladder(scene.load.normal_force), strict=True):
                found[n, force] = [c for c, *_ in outcome.contacts]
        except (CheckError, ConvergenceError):
            continue
    return found


def e_n(contacts: list[Contact], friction: str = "ccm") -> float:
    """e_n of the weaker finger [m]."""
    return min(c.limits[friction].e_n for c in contacts)


def off(low: float, high: float) -> float:
    """Relative error of a cheap level's value."""
    return abs(low / high - 1.0)


def volume(contact: Contact, found: SurfaceFit) -> float:
    """Quality of two such contacts face to face with a fitted surface over that with the exact one."""
    w = friction_wrench(contact.local, fibonacci_twists(HULL, contact.rho), 1.0)[:, [0, 1, 5]]
    V, A = polytope_volume(np.vstack([w, -w]) / contact.limits["ccm"].S / [1, 1, contact.rho])
    return found.surface.volume * found.surface.shadow_area / (V * A)


def of_patch(name: str, contacts: list[Contact]) -> Iterator[Row]:
    """Effects that are chosen when the contact is solved."""
    S, F_N = (sum(getattr(c.limits["ccm"], value) for c in contacts) for value in ("S", "F_N"))
    yield "friction", name, 1.0 - F_N / S, off(e_n(contacts, "pcm"), e_n(contacts))
    c = contacts[0]
    for level in SURFACES:
        found = fit_surface(c, "ccm", LimitSurface(model=level))
        yield "limit surface", f"{name}, {level}", found.own.Erad, off(volume(c, found), 1.0)


def rigid_scenes() -> Iterator[tuple[str, Scene]]:
    """Names and scenes of rigid objects, each with other pads, friction and sheets."""
    for (label, (shape, stations)), pad, (thick, modulus) in zip(RIGID.items(), cycle(PADS), cycle(SHEETS)):
        sheet = (f"gripper.sheet_thickness_mm={thick}", f"gripper.sheet_modulus_gpa={modulus}")
        given = (f"candidates.stations_mm={stations}", "candidates.angles_deg=[0]", FORCES, *pad, *sheet)
        text = f"[object]\n{shape}\n[candidates]\nstations_mm = [0]\n[load]\nnormal_force_n = [1]\n"
        yield label, load_scene(shape, given) if shape.endswith(".toml") else parse_scene(text, label, given)


def rigid_rows() -> Iterator[Row]:
    """Every effect but the object's."""
    for label, scene in rigid_scenes():
        compliance = effects.sheet_level(scene).compliance
        plain = {"sheet": "rigid"}
        foam, plate = climb(scene, **plain), climb(scene, sheet="elastic")
        coupled = climb(scene, **plain, friction_pressure_coupling="tangential")
        coarse = scene.with_values({"gripper.elements": [12, 6, 4]})
        part, whole = climb(coarse, **plain), climb(coarse, **plain, model_size="full")
        for key, contacts in foam.items():
            name = f"{label}, place {key[0]}, {key[1]:g} N"
            yield from of_patch(name, contacts)
            if key in plate:
                yield "sheet", name, compliance, off(e_n(contacts), e_n(plate[key]))
            if key in coupled:
                left = max(effects.neglected_traction(c.state, scene.friction.mu) for c in contacts)
                yield "friction-pressure coupling", name, left, off(e_n(contacts), e_n(coupled[key]))
            if key in part and key in whole:
                yield EXACT, name, 0.0, off(e_n(part[key]), e_n(whole[key]))


def wall_rows() -> Iterator[Row]:
    """The object's compliance; the level that is chosen at each force by itself."""
    for label, (file, thickness, modulus, stations, forces) in WALLS.items():
        stiff = (f"object.young_modulus_gpa={modulus}", "object.wall_poisson_ratio=0.38")
        material = (f"object.{thickness}", 'object.wall_material="custom"', *stiff)
        where = (f"candidates.stations_mm={stations}", "candidates.angles_deg=[0]", f"load.normal_force_n={forces}")
        scene = load_scene(file, (*material, *where, *COARSE))
        rigid, linear, shell = (climb(scene, object=level) for level in ("rigid", "linear_shell", "nonlinear_shell"))
        for force in scene.load.normal_force:
            for n, solving in enumerate(solvers(scene.with_values({"load.normal_force_n": [force]}))):
                key, name, level = (n, force), f"{label}, place {n}, {force:g} N", solving.level
                if key in shell and key in rigid:
                    yield "object: rigid or shell", name, level.share, off(e_n(rigid[key]), e_n(shell[key]))
                if key in shell and key in linear:
                    yield SHELLS, name, level.indicator, off(e_n(linear[key]), e_n(shell[key]))


def of_effect(rows: list[Row], effect: str) -> tuple[np.ndarray, np.ndarray]:
    """Indicators and errors of an effect."""
    x, error = np.array([row[2:] for row in rows if row[0] == effect], float).reshape(-1, 2).T
    return x, error


def summary(rows: list[Row]) -> Iterator[str]:
    """One line for each effect."""
    for effect, (limit, _) in PANELS.items():
        x, error = of_effect(rows, effect)
        skipped = x <= limit
        wrong, worst = np.count_nonzero(error[skipped] > TARGET), error[skipped].max(initial=0.0)
        yield (f"{effect}: {len(x)} cases, {np.count_nonzero(skipped)} skipped, {wrong} of them wrongly, largest error"
               f" when skipped {worst:.2%}, largest of all {error.max(initial=0.0):.1%}")  # fmt: skip
    _, error = of_effect(rows, EXACT)
    yield f"{EXACT}: {len(error)} cases, largest difference from the whole {error.max(initial=0.0):.1e}"
    for level in SURFACES:
        error = [row[3] for row in rows if row[0] == "limit surface" and row[1].endswith(level)] or [np.nan]
        yield f"quality with {level}: off by {min(error):.2%} to {max(error):.1%}, on average {np.mean(error):.2%}"


def draw(rows: list[Row]) -> bytes:
    """Indicator against error, one panel for each effect, as PNG."""
    with pictures.style():
        drawn, axes = pictures.figure(12, 6.4, 2, 4, gap=0.1)
        for panel, (effect, (limit, text)) in zip(axes.ravel(), PANELS.items(), strict=False):
            x, error = of_effect(rows, effect)
            x, error = np.clip(x, LEAST, MOST), np.maximum(error, FLOOR)
            low, high, skipped = 0.5 * x.min(), 2.0 * max(x.max(), limit), x <= limit
            panel.axhline(TARGET, color="#566069", lw=0.9, ls="--")
            if limit:
                panel.fill_between([low, limit], TARGET, 10, color="#c05a00", alpha=0.18, lw=0)
                panel.axvline(limit, color="#566069", lw=0.9)
            shape = np.array([SURFACES.get(row[1].split(", ")[-1], "o") for row in rows if row[0] == effect])
            for some, look in ((skipped, {"color": "#12436d"}), (~skipped, {"mec": "#12436d", "mfc": "none"})):
                for marker in SURFACES.values():
                    panel.plot(x[some & (shape == marker)], error[some & (shape == marker)], marker, ms=3.2, **look)
            wrong = np.count_nonzero(error[skipped] > TARGET)
            told = f"{np.count_nonzero(skipped)} of {len(x)} {WORDS.get(effect, 'skipped')}, {wrong} wrongly"
            panel.set(xscale="log", yscale="log", xlim=(low, high), ylim=(0.7 * FLOOR, 2), xlabel=text,
                      title=f"{effect}\n{told if limit else 'never skipped'}")  # fmt: skip
        for panel in axes[:, 0]:
            panel.set(ylabel="relative error where skipped")
        axes[1, 2].set(ylabel="error of the quality")
        axes[1, 3].axis("off")
        axes[1, 3].text(0.0, 0.95, LEGEND, va="top", linespacing=1.5, transform=axes[1, 3].transAxes)
        return pictures.as_png(drawn)


def table(file: Path, parts: list[str]) -> None:
    """Solve all cases and write a row for each as it is done."""
    file.parent.mkdir(parents=True, exist_ok=True)
    with file.open("w", newline="") as stream:
        out = csv.writer(stream)
        out.writerow(("effect", "case", "indicator", "error"))
        for part in parts:
            for row in PARTS[part]():
                out.writerow((*row[:2], f"{row[2]:.4g}", f"{row[3]:.3g}"))
                stream.flush()


PARTS = {"rigid": rigid_rows, "walls": wall_rows}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Indicators of effects against true errors.")
    parser.add_argument("table", type=Path, help="CSV with a row for each case; written without -o, read with it")
    parser.add_argument("-o", dest="out", type=Path, help="PNG to write")
    parser.add_argument("--only", choices=PARTS, help="leave the other cases out")
    given = parser.parse_args()
    if given.out is None:
        table(given.table, [given.only] if given.only else list(PARTS))
    with given.table.open(newline="") as stream:
        found: list[Row] = [(e, c, float(x), float(y)) for e, c, x, y in list(csv.reader(stream))[1:]]
    print("\n".join(summary(found)))
    if given.out is not None:
        given.out.write_bytes(draw(found))
