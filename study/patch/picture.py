"""Sections of a patch's limit surface, the exact one beside the fitted ones."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.friction.patch import FloatArray
from softjaw.study.patch.evaluate import Judged
from softjaw.study.show.pictures import SOFT, as_png, as_svg, figure, style
from softjaw.study.writing import write_file

FORMS = {".png": as_png, ".svg": as_svg}
AXES = ("f_x / S", "f_y / S", "tau_z / S [mm]")
PLANES = ((0, 1), (0, 2), (1, 2))
LOOK = {
    "exact": {"color": "#1d2429", "linewidth": 2.2},
    "three_motions": {"color": "#c05a00", "linestyle": "--"},
    "axis_aligned": {"color": "#8a5a9e", "linestyle": "-."},
    "full": {"color": "#2a8c82", "linestyle": ":"},
    "quartic": {"color": "#12436d", "linestyle": (0, (6, 2))},
}


def write_picture(patches: Sequence[Judged], mu: float, surface: str, path: Path) -> None:
    """Write the picture of all patches, one row each; the ending chooses the format.

    Raises
    ------
    StudyError
        With code 5 if the file cannot be written.
    """
    with style():
        drawn, axes = figure(9.0, 3.1 * len(patches), len(patches), len(PLANES))
        for row, judged in zip(axes, patches, strict=True):
            _row(row, judged, mu, surface)
        axes[0, 0].legend(*axes[0, 0].get_legend_handles_labels(), frameon=False, fontsize=7.5, loc="center")
        data = FORMS[path.suffix.lower()](drawn)
    write_file(path, data)


def section(judged: Judged, name: str, plane: tuple[int, int], n: int = 361) -> FloatArray:
    """Curve in which a plane of two axes meets a limit surface of the curved model, per unit of S.

    Parameters
    ----------
    judged : Judged
        The patch.
    name : str
        ``exact`` or the name of a fitted surface.
    plane : (int, int)
        Axes out of ``(f_x, f_y, tau_z)``.
    n : int
        Points of the curve.

    Returns
    -------
    (n, 2) array
        Loads in the plane [-, m].
    """
    phi = np.linspace(0, 2 * np.pi, n)
    u = np.zeros((n, 3))
    u[:, plane[0]], u[:, plane[1]] = np.cos(phi), np.sin(phi)
    u *= [1.0, 1.0, judged.rho]  # torque in proportion to force, for even steps
    surface = judged.exact["curved"] if name == "exact" else judged.surfaces["curved"][name].surface
    curve = surface.radius(u)[:, None] * u
    return curve[:, list(plane)]


def _row(row: Any, judged: Judged, mu: float, surface: str) -> None:
    names = dict.fromkeys(["exact", "three_motions", surface])
    for axes, plane in zip(row, PLANES, strict=True):
        axes.axhline(0, color=SOFT, linewidth=0.4)
        axes.axvline(0, color=SOFT, linewidth=0.4)
        for name in names:
            with np.errstate(invalid="ignore", divide="ignore"):
                curve = section(judged, name, plane) * [1e3 if k == 2 else 1.0 for k in plane]
            axes.plot(*curve.T, label=name.replace("_", " "), **LOOK[name])
        axes.set_xlabel(AXES[plane[0]])
        axes.set_ylabel(AXES[plane[1]])
    row[0].set_title(f"{Path(judged.read.file).name}, curved model, mu = {mu:g}")
