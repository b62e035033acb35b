"""What the pad's mesh and material must satisfy, and values of a scene that deserve a warning."""

from __future__ import annotations

import math
from collections.abc import Iterator

from softjaw.study.scene.errors import Finding, shown
from softjaw.study.scene.sections import Accuracy, Effects, Friction, Gripper, Load

MOST_ELEMENTS, LARGEST_ASPECT = 1_000_000, 20.0
ROUNDING = 1e-9  # of a length: fem.pad.backing_plate finds nodes this close to the support's rim on it, too


def pad_mesh(gripper: Gripper, effects: Effects) -> Iterator[Finding]:
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
            yield Finding(
                path, found, "an even number of elements where they are graded", "write 1.0, or even elements"
            )
    if math.prod(n) > MOST_ELEMENTS:
        expected = f"at most {MOST_ELEMENTS:,} elements"
        yield Finding(counts, f"{list(n)}, which is {math.prod(n):,} elements", expected, "start with [20, 10, 6]")
    edges = element_edges(gripper)
    if max(map(max, edges)) > LARGEST_ASPECT * min(map(min, edges)):
        sizes = " x ".join(f"{low:.3g}" if low == high else f"{low:.3g}..{high:.3g}" for low, high in edges)
        size = (gripper.pad_length_mm, gripper.pad_width_mm, gripper.pad_thickness_mm)
        h = (math.prod(size) / math.prod(n)) ** (1 / 3)
        better = [max(2, 2 * round(s / h / 2)) for s in size]
        expected = f"edges that differ by a factor of {LARGEST_ASPECT:g} at most"
        yield Finding(
            counts, f"{list(n)}, which makes elements of {sizes} mm", expected, f"try {better} without grading"
        )


def element_edges(gripper: Gripper) -> list[tuple[float, float]]:
    """Smallest and largest element edge along x, y and z [mm]."""
    sizes = (gripper.pad_length_mm / 2, gripper.pad_width_mm / 2, gripper.pad_thickness_mm)
    counts = (gripper.elements[0] // 2, gripper.elements[1] // 2, gripper.elements[2])
    edges = []
    for size, n, ratio in zip(sizes, counts, gripper.grading, strict=True):
        steps = [ratio ** (i / (n - 1)) for i in range(n)] if n > 1 else [1.0]
        edges.append((min(steps) / sum(steps) * size, max(steps) / sum(steps) * size))
    return edges


def sheet(gripper: Gripper, effects: Effects, accuracy: Accuracy) -> Iterator[Finding]:
    """The finger holds the sheet by at least one node of every mesh; with even counts one is in the middle."""
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


def pad_material(gripper: Gripper) -> Iterator[Finding]:
    """Constants that the chosen law cannot have."""
    g = gripper
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
        found = shown(list(g.alpha))
        yield Finding(("gripper", "alpha"), found, "exponents other than 0", "use a small exponent such as 0.01")
    total = sum(g.shear_moduli_kpa)
    if total <= 0 or not math.isclose(total, g.shear_modulus_kpa, rel_tol=1e-9):
        expected = f"shear_modulus_kpa, the sum of shear_moduli_kpa, to be {total:g} kPa and > 0"
        found = f"{g.shear_modulus_kpa:g} kPa"
        yield Finding(("gripper", "shear_modulus_kpa"), found, expected, "leave shear_modulus_kpa out")


def warnings(gripper: Gripper, friction: Friction, load: Load, accuracy: Accuracy) -> Iterator[str]:
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
