"""Completion scripts: what bash offers after some words, and that every shell gets every command."""

from __future__ import annotations

import subprocess

import pytest

from softjaw.study.cli import COMMANDS, SHELLS, main

pytestmark = pytest.mark.usefixtures("every_rank_speaks")

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


@pytest.mark.launches
@pytest.mark.parametrize(
    ("words", "offered"),
    [
        (["sh"], {"show"}),
        (["show", "--fo"], {"--force"}),
        (["show", "--force", "2", "a"], {"a.hdf"}),
        (["run", "sc"], {"scene.toml"}),
        (["export", "a.hdf", "--model", ""], {"ccm", "pcm", "pcm_projected"}),
        (["init", "c"], {"cup", "cylinder"}),
    ],
)
def test_bash_offers_what_fits(words, offered, tmp_path, capsys):
    assert main(["completion", "bash"]) == 0
    (tmp_path / "softjaw.bash").write_text(capsys.readouterr().out)
    (tmp_path / "tab.sh").write_text(TAB)
    for name in ("a.hdf", "scene.toml"):
        (tmp_path / name).touch()
    done = subprocess.run(["bash", "tab.sh", *words], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert set(done.stdout.splitlines()) == offered, done.stderr


@pytest.mark.parametrize("shell", SHELLS)
def test_every_shell_gets_every_command(shell, capsys):
    assert main(["completion", shell]) == 0
    text = capsys.readouterr().out
    assert all(name in text for group in COMMANDS.values() for name, *_ in group)
    assert "--retry-failed" in text or "-l retry-failed" in text
