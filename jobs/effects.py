"""What choosing effects is worth: wrong skips and effects taken without need, table and picture.

    python jobs/effects.py results/effects.csv                    solve every case at both levels of every effect
    python jobs/effects.py results/effects.csv --only friction    a part of it, of friction, plates, patches, walls
    python jobs/effects.py results/effects.csv -o effects.png     draw the table that is there and print its summary

A part replaces its own rows of the table and leaves the others. A skip is wrong where the effect moves e_n by more than
2 %, twice the target of `auto`; an effect is taken without need where it moves e_n by less than 1 %.
"""

from __future__ import annotations

import argparse
import csv
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from functools import partial
from itertools import chain, cycle
from pathlib import Path

import numpy as np

from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.wrench import friction_wrench
from softjaw.scoring.contact import PolytopeBody
from softjaw.study import pictures
from softjaw.study.case import effects
from softjaw.study.case.candidates import units
from softjaw.study.case.contact import Contact
from softjaw.study.case.effects import COUPLING as COUPLED
from softjaw.study.case.effects import EffectChoice
from softjaw.study.case.limit_surface import SurfaceFit, fit_surface
from softjaw.study.case.solver import CandidateSolver
from softjaw.study.quantities import E_N_TARGET, EFFECTS
from softjaw.study.scene import Scene, load_scene, parse_scene
from softjaw.study.scene.sections import LimitSurfaceKeys

