"""Meshes that users bring, by script: hollow bottles and bowls, a mug with a handle, scans with defects."""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np
import trimesh

SCANS = Path(__file__).parent / "scans"
AROUND = 64
OUTLINE = [  # radius and height of a waisted body [m]
    (0.0, 0.0),
    *((0.028 * np.sin(t), 0.0112 * (1 - np.cos(t))) for t in np.linspace(0.3, np.pi / 2, 6)),
    *((0.028 - 0.004 * np.sin(np.pi * s) ** 2, 0.0112 + 0.0876 * s) for s in np.linspace(0.05, 0.95, 19)),
    *((0.028 * np.cos(t), 0.0988 + 0.0112 * np.sin(t)) for t in np.linspace(0.0, np.pi / 2 - 0.3, 6)),
    (0.0, 0.11),
]


def revolved(outline: Sequence[tuple[float, float]], around: int = AROUND) -> trimesh.Trimesh:
    """Closed body of revolution about z from points (radius, z) [m] from pole to pole."""
    return trimesh.creation.revolve(np.array(outline), sections=around)


def outline_body(outline: Sequence[tuple[float, float]] = OUTLINE) -> trimesh.Trimesh:
    """A waisted body of oval sections, a quarter wider along x."""
    body = revolved(outline, 48)
    body.vertices[:, 0] *= 1.25
    return body


def slabs(count: int, overlap: float = 0.006) -> trimesh.Trimesh:
    radius, height = np.transpose(OUTLINE)
    cuts, parts = np.linspace(0.0, height[-1], count + 1), []
    for low, high in pairwise(cuts):
        low, high = max(low - overlap, 0.0), min(high + overlap, height[-1])
        ends = [(float(np.interp(z, height, radius)), z) for z in (low, high)]
        inner = [point for point in OUTLINE if low < point[1] < high]
        rims = [ends[:1] if low > 0 else [], inner, ends[1:] if high < height[-1] else []]
        parts.append(outline_body([(0.0, low), *(point for rim in rims for point in rim), (0.0, high)]))
    return trimesh.util.concatenate(parts)


def hollow_bottle(height: float, radius: float, neck: float, wall: float) -> trimesh.Trimesh:
    """A bottle with an open mouth and an inner wall ``wall`` under the outer one [m]."""
    s = np.linspace(0.0, 1.0, 13)
    shoulder = neck + (radius - neck) * 0.5 * (1.0 + np.cos(np.pi * s))
    z = (0.62 + 0.2 * s) * height
    body = np.linspace(0.0, 0.6, 13) * height
    outer = [(0.0, 0.0), *((radius, h) for h in body), *zip(shoulder, z, strict=True), (neck, height)]
    inner = [
        (neck - wall, height), *((r - wall, h) for r, h in zip(shoulder[::-1], z[::-1], strict=True)),
        *((radius - wall, max(h, wall)) for h in body[::-1]), (0.0, wall),
    ]
    return revolved([*outer, *inner])


def hollow_bowl(radius: float, wall: float, depth: float) -> trimesh.Trimesh:
    """A bowl: a part of a hollow ball, cut ``depth`` above its lowest point [m]."""
    ends = [np.arccos(max(-1.0, 1.0 - depth / r)) for r in (radius, radius - wall)]
    outer = [(radius * np.sin(t), radius * (1.0 - np.cos(t))) for t in np.linspace(0.0, ends[0], 33)]
    inner = [((radius - wall) * np.sin(t), radius - (radius - wall) * np.cos(t)) for t in np.linspace(ends[1], 0.0, 33)]
    return revolved([*outer, *inner])


def mug(radius: float = 0.04, height: float = 0.095, wall: float = 0.004) -> trimesh.Trimesh:
    """A cylindrical cup with a handle that is a second closed body, as drawing programs export it."""
    heights = np.linspace(0.0, height, 9)
    cup = revolved([
        (0.0, 0.0), *((radius, h) for h in heights),
        *((radius - wall, max(h, wall)) for h in heights[::-1]), (0.0, wall),
    ])  # fmt: skip
    handle = trimesh.creation.torus(0.025, 0.005, major_sections=48, minor_sections=20)
    handle.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    handle.apply_translation([radius + 0.018, 0.0, 0.5 * height])
    return trimesh.util.concatenate([cup, handle])


def punctured(mesh: trimesh.Trimesh, holes: int, rings: int = 1, seed: int = 0) -> trimesh.Trimesh:
    rng = np.random.default_rng(seed)
    gone = np.zeros(len(mesh.faces), dtype=bool)
    for vertex in rng.choice(len(mesh.vertices), holes, replace=False):
        near = {int(vertex)}
        for _ in range(rings):
            gone |= np.isin(mesh.faces, list(near)).any(axis=1)
            near |= set(mesh.faces[gone].ravel().tolist())
    return trimesh.Trimesh(mesh.vertices, mesh.faces[~gone], process=False)


def spoiled(mesh: trimesh.Trimesh, share: float = 0.01, seed: int = 0) -> trimesh.Trimesh:
    """A mesh with flipped, doubled and degenerate triangles, and every vertex stored once for each triangle."""
    rng = np.random.default_rng(seed)
    faces = mesh.faces.copy()
    flipped = rng.random(len(faces)) < share
    faces[flipped] = faces[flipped][:, ::-1]
    points = mesh.vertices[faces].reshape(-1, 3)
    split = np.arange(len(points)).reshape(-1, 3)
    slivers = split[rng.choice(len(split), 5)][:, [0, 1, 1]]
    return trimesh.Trimesh(points, np.concatenate([split, split[:3], slivers]), process=False)


def scan(name: str) -> trimesh.Trimesh:
    (file,) = SCANS.glob(f"*{name}*.stl")
    return trimesh.load(file)
