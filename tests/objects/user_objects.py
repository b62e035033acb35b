"""The objects that users bring, as files of triangles: scans whole and spoiled, hollow bottles and bowls, mugs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import trimesh

from tests.objects.bodies import SCANS, closed_mug, hollow_bottle, hollow_bowl, mug, punctured, scan, spoiled

Maker = Callable[[], trimesh.Trimesh]
EACH = 3  # hollow bottles, and as many bowls
HOLES = 3


def hollow(seed: int) -> dict[str, Maker]:
    """Bottles and bowls with an inner wall 2 to 5 mm under the outer one, narrow enough for a common gripper."""
    rng, made = np.random.default_rng(seed), {}
    for k in range(EACH):
        height, radius, wall = rng.uniform((0.12, 0.025, 0.002), (0.25, 0.04, 0.005))
        neck = max(2.5 * wall, radius * rng.uniform(0.35, 0.6))
        made[f"bottle {k}, wall {1e3 * wall:.1f} mm"] = lambda a=(height, radius, neck, wall): hollow_bottle(*a)
    for k in range(EACH):
        radius, wall, depth = rng.uniform((0.028, 0.002, 0.5), (0.042, 0.005, 1.3))
        made[f"bowl {k}, wall {1e3 * wall:.1f} mm"] = lambda a=(radius, wall, depth * radius): hollow_bowl(*a)
    return made


def user_objects(seed: int) -> dict[str, tuple[str, Maker]]:
    """Kind and maker of every object by its name; makers give metres."""
    found: dict[str, tuple[str, Maker]] = {}
    for file in sorted(Path(SCANS).glob("*.stl")):
        name = file.stem[8:].replace("_", " ")
        whole = lambda stem=file.stem: scan(stem)  # noqa: E731
        found[name] = "scan", whole
        found[f"{name}, with holes"] = "scan with holes", lambda whole=whole: punctured(whole(), HOLES, seed=seed)
        found[f"{name}, spoiled"] = "spoiled scan", lambda whole=whole: spoiled(whole(), seed=seed)
    found |= {name: ("hollow", make) for name, make in hollow(seed).items()}
    return found | {"mug of two bodies": ("mug", mug), "mug in one": ("mug", closed_mug)}
