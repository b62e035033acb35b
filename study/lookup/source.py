"""What a lookup takes out of a result file: the maps of one point of the sweep, and the object's symmetry."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from softjaw.study.result.layout import MODELS, ROOT
from softjaw.study.result.store import open_result
from softjaw.study.show.tables.show import place

GROUPS = ("fingers", "limit_surface")
TOO_LARGE = ("cor_wrench",)


class Source:
    """Everything that was read of a file at one point of its sweep; the file is closed.

    ``axes`` are station, angle and force; ``point`` holds the values of the swept keys as the scene writes them;
    ``maps`` gives unit and definition of every quantity of a case.
    """

    def __init__(self, result: Any, where: Mapping[str, Any]) -> None:
        self.file, self.scene, self.labels = result.path, result.scene, result.labels
        self.all_axes, self.layout = result.axes, result.layout
        self.axes = result.axes[-3:]
        self.index, self.point = _sweep_point(result.axes[:-3], where)
        self.status, self.messages = result.status[self.index], result.messages[self.index]
        shape = result.layout.shape
        paths = [d.path.removeprefix(f"{ROOT}/") for d in result.layout.datasets if d.shape[: len(shape)] == shape]
        maps = [q for q in result.layout.quantities if q.group == "maps"]
        names = {q.name for q in maps}
        wanted = [p for p in paths if p.split("/")[0] in (*GROUPS, *names) and p.split("/")[1] not in TOO_LARGE]
        self._values = {path: result.read(path)[self.index] for path in wanted}
        self._by_model = {q.name if q.group == "maps" else q.key: q.by_model for q in result.layout.quantities}
        self.maps = {q.name: (q.unit, q.definition) for q in maps}
        for d in result.layout.derived:
            over = tuple(n.replace(".", "_") for n in d.axes)
            if over in (result.layout.names, result.layout.names[:-1]) and not d.shape:
                found = result.derived(d.name)[self.index]
                found = found if over == result.layout.names else found[..., None]
                self._values[f"{d.name}/{d.name}"] = np.broadcast_to(found, self.status.shape)
                self.maps[d.name] = d.units, d.definition

    def read(self, name: str, model: str = "curved") -> np.ndarray:
        """A map, or a finger's dataset ``(station, angle, force, finger, ...)`` in one friction model."""
        if "/" in name and name in self._values:
            values = self._values[name]
            return values[..., MODELS.index(model), *self._trailing(name)] if self._by_model[name] else values
        if name in self.maps:
            return self._values[f"{name}/{model if self._by_model.get(name) else name}"]
        raise KeyError(f"{name} is not in {self.file}; it has {', '.join(sorted(self.maps))}")

    def has(self, name: str) -> bool:
        """Whether the file has such a map or dataset."""
        return name in self.maps or name in self._values

    def case(self, index: tuple[int, ...]) -> str:
        """A case in words, by its index along station, angle and force."""
        whole = SimpleNamespace(axes=self.all_axes, layout=self.layout, labels=self.labels)
        return place(whole, int(np.ravel_multi_index((*self.index, *index), self.layout.shape)))

    def _trailing(self, name: str) -> tuple[slice, ...]:
        return (slice(None),) * (self._values[name].ndim - 5)


def read_source(file: Path, where: Mapping[str, Any]) -> Source:
    """What a lookup needs of a file."""
    with open_result(file) as result:
        return Source(result, where)


def _sweep_point(axes: Any, where: Mapping[str, Any]) -> tuple[tuple[int, ...], dict[str, Any]]:
    """Index along the swept axes, and the values of their keys as the scene writes them."""
    index, point, left = [], {}, dict(where)
    for axis in axes:
        key, _, legend = axis.long_name.partition(" (")
        factor = _size(key)
        options: list[Any] = re.findall(r"(?:^|, )\d+ = ([^,)]*)", legend) or [v / factor for v in axis.values.tolist()]
        told = f"{key} = {', '.join(map(_text, options))}"
        if key not in left and axis.name not in left:
            if len(options) > 1:
                raise ValueError(f"where is missing {key}: give one of {told}")
            given = options[0]
        else:
            given = left.pop(key) if key in left else left.pop(axis.name)
            given = given / factor if key not in where and not isinstance(given, str) else given
        found = [i for i, option in enumerate(options) if _same(option, given)]
        if not found:
            raise ValueError(f"where has {key} = {_text(given)}: expected one of {told}; nothing is interpolated there")
        index.append(found[0])
        point[key] = options[found[0]]
    if left:
        known = ", ".join(axis.long_name.partition(" (")[0] for axis in axes) or "nothing: the file has no sweep"
        raise ValueError(f"where has {', '.join(left)}: expected {known}")
    return tuple(index), point


def _size(key: str) -> float:
    from softjaw.study.units import UNITS, split_unit

    unit = split_unit(key)[1]
    return UNITS[unit].size if unit else 1.0


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
    from softjaw.study.scene import parse_scene
    from softjaw.study.scene.problems import SceneError

    try:
        scene = parse_scene(source.scene, check_files=False)
        scene = scene.with_values(source.point) if source.point else scene
    except SceneError:
        return 2 * math.pi, False
    order, swap = scene.axis_symmetry, abs(math.sin(scene.candidates.roll)) < 1e-9
    if order % 2 and swap:
        return math.pi / order, True
    return (2 * math.pi / order if order else 0.0), False
