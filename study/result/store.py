"""Result files: opened without being trusted, every dataset checked before it is read. Needs neither MPI nor PETSc.

Crash safety: one process writes the whole skeleton, closes it, and renames it into place; after that all ranks do
nothing but independent writes to allocated space, in the order values, checksum, state. A killed process can
therefore lose the row it was writing, and nothing else: a row that is marked done but does not match its checksum is
solved again.
"""

import math
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study.messages import OTHER_FILE, StudyError, printable
from softjaw.study.quantities import MISSING, STATES
from softjaw.study.result import checksums
from softjaw.study.result.hdf5 import opened, text_of
from softjaw.study.result.layout import (
    MOST_SESSIONS,
    PROGRAM,
    ROOT,
    SESSION,
    VERSION,
    Header,
    Layout,
    header_of,
    layout_of,
)
from softjaw.study.result.lock import holder
from softjaw.study.scene.text import differences, parse_toml
from softjaw.study.units import shown_text


class Result:
    """A result file, opened by ``study.result.store.open_result``; every dataset is checked before it is read.

    ``axes`` lists the axes of all maps: sweeps first, then station, angle and normal force; ``layout`` is the
    layout that follows from them. Rows are flat indices over the axes. What does not match its checksum is refused,
    unless the result is read ``unchecked``.
    """

    def __init__(self, path: Path, file: Any, unchecked: bool = False) -> None:
        self.path, self.file = path, file
        root = file.attributes()
        # Asked first: a file of another program is reported as such, not as damaged.
        if root.get("program") != PROGRAM:
            raise ValueError("it does not name its program")
        # Before the layout: an older one need not have what is read below.
        if (version := root.get("layout_version", "")) != str(VERSION):
            raise StudyError(OTHER_FILE, f"{path}: layout {version or 'none'}, expected {VERSION}; run the scene again")
        self.layout = layout_of(self._string("layout"))
        self.header = header_of(self._string("header"), self.scene)
        self.axes, self.title, self.digest = self.layout.axes, printable(self.header.title), self.header.digest
        self._known = {d.path: d for d in self.layout.datasets}
        self._unchecked = unchecked
        if not unchecked:
            # With a wrong header, the sums of the rows would be looked for in the wrong places.
            if str(checksums.of_header(file, self.layout)) != file.attributes(ROOT).get("checksum"):
                what = "axes, layout, scene or definitions do not match their checksum"
                raise file.damaged(what, "restore it from a copy, or move it away and run the scene again")
            parse_toml(self.scene, str(path))  # its error names the file; later ones could not

    def refuse_other(self, header: Header) -> None:
        """Raise `StudyError` unless the file was made from the scene of a header."""
        if self.digest != header.digest:
            text = (
                f"{self.path}: made from another scene ({self.digest[:8]}, this one is {header.digest[:8]}:"
                f" {differences(self.scene, header.scene)}); choose another file with -o"
            )
            raise StudyError(OTHER_FILE, text)

    def read(self, path: str) -> np.ndarray:
        """A dataset by its path below ``/study`` (``e_n/pcm``), or the key of its quantity (``checks/adhesion``)."""
        full = self.layout.paths.get(path, f"{ROOT}/{path}")
        path = full.removeprefix(f"{ROOT}/")
        if self._unchecked or full not in self.layout.summed[:-1]:
            return self._values(path)
        # States before values: a row that is marked has all its values.
        rows = np.flatnonzero(self.status != MISSING)
        for patience in (0.0, 0.02, 0.2):  # a run may store a row anew between a look at its values and at its sums
            if patience:  # a sleep of nothing gives the core away, too
                time.sleep(patience)
            values = self._values(path, anew=patience > 0.0)
            broken = self._still(checksums.broken_rows(self.file, self.layout, full, values, rows), self.status)
            if not broken.size:
                break
        self._refuse(broken, path)
        return values

    def patch(self, row: int) -> dict[str, np.ndarray]:
        """Faces of both fingers at one case: ``pressure (2, faces)``, ``centroid (2, faces, 3)``, ..."""
        names = [c.path.rpartition("/")[2] for c in self.layout.columns if c.key.startswith("patch/")]
        index = tuple(map(int, np.unravel_index(row, self.layout.shape)))
        faces = {name: self._values(f"patch/{name}", index) for name in names}
        if not self._unchecked and self.status.flat[row] != MISSING:
            sums = self._values("checksums/rows", index)
            for name, values in faces.items():
                if checksums.of_array(values) != sums[self.layout.summed.index(f"{ROOT}/patch/{name}")]:
                    self._refuse(np.array([row]), f"patch/{name}")
        return faces

    def derived(self, name: str) -> np.ndarray:
        """A dataset that was filled after all rows."""
        return self._closing(f"derived/{name}")

    @cached_property
    def status(self) -> np.ndarray:
        """State of every case when it was read first, as `study.quantities.STATES` numbers them."""
        codes = self.codes
        if codes.max() >= len(STATES):
            raise self._damaged(f"a case has the state {codes.max()}, which does not exist")
        if not self._unchecked:
            under_way = self.killed or bool(holder(self.path))
            wrong = checksums.broken_states(self.file, self.layout, codes.ravel(), under_way)
            self._refuse(self._still(wrong, codes), "the state")
        return codes

    @property
    def codes(self) -> np.ndarray:
        """State of every case as the file has it now, whether it is right or wrong."""
        return self._values("status/code", anew=True)

    @property
    def messages(self) -> np.ndarray:
        """Message of every case that is not missing, as text."""
        return np.where(self.status == MISSING, "", _texts(self.read("status/message")))

    @property
    def scene(self) -> str:
        """The effective scene as TOML text."""
        return self._string("scene")

    @property
    def definitions(self) -> str:
        """What every quantity means."""
        return self._string("definitions")

    @property
    def report(self) -> str:
        """Best grasps, failures and how to read the file, as plain text; says so where the study is not finished."""
        return text_of(self._closing("report").item().strip(b"\0 "))

    @property
    def labels(self) -> np.ndarray:
        """Names of the candidates, ``(stations, angles)``; empty for those beyond the last one that has a name."""
        labels, shape = [printable(label) for label in self.header.labels], self.layout.shape[-3:-1]
        return np.array([*labels, *[""] * (math.prod(shape) - len(labels))]).reshape(shape)

    @property
    def sessions(self) -> list[dict[str, Any]]:
        """One entry for each time the study was started: start, stop, reason, ranks, versions, ..."""
        rows = self.file.values(f"{ROOT}/provenance/sessions", (MOST_SESSIONS,), SESSION)
        # A session that lost its start still has its sum: it counts as damage, not as none.
        used = [row for row in rows if row["crc"] or row["start"]]
        if not self._unchecked and any(row["crc"] != checksums.of_session(row) for row in used):
            raise self._damaged("a session does not match its checksum")
        fields = [(name, *kind) for name, kind in (SESSION.fields or {}).items() if name != "crc"]
        return [
            {name: text_of(row[name]) if kind.kind == "S" else int(row[name]) for name, kind, *_ in fields}
            for row in rows
            if row["start"]
        ]

    @property
    def killed(self) -> bool:
        """Whether the last session has no end: it is running, or was killed."""
        sessions = self.sessions
        return bool(sessions and not sessions[-1]["stop"])

    def _still(self, wrong: np.ndarray, codes: np.ndarray) -> np.ndarray:
        """Those of some rows that a run has not begun anew since their states were read; of the others, now missing."""
        begun = wrong[self.codes.flat[wrong] != codes.flat[wrong]] if wrong.size else wrong
        # In place, so that whoever holds the states sees that these rows have no values any more.
        codes.flat[begun] = MISSING
        return np.setdiff1d(wrong, begun)

    def _refuse(self, rows: np.ndarray, what: str) -> None:
        if rows.size:
            some = f"{', '.join(map(str, rows[:5]))}{', ...' if rows.size > 5 else ''}"
            cases = f"case {some}" if rows.size == 1 else f"{rows.size} cases ({some})"
            raise self._damaged(f"{what} of {cases} does not match its checksum")

    def _closing(self, name: str) -> np.ndarray:
        """What is filled after all rows, by its name in ``layout.closing``."""
        for patience in (0.02, 0.2, 0.0):  # a run may be writing it just now
            values = self._values(name, anew=True) if f"{ROOT}/{name}" in self._known else self._text(name)
            stored = self._values("checksums/closing", anew=True)[self.layout.closing.index(name)]
            if self._unchecked or checksums.of_array(values) == stored:
                return values
            time.sleep(patience)
        raise self._damaged(f"{name} does not match its checksum")

    def _damaged(self, what: str) -> StudyError:
        cure = "restore it from a copy, or run the scene again, which solves damaged cases anew"
        return self.file.damaged(what, cure)

    def _values(self, path: str, index: Any = (), *, anew: bool = False) -> np.ndarray:
        expected = self._known.get(f"{ROOT}/{path}")
        if expected is None:
            raise KeyError(f"{path} is not a dataset of this file; it has {', '.join(sorted(self._known))}")
        return np.asarray(self.file.values(expected.path, expected.shape, expected.dtype, index, anew=anew))

    def _text(self, name: str) -> np.ndarray:
        text = np.asarray(self.file.values(f"{ROOT}/{name}", anew=True))
        if text.shape != () or text.dtype.kind != "S":
            raise self._damaged(f"{ROOT}/{name} is not a text")
        return text

    def _string(self, name: str) -> str:
        return text_of(self._text(name).item().strip(b"\0 "))


