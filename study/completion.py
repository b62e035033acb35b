"""``softjaw completion SHELL``: a static script by which a shell completes commands, options and file names."""

from __future__ import annotations

import argparse

SHELLS = ("bash", "zsh", "fish")
WHERE = {
    "bash": "softjaw completion bash > ~/.local/share/bash-completion/completions/softjaw",
    "zsh": "softjaw completion zsh > ~/.zfunc/_softjaw  # with fpath+=~/.zfunc before compinit",
    "fish": "softjaw completion fish > ~/.config/fish/completions/softjaw.fish",
}
ENDINGS = {"toml": ("SCENE",), "hdf": ("FILE",)}  # metavars of files that are read, by their ending


def add_options(parser: argparse.ArgumentParser) -> None:
    """Describe the words after ``softjaw completion``."""
    parser.add_argument("shell", choices=SHELLS, help="the shell that is to learn softjaw's words")
    lines = [f"  {line}" for line in WHERE.values()]
    parser.epilog = "\n".join([str(parser.epilog), "", "for every new shell:", *lines])


def script(parser: argparse.ArgumentParser, shell: str) -> str:
    """The script for a shell; files are completed by the ending that a command reads."""
    import shtab

    for made in _parsers(parser):
        for action in made._actions:
            if found := _files(action, made.prog.rpartition(" ")[2]):
                action.complete = found  # type: ignore[attr-defined]
    preamble = {"bash": "\n".join(_bash_function(ending) for ending in ENDINGS)}
    return shtab.complete(parser, shell, preamble=preamble)


def _parsers(parser: argparse.ArgumentParser) -> list[argparse.ArgumentParser]:
    commands = next(a for a in parser._actions if isinstance(a, argparse._SubParsersAction))
    return list(commands.choices.values())


def _files(action: argparse.Action, command: str) -> dict[str, str] | None:
    """How each shell completes the files that an argument may name; None where it names none."""
    metavar = action.metavar if isinstance(action.metavar, str) else ""
    reads = not action.option_strings and command != "patch"
    ending = next((ending for ending, metavars in ENDINGS.items() if reads and metavar in metavars), None)
    if ending:
        return {"bash": f"_softjaw_file_{ending}", "zsh": f"_files -g '*.{ending}'",
                "fish": f"(__fish_complete_suffix .{ending})"}  # fmt: skip
    if metavar in ("FILE", "HTML", "PNG", "PICTURE", "VTKHDF"):
        return {"bash": "_shtab_compgen_files", "zsh": "_files", "fish": "(__fish_complete_path (commandline -ct))"}
    return None


def _bash_function(ending: str) -> str:
    # shtab lets bash quote and end names as those of files where the function's name has "_file"
    return f'_softjaw_file_{ending}() {{ compgen -d -- "$1"; compgen -f -X \'!*.{ending}\' -- "$1"; }}'
