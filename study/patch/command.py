"""The command ``softjaw patch``: its options, and the way from a file to the answer."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

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
    from softjaw.study.patch.reading import Reading, read_patch

    reading = Reading(options.unit, options.pressure_unit, options.pressure_name, options.flip_normals)
    files = [options.file, *([options.other] if options.other else [])]
    patches = [read_patch(file, reading) for file in files]
    return _told(options, patches)


def _told(options: argparse.Namespace, patches: list[Any]) -> str:
    from softjaw.study.patch.answer import Answer, as_json
    from softjaw.study.patch.evaluate import judge
    from softjaw.study.patch.grasp import grasp_of
    from softjaw.study.patch.text import as_text

    judged = [judge(patch, options.mu, options.long_side) for patch in patches]
    grasp = None
    if options.other or options.distance:
        lengths = [None if mm is None else 1e-3 * mm for mm in (options.distance, options.object_length,
                                                                 options.contact_length)]  # fmt: skip
        grasp = grasp_of(judged[0], judged[1] if options.other else None, options.mu, options.surface, *lengths)
    if options.picture:
        from softjaw.study.patch.picture import write_picture

        write_picture(judged, options.mu, options.surface, Path(options.picture))
    answer = Answer(options.mu, judged, grasp)
    return as_json(answer) if options.json else as_text(answer)


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
