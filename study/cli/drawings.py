"""Commands that draw: the report and the 3-D view."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from pathlib import Path

from softjaw.study.messages import CANNOT_WRITE, USAGE, StudyError, beside, write_file
from softjaw.study.result.read import open
from softjaw.study.show.grasps import judge
from softjaw.study.show.report.writing import write_report
from softjaw.study.show.view import model, object3d, window
from softjaw.study.units import in_si

ENDINGS = {"screenshot": (".png",), "html": (".html", ".htm")}


def choice(options: Namespace) -> tuple[int | None, tuple[float | None, float | None]]:
    """Candidate, and station [m] and angle [rad], as far as they were given."""
    station, angle = (*options.at, None, None)[:2]
    return options.candidate, (in_si("station_mm", station), in_si("angle_deg", angle))


def report(options: Namespace) -> str:
    """Write one page with everything."""
    page = Path(options.output or Path(options.file).with_suffix(".html"))
    return f"written: {write_report(Path(options.file), page, *choice(options))}"


def view(options: Namespace) -> None:
    """Show a result in three dimensions: write what was asked for, or else open a window.

    Raises
    ------
    StudyError
        If a file cannot be written, or there is neither a file to write nor a screen for a window.
    """
    paths = {name: _target(options, name) for name in ENDINGS if getattr(options, name) is not None}
    if not paths and not has_screen():
        text = "no screen for a window: found neither --html nor --screenshot, expected one of them"
        raise StudyError(USAGE, text)
    found, index = model.view_of(judge(open(options.file)), *choice(options), options.force)
    quantity, written = model.quantity_of(found.ds, options.quantity), []
    if "screenshot" in paths:
        with beside(paths["screenshot"]) as part:
            window.save_picture(found, index, part, quantity, options.motion)
        written.append(paths["screenshot"])
    if "html" in paths:
        html = object3d.view_page(found, index, quantity, options.motion)
        written.append(write_file(paths["html"], html))
    for path in written:
        print(f"written: {path}")
    if not written:
        window.show_window(found, index, quantity, options.motion)


def has_screen() -> bool:
    """Whether a window can be opened."""
    return sys.platform in ("darwin", "win32") or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _target(options: Namespace, name: str) -> Path:
    path, endings = Path(getattr(options, name)), ENDINGS[name]
    if path.suffix.lower() not in endings:
        raise StudyError(USAGE, f"--{name}: found '{path}', expected a file ending in {' or '.join(endings)}")
    if path.resolve() == Path(options.file).resolve():
        raise StudyError(USAGE, f"--{name}: {path} is the result file itself; choose another name")
    if not path.parent.is_dir():
        raise StudyError(CANNOT_WRITE, f"{path}: no folder {path.parent}; create it first")
    return path
