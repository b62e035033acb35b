"""YAML as readers of versions 1.1 and 1.2 take it."""

from __future__ import annotations

import json
import math
import re
from typing import Any


def yaml_text(value: Any, indent: int = 0) -> str:
    """Mappings as blocks, lists of numbers in one line; every number is one for readers of YAML 1.1 and 1.2.

    A text in the key ``#`` is a comment, on lines of its own.

    >>> print(yaml_text({"a": {"b": [1.0, 1e-5], "c": "on", "#": "note"}, "d": []}))
    a:
      b: [1.0, 1.0e-05]
      c: "on"
      # note
    d: []
    """
    pad, lines = " " * indent, []
    for key, held in value.items():
        if key == "#":
            lines += [f"{pad}# {line}" for line in str(held).splitlines()]
        elif isinstance(held, dict) and held:
            lines += [f"{pad}{key}:", yaml_text(held, indent + 2)]
        elif isinstance(held, list | tuple) and held and isinstance(held[0], dict):
            blocks = [yaml_text(member, indent + 2) for member in held]
            lines += [f"{pad}{key}:", *(f"{pad}- {block.lstrip()}" for block in blocks)]
        else:
            lines.append(f"{pad}{key}: {_flow(held)}")
    return "\n".join(lines)


def _flow(value: Any) -> str:
    """A value in one line: JSON, which is YAML, but for the numbers that YAML 1.1 would take for texts.

    >>> _flow(2e-7), _flow("2e-7"), _flow({"w": 1.0, "xyz": [0.0, 5e-324]})
    ('2.0e-07', '"2e-7"', '{w: 1.0, xyz: [0.0, 5.0e-324]}')
    """
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {_flow(held)}' for key, held in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(_flow, value))}]"
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else f"{'-' * (value < 0)}.inf"
    if isinstance(value, float):
        return re.sub(r"^(-?\d+)e", r"\1.0e", repr(value))
    return json.dumps(value)
