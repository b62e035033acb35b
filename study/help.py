"""How the command line speaks: one screen of help in the order of use, and a suggestion for what was mistyped."""

from __future__ import annotations

import argparse
import difflib
import shutil
import textwrap
from collections.abc import Sequence
from typing import IO, Any

from softjaw.study.exits import MEANING
from softjaw.study.speaking import first_rank

GROUPS = (  # in the order of use; a command that stands nowhere is listed under the last title
    ("prepare", ("init", "check", "plan", "cost")),
    ("solve", ("run", "watch", "status", "scale")),
    ("look at results", ("show", "report", "view", "figure", "compare")),
    ("use the numbers", ("export", "patch")),
    ("this program", ("schema", "doctor", "completion")),
)


class Parser(argparse.ArgumentParser):
    """Speaks on the first rank only, whatever started the ranks, and suggests what an unknown word may have meant."""

    def _print_message(self, message: str, file: IO[str] | None = None) -> None:
        if first_rank():
            super()._print_message(message, file)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if isinstance(action, argparse._SubParsersAction) and value not in action.choices:
            self.error(f"'{value}' is no command{_meant(value, list(action.choices))} '{self.prog} --help' lists all")
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            text = f"found '{value}', expected {', '.join(known)}{_meant(str(value), known)}"
            raise argparse.ArgumentError(action, text.rstrip(";"))

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Refuse what is left over here, where the options that exist are known."""
        found, rest = super().parse_known_args(args, namespace)
        if rest:
            slip = next((word for word in rest if word.startswith("-")), rest[0])
            name = slip.partition("=")[0]
            kind = "option" if slip.startswith("-") else "word"
            known = list(self._option_string_actions) if kind == "option" else []
            self.error(f"unknown {kind} '{name}'{_meant(name, known)} '{self.prog} --help' lists all")
        return found, rest


class Formatter(argparse.HelpFormatter):
    """Breaks descriptions between words, and leaves examples as they are."""

    def _fill_text(self, text: str, width: int, indent: str) -> str:
        return text if "\n" in text else super()._fill_text(text, width, indent)


class Program(Parser):
    """The parser of the whole program: its help lists the commands by what they are for."""

    def format_help(self) -> str:
        """Commands by group, an example, exit codes."""
        listed = next(a for a in self._actions if isinstance(a, argparse._SubParsersAction))
        texts = {made.dest: made.help or "" for made in listed._choices_actions}
        width = min(shutil.get_terminal_size().columns, 100) - 2
        known = {name for _, names in GROUPS for name in names}
        lines = [f"usage: {self.prog} COMMAND ...", "", *textwrap.wrap(self.description or "", width)]
        for title, names in GROUPS:
            more = [name for name in texts if name not in known] if title == GROUPS[-1][0] else []
            lines += ["", f"{title}:"]
            lines += [_entry(name, texts[name], width) for name in [*names, *more] if name in texts]
        codes = "; ".join(f"{code} {text}" for code, text in MEANING.items())
        lines += ["", *textwrap.wrap(f"exit codes: {codes}", width, subsequent_indent="  "), "", self.epilog or ""]
        return "\n".join(lines) + "\n"


def _entry(name: str, text: str, width: int) -> str:
    first, rest = f"  {name:<12}", " " * 14
    return textwrap.fill(text, width, initial_indent=first, subsequent_indent=rest)


def _meant(word: str, known: Sequence[str]) -> str:
    """A suggestion, or only the punctuation where no word is alike.

    >>> _meant("shwo", ["show", "run"]), _meant("x", ["show", "run"])
    ("; did you mean 'show'?", ';')
    """
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"; did you mean '{near[0]}'?" if near else ";"
