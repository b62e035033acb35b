"""``softjaw cost``: what accuracy costs in time, by an ordinary sweep over meshes; its table and its picture."""

from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from softjaw.friction.patch import FloatArray
from softjaw.study import pictures
from softjaw.study.case.build import has_wall
from softjaw.study.quantities import BY_KEY
from softjaw.study.result.read import axes_of, values_of
from softjaw.study.scene import Scene, parse_scene
from softjaw.study.table import aligned

FINENESS = (0.5, 0.7, 1.0, 1.4)  # elements per direction over those of the scene
WALL_SIZES = (2.0, 1.0, 0.7)  # of a wall's elements, over those of the scene
REPRESENTATIVE = 3  # candidates, and forces, that stand for all
SMALLEST = ("accuracy.wall_element_mm", "object.grid_step_mm")  # whose smallest value is the best; else the last
JUDGED = ("payload", "quality", "e_n", "indentation", "wall_stress")
LOOKS = (("#12436d", "o"), ("#c05a00", "s"), ("#2a8c82", "^"), ("#801650", "D"))


def cost_scene(scene: Scene) -> Scene:
    """The scene whose results tell the cost: a few of its cases, with its own sweep or one over meshes."""
    plain: dict[str, Any] = dict.fromkeys(("accuracy.target", "candidates.refine"))
    forces, last = scene.load.normal_force_n, len(scene.load.normal_force_n) - 1
    plain["load.normal_force_n"] = [forces[i] for i in sorted({0, last // 2, last})]
    plain |= {"uncertainty.spread": {}, "run.patches": "none"}
    few = scene.with_values(plain | _few_candidates(scene))
    return Scene.of_tables({**few.effective(), "sweep": dict(scene.sweep) or mesh_sweep(scene)})


def _few_candidates(scene: Scene) -> dict[str, Any]:
    """Candidates at the middles of equal parts of all, each at the first angle."""
    where = scene.candidates
    poses = scene.effective()["candidates"].get("poses", ())
    places = list(poses or where.station_values_mm)
    count = min(REPRESENTATIVE, len(places))
    chosen = [places[int((i + 0.5) / count * len(places))] for i in range(count)]
    if poses:
        return {"candidates.poses": chosen}
    given = {"stations": None, "stations_mm": chosen, "angles_deg": where.angles_deg[:1]}
    return {f"candidates.{key}": value for key, value in given.items()}


def mesh_sweep(scene: Scene) -> dict[str, Any]:
    """Meshes of the pads with both kinds of elements, or with meshes of a wall that may be simulated."""
    length, width, thickness = scene.gripper.elements
    # even along length and width, so that symmetric halves can be meshed
    meshes = [(_even(f * length), _even(f * width), max(2, round(f * thickness))) for f in FINENESS]
    meshes[FINENESS.index(1.0)] = scene.gripper.elements
    sweep: dict[str, Any] = {"gripper.elements": list(dict.fromkeys(meshes))}
    if has_wall(scene.object) and scene.effects.object != "rigid":
        # 10 mm are the largest that the key takes
        sizes = [min(f * scene.accuracy.wall_element_mm, 10.0) for f in WALL_SIZES]
        return sweep | {"accuracy.wall_element_mm": list(dict.fromkeys(sizes))}
    return sweep | {"gripper.element": ["hex8", "hex27"]}


def _even(count: float) -> int:
    return max(2, 2 * round(count / 2))


# --- what a file says -------------------------------------------------------------------------------------------------


class Setting(NamedTuple):
    """One point of the sweep.

    ``values``: value of each swept key, in words. ``seconds``: time of a case on one core, mean over those that are
    solved [s]. ``worst``: for each of `JUDGED` the largest relative distance from the reference; ``stated``: the
    largest error that the results state; NaN where none is known. ``failed``: cases without a result. ``given,
    reference``: whether it is what the scene has without the sweep, and whether it is the most accurate point.
    """

    values: dict[str, str]
    seconds: float
    worst: dict[str, float]
    stated: dict[str, float]
    failed: int
    given: bool
    reference: bool


def settings_in(ds: xr.Dataset) -> list[Setting]:
    """Every point of the sweep of a file, in its order."""
    scene, swept = parse_scene(ds.attrs["scene"], check_files=False), axes_of(ds)[:-3]
    shape = ds.status.shape[: len(swept)]
    seconds = _by_point(ds, BY_KEY["work/seconds_total"].variable)
    maps = {name: _by_point(ds, name) for name in JUDGED if name in ds}
    best = tuple(0 if axis.long_name in SMALLEST else length - 1 for axis, length in zip(swept, shape, strict=True))
    last = int(np.ravel_multi_index(best, shape))
    worst = {n: _largest(np.abs(values - values[last]) / np.abs(values[last])) for n, values in maps.items()}
    unknown = np.full(len(seconds), np.nan)
    stated = {n: _largest(_by_point(ds, f"{n}_error")) if f"{n}_error" in ds else unknown for n in maps}
    means, failed = seconds.mean(axis=1).filled(np.nan), np.ma.count_masked(seconds, axis=1)
    settings = []
    for i, index in enumerate(np.ndindex(shape)):
        values = {axis.long_name: scene.sweep[axis.long_name][j] for axis, j in zip(swept, index, strict=True)}
        words = {a.long_name: a.options[j] if a.options else f"{values[a.long_name]:g}"
                 for a, j in zip(swept, index, strict=True)}  # fmt: skip
        errors, claims = ({n: float(each[i]) for n, each in by_name.items()} for by_name in (worst, stated))
        given = scene.with_values(values) == scene.with_values({})
        settings.append(Setting(words, float(means[i]), errors, claims, int(failed[i]), given, i == last))
    return settings


def _by_point(ds: xr.Dataset, name: str) -> Any:
    """A map ``(points, cases)``, masked where it has no finite value."""
    return np.ma.masked_invalid(values_of(ds, name).reshape(-1, int(np.prod(ds.status.shape[-3:]))))


def _largest(values: Any) -> FloatArray:
    """The largest value at each point, NaN where there is none."""
    return np.ma.max(values, axis=1).filled(np.nan)


def percent(error: float) -> str:
    """A relative error in two digits.

    >>> percent(0.0213), percent(3e-8), percent(float("nan"))
    ('2.1 %', '< 0.0001 %', '-')
    """
    shown = f"{100 * error:.2g} %" if error >= 1e-6 else "< 0.0001 %"
    return shown if np.isfinite(error) else "-"


def cost_text(ds: xr.Dataset) -> str:
    """The settings, the cheapest first, with time and errors; one line for each."""
    settings = settings_in(ds)
    names, reference = list(settings[0].worst), next(s for s in settings if s.reference)
    head = (*settings[0].values, "time per case", *names, "")
    rows = [
        (*s.values.values(), f"{s.seconds:.2g} s", *(f"{percent(s.worst[n])} ({percent(s.stated[n])})" for n in names),
         ", ".join([*["as in the scene"] * s.given, *[f"{s.failed} failed"] * bool(s.failed)]))
        for s in sorted(settings, key=lambda s: s.seconds)
        if not s.reference
    ]  # fmt: skip
    lines = aligned(head, rows, range(len(head)))
    last = ", ".join(f"{key} = {value}" for key, value in reference.values.items())
    about = f"largest error of {ds.status.size // len(settings)} cases (in brackets the largest stated), against {last}"
    return "\n".join([*lines, f"{about}, which takes {reference.seconds:.2g} s"])


def cost_picture(ds: xr.Dataset) -> bytes:
    """Largest errors over the time of a case, a line for each value of the last axis; the scene's own is ringed.

    Dashes and hollow marks are the largest errors that the results state themselves.
    """
    settings = [s for s in settings_in(ds) if not s.reference]
    names, last = list(settings[0].worst), list(settings[0].values)[-1]
    seconds = [s.seconds for s in settings]
    with pictures.style():
        drawn, axes = pictures.figure(3.4 * len(names), 3.2, 1, len(names))
        for plot, name in zip(axes[0], names, strict=True):
            for k, value in enumerate(dict.fromkeys(s.values[last] for s in settings)):
                along, (colour, marker) = [s for s in settings if s.values[last] == value], LOOKS[k % len(LOOKS)]
                line = [(s.seconds, s.worst[name]) for s in along if s.worst[name] > 0]
                plot.plot(*np.transpose(line or [(np.nan, np.nan)]), color=colour, marker=marker, label=value)
                claimed = [(s.seconds, s.stated[name]) for s in along]
                plot.plot(*np.transpose(claimed), "--", lw=1, marker=marker, mfc="none", color=colour)
            given = [(s.seconds, s.worst[name]) for s in settings if s.given and s.worst[name] > 0]
            if given:
                plot.plot(*np.transpose(given), "o", ms=11, mfc="none", color="black", label="as in the scene")
            plot.set(yscale="log", xlabel="time per case [s]", title=f"largest error of {name} (hollow: stated)")
            if max(seconds) > 5 * min(seconds):  # over less, a logarithmic axis has no room for its labels
                pictures.logarithmic(plot)
        named = axes[0][-1].get_legend_handles_labels()
        drawn.legend(*named, loc="outside lower center", ncols=4, title=last, frameon=False)
        return pictures.as_png(drawn)
