"""Mesh files: what they may be and how large, and their triangles, which trimesh reads.

A file is judged before trimesh sees it (what it is, how large, how many faces it declares) and after (how many faces
came out): a damaged file is refused with one sentence, never half read. Nothing is merged, dropped or turned here;
`fem.objects.triangles` does that. numpy and trimesh are loaded when a mesh is read: `check` needs the limits alone.
"""

from __future__ import annotations

import io
import json
import math
import re
import warnings
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from softjaw.fem.errors import MeshError

if TYPE_CHECKING:
    import numpy as np
    import trimesh
    from numpy.typing import NDArray

# Each unit is ``times / over`` metres, so that converting rounds once.
LENGTHS = {"mm": (1, 1000), "cm": (1, 100), "m": (1, 1), "inch": (0.0254, 1)}
ENDINGS = (".stl", ".obj", ".ply", ".off", ".glb", ".gltf", ".3mf")
SCENES = (".glb", ".gltf", ".3mf")  # several bodies, each with a place of its own
LARGEST_FILE = 250 * 2**20  # bytes
MOST_FACES = 5_000_000
MOST_POINTS = 3 * MOST_FACES  # as many as an STL file has, where every triangle has its own
NUMBERS = 8  # kinds of numbers at a point of a scene, at most: place, normal, colours, ...
GLB_HEAD = 20  # bytes before the description of a binary glTF file
STL_HEAD, STL_FACET = 84, 50  # bytes of a binary STL file
FOLDED = math.pi - 1e-3  # angle between the normals of two triangles that lie on each other
# Points and faces that a text declares, by its lines or in its head.
DECLARED = {
    ".obj": (rb"^v ", rb"^f "),
    ".ply": (rb"^element[ \t]+vertex[ \t]+(\S+)", rb"^element[ \t]+face[ \t]+(\S+)"),
    ".off": (rb"^C?OFF\s+(?:#.*\s+)*(\d+)\s", rb"^C?OFF\s+(?:#.*\s+)*\d+\s+(\d+)"),
}


def read_triangles(path: Path) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Corners ``(k, 3)`` in the file's own unit and triangles ``(m, 3)`` of a mesh file.

    The bodies of a scene come in their places. Faces of more corners are cut into triangles where they are convex.

    Raises `MeshError`: the file cannot be read, is no mesh, too large or damaged.
    """
    import numpy as np

    try:
        if expected := lacking(path):
            raise MeshError(f"{path}: expected {expected}")
        kind, data = path.suffix.lower(), path.read_bytes()
    except OSError as problem:
        raise MeshError(f"{path}: cannot be read ({problem.strerror}); check the path") from problem
    if kind == ".stl" and not _is_text(data):
        data = _whole_binary_stl(path, data)
    if kind == ".obj":
        data = _plain_obj(path, data)
    points, faces = _declared(path, kind, data)
    if points > MOST_POINTS or faces > MOST_FACES:
        raise MeshError(
            f"{path}: the mesh has {points} points and {faces} faces, more than {MOST_POINTS} and {MOST_FACES}; "
            "decimate it, to about a tenth of the pad's element size nothing is lost"
        )
    if not faces:
        raise MeshError(f"{path}: the mesh is empty: it holds no triangles; export it as a surface mesh")
    mesh = _loaded(path, data)
    # a reader may leave out what it cannot read without a word
    if len(mesh.faces) < faces:
        raise MeshError(
            f"{path}: is truncated or damaged: {faces} faces declared, {len(mesh.faces)} triangles read; export again"
        )
    # polygons are cut into fans, which fold over where a polygon is not convex
    with np.errstate(invalid="ignore"):  # of points that are refused later
        folded = kind not in SCENES and len(mesh.faces) > faces and (mesh.face_adjacency_angles > FOLDED).any()
    if folded:
        text = f"{path}: has polygons that are not convex, expected triangles; triangulate the mesh when you export it"
        raise MeshError(text)
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64)


def lacking(path: Path) -> str:
    """What is expected of a file that cannot be a mesh: a known ending, content, a size; empty of one that can be."""
    endings = ", ".join(ENDINGS)
    if not path.exists():
        return "a file that is there; the path in a scene is relative to the scene file"
    if path.suffix.lower() not in ENDINGS:
        return f"a triangle mesh in a {endings} file; convert it to .stl"
    if not path.is_file() or not (size := path.stat().st_size):  # a device or a pipe may have no end
        return "a file that is not empty"
    return f"at most {LARGEST_FILE >> 20} MiB; decimate the mesh, or save it as binary .stl" * (size > LARGEST_FILE)


def stated_unit(path: Path) -> str:
    """Unit of the coordinates that a file itself says: of 3MF as `LENGTHS` has it where it does; else empty."""
    if path.suffix.lower() in (".glb", ".gltf"):
        return "m"
    if path.suffix.lower() != ".3mf":
        return ""
    with suppress(Exception), zipfile.ZipFile(path) as archive:  # reading it tells what is wrong with it
        heads = [archive.open(name).read(4096) for name in archive.namelist() if name.endswith(".model")]
        attribute = re.search(rb'<model[^>]*\sunit="(\w+)"', b"".join(heads))
        word = attribute[1].decode() if attribute else "millimeter"
        return {"millimeter": "mm", "centimeter": "cm", "meter": "m"}.get(word, word)
    return ""


def _is_text(data: bytes) -> bool:
    """Whether an STL file is text; binary ones may begin with "solid" too, but then have no facets near."""
    return data[:5].lower() == b"solid" and b"facet" in data[:1000].lower()


def _whole_binary_stl(path: Path, data: bytes) -> bytes:
    """The bytes that a binary STL file's head calls for; some programs write more."""
    count = int.from_bytes(data[STL_HEAD - 4 : STL_HEAD], "little") if len(data) >= STL_HEAD else -1
    need = STL_HEAD + STL_FACET * max(count, 0)
    if count < 0 or len(data) < need:
        text = f"{path}: truncated, or not an STL file: {len(data)} bytes, expected at least {need}; export it again"
        raise MeshError(text)
    return data[:need]


