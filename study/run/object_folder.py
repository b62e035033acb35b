"""Many objects in one scene: ``object.mesh`` names a pattern, as ``meshes/*.stl``, or a CSV file with a mesh a line.

The columns of the CSV are keys of the scene, those of ``[object]`` without the section: ``mesh,unit,mass_g``. Every
object is an ordinary scene, with its own mesh and what its line says put in.
"""

from __future__ import annotations

import csv
import hashlib
import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path, PurePath
from typing import Any

from softjaw.fem.objects.mesh_file import ENDINGS
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.result.index import INDEX
from softjaw.study.scene.model import Scene, file_digest, load_scene, put_overrides
from softjaw.study.scene.objects import Mesh
from softjaw.study.scene.text import parse_toml, read_text

TEXTS = ("mesh", "name", "unit", "axis")  # columns whose cells are texts, whatever they look like
EXPECTED = "expected a pattern that mesh files match, as `meshes/*.stl`, or a CSV file with a column `mesh`"


@dataclass(frozen=True)
class Listed:
    """One object of a folder: its name, its mesh, and what makes its scene of the common one, as ``--set`` takes it."""

    name: str
    mesh: str
    overrides: tuple[str, ...]


@dataclass(frozen=True)
class ObjectFolder:
    """The objects that a scene names together; ``overrides`` are those of all of them."""

    scene_file: str
    overrides: tuple[str, ...]
    objects: tuple[Listed, ...]

    def overrides_of(self, listed: Listed) -> tuple[str, ...]:
        """All overrides of one object's scene."""
        return (*self.overrides, *listed.overrides)

    def scene(self, listed: Listed) -> Scene:
        """The scene of one object; raises `SceneError` with everything that is wrong with it."""
        return load_scene(self.scene_file, self.overrides_of(listed))

    def check(self) -> Scene:
        """The scene of the first object, whether its mesh is there or not; what is wrong with it is so for all.

        Raises `SceneError` with everything that is wrong.
        """
        return load_scene(self.scene_file, self.overrides_of(self.objects[0]), check_files=False)


def folder_of(scene_file: str, overrides: Sequence[str]) -> ObjectFolder | None:
    """The objects of a scene that names many; None for a scene of one.

    Raises `StudyError`: no mesh matches, the CSV file cannot be used, or the scene is no TOML.
    """
    path = Path(scene_file)
    data = parse_toml(read_text(path), scene_file)
    put_overrides(data, overrides, {})
    table = data.get("object")
    mesh = table.get("mesh") if isinstance(table, dict) else None
    if not isinstance(mesh, str) or not (set("*?[") & set(mesh) or mesh.lower().endswith(".csv")):
        return None
    lines = _of_table(path.parent / mesh) if mesh.lower().endswith(".csv") else _of_pattern(path.parent, mesh)
    if not lines:
        raise StudyError(USAGE, f"{scene_file}: object.mesh: found '{mesh}', which names no mesh; {EXPECTED}")
    objects = [
        Listed(name, line["mesh"], tuple(_override(key, cell) for key, cell in ({"name": name} | line).items() if cell))
        for name, line in zip(_names([line["mesh"] for line in lines]), lines, strict=True)
    ]
    common = tuple(text for text in overrides if text.partition("=")[0].strip() != "object.mesh")
    return ObjectFolder(scene_file, common, tuple(objects))


def _of_pattern(folder: Path, pattern: str) -> list[dict[str, str]]:
    root = Path(PurePath(pattern).anchor or folder)
    paths = sorted(root.glob(str(PurePath(pattern).relative_to(PurePath(pattern).anchor))))
    return [{"mesh": str(path.resolve())} for path in paths if path.suffix.lower() in ENDINGS]


def _of_table(path: Path) -> list[dict[str, str]]:
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            lines: list[dict[Any, Any]] = list(csv.DictReader(file, skipinitialspace=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise StudyError(USAGE, f"{path}: cannot be read ({error}); {EXPECTED}") from error
    for number, line in enumerate(lines, start=2):
        if None in line or not line.get("mesh"):
            what = "more cells than columns" if None in line else "no mesh"
            raise StudyError(USAGE, f"{path}:{number}: found {what}, expected one cell for each column, a mesh in each")
        line["mesh"] = str((path.parent / line["mesh"]).resolve())
    return lines


def _override(key: str, cell: str) -> str:
    return f"{key if '.' in key else f'object.{key}'}={json.dumps(cell) if key in TEXTS else cell}"


def _names(meshes: Sequence[str]) -> list[str]:
    """A name for each mesh: its file's, with its folder where others have the same, with its ending at last.

    >>> _names(["/a/mug.stl", "/a/cup.stl", "/b/cup.stl", "/b/index.obj"])
    ['mug', 'a-cup', 'b-cup', 'b-index']
    """
    paths = [PurePath(mesh) for mesh in meshes]
    names = [path.stem for path in paths]
    for longer in (lambda p: f"{p.parent.name}-{p.stem}", lambda p: f"{p.parent.name}-{p.stem}-{p.suffix[1:]}"):
        seen = Counter(name.lower() for name in names)
        clashes = [seen[name.lower()] > 1 or name.lower() == INDEX for name in names]
        names = [longer(path) if clash else name for clash, path, name in zip(clashes, paths, names, strict=True)]
    seen = Counter()
    for i, name in enumerate(names):
        seen[name.lower()] += 1
        names[i] = f"{name}-{seen[name.lower()]}" if seen[name.lower()] > 1 else name
    return names


def key_of(scene: Scene) -> str:
    """SHA-256 of all that an object's results follow from, before its grasps are sampled; not names, ``[run]``."""
    data = scene.effective()
    del data["run"], data["object"]["name"]
    if isinstance(scene.object, Mesh):
        data["object"]["mesh"] = file_digest(scene.object.mesh)
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
