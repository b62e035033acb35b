"""Fig. 6 of the paper: an ellipsoid and a convex quartic for the same wrenches, and their errors along an object."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.friction.motion import fibonacci_twists
from softjaw.study import pictures
from softjaw.study.show.data import Data, number
from softjaw.study.show.figures import WIDTH
from softjaw.study.show.stored_surface import StoredSurface, stored_surface
from softjaw.study.show.tables.ranking import nearest
from softjaw.study.show.view import solids

MOTIONS = 250  # slip motions whose wrenches are drawn, and their opposites
SUPPORTS = 8000  # planes that bound the exact body
ROWS, COLUMNS = 61, 121  # directions from pole to pole, and round
ERRORS = "viridis"
FITS = {"fit_error_ellipsoid": ("ellipsoid from three motions", "#801650", "--", "D"),
        "fit_error": ("convex quartic", pictures.INK, "-", "v")}  # fmt: skip
FORCE = 3.0  # at which the error is drawn along the object [N]


def fitted_surfaces(data: Data) -> tuple[Any, str]:
    """(a) The ellipsoid and (b) the convex quartic, in the colours of their distance from the exact body."""
    index = (0, 0, len(data.forces) - 1)
    found = stored_surface(data, index, 0, "ccm")
    shapes = {"fit_error_ellipsoid": found.ellipsoid, "fit_error": found.chosen}
    u = _directions() * _most(found)
    exact = exact_radius(found, u)
    errors = {name: 100 * np.abs(shape.radius(u) / exact - 1) for name, shape in shapes.items()}
    top = max(float(e.max()) for e in errors.values())
    drawn, axes = pictures.figure(WIDTH, 3.9, 1, 2)
    words = []
    for panel, (name, shape), letter in zip(axes[0], shapes.items(), "ab", strict=True):
        image = solids.rendered(lambda plotter, n=name, s=shape: _body(plotter, found, s, errors[n], top),
                                   (0.9, 0.75, 0.45), (0, 0, 1), (1300, 1100))  # fmt: skip
        mean, most = number(100 * data.at(name, index), 2), number(errors[name].max(), 2)
        pictures.placed(panel, image, f"({letter}) {FITS[name][0]}: {mean} % off on average")
        words.append(f"{FITS[name][0]}: mean {mean} % over motions, largest {most} %")
    pictures.scale(drawn, axes, "distance from the exact limit surface, of its radius [%]", ERRORS, (0, top))
    return drawn, "; ".join(words)


def _directions() -> np.ndarray:
    """Directions ``(ROWS * COLUMNS, 3)`` on latitudes and longitudes."""
    t, phi = np.meshgrid(np.linspace(0, np.pi, ROWS), np.linspace(0, 2 * np.pi, COLUMNS), indexing="ij")
    return np.stack([np.sin(t) * np.cos(phi), np.sin(t) * np.sin(phi), np.cos(t)], axis=-1).reshape(-1, 3)


def _most(found: StoredSurface) -> np.ndarray:
    """Largest of each component that the contact carries ``(3,)`` [-]."""
    return np.abs(np.diagonal(found.wrenches(np.eye(3))))


def exact_radius(found: StoredSurface, u: np.ndarray) -> np.ndarray:
    """Reach of the exact body along directions ``(m, 3)``: the nearest of the planes ``w . t <= H(t)`` ``(m,)``."""
    t = fibonacci_twists(SUPPORTS, 1.0)
    H = np.einsum("ki,ki->k", found.wrenches(t), t)
    return np.concatenate([1 / (np.abs(some @ t.T) / H).max(axis=1) for some in np.array_split(u, 20)])


def _body(plotter: Any, found: StoredSurface, shape: Any, error: np.ndarray, top: float) -> None:
    """A surface, each component over the largest that the contact carries, with exact wrenches as dots."""
    u, most = _directions(), _most(found)
    grid, e = (u * shape.radius(u * most)[:, None]).reshape(ROWS, COLUMNS, 3), error.reshape(ROWS, COLUMNS)
    corners = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], axis=2).reshape(-1, 4, 3)
    middle = 0.25 * (e[:-1, :-1] + e[1:, :-1] + e[1:, 1:] + e[:-1, 1:])
    solids.faces(plotter, corners, middle.ravel(), cmap=ERRORS, clim=(0, top))
    solids.dots(plotter, found.samples(MOTIONS) / most, 0.012, color="white")
    solids.lines(plotter, np.stack([np.eye(3), 1.25 * np.eye(3)], axis=1), pictures.INK, 3)
    solids.labels(plotter, 1.33 * np.eye(3), ["f_x", "f_y", "tau_z"])


def fit_error_along(data: Data) -> tuple[Any, str]:
    """(c) Mean error of both fitted surfaces at every candidate along the object."""
    k = nearest(data.forces, FORCE)
    z = 1e3 * data.axes[-3].values
    drawn, axes = pictures.figure(WIDTH, 2.9, 1, data.shape[-2], gap=0.1, sharey=True)
    for j, panel in enumerate(axes[0]):
        for name, (label, colour, line, mark) in FITS.items():
            look = {"color": colour, "ls": line, "marker": mark, "label": label}
            panel.plot(z, 100 * data.map(name)[..., j, k].ravel(), **look)
        angle = number(np.degrees(data.axes[-2].values[j]))
        panel.set(xlabel="station along the axis [mm]", ylim=(0, None))
        panel.set_title(f"{'(c) ' * (j == 0)}pressed at {angle}°, {number(data.forces[k])} N")
    axes[0, 0].set_ylabel("mean error of the radius [%]")
    axes[0, -1].legend(frameon=False, fontsize=8)
    return drawn, _compared(data, k)


def _compared(data: Data, k: int) -> str:
    ellipsoid, quartic = (data.map(name) for name in FITS)
    better = np.mean((quartic < ellipsoid)[np.isfinite(quartic)])
    one, two = (100 * np.nanmean(m[..., k]) for m in (ellipsoid, quartic))
    return (
        f"at {number(data.forces[k])} N on average {number(one, 2)} % for the ellipsoid, {number(two, 2)} % for the "
        f"quartic; the quartic fits better in {number(100 * better)} % of the cases at all forces"
    )
