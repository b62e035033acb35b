"""Figs. 4ab and 5a of the paper: soft pads on curved objects, their pressure, and the friction of their elements."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from jobs.figures import drawing
from softjaw.study import pictures
from softjaw.study.case.build import outer_surface
from softjaw.study.scene import load_scene
from softjaw.study.show.grasps import at, axis_text, forces, number
from softjaw.study.show.view import solids
from softjaw.study.show.view.model import FORCE, NEUTRAL, View
from softjaw.study.show.view.pads import Pad

SCENES = Path(__file__).parents[1]
WIDTH = 8.5  # of every figure [in]
RATIO = 0.6  # b/a of the contact that is drawn
ARROWS = 9, 3  # at most, along and across the pad
LONGEST = 2.6  # arrow [mm]
FREE = "#eef0f1"  # faces without contact
MAP = "bottle"  # the scene whose candidates are shown
MARK = 0.8  # radius of a candidate's mark [mm]


def contact(ds: xr.Dataset) -> tuple[Any, str]:
    """(a) A pad on the elliptic cylinder with the pressure on its elements; (b) their friction against a turn."""
    ratio = ds.b_over_a.values
    index = (int(np.abs(ratio - RATIO).argmin()), 0, 0, len(forces(ds)) - 1)
    view = View(ds, index[:1])
    pad = view.pads(index)[0]
    top = 1e-3 * float(pad.pressure.max())
    out, along, beside = -pad.approach, pad.pose.rotation[:, 0], pad.pose.rotation[:, 1]

    def whole(plotter: Any) -> None:
        solids.surface(plotter, 1e3 * view.surface.points, view.surface.triangles, color=NEUTRAL)
        solids.block(plotter, pad)
        solids.pressures(plotter, pad, top)

    def close(plotter: Any) -> None:
        solids.faces(plotter, 1e3 * pad.quads()[~pad.loaded.ravel()], color=FREE)
        solids.pressures(plotter, pad, top, show_edges=True)
        solids.arrows(plotter, _fewer(pad).arrows("turn", LONGEST))

    drawn, axes = pictures.figure(WIDTH, 3.2, 1, 2)
    title = f"a soft pad on an elliptic cylinder, b/a = {number(ratio[index[0]])}, {number(forces(ds)[-1])} N"
    parts = (
        (f"(a) {title}", whole, 0.62 * out + 0.75 * beside + 0.3 * along),
        ("(b) its elements' friction against a turn about the normal", close, 0.9 * out + 0.5 * beside + 0.15 * along),
    )
    for panel, (title, draw, towards) in zip(axes[0], parts, strict=True):
        drawing.placed(panel, drawing.rendered(draw, towards, out, (1500, 900)), title)
    drawing.scale(drawn, axes, "contact pressure [kPa]", pictures.COLOURS["pressure"], (0, top))
    tilt = np.degrees(np.arccos(np.clip(pad.normal[pad.loaded] @ pad.approach, -1, 1))).max()
    return drawn, (
        f"loaded elements tilt by up to {number(tilt, 2)} degrees; of the friction across the cylinder that the PCM "
        f"claims, {number(100 * at(ds, 'f_y_overestimate', index), 2)} % is missing"
    )


def _fewer(pad: Pad) -> Pad:
    """The pad with fewer faces for arrows: those in the middle of equal strides over its loaded part."""
    rows, columns = (np.flatnonzero(pad.loaded.any(axis=k)) for k in (1, 0))
    counts = (min(n, len(k)) for k, n in zip((rows, columns), ARROWS, strict=True))
    i, j = (k[((np.arange(n) + 0.5) / n * len(k)).astype(int)] for k, n in zip((rows, columns), counts, strict=True))
    of = np.ix_(i, j)
    return pad._replace(centroid=pad.centroid[of], normal=pad.normal[of], pressure=pad.pressure[of], area=pad.area[of])


def candidates(ds: xr.Dataset) -> tuple[Any, str]:
    """(a) The candidates of a map on its object, and the pressure on a pad at one of them."""
    index = (0, 0, len(forces(ds)) - 1)
    view = View(ds)
    both = view.pads(index)
    pad, top = both[0], 1e-3 * max(float(p.pressure.max()) for p in both)
    marks, up = candidate_marks(), np.array([0.0, 0.0, 1.0])

    def whole(plotter: Any) -> None:
        solids.surface(plotter, 1e3 * view.surface.points, view.surface.triangles, color=NEUTRAL)
        drawing.dots(plotter, 1e3 * marks, MARK, FORCE)
        for finger in both:
            solids.block(plotter, finger)
            solids.pressures(plotter, finger, top)

    drawn, axes = pictures.figure(WIDTH, 3.5, 1, 2, width_ratios=[1, 1.7])
    seen = -0.5 * pad.approach + 0.85 * np.cross(up, pad.approach) + 0.2 * up
    image = drawing.rendered(whole, seen, up, (1100, 1300))
    drawing.placed(axes[0, 0], image, f"(a) {len(marks) // 2} candidates, one grasp")
    mapped = _front(axes[0, 1], pad, top)
    place = f"station {number(1e3 * ds.station.values[0])} mm, {axis_text(ds, 'angle', 0)}, {number(forces(ds)[-1])} N"
    axes[0, 1].set_title(f"pressure on its pad: {place}")
    drawing.scale_beside(drawn, mapped, axes[0, 1], "pressure [kPa]")
    off = 1e3 * float(np.linalg.norm(pad.pose.to_pad(pad.origin)[:2]))
    return drawn, f"the contact's origin lies {number(off)} mm from the middle of the pad: pressure is not symmetric"


def candidate_marks() -> np.ndarray:
    """Where the fingers of the map's candidates touch ``(2 c, 3)`` [m]."""
    scene = load_scene(SCENES / f"{MAP}.toml")
    places = []
    for angle in scene.candidates.angles:
        stations = np.array(scene.candidates.station_values)
        reach = np.interp(stations, *outline(scene.object, angle))
        for sign in (1.0, -1.0):
            places.append(np.stack([sign * reach * np.cos(angle), sign * reach * np.sin(angle), stations], axis=1))
    return np.concatenate(places)


