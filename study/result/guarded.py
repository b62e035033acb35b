"""HDF5 files of unknown origin: known paths alone, never another file, never more than the file itself holds."""

from __future__ import annotations

import faulthandler
import os
import resource
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from softjaw.study.messages import IN_USE, OTHER_FILE, StudyError, printable

SECONDS = 20  # of CPU
ROOM = 2**30  # bytes beyond what this process has already
NO_MEMORY = 3
DEFLATE = 1000  # no data get smaller by more than this
# what h5py raises for damage: its own errors have no class of their own
BROKEN = (RuntimeError, OSError, KeyError, ValueError, TypeError, AttributeError, OverflowError, MemoryError)


class GuardedFile:
    """Reads known paths of a file of unknown origin: never another file, never more than the file holds."""

    def __init__(self, path: Path, file: h5py.File) -> None:
        self.path, self._file, self._bytes = path, file, path.stat().st_size

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def attributes(self, path: str = "") -> dict[str, Any]:
        """Attributes of a group or dataset: texts, and lists as arrays."""
        with self._told(path or "/"):
            found = dict(self._node(path).attrs.items())
            return {key: text_of(value) if np.ndim(value) == 0 else np.asarray(value) for key, value in found.items()}

    def checked(self, path: str, shape: tuple[int, ...], dtype: np.dtype) -> h5py.Dataset:
        """A dataset that has the expected shape and type."""
        found = self.plain(path)
        if found.shape != shape or found.dtype != dtype:
            text = f"{path} has shape {found.shape} of {found.dtype}, expected {shape} of {dtype}"
            raise StudyError(OTHER_FILE, f"{self.path}: damaged ({text}); restore it from a copy")
        return found

    def plain(self, path: str) -> h5py.Dataset:
        """A dataset whose data stand in this very file."""
        with self._told(path):
            found = self._node(path)
            if not isinstance(found, h5py.Dataset):
                raise StudyError(OTHER_FILE, f"{self.path}: damaged ({path} is not a dataset); restore it from a copy")
            plist = found.id.get_create_plist()
            virtual = plist.get_layout() == h5py.h5d.VIRTUAL
            nbytes = found.size * max(found.dtype.itemsize, 1) if found.shape is not None else 0
            # A header can claim any size, and a reader allocates it before it misses the data.
            too_large = nbytes > self._bytes * (DEFLATE if found.chunks else 1)
            if virtual or plist.get_external_count() or too_large:
                raise StudyError(OTHER_FILE, f"{self.path}: {path} is not stored in this file; do not trust it")
            return found

    def texts(self, path: str) -> list[str]:
        """A list of texts of any length."""
        with self._told(path):
            found = self.plain(path)
            if found.ndim != 1 or not h5py.check_string_dtype(found.dtype):
                raise StudyError(
                    OTHER_FILE, f"{self.path}: damaged ({path} is not a list of texts); restore it from a copy"
                )
            return [text_of(text) for text in found[()].tolist()]

    def values(self, dataset: h5py.Dataset, index: Any = ()) -> Any:
        """Values of a dataset that `plain` or `checked` gave, all or those of an index."""
        with self._told(dataset.name or "a dataset"):
            return dataset[index]

    def _node(self, path: str) -> Any:
        node: Any = self._file
        # Link by link: HDF5 by itself would follow soft and external links out of the file.
        for part in filter(None, path.split("/")):
            link = node.get(part, getlink=True) if isinstance(node, h5py.Group) else None
            if not isinstance(link, h5py.HardLink):
                raise StudyError(OTHER_FILE, f"{self.path}: {path} is missing or in another file; do not trust it")
            node = node[part]
        return node

    @contextmanager
    def _told(self, path: str) -> Iterator[None]:
        """Turn whatever HDF5 says of damage into one sentence."""
        try:
            yield
        except BROKEN as error:
            text = f"{self.path}: damaged ({path}: {reason(error)}); restore it from a copy"
            raise StudyError(OTHER_FILE, text) from error


