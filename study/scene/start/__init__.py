"""``softjaw init``: a commented scene and a batch script to start from."""

import json
import math
import os
import re
import shlex
import sys
import tomllib
from argparse import Namespace
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from softjaw.fem.objects.mesh_file import LENGTHS, stated_unit
from softjaw.study.grippers import gripper_file
from softjaw.study.messages import CANNOT_WRITE, USAGE, StudyError, write_file
from softjaw.study.scene.section import numbers_text

HERE = Path(__file__).parent
PAD_LENGTH, OPENING = 50.0, 85.0  # mm, as in the template of a mesh, which names no gripper


# The file's axis that is the object's; extents [mm], the last along it; stations [mm] at which a pad fits on; notes.
Measured = tuple[str, tuple[float, ...], tuple[float, ...], tuple[str, ...]]


def longest(sides: Mapping[str, float]) -> str:
    """Axis of the largest extent; z where no other is clearly larger.

    >>> longest({"x": 100.1, "y": 90.0, "z": 100.0}), longest({"x": 110.0, "y": 120.0, "z": 100.0})
    ('z', 'y')
    """
    axis = max(sides, key=lambda name: sides[name])
    # an axis is the longest where it is so many times as long as z, so that rounding does not choose
    return axis if sides[axis] > 1.01 * sides["z"] else "z"


def jaws(gripper: str | None) -> tuple[float, float]:
    """Length of a gripper's pad, and the largest opening that its foam leaves [mm]."""
    if not gripper:
        return PAD_LENGTH, OPENING
    keys, hand = gripper_file(gripper)
    return keys.get("pad_length_mm", PAD_LENGTH), hand.stroke_mm - 2 * keys.get("pad_thickness_mm", 0.0)


