"""Answers of ``check`` and ``plan``: what a scene means and what it will take."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from study.layout import Layout
from study.plan import Plan, makespan, memory, sensible_ranks, unit_seconds
from study.progress import duration


def scene_text(scene: Any, file: str) -> str:
    """What would be run, in a few lines."""
    c, g, o = scene.candidates, scene.gripper, scene.object
    name = f" '{o.name}'" if getattr(o, "name", None) else ""
    where = (
        f"{c.count} explicit poses"
        if c.poses
        else f"{c.count}: {_list([*c.station_values_mm], 'mm')} along the axis, {_list(c.angles_deg, 'deg')} about it"
    )
    size = " x ".join(f"{1e3 * s:g}" for s in g.pad_size)
    mesh = " x ".join(map(str, g.elements))
    levels = [f"{key} {value}" for key, value in scene.effects.model_dump().items()]
    rows = {
        "object": f"{o.shape}{name}",
        "candidates": where,
        "forces": _list(scene.load.normal_force_n, "N"),
        "friction": f"mu = {scene.friction.mu:g}; curved, flat and projected",
        "sweep": "; ".join(f"{key}: {_list(values)}" for key, values in scene.sweep.items()),
        "cases": str(scene.cases),
        "pad": f"{size} mm, {g.material}, {g.shear_modulus_kpa:g} kPa, {mesh} elements ({g.element})",
        "accuracy": "every case on two meshes" if scene.accuracy.meshes > 1 else "one mesh, no error maps",
        "effects": ", ".join(levels),
        "petsc": " ".join(f"-{key} {value}" for key, value in scene.petsc.items()),
        "results": scene.output.file,
    }
    warnings = [f"warning: {text}" for text in scene.warnings]
    return "\n".join([f"{file}: no errors", *_aligned(rows), *warnings])


def plan_text(plan: Plan, scene: Any, path: Path, ranks: int) -> str:
    """Cases, units, disk, memory and time on so many ranks."""
    layout = plan.layout
    each = memory(scene)
    forces = layout.shape[-1]
    shared = plan.served - len(plan.units)
    symmetric = f", {shared} candidates are images of others by symmetry" if shared else ""
    space = f"{layout.nbytes / 1e6:.1f} MB in {path}"
    free = _free(path)
    rows = {
        "cases": f"{layout.rows} = {' x '.join(map(str, layout.shape))} ({', '.join(layout.names)})",
        "units": f"{len(plan.units)} ladders of {forces} forces{symmetric}",
        "disk": f"{space}, {free / 1e9:.1f} GB free" if free >= 0 else space,
        "memory": f"roughly {each / 1e9:.1g} GB on each rank, {each * ranks / 1e9:.2g} GB on {ranks}",
        "time": _time(plan, path, ranks),
        "ranks": f"up to {sensible_ranks(plan.costs)} are busy at least 80 % of the time",
    }
    return "\n".join(_aligned(rows))


def _time(plan: Plan, path: Path, ranks: int) -> str:
    seconds = _seconds(plan.layout, path)
    expected = unit_seconds(plan, seconds) if seconds is not None else []
    if not expected:
        return f"not known before a few ladders are in {path}: start the run, then plan again"
    whole = duration(makespan(expected, ranks))
    return f"about {whole} on {ranks} ranks for all cases, judged by those in {path}"


def _seconds(layout: Layout, path: Path) -> Any:
    if not path.is_file():
        return None
    from study.store import open_result

    with open_result(path) as result:
        return result.work("seconds_total").ravel() if result.layout.shape == layout.shape else None


def _free(path: Path) -> int:
    for folder in path.absolute().parents:
        if folder.is_dir():
            return shutil.disk_usage(folder).free
    return -1


def _list(values: Sequence[Any], unit: str = "") -> str:
    texts = [f"{v:g}" if isinstance(v, float) else str(v) for v in values]
    if len(texts) > 6:
        texts = [*texts[:2], "...", texts[-1], f"({len(values)} values)"]
        return f"{', '.join(texts[:-1])} {unit} {texts[-1]}".replace("  ", " ")
    return f"{', '.join(texts)} {unit}".rstrip()


def _aligned(rows: dict[str, str]) -> list[str]:
    return [f"  {name:<10}  {text}" for name, text in rows.items() if text]
