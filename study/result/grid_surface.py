"""The object's surface of the grid in a result file, before anything is solved."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np

from softjaw.study.case.build import has_wall
from softjaw.study.result.grid import Surface
from softjaw.study.show.data import Data
from softjaw.study.show.view.model import View


def surface_of(scene: Any, axes: Any) -> Surface:
    """The object of a scene, at the first point of its sweep, cut along the cells of its candidates."""
    asked = SimpleNamespace(
        result=SimpleNamespace(scene=scene.effective_toml()), axes=axes, shape=tuple(len(a.values) for a in axes),
        by_poses=not axes[-3].units, walled=has_wall(scene.object),
        values=lambda _: None,  # nothing is solved yet: no marks where the fingers touch
    )  # fmt: skip
    corners, cell = View(cast(Data, asked), (0,) * (len(axes) - 3)).surface
    points, inverse = np.unique(np.round(corners[..., :3].reshape(-1, 3), 9), axis=0, return_inverse=True)
    return Surface(points, inverse.reshape(-1, 3), cell)
