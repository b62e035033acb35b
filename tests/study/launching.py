"""Starting the fake study, alone or under mpirun, and comparing what it wrote."""

from __future__ import annotations

import subprocess
import sys
import time
from pathlib import Path

import h5py
import numpy as np

from softjaw.study.doctor import launch_environment

ROOT = Path(__file__).parent.parent.parent
SCRIPT = Path(__file__).parent / "fake_run.py"
NOT_COMPARED = ("study/work/", "study/checksums/times", "study/provenance/", "study/status/attempts")


def command(ranks, *words):
    """The fake study on so many ranks; 0 is without mpirun."""
    start = ["timeout", "-k", "5", "120", "mpirun", "--timeout", "110", "-n", str(ranks), "--oversubscribe"]
    return [*(start if ranks else []), sys.executable, *(str(word) for word in words)]


def launch(ranks, *words):
    """Run to the end; exit code, output and errors."""
    done = subprocess.run(
        command(ranks, *words), env=launch_environment(), cwd=ROOT, capture_output=True, text=True,
        timeout=130, stdin=subprocess.DEVNULL,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


def study(ranks, *words):
    """Run the fake study to its end."""
    return launch(ranks, SCRIPT, *words)


def start(ranks, *words):
    """Start the fake study and come back at once; a process group of its own, without ``timeout`` in between."""
    words = command(ranks, SCRIPT, *words)
    words = words[words.index("mpirun") :] if ranks else words
    return subprocess.Popen(
        words, env=launch_environment(), cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip


def wait_for(condition, limit=30.0):
    """Wait until ``condition()`` holds."""
    deadline = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < deadline, "it took too long"
        time.sleep(0.02)


def contents(path):
    """Bytes of every dataset that must not depend on how the work was done."""
    found = {}

    def keep(name, node):
        if isinstance(node, h5py.Dataset) and not name.startswith(NOT_COMPARED):
            found[name] = np.asarray(node[()]).tobytes()

    with h5py.File(path, "r") as file:
        file.visititems(keep)
    return found


def differing(path, expected):
    """Names of the datasets that are not, byte for byte, what was expected."""
    found = contents(path)
    return [name for name in sorted(found.keys() | expected.keys()) if found.get(name) != expected.get(name)]
