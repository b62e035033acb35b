"""Words to options: every command with its options, one screen of help in the order of use, and suggestions."""

import argparse
import math
import shutil
import textwrap
from argparse import ArgumentTypeError
from collections.abc import Callable, Sequence
from typing import Any

from softjaw.study.messages import MEANING, USAGE, StudyError, closest, first_rank
from softjaw.study.quantities import LISTED, MODELS, RANKED_BY

MILLION = 10**6
KINDS = {
    "bottle": "a bottle of revolution, heights x angles x forces; rigid; uncomment wall_mm for a thin wall",
    "cup": "a thin-walled cup: dents, and the range of forces that hold it without spilling",
    "cylinder": "cylinders of several curvatures: what curvature costs, curved against planar contact model",
    "mesh": "your own triangle mesh; needs --mesh FILE and --unit",
}
FORMATS = {  # of export: what stands in the file
    "csv": "every case: maps, pads, contact frames, limit surfaces; SI units",
    "json": "the same, with units, meanings and the words of the flags",
    "isaac_grasp": "grasps for Isaac Sim and Isaac ROS (YAML)",
    "graspgen": "grasps as GraspGen keeps them (JSON), with all that is known; a folder of objects as a data set",
    "acronym": "a folder of objects as ACRONYM keeps them (HDF5)",
    "webdataset": "a folder of objects as shards for WebDataset (tar)",
    "moveit": "a list of moveit_msgs/Grasp for ROS 2 (YAML)",
    "mjcf": "a MuJoCo scene of one grasp that runs: object, fingers, gravity",
    "sdf": "a model of one grasp for Gazebo Classic with ODE (its object beside it, NAME-object.stl)",
    "physx": "a stage of one grasp for PhysX and Isaac Sim (USD, .usda)",
    "vtk": "maps on the object and all pads with their pressure, for ParaView (.vtm)",
}


def number(
    expected: str = "a number", least: float = -math.inf, most: float = math.inf, kind: type = float
) -> Callable[[str], Any]:
    """A type of finite numbers from ``least`` to ``most``; ``expected`` says what they are."""

    def value(text: str) -> Any:
        try:
            given = kind(text)
        except ValueError:
            given = math.nan
        if not (math.isfinite(given) and least <= given <= most):
            raise ArgumentTypeError(f"found {text}, expected {expected}")
        return given

    return value


POSITIVE = number("a number above 0", math.ulp(0.0))


def no_file(text: str) -> str:
    """A type of kinds to start from: in place of one a mesh is often given."""
    if "." in text:
        meant = f"of a mesh, with its unit: 'init mesh --mesh {text} --unit mm'"
        raise ArgumentTypeError(f"found '{text}', expected {', '.join(KINDS)}; {meant}")
    return text


def integer(least: int) -> Callable[[str], int]:
    """A type of whole numbers from ``least`` to a million."""
    return number(f"a whole number from {least} to {MILLION}", least, MILLION, int)


def several(
    kind: Callable[[str], Any], expected: str, least: int = 1, most: int = MILLION
) -> Callable[[str], tuple[Any, ...]]:
    """A type of ``least`` to ``most`` values of a kind with commas between them."""

    def parts(text: str) -> tuple[Any, ...]:
        try:
            given = tuple(map(kind, text.split(",")))
        except ArgumentTypeError:
            given = ()
        if not least <= len(given) <= most:
            raise ArgumentTypeError(f"found {text}, expected {expected}")
        return given

    return parts


def bound(text: str) -> tuple[str, float]:
    """A name and a number with an equals sign between them."""
    key, _, value = text.partition("=")
    return key, number("a map and a number, such as payload=200")(value)


def candidate(text: str) -> int:
    """Number of a candidate from its name in a list.

    >>> candidate("p07"), candidate("12")
    (7, 12)
    """
    return int(text.lstrip("ps"))


