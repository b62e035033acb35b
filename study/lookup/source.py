"""What a lookup takes out of a result file: the maps of one point of the sweep, and the object's symmetry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from softjaw.study.quantities import BY_KEY
from softjaw.study.result.read import axes_of, maps_in, values_of
from softjaw.study.result.store import place_text
from softjaw.study.scene import SceneError, parse_scene
from softjaw.study.units import in_si


class Source:
    """A result file at one point of its sweep.

    ``axes`` are station, angle and force; ``point`` holds the values of the swept keys as the scene writes them;
    ``maps`` gives unit and definition of every quantity of a case.
    """

    def __init__(self, ds: xr.Dataset, where: Mapping[str, Any]) -> None:
        self.file, self.scene, self.labels = Path(ds.file), ds.scene, ds.label.values
        self.all_axes = axes_of(ds)
        self.axes = self.all_axes[-3:]
        self.index, self.point = _sweep_point(self.all_axes[:-3], where)
        self.data = ds.isel(dict(zip(ds.status.dims, self.index, strict=False)), drop=True)
        self.status, self.messages = self.data.status.values, self.data.message.values
        self.maps = {name: (unit, ds[name].definition) for name, unit in maps_in(ds).items()}

    def read(self, name: str, model: str = "ccm") -> np.ndarray:
        """A map, or a finger's dataset ``(station, angle, force, finger, ...)`` in one friction model."""
        if name in self.maps:
            return values_of(self.data, name, model)
        if not self.has(name):
            raise KeyError(f"{name} is not in {self.file}; it has {', '.join(sorted(self.maps))}")
        variable = self.data[BY_KEY[name].variable]
        return (variable.sel(model=model) if "model" in variable.dims else variable).values

    def has(self, name: str) -> bool:
        """Whether the file has such a map or dataset of the fingers."""
        q = BY_KEY.get(name)
        return name in self.maps or bool(q and "finger" in q.dims and q.variable in self.data)

    def case(self, index: tuple[int, ...]) -> str:
        """A case in words, by its index along station, angle and force."""
        return place_text(self.all_axes, self.labels, (*self.index, *index))


def _sweep_point(axes: Any, where: Mapping[str, Any]) -> tuple[tuple[int, ...], dict[str, Any]]:
    """Index along the swept axes, and the values of their keys as the scene writes them."""
    index, point, left = [], {}, dict(where)
    for axis in axes:
        key = axis.long_name
        factor = in_si(key, 1.0)
        options: list[Any] = [*axis.options] or [v / factor for v in axis.values.tolist()]
        known = f"{key} = {', '.join(map(_text, options))}"
        if key not in left and axis.name not in left:
            if len(options) > 1:
                raise ValueError(f"where is missing {key}: give one of {known}")
            given = options[0]
        else:
            given = left.pop(key) if key in left else left.pop(axis.name)
            given = given / factor if key not in where and not isinstance(given, str) else given
        matching = [i for i, option in enumerate(options) if _same(option, given)]
        if not matching:
            raise ValueError(f"where has {key} = {_text(given)}: expected one of {known}; there is no interpolation")
        index.append(matching[0])
        point[key] = options[matching[0]]
    if left:
        known = ", ".join(axis.long_name for axis in axes) or "nothing: the file has no sweep"
        raise ValueError(f"where has {', '.join(left)}: expected {known}")
    return tuple(index), point


def _same(option: Any, given: Any) -> bool:
    if isinstance(option, str) or isinstance(given, str):
        return option == given
    return math.isclose(option, given, rel_tol=1e-9, abs_tol=1e-12)


def _text(value: Any) -> str:
    return value if isinstance(value, str) else f"{value:.6g}"


def turning(source: Source) -> tuple[float, bool]:
    """Period of the angles [rad], 0 for a body of revolution, and whether a period exchanges the fingers.

    Half a turn of the gripper is the same grasp with the fingers exchanged, if both stand alike (roll 0). A scene that
    this version cannot read has a whole turn as its period.
    """
    try:
        scene = parse_scene(source.scene, check_files=False)
        scene = scene.with_values(source.point) if source.point else scene
    except SceneError:
        return 2 * math.pi, False
    order, swap = scene.axis_symmetry, abs(math.sin(scene.candidates.roll)) < 1e-9
    if order % 2 and swap:
        return math.pi / order, True
    return (2 * math.pi / order if order else 0.0), False
