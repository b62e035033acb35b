"""The page of the survey: a table of the objects, one of the random scenes by kind, and all failures by reason."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from textwrap import shorten

import numpy as np

from tests.objects.found import SOLVED, TRIED, Found
from tests.objects.reasons import reason_of

SECONDS, SHARE = 60.0, 0.98  # goals: CPU time to the first map, share of tried candidates that end solved
LONGEST = 80  # characters of a message
HEAD = ("object", "CPU s", "candidates", "solved", "best quality")
INTRODUCTION = """# Objects that users bring

Written by `make objects`. Each object is an STL file, run as a user would: `softjaw init mesh`, `softjaw run` on two
ranks with the scene as `init` wrote it, `show`, `report`, `view`. CPU s is the time of all processes from the file to
the first map. A candidate is solved if all its forces are; those that are too wide, collide or are not among the best
that the scene asks for are not counted. Scans are of the YCB Object and Model Set (`tests/objects/scans`); "with
holes": three patches of triangles are missing; "spoiled": one triangle in a hundred is flipped, some are doubled or
degenerate, and no two share a vertex.
"""
PICTURE = """![best grasps](objects.png)

Blocks are the pads of the best grasp, in the colours of pressure; balls are where the fingers of all candidates first
touch, in the colours of quality."""


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A table as Markdown."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(str(cell).replace('|', '/') for cell in cells)} |" for cells in lines)


def share_line(found: Sequence[Found]) -> str:
    """Sentence about the share of tried candidates that ended solved, and what the others failed by."""
    messages = [message for f in found for message in f.messages]
    by = Counter(reason_of(message).by for message in messages)
    solved, tried = share(found)
    return (
        f"**{solved} of {tried} tried candidates ended solved: {solved / max(tried, 1):.1%}** (goal {SHARE:.0%});"
        f" {by['physics']} failed by physics, {by['scene']} were refused with good reason,"
        f" {tried - solved - by['physics']} failed otherwise."
    )


def share(found: Sequence[Found]) -> tuple[int, int]:
    """Number of candidates that ended solved, and of those that were tried.

    An object without any counts as one, but where it is refused with good reason.
    """
    solved, tried = sum(f.count(SOLVED) for f in found), sum(f.count(*TRIED) for f in found)
    return solved, tried + sum(not f.states and reason_of(f.refused).by != "scene" for f in found)


def object_row(f: Found) -> list[object]:
    """Cells of an object."""
    return [f.name, f"{f.seconds:.0f}", f.count(*TRIED), f.count(SOLVED), f.best.rpartition(": ")[2]]


def kind_rows(scenes: Sequence[Found]) -> list[list[object]]:
    """Scenes, solved scenes and times by kind."""
    rows = []
    for kind in sorted({f.kind for f in scenes}):
        own = [f for f in scenes if f.kind == kind]
        seconds = [f.seconds for f in own]
        rows.append([kind, len(own), sum(f.count(SOLVED) for f in own), f"{np.median(seconds):.2f}",
                     f"{max(seconds):.1f}"])  # fmt: skip
    return rows


def reason_rows(found: Sequence[Found]) -> list[list[object]]:
    """Failures by class, those that physics does not excuse first."""
    lost = [(reason_of(message), f, where, message) for f in found for where, message in f.lost]
    counts = Counter(reason.name for reason, *_ in lost)
    lost.sort(key=lambda row: (row[0].by, -counts[row[0].name], row[0].name))
    return [
        [reason.name, reason.by, f"{f.name}, {where}", shorten(message, LONGEST, placeholder=" ...")]
        for reason, f, where, message in lost
    ]


def page(objects: Sequence[Found], scenes: Sequence[Found], seed: int) -> str:
    """The whole page as Markdown."""
    slow = [f.name for f in objects if f.seconds > SECONDS]
    return "\n".join([
        INTRODUCTION, share_line(objects), "",
        f"{len(objects) - len(slow)} of {len(objects)} maps took less than {SECONDS:g} s of CPU.", "",
        table(HEAD, [object_row(f) for f in objects]), "", PICTURE, "",
        f"## {len(scenes)} random scenes, seed {seed}", "", share_line(scenes), "",
        table(("kind", "scenes", "solved", "median CPU s", "longest"), kind_rows(scenes)), "",
        "## Failures", "",
        table(("reason", "by", "where", "message"), reason_rows([*objects, *scenes])), "",
    ])  # fmt: skip
