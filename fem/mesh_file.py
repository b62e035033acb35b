"""Mesh files as bytes: what can be known of a file before a library's reader, which may crash on it, sees it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from fem.mesh_check import MeshError
from fem.pose import FloatArray

ENDINGS = (".stl", ".obj", ".ply")
LARGEST_FILE = 200 * 2**20
PLY_BYTES = {"char": 1, "uchar": 1, "short": 2, "ushort": 2, "int": 4, "uint": 4, "float": 4, "double": 8,
             "int8": 1, "uint8": 1, "int16": 2, "uint16": 2, "int32": 4, "uint32": 4, "float32": 4, "float64": 8}


def checked_bytes(path: Path) -> bytes:
    """Contents of a mesh file that exists, has a known ending and a size that can be a mesh."""
    if path.suffix.lower() not in ENDINGS:
        raise MeshError(f"{path}: meshes are read from {', '.join(ENDINGS)} files; convert it to one of these")
    try:
        size = path.stat().st_size
        if size > LARGEST_FILE:
            raise MeshError(f"{path}: has {size >> 20} MiB, more than {LARGEST_FILE >> 20} MiB; decimate the mesh")
        data = path.read_bytes()
    except OSError as problem:
        raise MeshError(f"{path}: cannot be read ({problem.strerror}); check the path") from problem
    if not data.strip():
        raise MeshError(f"{path}: the file is empty; export the mesh again")
    return data


def binary_stl(path: Path, data: bytes) -> FloatArray | None:
    """Corners ``(m, 3, 3)`` of a binary STL file's triangles; None if the file is an ASCII one."""
    if data[:5].lower() == b"solid" and b"facet" in data[:1000].lower():
        return None
    count = int.from_bytes(data[80:84], "little") if len(data) >= 84 else -1
    if len(data) < 84 + 50 * count or count < 0:
        raise MeshError(f"{path}: is cut short or no STL file: {len(data)} bytes, but its header calls for "
                        f"{84 + 50 * count if count >= 0 else 'at least 84'}; copy or export it again")
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    return np.frombuffer(data, record, count, 84)["corners"].astype(float)


def check_ply(path: Path, data: bytes) -> None:
    """Refuse a PLY file that is shorter than its header says: readers trust the header."""
    head, found, _ = data[: 2**16].partition(b"end_header")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    elements: list[list] = []  # name, count, smallest number of bytes per element
    try:
        for words in lines:
            if words[:1] == ["element"]:
                elements.append([words[1], int(words[2]), 0])
            elif words[:2] == ["property", "list"]:
                elements[-1][2] += PLY_BYTES[words[2]] + 3 * PLY_BYTES[words[3]] * (elements[-1][0] == "face")
            elif words[:1] == ["property"]:
                elements[-1][2] += PLY_BYTES[words[1]]
    except (IndexError, KeyError, ValueError):
        found = b""
    if not found or lines[0] != ["ply"] or min((count for _, count, _ in elements), default=-1) < 0:
        raise MeshError(f"{path}: is no PLY file with a complete header; export it again")
    if ["format", "ascii", "1.0"] in lines:
        have, need, what = data.rstrip().count(b"\n") - len(lines), sum(count for _, count, _ in elements), "lines"
    else:
        have, need, what = len(data) - len(head) - 11, sum(count * size for _, count, size in elements), "bytes"
    if have < need:
        raise MeshError(f"{path}: is cut short: {have} {what} of data, but its header calls for {need}; export "
                        "it again")
