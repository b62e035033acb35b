"""``softjaw init``: a commented scene and a batch script to start from."""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import sys
from pathlib import Path
from typing import Any

from softjaw.study.exits import CANNOT_WRITE, USAGE, StudyError
from softjaw.study.writing import write_file

HERE = Path(__file__).parent
KINDS = {
    "bottle": "a bottle of revolution, heights x angles x forces; rigid, or thin-walled by taking a # away",
    "cup": "a thin-walled cup: dents, and the window of forces that hold it without spilling",
    "cylinder": "cylinders of several curvatures: what the curved model sees and the planar one does not",
    "mesh": "your own triangle mesh; needs --mesh FILE and --unit",
}
PAD_LENGTH, PAD_WIDTH = 50.0, 22.0  # mm; of objects that are large enough for such pads


def add_options(parser: argparse.ArgumentParser) -> None:
    """Describe the words after ``softjaw init``."""
    parser.add_argument("kind", choices=tuple(KINDS), help="what to start from")
    parser.add_argument("-o", metavar="NAME", dest="name", help="name of both files, also with a folder (default: the "
                        "kind, or the name of the mesh)")  # fmt: skip
    parser.add_argument("--mesh", metavar="FILE", help="mesh of the object: .stl, .obj, .ply or .off")
    parser.add_argument("--unit", choices=("mm", "cm", "m", "inch"), help="unit of the mesh's coordinates")
    parser.add_argument("--axis", choices=("x", "y", "z"), default="z", help="axis of the mesh along which grasps are "
                        "spread (default z)")  # fmt: skip
    parser.add_argument("--force", action="store_true", help="replace files that are there")
    parser.add_argument("--list", action="version", version=f"kinds:\n{kinds()}", help="list the kinds and leave")
    more = "softjaw init mesh --mesh jobs/objects/flask.stl --unit mm -o scenes/flask"
    parser.epilog = f"{parser.epilog}\n  {more}\n\nkinds:\n{kinds()}"


def kinds() -> str:
    """What can be started from."""
    return "\n".join(f"  {name:<9} {text}" for name, text in KINDS.items())


def init(options: argparse.Namespace) -> str:
    """Write both files, and tell what to do next.

    Raises
    ------
    StudyError
        A mesh that is missing or cannot be read, files that are there, or a folder that cannot be written.
    """
    if options.kind != "mesh" and options.mesh:
        raise StudyError(USAGE, f"--mesh: found beside '{options.kind}'; write 'softjaw init mesh --mesh ...'")
    base = _base(options)
    scene, batch = (base.with_name(base.name + ending) for ending in (".toml", ".sbatch"))
    there = [str(path) for path in (scene, batch) if path.exists()]
    if there and not options.force:
        raise StudyError(
            CANNOT_WRITE, f"{' and '.join(there)}: there already; choose another name with -o, or add --force"
        )
    words = {"NAME": base.name, "SOFTJAW": _program()}
    mesh = _about_mesh(options, scene) if options.kind == "mesh" else {}
    words |= mesh
    _write({scene: _filled(f"{options.kind}.toml", words), batch: _filled("run.sbatch", words)})
    unit = f"--unit {options.unit} --axis {options.axis}"
    measured = [f"object:  {mesh['SIZE']} mm, the last along its axis, with {unit}"] if mesh else []
    lines = [
        f"written: {scene!s:<{len(str(batch))}}  the scene: what is grasped, where and how hard",
        f"written: {batch}  a Slurm job that goes on after its time limit",
        *measured,
        f"next:    softjaw check {shlex.quote(str(scene))}",
        f"         mpirun -n 2 softjaw run {shlex.quote(str(scene))}",
    ]
    return "\n".join(lines)


def _base(options: argparse.Namespace) -> Path:
    """Both files without their endings; their name stands in a scene and in a shell script."""
    default = Path(options.mesh).stem if options.mesh else options.kind
    base = Path((options.name or default).removesuffix(".toml"))
    if not re.fullmatch(r"\w[\w.+-]*", base.name):
        text = f"-o: found '{base.name}', expected letters, digits and _ . + -, as in 'bottle-2'"
        raise StudyError(USAGE, f"{text}; the name stands in both files")
    return base


def _program() -> str:
    """The program that a batch job, which knows no virtual environment, has to start."""
    called = Path(sys.argv[0])
    return str(called.absolute() if called.name == "softjaw" else Path(sys.executable).with_name("softjaw"))


def _filled(template: str, words: dict[str, str]) -> str:
    text = (HERE / template).read_text(encoding="utf-8")
    for name, word in words.items():
        text = text.replace(f"@{name}@", word)
    return text


def _write(texts: dict[Path, str]) -> None:
    for path, text in texts.items():
        write_file(path, text, folders=True)


def _about_mesh(options: argparse.Namespace, scene: Path) -> dict[str, str]:
    """What the scene says of a mesh: its file, and stations and pads that fit its size."""
    if not options.mesh or not options.unit:
        needs = {"--mesh FILE": options.mesh, "--unit": options.unit}
        lacks = " and ".join(name for name, given in needs.items() if not given)
        text = f"a mesh needs {lacks}; units are never guessed, as in 'softjaw init mesh --mesh my.stl --unit mm'"
        raise StudyError(USAGE, text)
    across, height = _size(options)
    length = min(PAD_LENGTH, _rounded(0.5 * height))
    width = min(PAD_WIDTH, _rounded(min(across)))
    file = os.path.relpath(Path(options.mesh).absolute(), scene.absolute().parent)
    return {
        "MESH": json.dumps(file, ensure_ascii=False),
        "UNIT": options.unit,
        "AXIS": options.axis,
        "SIZE": " x ".join(f"{side:.4g}" for side in (*across, height)),
        "LENGTH": f"{length:g}",
        "WIDTH": f"{width:g}",
        "LOW": f"{_rounded(0.5 * length):g}",
        "HIGH": f"{height - 0.5 * length:.4g}",
    }


def _size(options: argparse.Namespace) -> tuple[tuple[float, float], float]:
    """Extents across and along the axis [mm] of a mesh that a study can take."""
    from softjaw.study.case.build import build_object
    from softjaw.study.scene.shapes import Mesh

    shape = Mesh(shape="mesh", mesh=str(Path(options.mesh).absolute()), unit=options.unit, axis=options.axis)
    try:
        built: Any = build_object(shape)
    except (ValueError, OSError) as error:
        raise StudyError(USAGE, f"--mesh: {error}") from error
    sides = 1e3 * (built.bounds[1] - built.bounds[0])
    return (float(sides[0]), float(sides[1])), float(sides[2])


def _rounded(length: float) -> float:
    """A length in whole mm, or with two digits where it is short.

    >>> _rounded(33.4), _rounded(3.456)
    (33.0, 3.5)
    """
    return float(f"{length:.2g}") if length < 10 else float(round(length))
