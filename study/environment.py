"""The surroundings of a process: threads per rank, and how to start other processes and ranks on this machine."""

from __future__ import annotations

import atexit
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
ROOT = Path(__file__).parents[2]  # where the package softjaw lies
# folders with loops that numba compiles
COMPILED = ("fem", "fem/contact", "fem/objects", "fem/pad", "fem/shell", "friction", "lsfit", "scoring")
PASSING = "softjaw-numba-"  # how temporary folders of compiled loops begin
LAUNCHED = ("OMPI_", "PMIX_", "PMI_", "PRTE_", "HYDRA_")  # variables by which a rank finds the mpirun above it


def pin_threads() -> None:
    """Give every rank one thread unless the user says otherwise; has to run before numpy is imported.

    Ranks share the cores already, and the order of a sum, so its last bits, depends on the number of threads.
    """
    for name in THREADS:
        os.environ.setdefault(name, "1")


def keep_compiled_loops() -> None:
    """Let numba keep compiled loops in a private temporary folder when it could not write anywhere else.

    Without any place to write it refuses to compile at all. Has to run before numba is imported. The folder is removed
    at the end of the process, so every start compiles anew: what is loaded from it is code, which nobody else may have
    put there.
    """
    if os.environ.get("NUMBA_CACHE_DIR") or _writable(_user_cache()):
        return
    if all(_writable(ROOT / "softjaw" / package / "__pycache__") for package in COMPILED):
        return
    folder = tempfile.mkdtemp(prefix=PASSING)
    os.environ["NUMBA_CACHE_DIR"] = folder
    atexit.register(shutil.rmtree, folder, ignore_errors=True)


def compiled_loops_pass() -> bool:
    """Whether compiled loops are kept in a folder that `keep_compiled_loops` made, and no longer than the process."""
    return Path(os.environ.get("NUMBA_CACHE_DIR", "")).name.startswith(PASSING)


def _user_cache() -> Path | None:
    """Where numba keeps a user's compiled loops; None where the user has no home."""
    try:
        return Path(os.environ.get("XDG_CACHE_HOME") or Path("~/.cache").expanduser()) / "numba"
    except RuntimeError:
        return None


def _writable(folder: Path | None) -> bool:
    """Whether files can be made in a folder, which itself may have to be made first; nothing is made here."""
    if folder is None:
        return False
    # Path.exists would raise where a folder above may not be searched
    standing = next((place for place in (folder, *folder.parents) if os.access(place, os.F_OK)), folder)
    return os.access(standing, os.W_OK | os.X_OK) and standing.is_dir()


def outside_mpi(environment: Mapping[str, str]) -> dict[str, str]:
    """The same variables without those that tie a process to the mpirun it was started by.

    >>> outside_mpi({"HOME": "/root", "OMPI_COMM_WORLD_RANK": "1"})
    {'HOME': '/root'}
    """
    return {name: value for name, value in environment.items() if not name.startswith(LAUNCHED)}


def launch_environment() -> dict[str, str]:
    """Variables for starting mpirun: this process's own, one thread per rank, and leave to run as root if it is root.

    Open MPI refuses root unless told twice; inside a container there is often no other user.
    """
    allowed = {"OMPI_ALLOW_RUN_AS_ROOT": "1", "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1"} if os.geteuid() == 0 else {}
    return {**dict.fromkeys(THREADS, "1"), **outside_mpi(os.environ), **allowed}


def mpirun(ranks: int) -> list[str]:
    """First words of the command line that starts so many ranks, more than there are cores if need be.

    Raises
    ------
    FileNotFoundError
        There is no ``mpirun`` on the search path.
    """
    command = ["mpirun", "-n", str(ranks)]
    trial = subprocess.run(
        [*command, "true"],
        env=launch_environment(),
        stdin=subprocess.DEVNULL,
        capture_output=True,
        timeout=60,
        check=False,
    )
    return command if trial.returncode == 0 else [*command, "--oversubscribe"]


@dataclass(frozen=True)
class Answer:
    """What a program said: exit code (None: still running when its time was up), standard output and error."""

    code: int | None
    output: str
    errors: str

    @property
    def trouble(self) -> str:
        """Last thing it said, or how it ended, in one line."""
        if self.code is None:
            return "no answer in time"
        said = [line.strip() for line in self.errors.splitlines() if line.strip()]
        return said[-1] if said else f"ended with exit code {self.code}"


def ask(code: str, *, prefix: tuple[str, ...] = (), limit: float = 60.0) -> Answer:
    """Run a piece of Python in a process of its own, behind ``prefix`` (mpirun), for at most ``limit`` seconds."""
    with subprocess.Popen(
        [*prefix, sys.executable, "-c", code],
        env={**launch_environment(), "H5PY_ALWAYS_USE_MPI": "1"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
    ) as process:
        try:
            output, errors = process.communicate(timeout=limit)
        except subprocess.TimeoutExpired:
            process.terminate()  # mpirun ends its ranks when asked to, not when killed
            try:
                process.communicate(timeout=10.0)
            except subprocess.TimeoutExpired:
                process.kill()
            return Answer(None, "", "")
    return Answer(process.returncode, output.strip(), errors)
