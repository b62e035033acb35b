"""Commands that read whole result files: as tables and numbers, as pages and pictures."""

from argparse import Namespace
from functools import partial
from pathlib import Path

from softjaw.study.cli.options import refuse_unused
from softjaw.study.messages import beside, fault_of, with_ending, write_file
from softjaw.study.quantities import LISTED
from softjaw.study.ranking import judge
from softjaw.study.result.index import index_path, one_file
from softjaw.study.result.read import open
from softjaw.study.show import objects
from softjaw.study.show.best_grasps import best, best_text
from softjaw.study.show.compare import compare as compared
from softjaw.study.show.compare import compare_text
from softjaw.study.show.watch import file_look
from softjaw.study.show.watch import watch as watched
from softjaw.study.table import rendered, terminal_width
from softjaw.study.units import in_si

ENDINGS = {"screenshot": (".png",), "html": (".html", ".htm")}


def watch(options: Namespace) -> int:
    """Follow a run until it ends."""
    index = index_path(options.file)
    return watched(partial(objects.look, index) if index else file_look(Path(options.file)), options.every)


def show(options: Namespace) -> str:
    """Print the best grasps, or the objects with theirs."""
    top = LISTED if options.top is None else options.top
    if index := index_path(options.file):
        refuse_unused(options, "force", "by")
        return rendered(objects.index_table(index, 0 if options.form and options.top is None else top), options.form)
    ds = open(options.file)
    with fault_of(options.file, ValueError):
        if options.form is None:
            return best_text(ds, terminal_width(), options.force, top, options.by)
        return rendered(best(ds, options.force, top, by=options.by), options.form)


def compare(options: Namespace) -> str:
    """Print two maps side by side."""
    first, second = (open(one_file(file)) for file in options.files)
    table = compared(first, second, options.quantity, options.model)
    top = LISTED if options.top is None else options.top
    return rendered(table, options.form) if options.form else compare_text(table, top, terminal_width())


def choice(options: Namespace) -> tuple[int | None, tuple[float | None, float | None]]:
    """Candidate, and station [m] and angle [rad], as far as they were given."""
    station, angle = (*options.at, None, None)[:2]
    return options.candidate, (in_si("station_mm", station), in_si("angle_deg", angle))


def report(options: Namespace) -> str:
    """Write one page with everything, of a file or of all objects of a folder."""
    # loads plotly, which tables do not need
    from softjaw.study.show.report import objects_page, writing

    index = index_path(options.file)
    page = with_ending("-o", options.output or (index or Path(options.file)).with_suffix(".html"), *ENDINGS["html"])
    if index:
        refuse_unused(options, "candidate", "at")
        return f"written: {objects_page.write_objects_page(index, page)}"
    return f"written: {writing.write_report(Path(options.file), page, *choice(options))}"


def view(options: Namespace) -> str:
    """Write a result in three dimensions: a page, a picture, or both; by default a page beside the file."""
    from softjaw.study.show.view import model, object3d, solids  # pyvista

    file = one_file(options.file)
    if options.html is None and options.screenshot is None:
        options.html = str(file.with_suffix("")) + "-3d.html"
    given = {name: getattr(options, name) for name in ENDINGS}
    paths = {name: with_ending(f"--{name}", file, *ENDINGS[name]) for name, file in given.items() if file is not None}
    shown, index = model.view_of(judge(open(file)), *choice(options), options.force)
    quantity = model.quantity_of(shown.ds, options.quantity)
    if "screenshot" in paths:
        with beside(paths["screenshot"]) as part:
            solids.save_picture(shown, index, part, quantity, options.motion)
    if "html" in paths:
        write_file(paths["html"], object3d.view_page(shown, index, quantity, options.motion))
    return "\n".join(f"written: {path}" for path in paths.values())
