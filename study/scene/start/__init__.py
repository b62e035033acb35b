"""``softjaw init``: a commented scene and a batch script to start from."""

from __future__ import annotations

import json
import os
import re
import shlex
import sys
from argparse import Namespace
from collections.abc import Callable, Sequence
from pathlib import Path

from softjaw.study.messages import CANNOT_WRITE, USAGE, StudyError, write_file

HERE = Path(__file__).parent
PAD_LENGTH = 50.0  # mm, as in the templates


def init(options: Namespace, measure: Callable[[Namespace], Sequence[float]]) -> str:
    """Write both files, and say what to do next; ``measure`` gives the extents of the mesh [mm], the axis last.

    Raises
    ------
    StudyError
        A mesh that is missing or cannot be read, files that exist, or a folder that cannot be written.
    """
    if options.kind != "mesh" and options.mesh:
        raise StudyError(USAGE, f"--mesh: found beside '{options.kind}'; write 'softjaw init mesh --mesh ...'")
    base = _base(options)
    scene, batch = (base.with_name(base.name + ending) for ending in (".toml", ".sbatch"))
    existing = [str(path) for path in (scene, batch) if path.exists()]
    if existing and not options.force:
        raise StudyError(
            CANNOT_WRITE, f"{' and '.join(existing)}: existing file; choose another name with -o, or add --force"
        )
    words = {"NAME": base.name, "SOFTJAW": _program()}
    mesh = _about_mesh(options, scene, measure) if options.kind == "mesh" else {}
    for path, template in ((scene, f"{options.kind}.toml"), (batch, "run.sbatch")):
        write_file(path, _filled(template, words | mesh), folders=True)
    unit = f"--unit {options.unit} --axis {options.axis}"
    measured = [f"object:  {mesh['SIZE']} mm, the last along its axis, with {unit}"] if mesh else []
    lines = [
        f"written: {scene!s:<{len(str(batch))}}  the scene: what is grasped, where and how hard",
        f"written: {batch}  a Slurm job that resumes after its time limit",
        *measured,
        f"next:    softjaw check {shlex.quote(str(scene))}",
        f"         mpirun -n 2 softjaw run {shlex.quote(str(scene))}",
    ]
    return "\n".join(lines)


def _base(options: Namespace) -> Path:
    """Both files without their endings; their name is part of a scene and of a shell script."""
    default = Path(options.mesh).stem if options.mesh else options.kind
    base = Path((options.name or default).removesuffix(".toml"))
    if not re.fullmatch(r"\w[\w.+-]*", base.name):
        text = f"-o: found '{base.name}', expected letters, digits and _ . + -; write a name as in 'bottle-2'"
        raise StudyError(USAGE, text)
    return base


def _program() -> str:
    """The program that a batch job starts; it has no virtual environment."""
    called = Path(sys.argv[0])
    return str(called.absolute() if called.name == "softjaw" else Path(sys.executable).with_name("softjaw"))


def _filled(template: str, words: dict[str, str]) -> str:
    text = (HERE / template).read_text(encoding="utf-8")
    for name, word in words.items():
        text = text.replace(f"@{name}@", word)
    return text


def _about_mesh(options: Namespace, scene: Path, measure: Callable) -> dict[str, str]:
    """What the scene says about a mesh: its file, its size, and stations that fit it."""
    if not options.mesh or not options.unit:
        needs = {"--mesh FILE": options.mesh, "--unit": options.unit}
        lacks = " and ".join(name for name, given in needs.items() if not given)
        text = f"a mesh needs {lacks}; units are never guessed, as in 'softjaw init mesh --mesh my.stl --unit mm'"
        raise StudyError(USAGE, text)
    *across, height = measure(options)
    half = 0.5 * min(PAD_LENGTH, _rounded(0.5 * height))
    file = os.path.relpath(Path(options.mesh).absolute(), scene.absolute().parent)
    return {
        "MESH": json.dumps(file, ensure_ascii=False),
        "UNIT": options.unit,
        "AXIS": options.axis,
        "SIZE": " x ".join(f"{side:.4g}" for side in (*across, height)),
        "LOW": f"{_rounded(half):g}",
        "HIGH": f"{height - half:.4g}",
    }


def _rounded(length: float) -> float:
    """A length in whole mm, or with two digits where it is short.

    >>> _rounded(33.4), _rounded(3.456)
    (33.0, 3.5)
    """
    return float(f"{length:.2g}") if length < 10 else float(round(length))
