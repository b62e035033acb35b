"""What users bring, run as they would run it: ``python -m tests.objects.survey``, which is ``make objects``.

Every object goes through `softjaw init mesh`, `run`, `show`, `report` and `view`, in processes of their own with a time
limit; random scenes are solved by `tests.objects.random_run`. Outcomes are kept one by one beside the results, so that
a part can be run again: ``--only banana``. Nothing here may load MPI: under it no other program could start `mpirun`.
"""

from __future__ import annotations

import json
import os
import re
import resource
import shlex
import signal
import subprocess
import sys
from argparse import ArgumentParser, Namespace
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

from softjaw.study.messages import DONE, SOME_FAILED, StudyError
from tests.objects.contact_sheet import contact_sheet
from tests.objects.found import Found, of_file
from tests.objects.objects_page import page
from tests.objects.random_scenes import LIMIT, random_scene
from tests.objects.user_objects import Maker, user_objects

SOFTJAW = str(Path(sys.executable).with_name("softjaw"))
GRACE = 60.0  # for a run that was told to stop, to write what it has [s]
WORKERS = 2
SAID = 300  # characters of the end of what a command said


def spent() -> float:
    """CPU time of all finished children [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def spent_by(session: int) -> float:
    """CPU time of the processes of a session [s]; `mpirun` that is told to stop does not wait for all of them."""
    total = 0
    for file in Path("/proc").glob("[0-9]*/stat"):
        with suppress(OSError):
            fields = file.read_text().rpartition(")")[2].split()
            total += sum(map(int, fields[11:13])) if int(fields[3]) == session else 0
    return total / os.sysconf("SC_CLK_TCK")


def said(words: list[str], folder: Path, limit: float) -> tuple[int | None, str, float]:
    """Exit code, output and CPU time [s] of a command; no code if it was stopped at the time limit [s]."""
    log, before = folder / "command.log", spent()
    with log.open("w") as out:
        process = subprocess.Popen(words, cwd=folder, stdout=out, stderr=subprocess.STDOUT, start_new_session=True)
    try:
        return process.wait(limit), log.read_text(errors="replace"), spent() - before
    except subprocess.TimeoutExpired:
        used = spent_by(process.pid)
        process.terminate()  # alone: mpirun passes it on
    try:
        process.wait(GRACE)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    return None, log.read_text(errors="replace"), max(used, spent() - before)


def file_name(name: str) -> str:
    """Name of an object's files."""
    return re.sub(r"[^\w.]+", "-", name)


def survey_object(name: str, kind: str, make: Maker, options: Namespace) -> Found:
    """The way of a user from the file of an object to its map and the picture of its best grasp."""
    file, folder = file_name(name), options.results
    make().export(folder / f"{file}.stl")
    result = folder / f"{file}.hdf"
    for old in (result, folder / f"{file}.png"):
        old.unlink(missing_ok=True)
    init = [SOFTJAW, "init", "mesh", "--mesh", f"{file}.stl", "--unit", "m", "-o", file, "--force"]
    run = [*shlex.split(options.mpirun), SOFTJAW, "run", f"{file}.toml", "-o", result.name]
    found = Found(name, kind)
    for words in (init, run):
        code, text, seconds = said(words, folder, options.limit)
        found.seconds += seconds
        if code not in (DONE, SOME_FAILED):
            end = f"stopped at the time limit of {options.limit:g} s" if code is None else f"exit code {code}"
            found.refused = f"{end}: {text[-SAID:]}"
            break
    if result.exists():
        try:
            found.states, found.failures = of_file(result)
        except StudyError as error:
            found.refused += f"the result cannot be read: {error}"
        found.best = look_at(file, folder, options.limit)
    return found


def look_at(file: str, folder: Path, limit: float) -> str:
    """Show, report and view a result; what is said of its best grasp."""
    code, text, _ = said([SOFTJAW, "show", f"{file}.hdf", "--json", "--top", "1"], folder, limit)
    said([SOFTJAW, "report", f"{file}.hdf", "-o", f"{file}.html"], folder, limit)
    said([SOFTJAW, "view", f"{file}.hdf", "--screenshot", f"{file}.png"], folder, limit)
    best = json.loads(text)["grasps"] if code == DONE else []
    return f"{best[0]['label']}: {best[0]['quality']:.3g}" if best else ""


def survey_random(numbers: list[int], options: Namespace) -> None:
    """Solve random scenes in one process after the other: one that dies loses the scene that it was at."""
    folder, left = options.results / "random", list(numbers)
    while left:
        words = [sys.executable, "-m", "tests.objects.random_run", str(options.seed), str(folder), *map(str, left)]
        ended = subprocess.run(words, stderr=subprocess.PIPE, text=True)
        left = [k for k in left if not (folder / f"{k:03d}.json").exists()]
        if left:
            killed = -ended.returncode in (signal.SIGPROF, signal.SIGALRM)
            crash = f"crash: exit code {ended.returncode}: {ended.stderr[-SAID:]}"
            why = f"time limit of {LIMIT:g} s" if killed else crash
            k = left.pop(0)
            kind, _ = random_scene(options.seed, k)
            Found(f"scene {k}", f"random {kind}", LIMIT, refused=why).save(folder / f"{k:03d}.json")


def survey(options: Namespace) -> None:
    """Run what was chosen, each object's outcome kept as it comes."""
    (options.results / "random").mkdir(parents=True, exist_ok=True)
    for name, (kind, make) in user_objects(options.seed).items():
        if re.search(options.only, name):
            found = survey_object(name, kind, make, options)
            found.save(options.results / f"{file_name(name)}.json")
            print(f"{name}: {found.states}, {found.seconds:.0f} s of CPU; {found.why}", flush=True)
    numbers = [k for k in range(options.scenes) if re.search(options.only, f"scene {k}")]
    for k in numbers:
        (options.results / "random" / f"{k:03d}.json").unlink(missing_ok=True)
    with ThreadPoolExecutor(WORKERS) as pool:
        list(pool.map(lambda i: survey_random(numbers[i::WORKERS], options), range(WORKERS)))


def main() -> None:
    """Read the command line, run, and write the page and the pictures."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0, help="of random scenes, hollow bodies and holes")
    parser.add_argument("--scenes", type=int, default=200, help="number of random scenes")
    parser.add_argument("--only", default="", help="regular expression of the objects to be run again")
    parser.add_argument("--limit", type=float, default=600.0, help="of each command on the clock [s]")
    parser.add_argument("--mpirun", default="mpirun -n 2", help="how ranks are started")
    parser.add_argument("--results", type=Path, default=Path("results/objects"))
    parser.add_argument("-o", "--output", type=Path, help="folder of the page and its picture: docs with seed 0")
    parser.add_argument("--page", action="store_true", help="write the page of what was run before")
    options = parser.parse_args()
    options.results = options.results.resolve() / str(options.seed)
    options.output = options.output or (options.results if options.seed else Path("docs"))
    if not options.page:
        survey(options)
    names = {name: options.results / file_name(name) for name in user_objects(options.seed)}
    objects = [Found.load(file) for path in names.values() if (file := path.with_name(path.name + ".json")).exists()]
    scenes = [Found.load(file) for file in sorted((options.results / "random").glob("*.json"))]
    (options.output / "objects.md").write_text(page(objects, scenes, options.seed))
    pictures = {f.name: (f.best, names[f.name].with_name(names[f.name].name + ".png")) for f in objects}
    contact_sheet(pictures, options.output / "objects.png")


if __name__ == "__main__":
    main()
