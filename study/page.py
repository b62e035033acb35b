"""A self-contained page from blocks of plain text, tables and plotly figures: for reports, views and cost studies.

Whoever builds a page hands over plain data; the template alone makes HTML of it, and escapes it. Text that plotly draws
itself goes through `label`, because plotly reads a few tags in it.
"""

import base64
import hashlib
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from typing import Any

import jinja2
from plotly.offline import get_plotlyjs

from softjaw.study.table import Table, with_unit
from softjaw.study.units import shown_unit

Block = dict[str, Any]
Section = tuple[str, str, Sequence[Block | None]]
FOLDER = "softjaw.study.templates"


def text(words: str, look: str = "") -> Block:
    """One paragraph; ``look`` is a class of the style, as ``note``."""
    return {"kind": "text", "text": words, "look": look}


def box(texts: Iterable[str], look: str) -> Block:
    """Paragraphs that stand out, as ``verdict`` or ``warn``."""
    return {"kind": "box", "texts": list(texts), "look": look}


def bullets(texts: Iterable[str]) -> Block:
    """A list."""
    return {"kind": "bullets", "texts": list(texts)}


def table(
    caption: str,
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    texts: Sequence[int] = (),
    wide: Sequence[int] = (),
    first: bool = False,
) -> Block:
    """A table with row headers; columns but ``texts`` and ``wide`` ones hold numbers. ``first`` marks the first row."""
    looks = ["wide" if j in wide else "text" if j in texts else "n" for j in range(len(head))]
    return {"kind": "table", "caption": caption, "head": head, "rows": rows, "looks": looks, "first": first}


def block_of(shown: Table, first: bool = False) -> Block:
    """The displayed columns of a table, as a block; what is wrapped in a text is text here."""
    columns = [c for c in shown.columns if c.display]
    heads = [with_unit(c.label or c.name, shown_unit(c.unit)) for c in columns]
    # A number stays in one line with its error.
    cells = ([(c, shown.cell(row, c)) for c in columns] for row in shown.rows)
    rows = [[text if c.wrap else text.replace(" ", "\N{NO-BREAK SPACE}") for c, text in row] for row in cells]
    texts = [i for i, c in enumerate(columns) if c.wrap]
    return table(shown.title, heads, rows, texts[:-1], texts[-1:], first)


def objects(caption: str, columns: Sequence[tuple[str, str]], rows: Sequence[Block]) -> Block:
    """A table with pictures that a reader sorts by its ``columns``, each a name and ``n`` (numbers) or ``text``.

    A row has ``cells``, each a text and what it is sorted by; ``anchor`` of the section that it leads to, ``image``
    (PNG) with ``alt``, or empty texts.
    """
    made = [row | {"image": base64.b64encode(row["image"]).decode()} for row in rows]
    return {"kind": "objects", "caption": caption, "head": columns, "rows": made}


def plot(figure: Any, caption: str, alt: str, height: int = 360) -> Block:
    """A plotly figure: what it shows (``alt``, for those who cannot see it) and how to read it (``caption``)."""
    return {"kind": "plot", "figure": figure, "caption": caption, "alt": alt, "height": height}


def label(words: str) -> str:
    """Text of a file as plotly has to get it, so that it shows the text and reads no tags in it.

    >>> label("<b>left</b>")
    '&lt;b&gt;left&lt;/b&gt;'
    """
    return escape(words, quote=False)


def page(title: str, subtitle: str, sections: Sequence[Section]) -> str:
    """The page of sections ``(anchor, heading, blocks)``, the first without a heading; without blocks that are None."""
    made = jinja2.Environment(loader=jinja2.PackageLoader(*FOLDER.rsplit(".", 1)), autoescape=True)
    made.policies["json.dumps_function"] = lambda figure, **_: figure.to_json(validate=False)
    parts = ((anchor, head, [block for block in blocks if block]) for anchor, head, blocks in sections)
    shown = [part for part in parts if part[2]]
    texts = [files(FOLDER).joinpath(name).read_text(encoding="utf-8") for name in ("page.css", "page.js", "objects.js")]
    kinds = {block["kind"] for _, _, blocks in shown for block in blocks}
    scripts = [get_plotlyjs().replace("</script", "<\\/script"), texts[1]] if "plot" in kinds else []
    scripts += [texts[2]] if "objects" in kinds else []
    return made.get_template("page.html").render(
        title=title, subtitle=subtitle, sections=shown, style=texts[0], scripts=scripts, policy=policy(scripts)
    )


def policy(scripts: Sequence[str]) -> str:
    """What the page may do: show what it holds and run these scripts."""
    digests = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in scripts]
    allowed = " ".join(f"'sha256-{digest}'" for digest in digests) or "'none'"
    return f"default-src 'none'; img-src data: blob:; style-src 'unsafe-inline'; script-src {allowed}"
