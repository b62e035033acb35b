"""The result file of a run: written by one run at a time, and still there while it is written."""

import contextlib
import errno
import fcntl
import os
import time
from collections.abc import Iterator
from pathlib import Path

from softjaw.study.messages import CANNOT_WRITE, IN_USE, StudyError, why

# Some network file systems have no locks: a run there is warned, not refused.
NO_LOCKS = {errno.ENOLCK, errno.EOPNOTSUPP, errno.ENOSYS, errno.EINVAL}
# A file system may emulate flock by record locks, which may refuse with EACCES.
BUSY = {errno.EWOULDBLOCK, errno.EACCES}


class Lock:
    """``NAME.hdf.lock``: taken alone by rank 0, which proves that no rank of another run lives, then shared by all.

    A lock cannot be turned from exclusive to shared in one step. Rank 0 therefore writes its name into the file
    while it is alone; whoever finds another name there afterwards was overtaken in between and withdraws.
    """

    def __init__(self, result: Path, owner: str) -> None:
        self.path, self.result, self.owner = result.with_name(result.name + ".lock"), result, owner
        self.warning, self._fd = "", -1

    def take_first(self) -> None:
        """On rank 0: raise `StudyError` if a rank of another run is alive."""
        for attempt in range(6):  # 'status' takes the lock for an instant to see whether a run is alive
            with self._writing():
                self._fd = os.open(self.path, os.O_RDWR | os.O_CREAT, 0o666)
            # A run that ends unlinks the file: a lock on a file without a name would keep nobody out.
            if self._flock(fcntl.LOCK_EX | fcntl.LOCK_NB):
                with contextlib.suppress(FileNotFoundError):
                    if os.fstat(self._fd).st_ino == self.path.stat().st_ino:
                        break
            # The name of the holder lets the message say whom to wait for.
            holder = os.read(self._fd, 200).decode(errors="replace").strip()
            self.release()
            if attempt == 5:
                raise in_use(self.result, holder or "name unknown")
            time.sleep(0.1)
        with self._writing():
            # A shorter name must not keep the end of a longer one that a killed run left.
            os.ftruncate(self._fd, 0)
            os.pwrite(self._fd, self.owner.encode(), 0)
        self._flock(fcntl.LOCK_SH)

    @contextlib.contextmanager
    def _writing(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            remedy = "choose another place with -o, or make room"
            text = f"{self.result}: cannot be written: {error.strerror} for {self.path.name} beside it; {remedy}"
            raise StudyError(CANNOT_WRITE, text) from error

    def join(self) -> None:
        """On the other ranks, after `take_first`: hold the lock as well, until this process dies."""
        self._fd = os.open(self.path, os.O_RDONLY)
        self._flock(fcntl.LOCK_SH)

    def confirm(self) -> None:
        """On rank 0, when all ranks hold the lock: raise `StudyError` if another run was quicker."""
        holder = os.pread(self._fd, 200, 0).decode(errors="replace").strip()
        if holder != self.owner:
            raise in_use(self.result, holder)

    def remove(self) -> None:
        """On rank 0, at the end of the run, while all ranks still hold the lock: take the file away."""
        # A user may have removed it by hand: the end of a run does not fail by that.
        self.path.unlink(missing_ok=True)

    def release(self) -> None:
        """Let go; a process that dies does so as well."""
        if self._fd >= 0:
            os.close(self._fd)
            # The number is soon given to another file, which a second release must not close.
            self._fd = -1

    def _flock(self, operation: int) -> bool:
        try:
            fcntl.flock(self._fd, operation)
        except OSError as error:
            if error.errno in BUSY:
                return False
            if error.errno not in NO_LOCKS:
                raise
            self.warning = f"{self.path.parent} has no file locks: make sure that only one run writes {self.result}"
        return True


def in_use(result: Path, holder: str) -> StudyError:
    """That another run has a file."""
    return StudyError(IN_USE, f"{result}: in use by another run ({holder}); wait for it")


def holder(result: Path) -> str:
    """Who is running on ``result`` now, or an empty text."""
    result = Path(os.path.realpath(result))  # of a link
    try:
        fd = os.open(result.with_name(result.name + ".lock"), os.O_RDONLY)
    except OSError:
        return ""
    try:
        # Only an attempt to lock tells a live run from a file that a killed one left behind.
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        return ""
    except OSError as error:
        return os.pread(fd, 200, 0).decode(errors="replace").strip() if error.errno in BUSY else ""
    finally:
        os.close(fd)


class OpenedFile:
    """The file that a run has opened, under the name that it had then.

    An open file outlives its name: without a look at the name, a run would fill a file that nobody can find any more.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self._identity = self._now()

    def check(self) -> None:
        """Raise `StudyError` if the file was moved or removed, or its folder cannot be reached."""
        try:
            identity = self._now()
        except FileNotFoundError:
            identity = None
        except OSError as error:
            raise self._lost(why(error)) from error
        if identity != self._identity:
            what = "was moved or removed" if identity is None else "was replaced by another file"
            text = f"{self.path}: {what} during the run; put it back, or begin again with the same command"
            raise StudyError(CANNOT_WRITE, text)

    @contextlib.contextmanager
    def writing(self) -> Iterator[None]:
        """Around a write: a failed one becomes a `StudyError`."""
        try:
            yield
        except (OSError, RuntimeError) as error:  # h5py has both
            raise self._lost(why(error)) from error

    def _lost(self, reason: str) -> StudyError:
        safe = "stored results are kept; make the place writable, then run the same command again to resume"
        return StudyError(CANNOT_WRITE, f"{self.path}: cannot be written any more ({reason}); {safe}")

    def _now(self) -> tuple[int, int]:
        # Device and inode, because a copy under the same name is another file.
        status = self.path.stat()
        return status.st_dev, status.st_ino
