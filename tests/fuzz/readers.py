"""Every reader of files from elsewhere: a valid file, how it is read, and the errors by which it may refuse one."""

import base64
import io
import json
import zipfile
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.study.messages import StudyError
from softjaw.study.patch.answer import read_patch
from softjaw.study.patch.patch_reader import Reading
from softjaw.study.scene import SceneError, load_scene
from tests.fuzz.edits import BINARY, TEXTUAL

SCENE = b"""# a study
[object]
shape = "revolution"
profile_mm = [[0, 30], [50, 30], [100, 29], [200, 20]]
name = "bottle"
[gripper]
elements = [4, 4, 2]
material = 'neo_hookean'
[[candidates.poses]]
point_mm = [0.0, 0, 50]
approach = [1, 0, 0]
long_side = [0, 0, 1]
[load]
normal_force_n = [1, 2.5e0]
[sweep]
"friction.mu" = [0.5, 0.8]
[petsc]
contact_snes_max_it = 30
"""
TABLE = b"""x_mm,y_mm,z_mm,area_mm2,nx,ny,nz,pressure_kpa
0,0,0,1,0,0,1,5
1,0,0,1,0,0,1,5.5
0,1,0,1.25,0,0.1,1,7
2,1,0,1,0,0,1,5
"""
POINTS = 30.0 * np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]])
FACES = np.array([[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]])  # octahedron
BODY = trimesh.Trimesh(POINTS, FACES, process=False)
ROWS = "".join([*(f"{x:g} {y:g} {z:g}\n" for x, y, z in POINTS), *(f"3 {a} {b} {c}\n" for a, b, c in FACES)])
BODY_3MF = "<mesh><vertices>{}</vertices><triangles>{}</triangles></mesh>".format(
    "".join(f'<vertex x="{x:g}" y="{y:g}" z="{z:g}"/>' for x, y, z in POINTS),
    "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in FACES),
)
_mesh, _metres = (partial(MeshObject.from_file, unit=unit) for unit in ("mm", "m"))


class Reader(NamedTuple):
    """A valid file's name and bytes, the kinds of edits that fit, the reader and the errors it may raise."""

    name: str
    content: bytes
    kinds: tuple
    read: Callable[[Path], Any]
    errors: tuple = (StudyError,)


def stl(binary):
    return BODY.export(file_type="stl") if binary else BODY.export(file_type="stl_ascii").encode()


def obj():
    faces = (f"f {a}/1 {b} {c}\n" for a, b, c in FACES + 1)
    return "".join([*(f"v {x:g} {y:g} {z:g}\n" for x, y, z in POINTS), *faces]).encode()


def off():
    return ("OFF\n6 8 0\n" + ROWS).encode()


def ply(binary):
    content = BODY.export(file_type="ply")
    head, end, _ = content.partition(b"end_header\n")
    return content if binary else head.replace(b"binary_little_endian", b"ascii") + end + ROWS.encode()


def gltf_tree(**changes):
    """The JSON of a glTF scene of the octahedron in metres, whose buffer lies in it; ``changes`` replace its parts."""
    data = (1e-3 * POINTS).astype("<f4").tobytes() + FACES.astype("<u4").tobytes()
    views = [{"buffer": 0, "byteOffset": 0, "byteLength": 72}, {"buffer": 0, "byteOffset": 72, "byteLength": 96}]
    kinds = [("VEC3", 5126, 6), ("SCALAR", 5125, 24)]
    return {
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": i, "componentType": of, "count": count, "type": kind}
            for i, (kind, of, count) in enumerate(kinds)
        ],
        "bufferViews": views,
        "buffers": [{"byteLength": len(data), "uri": "data:;base64," + base64.b64encode(data).decode()}],
    } | changes  # fmt: skip


def gltf(**changes):
    return json.dumps(gltf_tree(**changes)).encode()


def glb(**changes):
    tree = gltf_tree(**changes)
    data = base64.b64decode(tree["buffers"][0].pop("uri").partition(",")[2])
    text = json.dumps(tree).encode()
    text += b" " * (-len(text) % 4)
    chunks = [len(part).to_bytes(4, "little") + kind + part for kind, part in ((b"JSON", text), (b"BIN\0", data))]
    body = b"".join(chunks)
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(4, "little") + body


def model_3mf(more="", built=1, head=""):
    """The XML of a 3MF file: the octahedron as object 1, ``more`` objects, and which one is built."""
    space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
    return (
        f'<?xml version="1.0" encoding="UTF-8"?>{head}<model unit="millimeter" xmlns="{space}"><resources>'
        f'<object id="1" type="model">{BODY_3MF}</object>{more}</resources>'
        f'<build><item objectid="{built}"/></build></model>'
    ).encode()


def packed(*models, kind=zipfile.ZIP_DEFLATED):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", kind) as archive:
        for i, model in enumerate(models):
            archive.writestr(f"3D/3dmodel{i or ''}.model", model)
    return file.getvalue()


def _scene(path):
    scene = load_scene(path)
    return scene.effective_toml(), scene.digest


def _patch(path):
    return read_patch(str(path), Reading("mm", "kpa"))


def _model(path):
    """A model that is packed as a 3MF file after it has been made wrong, so that its checksum is right."""
    whole = path.with_name("mesh.3mf")
    whole.write_bytes(packed(path.read_bytes()))
    return _mesh(whole)


QUICK = {
    "scene": Reader("scene.toml", SCENE, TEXTUAL, _scene, (SceneError,)),
    "table": Reader("patch.csv", TABLE, TEXTUAL, _patch),
    "ASCII STL": Reader("mesh.stl", stl(False), TEXTUAL, _mesh, (MeshError,)),
    "binary STL": Reader("mesh.stl", stl(True), BINARY, _mesh, (MeshError,)),
    "OBJ": Reader("mesh.obj", obj(), TEXTUAL, _mesh, (MeshError,)),
    "ASCII PLY": Reader("mesh.ply", ply(False), TEXTUAL, _mesh, (MeshError,)),
    "OFF": Reader("mesh.off", off(), TEXTUAL, _mesh, (MeshError,)),
    "binary PLY": Reader("mesh.ply", ply(True), TEXTUAL, _mesh, (MeshError,)),
    "glTF": Reader("mesh.gltf", gltf(), TEXTUAL, _metres, (MeshError,)),
    "GLB": Reader("mesh.glb", glb(), TEXTUAL, _metres, (MeshError,)),
    "3MF": Reader("mesh.3mf", packed(model_3mf()), BINARY, _mesh, (MeshError,)),
    "model of a 3MF": Reader("mesh.model", model_3mf(), TEXTUAL, _model, (MeshError,)),
}
