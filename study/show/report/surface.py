"""Pictures of limit surfaces: the wrenches that a contact can carry, the surfaces fitted to them, and how far off."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.case.stored_surface import StoredSurface, shadow_outline, stored_surface
from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number, shown
from softjaw.study.show.report.page import Picture
from softjaw.study.show.tables.ranking import largest

COMPONENTS = (("f_x", "N", 1.0), ("f_y", "N", 1.0), ("tau_z", "N mm", 1e3))
PLANES = ((0, 1), (0, 2), (1, 2))
SAMPLES = 300  # that are drawn in space
LINES = {
    "chosen": {"linestyle": "-", "lw": 1.5},
    "ellipsoid": {"linestyle": "--", "lw": 1.1},
}


def surface_pictures(data: Data, index: tuple[int, ...]) -> list[Picture]:
    """Shadows and a view in space of the weaker finger's limit surfaces at one case; none where nothing is stored."""
    weakest = data.values("fingers/tau_z_max")
    finger = 0 if weakest is None else largest(-np.nan_to_num(weakest[index][:, 0]))
    found = {model: stored_surface(data, index, finger, model) for model in ("curved", data.planar)}
    known = {model: surface for model, surface in found.items() if surface is not None and surface.ellipsoid.rank == 3}
    if not known:
        return []
    pictures_found = [_shadows(data, index, known)]
    if all(surface.patch is not None for surface in known.values()):
        pictures_found.append(_space(data, index, known))
    return pictures_found


def _shadows(data: Data, index: tuple[int, ...], known: dict[str, StoredSurface]) -> Picture:
    drawn, axes = pictures.figure(10, 3.9, 1, 3, gap=0.1)
    for panel, (i, j) in zip(axes.flat, PLANES, strict=True):
        for model, surface in reversed(known.items()):  # the curved model on top
            _shadow(panel, surface, model, i, j)
        panel.set(xlabel=_label(i), ylabel=_label(j))
        panel.set_title(f"shadow on {COMPONENTS[i][0]}, {COMPONENTS[j][0]}")
        panel.axhline(0, color=pictures.SOFT, lw=0.4, zorder=0)
        panel.axvline(0, color=pictures.SOFT, lw=0.4, zorder=0)
    axes[0, 0].set_aspect("equal", adjustable="datalim")
    named = dict(zip(*reversed(axes[0, 0].get_legend_handles_labels()), strict=True))
    labels = sorted(named, key=lambda label: list(known).index(label.partition(",")[0]))
    drawn.legend(
        [named[label] for label in labels], labels, loc="outside lower center", ncols=3, frameon=False, fontsize=8
    )
    exact = "Dots are exact wrenches of slip motions. " if any(s.patch for s in known.values()) else ""
    caption = (
        f"{data.place(index, force=True)}: the loads that one contact carries without slipping, seen along each axis. "
        f"{exact}Full lines: fitted surface; dashed: ellipsoid from three motions. {_misfits(data, index)}"
    )
    alt = f"Shadows of the limit surface on the three planes of f_x, f_y and tau_z. {_misfits(data, index)}"
    return Picture(pictures.as_svg(drawn), alt, caption)


def _label(i: int) -> str:
    name, unit, _ = COMPONENTS[i]
    return f"{name} [{unit}]"


def _shadow(panel: Any, surface: StoredSurface, model: str, i: int, j: int) -> None:
    style = pictures.MODEL_STYLE[model]
    scale = surface.unit[[i, j]] * [COMPONENTS[i][2], COMPONENTS[j][2]]
    exact = surface.outline(i, j, 48)
    if exact is not None:
        look = {"ls": "", "marker": style["marker"], "ms": 3.2, "mfc": "none", "mew": 0.8, "color": style["color"]}
        panel.plot(*(exact * scale).T, **look, label=f"{model}, exact")
    for name, shape in (("chosen", surface.chosen), ("ellipsoid", surface.ellipsoid)):
        if shape is not None:
            outline = shadow_outline(shape, i, j) * scale
            closed = np.vstack([outline, outline[:1]])
            what = "fitted" if name == "chosen" else "three motions"
            panel.plot(*closed.T, color=style["color"], **LINES[name], label=f"{model}, {what}")


