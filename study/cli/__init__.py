"""The command line: the module that a command needs is imported when it runs, and every error becomes an exit code."""

import errno
import io
import os
import sys
import traceback
from argparse import Namespace
from collections.abc import Sequence
from importlib import import_module
from typing import Any

from softjaw.study.cli.options import program
from softjaw.study.doctor import begin_mpi, keep_compiled_loops, pin_threads
from softjaw.study.messages import BUG, CANNOT_WRITE, DONE, LACKING, STOPPED, USAGE, StudyError, complain, printable
from softjaw.study.run.limits import is_out_of_memory, listen, no_room, require_room

UNWRITABLE = {errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}  # what standard output can answer
SOLVING = ("run", "cost")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit code is the same on every rank."""
    # Before numpy is imported: its libraries read the number of threads only once.
    pin_threads()
    keep_compiled_loops()
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # the search for some is a tenth of a start
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a coding that lacks a letter ends no command
            stream.reconfigure(errors="backslashreplace")
    words = list(sys.argv[1:] if arguments is None else arguments)
    # What follows "--" belongs to PETSc, whose options argparse would take for its own.
    cut = words.index("--") if "--" in words else len(words)
    parser = program()
    if not words:
        parser.print_help()
        return USAGE
    try:
        options = parser.parse_args(words[:cut])
    # argparse ends the process itself; callers and tests want a code.
    except SystemExit as leave:
        return int(leave.code or 0)
    options.petsc = words[cut + 1 :]
    try:
        if options.petsc and options.command != "run":
            raise StudyError(USAGE, "only 'run' takes PETSc options after '--'")
        code = command(options)
        # Flushed here, while an error of the output can still become an exit code.
        sys.stdout.flush()
        return code
    except StudyError as error:
        return complain(error)
    except ImportError as error:
        return complain(StudyError(USAGE, LACKING.format(what=options.command, error=error)))
    except OSError as error:
        # An error with a file name is about that file and not about standard output.
        if error.errno not in UNWRITABLE or error.filename:
            return _unforeseen(options, error)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or the interpreter tries again as it ends
        if error.errno == errno.EPIPE:  # the reader of a pipe has seen enough
            return DONE
        return complain(StudyError(CANNOT_WRITE, f"the output cannot be written ({error.strerror})"))
    except Exception as error:
        return _unforeseen(options, error)


def command(options: Namespace) -> int:
    """Import the module of a command and run it; a text that it returns is printed."""
    if options.command in SOLVING:
        listen()
        # Before the solvers load, which may hang instead of failing where memory is short.
        require_room()
    if options.command == "run":
        os.environ["H5PY_ALWAYS_USE_MPI"] = "1"  # before h5py is imported: its own guess misses srun and single runs
    options.folder = _module("cli.quick").objects_of(options) if "objects" in options else None
    if options.command in SOLVING:
        if not options.folder:  # a wrong scene is refused before the solvers are loaded
            options.scene_read = _module("cli.quick").scene_of(options)
        begin_mpi()
    answer = getattr(_module(options.module), options.command)(options)
    if isinstance(answer, str):
        print(printable(answer))
        return DONE
    return int(answer or DONE)


def _module(name: str) -> Any:
    return import_module(f"softjaw.study.{name}")


def _unforeseen(options: Namespace, error: Exception) -> int:
    """The exit code of an error that no command expects: too little memory, or a bug."""
    if is_out_of_memory(error):
        print(f"error: {no_room(str(error) or type(error).__name__)}", file=sys.stderr, flush=True)
        return _ended(STOPPED if options.command == "run" else USAGE)
    traceback.print_exc()
    # Abort does not flush what still waits.
    sys.stderr.flush()
    return _ended(BUG)


def _ended(code: int) -> int:
    """The exit code; of several ranks the others are ended, because they wait for this one."""
    # Looked up, not imported: a command without MPI must not start it to end.
    mpi: Any = sys.modules.get("mpi4py.MPI")
    if mpi and mpi.COMM_WORLD.size > 1:
        mpi.COMM_WORLD.Abort(code)
    return code
