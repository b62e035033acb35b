"""What users bring, from file to map: ``python -m tests.objects.survey``, which is ``make objects``."""

import re
import signal
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from tests.objects.solve import LIMIT, Outcome, file_name, objects

WORKERS = 2
ERROR_TEXT = 300  # characters of the end of what a process wrote before it died
LONGEST = 160  # characters of a message on the page
GOAL = 0.98  # share of cases that end solved
TOUCH = 1e-4  # overlap at first touch up to which a pad starts outside: of edges that are rounded [m]
PHYSICS = ("the foam loses ellipticity", "the pad is compressed too far", "the pad grazes the object")
HEAD = ("kind", "meshes", "accepted", "cases", "solved", "flags", "pads inside", "median CPU s")
PAGE = """# Objects that users bring

Written by `make objects`. Each mesh is made by a script (`tests/objects/bad_meshes.py`), or is a scan of the YCB Object
and Model Set (`tests/objects/scans`), and is written as STL, OBJ, PLY, OFF, GLB or 3MF in turn. Its scene is that of
`softjaw init mesh` with three sampled grasps at 5 N on one coarse mesh (10 x 6 x 4 elements) of each pad. Random scenes
are shapes without a mesh, one grasp at three forces each. Flags: share of the solved cases that carry them, from a
tenth on. A pad starts inside where triangles reach more than {touch:g} mm past its face at first touch.

**{solved} of {cases} cases are solved: {share:.1%}** (goal {goal:.0%}); {physics} fail by physics, {others} otherwise;
{refused} of {objects} objects are refused.

{kinds}

## Failures

{failures}
"""


def survey(names: Sequence[str], options: Namespace) -> None:
    """Solve objects in one process after the other: one that dies loses the object that it is at."""
    folder, kinds, rest = options.results, objects(options.seed), list(names)
    while rest:
        words = [sys.executable, "-m", "tests.objects.solve", str(options.seed), str(folder), *rest]
        ended = subprocess.run(words, stderr=subprocess.PIPE, text=True)
        rest = [name for name in rest if not (folder / f"{file_name(name)}.json").exists()]
        if rest:
            slow = -ended.returncode in (signal.SIGPROF, signal.SIGALRM)
            crash = f"crash: exit code {ended.returncode}: {ended.stderr[-ERROR_TEXT:]}"
            name = rest.pop(0)
            Outcome(name, kinds[name], LIMIT, refused=f"time limit of {LIMIT:g} s" if slow else crash).save(folder)


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(str(cell).replace('|', '/') for cell in cells)} |" for cells in lines)


def by_physics(message: str) -> bool:
    """Whether no better program could solve a case."""
    return message.startswith(PHYSICS)


def kind_row(kind: str, outcomes: Sequence[Outcome]) -> list[object]:
    flags: Counter[str] = sum((Counter(o.flags) for o in outcomes), Counter())
    solved, seconds = sum(o.solved for o in outcomes), sorted(o.seconds for o in outcomes)
    shares = ", ".join(f"{word} {n / solved:.0%}" for word, n in flags.most_common() if 10 * n >= solved)
    return [
        kind, len(outcomes), sum(not o.refused for o in outcomes), sum(o.cases for o in outcomes), solved, shares,
        sum(o.inside > TOUCH for o in outcomes), f"{seconds[len(seconds) // 2]:.1f}",
    ]  # fmt: skip


def page(outcomes: Sequence[Outcome]) -> str:
    kinds = list(dict.fromkeys(o.kind for o in outcomes))
    rows = [kind_row(kind, [o for o in outcomes if o.kind == kind]) for kind in kinds]
    failures = [(o.name, *failure) for o in outcomes for failure in o.failures]
    failures += [(o.name, "all", o.refused) for o in outcomes if o.refused]
    physics, cases = sum(by_physics(message) for *_, message in failures), sum(o.cases for o in outcomes)
    solved = sum(o.solved for o in outcomes)
    cells = [(name, where, " ".join(message.split())[:LONGEST]) for name, where, message in failures]
    return PAGE.format(
        solved=solved, cases=cases, share=solved / max(cases, 1), goal=GOAL, physics=physics,
        others=cases - solved - physics, refused=sum(bool(o.refused) for o in outcomes), objects=len(outcomes),
        kinds=table(HEAD, rows), failures=table(("object", "case", "message"), cells), touch=1e3 * TOUCH,
    )  # fmt: skip


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="of holes, spoiled triangles and random scenes")
    parser.add_argument("--only", default="", help="regular expression of the objects to be run again")
    parser.add_argument("--results", type=Path, default=Path("results/objects"))
    parser.add_argument("-o", "--output", type=Path, help="folder of the page: docs with seed 0")
    parser.add_argument("--page", action="store_true", help="write the page of what was run before")
    options = parser.parse_args()
    options.results = options.results.resolve() / str(options.seed)
    options.results.mkdir(parents=True, exist_ok=True)
    files = {name: options.results / f"{file_name(name)}.json" for name in objects(options.seed)}
    if not options.page:
        names = [name for name in files if re.search(options.only, name)]
        for name in names:
            files[name].unlink(missing_ok=True)
        with ThreadPoolExecutor(WORKERS) as pool:
            list(pool.map(lambda i: survey(names[i::WORKERS], options), range(WORKERS)))
    output = options.output or (options.results if options.seed else Path("docs"))
    (output / "objects.md").write_text(page([Outcome.load(file) for file in files.values() if file.exists()]))


if __name__ == "__main__":
    main()
