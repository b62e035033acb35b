"""Figs. 5b and 6 of the paper: the wrenches that both friction models allow, and limit surfaces fitted to them."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from jobs.figures import drawing
from jobs.figures.contacts import WIDTH
from softjaw.friction.motion import fibonacci_twists
from softjaw.lsfit.samples import fit_error
from softjaw.lsfit.surface import PLANES, circle, shadow_outline
from softjaw.study import pictures
from softjaw.study.case.limit_surface import fitted
from softjaw.study.quantities import FINGERS
from softjaw.study.ranking import nearest
from softjaw.study.show.grasps import Index, at, axis_text, field, forces, number
from softjaw.study.show.stored_surface import (
    COMPONENTS,
    NAMES,
    StoredSurface,
    sphere,
    stored_surface,
)
from softjaw.study.show.view import solids
from softjaw.study.show.view.model import View

MODELS = ("pcm", "ccm")
TURN = 144  # directions in a plane
MOTIONS = 250  # slip motions whose wrenches are drawn, and their opposites
SUPPORTS = 8000  # planes that bound the exact body
ROWS, COLUMNS = 61, 121  # directions from pole to pole, and round
ERRORS = "viridis"
FITS = {"fit_error_ellipsoid": ("ellipsoid from three motions", "#801650", "--", "D"),
        "fit_error": ("convex quartic", pictures.INK, "-", "v")}  # fmt: skip
GRID = 21  # centres of rotation along a side of the paper's grid
FORCE = 3.0  # at which the error is drawn along the object [N]


def exact_surface(ds: xr.Dataset, index: Index, model: str) -> StoredSurface:
    """The first finger's limit surfaces of a case, with its exact wrenches."""
    found = stored_surface(ds, index, 0, model, View(ds, index[:-3]).faces(index))
    assert found is not None
    return found


def wrench_spaces(ds: xr.Dataset, sharp: xr.Dataset) -> tuple[Any, str]:
    """(b) Shadows of both models' wrench spaces and their distance, for the contact of (a) and a sharp cylinder."""
    ratio = sharp.b_over_a.values
    cases = (
        ("the contact of (a)", ds, (0, 0, len(forces(ds)) - 1)),
        (f"elliptic cylinder, a/b = {number(1 / ratio.min())}", sharp,
         (int(ratio.argmin()), 0, 0, len(forces(sharp)) - 1)),
    )  # fmt: skip
    drawn, axes = pictures.figure(WIDTH, 5.0, 2, 3, gap=0.06)
    largest = []
    for row, (name, study, index) in zip(axes, cases, strict=True):
        known = {model: exact_surface(study, index, model) for model in MODELS}
        for panel, (i, j) in zip(row, ((0, 1), (1, 2)), strict=False):
            _shadows(panel, known, i, j)
        gap = _gaps(row[2], known)
        row[0].set_title(f"{name}, {number(forces(study)[index[-1]])} N")
        largest.append(f"{name}: up to {number(gap, 2)} % of what the PCM claims is missing")
    axes[0, 0].set_title(f"(b) {axes[0, 0].get_title(loc='left')}")
    named = [pair for k in (0, 2) for pair in zip(*axes[0, k].get_legend_handles_labels(), strict=True)]
    drawn.legend(*zip(*named, strict=True), loc="outside lower center", ncols=len(named), frameon=False, fontsize=8)
    return drawn, "; ".join(largest)


def _shadows(panel: Any, known: dict[str, StoredSurface], i: int, j: int) -> None:
    for model, found in known.items():
        outline = shadow_outline(found.exact.support_points, i, j, TURN) * found.unit[[i, j]]
        panel.plot(*outline.T, **drawing.model_look(model, marker=""))
    panel.set(xlabel=NAMES[i], ylabel=NAMES[j])
    if (i, j) == (0, 1):
        panel.set_aspect("equal", adjustable="datalim")


