"""Completion scripts: what bash offers after some words, and that every shell gets every command."""

from __future__ import annotations

import subprocess

import pytest

from softjaw.study.cli import main, program
from softjaw.study.completion import SHELLS, script

# What bash does at the tab key, without a terminal.
TAB = """
source ./softjaw.bash
COMP_WORDS=(softjaw "$@")
COMP_CWORD=$(( ${#COMP_WORDS[@]} - 1 ))
COMP_LINE="${COMP_WORDS[*]}"
function_of_softjaw=$(complete -p softjaw | sed 's/.*-F \\([^ ]*\\) .*/\\1/')
$function_of_softjaw softjaw 2> /dev/null
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where someone works, with the script for bash."""
    path = tmp_path_factory.mktemp("completion")
    (path / "softjaw.bash").write_text(script(program(), "bash"))
    (path / "tab.sh").write_text(TAB)
    (path / "old").mkdir()
    for name in ("a.hdf", "my map.hdf", "scene.toml", "page.html"):
        (path / name).touch()
    return path


@pytest.mark.launches
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["sh"], ["show"]),
        (["show", "--"], ["--help", "--force", "--top", "--json", "--csv"]),
        (["show", "--fo"], ["--force"]),
        (["show", ""], ["old", "a.hdf", "my map.hdf"]),
        (["show", "--force", "2", "a"], ["a.hdf"]),
        (["compare", "a.hdf", "m"], ["my map.hdf"]),
        (["run", ""], ["old", "scene.toml"]),
        (["export", "a.hdf", "--model", ""], ["curved", "flat", "projected"]),
        (["init", "c"], ["cup", "cylinder"]),
        (["completion", ""], list(SHELLS)),
    ],
)
def test_bash_offers_what_fits(folder, words, offered):
    done = subprocess.run(["bash", "tab.sh", *words], cwd=folder, capture_output=True, text=True, check=False)
    found = done.stdout.splitlines()
    assert sorted(name for name in found if name != "-h") == sorted(offered), done.stderr


@pytest.mark.parametrize("shell", SHELLS)
@pytest.mark.usefixtures("every_rank_speaks")
def test_every_shell_gets_every_command(shell, capsys):
    assert main(["completion", shell]) == 0
    text = capsys.readouterr().out
    commands = next(action for action in program()._actions if action.choices)
    assert len(commands.choices) > 15
    assert all(name in text for name in commands.choices)
    assert "--retry-failed" in text or "-l retry-failed" in text


def test_another_shell_is_bad_usage(capsys):
    assert main(["completion", "bsh"]) == 2