def _texts(strings: np.ndarray) -> np.ndarray:
    """Texts of an array of fixed-length strings."""
    return np.array([text_of(text) for text in strings.ravel().tolist()], dtype=str).reshape(strings.shape)


def place_text(axes: Sequence[Any], labels: Any, index: Sequence[int]) -> str:
    """A case in words: ``station 12 mm, angle 90 deg, 5 N``; an explicit pose by its label.

    Axes that have only one value are left out, and the force where ``index`` is that of a candidate.
    """
    words = []
    for axis, i in zip(axes, index, strict=False):
        if axis is axes[-1]:
            words.append(value_text(axis, i))
        elif axis.name in ("station", "angle") and not axes[-3].units:
            words += [str(labels[tuple(index[-3:-1])])] * (axis.name == "station")
        elif axis.name == "station" or len(axis.values) > 1:
            words.append(f"{axis.name.replace('_', ' ')} {value_text(axis, i)}")
    return ", ".join(words)


def value_text(axis: Any, i: int) -> str:
    """A value of an axis with its unit, or the text that it represents."""
    return str(axis.options[i]) if axis.options else shown_text(axis.values[i], axis.units)


@contextmanager
def open_result(path: str | Path, unchecked: bool = False) -> Iterator[Result]:
    """A result file for reading, also while written; ``unchecked`` skips checksums. `StudyError` if it is none."""
    path = Path(path)
    # whatever numbers it holds, no warning of numpy is worth printing
    with opened(path, "result file", lambda file: Result(path, file, unchecked)) as result, np.errstate(all="ignore"):
        yield result


def torn_rows(path: Path, layout: Layout) -> list[int]:
    """Rows that are marked done or failed but do not match their checksums."""
    # Unchecked, because a checking reader refuses the file at its first torn row.
    with open_result(path, unchecked=True) as result:
        codes = result.codes.ravel()
        marked = np.flatnonzero(codes != MISSING)
        columns = ((c.path, result.read(c.path.removeprefix(f"{ROOT}/"))) for c in layout.columns)
        torn = [checksums.broken_rows(result.file, layout, path, values, marked) for path, values in columns]
        # The caller holds the lock, so no run is under way.
        states = checksums.broken_states(result.file, layout, codes, under_way=False)
    # What is not marked is solved anyway.
    return sorted({*np.concatenate(torn).tolist(), *(set(states.tolist()) & set(marked.tolist()))})
