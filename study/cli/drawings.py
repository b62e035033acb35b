"""Commands that draw: the report and the 3-D view."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from softjaw.study.show.report.writing import write_report
from softjaw.study.show.view import command as viewing


def report(options: Namespace) -> str:
    """Write one page with everything."""
    page = Path(options.output or Path(options.file).with_suffix(".html"))
    return "\n".join(f"written: {path}" for path in write_report(Path(options.file), page, *viewing.choice(options)))


def view(options: Namespace) -> None:
    """Show a result in three dimensions."""
    viewing.view(options)
