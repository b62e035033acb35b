"""What of a damaged result file is good, and a copy of it that a run can go on with. The original is never changed."""

from __future__ import annotations

import os
import shutil
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.study.environment import ask
from softjaw.study.exits import CANNOT_WRITE, IN_USE, OTHER_FILE, StudyError
from softjaw.study.result.layout import DONE, FAILED, MISSING, ROOT
from softjaw.study.result.store import ResultWriter, create, open_result, rows_of
from softjaw.study.run.lock import holder
from softjaw.study.scene.problems import SceneError
from softjaw.study.writing import remove

SIGNATURE, END = b"\x89HDF\r\n\x1a\n", struct.Struct("<40xQ")  # version 0, which this program writes: size at byte 40
BROKEN = (StudyError, SceneError, ValueError, KeyError, TypeError, RuntimeError, OSError)  # of HDF5, whatever it finds
PROBE = "from softjaw.study.result import repair; repair.probe({!r})"  # in a process of its own
PATIENCE = 60.0  # s for reading the structure of a file that was cut off
RESTORE = "restore it from a copy, or move it away and solve again"


@dataclass(frozen=True)
class Findings:
    """What is wrong with a file: bytes it has and should have, states and torn ones of its rows, what else."""

    size: int
    whole: int
    codes: np.ndarray
    torn: list[int]
    flaw: str
    leftovers: list[Path]

    @property
    def sound(self) -> bool:
        """Whether a run could go on with the file as it is."""
        return self.size >= self.whole and not self.torn and not self.flaw


def repair(path: Path, write: bool = False, in_place: bool = False) -> str:
    """Say what is good; with ``write`` or ``in_place`` make a usable file of it.

    Raises
    ------
    StudyError
        Nothing can be repaired, a run is using the file, or there is no room for the copy.
    """
    if who := holder(path):
        raise StudyError(IN_USE, f"{path}: in use by a run ({who}); wait for it")
    target = path.with_suffix(".repaired.hdf")
    backup = path.with_name(path.name + ".backup")
    for made in [target] if write else [target, backup] if in_place else []:
        if made.exists():
            raise StudyError(CANNOT_WRITE, f"{made}: exists already, of an earlier repair; move it away")
    with _completed(path, target) as copy:
        found = _examine(path, copy)
        told = [*_told(path, found)]
        if not (write or in_place):
            return "\n".join([*told, *_advice(path, found)])
        if not found.sound:
            fresh = target.with_name(target.name + ".new")
            _rewrite(path, copy, fresh)
            fresh.replace(target)
            told.append(f"written: {target}; the command that made the original goes on with it")
            if in_place:
                path.replace(backup)
                target.replace(path)
                told[-1] = f"written: {path}, the damaged one is {backup}; the same command goes on"
    for left in found.leftovers:
        left.unlink(missing_ok=True)
    return "\n".join([*told, *(f"removed: {left}" for left in found.leftovers)])


@contextmanager
def _completed(path: Path, target: Path) -> Iterator[Path]:
    """The file with the length it should have: a copy beside it where it is cut, which is removed again."""
    copy = target.with_name(target.name + ".part")
    try:
        whole = _whole(path)
        if path.stat().st_size >= whole:
            yield path
            return
        shutil.copyfile(path, copy)
        os.truncate(copy, whole)
        yield copy
    except FileNotFoundError as error:
        part = path.with_name(path.name + ".part").exists()
        text = f"only {path.name}.part, in which nothing was solved yet; run again" if part else "check the path"
        raise StudyError(OTHER_FILE, f"{path}: there is no such file; {text}") from error
    except OSError as error:
        raise StudyError(CANNOT_WRITE, f"{target}: cannot be written ({error.strerror or error})") from error
    finally:
        remove(copy)


def _whole(path: Path) -> int:
    """Bytes that the file should have, as it says itself."""
    with path.open("rb") as file:
        head = file.read(END.size)
    if len(head) < END.size or not head.startswith(SIGNATURE) or head[8]:
        kind = "is empty" if not head.strip(b"\0") else "does not begin like a result file"
        raise StudyError(OTHER_FILE, f"{path}: {kind}, so nothing can be repaired; {RESTORE}")
    return int(END.unpack(head)[0])


