"""The live view: what it shows of a file that grows between its looks, when it ends, and with which exit code."""

import io

import h5py
import numpy as np
import pytest

from softjaw.study.cli import main
from softjaw.study.messages import OTHER_FILE
from softjaw.study.quantities import DONE, FAILED, MISSING
from softjaw.study.result.skeleton import UNFINISHED, report_bytes
from softjaw.study.show import watch as view
from softjaw.study.show.watch import INTERRUPTED, file_look, watch
from tests.study.formula_results import grid_axes, make, sealed

SIZE = 4 * 6 * 4  # cases of the file


class Run:
    """A run that solves some more cases whenever the watcher sleeps, and ends after the last of its steps."""

    def __init__(self, path, steps, monkeypatch, **about):
        self.path, self.steps, self.slept = path, list(steps), []
        make(path, axes=grid_axes(np.arange(4) * 0.01), status__code=MISSING, **about)
        monkeypatch.setattr(view, "holder", lambda _: "host node7, 8 ranks" if self.steps else "")

    def sleep(self, seconds):
        self.slept.append(seconds)
        count, state = self.steps.pop(0)
        with h5py.File(self.path, "r+") as file:
            codes = file["study/status/code"][()].ravel()
            first = int(np.flatnonzero(codes == MISSING)[0])
            codes[first : first + count] = state
            file["study/status/code"][...] = codes.reshape(4, 6, 4)
            messages = np.where(codes == FAILED, b"no contact at this force", b"")
            stored = file["study/status/message"]
            stored[...] = messages.reshape(4, 6, 4).astype(stored.dtype)
        sealed(self.path)


def watched(run, stream):
    return watch(file_look(run.path), 3.0, stream, run.sleep), stream.getvalue()


def test_a_round_is_another_file_with_more_cases_and_a_finished_run_ends_the_view_with_its_code(tmp_path, monkeypatch):
    path, steps = tmp_path / "a.hdf", [1]
    make(path, axes=grid_axes(np.arange(4) * 0.01))
    monkeypatch.setattr(view, "holder", lambda _: "host node7, 8 ranks" if steps else "")

    def grow(_):
        steps.clear()
        make(path, axes=grid_axes([0, 0.01, 0.015, 0.02, 0.03]), added=((15.0,),))

    stream = io.StringIO()
    assert watch(file_look(path), 3.0, stream, grow) == 0
    assert "96/96 done" in stream.getvalue()
    assert "120/120 done, round 1 of further grasps" in stream.getvalue()
    run = Run(tmp_path / "a.hdf", [(40, DONE), (0, DONE), (SIZE - 40, DONE)], monkeypatch)
    code, text = watched(run, io.StringIO())
    assert code == 0
    assert run.slept == [3.0] * 3
    lines = [line.partition("] ")[2] for line in text.splitlines() if line.startswith("[")]
    assert lines == ["0/96 done", "40/96 done", "96/96 done"]  # what has not changed is not told again
    assert "\x1b" not in text
    run = Run(tmp_path / "a.hdf", [(8, DONE)], monkeypatch)

    def interrupted(_):
        raise KeyboardInterrupt

    assert watch(file_look(run.path), 1.0, io.StringIO(), interrupted) == INTERRUPTED


BETWEEN_ROUNDS = {"report": report_bytes(UNFINISHED)}


@pytest.mark.parametrize(("last", "code", "about"), [
    ((8, FAILED), 6, {}), ((4, DONE), 75, {}), ((8, DONE), 75, BETWEEN_ROUNDS),
])  # fmt: skip
def test_failed_and_missing_cases_are_told_by_the_exit_code(tmp_path, monkeypatch, last, code, about):
    run = Run(tmp_path / "a.hdf", [(SIZE - 8, DONE), last], monkeypatch, **about)
    found, text = watched(run, io.StringIO())
    assert found == code
    assert ("8 x failed" in text) == (code == 6)


def test_a_terminal_is_drawn_over_itself(tmp_path, monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    run = Run(tmp_path / "a.hdf", [(48, DONE), (2, FAILED), (SIZE - 50, DONE)], monkeypatch)
    terminal = io.StringIO()
    terminal.isatty = lambda: True
    code, text = watched(run, terminal)
    assert code == 6
    first, begun, failing = text.split("a.hdf")[1:4]
    assert "payload" not in first
    assert "payload" in begun  # the best so far
    assert "no contact at this force" in failing
    assert "\x1b[1A\x1b[2K" in begun  # what was drawn is wiped
    assert main(["watch", "no.hdf"]) == OTHER_FILE
