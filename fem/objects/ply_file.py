"""PLY files, ASCII and binary: a header that lists elements and their properties, then the elements themselves."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from softjaw.fem.objects.file_limits import MOST_CORNERS
from softjaw.fem.objects.mesh_check import MeshError
from softjaw.fem.objects.mesh_file import Polygons, as_floats, check_corners, check_counts, numbers, text_lines

KINDS = {"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
         "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
         "float32": "f4", "float64": "f8"}  # fmt: skip
FORMATS = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
INDICES = ("vertex_indices", "vertex_index")


@dataclass
class Element:
    """A kind of element: how many, and properties as ``(name, kind, kind of a list's length or nothing)``."""

    name: str
    count: int
    properties: list[tuple[str, str, str]] = field(default_factory=list)


def ply_polygons(data: bytes) -> Polygons:
    """Polygons of a PLY file; every property but coordinates and corners is left out."""
    order, elements, body = _header(data)
    if order == "":
        return _ascii(elements, body)
    points, sizes, corners, at = np.empty((0, 3)), np.empty(0, np.int64), np.empty(0, np.int64), 0
    for element in elements:
        need = element.count * sum(np.dtype(size or kind).itemsize for _, kind, size in element.properties)
        if len(body) - at < need:
            raise _cut(len(body) - at, need, "bytes")
        if element.name == "vertex":
            record = np.dtype([(f"{name}", order + kind) for name, kind, _ in element.properties])
            found = np.frombuffer(body, record, element.count, at)
            points, at = np.stack([as_floats(found[axis]) for axis in "xyz"], axis=1), at + found.nbytes
        elif element.name == "face":
            sizes, corners, at = _binary_faces(element, order, body, at)
            break  # what comes after the faces is not needed
        else:
            at = _binary_faces(element, order, body, at)[2]
    return points, sizes, corners


def _header(data: bytes) -> tuple[str, list[Element], bytes]:
    """Byte order (none for ASCII), the elements and the bytes after the header."""
    head, found, _ = data[: 2**16].partition(b"end_header")
    lines = [line.split() for line in head.decode("ascii", "replace").splitlines()]
    elements: list[Element] = []
    order = None
    try:
        for words in lines:
            match words:
                case ["format", name, "1.0"]:
                    order = FORMATS[name]
                case ["element", name, count]:
                    elements.append(Element(name, int(count)))
                case ["property", "list", size, kind, name]:
                    elements[-1].properties.append((name, KINDS[kind], KINDS[size]))
                case ["property", kind, name]:
                    elements[-1].properties.append((name, KINDS[kind], ""))
    except (IndexError, KeyError, ValueError):
        found = b""
    if not (found and lines[:1] == [["ply"]] and order is not None and _usable(elements)):
        raise MeshError("is no PLY file with a complete header; export it again")
    if sum(element.count for element in elements) <= len(data):  # or else a count is a lie, which is told better below
        for element in elements:
            check_counts(*((0, element.count) if element.name == "face" else (element.count, 0)))
    return order, elements, data[len(head) + 10 :].partition(b"\n")[2]


def _usable(elements: list[Element]) -> bool:
    """Whether there are points and faces with the properties that are needed, each once."""
    names = [element.name for element in elements]
    known = {element.name: element for element in elements}
    if len(known) < len(names) or not {"vertex", "face"} <= known.keys() or min(e.count for e in elements) < 0:
        return False
    twice = any(len({p[0] for p in e.properties}) < len(e.properties) or not e.properties for e in elements)
    plain = {name for name, _, size in known["vertex"].properties if not size}
    lists = [name for name, kind, size in known["face"].properties if size and "f" not in kind + size]
    whole = all("f" not in size for e in elements for _, _, size in e.properties)
    return not twice and whole and {*"xyz"} <= plain == {p[0] for p in known["vertex"].properties} and any(
        name in INDICES for name in lists
    )  # fmt: skip


def _ascii(elements: list[Element], body: bytes) -> Polygons:
    """Polygons of an ASCII file, which has one line for each element."""
    lines, at = text_lines(body), 0
    need = sum(element.count for element in elements)
    if len(lines) < need:
        raise _cut(len(lines), need, "lines")
    places: list[bytes] = []
    corners: list[bytes] = []
    sizes: list[int] = []
    for element in elements:
        rows = (line.split() for line in lines[at : at + element.count])
        names = [name for name, _, _ in element.properties]
        if element.name == "vertex":
            columns = [names.index(axis) for axis in "xyz"]
            for row in rows:
                if len(row) < len(names):
                    raise MeshError(f"is damaged: a point has fewer than {len(names)} numbers; export it again")
                places += [row[c] for c in columns]
        elif element.name == "face":
            for row in rows:
                listed = _list_of(element, row)
                check_corners(len(listed), len(corners))
                corners += listed
                sizes.append(len(listed))
        at += element.count
    return numbers(places, "f8").reshape(-1, 3), np.array(sizes, np.int64), numbers(corners, "i8")


def _list_of(element: Element, row: list[bytes]) -> list[bytes]:
    """Corners of a face in the words of its line."""
    at = 0
    for name, _, size in element.properties:
        count = int(numbers(row[at : at + 1] or [b"none"], "i8")[0]) if size else 1
        first = at + bool(size)
        if not 0 <= count <= len(row) - first:
            raise MeshError(
                f"is damaged: a face is said to have {count} corners, its line has {len(row) - first} "
                "numbers; export it again"
            )
        if name in INDICES:
            return row[first : first + count]
        at = first + count
    raise AssertionError(element)


def _binary_faces(element: Element, order: str, body: bytes, at: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Corners of each element's list, all corners, and the place behind; at once where all lists are equally long."""
    lengths = _lengths(element, order, body, at)
    record = _record(element, order, lengths)
    if record.itemsize * element.count <= len(body) - at:
        found = np.frombuffer(body, record, element.count, at)
        if all((found[f"n {name}"] == n).all() for name, n in lengths.items()):
            name = next((name for name in INDICES if name in lengths), None)
            listed = found[name] if name else np.empty((element.count, 0))
            count = listed.shape[1]
            return np.full(element.count, count), listed.astype(np.int64).ravel(), at + found.nbytes
    return _one_by_one(element, order, body, at)


def _record(element: Element, order: str, lengths: dict[str, int]) -> np.dtype:
    parts: list[tuple] = []
    for name, kind, size in element.properties:
        parts += (
            [(f"n {name}", order + size), (name, order + kind, (lengths[name],))] if size else [(name, order + kind)]
        )
    return np.dtype(parts)


def _lengths(element: Element, order: str, body: bytes, at: int) -> dict[str, int]:
    """Lengths of the lists of the element that begins at a place."""
    found = {}
    for name, kind, size in element.properties:
        if size:
            if at + np.dtype(size).itemsize > len(body):
                raise _cut(len(body), at + np.dtype(size).itemsize, "bytes")
            found[name] = int(np.frombuffer(body, order + size, 1, at)[0])
            if not 0 <= found[name] <= MOST_CORNERS:
                raise MeshError(
                    f"is damaged: a list of {found[name]} members, expected at most {MOST_CORNERS}; export it again"
                )
            at += np.dtype(size).itemsize
        at += np.dtype(kind).itemsize * found.get(name, 1)
    return found


def _one_by_one(element: Element, order: str, body: bytes, at: int) -> tuple[np.ndarray, np.ndarray, int]:
    """As `_binary_faces`, for lists of different lengths."""
    sizes, corners = [], [np.empty(0, np.int64)]
    records: dict[tuple[int, ...], np.dtype] = {}
    for _ in range(element.count):
        lengths = _lengths(element, order, body, at)
        record = records.setdefault(tuple(lengths.values()), _record(element, order, lengths))
        if at + record.itemsize > len(body):
            raise _cut(len(body), at + record.itemsize, "bytes")
        name = next((name for name in INDICES if name in lengths), None)
        if name:
            corners.append(np.frombuffer(body, record, 1, at)[name][0].astype(np.int64))
            sizes.append(lengths[name])
        at += record.itemsize
    return np.array(sizes, np.int64), np.concatenate(corners), at


def _cut(have: int, need: int, what: str) -> MeshError:
    return MeshError(f"is cut short: {have} {what} of data, but its header calls for {need}; export it again")
