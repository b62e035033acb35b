"""``softjaw patch``: from files and options to the answer."""

from __future__ import annotations

import argparse
from pathlib import Path

from softjaw.study.messages import USAGE, StudyError
from softjaw.study.patch.answer import as_json, as_record, grasp_record, judge
from softjaw.study.patch.reading import Reading, read_patch
from softjaw.study.patch.text import as_text, write_picture

PICTURES = (".png", ".svg")


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
