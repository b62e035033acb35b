"""Maps of a report over station and angle, at one force or at several to choose from."""

from __future__ import annotations

import numpy as np

from softjaw.study.show import pictures
from softjaw.study.show.data import Data, number
from softjaw.study.show.report.maps import (
    HOW_TO_READ,
    MAPS,
    MOST_ANGLES,
    SHORT,
    different_angles,
    draw_panel,
    elsewhere,
    extremes,
    main_axis,
    panel_spot,
    scaled,
)
from softjaw.study.show.report.page import MOST_CHOICES, Picture, choice, picture


def angle_maps(data: Data, index: tuple[int, ...]) -> str:
    """Quality and e_n over the main axis and the angle; empty where all angles give the same.

    Where `force_maps` cannot draw all angles there is one picture for each of the highest forces, to choose from.
    """
    angles = different_angles(data)
    if len(angles) < 2:
        return ""
    highest = range(len(data.forces))[1 - MOST_CHOICES :] if len(angles) > MOST_ANGLES else ()
    forces = sorted({index[-1], *highest})
    figures = [picture(_angle_map(data, (*index[:-1], k))) for k in forces]
    if len(figures) == 1:
        return figures[0]
    labels = [f"{number(data.forces[k])} N" for k in forces]
    return choice("Normal force per finger", labels, figures, forces.index(index[-1]))


def _angle_map(data: Data, index: tuple[int, ...]) -> Picture:
    x, y = main_axis(data), len(data.shape) - 2
    drawn, axes = pictures.figure(10, min(max(1.1 + 0.25 * data.shape[y], 1.8), 4.5) + 0.5, 1, 2, sharey=True)
    for column, name in enumerate(MAPS):
        values = scaled(data, name)[..., index[-1]]
        last = draw_panel(data, axes[0, column], name, x, y, index, pictures.span(values))
        if np.isfinite(values).any():
            pictures.colour_bar(drawn, last, axes[0, column], SHORT[name])
        axes[0, column].set_xlabel(data.axis_label(data.axes[x]))
    axes[0, 0].set_ylabel("angle [°]")
    caption = f"At {elsewhere(data, index, x, y) or number(data.forces[index[-1]]) + ' N'}. {HOW_TO_READ}"
    alt = f"Heat maps of grasp quality and e_n over {data.name(data.axes[x])} and angle. {extremes(data, index)}"
    svg = pictures.as_svg(drawn)
    spots = [panel_spot(data, axes[0, column], name, x, y, index) for column, name in enumerate(MAPS)]
    return Picture(svg, alt, caption, spots=tuple(spots))
