"""Reference pages of the site, made from the tables of the program each time the site is built; none is stored.

`mkdocs.yml` names this file as a hook: mkdocs calls `on_config` and `on_files`.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import json
import os
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import groupby
from pathlib import Path
from typing import Any

from pydantic import BaseModel

import softjaw
from softjaw.study.cli.options import COMMANDS, program
from softjaw.study.flags import DERIVED, Flag
from softjaw.study.messages import MEANING
from softjaw.study.quantities import EFFECTS, INDICATORS, MODEL_NAMES, REASONS, STATES, TABLE, Quantity
from softjaw.study.scene.grasps import GraspPose
from softjaw.study.scene.model import SECTIONS, Scene
from softjaw.study.scene.objects import SHAPES, SectionTable, Shape, Walled
from softjaw.study.scene.section import SceneSection
from softjaw.study.units import UNITS, split_unit

BOUNDS = {"exclusiveMinimum": ">", "minimum": ">=", "exclusiveMaximum": "<", "maximum": "<="}
ROOT = Path(__file__).parents[1]
WIDTH = 96  # columns of a command's help
NESTED = {  # tables within a section, with an example of where they stand
    "[[candidates.poses]]": GraspPose,
    "[[object.sections]]": SectionTable,
}


def table(head: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    r"""A table of markdown; what a cell holds cannot end it.

    >>> print(table(["a", "b"], [["x|y", 1]]))
    | a | b |
    | --- | --- |
    | x\|y | 1 |
    """
    head = list(head)
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(_cell(value) for value in line) + " |" for line in lines)


def _cell(value: Any) -> str:
    return re.sub(r"\s+", " ", str(value)).replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")


def _code(text: str) -> str:
    return f"`{text}`" if text else ""


# ---- scenes ----------------------------------------------------------------------------------------------------------


def scene_page() -> str:
    """Every section and key of a scene."""
    parts = [
        "# Keys of a scene",
        "A scene is a TOML file. Keys end in their unit. A dash means that nothing stands in"
        " for a key that is left out. `softjaw check SCENE` prints the values in effect,"
        " `softjaw schema` the same as a JSON schema for editors.",
    ]
    for name, field in Scene.model_fields.items():
        parts.append(f"## `[{name}]`")
        if name == "object":
            parts += list(_object_parts())
        elif name in SECTIONS:
            parts += _section(SECTIONS[name])
        else:
            parts.append(f"{_sentence(field.description or '')}")
        for place, model in NESTED.items():
            parts += [f"### `{place}`", *_section(model)] if name in place else []
    return "\n\n".join(parts) + "\n"


def _object_parts() -> Iterator[str]:
    """Keys of `[object]`: those of every shape, those of walls, and the own ones of each shape."""
    yield "`shape` says which of these keys there are."
    yield "### Every shape"
    yield from _section(Shape)
    walled = [f"`{name}`" for name, model in SHAPES.items() if issubclass(model, Walled)]
    yield f"### Thin walls: {', '.join(walled)}"
    yield from _section(Walled, without=set(Shape.model_fields))
    for name, model in SHAPES.items():
        shared = set((Walled if issubclass(model, Walled) else Shape).model_fields)
        yield f'### `shape = "{name}"`'
        yield from _section(model, without={*shared, "shape"})


def _section(model: type[SceneSection], without: Iterable[str] = ()) -> list[str]:
    """What a section is, and its keys as a table."""
    schema = model.model_json_schema()
    rows = [_key_row(key, part, schema) for key, part in schema["properties"].items() if key not in set(without)]
    return [_plain(inspect.getdoc(model) or ""), table(("key", "takes", "default", "is"), rows)]


def _key_row(key: str, schema: Mapping[str, Any], whole: Mapping[str, Any]) -> tuple[str, ...]:
    unit = split_unit(key)[1]
    takes = _kind(schema) + (f" [{UNITS[unit].text}]" if unit else "")
    if key in whole.get("required", ()):
        default = "required"
    elif schema.get("default") in (None, [], ""):
        default = "-"
    else:
        default = _code(json.dumps(schema["default"]))
    example = next(iter(schema.get("examples", ())), None)
    text = schema.get("description", "") + (f"; as in `{json.dumps(example)}`" if example is not None else "")
    return _code(key), takes, default, text


def _options(schema: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The alternatives of a key that is given; leaving it out is none of them, nor is switching a table on."""
    return [s for s in schema.get("anyOf", ()) if s.get("type") not in ("null", "boolean")]


def _choices(schema: Mapping[str, Any]) -> list[str]:
    parts = (schema, *schema.get("anyOf", ()))
    return [str(value) for s in parts for value in s.get("enum", [s["const"]] if "const" in s else [])]


