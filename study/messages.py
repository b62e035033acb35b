"""What a command says and writes, and how it ends: exit codes, the error that carries one, printable texts, files.

Files that a user asked for are whole under their name or not there.
"""

import difflib
import json
import os
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

DONE, USAGE, OTHER_FILE, IN_USE, CANNOT_WRITE, SOME_FAILED, BUG, STOPPED = 0, 2, 3, 4, 5, 6, 70, 75
MEANING = {
    DONE: "done",
    USAGE: "bad usage or scene, nothing was started",
    OTHER_FILE: "the file belongs to another scene or cannot be read",
    IN_USE: "another run is using the file",
    CANNOT_WRITE: "the file cannot be written",
    SOME_FAILED: "finished, some cases failed",
    BUG: "a bug",
    STOPPED: "stopped, run the same command again",
}
LACKING = "{what} needs {error.name}: {error}; what does not solve works without, and 'softjaw doctor' checks the rest"
RANK = ("OMPI_COMM_WORLD_RANK", "PMIX_RANK", "PMI_RANK", "SLURM_PROCID")
# What controls a terminal or hides text: control characters, line separators, changes of direction, surrogates
UNPRINTABLE = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff\ufeff]")


class StudyError(Exception):
    """An expected failure of a run: one sentence for the user and the exit code that goes with it."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(code, message)
        self.code, self.message = code, message

    def __str__(self) -> str:
        return self.message


class NoGraspError(StudyError):
    """An object that can be read, and that no grasp fits."""


class Problem(NamedTuple):
    """One thing wrong with an input, with its place; ``line`` is None where no line can be named."""

    file: str
    line: int | None
    key: str
    value: str
    expected: str
    remedy: str

    def __str__(self) -> str:
        place = self.file if self.line is None else f"{self.file}:{self.line}"
        key, remedy = f" {self.key}:" if self.key else "", f"; {self.remedy}" if self.remedy else ""
        return f"{place}:{key} found {self.value}, expected {self.expected}{remedy}"


def printable(text: str) -> str:
    r"""A text of unknown origin with nothing in it that controls a terminal.

    >>> print(printable("a\x1b[2Jb"))
    a\u001b[2Jb
    """
    return UNPRINTABLE.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def shortened(text: str, width: int = 80) -> str:
    """A printable text of at most ``width`` characters."""
    text = printable(text)
    return text if len(text) <= width else text[: width - 4] + " ..."


def shown(value: Any, width: int = 60) -> str:
    """A value as TOML would write it, shortened to ``width`` characters."""
    if isinstance(value, Mapping):
        return "a table" if value else "an empty table"
    text = json.dumps(value, ensure_ascii=False, default=str)
    return shortened(text if isinstance(value, str) else text.replace("Infinity", "inf").replace("NaN", "nan"), width)


def first_of(texts: Sequence[str], most: int, what: str, place: str = "") -> list[str]:
    """The first texts; where there are more than ``most``, how many more, and of ``what``."""
    return [*texts[:most], *[f"{place}and {len(texts) - most} more{what}"] * (len(texts) > most)]


def closest(word: str, words: Sequence[str]) -> str | None:
    """The word that a mistyped one most likely means.

    >>> closest("Pad-Lenght", ["mu", "pad_length"])
    'pad_length'
    """
    lower = {known.lower(): known for known in words}
    return next((lower[w] for w in difflib.get_close_matches(word.lower().replace("-", "_"), lower, n=1)), None)


def launched() -> bool:
    """Whether this process was started as a rank, of one or several; known without MPI."""
    return any(name in os.environ for name in RANK)


def first_rank() -> bool:
    """Whether this process speaks for all ranks; known without MPI."""
    return next((os.environ[name] == "0" for name in RANK if name in os.environ), True)


def complain(error: StudyError, speaks: bool | None = None) -> int:
    """Say what went wrong, once unless it is known that this process ``speaks``, and give the exit code."""
    if first_rank() if speaks is None else speaks:
        for line in error.message.splitlines():
            print(f"error: {printable(line)}", file=sys.stderr, flush=True)
    return error.code


def with_ending(option: str, file: str | Path, *endings: str) -> Path:
    """The path of a file that an option names; `StudyError` if it has another ending."""
    if Path(file).suffix.lower() not in endings:
        raise StudyError(USAGE, f"{option}: found '{file}', expected a file ending in {' or '.join(endings)}")
    return Path(file)


@contextmanager
def fault_of(place: str, *kinds: type[Exception], code: int = USAGE, ending: str = "") -> Iterator[None]:
    """Errors of these kinds become a `StudyError` that names what is at fault, and ends with ``ending``."""
    try:
        yield
    except kinds as error:
        raise StudyError(code, f"{place}: {error}{ending}") from error


@contextmanager
def beside(path: Path, folders: bool = False, part: Path | None = None) -> Iterator[Path]:
    """A place to write to, renamed to ``path`` when it is on disk; with ``folders`` those that are missing are made.

    ``part`` names it. Devices and pipes are written to as they are. `StudyError` if the file cannot be written.
    """
    special = path.exists() and not path.is_file() and not path.is_dir()
    part = path if special else part or path.with_name(f"{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        if folders:
            make_folders(path.parent)
        yield part
        if not special:
            _on_disk(part)
            part.replace(path)
            _on_disk(path.parent)
    except (OSError, RuntimeError, ValueError) as error:
        if not isinstance(error, OSError) and "write" not in str(error):  # what h5py says of a full disk
            raise
        raise StudyError(CANNOT_WRITE, f"{path}: cannot be written ({why(error)}); choose another place") from error
    finally:
        if not special:
            remove(part)


def _on_disk(path: Path) -> None:
    """Wait until a file or folder is there for good."""
    opened = os.open(path, os.O_RDONLY)
    os.fsync(opened)
    os.close(opened)


def why(error: Exception) -> str:
    """What the system said of a file, also where HDF5 reports it, or the part of an error that says something.

    >>> why(OSError("Unable to create file (unable to open file: errno = 13, error message = 'Permission denied')"))
    'Permission denied'
    """
    text = str(error) or type(error).__name__
    if message := re.search(r"error message = '([^']*)'", text):
        return message[1]
    if getattr(error, "strerror", None):
        return str(error.strerror)  # type: ignore[attr-defined]
    # h5py puts what HDF5 says in parentheses behind its own sentence.
    if isinstance(error, OSError | RuntimeError):
        text = text.partition("(")[2].rstrip(")") or text
    return printable(" ".join(text.split()))[:200]


def remove(path: Path) -> None:
    """Remove a file if it is there; a read-only place, which refuses even to look, has none."""
    with suppress(OSError):
        path.unlink(missing_ok=True)


def make_folders(folder: Path) -> None:
    """Make a folder and those above it; `NotADirectoryError` where one of them is a file."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except FileExistsError as error:
        raise NotADirectoryError(error.errno, "Not a directory", str(folder)) from error


def write_file(path: Path, content: str | bytes, folders: bool = False) -> Path:
    """Write a whole file; see `beside`."""
    with beside(path, folders) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
    return path
