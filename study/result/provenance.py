"""Which program, on which machine, with which libraries: what a later reader needs to trust or repeat a result."""

import os
import platform
import shlex
import subprocess
import sys
from datetime import datetime
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np


def timestamp() -> str:
    """Local time with its offset from UTC."""
    return datetime.now().astimezone().isoformat(timespec="seconds")


def program() -> str:
    """Name and version of this program."""
    try:
        return f"softjaw {metadata.version('softjaw')}"
    except metadata.PackageNotFoundError:
        return "softjaw, not installed"


def git_state(folder: Path) -> str:
    """Commit of the sources, with ``-dirty`` if they were changed; empty where there is no repository."""
    # Asked first, because git would also find a repository that merely contains the installed package.
    if not (folder / ".git").exists():
        return ""
    command = ["git", "-C", str(folder), *"describe --always --dirty --abbrev=12".split()]
    # A missing git or a slow disk must not keep a study from starting.
    try:
        return subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return ""


def cpu() -> str:
    """Model of the processor."""
    lines = Path("/proc/cpuinfo").read_text().splitlines()
    # Not every architecture tells the name of its model.
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def versions(mpi_library: str) -> str:
    """Versions of the libraries that had a part in the numbers, as far as they are loaded."""
    # Some MPI libraries give several lines and zero bytes at the end.
    known = [f"python {platform.python_version()}", mpi_library.split(",")[0].splitlines()[0].strip("\0 ")]
    names = ("numpy", "scipy", "numba", "skfem", "clarabel", "mpi4py", "petsc4py", "h5py")
    # Importing a library only to name it would slow the start.
    known += [f"{name} {getattr(sys.modules[name], '__version__', '?')}" for name in names if name in sys.modules]
    if "petsc4py.PETSc" in sys.modules:
        known.append(f"PETSc {'.'.join(map(str, sys.modules['petsc4py.PETSc'].Sys.getVersion()))}")
    known.append(f"HDF5 {sys.modules['h5py'].version.hdf5_version}")
    blas = getattr(getattr(np, "__config__", None), "CONFIG", {}).get("Build Dependencies", {}).get("blas", {})
    threads = os.environ.get("OMP_NUM_THREADS", "all")
    known.append(f"BLAS {blas.get('name', '?')} {blas.get('version', '')} ({threads} threads)")
    return ", ".join(known)


def session(ranks: int, hosts: int, mpi_library: str) -> dict[str, Any]:
    """One row of the provenance, as a run begins."""
    return {
        "start": timestamp(), "reason": "running", "ranks": ranks, "hosts": hosts, "host": platform.node(),
        "program": program(), "git": git_state(Path(__file__).parents[3]), "versions": versions(mpi_library),
        "cpu": cpu(), "command": shlex.join(sys.argv), "petsc_options": os.environ.get("PETSC_OPTIONS", ""),
    }  # fmt: skip
