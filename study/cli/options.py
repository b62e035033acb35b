"""Words to options: every command with its options, one screen of help in the order of use, and suggestions."""

from __future__ import annotations

import argparse
import difflib
import shutil
import textwrap
from collections.abc import Sequence
from typing import Any

from softjaw.study.cli import values
from softjaw.study.messages import MEANING, first_rank
from softjaw.study.quantities import RANKED_BY

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
    "graspgen": "grasps as GraspGen keeps them (JSON), with all that is known",
    "moveit": "a list of moveit_msgs/Grasp for ROS 2 (YAML)",
    "mjcf": "a MuJoCo scene of one grasp, with the friction of each finger",
    "sdf": "the fingers of one grasp for Gazebo Classic with ODE",
    "physx": "the fingers of one grasp for PhysX and Isaac Sim (USD, .usda)",
    "vtk": "maps on the object and all pads with their pressure, for ParaView (.vtm)",
}
NO_DRAKE = (
    "Drake has no parameter for it: its point contact has no torsional friction, and its hydroelastic contact finds a"
    " pressure field, and with it e_n, of its own; expected"
)
APPROACHES = ("x", "minus-x", "y", "minus-y")
SURFACES = ("three_motions", "axis_aligned", "full", "quartic")
COMMANDS = {  # by what they are for, in the order of use: name, what it does, an example of its words, its module
    "prepare": (
        ("init", "write a commented scene and a batch script to start from", "init bottle", "cli.quick"),
        ("check", "find every error of a scene, or say what would be run", "check jobs/bottle-rigid.toml", "cli.quick"),
        ("plan", "cases, units, disk, memory and time, before anything is spent", "plan jobs/bottle-rigid.toml -n 16",
         "cli.quick"),
        ("cost", "what accuracy costs in time: errors and seconds on several meshes",
         "cost jobs/bottle-rigid.toml -o results/bottle-rigid-cost.hdf", "cli.running"),
    ),
    "solve": (
        ("run", "solve a scene into a result file; run again to resume",
         "run jobs/smoke.toml -o results/smoke.hdf -- -contact_snes_monitor", "cli.running"),
        ("watch", "live view of a run, in another terminal", "watch results/bottle-rigid.hdf --every 5", "cli.results"),
        ("status", "what a result file holds so far, also while it grows", "status results/bottle-rigid.hdf",
         "show.status"),
    ),
    "look at results": (
        ("show", "the best grasps as a table", "show results/bottle-rigid.hdf --force 4 --top 3 --json",
         "cli.results"),
        ("report", "one self-contained page: maps, definitions, provenance",
         "report results/bottle-rigid.hdf -o results/bottle-rigid.html", "cli.drawings"),
        ("view", "the map on the object in 3-D: window, page, picture",
         "view results/bottle-rigid.hdf --force 4 --screenshot view.png", "cli.drawings"),
        ("compare", "two maps side by side: settings and cases that differ",
         "compare results/soft.hdf results/stiff.hdf --quantity e_n", "cli.results"),
    ),
    "use the numbers": (
        ("export", "grasps and their friction for planners and simulators",
         "export results/smoke.hdf --format mjcf -o results/smoke.xml", "cli.exporting"),
        ("patch", "judge a pressure field from elsewhere: friction, score",
         "patch jobs/cylinder-pressure.csv --mu 0.8 --distance 60", "patch.answer_text"),
    ),
    "this program": (
        ("schema", "JSON schema of a scene, for editors", "schema > scene.schema.json", "cli.quick"),
        ("doctor", "check that this machine has what softjaw needs", "doctor", "doctor"),
    ),
}  # fmt: skip


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
            self.error(f"unknown {kind} '{name}'{_meant(name, known)} '{self.prog} --help' lists all")
        return parsed, rest


def _meant(word: str, known: Sequence[str]) -> str:
    """A suggestion, or only the punctuation where no word is alike.

    >>> _meant("shwo", ["show", "run"]), _meant("x", ["show", "run"])
    ("; did you mean 'show'?", ';')
    """
    near = difflib.get_close_matches(word, known, n=1, cutoff=0.5)
    return f"; did you mean '{near[0]}'?" if near else ";"