def opened(path: Path, kind: str, make: Callable[[GuardedFile], Any], walk: Callable[[Any], object]) -> Any:
    """What ``make`` makes of a file, which stays open; a child process has gone through it by ``walk`` before.

    Raises
    ------
    StudyError
        The file cannot be read as a file of this ``kind``, another program holds it, or HDF5 does not survive it.
    """
    # Opening a pipe or a device could block for ever.
    if path.exists() and not path.is_file():
        raise StudyError(OTHER_FILE, f"{path}: is not a regular file; name a {kind}")

    def attempt() -> None:
        file = h5py.File(path, "r")  # not closed: that has to work on half of a structure, and the process ends anyway
        with suppress(StudyError):
            walk(make(GuardedFile(path, file)))

    if why := trouble(attempt):
        raise StudyError(OTHER_FILE, f"{path}: damaged ({why}); restore it from a copy")
    try:
        file = GuardedFile(path, h5py.File(path, "r"))
    except FileNotFoundError as error:
        raise StudyError(OTHER_FILE, f"{path}: no such file") from error
    except BROKEN as error:
        # h5py has no class for this: only the text tells a lock from damage.
        if "unable to lock file" in str(error):
            text = f"{path}: another program holds it open for writing; close it there"
            raise StudyError(IN_USE, text) from error
        raise StudyError(OTHER_FILE, f"{path}: {_why_not(path, kind, error)}") from error
    try:
        return make(file)
    except BROKEN as error:
        file.close()
        text = f"{path}: not a {kind} of softjaw ({reason(error)}); choose another file"
        raise StudyError(OTHER_FILE, text) from error
    except StudyError:
        file.close()
        raise


def _why_not(path: Path, kind: str, error: Exception) -> str:
    """What to say of a file that HDF5 does not open."""
    if not os.access(path, os.R_OK):
        return "permission denied; ask its owner to let you read it"
    if path.suffix == ".toml":
        return f"is a scene, not a {kind}; 'softjaw run {path}' solves it"
    return f"not a readable {kind} ({reason(error)}); move it away or restore it"


def reason(error: Exception) -> str:
    """The part of an error of HDF5 that says something, on one line."""
    if getattr(error, "strerror", None):
        return str(error.strerror)  # type: ignore[attr-defined]
    text = str(error) or type(error).__name__
    # h5py puts what HDF5 says in parentheses behind its own sentence.
    if isinstance(error, OSError | RuntimeError):
        text = text.partition("(")[2].rstrip(")") or text
    return printable(" ".join(text.split()))[:200]


def text_of(value: Any) -> str:
    """Text of an attribute or a fixed-length string, with nothing in it that a terminal would obey."""
    return printable(value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value))


def trouble(attempt: Callable[[], object]) -> str:
    """How an attempt ended that must not be repeated here, in words; empty if it came to an end, even by an exception.

    It costs a few milliseconds, and as much again as the attempt itself.
    """
    try:
        child = os.fork()
    except OSError:  # no process to be had: then without the trial
        return ""
    if child == 0:
        code = NO_MEMORY
        try:
            _limit()
            attempt()
            code = 0
        except MemoryError:
            pass
        except BaseException as error:  # reported by the parent, which meets it too
            # Missing memory also comes as other errors, whose text alone says so.
            code = NO_MEMORY if "alloc" in str(error).lower() else 0
        finally:
            # No exit handlers, and no flush of buffers that the parent will write as well.
            os._exit(code)
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status):
        # At a hard limit the kernel kills instead of sending SIGXCPU.
        slow = os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL)
        return f"reading it does not end within {SECONDS} s" if slow else "the library that reads it crashes on it"
    return f"reading it takes more than {ROOM >> 30} GiB" if os.WEXITSTATUS(status) == NO_MEMORY else ""


def _limit() -> None:
    """Let this process be quiet, short and small."""
    # A crash is expected here: its traceback belongs on no terminal.
    faulthandler.disable()
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    # Handlers of a run are inherited: a signal must end this child and not stop the run from inside it.
    for wanted in (signal.SIGINT, signal.SIGTERM):
        signal.signal(wanted, signal.SIG_DFL)
    # No core file of a mere trial.
    limits = {resource.RLIMIT_CORE: 0, resource.RLIMIT_CPU: SECONDS}
    # Elsewhere there is no /proc that tells the present size, which a bound has to be added to.
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limits[resource.RLIMIT_AS] = pages * resource.getpagesize() + ROOM
    for kind, value in limits.items():
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))
