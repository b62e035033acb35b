"""What the sections of a scene must satisfy together, all checks in one list, and values that are seldom meant."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from pathlib import PurePosixPath, PureWindowsPath
from typing import Any

from softjaw.study.scene import grasp_checks as grasps
from softjaw.study.scene.objects import Shape, Walled
from softjaw.study.scene.problems import Finding, KeyPath, closest, shown
from softjaw.study.scene.sections import (
    Accuracy,
    Candidates,
    Effects,
    Friction,
    Gripper,
    LimitSurface,
    Load,
    Output,
    Task,
    Uncertainty,
)

MOST_CASES, MOST_ELEMENTS, LARGEST_ASPECT = 1_000_000, 1_000_000, 20.0
ROUNDING = 1e-9  # of a length: fem.pad.backing_plate finds nodes this close to the support's rim on it, too
LEVELS = {  # level of the effect: models of [limit_surface]
    "three_motions": ("three_motions",), "fitted_ellipsoid": ("full", "axis_aligned"), "quartic": ("quartic",),
}  # fmt: skip
PROGRAMMES = ("full", "quartic")  # models that can be fitted by a programme too
OTHERS = "others go into the environment variable PETSC_OPTIONS"


def _coupling(shape: Shape, effects: Effects) -> Iterator[Finding]:
    """Friction acts back on pads that press on rigid objects."""
    if effects.friction_pressure_coupling != "tangential":
        return
    where = ("effects", "friction_pressure_coupling")
    if isinstance(shape, Walled) and shape.wall is not None and effects.object != "rigid":
        found, remedy = '"tangential" with a thin wall', 'write object = "rigid" in [effects], or "none" here'
        yield Finding(where, found, "a rigid object", remedy)


def _named(path: KeyPath, wanted: Any, candidates: Candidates) -> Iterator[Finding]:
    """Numbers and labels that no candidate has, in a list of candidates."""
    labels = candidates.labels
    numbers = f"0 to {len(labels) - 1}"
    for i, name in enumerate(wanted if isinstance(wanted, tuple) else ()):
        if isinstance(name, int) and not 0 <= name < len(labels):
            remedy = "numbers count stations, then angles"
            yield Finding((*path, i), f"{name}", f"a candidate's number, {numbers}", remedy)
        elif isinstance(name, str) and name not in labels:
            near = closest(name, labels)
            remedy = f"did you mean {shown(near)}?" if near else f"write the candidate's number, {numbers}"
            yield Finding((*path, i), shown(name), f"a candidate's label, as {shown(labels[0])}", remedy)


def _pad_mesh(gripper: Gripper, effects: Effects) -> Iterator[Finding]:
    """Symmetric halves need even counts; slivers and meshes beyond any memory are slips."""
    n, counts = gripper.elements, ("gripper", "elements")
    odd = [i for i in (0, 1) if n[i] % 2]
    if odd and effects.model_size != "full":
        even = [k + k % 2 if i < 2 else k for i, k in enumerate(n)]
        expected = "even numbers along length and width, so that symmetric halves can be meshed"
        yield Finding(counts, f"{list(n)}", expected, f'write {even}, or effects.model_size = "full"')
    for i in odd:
        if gripper.grading[i] != 1:
            path, found = ("gripper", f"grading_{'xy'[i]}"), f"{gripper.grading[i]:g} with {n[i]} elements"
            expected = "an even number of elements where they are graded"
            yield Finding(path, found, expected, "write 1.0, or even elements")
    if math.prod(n) > MOST_ELEMENTS:
        found, expected = f"{list(n)}, which is {math.prod(n):,} elements", f"at most {MOST_ELEMENTS:,} elements"
        yield Finding(counts, found, expected, "start with [20, 10, 6]")
    edges = _element_edges(gripper)
    if max(map(max, edges)) > LARGEST_ASPECT * min(map(min, edges)):
        sizes = " x ".join(f"{low:.3g}" if low == high else f"{low:.3g}..{high:.3g}" for low, high in edges)
        size = (gripper.pad_length_mm, gripper.pad_width_mm, gripper.pad_thickness_mm)
        h = (math.prod(size) / math.prod(n)) ** (1 / 3)
        better = [max(2, 2 * round(s / h / 2)) for s in size]
        found = f"{list(n)}, which makes elements of {sizes} mm"
        expected = f"edges that differ by a factor of {LARGEST_ASPECT:g} at most"
        yield Finding(counts, found, expected, f"try {better} without grading")


def _element_edges(gripper: Gripper) -> list[tuple[float, float]]:
    """Smallest and largest element edge along x, y and z [mm]."""
    sizes = (gripper.pad_length_mm / 2, gripper.pad_width_mm / 2, gripper.pad_thickness_mm)
    counts = (gripper.elements[0] // 2, gripper.elements[1] // 2, gripper.elements[2])
    edges = []
    for size, n, ratio in zip(sizes, counts, gripper.grading, strict=True):
        steps = [ratio ** (i / (n - 1)) for i in range(n)] if n > 1 else [1.0]
        edges.append((min(steps) / sum(steps) * size, max(steps) / sum(steps) * size))
    return edges


def _backing_plate(gripper: Gripper, effects: Effects, accuracy: Accuracy) -> Iterator[Finding]:
    """The finger holds the backing plate by at least one node of every mesh; with even counts one is in the middle."""
    if effects.sheet == "rigid":
        return
    counts = [gripper.elements[:2], [-(-n // 2) for n in gripper.elements[:2]]][: accuracy.meshes]
    size = gripper.pad_length_mm, gripper.pad_width_mm
    need = [max(side / n[axis] if n[axis] % 2 else 0.0 for n in counts) for axis, side in enumerate(size)]
    if any(held < (1 - ROUNDING) * least for held, least in zip(gripper.sheet_support_mm, need, strict=True)):
        meshes = " and ".join(f"{list(n)}" for n in counts)
        found = f"{list(gripper.sheet_support_mm)} mm with {meshes} elements along length and width"
        expected = f"a support of at least {need[0]:g} x {need[1]:g} mm, which holds nodes of the pad's mesh"
        remedy = "use even numbers of elements" if len(counts) == 1 else "use multiples of 4 elements"
        yield Finding(("gripper", "sheet_support_mm"), found, expected, remedy)


def _pad_material(g: Gripper) -> Iterator[Finding]:
    """Constants that the chosen law cannot have."""
    if g.material == "blatz_ko" and g.poisson_ratio != 0.25:
        expected, remedy = "0.25, which Blatz-Ko foam always has", 'remove the key, or choose material = "hyperfoam"'
        yield Finding(("gripper", "poisson_ratio"), f"{g.poisson_ratio:g}", expected, remedy)
    if g.material != "hyperfoam":
        for key in ("alpha", "shear_moduli_kpa"):
            if getattr(g, key):
                found, expected = f"{key} with material {shown(g.material)}", "it with hyperfoam only"
                yield Finding(("gripper", key), found, expected, 'remove it, or write material = "hyperfoam"')
        return
    if len(g.alpha) != len(g.shear_moduli_kpa):
        found = f"{len(g.alpha)} exponents and {len(g.shear_moduli_kpa)} moduli"
        remedy = "give alpha and shear_moduli_kpa the same length"
        yield Finding(("gripper", "alpha"), found, "one exponent per modulus", remedy)
    if 0 in g.alpha:
        found, remedy = shown(list(g.alpha)), "use a small exponent such as 0.01"
        yield Finding(("gripper", "alpha"), found, "exponents other than 0", remedy)
    total = sum(g.shear_moduli_kpa)
    if total <= 0 or not math.isclose(total, g.shear_modulus_kpa, rel_tol=1e-9):
        found = f"{g.shear_modulus_kpa:g} kPa"
        expected = f"shear_modulus_kpa, the sum of shear_moduli_kpa, to be {total:g} kPa and > 0"
        yield Finding(("gripper", "shear_modulus_kpa"), found, expected, "leave shear_modulus_kpa out")


def _limit_surface(surface: LimitSurface, effects: Effects) -> Iterator[Finding]:
    """A forced level is the model's, and only some models have several objectives."""
    level, models = effects.limit_surface, LEVELS.get(effects.limit_surface, ())
    if models and surface.model not in models:
        expected = f"the level of limit_surface.model, which is {shown(surface.model)}"
        remedy = f'write `model = "{models[0]}"` in [limit_surface], or "auto" here'
        yield Finding(("effects", "limit_surface"), shown(level), expected, remedy)
    if surface.objective == "zhou" and surface.model not in PROGRAMMES:
        found, expected = f'"zhou" with model {shown(surface.model)}', f"it with model {' or '.join(PROGRAMMES)}"
        yield Finding(("limit_surface", "objective"), found, expected, 'write `objective = "least_squares"`')


