"""From a case of a catalogue to its scene."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from softjaw.study.catalogue.model import Case, Catalogue
from softjaw.study.messages import USAGE, StudyError
from softjaw.study.scene import Scene, parse_scene
from softjaw.study.scene.load import ALTERNATIVES
from softjaw.study.scene.problems import SceneError
from softjaw.study.scene.text import parse_toml, read_text, toml_text

WHOLE = {"object": ("shape",), "candidates": sum(ALTERNATIVES, ())}  # keys that make a section replace its base's


def case_scene(catalogue: Catalogue, case: Case, path: Path, overrides: Sequence[str] = ()) -> Scene:
    """Scene of a case of the catalogue that stands in the file ``path``.

    Raises
    ------
    StudyError
        With everything wrong with it.
    """
    base = catalogue.base.get(case.base)
    try:
        if base is None:
            base = parse_toml(read_text(path.parent / case.base), case.base)
    except SceneError as error:
        raise StudyError(USAGE, str(error)) from error
    text = toml_text(merged(base, case.sections))
    try:
        return parse_scene(text, path.parent / f"{case.name}.toml", overrides)
    except SceneError as error:
        lines = [f"{p.key}: found {p.found}, expected {p.expected}; {p.remedy}" for p in error.problems]
        raise StudyError(USAGE, "\n".join(lines)) from error


def merged(base: Mapping[str, Any], sections: Mapping[str, Any]) -> dict[str, Any]:
    """Sections of a case laid over those of its base: key by key, but another shape or place replaces the whole.

    >>> merged({"load": {"a": 1, "b": 2}}, {"load": {"b": 3}})
    {'load': {'a': 1, 'b': 3}}
    """
    data = {name: dict(table) for name, table in base.items()}
    for name, table in sections.items():
        whole = not isinstance(table, Mapping) or any(key in table for key in WHOLE.get(name, ()))
        data[name] = table if whole else {**data.get(name, {}), **table}
    return data