def heights(height: float, pad: float = PAD_LENGTH) -> tuple[float, ...]:
    """Stations [mm] at which a pad along the axis of an object does not reach beyond its ends; none on a short one.

    >>> heights(61.0), heights(40.0)
    ((25.0, 30.5, 36.0), ())
    """
    room = height - pad
    count = min(8, 1 + int(room // 5))  # at two angles a first map of 16 candidates
    # Down to 0.1 mm, so that rounding leads over neither end.
    return tuple(math.floor(10 * (pad / 2 + room * i / max(count - 1, 1))) / 10 for i in range(max(count, 0)))


def init(options: Namespace, measure: Callable[[Namespace], Measured]) -> str:
    """Write both files, and say what to do next; ``measure`` looks at the mesh.

    Raises `StudyError`: a mesh that is missing or cannot be read, files that exist, or a folder that cannot be written.
    """
    for name in ("mesh", "unit", "axis") if options.kind != "mesh" else ():
        if getattr(options, name):
            raise StudyError(USAGE, f"--{name}: found beside '{options.kind}'; write 'softjaw init mesh --mesh ...'")
    if options.mesh and (Path(options.mesh).is_dir() or "*" in options.mesh):
        many = shlex.quote(options.mesh)
        raise StudyError(USAGE, f"--mesh: found {many}, expected one of them; then: softjaw run SCENE --objects {many}")
    base = _base(options)
    scene, batch = (base.with_name(base.name + ending) for ending in (".toml", ".sbatch"))
    existing = [str(path) for path in (scene, batch) if path.exists()]
    if existing and not options.force:
        verb = "exist" if existing[1:] else "exists"
        text = f"{' and '.join(existing)}: {verb} already; choose another name with -o, or add --force"
        raise StudyError(CANNOT_WRITE, text)
    called = Path(sys.argv[0])  # what a batch job starts; it has no virtual environment
    program = called.absolute() if called.name == "softjaw" else Path(sys.executable).with_name("softjaw")
    words = {"NAME": base.name, "SOFTJAW": str(program)}
    mesh, notes = _about_mesh(options, scene, measure) if options.kind == "mesh" else ({}, ())
    for path, template in ((scene, f"{options.kind}.toml"), (batch, "run.sbatch")):
        text = _filled(template, words | mesh)
        text = with_gripper(text, options.gripper) if path == scene and options.gripper else text
        write_file(path, text, folders=True)
    about = "object:  {SIZE} mm along the file's x, y and z, with --unit {UNIT} --axis {AXIS}"
    measured = [about.format(**mesh), *(f"         {note}" for note in notes)] if mesh else []
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


def _filled(template: str, words: dict[str, str]) -> str:
    text = (HERE / template).read_text(encoding="utf-8")
    for name, word in words.items():
        text = text.replace(f"@{name}@", word)
    return re.sub(r"[ ]+$", "", text, flags=re.MULTILINE)


def with_gripper(text: str, name: str) -> str:
    """A scene with a gripper's preset instead of its own pad, and with normal forces that the gripper has."""
    keys, hand = gripper_file(name)
    low, high = hand.force_n
    size = "x".join(f"{keys.get(key, 0):g}" for key in ("pad_length_mm", "pad_width_mm", "pad_thickness_mm"))
    line = f'preset = "{name}"  # pads of {size} mm, {hand.stroke_mm:g} mm of stroke, {low:g} to {high:g} N'
    text = re.sub(r"(?m)^(pad_\w+|max_opening_mm) = .*\n", "", text).replace("[gripper]\n", f"[gripper]\n{line}\n")
    forces = [force for force in tomllib.loads(text)["load"]["normal_force_n"] if low <= force <= high]
    forces = forces if len(forces) > 1 else [force for force in (low, 2 * low, 3 * low) if force <= high]
    return re.sub(r"(?m)^normal_force_n = \[.*\]", f"normal_force_n = {numbers_text(forces)}", text)


def _about_mesh(options: Namespace, scene: Path, measure: Callable) -> tuple[dict[str, str], tuple[str, ...]]:
    """What the scene says about a mesh, its file, its size, and stations that fit it; notes on the mesh."""
    if options.mesh and not options.unit and (stated := stated_unit(Path(options.mesh))) in LENGTHS:
        options.unit = stated
    if not options.mesh or not options.unit:
        needs = {"--mesh FILE": options.mesh, "--unit": options.unit}
        lacks = " and ".join(name for name, given in needs.items() if not given)
        text = f"a mesh needs {lacks}; units are never guessed, as in 'softjaw init mesh --mesh my.stl --unit mm'"
        raise StudyError(USAGE, text)
    axis, extents, stations, notes = measure(options)
    file = os.path.relpath(Path(options.mesh).absolute(), scene.absolute().parent)
    return {
        "MESH": json.dumps(file, ensure_ascii=False), "UNIT": options.unit, "AXIS": axis,
        "SIZE": " x ".join(f"{extents[i - 'xyz'.index(axis) - 1]:.4g}" for i in range(3)),
        "STATIONS": _stations(extents, stations, *jaws(options.gripper)),
    }, notes  # fmt: skip


def _stations(extents: Sequence[float], stations: Sequence[float], pad: float, opening: float) -> str:
    """Lines that propose stations, or say why there are none that `check` would not warn of."""
    wide, deep, height = extents
    angles = [angle for angle, width in ((0, wide), (90, deep)) if width <= opening]
    if height < pad:
        return f"# Stations along its axis: none, because the pad is longer than the object there, {height:.3g} mm."
    if not angles or not stations:
        why = f"it is wider than {opening:g} mm" if not angles else "the line through its middle bends too much"
        return f"# Stations along its axis: none that would do everywhere, because {why}."
    return (
        "# Or, for an object with an axis, stations: heights above its lowest point, at which the pad stays on it.\n"
        f"# stations_mm = {json.dumps(stations)}\n"
        f"# angles_deg = {json.dumps(angles)}        # about its centre line, where it is at most {opening:g} mm wide"
    )
