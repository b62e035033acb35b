"""STL files, binary and ASCII: triangles with corners of their own."""

from __future__ import annotations

import re

import numpy as np

from softjaw.fem.objects.mesh_check import MeshError
from softjaw.fem.objects.mesh_file import Polygons, as_floats, check_counts, numbers

RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
VERTEX = re.compile(rb"^[ \t]*vertex[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)[ \t]*\r?$", re.MULTILINE | re.IGNORECASE)


def stl_polygons(data: bytes) -> Polygons:
    """Polygons of an STL file; its normals are left out, as the order of the corners tells them."""
    # binary files may begin with "solid" too, but then have no facets near
    ascii_one = data[:5].lower() == b"solid" and b"facet" in data[:1000].lower()
    corners = _ascii(data) if ascii_one else _binary(data)
    return corners.reshape(-1, 3), np.full(len(corners), 3), np.arange(3 * len(corners))


def _binary(data: bytes) -> np.ndarray:
    """Corners ``(m, 3, 3)``."""
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if len(data) < 84 + RECORD.itemsize * count or count < 0:
        need = 84 + RECORD.itemsize * count if count >= 0 else "at least 84"
        raise MeshError(
            f"is cut short or no STL file: {len(data)} bytes, but its header calls for {need}; copy or export it again"
        )
    check_counts(0, count)
    return as_floats(np.frombuffer(data, RECORD, count, 84)["corners"])


def _ascii(data: bytes) -> np.ndarray:
    """Corners ``(m, 3, 3)``."""
    lower = data.lower()
    facets, vertices = lower.count(b"endfacet"), lower.count(b"vertex")
    check_counts(vertices, facets)
    found = VERTEX.findall(data)
    if not len(found) == vertices == 3 * facets or b"endsolid" not in lower:
        raise MeshError(
            f"is damaged or no STL file: {facets} complete facets with {len(found)} corners that can be "
            "read, expected three of each and 'endsolid'; export it again"
        )
    return numbers([word for corner in found for word in corner], "f8").reshape(-1, 3, 3)