def _plain_obj(path: Path, data: bytes) -> bytes:
    """An OBJ file whose faces hold nothing but points: trimesh takes all faces to be written like the first."""
    # a backslash continues a line, and the patterns below look at whole lines
    data = data.replace(b"\\\r\n", b" ").replace(b"\\\n", b" ").replace(b"\t", b" ")
    # patterns that begin with a letter of their own are looked for twenty times as fast
    data = re.sub(rb"\n +", b"\n", re.sub(rb"#[^\r\n]*", b"", data).lstrip(b" "))
    data = re.sub(rb"^f .*$", lambda face: re.sub(rb"/\S*", b"", face[0]), data, flags=re.MULTILINE)
    if re.search(rb"^f(?:.* )?0(?:\s|$)", data, re.MULTILINE):
        raise MeshError(f"{path}: is damaged: a face refers to point 0, but OBJ files count from 1; export it again")
    # such numbers count from the points read so far, not from the last of all
    back = re.search(rb"^f.* -", data, re.MULTILINE)
    if back and re.search(rb"^v ", data[back.start() :], re.MULTILINE):
        text = f"{path}: has faces that count back among its points; export it with all points before the faces"
        raise MeshError(text)
    return data


def _declared(path: Path, kind: str, data: bytes) -> tuple[int, int]:
    """Points and faces that a file says it has, which are counted or read from its head."""
    if kind == ".stl":
        faces = data.lower().count(b"endfacet") if _is_text(data) else (len(data) - STL_HEAD) // STL_FACET
        return 3 * faces, faces
    if kind in SCENES:
        return _declared_in_scene(path, kind, data), 1
    numbers = [re.findall(pattern, data, re.MULTILINE) for pattern in DECLARED[kind]]
    if kind == ".obj":
        return len(numbers[0]), len(numbers[1])
    # fifteen digits are too many already, and what follows them need not be digits
    points, faces = (int(values[0][:15]) if values and values[0][:15].isdigit() else 0 for values in numbers)
    return points, faces


def _declared_in_scene(path: Path, kind: str, data: bytes) -> int:
    """Numbers that a scene's reader would make room for, with every body counted at each of its places."""
    try:
        if kind == ".3mf":
            with zipfile.ZipFile(io.BytesIO(data)) as archive:
                size = sum(entry.file_size for entry in archive.infolist())
            return MOST_POINTS + 1 if size > LARGEST_FILE else 1
        length = int.from_bytes(data[GLB_HEAD - 8 : GLB_HEAD - 4], "little")
        tree = json.loads(data[GLB_HEAD : GLB_HEAD + length] if kind == ".glb" else data)
        counts = [int(accessor["count"]) for accessor in tree.get("accessors", ())]
        parents = sum(len(node.get("children", ())) for node in tree.get("nodes", ()))
        # places of bodies in a scene
        if min(counts, default=0) < 0 or parents >= max(len(tree.get("nodes", ())), 1) or parents > 10_000:
            raise ValueError("its nodes are no tree, or a count is negative")
        return sum(counts) // NUMBERS
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, zipfile.BadZipFile) as problem:
        raise _damaged(path, problem) from problem


def _damaged(path: Path, problem: BaseException) -> MeshError:
    reason = ascii(f"{type(problem).__name__}: {problem}")[1:200]
    return MeshError(f"{path}: is damaged or not what its ending says ({reason}); export it again")


class _Beside:
    """Files beside a mesh file, which it may name: buffers of glTF. Nothing else is opened."""

    def __init__(self, path: Path) -> None:
        self._folder = path.parent.resolve()

    def get(self, name: str) -> bytes:
        """Contents of a regular file in the folder of the mesh, of a plausible size."""
        file = (self._folder / name).resolve()
        if file.parent != self._folder or not file.is_file() or file.stat().st_size > LARGEST_FILE:
            raise ValueError(f"it names '{name!a}', expected a file beside it")
        return file.read_bytes()

    __getitem__ = get


def _loaded(path: Path, data: bytes) -> trimesh.Trimesh:
    """The mesh as trimesh reads it: no other file is opened, nothing is changed."""
    import numpy as np
    import trimesh  # a third of a second, and most scenes have no mesh

    kind = path.suffix[1:].lower()
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("error", "string or file could not be read")  # numpy would leave the rest out
            options = {"resolver": _Beside(path)} if kind == "gltf" else {}
            scene = trimesh.load_scene(
                io.BytesIO(data), file_type=kind, process=False, maintain_order=True, skip_materials=True, **options
            )
            # once for each place
            bodies = [scene.geometry[scene.graph[node][1]] for node in scene.graph.nodes_geometry]
            placed = sum(len(getattr(body, "faces", ())) for body in bodies)
            if placed > MOST_FACES:
                raise ValueError(f"its bodies have {placed} faces, expected at most {MOST_FACES}")
            mesh = scene.to_mesh()
            points, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    except Exception as problem:  # whatever a damaged file makes of the reader
        raise _damaged(path, problem) from problem
    if faces.ndim != 2 or faces.shape[1] != 3 or points.shape[1:] != (3,) or not len(faces):
        raise MeshError(f"{path}: is damaged or empty: no triangles could be read; export it again")
    astray = (faces < 0) | (faces >= len(points))
    if astray.any():
        text = f"{path}: damaged, a face has point {faces[astray][0]} of only {len(points)} (from 0); export it again"
        raise MeshError(text)
    return mesh
