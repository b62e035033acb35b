"""Force over closing displacement, indentation and e_n of thin walls from results of jobs/snap-in.toml, as a picture.

    python jobs/snap-in.py results/snap-in.hdf results/snap-in-linear.hdf -o snap-in.png

Every file is a line, named by how its wall was simulated.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np

from softjaw.study import pictures
from softjaw.study.quantities import EFFECTS
from softjaw.study.result.store import open_result

PANELS = (("closing", "closing of the pads [mm]"), ("indentation", "indentation [mm]"), ("e_n", "e_n [mm]"))
LOOKS = ({"color": "#12436d"}, {"color": "#c05a00", "ls": "--"}, {"color": "#566069", "ls": ":"})


def line(file: Path) -> tuple[str, np.ndarray, list[np.ndarray]]:
    """How the wall of the first candidate was simulated, its forces [N], and the panels' values over them [mm]."""
    with open_result(file) as result:
        forces = np.asarray(result.axes[-1].values)
        values = [1e3 * np.asarray(result.read(f"{name}/{'ccm' if name == 'e_n' else name}")) for name, _ in PANELS]
        level = int(result.read("effects/object_level").ravel()[0])
    return EFFECTS["object"][level], forces, [v.reshape(-1, len(forces))[0] for v in values]


def draw(files: list[Path]) -> bytes:
    """The picture as PNG."""
    with pictures.style():
        drawn, axes = pictures.figure(11, 3.6, 1, len(PANELS), gap=0.16, sharey=True)
        for file, look in zip(files, LOOKS, strict=False):
            name, forces, values = line(file)
            for panel, x in zip(axes[0], values, strict=True):
                panel.plot(x, forces, label=name, marker="o", ms=3, **look)
        for panel, (_, text) in zip(axes[0], PANELS, strict=True):
            panel.set(xlabel=text, ylim=(0, None))
        axes[0, 0].set(xlim=(0, None), ylabel="force per finger [N]")
        axes[0, 0].legend(loc="lower right", frameon=False)
        return pictures.as_png(drawn)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Force over closing displacement, indentation and e_n, as a picture.")
    parser.add_argument("files", nargs="+", type=Path, help="up to three result files")
    parser.add_argument("-o", dest="out", type=Path, required=True, help="PNG to write")
    given = parser.parse_args()
    given.out.write_bytes(draw(given.files))