def _gaps(panel: Any, known: dict[str, StoredSurface]) -> float:
    """Share of the PCM's claim that is missing, over the direction in each plane; the largest [%]."""
    largest = 0.0
    for (i, j), line in zip(PLANES, ("-", "--", ":"), strict=True):
        t = circle(i, j, TURN)[: TURN // 2 + 1]
        # along a motion the wrench resists as much as the body reaches: its support
        reach = {model: found.exact.support(t) for model, found in known.items()}
        gap = 100 * (1 - reach["ccm"] / reach["pcm"])
        largest = max(largest, float(gap.max()))
        label = f"{COMPONENTS[i][0]} to {COMPONENTS[j][0]}"
        panel.plot(np.linspace(0, 180, len(gap)), gap, color=pictures.INK, label=label, ls=line)
    panel.set(xlabel="direction in the plane [°]", ylabel="1 - CCM / PCM [%]", xlim=(0, 180), ylim=(0, None))
    panel.set_xticks([0, 45, 90, 135, 180])
    return largest


def fitted_surfaces(ds: xr.Dataset) -> tuple[Any, str]:
    """(a) The ellipsoid and (b) the convex quartic, in the colours of their distance from the exact body."""
    index = (0, 0, len(forces(ds)) - 1)
    found = exact_surface(ds, index, "ccm")
    shapes = {"fit_error_ellipsoid": found.ellipsoid, "fit_error": found.chosen}
    u = sphere(ROWS, COLUMNS).reshape(-1, 3) * _most(found)
    exact = exact_radius(found, u)
    errors = {name: 100 * np.abs(shape.radius(u) / exact - 1) for name, shape in shapes.items() if shape is not None}
    top = max(float(e.max()) for e in errors.values())
    drawn, axes = pictures.figure(WIDTH, 3.9, 1, 2)
    results = []
    for panel, (name, error), letter in zip(axes[0], errors.items(), "ab", strict=True):
        draw = partial(_body, found=found, shape=shapes[name], error=error, top=top)
        image = drawing.rendered(draw, (0.9, 0.75, 0.45), (0, 0, 1), (1300, 1100))
        fit, mean, most = FITS[name][0], number(100 * at(ds, name, index), 2), number(error.max(), 2)
        drawing.placed(panel, image, f"({letter}) {fit}: {mean} % off, mean over motions")
        grid = number(100 * errors_on_grid(found)[name], 2)
        results.append(f"{fit}: mean {mean} % over even motions, {grid} % on the paper's grid, largest {most} %")
    drawing.scale(drawn, axes, "distance from the exact limit surface, of its radius [%]", ERRORS, (0, top))
    return drawn, "; ".join(results)


def errors_on_grid(found: StoredSurface) -> dict[str, float]:
    """Mean errors of the radius on the paper's wrenches, of the surfaces in `FITS` [-].

    They are those of turns about a grid of centres of rotation, to which the quartic is fitted, too, and of which nine
    in ten are nearly translations.
    """
    centre = 5 * np.stack(np.meshgrid(*[np.linspace(-1, 1, GRID)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    twist = np.column_stack([centre[:, 1], -centre[:, 0], np.ones(len(centre))])
    W, T = found.exact.support_points(twist), twist / np.linalg.norm(twist, axis=1, keepdims=True)
    surfaces = found.ellipsoid, fitted(found.ellipsoid, W, T, "quartic", "least_squares")[0]
    return {name: fit_error(surface, W, T).Erad for name, surface in zip(FITS, surfaces, strict=True)}


def _most(found: StoredSurface) -> np.ndarray:
    """Largest of each component that the contact carries ``(3,)`` [-]."""
    return found.exact.semi_axes


def exact_radius(found: StoredSurface, u: np.ndarray) -> np.ndarray:
    """Reach of the exact body along directions ``(m, 3)``: the nearest of the planes ``w . t <= H(t)`` ``(m,)``."""
    t = fibonacci_twists(SUPPORTS, 1.0)
    H = found.exact.support(t)
    return np.concatenate([1 / (np.abs(some @ t.T) / H).max(axis=1) for some in np.array_split(u, 20)])


def _body(plotter: Any, found: StoredSurface, shape: Any, error: np.ndarray, top: float) -> None:
    """A surface, each component over the largest that the contact carries, with exact wrenches as dots."""
    u, most = sphere(ROWS, COLUMNS).reshape(-1, 3), _most(found)
    grid, e = (u * shape.radius(u * most)[:, None]).reshape(ROWS, COLUMNS, 3), error.reshape(ROWS, COLUMNS)
    corners = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4, 3)
    middle = 0.25 * (e[:-1, :-1] + e[1:, :-1] + e[1:, 1:] + e[:-1, 1:])
    solids.faces(plotter, corners, middle.ravel(), cmap=ERRORS, clim=(0, top))
    wrenches = found.exact.support_points(fibonacci_twists(MOTIONS, 1.0)) / most
    drawing.dots(plotter, np.vstack([wrenches, -wrenches]), 0.012, "white")
    solids.lines(plotter, np.stack([np.eye(3), 1.25 * np.eye(3)], axis=1), pictures.INK, 3)
    solids.labels(plotter, 1.33 * np.eye(3), [name for name, _ in COMPONENTS])


def fit_error_along(ds: xr.Dataset) -> tuple[Any, str]:
    """(c) Mean error of both fitted surfaces at every candidate along the object."""
    k, z = nearest(forces(ds), FORCE), 1e3 * ds.station.values
    found: dict[str, Any] = {name: 100 * field(ds, name) for name in FITS}
    grid = on_grid_along(ds, k)
    drawn, axes = pictures.figure(WIDTH, 3.3, 1, ds.sizes["angle"], gap=0.1, sharey=True)
    for j, panel in enumerate(axes[0]):
        for name, (label, colour, line, mark) in FITS.items():
            panel.plot(z, found[name][:, j, k], color=colour, ls=line, marker=mark, label=label)
            panel.plot(z, grid[name][:, j], color=colour, ls=line, lw=0.8, label=f"{label}, on the paper's grid")
        panel.set(xlabel="station along the axis [mm]", ylim=(0, None))
        panel.set_title(f"{'(c) ' * (j == 0)}pressed at {axis_text(ds, 'angle', j)}, {number(forces(ds)[k])} N")
    axes[0, 0].set_ylabel("mean error of the radius [%]")
    named = axes[0, 0].get_legend_handles_labels()
    drawn.legend(*named, loc="outside lower center", ncols=2, frameon=False, fontsize=8)
    ellipsoid, quartic = (found[name] for name in FITS)
    better = 100 * float(np.mean((quartic < ellipsoid)[np.isfinite(quartic)]))
    one, two = (float(np.nanmean(values[..., k])) for values in (ellipsoid, quartic))
    on_grid = " and ".join(f"{number(float(np.nanmean(values)), 2)} %" for values in grid.values())
    return drawn, (
        f"at {number(forces(ds)[k])} N on average {number(one, 2)} % for the ellipsoid, {number(two, 2)} % for the "
        f"quartic; the quartic fits better in {number(better)} % of the cases at all forces; on the paper's grid "
        f"of {GRID} x {GRID} centres of rotation {on_grid}"
    )


def on_grid_along(ds: xr.Dataset, k: int) -> dict[str, np.ndarray]:
    """Errors of `errors_on_grid` at a force ``(station, angle)`` [%], of the finger where they are larger."""
    view, shape = View(ds, ()), (ds.sizes["station"], ds.sizes["angle"])
    errors = {name: np.full(shape, np.nan) for name in FITS}
    for place in np.ndindex(shape):
        index = (*place, k)
        surfaces = [stored_surface(ds, index, finger, "ccm", view.faces(index)) for finger in range(FINGERS)]
        known = [errors_on_grid(found) for found in surfaces if found is not None and found.exact is not None]
        for name in FITS:
            errors[name][place] = 100 * max((own[name] for own in known), default=np.nan)
    return errors
