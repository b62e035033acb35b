"""A page of HTML from parts: everything from a file is escaped, pictures are embedded, nothing is loaded.

The one script of a page only tells again what stands in its tables, at the cell of a map that a reader points at.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files

from softjaw.study.show.report.spots import Spot

MOST_CHOICES = 8  # as many as the style knows
STYLE, SCRIPT = "page.css", "hover.js"


@dataclass(frozen=True)
class Picture:
    """A picture with what it shows (``alt``, for those who cannot see it) and how to read it (``caption``).

    ``spots`` are the maps in it whose cells can be pointed at; ``kind`` is the picture's media type below ``image``.
    """

    content: bytes
    alt: str
    caption: str
    narrow: bool = False
    spots: tuple[Spot, ...] = ()
    kind: str = "svg+xml"


def paragraph(text: str, kind: str = "") -> str:
    """One paragraph of plain text."""
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def heading(text: str) -> str:
    """Heading of a part of a section."""
    return f"<h3>{escape(text)}</h3>"


def box(paragraphs: Iterable[str], kind: str) -> str:
    """Paragraphs that stand out, as ``verdict`` or ``warn``."""
    return f'<div class="{kind}">{"".join(paragraph(text) for text in paragraphs)}</div>'


def bullets(items: Iterable[str]) -> str:
    """A list of plain texts."""
    return f"<ul>{''.join(f'<li>{escape(text)}</li>' for text in items)}</ul>"


def table(
    caption: str,
    head: Sequence[str],
    rows: Sequence[Sequence[str]],
    texts: Sequence[int] = (),
    wide: Sequence[int] = (),
    first: bool = False,
    ids: tuple[str, Sequence[str]] = ("", ()),
    best: str = "",
) -> str:
    """A table of plain texts with row headers; columns but ``texts`` and ``wide`` ones hold numbers.

    ``first`` marks the first row; ``ids`` are names of the table and of its rows for the script,
    ``best`` is the row that it starts at.
    """
    kind = ["wide" if j in wide else "text" if j in texts else "n" for j in range(len(head))]
    top = "".join(f'<th scope="col" class="{k}">{escape(h)}</th>' for h, k in zip(head, kind, strict=True))
    body = []
    for i, row in enumerate(rows):
        cells = [f'<td class="{k}">{escape(cell)}</td>' for cell, k in zip(row[1:], kind[1:], strict=True)]
        mark = f' id="{escape(ids[1][i])}"' if ids[0] else ' class="first"' if first and not i else ""
        body.append(f'<tr{mark}><th scope="row" class="{kind[0]}">{escape(row[0])}</th>{"".join(cells)}</tr>')
    name = f' id="{escape(ids[0])}" data-best="{escape(best)}"' if ids[0] else ""
    return (
        f'<div class="scroll" role="region" aria-label="{escape(caption)}" tabindex="0">'
        f"<table{name}><caption>{escape(caption)}</caption><thead><tr>{top}</tr></thead><tbody>{''.join(body)}</tbody></table></div>"
    )


def picture(shown: Picture) -> str:
    """A figure with its picture inside."""
    data = base64.b64encode(shown.content).decode()
    kind = ' class="narrow"' if shown.narrow else ""
    image = f'<img src="data:image/{shown.kind};base64,{data}" alt="{escape(shown.alt)}">'
    plain = json.dumps([s.plain() for s in shown.spots], separators=(",", ":"), allow_nan=False)
    told = f' data-spots="{escape(plain)}"' if shown.spots else ""
    frame = f'<div class="frame"{told}>{image}</div>'
    frame = frame if shown.narrow else f'<div class="scroll wide">{frame}</div>'
    return f"<figure{kind}>{frame}<figcaption>{escape(shown.caption)}</figcaption></figure>"


def choice(title: str, labels: Sequence[str], figures: Sequence[str], first: int) -> str:
    """One of at most `MOST_CHOICES` figures on the screen, all of them in print; needs no script."""
    buttons = []
    for k, label in enumerate(labels):
        name, mark = f"{title.lower().replace(' ', '-')}-{k}", " checked" * (k == first)
        group = name.rpartition("-")[0]
        buttons.append(f'<input type="radio" name="{escape(group)}" id="{escape(name)}"{mark}>')
        buttons.append(f'<label for="{escape(name)}">{escape(label)}</label>')
    return f'<fieldset class="choice"><legend>{escape(title)}</legend>{"".join(buttons)}{"".join(figures)}</fieldset>'


def details(summary: str, html: str) -> str:
    """Parts of a page that are folded away until a reader asks for them."""
    return f"<details><summary>{escape(summary)}</summary>{html}</details>"


def text_block(text: str) -> str:
    """A text as it stands in a file."""
    return f"<pre>{escape(text)}</pre>"


def page(title: str, subtitle: str, sections: Sequence[tuple[str, str, str]]) -> str:
    """The whole page from sections ``(anchor, heading, html)``; the first has no heading of its own."""
    links = " ".join(f'<a href="#{anchor}">{escape(heading)}</a>' for anchor, heading, _ in sections if heading)
    nav = f'<nav aria-label="contents">{links}</nav>'
    body = []
    for i, (anchor, heading, html) in enumerate(sections):
        head = f'<h2 id="{anchor}-title">{escape(heading)}</h2>' if heading else ""
        name = f'aria-labelledby="{anchor}-title"' if heading else 'aria-label="verdict"'
        body.append(f'<section id="{anchor}" {name}>{head}{html}</section>' + (nav if i == 0 else ""))
    folder = files("softjaw.study.show.report")
    style, script = (folder.joinpath(name).read_text(encoding="utf-8") for name in (STYLE, SCRIPT))
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{policy(script)}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f'<style>{style}</style></head>\n<body><a class="skip" href="#{sections[0][0]}">to the verdict</a>\n'
        f"<header><h1>{escape(title)}</h1>{paragraph(subtitle, 'sub')}</header>\n"
        f"<main>{''.join(body)}</main><script>{script}</script></body></html>\n"
    )


def policy(script: str) -> str:
    """What the page may do: show what it holds and run this one script."""
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    return f"default-src 'none'; img-src data:; style-src 'unsafe-inline'; script-src 'sha256-{digest}'"
