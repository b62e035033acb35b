"""Many objects in one scene: ``object.mesh`` names a pattern, as ``meshes/*.stl``, or a CSV file with a mesh a line.

The columns of the CSV are keys of the scene, those of ``[object]`` without the section: ``mesh,unit,mass_g``. Every
object is an ordinary scene, with its own mesh and what its line says put in. Its name follows from its own path or line
alone, so that other objects may come and go: ``a-mug`` of ``a/mug.stl`` and ``*/*.stl``, or the column ``name``.
"""

import csv
import hashlib
import json
from collections.abc import Sequence
from pathlib import Path, PurePath
from typing import Any, NamedTuple

from softjaw.fem.objects.mesh_file import ENDINGS
from softjaw.study.messages import USAGE, StudyError, fault_of, shortened, shown
from softjaw.study.result.index import INDEX
from softjaw.study.scene.model import Scene, file_digest, load_scene, put_overrides
from softjaw.study.scene.objects import Mesh
from softjaw.study.scene.section import SceneError
from softjaw.study.scene.text import parse_toml, quoted, read_text

Lines = list[tuple[str, dict[str, str]]]  # of each object where it is listed, and its cells, its name among them
PATTERN = set("*?[")
TEXTS = ("mesh", "name", "unit", "axis")  # columns whose cells are texts, whatever they look like
EXPECTED = "expected a pattern that mesh files match, as `meshes/*.stl`, or a CSV file with a column `mesh`"


class Listed(NamedTuple):
    """One object of a folder: its name, where it is listed, its mesh, and what makes its scene, as for ``--set``."""

    name: str
    place: str
    mesh: str
    overrides: tuple[str, ...]


class ObjectFolder(NamedTuple):
    """The objects that a scene names together; ``overrides`` are those of all of them."""

    scene_file: str
    overrides: tuple[str, ...]
    objects: tuple[Listed, ...]

    def overrides_of(self, listed: Listed) -> tuple[str, ...]:
        """All overrides of one object's scene."""
        return (*self.overrides, *listed.overrides)

    def scene(self, listed: Listed, check_files: bool = True) -> Scene:
        """The scene of one object; raises `SceneError` with everything that is wrong with it."""
        try:
            return load_scene(self.scene_file, self.overrides_of(listed), check_files)
        except SceneError as error:
            cells = {f"--set {shortened(text)}" for text in listed.overrides}
            placed = [p._replace(file=listed.place) if p.file in cells else p for p in error.problems]
            raise SceneError(placed) from None

    def check(self) -> Scene:
        """The scene of the first object that has one, whether its mesh is there or not.

        Raises `SceneError` with everything that is wrong with the first where none has.
        """
        errors = []
        for listed in self.objects:
            try:
                return self.scene(listed, check_files=False)
            except SceneError as error:
                errors.append(error)
        raise errors[0]


def folder_of(scene_file: str, overrides: Sequence[str]) -> ObjectFolder | None:
    """The objects of a scene that names many; None for a scene of one.

    Raises `StudyError`: no mesh matches, two have one name, the CSV file cannot be used, or the scene is no TOML.
    """
    path = Path(scene_file)
    data = parse_toml(read_text(path), scene_file)
    problems = put_overrides(data, overrides, {})
    table = data.get("object")
    mesh = table.get("mesh") if isinstance(table, dict) else None
    if not isinstance(table, dict) or not isinstance(mesh, str):
        return None
    if (shape := table.get("shape")) != "mesh":
        text = f"found {shown(shape)}, expected \"mesh\" beside object.mesh, or --objects"
        raise StudyError(USAGE, f"{scene_file}: object.shape: {text}")
    file, in_table = path.parent / mesh, mesh.lower().endswith(".csv")
    if not in_table and (not PATTERN & set(mesh) or file.is_file()):
        return None
    if problems:  # one of them may name the meshes
        raise SceneError(problems)
    lines = _of_table(file) if in_table else _of_pattern(path.parent, mesh)
    if not lines:
        raise StudyError(USAGE, f"{scene_file}: object.mesh: found '{mesh}', which names no mesh; {EXPECTED}")
    objects: dict[str, Listed] = {}
    for place, line in lines:
        try:
            line["mesh"].encode()
        except UnicodeEncodeError:
            raise StudyError(USAGE, f"{line['mesh']!a}: found a name that is no UTF-8; rename it") from None
        name = line["name"] + "-object" * (line["name"].lower() == INDEX)
        listed = Listed(name, place, line["mesh"], tuple(_override(key, cell) for key, cell in line.items() if cell))
        if (other := objects.setdefault(name.lower(), listed)) is not listed:
            text = f"{other.place} and {place}: both objects have the name '{name}'; narrow the pattern, rename one,"
            raise StudyError(USAGE, f"{text} or list them in a CSV file with a column `name`")
    common = tuple(text for text in overrides if text.partition("=")[0].strip() != "object.mesh")
    return ObjectFolder(scene_file, common, tuple(objects.values()))


def _of_pattern(root: Path, pattern: str) -> Lines:
    parts = list(PurePath(pattern).parts)
    while len(parts) > 1 and (not PATTERN & set(parts[0]) or (root / parts[0]).exists()):
        root /= parts.pop(0)
    paths = [p for p in sorted(root.glob("/".join(parts))) if p.suffix.lower() in ENDINGS and not p.is_dir()]
    places = [path.relative_to(root) for path in paths]
    names = ["-".join(place.with_suffix("").parts) for place in places]
    return [(str(p), {"name": n, "mesh": str(m.resolve())}) for p, n, m in zip(places, names, paths, strict=True)]


def _of_table(path: Path) -> Lines:
    unread = fault_of(f"{path}: cannot be read", OSError, UnicodeDecodeError, csv.Error, ending=f"; {EXPECTED}")
    with unread, path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.DictReader(file, skipinitialspace=True)
        lines: list[tuple[str, dict[Any, Any]]] = [(f"{path}:{reader.line_num}", line) for line in reader]
    columns = [name for name in reader.fieldnames or () if name]
    if "mesh" not in columns or len(set(columns)) < len(columns):
        text = f"{path}:1: found {shown(', '.join(columns))}, expected distinct columns, `mesh` among them, and commas"
        raise StudyError(USAGE, text)
    if of_run := [name for name in columns if name.startswith("run.")]:
        raise StudyError(USAGE, f"{path}:1: found the column {of_run[0]}, expected it in the scene, for all objects")
    for place, line in lines:
        if None in line or not line["mesh"]:
            what = "more cells than columns" if None in line else "no mesh"
            raise StudyError(USAGE, f"{place}: found {what}, expected one cell for each column, a mesh in each")
        line["name"] = line.get("name") or PurePath(line["mesh"]).stem
        if PurePath(line["name"]).name != line["name"]:
            raise StudyError(USAGE, f"{place}: found the name {shown(line['name'])}, expected one of a file")
        line["mesh"] = str((path.parent / line["mesh"]).resolve())
    return lines


def _override(key: str, cell: str) -> str:
    return f"{key if '.' in key else f'object.{key}'}={quoted(cell) if key in TEXTS else cell}"


def key_of(scene: Scene) -> str:
    """SHA-256 of all that an object's results follow from, before its grasps are sampled; not names, ``[run]``."""
    data = scene.effective()
    del data["run"], data["object"]["name"]
    if isinstance(scene.object, Mesh):
        data["object"]["mesh"] = file_digest(scene.object.mesh)
    return hashlib.sha256(json.dumps(data, sort_keys=True).encode()).hexdigest()
