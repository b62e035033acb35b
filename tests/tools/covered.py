"""Which test files run which line: a plugin of pytest, ``-p tests.tools.covered``; COVERED names the output (JSON).

Files that share a fixture of the session run its lines together, though the fixture is set up in one of them only.
"""

import json
import os
from collections import defaultdict
from pathlib import Path

import coverage
import pytest

ROOT = Path(__file__).parents[2]
FOLDERS = ("fem", "friction", "lsfit", "scoring", "study")
measuring = coverage.Coverage(data_file=None, config_file=False, source=[str(ROOT / folder) for folder in FOLDERS])
users: defaultdict[str, set[str]] = defaultdict(set)  # files by the fixture of the session that they use


def pytest_sessionstart() -> None:
    measuring.start()


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    file = item.nodeid.partition("::")[0]
    measuring.switch_context(file)
    for name, definitions in item._fixtureinfo.name2fixturedefs.items():
        if definitions[-1].scope == "session":
            users[name].add(file)


def pytest_sessionfinish() -> None:
    """Write the test files of every line of every file."""
    measuring.stop()
    partners: defaultdict[str, set[str]] = defaultdict(set)
    for files in users.values():
        for file in files:
            partners[file] |= files
    data = measuring.get_data()
    lines = {}
    for source in data.measured_files():
        name = str(Path(source).resolve().relative_to(ROOT))
        lines[name] = {
            line: sorted(set().union(*({context} | partners[context] for context in contexts if context)))
            for line, contexts in data.contexts_by_lineno(source).items()
        }
    Path(os.environ["COVERED"]).write_text(json.dumps(lines))
