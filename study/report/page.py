"""A page of HTML from parts: everything from a file is escaped, pictures are embedded, nothing is loaded or run."""

from __future__ import annotations

import base64
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape

CSS = """
:root { color-scheme: light; --ink: #1d2429; --soft: #566069; --line: #d3d8dc; --tint: #f3f6f8; --mark: #12436d }
* { box-sizing: border-box }
html { -webkit-text-size-adjust: 100% }
body { margin: 0 auto; max-width: 62rem; padding: 1rem 1.25rem 4rem; background: #fff; color: var(--ink);
  font: 1rem/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "DejaVu Sans", sans-serif }
h1 { font-size: 1.7rem; line-height: 1.2; margin: .5rem 0 .25rem }
h2 { font-size: 1.25rem; margin: 2.75rem 0 .5rem; padding-top: .6rem; border-top: 2px solid var(--mark) }
h3 { font-size: 1.02rem; margin: 1.5rem 0 .25rem }
p, ul { max-width: 46rem } p { margin: .5rem 0 }
.sub, figcaption, caption, .note { color: var(--soft); font-size: .9rem }
.sub { margin: 0; overflow-wrap: anywhere }
.verdict { font-size: 1.12rem; background: var(--tint); border-left: 4px solid var(--mark);
  padding: .8rem 1rem; margin: 1rem 0; max-width: none }
.verdict p { max-width: none; margin: .3rem 0 }
.warn { border: 1px solid #b3541e; border-left-width: 4px; background: #fff6ef; padding: .55rem .9rem; margin: 1rem 0 }
nav { margin: .75rem 0; font-size: .9rem } nav a { margin-right: 1rem; white-space: nowrap }
a { color: var(--mark) }
figure { margin: 1.25rem 0 } figure img { display: block; width: 100%; height: auto }
figure.narrow img { max-width: 30rem }
figcaption { margin-top: .35rem; max-width: 46rem }
.scroll { overflow-x: auto; margin: .9rem 0 }
table { border-collapse: collapse; font-size: .92rem; font-variant-numeric: tabular-nums }
caption { text-align: left; padding-bottom: .35rem }
th, td { padding: .28rem .75rem .28rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line) }
thead th { border-bottom: 1.5px solid var(--soft); vertical-align: bottom; line-height: 1.3 }
.n { text-align: right } tbody th { font-weight: 600 } tr.first td, tr.first th { background: var(--tint) }
th.text[scope=row] { min-width: 10.5rem } td.wide { min-width: 11rem; overflow-wrap: anywhere }
pre { background: var(--tint); padding: .8rem 1rem; overflow-x: auto; font-size: .82rem; line-height: 1.45;
  white-space: pre-wrap; overflow-wrap: anywhere }
@media (max-width: 40rem) { body { padding: .5rem .75rem 2rem } h1 { font-size: 1.4rem }
  .verdict { font-size: 1.02rem } .scroll.wide img { width: 46rem; max-width: none } table { font-size: .86rem } }
@media print { body { max-width: none; padding: 0; font-size: 10pt } nav { display: none }
  figure, tr, .verdict { break-inside: avoid } h2, h3, caption, thead { break-after: avoid }
  table { font-size: 8.5pt } td.wide { min-width: 7rem } tbody tr:first-child { break-before: avoid }
  a { color: inherit } .scroll { overflow: visible } pre { white-space: pre-wrap } }
"""
POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"


@dataclass(frozen=True)
class Picture:
    """An SVG with what it shows (``alt``, for those who cannot see it) and how to read it (``caption``)."""

    svg: bytes
    alt: str
    caption: str
    narrow: bool = False


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
) -> str:
    """A table of plain texts with row headers; columns but ``texts`` and ``wide`` ones hold numbers.

    ``first`` marks the first row.
    """
    kind = ["wide" if j in wide else "text" if j in texts else "n" for j in range(len(head))]
    top = "".join(f'<th scope="col" class="{k}">{escape(h)}</th>' for h, k in zip(head, kind, strict=True))
    body = []
    for i, row in enumerate(rows):
        cells = [f'<td class="{k}">{escape(cell)}</td>' for cell, k in zip(row[1:], kind[1:], strict=True)]
        mark = ' class="first"' if first and not i else ""
        body.append(f'<tr{mark}><th scope="row" class="{kind[0]}">{escape(row[0])}</th>{"".join(cells)}</tr>')
    return (
        f'<div class="scroll" role="region" aria-label="{escape(caption)}" tabindex="0"><table>'
        f"<caption>{escape(caption)}</caption><thead><tr>{top}</tr></thead><tbody>{''.join(body)}</tbody></table></div>"
    )


def picture(shown: Picture) -> str:
    """A figure with its picture inside."""
    data = base64.b64encode(shown.svg).decode()
    kind = ' class="narrow"' if shown.narrow else ""
    image = f'<img src="data:image/svg+xml;base64,{data}" alt="{escape(shown.alt)}">'
    frame = image if shown.narrow else f'<div class="scroll wide">{image}</div>'
    return f"<figure{kind}>{frame}<figcaption>{escape(shown.caption)}</figcaption></figure>"


def text_block(text: str) -> str:
    """A text as it stands in a file."""
    return f"<pre>{escape(text)}</pre>"


def page(title: str, subtitle: str, sections: Sequence[tuple[str, str, str]]) -> str:
    """The whole page from sections ``(anchor, heading, html)``; the first has no heading of its own."""
    links = " ".join(f'<a href="#{anchor}">{escape(heading)}</a>' for anchor, heading, _ in sections if heading)
    nav = f'<nav aria-label="contents">{links}</nav>'
    body = []
    for i, (anchor, heading, html) in enumerate(sections):
        head = f"<h2>{escape(heading)}</h2>" if heading else ""
        body.append(f'<section id="{anchor}">{head}{html}</section>' + (nav if i == 0 else ""))
    return (
        f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<style>{CSS}</style></head>\n<body><header><h1>{escape(title)}</h1>{paragraph(subtitle, 'sub')}</header>\n"
        f"<main>{''.join(body)}</main></body></html>\n"
    )
