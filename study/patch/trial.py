"""A trial in a child process of what a library may not survive, such as VTK a damaged file."""

from __future__ import annotations

import faulthandler
import os
import resource
import signal
import sys
from collections.abc import Callable
from pathlib import Path

TRIAL_CPU_S = 20
TRIAL_BYTES = 2**30  # beyond what this process has already
NO_MEMORY = 3  # exit code of a trial


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
        return f"reading it does not end within {TRIAL_CPU_S} s" if slow else "the library that reads it crashes on it"
    return f"reading it takes more than {TRIAL_BYTES >> 30} GiB" if os.WEXITSTATUS(status) == NO_MEMORY else ""


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
    limits = {resource.RLIMIT_CORE: 0, resource.RLIMIT_CPU: TRIAL_CPU_S}
    # Elsewhere there is no /proc that tells the present size, which a bound has to be added to.
    if sys.platform == "linux":
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        limits[resource.RLIMIT_AS] = pages * resource.getpagesize() + TRIAL_BYTES
    for kind, value in limits.items():
        hard = resource.getrlimit(kind)[1]
        resource.setrlimit(kind, (value if hard == resource.RLIM_INFINITY else min(value, hard), hard))