def _weight(task: Task) -> Iterator[Finding]:
    if not any(abs(v) > 1e-9 for v in task.weight_direction):
        path = ("task", "weight_direction")
        yield Finding(path, shown(list(task.weight_direction)), "a direction", "write for example [0, 0, -1]")


def _output_file(output: Output) -> Iterator[Finding]:
    """Results end in .hdf, the one ending that every viewer takes, and stay below the working directory."""
    path, parts = ("output", "file"), PurePosixPath(output.file).parts
    if not output.file.endswith(".hdf"):
        remedy = f"write {shown(re.sub(r'[.][A-Za-z0-9]*$', '', output.file) + '.hdf')}"
        yield Finding(path, shown(output.file), "a file ending in .hdf, which all viewers open", remedy)
    if PurePosixPath(output.file).is_absolute() or PureWindowsPath(output.file).drive or ".." in parts:
        remedy = "give any other place on the command line with `-o`"
        yield Finding(path, shown(output.file), "a path below the working directory", remedy)


def _petsc(table: Mapping[str, Any]) -> Iterator[Finding]:
    """Options of the contact solver only, and none that writes files or runs code."""
    for key, value in table.items():
        path, bare = ("petsc", key), re.sub(r"^-*(contact_)?", "", key)
        if not re.fullmatch(r"contact_[a-z0-9_]+", key):
            remedy = f"write `contact_{bare}` if the contact solver is meant; {OTHERS}"
            expected = "an option of the contact solver, contact_..., as softjaw takes no others"
            yield Finding(path, f"the option {shown(key)}", expected, remedy)
        elif bare.endswith("python_type"):
            yield Finding(path, "an option that runs Python code", "options of the solver itself", "remove it")
        elif not isinstance(value, str | int | float):
            yield Finding(path, shown(value), "text, a number, or true or false", "write the option's value alone")
        elif isinstance(value, str) and not re.fullmatch(r"[A-Za-z0-9_,.+-]*", value):
            remedy = "options that name files go into the environment variable PETSC_OPTIONS"
            yield Finding(path, shown(value), "a word, a number or a list of them", remedy)


