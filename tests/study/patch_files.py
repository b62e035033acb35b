"""The same patch written as every kind of file that ``softjaw patch`` reads."""

import numpy as np
import pyvista as pv


def cylinder_mesh(R=0.03, alpha=np.pi / 3, L=0.04, n=15, m=9, triangles=False):
    """Points ``(k, 3)`` and quadrilaterals (or triangles) of a cylinder along x; normals point to +z."""
    phi, x = np.linspace(-alpha, alpha, n + 1), np.linspace(-L / 2, L / 2, m + 1)
    points = np.array([[s, R * np.sin(f), R * np.cos(f)] for f in phi for s in x])
    i, j = (g.ravel() for g in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    first = i * (m + 1) + j
    quads = np.stack([first, first + 1, first + m + 2, first + m + 1], axis=1)
    return points, np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) if triangles else quads


def table(path, headers, columns):
    lines = [",".join(headers), *(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())]
    path.write_text("\n".join(lines) + "\n")
    return path


def centres(path, patch, length="m", pressure="pa"):
    a, p = {"m": 1.0, "mm": 1e3}[length], {"pa": 1.0, "kpa": 1e-3}[pressure]
    headers = [*(f"{c}_{length}" for c in "xyz"), f"area_{length}2", "nx", "ny", "nz", f"pressure_{pressure}"]
    return table(path, headers, [a * patch.centroid, a**2 * patch.area, patch.normal, p * patch.pressure])


def corners(path, points, cells, pressure):
    headers = [f"{c}{k + 1}_m" for k in range(cells.shape[1]) for c in "xyz"]
    return table(path, [*headers, "pressure_pa"], [points[cells].reshape(len(cells), -1), pressure])


def vtk(path, points, cells, on_cells=(), on_points=(), kinds=None):
    points, faces = np.asarray(points, float), np.concatenate([[len(c), *c] for c in cells])
    if path.suffix == ".vtu":
        grid = pv.UnstructuredGrid(faces, kinds or [{3: 5, 4: 9}[len(c)] for c in cells], points)
    else:
        grid = pv.PolyData(points, faces)
    for data, pairs in ((grid.cell_data, on_cells), (grid.point_data, on_points)):
        for name, values in pairs:
            data[name] = np.asarray(values)
    grid.save(path, binary=False)
    return path
