"""Write the triangle meshes of the hard cases beside this file: one egg in many guises, cubes, broken bodies.

Run from the repository's root: ``python -m tests.hard_cases.objects.make_hard``.
"""

from pathlib import Path

import numpy as np
import trimesh

from softjaw.fem.objects.gap import grid_triangles

HERE = Path(__file__).resolve().parent
SEMI_AXES_MM = np.array([25.0, 20.0, 35.0])
ROWS, COLUMNS = 20, 36
MM_PER_INCH = 25.4
NOISE_MM = 0.1
CUBE_MM = 40.0


def egg(rows: np.ndarray, columns: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ellipsoid with nodes at polar angles ``rows (m,)`` and azimuths ``columns (n,)``: points [mm], triangles."""
    polar, azimuth = np.meshgrid(rows, columns, indexing="ij")
    unit = np.stack([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), -np.cos(polar)], axis=-1)
    points = np.concatenate([unit.reshape(-1, 3), [[0, 0, -1], [0, 0, 1]]]) * SEMI_AXES_MM
    n, i = len(columns), np.arange(len(columns))
    j, last = (i + 1) % n, (len(rows) - 1) * n
    bottom = np.stack([j, i, 0 * i + len(points) - 2], axis=1)
    top = np.stack([last + i, last + j, 0 * i + len(points) - 1], axis=1)
    return points, np.concatenate([bottom, grid_triangles(len(rows), n, closed=True), top])


def even(n: int, end: float) -> np.ndarray:
    return end * (np.arange(n) + 1.0) / (n + 1.0)


def uneven(n: int, end: float) -> np.ndarray:
    t = even(n, 1.0)
    return end * (t + 0.9 * np.sin(6 * np.pi * t) / (6 * np.pi))


def cube(size: float, middle: tuple[float, float, float]) -> tuple[np.ndarray, np.ndarray]:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)], float)
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners * size / 2 + middle, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def meshes() -> dict[str, tuple[np.ndarray, np.ndarray]]:
    around = 2 * np.pi * (np.arange(COLUMNS) + 0.5) / COLUMNS  # facets face the fingers squarely
    points, triangles = egg(even(ROWS, np.pi), around)
    noise = np.random.default_rng(1).normal(scale=NOISE_MM, size=points.shape)
    two = [cube(CUBE_MM, middle) for middle in ((0.0, 0.0, 0.0), (15.0, 10.0, 5.0))]
    cubic = cube(CUBE_MM, (0.0, 0.0, 0.0))
    return {
        "egg": (points, triangles),
        "egg-in-m": (points / 1000.0, triangles),
        "egg-in-inches": (points / MM_PER_INCH, triangles),
        "egg-lying": (points[:, [2, 0, 1]], triangles),  # its axis z is x here
        "egg-noisy": (points + noise, triangles),
        "egg-slivers": egg(uneven(ROWS, np.pi), uneven(COLUMNS, 2 * np.pi)),
        "cube": cubic,
        "cube-open": (cubic[0], cubic[1][1:]),
        "cube-inside-out": (cubic[0], cubic[1][:, ::-1]),
        "cubes-crossing": (np.concatenate([two[0][0], two[1][0]]), np.concatenate([two[0][1], two[1][1] + 8])),
    }


if __name__ == "__main__":
    for name, mesh in meshes().items():
        trimesh.Trimesh(*mesh, process=False).export(HERE / f"hard-{name}.stl")
