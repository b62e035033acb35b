"""One self-contained page about a result file: for mails and printing.

The page answers in the order of a reader's questions: where to grasp, how wide and how hard, and how sure that is; the
object and its maps; what failed and why; the best case in detail; then how it was computed. It needs no network.
"""

from pathlib import Path

import xarray as xr

from softjaw.study.messages import CANNOT_WRITE, StudyError, write_file
from softjaw.study.page import Block, Section, box, page, text
from softjaw.study.quantities import DONE, FAILED, NO_GRASP
from softjaw.study.ranking import judge
from softjaw.study.result.read import open
from softjaw.study.show.best_grasps import answer
from softjaw.study.show.grasps import Index, field, forces
from softjaw.study.show.report import contact, curves, maps, tables, verdict
from softjaw.study.show.view.model import Place, View, view_of
from softjaw.study.show.view.object3d import object_block


def write_report(file: Path, out: Path, candidate: int | None = None, place: Place = (None, None)) -> Path:
    """Write the page ``out``; its path.

    A candidate, counted over stations and angles, or the one nearest to a ``place`` (station [m], angle [rad]) is shown
    beside the best one.

    Raises `StudyError` if ``file`` is no result file or has no such candidate, or ``out`` cannot be written.
    """
    # A report must never write over the result that it is made from.
    if Path(file).resolve() == Path(out).resolve():
        raise StudyError(CANNOT_WRITE, f"{out}: choose a name that ends in .html for the report, with -o")
    return write_file(Path(out), build(open(file), candidate, place))


def build(ds: xr.Dataset, candidate: int | None = None, place: Place = (None, None)) -> str:
    """The page of a study, as `study.result.read.open` gives it."""
    ds = judge(ds)
    if candidate is not None or place != (None, None):
        ds = judge(ds, view_of(ds, candidate, place, None)[1])
    # A study without a solved case still gets its page, with states and scene.
    view, best = view_of(ds, None, (None, None), None)
    sections: list[Section] = [
        ("answer", "", [the_object(view, best), the_answer(ds)]),
        ("best", "Best grasps", best_grasps(ds)),
        ("maps", "Maps", (maps.maps(ds, best) if ds.status.size > 1 else []) +
         tables.reasons(ds, FAILED, *NO_GRASP)),
        ("wall", "What the wall bears", wall(view, best)),
        ("curvature", "What curvature costs", curves.differences(ds, best)),
        *(cases(view) if ds.attrs["best"] is not None else []),
        ("effects", "What was simulated", [*tables.effects(ds), text(verdict.CAVEAT, "note")]),
        ("cost", "Convergence and cost",
         [*tables.reasons(ds, DONE), *tables.checks(ds), *tables.time_split(ds)]),
        ("cases", "All cases", tables.every_case(ds)),
        ("definitions", "Definitions", tables.definitions(ds)),
        ("provenance", "Provenance", tables.provenance(ds)),
        ("scene", "Scene in effect", tables.scene(ds)),
    ]  # fmt: skip
    title = f"{ds.attrs['title']}: {'where to grasp' if view.candidates > 1 else 'grasp study'}"
    return page(title, verdict.subtitle(ds), sections)


def the_answer(ds: xr.Dataset) -> Block | None:
    """The best grasp at a glance: where, how wide, how hard, what it holds, why no more."""
    if ds.attrs["best"] is None:
        return None
    return {"kind": "answer", "lines": [(name, *value) for name, value in answer(ds, ds.attrs["best"]).items()]}


def best_grasps(ds: xr.Dataset) -> list[Block]:
    """How sure the best grasp is, what speaks against it, and the tables of the best grasps."""
    boxes = [(verdict.verdict(ds), "verdict"), (verdict.warnings(ds), "warn")]
    return [box(texts, look) for texts, look in boxes if texts] + tables.best_grasps(ds)


def the_object(view: View, best: Index) -> Block:
    """The object in three dimensions with the pads of the best and of the chosen grasp at every force."""
    shown = [i for i in (best, view.ds.attrs["chosen"]) if i and i[:-3] == view.point]
    cases = dict.fromkeys((*i[:-1], k) for i in shown for k in range(len(forces(view.ds))))
    return object_block(view, best, view.ds.attrs["score"], "x", list(cases))


def wall(view: View, best: Index) -> list[Block | None]:
    """Limits, shape and force curves of a thin wall; empty without one."""
    ds, shape = view.ds, getattr(view.scene, "object", None)
    if field(ds, "indentation") is None:
        return []
    allowed = getattr(shape, "allowed_dent", None)
    return [tables.wall(shape), curves.wall_section(view, best), curves.wall_curves(ds, best, allowed)]


def cases(view: View) -> list[Section]:
    """Force curves, contact patch and limit surface of the best case, and of the one that was asked for."""
    ds, best, chosen = view.ds, view.ds.attrs["best"], view.ds.attrs["chosen"]
    roles = {"Best case": best}
    if chosen not in (None, best) and ds.status.values[chosen] == DONE:
        roles["Chosen candidate"] = chosen
    # The other case may belong to another point of the sweep, and so to another object.
    views = {index: view if index[:-3] == view.point else View(ds, index[:-3]) for index in roles.values()}
    mu = view.scene.friction.mu if view.scene else None
    return [
        ("models", "Friction models compared", curves.models(ds, roles, mu)),
        ("patch", "Contact patch", [contact.patch(views[index], index) for index in roles.values()]),
        ("surface", "Limit surface", [contact.limit_surfaces(views[index], index) for index in roles.values()]),
    ]