TARGET, WRONG = E_N_TARGET, 2.0 * E_N_TARGET  # relative errors of e_n: what `auto` aims at, and a wrong skip
FLOOR, LEAST, MOST = 1e-6, 1e-5, 100.0  # errors, and indicators, beyond are drawn there
HULL = 3000  # motions whose wrenches stand for the limit surface itself
ROUND = 'shape = "elliptic_cylinder"\nsemi_axis_a_mm = {}\nsemi_axis_b_mm = {}\nlength_mm = 160'
TURNED = 'shape = "revolution"\nprofile_mm = {}'
RIGID = {  # object, or the file of a scene, and stations
    **{f"ball {r} mm": (f'shape = "sphere"\nradius_mm = {r}', "[0]") for r in (15, 25, 40, 80)},
    **{f"cylinder {a} x {b} mm": (ROUND.format(a, b), "[0]")
       for a, b in ((8, 8), (14, 14), (25, 20), (20, 40), (60, 60), (30, 15))},
    "box": ('shape = "box"\nsize_mm = [50, 40, 120]\nedge_radius_mm = 4', "[0]"),
    "rounded box": ('shape = "box"\nsize_mm = [40, 30, 100]\nedge_radius_mm = 12', "[0, 30]"),
    "flask": ("jobs/flask-mesh.toml", "[40, 70, 90]"),
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
PLATES = ((2.0, 200.0), (1.0, 5.0), (0.53, 200.0), (2.0, 3.0), (1.0, 70.0))  # mm, GPa
CUP, BOTTLE = "jobs/cup.toml", "jobs/bottle.toml"
WALLS = {  # file, wall, modulus [GPa], stations, forces
    **{f"cup {t} mm, {E} GPa": (CUP, f"wall_mm=[[0, {t}], [110, {t}]]", E, "[50]", "[0.5, 2, 4]")
       for t, E in ((0.45, 1.3), (1.0, 1.3), (1.0, 10), (1.0, 70))},
    **{f"bottle {t} mm, {E} GPa": (BOTTLE, f"wall_mm={t}", E, "[50, 70, 150]", "[1, 3, 7, 13]")
       for t, E in ((0.4, 2.0), (0.8, 2.0), (0.8, 20), (1.5, 20), (1.5, 70))},
}  # fmt: skip
COARSE = ("accuracy.wall_element_mm=4",
          "gripper.elements=[10, 6, 4]", 'accuracy.contact="weighted"')  # fmt: skip
SHELL, SHELLS, COUPLING = "object: rigid or shell", "object: linear or nonlinear shell", "friction acting back"
PANELS = {  # of an effect: indicator up to which it is skipped without a measurement, and what the axis says
    SHELL: (effects.STIFF_WALL, "indentation / closing displacement"),
    SHELLS: (effects.SMALL_INDENTATION, "indentation / wall thickness"),
    "sheet": (effects.STIFF_PLATE, "compliance over that of the pad"),
    COUPLING: (effects.SMALL_TRACTION, "traction left out / pressure"),
    "friction": (0.0, "1 - F_N / S"),
    "limit surface": (0.0, "radial fit error"),  # quality, not e_n; the quartic is never skipped
}
EXACT = "model size"
PLAIN = {"object": "rigid", "sheet": "rigid", COUPLED: "none"}
SURFACES = {"three_motions": "s", "full": "^", "quartic": "o"}  # and how they are drawn
LEGEND = """filled: skipped by auto; open: taken
upright line: indicator up to which auto skips
without a look at the coarse mesh
dashed line: 2 %, twice the target
shaded: filled marks there are wrong skips
friction: planar model (auto is always curved)
limit surface: from three motions (squares),
fitted ellipsoids (triangles), quartics (circles)"""
Row = tuple[str, str, float, float, int, float]  # effect, case, indicator, measured change, whether taken, error


def at_levels(scene: Scene, **levels: str) -> Scene:
    """The scene with these levels of its effects."""
    return scene.with_values({f"effects.{name}": level for name, level in levels.items()})


def choices(scene: Scene) -> Iterator[EffectChoice]:
    """Levels of the effects of a scene's candidates."""
    for unit in units(scene):
        solver = CandidateSolver(scene, unit.candidate.poses)
        yield EffectChoice(solver)
        solver.put_away()


def contacts_at(scene: Scene, **levels: str) -> dict[tuple[int, float], Sequence[Contact]]:
    """Contacts by candidate and force where there is a solution; effects that are not named are left out."""
    contacts: dict[tuple[int, float], Sequence[Contact]] = {}
    for n, choice in enumerate(choices(at_levels(scene, **(PLAIN | levels)))):
        for k, force in enumerate(choice.solver.forces):
            with suppress(ConvergenceError, CheckError):
                contacts[n, force] = choice.case(k).fine.contacts
    return contacts


def e_n(contacts: Sequence[Contact], friction: str = "ccm") -> float:
    """e_n of the weaker finger [m]."""
    return min(c.limits[friction].e_n for c in contacts)


def off(low: float, high: float) -> float:
    """Relative error of a cheap level's value."""
    return abs(low / high - 1.0)


def volume(contact: Contact, found: SurfaceFit) -> float:
    """Quality of two such contacts face to face with a fitted surface over that with the exact one."""
    w = friction_wrench(contact.local, fibonacci_twists(HULL, contact.rho), 1.0)[:, [0, 1, 5]]
    exact = PolytopeBody(np.vstack([w, -w]) / contact.limits["ccm"].S / [1, 1, contact.rho])
    return found.surface.volume * found.surface.shadow_area / (exact.volume * exact.shadow_area)


def of_patch(name: str, contacts: Sequence[Contact]) -> Iterator[Row]:
    """Effects that are chosen when the contact is solved."""
    S, F_N = (sum(getattr(c.limits["ccm"], value) for c in contacts) for value in ("S", "F_N"))
    yield "friction", name, 1.0 - F_N / S, np.nan, 1, off(e_n(contacts, "pcm"), e_n(contacts))
    c = contacts[0]
    for level in SURFACES:
        found = fit_surface(c, "ccm", LimitSurfaceKeys.model_validate({"model": level}))
        yield "limit surface", f"{name}, {level}", found.fit_error_own.Erad, np.nan, 1, off(volume(c, found), 1.0)


def rigid_scenes() -> Iterator[tuple[str, Scene]]:
    """Names and scenes of rigid objects, each with other pads, friction and backing plates."""
    for (label, (shape, stations)), pad, (thick, modulus) in zip(RIGID.items(), cycle(PADS), cycle(PLATES)):
        sheet = (f"gripper.sheet_thickness_mm={thick}", f"gripper.sheet_modulus_gpa={modulus}")
        given = (f"candidates.stations_mm={stations}", "candidates.angles_deg=[0]", FORCES, *pad, *sheet)
        text = f"[object]\n{shape}\n[candidates]\nstations_mm = [0]\n[load]\nnormal_force_n = [1]\n"
        yield label, load_scene(shape, given) if shape.endswith(".toml") else parse_scene(text, label, given)


def named(label: str, n: int, force: float) -> str:
    """Name of a case."""
    return f"{label}, place {n}, {force:g} N"


def chosen_rows(effect: str, name: str, cheap: str, dear: str, without: dict[str, str]) -> Iterator[Row]:
    """An effect as it is chosen between two levels at every force, where those in ``without`` are left out."""
    for label, scene in rigid_scenes():
        free, taking = contacts_at(scene), contacts_at(scene, **{effect: dear})
        for n, choice in enumerate(choices(at_levels(scene, **without))):
            for k, force in enumerate(choice.solver.forces):
                level = choice.level(effect, k)
                if (n, force) in free and (n, force) in taking:
                    error, taken = off(e_n(free[n, force]), e_n(taking[n, force])), int(level.level != cheap)
                    yield name, named(label, n, force), level.indicator, level.change, taken, error


def patch_rows() -> Iterator[Row]:
    """Effects whose choice costs nothing."""
    for label, scene in rigid_scenes():
        coarse = at_levels(scene.with_values({"gripper.elements": [12, 6, 4]}), **PLAIN)
        part, whole = contacts_at(coarse), contacts_at(coarse, model_size="full")
        for key, contacts in contacts_at(scene).items():
            yield from of_patch(named(label, *key), contacts)
            if key in part and key in whole:
                yield EXACT, named(label, *key), 0.0, np.nan, 0, off(e_n(part[key]), e_n(whole[key]))


def wall_rows() -> Iterator[Row]:
    """The object's compliance; the level that is chosen at each force by itself."""
    for label, (file, thickness, modulus, stations, forces) in WALLS.items():
        stiff = (f"object.young_modulus_gpa={modulus}", "object.wall_poisson_ratio=0.38")
        material = (f"object.{thickness}", 'object.wall_material="custom"', *stiff)
        where = (f"candidates.stations_mm={stations}", "candidates.angles_deg=[0]", f"load.normal_force_n={forces}")
        scene = load_scene(file, (*material, *where, *COARSE))
        rigid, linear, shell = (
            contacts_at(scene, object=level) for level in ("rigid", "linear_shell", "nonlinear_shell")
        )
        for force in scene.load.normal_force:
            alone = at_levels(scene.with_values({"load.normal_force_n": [force]}), **(PLAIN | {"object": "auto"}))
            for n, choice in enumerate(choices(alone)):
                key, name, level = (n, force), named(label, n, force), choice.level("object", 0)
                number = EFFECTS["object"].index(level.level)
                if key in shell and key in rigid:
                    change = level.change if number < 2 else np.nan
                    yield (SHELL, name, choice.indentation[0], change, int(number > 0),
                           off(e_n(rigid[key]), e_n(shell[key])))  # fmt: skip
                if key in shell and key in linear and number > 0:
                    error = off(e_n(linear[key]), e_n(shell[key]))
                    yield SHELLS, name, choice.indentation[1], level.change, int(number > 1), error


def of_effect(rows: list[Row], effect: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Indicators, whether the effect was taken, and errors of the cheaper level."""
    own = np.array([row[2:] for row in rows if row[0] == effect], float).reshape(-1, 4)
    return own[:, 0], own[:, 2] > 0, own[:, 3]


def summary(rows: list[Row]) -> Iterator[str]:
    """One line for each effect."""
    for effect in PANELS:
        x, taken, error = of_effect(rows, effect)
        wrong, unneeded = np.count_nonzero(error[~taken] > WRONG), np.count_nonzero(error[taken] < TARGET)
        yield (f"{effect}: {len(x)} cases, {np.count_nonzero(taken)} taken, {unneeded} of them without need, {wrong}"
               f" wrong skips, largest error when skipped {error[~taken].max(initial=0.0):.2%}, largest of all"
               f" {error.max(initial=0.0):.1%}")  # fmt: skip
    _, _, error = of_effect(rows, EXACT)
    yield f"{EXACT}: {len(error)} cases, largest difference from the whole {error.max(initial=0.0):.1e}"
    for level in SURFACES:
        off_by = [row[5] for row in rows if row[0] == "limit surface" and row[1].endswith(level)] or [np.nan]
        yield f"quality with {level}: off by {min(off_by):.2%} to {max(off_by):.1%}, on average {np.mean(off_by):.2%}"


def draw(rows: list[Row]) -> bytes:
    """Indicator against error, one panel for each effect, as PNG."""
    with pictures.style():
        drawn, axes = pictures.figure(12, 6.4, 2, 4, gap=0.1)
        for panel, (effect, (limit, text)) in zip(axes.ravel(), PANELS.items(), strict=False):
            x, taken, error = of_effect(rows, effect)
            x, error, skipped = np.clip(x, LEAST, MOST), np.maximum(error, FLOOR), ~taken
            low, high = 0.5 * x.min(initial=MOST), 2.0 * max(x.max(initial=LEAST), limit)
            panel.axhline(WRONG, color="#566069", lw=0.9, ls="--")
            if limit:
                panel.fill_between([low, high], WRONG, 10, color="#c05a00", alpha=0.18, lw=0)
                panel.axvline(limit, color="#566069", lw=0.9)
            shape = np.array([SURFACES.get(row[1].split(", ")[-1], "o") for row in rows if row[0] == effect])
            for some, look in ((skipped, {"color": "#12436d"}), (~skipped, {"mec": "#12436d", "mfc": "none"})):
                for marker in SURFACES.values():
                    panel.plot(x[some & (shape == marker)], error[some & (shape == marker)], marker, ms=3.2, **look)
            wrong = np.count_nonzero(error[skipped] > WRONG)
            label = f"{np.count_nonzero(skipped)} of {len(x)} skipped, {wrong} wrongly"
            panel.set(xscale="log", yscale="log", xlim=(low, high), ylim=(0.7 * FLOOR, 2), xlabel=text,
                      title=f"{effect}\n{label if limit else 'never skipped'}")  # fmt: skip
        for panel in axes[:, 0]:
            panel.set(ylabel="relative error where skipped")
        axes[1, 1].set(ylabel="error of the quality")
        for panel in axes[1, 2:]:
            panel.axis("off")
        axes[1, 2].text(0.0, 0.95, LEGEND, va="top", linespacing=1.5, transform=axes[1, 2].transAxes)
        return pictures.as_png(drawn)


def read(file: Path) -> list[Row]:
    """Rows of a table, of none where there is no file."""
    if not file.exists():
        return []
    with file.open(newline="") as stream:
        rows = list(csv.reader(stream))[1:]
    return [(e, c, float(x), float(change), int(taken), float(y)) for e, c, x, change, taken, y in rows]


def table(file: Path, parts: list[str]) -> None:
    """Solve the cases of some parts and write a row for each as it is done; rows of other parts stay."""
    file.parent.mkdir(parents=True, exist_ok=True)
    gone = {effect for part in parts for effect in PARTS[part][1]}
    kept = [row for row in read(file) if row[0] not in gone]
    with file.open("w", newline="") as stream:
        out = csv.writer(stream)
        out.writerow(("effect", "case", "indicator", "change", "taken", "error"))
        for row in chain(kept, *(PARTS[part][0]() for part in parts)):
            out.writerow((*row[:2], f"{row[2]:.4g}", f"{row[3]:.4g}", row[4], f"{row[5]:.3g}"))
            stream.flush()


PARTS: dict[str, tuple[Callable[[], Iterator[Row]], tuple[str, ...]]] = {  # with the effects that each has rows of
    "friction": (partial(chosen_rows, COUPLED, COUPLING, "none", "tangential", {"sheet": "rigid"}), (COUPLING,)),
    "plates": (partial(chosen_rows, "sheet", "sheet", "rigid", "elastic", {COUPLED: "none"}), ("sheet",)),
    "patches": (patch_rows, ("friction", "limit surface", EXACT)),
    "walls": (wall_rows, (SHELL, SHELLS)),
}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="What choosing effects is worth: wrong skips, unneeded effects.")
    parser.add_argument("table", type=Path, help="CSV with a row for each case; written without -o, read with it")
    parser.add_argument("-o", dest="out", type=Path, help="PNG to write")
    parser.add_argument("--only", choices=PARTS, nargs="+", default=list(PARTS), help="leave the other parts out")
    given = parser.parse_args()
    if given.out is None:
        table(given.table, given.only)
    found = read(given.table)
    print("\n".join(summary(found)))
    if given.out is not None:
        given.out.write_bytes(draw(found))
