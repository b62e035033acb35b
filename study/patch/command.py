"""The command ``softjaw patch``: its options, and the way from a file to the answer."""

from __future__ import annotations

import argparse
import math
from pathlib import Path

from softjaw.study.messages import USAGE, StudyError

PICTURES = (".png", ".svg")
SURFACES = ("three_motions", "axis_aligned", "full", "quartic")


def add_options(parser: argparse.ArgumentParser) -> None:
    """Describe the words after ``softjaw patch``."""
    add = parser.add_argument
    add("file", metavar="FILE", help="CSV with one face per line, or VTU / VTP; see the README for the columns")
    add("--mu", type=_positive, default=0.8, help="friction coefficient (default 0.8)")
    add("--long-side", type=_direction, metavar="X,Y,Z", help="direction of the contact frame's x axis, the pad's long "
        "side; write --long-side=-1,0,0 for negative numbers (default: the longer direction of the patch)")  # fmt: skip
    add("--unit", choices=("m", "cm", "mm"), help="of lengths and areas that carry none in the file")
    add("--pressure-unit", choices=("pa", "kpa", "mpa"), help="of a pressure that carries none in the file")
    add("--pressure-name", metavar="NAME", help="column or data array that holds the pressure (default: pressure)")
    add("--flip-normals", action="store_true", help="turn all normals; they point into the object, as the finger does")
    add("--other", metavar="FILE", help="the other contact of the grasp, in the same coordinates, units and options")
    add("--distance", type=_positive, metavar="MM", help="between two such contacts that face each other")
    add("--object-length", type=_positive, metavar="MM", help="divides torques of forces (default: the distance)")
    add("--contact-length", type=_positive, metavar="MM", help="divides torques about the normals (default: rho)")
    add("--surface", choices=SURFACES, default="quartic", help="limit surface that is scored (default: quartic)")
    add("-o", metavar="PICTURE", dest="picture", help="also write sections of the limit surface (.png or .svg)")
    add("--json", action="store_true", help="as JSON, SI units")


def answer_text(options: argparse.Namespace) -> str:
    """Read, judge and score; the text or the JSON of it."""
    if options.other and options.distance:
        raise StudyError(USAGE, "--distance: found beside --other, which tells the distance itself; remove one of them")
    scored = options.other or options.distance
    for name in ("object_length", "contact_length"):
        if getattr(options, name) and not scored:
            option = f"--{name.replace('_', '-')}"
            raise StudyError(USAGE, f"{option}: found without a grasp to score; add --distance MM or --other FILE")
    if options.picture and not options.picture.lower().endswith(PICTURES):
        text = f"-o: found {options.picture}, expected a picture's name that ends in {' or '.join(PICTURES)}"
        raise StudyError(USAGE, f"{text}; for numbers write --json and lead the output into a file")
    from softjaw.study.patch.answer import as_json, as_record, grasp_record, judge
    from softjaw.study.patch.reading import Reading, read_patch
    from softjaw.study.patch.text import as_text, write_picture

    reading = Reading(options.unit, options.pressure_unit, options.pressure_name, options.flip_normals)
    files = [options.file, *([options.other] if options.other else [])]
    patches = [judge(read, options.mu, options.long_side) for read in [read_patch(file, reading) for file in files]]
    grasp = None
    if scored:
        lengths = (options.distance, options.object_length, options.contact_length)
        metres = [None if mm is None else 1e-3 * mm for mm in lengths]
        grasp = grasp_record(patches[0], patches[1] if options.other else None, options.surface, *metres)
    if options.picture:
        write_picture(patches, options.surface, Path(options.picture))
    record = as_record(patches, grasp)
    return as_json(record) if options.json else as_text(record)


def _positive(text: str) -> float:
    if not 0 < (value := float(text)) < math.inf:
        raise argparse.ArgumentTypeError(f"found {text}, expected a number above 0")
    return value


def _direction(text: str) -> list[float]:
    try:
        found = [float(part) for part in text.split(",")]
    except ValueError:
        found = []
    if len(found) != 3 or not all(map(math.isfinite, found)) or not any(found):
        raise argparse.ArgumentTypeError(f"found {text}, expected three numbers such as 1,0,0, not all of them 0")
    return found
