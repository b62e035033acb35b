"""Every reader of files from elsewhere: a valid file, how it is read, and the errors by which it may refuse one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from softjaw.fem.errors import MeshError
from softjaw.study.messages import StudyError
from softjaw.study.scene import SceneError
from tests.fuzz.edits import BINARY, TEXTUAL


class Reader(NamedTuple):
    """A valid file's name and bytes, the kinds of edits that fit, the reader and the errors it may raise."""

    name: str
    content: bytes
    kinds: tuple
    read: Callable[[Path], Any]
    errors: tuple = (StudyError,)


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
FACES = np.array(
    [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4], [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
)  # an octahedron


def stl(binary):
    if binary:
        record = np.zeros(len(FACES), np.dtype([("n", "<f4", 3), ("v", "<f4", (3, 3)), ("a", "<u2")]))
        record["v"] = POINTS[FACES]
        return b"\0" * 80 + len(FACES).to_bytes(4, "little") + record.tobytes()
    facets = ("".join(f"vertex {x:g} {y:g} {z:g}\n" for x, y, z in corners) for corners in POINTS[FACES])
    body = "".join(f"facet normal 0 0 0\nouter loop\n{facet}endloop\nendfacet\n" for facet in facets)
    return f"solid s\n{body}endsolid s\n".encode()


def obj():
    return "".join(
        [*(f"v {x:g} {y:g} {z:g}\n" for x, y, z in POINTS), *(f"f {a}/1 {b} {c}\n" for a, b, c in FACES + 1)]
    ).encode()


def off():
    rows = [*(" ".join(f"{x:g}" for x in p) for p in POINTS), *(f"3 {a} {b} {c}" for a, b, c in FACES)]
    return ("OFF\n6 8 0\n" + "\n".join(rows) + "\n").encode()


def ply(binary):
    head = f"ply\nformat {'binary_little_endian' if binary else 'ascii'} 1.0\nelement vertex 6\n"
    head += "".join(f"property float {axis}\n" for axis in "xyz")
    head += "element face 8\nproperty list uchar int vertex_indices\nend_header\n"
    if binary:
        faces = np.zeros(8, [("n", "u1"), ("v", "<i4", 3)])
        faces["n"], faces["v"] = 3, FACES
        return head.encode() + POINTS.astype("<f4").tobytes() + faces.tobytes()
    rows = [*(" ".join(f"{x:g}" for x in p) for p in POINTS), *(f"3 {a} {b} {c}" for a, b, c in FACES)]
    return (head + "\n".join(rows) + "\n").encode()


def _scene(path):
    from softjaw.study.scene import load_scene

    scene = load_scene(path)
    return scene.effective_toml(), scene.digest


def _patch(path):
    from softjaw.study.patch.contacts import read_patch
    from softjaw.study.patch.patch_reader import Reading

    return read_patch(str(path), Reading("mm", "kpa"))


def _mesh(path):
    from softjaw.fem.objects.mesh_object import MeshObject

    return MeshObject.from_file(path, "mm")


def _result(path):
    from softjaw.study.export.cases import as_csv
    from softjaw.study.result.read import dataset
    from softjaw.study.result.store import open_result
    from softjaw.study.show.best_grasps import best
    from softjaw.study.show.status import status_text
    from softjaw.study.table import as_json

    with open_result(path) as result:
        ds = dataset(result)
        return as_csv(ds), as_json(best(ds, None, 3)), status_text(result, 80)


QUICK = {
    "scene": Reader("scene.toml", SCENE, TEXTUAL, _scene, (SceneError,)),
    "table": Reader("patch.csv", TABLE, TEXTUAL, _patch),
    "ASCII STL": Reader("mesh.stl", stl(False), TEXTUAL, _mesh, (MeshError,)),
    "binary STL": Reader("mesh.stl", stl(True), BINARY, _mesh, (MeshError,)),
    "OBJ": Reader("mesh.obj", obj(), TEXTUAL, _mesh, (MeshError,)),
    "ASCII PLY": Reader("mesh.ply", ply(False), TEXTUAL, _mesh, (MeshError,)),
    "OFF": Reader("mesh.off", off(), TEXTUAL, _mesh, (MeshError,)),
    "binary PLY": Reader("mesh.ply", ply(True), TEXTUAL, _mesh, (MeshError,)),
}


def slow_readers(folder: Path) -> dict[str, Reader]:
    """Readers whose libraries have to be kept apart, with files that take a while to make."""
    from tests.study.formula_results import make
    from tests.study.patch_files import cylinder_mesh, vtk

    points, cells = cylinder_mesh()
    grids = [vtk(folder / f"seed.{end}", points, cells, [("pressure", np.ones(len(cells)))]) for end in ("vtu", "vtp")]
    return {
        "VTU": Reader("patch.vtu", grids[0].read_bytes(), TEXTUAL, _patch),
        "VTP": Reader("patch.vtp", grids[1].read_bytes(), TEXTUAL, _patch),
        "result": Reader("result.hdf", make(folder / "seed.hdf").read_bytes(), BINARY, _result),
    }