def refuse_unused(options: argparse.Namespace, *names: str, form: str = "") -> None:
    """Refuse those of these `OPTIONS` that were given: a ``form`` of export, or a folder, has no use for them."""
    meant = f"other formats than {form}" if form else f"one result file; '{options.file}' is a folder of objects"
    for (option, *_), settings in (OPTIONS[name] for name in names):
        if getattr(options, settings.get("dest", option[2:])) != settings.get("default"):
            raise StudyError(USAGE, f"{option}: is for {meant}")


def _option(*names: str, **settings: Any) -> tuple[tuple[str, ...], dict[str, Any]]:
    """Names of an option, and its settings in argparse's words; those of the same ``dest`` exclude each other."""
    return names, settings


NORMAL_FORCE = "normal force [N], solved or between two (default: the lowest that holds the object, else the largest)"
OPTIONS = {
    "scene": _option("scene", metavar="SCENE", help="scene file (TOML)"),
    "set": _option("--set", metavar="KEY=VALUE", action="append", default=[], dest="overrides",
                   help="replace one value of the scene, as in object.radius_mm=20; repeatable"),
    "objects": _option("--objects", metavar="MESHES", help="meshes in place of the scene's: 'm/*.stl', a folder, CSV"),
    "ranks": _option("-n", type=several(integer(1), "whole numbers, such as 16,64"), default=(1,), dest="ranks",
                     metavar="RANKS", help="ranks (default 1), or several: the time on each"),
    "result": _option("-o", metavar="FILE", dest="output", help="result file (default: results/<scene>.hdf)"),
    "retry": _option("--retry-failed", action="store_true", help="repeat failed cases"),
    "file": _option("file", metavar="FILE", help="result file (.hdf)"),
    "results": _option("file", metavar="FILE", help="result file (.hdf), or a folder of results"),
    "files": _option("files", metavar="FILE", nargs=2, help="two result files"),
    "every": _option("--every", type=number("at least 0.1 s", 0.1), default=2.0, metavar="S",
                     help="seconds between updates (default 2)"),
    "json": _option("--json", action="store_const", const="json", dest="form", help="as JSON, SI units"),
    "csv": _option("--csv", action="store_const", const="csv", dest="form", help="as CSV, SI units"),
    "format": _option("--format", choices=tuple(FORMATS), dest="form", metavar="FORMAT", help="one of those below"),
    "force": _option("--force", type=POSITIVE, metavar="N", help=NORMAL_FORCE),
    "level": _option("--force", type=number(), metavar="N", help="force level nearest to N [N]"),
    "by": _option("--by", choices=RANKED_BY, help="what ranks grasps; force: the least that holds (default payload)"),
    "top": _option("--top", type=integer(0), metavar="K", help=f"how many rows, 0: all (default {LISTED})"),
    "most": _option("--top", type=integer(0), metavar="K",
                    help="how many grasps, 0: all (default: 1 for a simulator, which gets a file for each, else all)"),
    "compared": _option("--quantity", default="e_n", metavar="NAME", help="map that is listed by case (default e_n)"),
    "model": _option("--model", choices=MODELS, default="ccm", help="friction model (default ccm)"),
    "candidate": _option("--candidate", type=candidate, metavar="N", help="candidate by its number or name, as p07"),
    "at": _option("--at", type=several(number(), "a station, or station,angle as in 75,90", 1, 2), default=(),
                  metavar="MM,DEG", help="candidate nearest to this station and angle; --at=-5 for negative numbers"),
    "page": _option("-o", metavar="HTML", dest="output", help="page to write (default: beside the file)"),
    "quantity": _option("--quantity", metavar="NAME", help="map on the object (default: payload)"),
    "motion": _option("--motion", choices=("x", "y", "turn"), default="x",
                      help="slip that friction is drawn for (default: along x of the contact)"),
    "screenshot": _option("--screenshot", metavar="PNG", help="write a picture; needs no screen"),
    "html": _option("--html", metavar="HTML", help="page to write, which needs nothing else (default: FILE-3d.html)"),
    "min": _option("--min", type=bound, metavar="NAME=VALUE", action="append", default=[], dest="least",
                   help="leave out grasps with less, in the unit of 'softjaw show', as payload=200; repeatable"),
    "written": _option("-o", metavar="FILE", dest="output", help="file to write (default: standard output)"),
    "approach": _option("--approach", choices=("x", "minus-x", "y", "minus-y"), action="append", dest="approaches",
                        help="palm to fingertips, by the long (x) or short (y) side of pad 1 (default: the clearest)"),
    "gripper": _option("--gripper", metavar="NAME", help="franka_hand, robotiq_2f85, schunk_egp50, wsg50, or a file"),
    "wider": _option("--wider", type=number("a number, 0 or above", 0.0), default=20.0, metavar="MM",
                     help="how far the gripper opens beyond first touch (default 20)"),
    "frame": _option("--frame", default="object", metavar="NAME",
                     help="name of the object's frame, for isaac_grasp and moveit (default object)"),
    "kind": _option("kind", type=no_file, choices=tuple(KINDS), help="what to start from"),
    "name": _option("-o", metavar="NAME", dest="name", help="name of both files (default: the kind, or the mesh's)"),
    "mesh": _option("--mesh", metavar="FILE", help="mesh of the object: .stl, .obj, .ply, .off, .glb, .gltf or .3mf"),
    "mesh unit": _option("--unit", choices=("mm", "cm", "m", "inch"), help="unit of the mesh (default of glTF: m)"),
    "axis": _option("--axis", choices=("x", "y", "z"), help="axis along which grasps lie (default: the longest)"),
    "replace": _option("--force", action="store_true", help="replace existing files"),
    "field": _option("file", metavar="FILE", help="pressures as CSV, VTU or VTP; columns: docs/pressure-fields.md"),
    "pad": _option("scene", metavar="SCENE", nargs="?", help="with --deformed: scene file (TOML), whose pad is solved"),
    "deformed": _option("--deformed", action="store_true",
                        help="FILE holds points of the pad's deformed face (CSV with x, y, z), or of a contour (y, z)"),
    "mu": _option("--mu", type=POSITIVE, help="friction coefficient (default 0.8; with --deformed that of the scene)"),
    "side": _option("--long-side", type=several(number(), "three numbers, such as 1,0,0", 3, 3), metavar="X,Y,Z",
                    help="the contact frame's x axis, as --long-side=-1,0,0 (default: the patch's longer direction)"),
    "unit": _option("--unit", choices=("m", "cm", "mm"), help="unit of lengths and areas, where the file gives none"),
    "pressure unit": _option("--pressure-unit", choices=("pa", "kpa", "mpa"), help="unit of the pressure, likewise"),
    "pressure": _option("--pressure-name", metavar="NAME", help="column or array of the pressure (default: pressure)"),
    "flip": _option("--flip-normals", action="store_true", help="turn all normals; they point into the object"),
    "other": _option("--other", metavar="FILE", help="the other contact of the grasp, in the same coordinates"),
    "distance": _option("--distance", type=POSITIVE, metavar="MM", help="distance of two such contacts, face to face"),
    "arms": _option("--object-length", type=POSITIVE, metavar="MM",
                    help="divides torques of forces (default: the distance)"),
    "torques": _option("--contact-length", type=POSITIVE, metavar="MM",
                       help="divides torques about normals (default: rho)"),
    "surface": _option("--surface", choices=("three_motions", "axis_aligned", "full", "quartic"),
                       default="three_motions",
                       help="limit surface that is scored (default: three_motions, as a study's quality)"),
    "outlines": _option("-o", metavar="PICTURE", dest="picture", help="picture of the limit surface (.png or .svg)"),
}  # fmt: skip
GRIPPER = ("gripper", "approach", "wider", "frame")
COMMANDS = {  # by what they are for, in the order of use: name, what it does, an example, its module, its options
    "prepare": (
        ("init", "write a commented scene and a batch script to start from", "init bottle", "cli.quick",
         ("kind", "name", "mesh", "mesh unit", "axis", "gripper", "replace")),
        ("check", "find every error of a scene, or say what would be run", "check jobs/bottle-rigid.toml", "cli.quick",
         ("scene", "set", "objects")),
        ("plan", "cases, disk, memory and time, by a few grasps that are solved", "plan jobs/bottle-rigid.toml -n 16",
         "cli.quick", ("scene", "set", "objects", "ranks", "result")),
        ("cost", "what accuracy costs in time: errors and seconds on several meshes",
         "cost jobs/bottle-rigid.toml -o results/bottle-rigid-cost.hdf", "cli.running", ("scene", "set", "result")),
    ),
    "solve": (
        ("run", "solve a scene into a result file; run again to resume",
         "run jobs/smoke.toml -o results/smoke.hdf -- -contact_snes_monitor", "cli.running",
         ("scene", "set", "objects", "result", "retry")),
        ("watch", "live view of a run, in another terminal; Ctrl-C ends the view alone",
         "watch results/bottle-rigid.hdf --every 5", "cli.results", ("results", "every")),
        ("status", "what a result file holds so far, also while it grows", "status results/bottle-rigid.hdf",
         "show.status", ("results", "json", "csv")),
    ),
    "look at results": (
        ("show", "the best grasps as a table", "show results/bottle-rigid.hdf --force 4 --top 3 --json",
         "cli.results", ("results", "json", "csv", "force", "by", "top")),
        ("report", "one self-contained page: maps, definitions, provenance",
         "report results/bottle-rigid.hdf -o results/bottle-rigid.html", "cli.results",
         ("results", "candidate", "at", "page")),
        ("view", "the map on the object in 3-D: page, picture",
         "view results/bottle-rigid.hdf --force 4 --screenshot view.png", "cli.results",
         ("file", "candidate", "at", "level", "quantity", "motion", "screenshot", "html")),
        ("compare", "two maps side by side: settings and cases that differ",
         "compare results/soft.hdf results/stiff.hdf --quantity e_n", "cli.results",
         ("files", "json", "csv", "compared", "top", "model")),
    ),
    "use the numbers": (
        ("export", "grasps and their friction for planners and simulators",
         "export results/smoke.hdf --format mjcf -o results/smoke.xml", "cli.exporting",
         ("results", "json", "csv", "format", "force", "by", "model", "most", "min", "written", *GRIPPER)),
        ("patch", "judge a pressure field from elsewhere: friction, score",
         "patch jobs/cylinder-pressure.csv --mu 0.8 --distance 60", "patch.answer_text",
         ("field", "pad", "deformed", "mu", "side", "unit", "pressure unit", "pressure", "flip", "other", "distance",
          "arms", "torques", "surface", "outlines", "json")),
    ),
    "this program": (
        ("schema", "JSON schema of a scene, for editors", "schema > scene.schema.json", "cli.quick", ()),
        ("doctor", "check that this machine has what softjaw needs", "doctor", "doctor", ()),
    ),
}  # fmt: skip
LISTS = {"init": ("kinds", KINDS), "export": ("formats", FORMATS)}  # below the help of a command


