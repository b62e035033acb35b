"""Background of a report: what was simulated, what the numbers mean, and where they come from."""

from __future__ import annotations

import re

import numpy as np

from softjaw.study.quantities import EFFECTS, REASONS
from softjaw.study.result.layout import DONE
from softjaw.study.run.progress import duration
from softjaw.study.show.data import Data, number
from softjaw.study.show.report.page import bullets, paragraph, table, text_block
from softjaw.study.show.tables.status import PARTS


def effects(data: Data) -> str:
    """Level, indicator and reason of every effect over the solved cases."""
    rows = []
    for name, levels in EFFECTS.items():
        parts = {part: data.values(f"effects/{name}_{part}") for part in ("level", "indicator", "reason")}
        if parts["level"] is None:
            continue
        chosen = _texts(parts["level"], levels)
        indicator = parts["indicator"]
        low, high = (np.nanmin(indicator), np.nanmax(indicator)) if indicator is not None else (np.nan, np.nan)
        area = number(low) if number(low) == number(high) else f"{number(low)} to {number(high)}"
        if chosen:
            rows.append([name.replace("_", " "), chosen, area, _texts(parts["reason"], REASONS)])
    if not rows:
        return paragraph("No effects are stored.", "note")
    return table("Effects that were simulated", ["effect", "level", "indicator", "reason"], rows, texts=(0, 1, 3))


def _texts(codes: np.ndarray | None, meaning: tuple[str, ...]) -> str:
    if codes is None:
        return ""
    known = codes[np.isfinite(codes)].astype(int)
    counts = {c: int(np.sum(known == c)) for c in sorted(set(known.tolist()) & set(range(len(meaning))))}
    if len(counts) == 1:
        return meaning[next(iter(counts))]
    return "; ".join(f"{meaning[c]} ({n} of {known.size} cases)" for c, n in counts.items())


def definitions(data: Data) -> str:
    """The file's own definitions: its introduction, and one row for each quantity."""
    intro, rows = [], []
    for line in data.result.definitions.splitlines():
        found = re.match(r"(\S+/\S+) \[([^\]]*)\](?: \[[^\]]*\])?: ([^.]*)\. ?(.*)$", line)
        if found:
            path, units, name, text = found.groups()
            rows.append([path, units, f"{name}. {text}"])
        else:
            intro.append(line.strip())
    head = ["dataset", "unit (SI)", "meaning"]
    return paragraph(" ".join(intro)) + (table("What the numbers mean", head, rows, (0, 1), (2,)) if rows else "")


def scene_text(data: Data) -> str:
    """The effective scene and where it came from."""
    about = data.result.scene_attributes
    keys = [key for key in ("file", "overrides", "petsc_options") if about.get(key)]
    items = [f"{key.replace('_', ' ')}: {about[key]}" for key in keys]
    return bullets([*items, f"digest: {data.result.digest}"]) + text_block(data.result.scene)


def provenance(data: Data) -> str:
    """Sessions, programs and machines."""
    sessions = data.result.sessions
    if not sessions:
        return paragraph("No session is recorded.", "note")
    rows = [
        [str(i), s["start"], s["stop"] or "–", s["reason"] if s["stop"] else "running, or ended without a word",
         str(s["ranks"]), str(s["done"]), str(s["failed"])]
        for i, s in enumerate(sessions, start=1)
    ]  # fmt: skip
    head = ["session", "start", "stop", "how it ended", "ranks", "solved", "failed"]
    html = table("Sessions", head, rows, texts=(1, 2, 3))
    kinds: dict[tuple[str, ...], list[str]] = {}
    for i, s in enumerate(sessions, start=1):
        key = tuple(s[k] for k in ("program", "git", "versions", "host", "cpu", "command", "petsc_options"))
        kinds.setdefault(key, []).append(str(i))
    names = ("program", "sources", "versions", "host", "processor", "command", "PETSc options")
    for key, which in kinds.items():
        rows = [[name, value] for name, value in zip(names, key, strict=True) if value]
        caption = f"Program and machine of session {', '.join(which)}"
        html += table(caption, ["what", "value"], rows, texts=(0,), wide=(1,))
    return html


def time_split(data: Data) -> str:
    """Where the time of all cases went."""
    total = data.values("work/seconds_total")
    if total is None:
        return ""
    whole = float(np.nansum(total))
    found = {part: data.values(f"work/seconds_{part}") for part in PARTS}
    sums = {part: float(np.nansum(seconds)) for part, seconds in found.items() if seconds is not None}
    rows = [[part, duration(seconds), f"{seconds / whole:.0%}" if whole else "–"] for part, seconds in sums.items()]
    rows.append(["all", duration(whole), "100%"])
    longest = np.unravel_index(np.nanargmax(total), total.shape)
    note = f"Longest case: {number(total[longest])} s ({data.place(longest, force=True)})."
    caption = f"Time of {data.count(DONE)} solved cases, summed over all ranks"
    return table(caption, ["part", "time", "share"], rows, texts=(0,)) + paragraph(note, "note")
