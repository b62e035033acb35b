"""Something dangerous tried in a child process first: what a library crashes on ends the child, and not the program."""

from __future__ import annotations

import faulthandler
import os
import resource
import signal
import sys
from collections.abc import Callable
from pathlib import Path

SECONDS = 20  # of CPU
ROOM = 2**30  # bytes beyond what this process has already
NO_MEMORY = 3


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
        except BaseException as error:  # told by the parent, which meets it too
            code = NO_MEMORY if "alloc" in str(error).lower() else 0
        finally:
            os._exit(code)
    status = os.waitpid(child, 0)[1]
    if os.WIFSIGNALED(status):
        slow = os.WTERMSIG(status) in (signal.SIGXCPU, signal.SIGKILL)
        return f"reading it does not end within {SECONDS} s" if slow else "the library that reads it crashes on it"
    return f"reading it takes more than {ROOM >> 30} GiB" if os.WEXITSTATUS(status) == NO_MEMORY else ""


def _limit() -> None:
    """Let this process be quiet, short and small."""
    faulthandler.disable()
    silent = os.open(os.devnull, os.O_WRONLY)
    os.dup2(silent, 1)
    os.dup2(silent, 2)
    for wanted in (signal.SIGINT, signal.SIGTERM):
        signal.signal(wanted, signal.SIG_DFL)
    limits = {resource.RLIMIT_CORE: 0, resource.RLIMIT_CPU: SECONDS}
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limits[resource.RLIMIT_AS] = pages * resource.getpagesize() + ROOM
    for kind, value in limits.items():
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))