class Parser(argparse.ArgumentParser):
    """Speaks on the first rank only, whatever started the ranks, and suggests what an unknown word may have meant."""

    def _print_message(self, message: str, file: Any = None) -> None:
        # Ranks that parse the same wrong words would all print the same help.
        if first_rank():
            super()._print_message(message, file)

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if isinstance(action, argparse._SubParsersAction) and value not in action.choices:
            meant = _meant(value, list(action.choices))
            self.error(f"unknown command '{value}'{meant} '{self.prog} --help' lists all")
        if action.choices is not None and value not in action.choices:
            known = [str(choice) for choice in action.choices]
            text = f"found '{value}', expected {', '.join(known)}{_meant(str(value), known)}"
            raise argparse.ArgumentError(action, text.rstrip(";"))

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """Refuse what is left over here, where the options that exist are known."""
        parsed, rest = super().parse_known_args(args, namespace)
        if rest:
            # A mistyped option leaves its value over as well: the option is the one to name.
            slip = next((word for word in rest if word.startswith("-")), rest[0])
            name = slip.partition("=")[0]
            kind = "option" if slip.startswith("-") else "word"
            known = list(self._option_string_actions) if kind == "option" else []
            ranks = " 'mpirun -n 2 softjaw ...' starts two ranks;" * (name in ("-n", "-np"))
            self.error(f"unknown {kind} '{name}'{_meant(name, known)}{ranks} '{self.prog} --help' lists all")
        return parsed, rest


