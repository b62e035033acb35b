"""``softjaw view``: its options, and what each of them makes."""

from __future__ import annotations

import math
import os
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from pathlib import Path
from typing import TYPE_CHECKING

from softjaw.study.messages import CANNOT_WRITE, USAGE, StudyError
from softjaw.study.writing import beside, write_file

if TYPE_CHECKING:
    from softjaw.study.show.view.model import View

ENDINGS = {"screenshot": (".png",), "html": (".html", ".htm"), "vtkhdf": (".vtkhdf", ".hdf")}


def add_options(parser: ArgumentParser) -> None:
    """The options of the command."""
    parser.add_argument("file", metavar="FILE", help="result file (.hdf)")
    add_choice(parser)
    parser.add_argument("--force", type=_number, metavar="N", help="force level nearest to N [N]")
    parser.add_argument("--quantity", metavar="NAME", help="map on the object (default: quality)")
    parser.add_argument("--motion", choices=("x", "y", "turn"), default="x",
                        help="slip that the friction is drawn for (default: along x of the contact)")  # fmt: skip
    parser.add_argument("--screenshot", metavar="PNG", help="write a picture; needs no screen")
    parser.add_argument("--html", metavar="HTML", help="write the view as one page that needs nothing else")
    parser.add_argument("--vtkhdf", metavar="VTKHDF", help="write object and pads for ParaView and pyvista.read")
    parser.add_argument("--port", type=int, metavar="PORT", help="show the page at this port of 127.0.0.1, no window")


def add_choice(parser: ArgumentParser) -> None:
    """Options that choose a candidate; `choice` reads them."""
    parser.add_argument("--candidate", type=int, metavar="N", help="candidate, counted over stations and angles")
    parser.add_argument("--station", type=_number, metavar="MM", help="candidate nearest to this station [mm]")
    parser.add_argument("--angle", type=_number, metavar="DEG", help="candidate nearest to this angle [deg]")


def choice(options: Namespace) -> tuple[int | None, tuple[float | None, float | None]]:
    """Candidate, and station [m] and angle [rad], as far as they were given."""
    angle = None if options.angle is None else math.radians(options.angle)
    return options.candidate, (None if options.station is None else 1e-3 * options.station, angle)


def _number(text: str) -> float:
    if not math.isfinite(value := float(text)):
        raise ArgumentTypeError(f"found {text}, expected a number")
    return value


def view(options: Namespace) -> None:
    """Write what was asked for; or else open a window, or without a screen show the page until Ctrl-C."""
    paths = {name: _target(options, name) for name in ENDINGS if getattr(options, name) is not None}
    from softjaw.study.result.store import open_result
    from softjaw.study.show.data import Data
    from softjaw.study.show.view.model import quantity_of, view_of

    with open_result(options.file) as result:
        data = Data(result)
        found, index = view_of(data, *choice(options), options.force)
        quantity = quantity_of(data, options.quantity)
        for name, path in paths.items():
            for made in _write(name, path, found, index, quantity, options.motion):
                print(f"written: {made}")
        if paths:
            return
        if options.port is None and has_screen():
            from softjaw.study.show.view.window import show_window

            show_window(found, index, quantity, options.motion)
            return
        from softjaw.study.show.view.object3d import view_page

        html = view_page(found, index, quantity, options.motion)
    from softjaw.study.show.view.server import serve

    serve(html, options.port or 0)


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
        raise StudyError(CANNOT_WRITE, f"{path}: there is no folder {path.parent}; make it first")
    return path


def _write(name: str, path: Path, found: View, index: tuple[int, ...], quantity: str, motion: str) -> list[Path]:
    if name == "vtkhdf":
        from softjaw.study.show.view.grids import write_grids

        return write_grids(found, index, path)
    if name == "screenshot":
        from softjaw.study.show.view.window import save_picture

        with beside(path) as part:
            save_picture(found, index, part, quantity, motion)
        return [path]
    from softjaw.study.show.view.object3d import view_page

    return [write_file(path, view_page(found, index, quantity, motion))]
