"""Whether the result file is still there while it is being written, and what to say when it is not."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from softjaw.study.exits import CANNOT_WRITE, StudyError


class Standing:
    """The file that a run has opened, under the name that it had then.

    An open file outlives its name: without a look at the name, a run would fill a file that nobody can find any more.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._identity = self._now()

    def check(self) -> None:
        """Raise `StudyError` if the file was moved or removed, or its folder cannot be reached."""
        try:
            found = self._now()
        except FileNotFoundError:
            found = None
        except OSError as error:
            raise self._lost(error.strerror or str(error)) from error
        if found != self._identity:
            what = "was moved or removed" if found is None else "was replaced by another file"
            remedy = "put it back, or begin again with the same command"
            raise StudyError(CANNOT_WRITE, f"{self.path}: {what} while the run was writing it; {remedy}")

    @contextmanager
    def writing(self) -> Iterator[None]:
        """Around a write: a failed one becomes a `StudyError`."""
        try:
            yield
        except (OSError, RuntimeError) as error:  # h5py has both
            raise self._lost(str(error)) from error

    def _lost(self, reason: str) -> StudyError:
        safe = "what was stored before is kept, and the same command goes on when the place can be written again"
        return StudyError(CANNOT_WRITE, f"{self.path}: cannot be written any more ({reason}); {safe}")

    def _now(self) -> tuple[int, int]:
        status = self.path.stat()
        return status.st_dev, status.st_ino