class Program(Parser):
    """The parser of the whole program: its help lists the commands by what they are for."""

    def format_help(self) -> str:
        """Commands by group, an example, exit codes."""
        # Lines beyond 100 characters are hard to read on wide terminals.
        width = min(shutil.get_terminal_size().columns, 100) - 2
        lines = [f"usage: {self.prog} COMMAND ...", "", *textwrap.wrap(self.description or "", width)]
        for title, listed in COMMANDS.items():
            entries = [
                textwrap.fill(text, width, initial_indent=f"  {name:<12}", subsequent_indent=" " * 14)
                for name, text, *_ in listed
            ]
            lines += ["", f"{title}:", *entries]
        codes = "; ".join(f"{code} {text}" for code, text in MEANING.items())
        lines += ["", *textwrap.wrap(f"exit codes: {codes}", width, subsequent_indent="  "), "", self.epilog or ""]
        return "\n".join(lines) + "\n"


def program() -> Program:
    """The parser of the whole command line."""
    parser = Program(
        prog="softjaw",
        description="How well a two-finger gripper with soft jaws holds an object, place by place. "
        "'softjaw COMMAND --help' explains a command and shows an example.",
        epilog="example:\n  mpirun -n 8 softjaw run jobs/bottle-rigid.toml",
    )
    listed = parser.add_subparsers(metavar="COMMAND", required=True, parser_class=Parser)
    made = {}
    for name, text, example, module in (command for group in COMMANDS.values() for command in group):
        ranks = "mpirun -n 8 " if name == "run" else ""
        made[name] = listed.add_parser(
            name, help=text, description=f"{text[0].upper()}{text[1:]}.",
            epilog=f"example:\n  {ranks}softjaw {example}", formatter_class=argparse.RawDescriptionHelpFormatter,
        )  # fmt: skip
        made[name].set_defaults(command=name, module=module)
    for name, add_options in (("init", _add_init_options), ("watch", _add_watch_options),
                              ("view", _add_view_options),
                              ("patch", _add_patch_options)):  # fmt: skip
        add_options(made[name])
    _add_scene_options(made)
    _add_result_options(made)
    return parser