def _misfits(data: Data, index: tuple[int, ...]) -> str:
    fitted, ellipsoid = data.at("misfit", index), data.at("misfit_ellipsoid", index)
    if not np.isfinite(fitted) or not np.isfinite(ellipsoid):
        return ""
    return (
        f"Mean error of the radius (curved model): {number(100 * fitted, 2)} % fitted, {number(100 * ellipsoid, 2)} % "
        "from three motions."
    )


def _space(data: Data, index: tuple[int, ...], known: dict[str, StoredSurface]) -> Picture:
    drawn, axes = pictures.figure(10, 4.6, 1, len(known), subplot_kw={"projection": "3d"})
    reach = np.max([np.abs(s.samples(SAMPLES) * s.unit).max(axis=0) for s in known.values()], axis=0)
    factors = np.array([c[2] for c in COMPONENTS])
    for panel, (model, surface) in zip(axes.flat, known.items(), strict=True):
        points = surface.samples(SAMPLES) * surface.unit * factors
        colour = pictures.MODEL_STYLE[model]["color"]
        for line in _wires(surface.chosen or surface.ellipsoid):
            panel.plot(*(line * surface.unit * factors).T, color=pictures.SOFT, lw=0.5, alpha=0.8)
        panel.scatter(*points.T, s=5, color=colour, depthshade=True, linewidths=0, rasterized=True)
        panel.set(xlabel=_label(0), ylabel=_label(1), zlabel=_label(2))
        for axis, most in zip("xyz", reach * factors, strict=True):
            getattr(panel, f"set_{axis}lim")(-1.05 * most, 1.05 * most)
        panel.set_title(f"{model} model", y=0.9)
        panel.view_init(22, -55)
        panel.set_box_aspect(None, zoom=0.88)  # leaves room for the label at the right
        panel.locator_params(nbins=5)
    caption = (
        f"Wrenches of {SAMPLES} slip motions and their opposites (dots), computed from the stored contact patch, with "
        "the fitted limit surface (lines), in equal frames."
    )
    models = " and the ".join(known)
    alt = f"Wrenches in the space of f_x, f_y and tau_z with the fitted surface, for the {models} model."
    return Picture(pictures.as_webp(drawn), alt, caption, kind="webp")


def _wires(shape: Any, count: int = 12) -> list[np.ndarray]:
    """Lines of longitude and latitude on a surface."""
    phi = np.linspace(0, 2 * np.pi, 61)
    c, s = np.cos(phi), np.sin(phi)
    heights = np.radians([-60, -30, 0, 30, 60])
    rings = [np.column_stack([c * np.cos(a), s * np.cos(a), np.full(len(phi), np.sin(a))]) for a in heights]
    turns = np.pi * np.arange(count // 2) / (count // 2)
    halves = [np.column_stack([c * np.cos(b), c * np.sin(b), s]) for b in turns]
    return [u * shape.radius(u)[:, None] for u in rings + halves]


def misfit_curves(data: Data, position: int, index: tuple[int, ...]) -> Picture | None:
    """Misfit of the fitted surface and of the ellipsoid from three motions over one axis; None if it is not stored."""
    cut = tuple(slice(None) if i == position else k for i, k in enumerate(index))
    found = {"fitted": data.map("misfit"), "three motions": data.map("misfit_ellipsoid")}
    lines = {name: 100 * values[cut] for name, values in found.items() if values is not None}
    if not any(np.isfinite(line).sum() > 1 for line in lines.values()):
        return None
    axis = data.axes[position]
    x = axis.values * shown(axis.units)[1]
    drawn, axes = pictures.figure(6, 2.6, 1, 1)
    styles = {"fitted": pictures.MODEL_STYLE["curved"], "three motions": {**pictures.MODEL_STYLE["curved"], "ls": "--"}}
    styles = {name: {**{k: v for k, v in s.items() if k != "linestyle" or name == "fitted"}, "marker": ""}
              for name, s in styles.items()}  # fmt: skip
    pictures.curves(axes[0, 0], x, lines, styles)
    axes[0, 0].set(xlabel=data.axis_label(axis), ylabel="misfit [%]")
    axes[0, 0].set_ylim(bottom=0)
    caption = (
        "Mean error of the limit surface's radius, curved model, weaker fit of both fingers, on motions that no "
        "surface was fitted to."
    )
    return Picture(pictures.as_svg(drawn), f"Misfit of the limit surfaces over {data.name(axis)}", caption, narrow=True)