def _examine(path: Path, copy: Path) -> Findings:
    if (
        copy != path
        and ask(PROBE.format(str(copy.absolute())), limit=PATIENCE).code != 0
    ):
        raise _hopeless(path, "what is left of its structure cannot be read")
    try:
        with open_result(copy, unchecked=True) as result:
            layout, marked = result.layout, result.codes.ravel()
            packed = any(result.file.plain(dataset.path).chunks for dataset in layout.datasets)
            lost = _lost_part(result, path.stat().st_size)
        codes, torn = np.full(marked.shape, MISSING), []
        for row, state, values in rows_of(copy, layout):
            codes[row], torn = state, torn + [row] * (values is None)
        unmarked = int(np.sum(codes != marked))
    except BROKEN as error:
        raise _hopeless(path, str(error).removeprefix(f"{copy}: ")) from error
    leftovers = [path.with_name(path.name + end) for end in (".part", ".lock")]
    flaw = f"damaged: the states of {unmarked} cases, which their checksums still tell" if unmarked else ""
    flaw = f"damaged: {lost}; it can be made again" if lost else flaw
    flaw = "repacked: a run could not write it in parallel" if packed else flaw
    return Findings(path.stat().st_size, copy.stat().st_size, codes, torn, flaw, [p for p in leftovers if p.exists()])


def probe(copy: str) -> None:
    """Read whatever a repair reads, in a process of its own: over zeros HDF5 may crash or turn for ever."""
    with suppress(*BROKEN), open_result(copy, unchecked=True) as result:
        _lost_part(result, 2**63)
        list(rows_of(Path(copy), result.layout))


def _lost_part(result: Any, size: int) -> str:
    """The first thing beside the rows that is not as it was written; empty where all of it is."""
    layout = result.layout
    fixed = [f"{ROOT}/{name}" for name in ("scene", "definitions", "provenance/sessions")]
    for name in [*fixed, *(f"{ROOT}/axes/{axis}" for axis in layout.names), *(d.path for d in layout.grid)]:
        try:
            found = result.file.plain(name)
        except BROKEN:
            return name
        if found.size and int(found.id.get_offset() or 0) + found.nbytes > size:
            return name
    if not result.header_good:
        return "its axes, scene or definitions"
    return next((name for name in layout.closing if not result.closing_good(name)), "")


def _rewrite(path: Path, copy: Path, fresh: Path) -> None:
    """A new file of the same scene with the good rows of the damaged one."""
    try:
        with open_result(copy, unchecked=True) as result:
            layout, plan, digest = result.layout, _plan(result), result.digest
        if plan.header.digest != digest:
            raise ValueError("its scene, or the mesh that it names, is not the one that was solved")
        create(fresh, plan.layout, plan.header)
        with open_result(fresh) as made:
            same = replace(layout, surface=made.layout.surface).options() == made.layout.options()
        if not same or plan.layout.shape != layout.shape:
            raise ValueError("another version of this program made it, which stored other values; repair it with that")
        writer = ResultWriter(fresh, plan.layout, None)
        for row, state, values in rows_of(copy, layout):
            if values is not None:
                writer.copy(row, values, state)
        writer.close()
    except BROKEN as error:
        remove(fresh)
        if getattr(error, "code", 0) == CANNOT_WRITE:
            raise
        raise _hopeless(path, str(error)) from error


def _plan(result: Any) -> Any:
    """The plan of the scene that a file was made from."""
    from softjaw.study.run.plan import make_plan
    from softjaw.study.scene import parse_scene

    told = result.scene_attributes
    if not result.scene:
        raise ValueError("its scene is lost")
    return make_plan(parse_scene(result.scene), told.get("file", ""), told.get("overrides", "").splitlines())


def _hopeless(path: Path, reason: str) -> StudyError:
    return StudyError(OTHER_FILE, f"{path}: cannot be repaired ({reason}); {RESTORE}")


def _told(path: Path, found: Findings) -> Iterator[str]:
    done, failed, missing = (int(np.sum(found.codes == state)) for state in (DONE, FAILED, MISSING))
    yield f"{path}: {done - len(found.torn)} of {found.codes.size} cases good, {failed} failed, {missing} missing"
    if found.size < found.whole:
        cut = (found.whole - found.size) / 1e6
        yield f"  cut off: {cut:.3g} of {found.whole / 1e6:.3g} MB, probably while it was copied"
    elif found.flaw:
        yield f"  {found.flaw}"
    if found.torn:
        first = f"{', '.join(map(str, found.torn[:8]))}{', ...' if len(found.torn) > 8 else ''}"
        yield f"  damaged: {len(found.torn)} cases marked done do not match their checksums (rows {first})"
    for left in found.leftovers:
        yield f"  left over: {left}, of a run that was killed"


def _advice(path: Path, found: Findings) -> Iterator[str]:
    if not found.sound:
        yield f"nothing was changed; 'softjaw repair {path} --write' makes a usable copy, --in-place replaces the file"
    elif found.leftovers:
        yield f"the file is sound; 'softjaw repair {path} --write' removes what is left over, and so does the next run"
    else:
        yield "the file is sound, there is nothing to repair"
