"""The pictures of `softjaw view` of all objects on one sheet, each with its name and its best grasp."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill

import numpy as np
from matplotlib import image
from matplotlib.figure import Figure

from softjaw.study.show.view.solids import trimmed

COLUMNS = 4
OBJECT = (slice(None), slice(200, 930))  # rows and columns of such a picture without its scales and its text


def contact_sheet(pictures: dict[str, tuple[str, Path]], file: Path) -> None:
    """Write a PNG of these pictures: caption and file by the object's name; those that are missing stay empty."""
    rows = -(-max(len(pictures), 1) // COLUMNS)
    figure = Figure(figsize=(3.6 * COLUMNS, 3.2 * rows), layout="constrained")
    axes = figure.subplots(rows, COLUMNS, squeeze=False).ravel()
    for ax in axes:
        ax.set_axis_off()
    for ax, (name, (best, picture)) in zip(axes, pictures.items(), strict=False):
        ax.set_title(f"{name}\n{fill(best, 44)}", fontsize=8)
        if picture.exists():
            pixels = image.imread(picture)[..., :3][OBJECT]
            ax.imshow(trimmed(np.rint(255 * pixels)).astype(np.uint8))
    figure.savefig(file, dpi=110)