def _uncertain(own: Uncertainty, shape: Any, friction: Friction, sweep: Mapping[str, Any]) -> Iterator[Finding]:
    """A friction coefficient that may be negative, a wall that is not there, and a sweep, which has no intervals."""
    if own.mu and own.mu >= friction.mu:
        expected = f"less than friction.mu, which is {friction.mu:g}"
        remedy = "the half-width is in the unit of mu, not in per cent"
        yield Finding(("uncertainty", "mu"), f"{own.mu:g}", expected, remedy)
    if own.wall_thickness_percent and getattr(shape, "wall", None) is None:
        found, expected = f"{own.wall_thickness_percent:g}", "0 for an object without a wall"
        path = ("uncertainty", "wall_thickness_percent")
        yield Finding(path, found, expected, "give object.wall_mm, or leave it out")
    if own.parts and sweep:
        found, remedy = f"it beside a sweep over {', '.join(sweep)}", "leave [sweep] out here, or [uncertainty]"
        yield Finding(("uncertainty",), found, "a scene without a sweep", remedy)


CHECKS: tuple[tuple[tuple[str, ...], Callable[..., Iterator[Finding]]], ...] = (
    (("object",), grasps.object_findings), (("object", "effects"), grasps.wall_findings),
    (("object", "effects"), _coupling), (("gripper", "effects"), _pad_mesh), (("gripper",), _pad_material),
    (("gripper", "effects", "accuracy"), _backing_plate), (("candidates",), grasps.candidate_findings),
    (("object", "candidates"), grasps.station_findings),
    (("object", "candidates", "gripper"), grasps.pose_findings),
    (("load",), lambda load: grasps.twice(("load", "normal_force_n"), load.normal_force_n)),
    (("output",), _output_file), (("petsc",), _petsc), (("limit_surface", "effects"), _limit_surface),
    (("limit_surface", "candidates"), lambda s, c: _named(("limit_surface", "wrench_samples"), s.wrench_samples, c)),
    (("task",), _weight), (("uncertainty", "object", "friction", "sweep"), _uncertain),
    (("uncertainty", "candidates"), lambda u, c: _named(("uncertainty", "probes"), u.probes, c)),
)  # fmt: skip


def findings(given: Mapping[str, Any]) -> list[Finding]:
    """Everything wrong with the sections that are there; a check whose sections are not all there is left out."""
    ready = [(names, check) for names, check in CHECKS if all(name in given for name in names)]
    return [finding for names, check in ready for finding in check(*(given[name] for name in names))]


def value_warnings(gripper: Gripper, friction: Friction, load: Load, accuracy: Accuracy) -> Iterator[str]:
    """Sentences about values that are allowed but seldom meant."""
    if friction.mu > 2:
        yield f"friction.mu = {friction.mu:g} is large: foam on plastic has about 0.8, and the paper's highest is 2"
    force, area = load.normal_force_n[-1], gripper.pad_length_mm * gripper.pad_width_mm
    strain = force / area * 1000 / gripper.shear_modulus_kpa
    if strain > 2:
        yield (
            f"load.normal_force_n = {force:g} N on {area:g} mm^2 is a mean pressure of {strain:.2g} times the pad's "
            "shear modulus: cases may fail to converge"
        )
    if gripper.poisson_ratio > 0.45 and gripper.element == "hex8":
        yield f'gripper.poisson_ratio = {gripper.poisson_ratio:g} makes hex8 elements too stiff: use element = "hex27"'
    if accuracy.meshes == 2 and any(n % 4 for n in gripper.elements):
        yield (
            f"accuracy.meshes = 2 halves the mesh, and gripper.elements = {list(gripper.elements)} cannot be halved "
            "evenly: multiples of 4 can"
        )