def _kind(schema: Mapping[str, Any]) -> str:
    """What values a key takes, read off its JSON schema: kind and range, or all choices."""
    kind, options = schema.get("type"), _options(schema)
    if options:
        return " or ".join(map(_kind, options))
    if values := [json.dumps(v) for v in _choices(schema)]:
        return values[0] if len(values) == 1 else f"one of {', '.join(values)}"
    if kind in ("number", "integer"):
        limits = " and ".join(f"{sign} {schema[name]:.10g}" for name, sign in BOUNDS.items() if name in schema)
        return f"{'a whole number' if kind == 'integer' else 'a number'} {limits}".strip()
    if kind == "array":
        low, high = schema.get("minItems", 0), schema.get("maxItems")
        count = f"{low}" if low == high else f"{low} or more" if high is None else f"{low} to {high}"
        item = (schema.get("prefixItems") or [schema.get("items", {})])[0]
        each = f", each {_kind(item)}" if item.get("type") in ("number", "integer", "array") else ""
        return f"a list of {count}{each}"
    return {"string": "text", "boolean": "true or false"}.get(str(kind), "a table")


def scenes_page() -> str:
    """Every scene of `jobs/`, by the comment on its first line."""
    first_lines = {file.name: file.read_text().partition("\n")[0] for file in sorted((ROOT / "jobs").glob("*.toml"))}
    rows = [(_code(f"jobs/{name}"), line.lstrip("# ")) for name, line in first_lines.items()]
    text = "Each is a file to run, to read and to start from."
    return f"# Scenes that come with it\n\n{text}\n\n{table(('scene', 'is'), rows)}\n"


# ---- quantities, flags, effects --------------------------------------------------------------------------------------


def quantities_page() -> str:
    """Every dataset of a result file by its group."""
    models = ", ".join(f"`{key}` {name}" for key, name in MODEL_NAMES.items())
    parts = [
        "# Quantities of a result file",
        "Every number of a case, by the group of the file that holds it. `softjaw.open` gives the same quantities as"
        f" variables of a dataset. All values are in SI units. `model` runs over the friction models: {models}."
        " NaN means that a case has no such value; its state and message say why.",
    ]
    for group, rows in groupby(sorted(TABLE, key=lambda q: _groups().index(q.group)), key=lambda q: q.group):
        where = "`/study/NAME`" if group == "maps" else f"`/study/{group}/NAME`"
        parts += [f"## {group}", f"In {where}.", table(("name", "is", "unit", "dimensions"), map(_quantity_row, rows))]
    return "\n\n".join(parts) + "\n"


def _groups() -> list[str]:
    return list(dict.fromkeys(q.group for q in TABLE))


def _quantity_row(q: Quantity) -> tuple[str, ...]:
    needs = f" Only with: {', '.join(q.needs)}." if q.needs else ""
    if q.meanings:
        needs += " " + "; ".join(f"{code} {text}" for code, text in enumerate(q.meanings)) + "."
    return _code(q.name), f"{_sentence(q.label)} {_sentence(q.definition)}{needs}", q.unit, ", ".join(q.dims)


def flags_page() -> str:
    """Flags, states of a case, exit codes, and effects with their levels."""
    flags = [(int(f), f.word, _sentence(f.sentence) + f" {_sentence(f.more)}" * bool(f.more)) for f in Flag]
    effects = [(_code(name), ", ".join(levels), INDICATORS.get(name, "-")) for name, levels in EFFECTS.items()]
    derived = " and ".join(f"`{f.word}`" for f in Flag if f & DERIVED)
    parts = [
        "# Flags, states, effects, exit codes",
        "## Flags of a case",
        f"`flags` is the sum of these numbers. {derived} are not stored: they follow from the safe force range.",
        table(("number", "word", "means"), flags),
        "## States of a case",
        table(("code", "state"), enumerate(STATES)),
        "## Effects",
        "Levels from the cheapest on; `[effects]` of a scene chooses among them.",
        table(("effect", "levels", "indicator"), effects),
        "Why a level was taken:",
        table(("code", "reason"), enumerate(REASONS)),
        "## Exit codes",
        table(("code", "means"), MEANING.items()),
    ]
    return "\n\n".join(parts) + "\n"


# ---- commands --------------------------------------------------------------------------------------------------------


def commands_page() -> str:
    """The help of every command."""
    parts = ["# Commands", f"```text\n{_help()}```"]
    for title, listed in COMMANDS.items():
        parts.append(f"## {title[0].upper()}{title[1:]}")
        parts += [f"### softjaw {name}\n\n```text\n{_help(name)}```" for name, *_ in listed]
    return "\n\n".join(parts) + "\n"


def _help(*words: str) -> str:
    """What ``--help`` prints, at a width that does not depend on the terminal."""
    before, os.environ["COLUMNS"] = os.environ.get("COLUMNS"), str(WIDTH)
    text = io.StringIO()
    try:
        with contextlib.redirect_stdout(text), contextlib.suppress(SystemExit):
            program().parse_args([*words, "--help"])
    finally:
        del os.environ["COLUMNS"]
        if before is not None:
            os.environ["COLUMNS"] = before
    return text.getvalue()


