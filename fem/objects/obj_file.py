"""OBJ files: points in lines ``v x y z``, faces in lines ``f 1 2 3`` that count points from 1, or back from -1."""

from __future__ import annotations

import numpy as np

from softjaw.fem.objects.mesh_check import MeshError
from softjaw.fem.objects.mesh_file import Polygons, check_corners, check_counts, numbers, text_lines


def obj_polygons(data: bytes) -> Polygons:
    """Polygons of an OBJ file; texture, normals, groups and materials are left out."""
    lines = text_lines(data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" "))
    count = sum(line.startswith((b"v ", b"v\t")) for line in lines)
    check_counts(count, sum(line.startswith((b"f ", b"f\t")) for line in lines))
    places: list[bytes] = []
    corners: list[bytes] = []
    sizes: list[int] = []
    before: list[int] = []  # points before each face, from which negative numbers count back
    for number, line in enumerate(lines, 1):
        words = line.split()
        if words[:1] == [b"v"]:
            if len(words) < 4:
                raise MeshError(
                    f"is damaged: line {number} has {len(words) - 1} coordinates, expected 3; export it again"
                )
            places += words[1:4]
        elif words[:1] == [b"f"]:
            if len(words) < 4:
                raise MeshError(
                    f"is damaged: line {number} has {len(words) - 1} corners, expected at least 3; export it again"
                )
            check_corners(len(words) - 1, len(corners))
            corners += [word.partition(b"/")[0] for word in words[1:]]
            sizes.append(len(words) - 1)
            before.append(len(places) // 3)
    given, size = numbers(corners, "i8"), np.array(sizes, dtype=np.int64)
    if (given == 0).any():
        raise MeshError("is damaged: a face refers to point 0, but OBJ files count from 1; export it again")
    back = np.repeat(np.array(before, dtype=np.int64), size)
    return numbers(places, "f8").reshape(-1, 3), size, np.where(given > 0, given - 1, given + back)
