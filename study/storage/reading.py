"""Read access to a result file: maps, fingers, checks, patches, texts. Needs neither MPI nor PETSc."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from study.exits import OTHER_FILE, StudyError
from study.storage.guarded import text_of
from study.storage.layout import FAILED, LABEL, PROGRAM, READABLE, ROOT, SESSION, SESSIONS, layout_from_options

BEYOND = 1e100  # no value of a study in SI units comes near it, and its square can be computed


class StoredAxis(NamedTuple):
    """One axis of the maps, as read from a file."""

    name: str
    values: np.ndarray
    units: str
    long_name: str


class Result:
    """A result file, opened by ``study.storage.store.open_result``; every dataset is checked before it is read.

    ``axes`` lists the axes of all maps: sweeps first, then station, angle and normal force; ``layout`` is the
    layout that follows from them. Rows are flat indices over the axes.
    """

    def __init__(self, path: Path, file: Any) -> None:
        self.path, self.file = path, file
        root, study = file.attributes(), file.attributes(ROOT)
        if root.get("program") != PROGRAM:
            raise ValueError("it does not name its program")
        self.version = root.get("layout_version", "")
        if self.version not in map(str, READABLE):
            known = " and ".join(map(str, READABLE))
            raise ValueError(f"its layout has version {self.version or 'none'}, this program reads {known}")
        self.axes = tuple(self._axis(text_of(name)) for name in study["axes"])
        self.layout = layout_from_options(self.axes, study["options"])
        if len(self.axes) < 3 or min(self.layout.shape) < 1:
            raise ValueError("its axes are not those of a study")
        self.title = str(study.get("title", ""))
        self.digest = file.attributes(f"{ROOT}/scene").get("digest", "")
        self._known = {d.path: d for d in self.layout.datasets}

    def __enter__(self) -> Result:
        """The file is open; whatever numbers it holds, no warning of numpy is worth printing."""
        self._quiet = np.errstate(all="ignore")
        self._quiet.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        """Close the file."""
        self._quiet.__exit__(*error)
        self.close()

    def close(self) -> None:
        """Close the file."""
        self.file.close()

    def read(self, path: str) -> np.ndarray:
        """A dataset of the layout below ``/study``, for example ``checks/tension`` or ``e_n/flat``."""
        found = self.file.values(self._checked(path))
        if found.dtype.kind == "f" and (np.isfinite(found) & (np.abs(found) > BEYOND)).any():
            text = f"{path} has values beyond {BEYOND:g}"
            raise StudyError(OTHER_FILE, f"{self.path}: damaged ({text}); restore it from a copy")
        return found

    def map(self, name: str, model: str | None = None) -> np.ndarray:
        """One map over all axes; ``model`` where there is one value for each friction model."""
        return self.read(f"{name}/{model or name}")

    def fingers(self, name: str) -> np.ndarray:
        """A quantity of each finger: axes, finger, then models or components."""
        return self.read(f"fingers/{name}")

    def checks(self, name: str) -> np.ndarray:
        """A check of each finger's contact solution: axes, finger."""
        return self.read(f"checks/{name}")

    def work(self, name: str) -> np.ndarray:
        """Iterations (axes, finger) or seconds (axes)."""
        return self.read(f"work/{name}")

    def effects(self, name: str) -> dict[str, np.ndarray]:
        """Level, indicator and reason of an effect, each over all axes."""
        return {part: self.read(f"effects/{name}_{part}") for part in ("level", "indicator", "reason")}

    def patch(self, row: int) -> dict[str, np.ndarray]:
        """Faces of both fingers at one case: ``pressure (2, faces)``, ``centroid (2, faces, 3)``, ..."""
        names = [path.rpartition("/")[2] for path in self._known if path.startswith(f"{ROOT}/patch/")]
        return {name: self.file.values(self._checked(f"patch/{name}"), row) for name in names}

    def derived(self, name: str) -> np.ndarray:
        """A dataset that was filled after all rows."""
        return self.read(f"derived/{name}")

    def row(self, *index: int) -> int:
        """Flat row of a case from its index along each axis."""
        return int(np.ravel_multi_index(index, self.layout.shape))

    @property
    def status(self) -> np.ndarray:
        """State of every case: 0 missing, 1 done, 2 failed."""
        found = self.read("status/code")
        if found.max() > FAILED:
            text = f"a case has the state {found.max()}, which does not exist"
            raise StudyError(OTHER_FILE, f"{self.path}: damaged ({text}); restore it from a copy")
        return found

    @property
    def messages(self) -> np.ndarray:
        """Message of every case, as text."""
        return _texts(self.read("status/message"))

    @property
    def scene(self) -> str:
        """The effective scene as TOML text."""
        return self._string("scene")

    @property
    def scene_attributes(self) -> dict[str, Any]:
        """Digest, file name, overrides and PETSc options of the scene."""
        return self.file.attributes(f"{ROOT}/scene")

    @property
    def definitions(self) -> str:
        """What every quantity means."""
        return self._string("definitions")

    @property
    def report(self) -> str:
        """Best grasps, failures and how to read the file, as plain text; says so where the study is not finished."""
        return self._string("report") if self.version != str(READABLE[0]) else ""

    @property
    def labels(self) -> np.ndarray:
        """Names of the candidates, ``(stations, angles)``."""
        found = self.file.checked(f"{ROOT}/candidates/label", self.layout.shape[-3:-1], np.dtype(f"S{LABEL}"))
        return _texts(self.file.values(found))

    @property
    def sessions(self) -> list[dict[str, Any]]:
        """One entry for each time the study was started: start, stop, reason, ranks, versions, ..."""
        rows = self.file.values(self.file.checked(f"{ROOT}/provenance/sessions", (SESSIONS,), SESSION))
        fields = [(name, kind[:2]) for name, kind in (SESSION.fields or {}).items()]
        return [
            {name: text_of(row[name]) if kind.kind == "S" else int(row[name]) for name, (kind, _) in fields}
            for row in rows
            if row["start"]
        ]

    def _checked(self, path: str) -> Any:
        expected = self._known.get(f"{ROOT}/{path}")
        if expected is None:
            raise KeyError(f"{path} is no dataset of this file; it has {', '.join(sorted(self._known))}")
        return self.file.checked(expected.path, expected.shape, expected.dtype)

    def _axis(self, name: str) -> StoredAxis:
        path = f"{ROOT}/axes/{name}"
        found, attributes = self.file.plain(path), self.file.attributes(path)
        if found.ndim != 1 or found.dtype != np.dtype("<f8"):
            raise ValueError(f"axis '{name}' is no list of numbers")
        units = str(attributes.get("units", ""))
        values = self.file.values(found)
        if not (np.abs(values) < BEYOND).all():
            raise ValueError(f"axis '{name}' has values that are no numbers")
        return StoredAxis(name, values, units, str(attributes.get("long_name", name)).removesuffix(f" [{units}]"))

    def _string(self, name: str) -> str:
        found = self.file.plain(f"{ROOT}/{name}")
        if found.shape != () or found.dtype.kind != "S":
            raise StudyError(OTHER_FILE, f"{self.path}: damaged ({ROOT}/{name} is no text); restore it from a copy")
        return text_of(self.file.values(found).strip(b"\0 "))


def _texts(found: np.ndarray) -> np.ndarray:
    """Texts of an array of fixed-length strings."""
    return np.array([text_of(text) for text in found.ravel().tolist()], dtype=str).reshape(found.shape)
