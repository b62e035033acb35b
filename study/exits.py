"""Exit codes of the program, and the error that carries one to every rank."""

from __future__ import annotations

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


class StudyError(Exception):
    """An expected failure of a run: one sentence for the user and the exit code that goes with it."""

    def __init__(self, code: int, message: str) -> None:
        super().__init__(code, message)
        self.code, self.message = code, message

    def __str__(self) -> str:
        return self.message
