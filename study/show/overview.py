"""Answer of ``check``: what a scene means."""

from collections.abc import Sequence
from typing import Any

from softjaw.study.case.build import axis_span, geometry, has_wall, listed_accuracy
from softjaw.study.units import UNITS, shown

OPEN = {"top": "open top", "both": "open at both ends", "none": "closed top"}


def scene_text(scene: Any, file: str) -> str:
    """What would be run, in a few lines."""
    c, g, o = scene.candidates, scene.gripper, scene.object
    most = "at most " * bool(c.sampled)
    name = f" '{o.name}'" if getattr(o, "name", None) else ""
    where = "sampled grasps" if c.sampled else "explicit poses"
    if not c.poses and not c.sampled:
        where = f"at {listed([*c.station_values_mm], 'mm')} along the axis, {listed(c.angles_deg, 'deg')} about it"
    size = " x ".join(f"{shown(s, 'm'):g}" for s in g.pad_size)
    mesh = " x ".join(map(str, g.elements))
    inputs = ", ".join(f"{key} +- {width:g}" for key, width in scene.uncertainty.spread.items())
    limits = {"auto": "its rank's share of the free memory", "none": "any memory"}
    memory = limits.get(scene.run.memory_gb) or f"{scene.run.memory_gb:g} GB"
    levels = [f"{key} {value}" for key, value in scene.effects.model_dump().items()]
    rows = {
        "object": f"{o.shape}{name}{_extent(o)}",
        "mesh": getattr(o, "mesh", ""),  # the effective path, wherever the scene's leads
        "wall": wall_text(o),
        "mass": f"{o.mass_g:g} g, to be held {scene.task.safety:g} times over" if o.mass_g else "",
        "candidates": f"{most}{c.total} {where}",
        "forces": listed(scene.load.normal_force_n, "N"),
        "friction": f"mu = {scene.friction.mu:g}; CCM, PCM and PCM scaled by F_N",
        "sweep": "; ".join(f"{key}: {listed(values)}" for key, values in scene.sweep.items()),
        "cases": f"{most}{scene.cases}",
        "refinement": f"at most {c.refine} more cases, beside their images by symmetry" if c.refine else "",
        "pad": f"{size} mm, {g.material}, {g.shear_modulus_kpa:g} kPa, {mesh} elements ({g.element})",
        "accuracy": _meshes(listed_accuracy(scene), "those that may be the best" if c.sampled else "every case"),
        "intervals": f"from {inputs}; every case is solved {scene.uncertainty.samples} more times" if inputs else "",
        "effects": ", ".join(levels),
        "petsc": " ".join(f"-{key} {value}" for key, value in scene.petsc.items()),
        "each case": f"may take {scene.run.time_limit_s:g} s and {memory}; fails beyond that; the run continues",
    }
    return "\n".join([f"{file}: no errors", *aligned(rows)])


def _meshes(accuracy: Any, which: str) -> str:
    """On how many meshes the cases ``which`` are solved."""
    if accuracy.target is None:
        return f"{which} on two meshes" if accuracy.meshes > 1 else "one mesh, no error maps"
    goal = f"{accuracy.target_of} within {100 * accuracy.target:g} %"
    return f"{goal}: {which} on two meshes, on up to {accuracy.most_meshes} where the error asks for it"


def wall_text(shape: Any) -> str:
    """Thickness, material and support of an object's wall; empty for a rigid object."""
    if not has_wall(shape):
        return ""
    material, given = geometry().material_of(shape), shape.thicknesses_mm
    thickness = f"{min(given):g}" if min(given) == max(given) else f"{min(given):g} to {max(given):g}"
    yields = material.yield_strength and f"yields at {material.yield_strength / UNITS['mpa'].size:g} MPa"
    words = [
        f"{thickness} mm {shape.wall_material} ({material.young_modulus / UNITS['gpa'].size:g} GPa, "
        f"{yields or 'strength unknown'})",
        shape.support,
        OPEN[shape.open_ends],
        f"indentation up to {shape.allowed_dent_mm:g} mm allowed" if shape.allowed_dent_mm else "any indentation",
    ]
    return ", ".join(words)


def _extent(shape: Any) -> str:
    """Where the object begins and ends along its axis, and for a mesh what that is counted from."""
    span = axis_span(shape)
    if span is None:
        return ", unbounded along its axis"
    text = f", {span[0]:g} to {span[1]:g} mm along its axis"
    if shape.shape != "mesh":
        return text
    return f"{text} (the file's {shape.axis}, counted from the mesh's lowest point; x and y from the middle)"


def listed(values: Sequence[Any], unit: str = "") -> str:
    """Values with their unit; of many the first ones, the last one, and how many there are.

    >>> listed([1.0, 2.5], "mm"), listed([*range(9)])
    ('1, 2.5 mm', '0, 1, ..., 8 (9 values)')
    """
    texts, count = [f"{v:.5g}" if isinstance(v, float) else str(v) for v in values], len(values)
    texts = texts if count <= 6 else [*texts[:2], "...", texts[-1]]
    return f"{', '.join(texts)} {unit}".rstrip() + f" ({count} values)" * (count > 6)


def aligned(rows: dict[str, str]) -> list[str]:
    """One line for each row that says something."""
    return [f"  {name:<10}  {text}" for name, text in rows.items() if text]