def outline(shape: Any, angle: float) -> tuple[np.ndarray, np.ndarray]:
    """Heights and half widths [m] along the approach at ``angle`` [rad] of an object with a wall round its axis."""
    surface = outer_surface(shape)
    theta, s = np.meshgrid(np.linspace(0, 2 * np.pi, 73), np.linspace(*surface.wall, 161), indexing="ij")
    place = surface.jets(theta, s)[:, 0].reshape(*theta.shape, 3)
    along = place[..., 0] * np.cos(angle) + place[..., 1] * np.sin(angle)
    return place[0, :, 2], 0.5 * np.ptp(along, axis=0)


def _front(axes: Any, pad: Pad, top: float) -> Any:
    """The pad's contact face in its own frame, with the contact frame and the pad's middle."""
    corners, loaded = 1e3 * pad.pose.to_pad(pad.quads().reshape(-1, 3)).reshape(-1, 4, 3)[..., :2], pad.loaded.ravel()
    pale = {"cmap": "Greys", "edgecolor": "#d5dade"}
    drawing.polygons(axes, corners[~loaded], np.zeros((~loaded).sum()), (0, 12), **pale).set_zorder(0)
    pressure, colours = 1e-3 * pad.pressure.ravel()[loaded], pictures.COLOURS["pressure"]
    mapped = drawing.polygons(axes, corners[loaded], pressure, (0.0, top), cmap=colours)
    origin, frame = 1e3 * pad.pose.to_pad(pad.origin)[:2], pad.frame @ pad.pose.rotation
    for name, direction in zip("xy", frame[:2], strict=True):
        drawing.arrow(axes, origin, origin + 8 * direction[:2])
        axes.text(*(origin + 10 * direction[:2]), name, ha="center", va="center")
    axes.plot(*origin, "o", ms=5, mfc="white", mec=pictures.INK)
    axes.plot(0, 0, "+", ms=9, mew=1.4, color=pictures.INK)
    axes.annotate("middle of the pad", (0, 0), (0, -3), textcoords="data", ha="center", va="top", fontsize=8)
    low, high = corners.min(axis=(0, 1)) - 1, corners.max(axis=(0, 1)) + 1
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
    axes.set(xlabel="along the pad [mm]", ylabel="across the pad [mm]")
    return mapped
