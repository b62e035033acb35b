"""The page of a folder of objects: a picture of each with its best grasp, sorted as a reader likes, and its answer."""

from pathlib import Path

from softjaw.study import page
from softjaw.study.messages import StudyError, write_file
from softjaw.study.ranking import judge
from softjaw.study.result.index import SOLVED, read_index
from softjaw.study.result.read import open
from softjaw.study.show.objects import counts_text, index_table
from softjaw.study.show.report.tables import best_grasps
from softjaw.study.show.report.writing import the_answer
from softjaw.study.show.view.model import View
from softjaw.study.show.view.solids import thumbnail
from softjaw.study.table import Row, plain, with_unit
from softjaw.study.units import shown_unit


def write_objects_page(index: Path, out: Path) -> Path:
    """Write one page on all objects of a folder; its path. `StudyError` if that or reading the index fails."""
    rows, about = read_index(index)
    table = index_table(index)
    columns = [c for c in table.columns if c.display]
    heads = [(with_unit(c.label or c.name, shown_unit(c.unit)), "text" if c.wrap else "n") for c in columns]
    listed, sections = [], []
    for row in table.rows:
        image, blocks = _object(index.parent, row) if row["state"] in SOLVED else (b"", [])
        anchor = f"object-{row['object']}" if blocks else ""
        cells = [(table.cell(row, c), plain(row[c.name])) for c in columns]
        listed.append({"cells": cells, "anchor": anchor, "image": image, "alt": f"best grasp of {row['object']}"})
        sections.append((anchor, row["object"], blocks))
    note = "Click on the head of a column to sort by it, on an object for its best grasps."
    gallery = [page.text(note, "note"), page.objects("best grasp of every object", heads, listed)]
    title = f"{index.parent.name}: where to grasp {len(rows)} objects"
    subtitle = f"{counts_text(rows)}; {about.get('scene_file', '')}"
    return write_file(out, page.page(title, subtitle, [("objects", "", gallery), *sections]))


def _object(folder: Path, row: Row) -> tuple[bytes, list[page.Block]]:
    """Picture of an object with its best grasp, and what its section says; nothing where its file cannot be read."""
    try:
        ds = judge(open(folder / row["file"]))
    except StudyError as error:
        return b"", [page.box([error.message], "warn")]
    blocks = [*filter(None, [the_answer(ds)]), *best_grasps(ds)]
    report = Path(row["file"]).with_suffix(".html")
    if (folder / report).exists():
        blocks.append({"kind": "link", "text": f"report on {row['object']}", "target": report.as_posix()})
    return thumbnail(View(ds, best[:-3]), best) if (best := ds.attrs["best"]) else b"", blocks
