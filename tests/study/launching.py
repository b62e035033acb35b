"""Starting the fake study, alone or under mpirun, and comparing what it wrote."""

import io
import json
import resource
import subprocess
import sys
import time
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import h5py
import numpy as np
import pytest

from softjaw.study.cli import main
from softjaw.study.doctor import launch_environment
from softjaw.study.messages import StudyError
from softjaw.study.quantities import DONE
from softjaw.study.result.store import open_result
from tests.study import fake_run

ROOT = Path(__file__).parent.parent.parent
SCRIPT = Path(__file__).parent / "fake_run.py"
HARMFUL = {"--kill", "--bug", "--stuck", "--greedy", "--unplug", "--remove", "--file-limit"}
NOT_COMPARED = ("study/work/", "study/provenance/", "study/status/attempts")


def command(ranks, *words):
    """The fake study on so many ranks; 0 is without mpirun."""
    start = ["timeout", "-k", "5", "120", "mpirun", "--timeout", "110", "-n", str(ranks), "--oversubscribe"]
    return [*(start if ranks else []), sys.executable, *(str(word) for word in words)]


def launch(ranks, *words, **options):
    options = {"env": launch_environment(), "cwd": ROOT, "timeout": 130} | options
    done = subprocess.run(command(ranks, *words), capture_output=True, text=True, stdin=subprocess.DEVNULL, **options)
    return done.returncode, done.stdout, done.stderr


def study(ranks, *words):
    """Run the fake study to its end; without mpirun in this process where it can do no harm there."""
    if ranks or HARMFUL.intersection(words):
        return launch(ranks, SCRIPT, *words)
    return here(fake_run.main, *words)


def ended(ranks, *words, code=0):
    """What the fake study says of errors when it is run to an end with this exit code."""
    found, _, errors = study(ranks, *words)
    assert found == code, errors
    return errors


def softjaw(ranks, *words):
    """Run a command of the program to its end; without mpirun in this process."""
    return launch(ranks, "-m", "softjaw", *words) if ranks else here(main, *words)


def solve(ranks, scene, path, *words):
    """Run a scene into a file without an error, and without mpirun in silence; what was printed."""
    code, output, errors = softjaw(ranks, "run", scene, "-o", path, *words)
    assert code == 0, output + errors
    assert ranks or not errors
    return output


def answer(*words):
    """The JSON that a command prints, below what it says on its way."""
    code, output, errors = softjaw(0, *words, "--json")
    assert code == 0, errors
    return json.loads(output[output.index("{") :])


def here(program, *words):
    output, errors = io.StringIO(), io.StringIO()
    with redirect_stdout(output), redirect_stderr(errors):
        code = program([str(word) for word in words])
    return code, output.getvalue(), errors.getvalue()


def refusal(code, match=None):
    """That a `StudyError` with this exit code is raised, as by ``pytest.raises``."""
    return pytest.raises(StudyError, match=match, check=lambda error: error.code == code)


def start(ranks, *words):
    return begin(ranks, SCRIPT, *words)


def begin(ranks, *words):
    """Start a program and come back at once; a process group of its own, without ``timeout`` in between."""
    words = command(ranks, *words)
    words = words[words.index("mpirun") :] if ranks else words
    return subprocess.Popen(
        words, env=launch_environment(), cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip


def children_seconds():
    """CPU time of the processes that were started and have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def wait_for(condition, limit=60.0):
    deadline = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < deadline, "it took too long"
        time.sleep(0.02)


def states(path):
    with open_result(path) as result:
        return result.status.ravel()


def done(path):
    """How many cases are done; of a file that is not made yet none."""
    return int((states(path) == DONE).sum()) if path.exists() else 0


def contents(path):
    """Bytes of every dataset that must not depend on how the work was done."""
    found = {}

    def keep(name, node):
        if name == "study/checksums/rows":
            columns = json.loads(node.file["study/layout"][()])["stored"]
            sums = {f"{name}{path}": node[..., j] for j, path in enumerate(columns)}
            found.update({path: v.tobytes() for path, v in sums.items() if "/study/work/" not in path})
        elif isinstance(node, h5py.Dataset) and not name.startswith(NOT_COMPARED):
            found[name] = np.asarray(node[()]).tobytes()

    with h5py.File(path, "r") as file:
        file.visititems(keep)
    return found


def differing(path, expected):
    """Names of the datasets that are not, byte for byte, what was expected."""
    found = contents(path)
    return [name for name in sorted(found.keys() | expected.keys()) if found.get(name) != expected.get(name)]
