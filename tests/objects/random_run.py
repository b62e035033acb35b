"""Solve random scenes one after the other in this process: ``python -m tests.objects.random_run SEED FOLDER K...``.

Every scene's outcome is written as soon as it is known. A scene that takes longer than its limit ends the process
wherever it is; the survey notes that and starts another one for the rest.
"""

from __future__ import annotations

import signal
import sys
import time
from pathlib import Path

from softjaw.study.scene import parse_scene
from softjaw.study.scene.text import toml_text
from tests.hard_cases.hard_case import outcome_of
from tests.objects.found import LOST, SOLVED, Found
from tests.objects.random_scenes import LIMIT, random_scene

STALLED = 10  # times as much time on the clock


def solved_scene(seed: int, k: int, folder: Path) -> Found:
    """What became of one scene, which is kept beside it as a file for `softjaw run`."""
    kind, tables = random_scene(seed, k)
    file = folder / f"{k:03d}.toml"
    text = toml_text(tables)
    file.write_text(text)
    start = time.process_time()
    found = Found(f"scene {k}", f"random {kind}")
    try:
        outcome = outcome_of(lambda: parse_scene(text, file))
    except Exception as error:  # a crash of the program is what is looked for
        found.refused = f"crash: {type(error).__name__}: {error}"
    else:
        found.refused = outcome.refused
        if not outcome.refused:
            lost = [i for i, done in enumerate(outcome.done) if not done]
            found.failures = [(f"{file.name}, {outcome.forces[i]:g} N", outcome.messages[i]) for i in lost[:1]]
            found.states = {LOST if lost else SOLVED: 1}
    found.seconds = time.process_time() - start
    return found


def main(words: list[str]) -> None:
    """Solve the scenes with these numbers."""
    seed, folder = int(words[0]), Path(words[1])
    for k in map(int, words[2:]):
        # the default action of both signals ends the process, also in the middle of compiled code
        signal.setitimer(signal.ITIMER_PROF, LIMIT)
        signal.setitimer(signal.ITIMER_REAL, STALLED * LIMIT)
        solved_scene(seed, k, folder).save(folder / f"{k:03d}.json")


if __name__ == "__main__":
    main(sys.argv[1:])
