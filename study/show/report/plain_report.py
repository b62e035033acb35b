"""The report in the file itself, as plain text: for whoever has nothing but the file and a tool that prints HDF5."""

from __future__ import annotations

import textwrap
from typing import Any

from softjaw.study.result.layout import DONE, FAILED
from softjaw.study.result.read import dataset
from softjaw.study.show.data import Data
from softjaw.study.show.report.verdict import CAVEAT, meaning, subtitle, verdict, warnings
from softjaw.study.show.tables.show import as_text, best

TOP, MOST_REASONS, MOST_PLACES, WIDTH = 5, 10, 3, 120
READING = """How to read the file
All values are SI. Every dataset has its unit, its label and its definition as attributes; /study/definitions has all
definitions in one text, with the friction models: 'curved' lets every face resist in its own plane, 'flat' and
'projected' are planar models with the pressure sum S and with the normal force F_N. NaN: there is no value, and
/study/status/code (0 missing, 1 done, 2 failed) and /study/status/message say why. Candidates are counted over stations
and angles, the angle running fastest. /study/scene is the scene with all settings, /study/provenance/sessions tells
programs and machine. Plots: h5web, silx or NeXpy open at the map of quality; ParaView and pyvista open /VTKHDF, the
object with its maps and the pads with their pressure, with the force as time."""


def plain_report(result: Any, mu: float | None) -> str:
    """What it is, the best grasps, failures with their reasons, and how to read the numbers."""
    data = Data(result)
    size = subtitle(data).partition(": ")[2]
    what = f"{data.title}: {size}" if result.title else size
    table = [as_text(best(dataset(result), top=TOP, whole_lines=True), WIDTH)] if data.best else []
    notes = "\n".join(line for state in (FAILED, DONE) for line in _notes(data, state))
    said = "\n".join([*verdict(data, mu), *warnings(data), meaning(data)]).replace("\xa0", " ").strip()
    parts = [what, said, *table, notes, READING, CAVEAT.replace("the scene below", "/study/scene")]
    lines = "\n\n".join(part for part in parts if part).splitlines()
    text = "\n".join(textwrap.fill(line, WIDTH) if len(line) > WIDTH else line for line in lines) + "\n"
    return text.replace("\N{DEGREE SIGN}", " deg").replace("\N{MULTIPLICATION SIGN}", "x")  # h5dump escapes them


def _notes(data: Data, state: int) -> list[str]:
    """Why cases failed, or what to know about solved ones: one line for messages that differ in numbers only."""
    word, lines = "failed" if state == FAILED else "noted", []
    for count, text, where in data.grouped(state)[:MOST_REASONS]:
        places = "; ".join(data.place(index, force=True).replace("\xa0", " ") for index in where[:MOST_PLACES])
        lines.append(f"{word} {count} x {text} [{places}{'; ...' * (count > MOST_PLACES)}]")
    return lines