def _add_watch_options(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("file", metavar="FILE", help="result file (.hdf)")
    parser.add_argument(
        "--every", type=values.seconds, default=2.0, metavar="S", help="seconds between updates (default 2)"
    )
    ending = "Ends with the run, and with its exit code: 0, 6 where cases failed, 75 where some are not computed."
    parser.description = textwrap.fill(f"{parser.description} {ending} Ctrl-C ends the view, not the run.", 78)


def _add_init_options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    kinds = "kinds:\n" + "\n".join(f"  {name:<9} {text}" for name, text in KINDS.items())
    add("kind", choices=tuple(KINDS), help="what to start from")
    add("-o", metavar="NAME", dest="name", help="name of both files, also with a folder (default: the kind, or the "
        "name of the mesh)")  # fmt: skip
    add("--mesh", metavar="FILE", help="mesh of the object: .stl, .obj, .ply, .off, .glb, .gltf or .3mf")
    add("--unit", choices=("mm", "cm", "m", "inch"), help="unit of the mesh's coordinates (default of glTF: m)")
    add("--axis", choices=("x", "y", "z"), help="axis of the mesh along which grasps are spread (default: the longest)")
    add("--force", action="store_true", help="replace existing files")
    more = "softjaw init mesh --mesh jobs/objects/flask.stl --unit mm -o scenes/flask"
    parser.epilog = f"{parser.epilog}\n  {more}\n\n{kinds}"


def _add_scene_options(made: dict[str, Any]) -> None:
    """What the commands take that read a scene."""
    for parser in (made["check"], made["plan"], made["cost"], made["run"]):
        parser.add_argument("scene", metavar="SCENE", help="scene file (TOML)")
        parser.add_argument("--set", metavar="KEY=VALUE", action="append", default=[], dest="overrides",
                            help="replace one value of the scene, as in object.radius_mm=20; repeatable")  # fmt: skip
    add = made["plan"].add_argument
    add("-n", type=values.counts, default=(1,), metavar="RANKS", dest="ranks", help="ranks (default 1); several, as in "
        "16,64,256, replay the times of a finished study on each")  # fmt: skip
    add("--repeat", type=values.whole(1), default=1, metavar="K", help="replay a study of K times as many candidates")
    for parser in (made["plan"], made["cost"], made["run"]):
        parser.add_argument("-o", metavar="FILE", dest="output", help="result file (default: results/<scene>.hdf, "
                            "of cost results/<scene>-cost.hdf)")  # fmt: skip
    made["run"].add_argument("--retry-failed", action="store_true", help="solve failed cases again")


def _add_result_options(made: dict[str, Any]) -> None:
    """What the commands take that look at result files."""
    for name in ("status", "show", "report", "export"):
        made[name].add_argument("file", metavar="FILE", help="result file (.hdf)")
    made["compare"].add_argument("files", metavar="FILE", nargs=2, help="result files (.hdf): a and b")
    for name in ("status", "show", "compare", "export"):
        form = made[name].add_mutually_exclusive_group(required=name == "export")
        form.add_argument("--json", action="store_const", const="json", dest="form", help="as JSON, SI units")
        form.add_argument("--csv", action="store_const", const="csv", dest="form", help="as CSV, SI units")
        if name == "export":
            form.add_argument("--format", type=_format, choices=tuple(FORMATS), dest="form", metavar="FORMAT",
                              help="one of those below")  # fmt: skip
    for name in ("show", "export"):
        made[name].add_argument("--force", type=values.positive, metavar="N", help="normal force [N], solved or "
                                "between two solved ones (default: the lowest that holds the object, else the largest)"
                                )  # fmt: skip
        made[name].add_argument("--by", choices=RANKED_BY, help="what grasps are ranked by, "
                                "force: the least that holds object.mass_g (default payload)")  # fmt: skip
    made["compare"].add_argument("--quantity", default="e_n", metavar="NAME", help="map that is listed by case "
                                 "(default e_n)")  # fmt: skip
    for name, listed in (("show", "how many grasps"), ("compare", "largest differences")):
        many = f"{listed}, 0: all (default 10)"
        made[name].add_argument("--top", type=values.whole(0), default=10, metavar="K", help=many)
    for name in ("compare", "export"):
        made[name].add_argument("--model", choices=("ccm", "pcm", "pcm_projected"), default="ccm",
                                help="friction model (default ccm)")  # fmt: skip
    _add_export_options(made["export"])
    _add_choice(made["report"])
    made["report"].add_argument("-o", metavar="HTML", dest="output", help="page to write (default: beside the file)")


def _add_export_options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("--top", type=values.whole(0), metavar="K", help="how many grasps, the best first, 0: all (default: 1 for a "
        "simulator, else all; a simulator gets a file for each)")  # fmt: skip
    add("--min", type=values.bound, metavar="NAME=VALUE", action="append", default=[], dest="least", help="leave out "
        "grasps with less, in the unit of 'softjaw show': payload=200 is 200 g; repeatable")  # fmt: skip
    add("-o", metavar="FILE", dest="output", help="file to write (default: standard output)")
    add = parser.add_argument_group("the gripper, for isaac_grasp, graspgen and moveit").add_argument
    add("--approach", choices=APPROACHES, action="append", dest="approaches", help="from palm to fingertips: along "
        "the long side (x) or the short side (y) of finger 1's pad, or against it; repeatable (default minus-x)"
        )  # fmt: skip
    add("--closing", choices=("x", "y"), help="axis of the gripper's frame from finger 1 to finger 2; z approaches "
        "(default x for graspgen, else y)")  # fmt: skip
    add("--depth", type=values.not_negative, default=0.0, metavar="MM", help="from the origin of the gripper's frame "
        "to the middle of the pads (default 0)")  # fmt: skip
    add("--wider", type=values.not_negative, default=20.0, metavar="MM", help="how far the gripper opens beyond first "
        "touch (default 20)")  # fmt: skip
    add("--joints", type=values.names, default=("finger_joint1", "finger_joint2"), metavar="A,B", help="joints of the "
        "fingers, each at half the opening (default finger_joint1,finger_joint2)")  # fmt: skip
    add("--frames", type=values.pair, default=("gripper", "object"), metavar="A,B", help="names of the gripper's and "
        "the object's frame (default gripper,object)")  # fmt: skip
    listed = "\n".join(f"  {name:<12} {text}" for name, text in FORMATS.items())
    parser.epilog = f"{parser.epilog}\n\nformats:\n{listed}"


def _add_patch_options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("file", metavar="FILE", help="CSV with one face per line, or VTU / VTP; columns: docs/pressure-fields.md")
    add("scene", metavar="SCENE", nargs="?", help="with --deformed: scene file (TOML), whose pad is solved")
    add(
        "--deformed",
        action="store_true",
        help="FILE holds points of the pad's deformed contact face (CSV with x, y, "
        "z), or of a contour along its width (y, z), seen from the backing plate",
    )
    add("--mu", type=values.positive, help="friction coefficient (default 0.8; with --deformed that of the scene)")
    add("--long-side", type=values.direction, metavar="X,Y,Z", help="direction of the contact frame's x axis, the "
        "pad's long side; write --long-side=-1,0,0 for negative numbers (default: the longer direction of the patch)"
        )  # fmt: skip
    add("--unit", choices=("m", "cm", "mm"), help="unit of lengths and areas, where the file gives none")
    add("--pressure-unit", choices=("pa", "kpa", "mpa"), help="unit of the pressure, where the file gives none")
    add("--pressure-name", metavar="NAME", help="column or data array that holds the pressure (default: pressure)")
    add("--flip-normals", action="store_true", help="turn all normals; they point into the object, as the finger does")
    add("--other", metavar="FILE", help="the other contact of the grasp, in the same coordinates, units and options")
    add("--distance", type=values.positive, metavar="MM", help="distance of two such contacts that face each other")
    add("--object-length", type=values.positive, metavar="MM", help="divides torques of forces (default: the distance)")
    add("--contact-length", type=values.positive, metavar="MM", help="divides torques about the normals (default: rho)")
    add("--surface", choices=SURFACES, default="quartic", help="limit surface that is scored (default: quartic)")
    add("-o", metavar="PICTURE", dest="picture", help="also write sections of the limit surface (.png or .svg)")
    add("--json", action="store_true", help="as JSON, SI units")


def _add_choice(parser: argparse.ArgumentParser) -> None:
    """Options that choose a candidate."""
    add = parser.add_argument
    add("--candidate", type=int, metavar="N", help="candidate, counted over stations and angles")
    add("--at", type=values.place, default=(None, None), metavar="MM,DEG", help="candidate nearest to this station "
        "[mm] and, if given, angle [deg]; write --at=-5 for negative numbers")  # fmt: skip


def _add_view_options(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument
    add("file", metavar="FILE", help="result file (.hdf)")
    _add_choice(parser)
    add("--force", type=values.finite, metavar="N", help="force level nearest to N [N]")
    add("--quantity", metavar="NAME", help="map on the object (default: payload)")
    add("--motion", choices=("x", "y", "turn"), default="x",
        help="slip that the friction is drawn for (default: along x of the contact)")  # fmt: skip
    add("--screenshot", metavar="PNG", help="write a picture; needs no screen")
    add("--html", metavar="HTML", help="write the view as one page that needs nothing else")


def _format(text: str) -> str:
    if text == "drake":
        raise argparse.ArgumentTypeError(f"{NO_DRAKE} {', '.join(FORMATS)}")
    return text