# ---- Python ----------------------------------------------------------------------------------------------------------


def api_page() -> str:
    """Every public name of ``import softjaw``."""
    parts = [
        "# Python",
        "What `import softjaw` offers. A name is loaded when it is first used; only what solves needs PETSc and MPI.",
    ]
    for name in softjaw.__all__:
        parts += [f"## `softjaw.{name}`", *_documented(getattr(softjaw, name), name)]
    return "\n\n".join(parts) + "\n"


def _documented(what: Any, name: str) -> Iterator[str]:
    """Signature, docstring, and of a class its public members."""
    yield from _signature(what, name)
    yield _docstring(what)
    if not inspect.isclass(what):
        return
    fields = what.model_fields if issubclass(what, BaseModel) else {}
    for member, value in vars(what).items():
        inner = value.__func__ if isinstance(value, classmethod | staticmethod) else value
        if member.startswith("_") or member in fields or not (inspect.isfunction(inner) or isinstance(inner, property)):
            continue
        yield f"### `{name}.{member}`"
        yield from _signature(inner, member)
        yield _docstring(inner)


def _signature(what: Any, name: str) -> Iterator[str]:
    """How it is called; not of a scene, whose arguments are the sections of `scene_page`."""
    if isinstance(what, property) or (inspect.isclass(what) and issubclass(what, BaseModel)):
        return
    with contextlib.suppress(ValueError, TypeError):
        # annotations are strings here, and would stand in quotes
        text = re.sub(r"(: |-> )'([^']*)'", r"\1\2", str(inspect.signature(what)))
        yield f"```python\n{name}{text}\n```"


def _docstring(what: Any) -> str:
    """A docstring in numpy's form as markdown: sections, their entries, and examples."""
    text, parts = inspect.getdoc(what) or "", []
    pieces = re.split(r"^(\w[\w ]*)\n-{3,}\n", text, flags=re.M)
    parts.append(_plain(pieces[0]))
    for title, body in zip(pieces[1::2], pieces[2::2], strict=True):
        parts.append(f"**{title}**")
        parts.append(_plain(body) if title in ("Notes", "Examples", "References", "Warnings") else _entries(body))
    return "\n\n".join(part for part in parts if part)


def _entries(body: str) -> str:
    """``name : type`` with indented text below, as a list."""
    entries = re.findall(r"^(\S.*)\n?((?:^(?:[ \t]+.*|)\n?)*)", body, flags=re.M)
    return "\n".join(f"* `{head.strip()}`: {' '.join(text.split())}" for head, text in entries)


def _plain(text: str) -> str:
    """Text of a docstring, examples fenced, with code in single backticks."""
    text = re.sub(r"``(.+?)``", r"`\1`", text.strip())
    example = re.compile(r"^>>> .*\n?(?:^(?!\s*$).*\n?)*", re.M)
    return example.sub(lambda found: f"\n```python\n{found[0].rstrip()}\n```\n", text)


def _sentence(text: str) -> str:
    """With a capital, unless it begins with a symbol, and a full stop.

    >>> _sentence("largest pressure"), _sentence("e_n of the pad."), _sentence("")
    ('Largest pressure.', 'e_n of the pad.', '')
    """
    first = text.split(" ")[0]
    if first == "a" or (first.isalpha() and first.islower() and len(first) > 1):
        text = text[0].upper() + text[1:]
    return text if not text or text.endswith(".") else f"{text}."


def _of_root(name: str) -> Callable[[], str]:
    """A page that lies beside the README, where people look for it; its links to docs stay right."""
    return lambda: (ROOT / name).read_text().replace("](docs/", "](")


# ---- the site --------------------------------------------------------------------------------------------------------


PAGES: dict[str, Callable[[], str]] = {
    "reference/scene.md": scene_page,
    "reference/scenes.md": scenes_page,
    "reference/quantities.md": quantities_page,
    "reference/flags.md": flags_page,
    "reference/commands.md": commands_page,
    "reference/api.md": api_page,
    "contributing.md": _of_root("CONTRIBUTING.md"),
    "changelog.md": _of_root("CHANGELOG.md"),
}


def on_config(config: Any) -> Any:
    """Hook of mkdocs: a page that the navigation does not name is a how-to."""
    parts = next(entry for entry in config.nav if "How-to" in entry)["How-to"]
    named = re.findall(r"[\w/-]+\.md", json.dumps(config.nav))
    parts += sorted({file.name for file in Path(config.docs_dir).glob("*.md")} - set(named))
    return config


def on_files(files: Any, config: Any) -> Any:
    """Hook of mkdocs: put the generated pages beside those of the folder."""
    from mkdocs.structure.files import File

    for path, page in PAGES.items():
        files.append(File.generated(config, path, content=page()))
    return files
