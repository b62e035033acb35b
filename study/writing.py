"""Files that a user asked for: whole under their name or not there, and one sentence where they cannot be written."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from softjaw.study.messages import CANNOT_WRITE, StudyError


@contextmanager
def beside(path: Path, folders: bool = False) -> Iterator[Path]:
    """A place to write to, renamed to ``path`` at the end; with ``folders`` those that are missing are made.

    Devices and pipes are written to as they are.

    Raises
    ------
    StudyError
        If the file cannot be written, with exit code 5.
    """
    special = path.exists() and not path.is_file() and not path.is_dir()
    part = path if special else path.with_name(f"{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        if folders:
            make_folders(path.parent)
        yield part
        if not special:
            part.replace(path)
    except (OSError, RuntimeError) as error:
        if not isinstance(error, OSError) and "write" not in str(error):  # what h5py says of a full disk
            raise
        raise StudyError(CANNOT_WRITE, f"{path}: cannot be written ({why(error)}); choose another place") from error
    finally:
        if not special:
            remove(part)


def why(error: Exception) -> str:
    """What the system said of a file, also where it is told by HDF5.

    >>> why(OSError("Unable to create file (unable to open file: errno = 13, error message = 'Permission denied')"))
    'Permission denied'
    """
    told = re.search(r"error message = '([^']*)'", str(error))
    return told[1] if told else getattr(error, "strerror", None) or str(error)


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
