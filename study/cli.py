"""The command line: words to options, and errors to exit codes."""

from __future__ import annotations

import argparse
import errno
import math
import os
import sys
import traceback
from collections.abc import Sequence
from typing import Any

from softjaw.study import commands
from softjaw.study.accuracy.cost.command import add_options as add_cost_options
from softjaw.study.completion import add_options as add_completion_options
from softjaw.study.environment import keep_compiled_loops, pin_threads
from softjaw.study.exits import BUG, CANNOT_WRITE, DONE, USAGE, StudyError
from softjaw.study.file_options import add_scale_options
from softjaw.study.help import Formatter, Parser, Program
from softjaw.study.patch.command import add_options as add_patch_options
from softjaw.study.run.memory import is_out_of_memory, no_room
from softjaw.study.scene.start import add_options as add_init_options
from softjaw.study.show.figures.command import add_options as add_figure_options
from softjaw.study.show.tables.watch import add_options as add_watch_options
from softjaw.study.show.view.command import add_choice
from softjaw.study.show.view.command import add_options as add_view_options
from softjaw.study.speaking import complain

UNWRITABLE = {errno.EPIPE, errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO}  # what standard output can answer


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; the exit code is the same on every rank."""
    pin_threads()
    keep_compiled_loops()
    words = list(sys.argv[1:] if arguments is None else arguments)
    cut = words.index("--") if "--" in words else len(words)
    parser = program()
    if not words:
        parser.print_help()
        return USAGE
    try:
        options = parser.parse_args(words[:cut])
    except SystemExit as leave:
        return int(leave.code or 0)
    options.petsc = words[cut + 1 :]
    try:
        if options.petsc and options.command is not commands.run:
            raise StudyError(USAGE, "only 'run' takes PETSc options after '--'")
        code = options.command(options)
        sys.stdout.flush()
        return code
    except StudyError as error:
        return complain(error)
    except OSError as error:
        if error.errno not in UNWRITABLE or error.filename:
            return _unforeseen(options, error)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or the interpreter tries again as it ends
        if error.errno == errno.EPIPE:  # the reader of a pipe has seen enough
            return DONE
        return complain(StudyError(CANNOT_WRITE, f"the output cannot be written ({error.strerror})"))
    except Exception as error:
        return _unforeseen(options, error)


def _unforeseen(options: argparse.Namespace, error: Exception) -> int:
    """The exit code of an error that no command expects: too little memory, a damaged file, or a bug."""
    if is_out_of_memory(error):
        return complain(StudyError(USAGE, no_room(str(error) or type(error).__name__)))
    if damage := commands.damage(options, error):
        return complain(damage)
    traceback.print_exc()
    return BUG


def program() -> Program:
    """The parser of the whole command line."""
    parser = Program(
        prog="softjaw",
        description="How well a two-finger gripper with soft jaws holds an object, place by place. "
        "'softjaw COMMAND --help' explains a command and shows an example.",
        epilog="example:\n  mpirun -n 8 softjaw run jobs/bottle-rigid.toml",
    )
    listed = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)

    def add(name: str, command: Any, text: str, example: str) -> argparse.ArgumentParser:
        made = listed.add_parser(
            name, help=text, description=f"{text[0].upper()}{text[1:]}.", epilog=f"example:\n  {example}",
            formatter_class=Formatter,
        )  # fmt: skip
        made.set_defaults(command=command)
        return made

    add_init_options(add("init", commands.init, "write a commented scene and a batch script to start from",
                         "softjaw init bottle"))  # fmt: skip
    check = add("check", commands.check, "find every error of a scene, or say what would be run",
                "softjaw check jobs/bottle-rigid.toml")  # fmt: skip
    plan = add("plan", commands.plan, "cases, units, disk, memory and time, before anything is spent",
               "softjaw plan jobs/bottle-rigid.toml -n 16")  # fmt: skip
    run = add("run", commands.run, "solve a scene into a result file; again: go on where it was",
              "mpirun -n 8 softjaw run jobs/smoke.toml -o results/smoke.hdf -- -contact_snes_monitor")  # fmt: skip
    for made in (check, plan, run):
        made.add_argument("scene", metavar="SCENE", help="scene file (TOML)")
        made.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], dest="overrides",
                          help="replace one value of the scene, as in object.radius_mm=20; repeatable")  # fmt: skip
    plan.add_argument("-n", type=_positive, default=1, metavar="RANKS", dest="ranks", help="ranks (default 1)")
    for made in (plan, run):
        made.add_argument("-o", metavar="FILE", dest="output", help="result file (default: results/<scene>.hdf)")
    run.add_argument("--retry-failed", action="store_true", help="solve failed cases again")
    status = add("status", commands.status, "what a result file holds so far, also while it grows",
                 "softjaw status results/bottle-rigid.hdf")  # fmt: skip
    add_watch_options(add("watch", commands.watch, "live view of a run, in another terminal",
                          "softjaw watch results/bottle-rigid.hdf --every 5"))  # fmt: skip
    add_scale_options(add("scale", commands.scale, "replay the times of a finished file on many ranks",
                          "softjaw scale results/bottle-rigid.hdf -n 64,256,1024 --repeat 10"))  # fmt: skip
    show = add("show", commands.show, "the best grasps as a table",
               "softjaw show results/bottle-rigid.hdf --force 4 --top 3 --json")  # fmt: skip
    report = add("report", commands.report, "one self-contained page: maps, definitions, provenance",
                 "softjaw report results/bottle-rigid.hdf -o results/bottle-rigid.html")  # fmt: skip
    for made in (status, show, report):
        made.add_argument("file", metavar="FILE", help="result file (.hdf)")
    show.add_argument("--force", type=_force, metavar="N", help="force level nearest to N [N] (default: the highest, "
                      "or the highest that some grasp holds and its wall bears)")  # fmt: skip
    show.add_argument("--top", type=_count, default=10, metavar="K", help="how many grasps, 0: all (default 10)")
    compare = add("compare", commands.compare, "two maps side by side: settings and cases that differ",
                  "softjaw compare results/soft.hdf results/stiff.hdf --quantity e_n")  # fmt: skip
    compare.add_argument("files", metavar="FILE", nargs=2, help="result files (.hdf): a and b")
    compare.add_argument("--quantity", default="e_n", metavar="NAME", help="map that is listed by case (default e_n)")
    compare.add_argument("--top", type=_count, default=10, metavar="K", help="largest differences, 0: all (default 10)")
    export = add("export", commands.export, "every case for planners: maps, frames, limit surfaces",
                 "softjaw export results/smoke.hdf --csv -o results/smoke.csv")  # fmt: skip
    export.add_argument("file", metavar="FILE", help="result file (.hdf)")
    export.add_argument("-o", metavar="FILE", dest="output", help="file to write (default: standard output)")
    for made in (compare, export):
        made.add_argument("--model", choices=("curved", "flat", "projected"), default="curved",
                          help="friction model (default curved)")  # fmt: skip
    for made in (status, show, compare, export):
        form = made.add_mutually_exclusive_group(required=made is export)
        form.add_argument("--json", action="store_const", const="json", dest="form", help="as JSON, SI units")
        form.add_argument("--csv", action="store_const", const="csv", dest="form", help="as CSV, SI units")
    add_choice(report)
    report.add_argument("-o", metavar="HTML", dest="output", help="page to write (default: beside the file)")
    add_patch_options(add("patch", commands.patch, "judge a pressure field from elsewhere: friction, score",
                          "softjaw patch jobs/cylinder-pressure.csv --mu 0.8 --distance 60"))  # fmt: skip
    add_view_options(add("view", commands.view, "the map on the object in 3-D: window, page, picture",
                         "softjaw view results/bottle-rigid.hdf --force 4 --screenshot view.png"))  # fmt: skip
    add_figure_options(add("figure", commands.figure, "a figure of the paper, from its scene to the picture",
                           "softjaw figure 4c"))  # fmt: skip
    add_completion_options(add("completion", commands.completion, "a script by which the shell completes words",
                               "softjaw completion bash > softjaw.bash"))  # fmt: skip
    add_cost_options(add("cost", commands.cost, "what accuracy costs in time: errors and seconds of every setting",
                         "softjaw cost jobs/bottle-rigid.toml -o results/bottle-rigid-cost.hdf"))  # fmt: skip
    add("schema", commands.schema, "JSON schema of a scene, for editors", "softjaw schema > scene.schema.json")
    add("doctor", commands.doctor, "does this machine have what softjaw needs", "softjaw doctor")
    return parser


def _positive(text: str) -> int:
    if (value := int(text)) < 1:
        raise argparse.ArgumentTypeError(f"found {text}, expected at least 1")
    return value


def _force(text: str) -> float:
    if not 0 < (value := float(text)) < math.inf:
        raise argparse.ArgumentTypeError(f"found {text}, expected a force > 0 in N")
    return value


def _count(text: str) -> int:
    if (value := int(text)) < 0:
        raise argparse.ArgumentTypeError(f"found {text}, expected 0 or more")
    return value
