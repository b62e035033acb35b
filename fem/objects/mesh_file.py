"""Mesh files: their bytes, of a size that can be a mesh, and the reader that fits their ending.

The readers are our own: those of VTK trust what a file says of itself, and a damaged one ended the program. These read
nothing that is not there, and every number and index is checked.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from softjaw.fem.objects.file_limits import (
    ENDINGS,
    LARGEST_FILE,
    LONGEST_LINE,
    LONGEST_NUMBER,
    MOST_CORNERS,
    MOST_LINES,
    MOST_POINTS,
    MOST_TRIANGLES,
)
from softjaw.fem.objects.gap import IntArray
from softjaw.fem.objects.mesh_check import MeshError
from softjaw.fem.objects.pose import FloatArray

Polygons = tuple[FloatArray, IntArray, IntArray]  # points (k, 3), number of corners of each face (m,), all corners


def read_polygons(path: Path) -> Polygons:
    """Points ``(k, 3)`` in the file's own unit, corners of each face ``(m,)``, and all corners, one face after another.

    Raises
    ------
    MeshError
        The file cannot be read, is no mesh, too large or damaged.
    """
    from softjaw.fem.objects.obj_file import obj_polygons
    from softjaw.fem.objects.ply_file import ply_polygons
    from softjaw.fem.objects.stl_file import stl_polygons

    data = checked_bytes(path)
    readers = {".stl": stl_polygons, ".obj": obj_polygons, ".ply": ply_polygons}
    try:
        points, sizes, corners = readers[path.suffix.lower()](data)
    except MeshError as problem:
        raise MeshError(f"{path}: {problem}") from problem
    if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
        astray = corners[(corners < 0) | (corners >= len(points))][0]
        raise MeshError(
            f"{path}: a face refers to point {astray}, but there are only {len(points)} (counted from 0); "
            "the file is damaged, export it again"
        )
    return points, sizes, corners


def checked_bytes(path: Path) -> bytes:
    """Contents of a mesh file that exists, has a known ending and a size that can be a mesh."""
    if path.suffix.lower() not in ENDINGS:
        raise MeshError(f"{path}: meshes are read from {', '.join(ENDINGS)} files; convert it to one of these")
    try:
        size = path.stat().st_size
        if not path.is_file():  # a device or a pipe may have no end
            raise MeshError(f"{path}: is no regular file; name the file of a mesh")
        if size > LARGEST_FILE:
            raise MeshError(f"{path}: has {size >> 20} MiB, more than {LARGEST_FILE >> 20} MiB; decimate the mesh")
        data = path.read_bytes()
    except OSError as problem:
        raise MeshError(f"{path}: cannot be read ({problem.strerror}); check the path") from problem
    if not data.strip():
        raise MeshError(f"{path}: the file is empty; export the mesh again")
    return data


def check_counts(points: int, faces: int) -> None:
    """Refuse more points or faces than a mesh may have, before they are read."""
    if points > MOST_POINTS or faces > MOST_TRIANGLES:
        raise MeshError(
            f"the mesh has {points} points and {faces} faces, more than {MOST_POINTS} and {MOST_TRIANGLES}; decimate "
            "it, to about a tenth of the pad's element size nothing is lost"
        )


def check_corners(count: int, total: int) -> None:
    """Refuse a face of ``count`` corners, or so many corners altogether, that no mesh of triangles is made of them."""
    if count > MOST_CORNERS or total > 4 * MOST_TRIANGLES:
        raise MeshError(
            f"a face of {count} corners, {total} in all, more than {MOST_CORNERS} and {4 * MOST_TRIANGLES}; "
            "triangulate and decimate the mesh"
        )


def text_lines(data: bytes) -> list[bytes]:
    """Lines of a text, not too many and none too long to be taken apart."""
    count = data.count(b"\n") + data.count(b"\r")
    if count > MOST_LINES:
        raise MeshError(f"has {count} lines, more than {MOST_LINES}; decimate the mesh")
    lines = data.splitlines()
    if (longest := max(map(len, lines), default=0)) > LONGEST_LINE:
        raise MeshError(f"has a line of {longest} bytes, more than {LONGEST_LINE}; export the mesh again")
    return lines


def as_floats(values: np.ndarray) -> FloatArray:
    """Numbers of any kind as floats; what is none comes out as NaN, without a warning."""
    with np.errstate(invalid="ignore"):
        return values.astype(float)


def numbers(words: list[bytes], kind: str) -> np.ndarray:
    """Words as an array of ``f8`` or ``i8``; `MeshError` names the first that is no such number."""
    try:
        if max(map(len, words), default=0) <= LONGEST_NUMBER:  # numpy would keep this room for each of them
            return np.array(words, dtype="S").astype(kind) if words else np.empty(0, kind)
    except (ValueError, OverflowError):
        pass
    word = next((word for word in words if not _is_number(word, kind)), b"a number beyond all bounds")
    found = word[:LONGEST_NUMBER].decode("ascii", "replace")
    raise MeshError(f"is damaged: found {found!a} where a number has to stand; export it again")


def _is_number(word: bytes, kind: str) -> bool:
    try:
        return len(word) <= LONGEST_NUMBER and (kind == "f8" or abs(int(word)) < 2**63) and float(word) is not None
    except (ValueError, OverflowError):
        return False
