"""The same patch written as every kind of file that ``softjaw patch`` reads."""

import numpy as np


def cylinder_mesh(R=0.03, alpha=np.pi / 3, L=0.04, n=15, m=9, triangles=False):
    """Points ``(k, 3)`` and quadrilaterals (or triangles) of a cylinder along x; normals point to +z."""
    phi, x = np.linspace(-alpha, alpha, n + 1), np.linspace(-L / 2, L / 2, m + 1)
    points = np.array([[s, R * np.sin(f), R * np.cos(f)] for f in phi for s in x])
    i, j = (g.ravel() for g in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    first = i * (m + 1) + j
    quads = np.stack([first, first + 1, first + m + 2, first + m + 1], axis=1)
    return points, np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) if triangles else quads


def table(path, headers, columns):
    """A CSV file that keeps every digit."""
    lines = [",".join(headers), *(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())]
    path.write_text("\n".join(lines) + "\n")
    return path


def centres(path, patch, length="m", pressure="pa"):
    """Centre, area and normal of every face of a ContactPatch; ``length`` and ``pressure`` are units."""
    a, p = {"m": 1.0, "mm": 1e3}[length], {"pa": 1.0, "kpa": 1e-3}[pressure]
    headers = [*(f"{c}_{length}" for c in "xyz"), f"area_{length}2", "nx", "ny", "nz", f"pressure_{pressure}"]
    return table(path, headers, [a * patch.centroid, a**2 * patch.area, patch.normal, p * patch.pressure])


def corners(path, points, cells, pressure):
    """Corners of every face."""
    headers = [f"{c}{k + 1}_m" for k in range(cells.shape[1]) for c in "xyz"]
    return table(path, [*headers, "pressure_pa"], [points[cells].reshape(len(cells), -1), pressure])


def _array(name, values, kind="Float64"):
    values = np.asarray(values)
    parts = values.shape[1] if values.ndim == 2 else 1
    text = " ".join(map(repr, values.ravel().tolist()))
    return f'<DataArray type="{kind}" Name="{name}" NumberOfComponents="{parts}" format="ascii">{text}</DataArray>'


def vtk(path, points, cells, on_cells=(), on_points=(), kinds=None):
    """An ASCII VTU or VTP file, by the path's ending; data are pairs of name and values."""
    sizes = np.array([len(c) for c in cells])
    flat = np.concatenate([np.asarray(c) for c in cells])
    topology = _array("connectivity", flat, "Int64") + _array("offsets", np.cumsum(sizes), "Int64")
    data = "".join(
        f"<{where}>{''.join(_array(*pair) for pair in pairs)}</{where}>"
        for where, pairs in (("PointData", on_points), ("CellData", on_cells))
    )
    place = f"<Points>{_array('Points', points)}</Points>"
    if path.suffix == ".vtu":
        types = _array("types", [{3: 5, 4: 9}[s] for s in sizes] if kinds is None else kinds, "UInt8")
        kind, head = "UnstructuredGrid", f'NumberOfPoints="{len(points)}" NumberOfCells="{len(cells)}"'
        inner = f"{place}<Cells>{topology}{types}</Cells>"
    else:
        kind, head = "PolyData", f'NumberOfPoints="{len(points)}" NumberOfPolys="{len(cells)}"'
        inner = f"{place}<Polys>{topology}</Polys>"
    path.write_text(
        f'<?xml version="1.0"?>\n<VTKFile type="{kind}" version="1.0" byte_order="LittleEndian" '
        f'header_type="UInt64"><{kind}><Piece {head}>{data}{inner}</Piece></{kind}></VTKFile>\n'
    )
    return path