def _meant(word: str, known: Sequence[str]) -> str:
    """A suggestion, or only the punctuation where no word is alike.

    >>> _meant("shwo", ["show", "run"]), _meant("x", ["show", "run"])
    ("; did you mean 'show'?", ';')
    """
    near = closest(word, known)
    return f"; did you mean '{near}'?" if near else ";"


class Program(Parser):
    """The parser of the whole program: its help lists the commands by what they are for."""

    def format_help(self) -> str:
        """Commands by group, an example, exit codes."""
        # Lines beyond 100 characters are hard to read on wide terminals.
        width = min(shutil.get_terminal_size().columns, 100) - 2
        lines = [f"usage: {self.prog} COMMAND ...", "", *textwrap.wrap(self.description or "", width)]
        for title, listed in COMMANDS.items():
            lines += ["", f"{title}:"]
            for name, text, *_ in listed:
                lines.append(textwrap.fill(text, width, initial_indent=f"  {name:<12}", subsequent_indent=" " * 14))
        codes = "; ".join(f"{code} {text}" for code, text in MEANING.items())
        lines += ["", *textwrap.wrap(f"exit codes: {codes}", width, subsequent_indent="  "), "", self.epilog or ""]
        return "\n".join(lines) + "\n"


def program() -> Program:
    """The parser of the whole command line."""
    parser = Program(
        prog="softjaw",
        description="How well a gripper with soft jaws holds an object, place by place; see 'softjaw COMMAND --help'.",
        epilog="example:\n  mpirun -n 8 softjaw run jobs/bottle-rigid.toml",
    )
    listed = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    for name, text, example, module, options in (command for group in COMMANDS.values() for command in group):
        parts = [f"example:\n  {'mpirun -n 8 ' * (name == 'run')}softjaw {example}"]
        for title, entries in [LISTS[name]] if name in LISTS else []:
            parts.append("\n".join([f"{title}:", *(f"  {entry:<12} {what}" for entry, what in entries.items())]))
        made = listed.add_parser(name, help=text, description=f"{text[0].upper()}{text[1:]}.",
                                 epilog="\n\n".join(parts),
                                 formatter_class=argparse.RawDescriptionHelpFormatter)  # fmt: skip
        made.set_defaults(command=name, module=module)
        _add_options(made, options)
    return parser


def _add_options(parser: argparse.ArgumentParser, options: Sequence[str]) -> None:
    """Give a command its options of `OPTIONS`, in this order."""
    form = gripper = None
    for option in options:
        names, settings = OPTIONS[option]
        place: Any = parser
        if settings.get("dest") == "form":
            place = form = form or parser.add_mutually_exclusive_group(required="format" in options)
        elif option in GRIPPER:
            title = "the gripper, for planners and data sets (--gripper also for simulators)"
            place = gripper = gripper or parser.add_argument_group(title)
        place.add_argument(*names, **settings)
