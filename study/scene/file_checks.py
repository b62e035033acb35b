"""What files and PETSc options named in a scene must satisfy."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any

from softjaw.fem.objects.mesh_file import ENDINGS, LARGEST_FILE
from softjaw.study.scene.errors import Finding, shown
from softjaw.study.scene.sections import Output
from softjaw.study.scene.shapes import Mesh

OTHERS = "others go into the environment variable PETSC_OPTIONS"


def output_file(output: Output) -> Iterator[Finding]:
    """Results end in .hdf, the one ending that every viewer takes, and stay below the working directory."""
    path, parts = ("output", "file"), PurePosixPath(output.file).parts
    if not output.file.endswith(".hdf"):
        remedy = f"write {shown(re.sub(r'[.][A-Za-z0-9]*$', '', output.file) + '.hdf')}"
        yield Finding(path, shown(output.file), "a file ending in .hdf, which all viewers open", remedy)
    if PurePosixPath(output.file).is_absolute() or PureWindowsPath(output.file).drive or ".." in parts:
        remedy = "give any other place on the command line with `-o`"
        yield Finding(path, shown(output.file), "a path below the working directory", remedy)


def petsc_options(table: Mapping[str, Any]) -> Iterator[Finding]:
    """Options of the contact solver only, and none that writes files or runs code."""
    for key, value in table.items():
        path, bare = ("petsc", key), re.sub(r"^-*(contact_)?", "", key)
        if not re.fullmatch(r"contact_[a-z0-9_]+", key):
            remedy = f"write `contact_{bare}` if the contact solver is meant; {OTHERS}"
            expected = "an option of the contact solver, contact_..., as softjaw takes no others"
            yield Finding(path, f"the option {shown(key)}", expected, remedy)
        elif bare.endswith("python_type"):
            yield Finding(path, "an option that runs Python code", "options of the solver itself", "remove it")
        elif not isinstance(value, str | int | float):
            yield Finding(path, shown(value), "text, a number, or true or false", "write the option's value alone")
        elif isinstance(value, str) and not re.fullmatch(r"[A-Za-z0-9_,.+-]*", value):
            remedy = "options that name files go into the environment variable PETSC_OPTIONS"
            yield Finding(path, shown(value), "a word, a number or a list of them", remedy)


def mesh_file(shape: Mesh) -> Iterator[Finding]:
    """The mesh's file exists and can be one (its content is judged when it is read)."""
    file, path = Path(shape.mesh), ("object", "mesh")
    remedy = "the path is relative to the scene file"
    if file.suffix.lower() not in ENDINGS:
        yield Finding(path, shown(file.name), f"a triangle mesh in a {', '.join(ENDINGS)} file", "convert it to .stl")
    elif not file.is_file():
        found = "a directory" if file.is_dir() else "no such file"
        yield Finding(path, f"{found} at {file}", "the file of a triangle mesh", remedy)
    elif not (size := file.stat().st_size):
        yield Finding(path, f"an empty file at {file}", "the file of a triangle mesh", remedy)
    elif size > LARGEST_FILE:
        expected = f"at most {LARGEST_FILE >> 20} MiB"
        yield Finding(path, f"{size >> 20} MiB in {file}", expected, "decimate the mesh, or save it as binary .stl")
