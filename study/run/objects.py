"""A folder of objects in one run: ranks divide objects, grasp candidates and forces together.

Objects are taken in batches, whose files are open at once. Ranks first divide the objects of a batch, to sample and
plan their grasps, then all their cases: a rank takes an object that nobody has begun, as the mesh that it has read
serves all of its candidates, and helps with the one where most is left when there is none. What idles is the end of
both steps of a batch: less than the sampling of an object, and less than a load path or a force. Every file is an
ordinary one, with the same bits as a run of its own.
"""

import math
import os
import time
from collections import Counter
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

from softjaw.study import messages, quantities
from softjaw.study.case.build import listed_accuracy, with_mass
from softjaw.study.case.result import TimeLimitError
from softjaw.study.flags import LOST, Flag, flag_words
from softjaw.study.messages import NoGraspError, StudyError, complain, first_of, shortened
from softjaw.study.ranking import judge, largest, task_keys
from softjaw.study.result import index
from softjaw.study.result.lock import holder, in_use
from softjaw.study.result.read import dataset, values_of
from softjaw.study.result.store import open_result, torn_rows
from softjaw.study.result.write import Files, ResultWriter
from softjaw.study.run.limits import AbandonedError, Stopper, early, limited_memory
from softjaw.study.run.load_path import sentence, settle
from softjaw.study.run.object_folder import ObjectFolder, key_of
from softjaw.study.run.plan import Plan
from softjaw.study.run.schedule import Claims
from softjaw.study.run.session import (
    Session,
    Work,
    begin_round,
    file_of,
    finish,
    has_coarser,
    locked,
    on_rank0,
    pack,
    rounds_in,
)
from softjaw.study.scene import Scene, SceneError, parse_scene
from softjaw.study.scene.text import differences
from softjaw.study.table import Row
from softjaw.study.units import in_si

BATCH_PER_RANK, MOST_OPEN_FILES = 4, 128  # objects of a batch: for each rank, and at most
REASON_LETTERS = 400
FATAL = (messages.CANNOT_WRITE, messages.IN_USE)  # codes of errors that the objects after it would meet, too
T = TypeVar("T")
Study = Callable[[Scene, tuple[str, ...]], tuple[Plan, Work]]


class Part(NamedTuple):
    """One object of a batch as all ranks know it: its number in the folder, file, plan, and rows that are torn."""

    number: int
    path: Path
    plan: Plan
    torn: tuple[int, ...]
    seconds: float


def run_objects(
    folder: ObjectFolder, out: Path, study: Study, work: Work, comm: Any, *, retry_failed: bool = False
) -> int:
    """Solve all objects of a folder into files of ``out`` and an index; the exit code; collective over ``comm``.

    ``study(scene, overrides)`` plans one object on one rank, for a communicator of that rank alone; ``work`` is how
    the cases of any object are solved.

    Raises `StudyError` on every rank: what is wrong for all objects alike, ``out`` is in use, of another
    scene, or cannot be written.
    """
    with locked(out / f"{index.INDEX}.hdf", comm):
        run = _ObjectsRun(folder, out, study, work, comm, retry_failed)
        batch = min(max(BATCH_PER_RANK * comm.size, BATCH_PER_RANK), MOST_OPEN_FILES)
        if run.changed and not run.todo():
            run.store()
        while todo := run.todo()[:batch]:
            if not run.solve(todo):
                break
        early.clear()  # a signal that found nothing left to stop
        return index.code_of(run.rows)


class _ObjectsRun:
    """What all ranks know of a run: ``rows`` of the index, one an object, and whether they have ``changed`` since it.

    ``_mine`` is what this rank has planned.
    """

    def __init__(
        self, folder: ObjectFolder, out: Path, study: Study, work: Work, comm: Any, retry_failed: bool
    ) -> None:
        self._folder, self._out, self._study, self._work, self._comm = folder, out, study, work, comm
        self._retry = retry_failed
        self.rows, self.changed = on_rank0(comm, _rows_of, folder, out, retry_failed)
        self._mine: dict[int, tuple[Plan, Work]] = {}
        self._failed: list[tuple[int, Row]] = []
        self._tried: set[int] = set()
        for n in self._torn():
            self.rows[n]["state"] = index.MISSING

    def _torn(self) -> list[int]:
        """Numbers of objects in whose files rows are torn, by all ranks; `StudyError` if a file is unreadable."""
        torn, refused = list[int](), list[StudyError]()
        for n, row in [*enumerate(self.rows)][self._comm.rank :: self._comm.size]:
            path = self._out / row["file"]
            if row["done"] > 0 and row["state"] in index.ENDED:
                try:
                    with open_result(path) as result:
                        torn += [n] * bool(torn_rows(path, result.layout))
                except StudyError as error:
                    refused.append(error)
        gathered = self._comm.allgather((torn, refused))
        if damaged := [error for _, errors in gathered for error in errors]:
            texts = first_of([error.message for error in damaged], 20, " such files")
            raise StudyError(damaged[0].code, "\n".join(texts))
        return [n for numbers, _ in gathered for n in numbers]

    def todo(self) -> list[int]:
        """Numbers of the objects that this run has still to take."""
        return [n for n, row in enumerate(self.rows) if row["state"] not in index.ENDED and n not in self._tried]

    def solve(self, batch: list[int]) -> bool:
        """Solve a batch; whether no signal came."""
        self._tried |= set(batch)
        for n, row in ((n, self.rows[n]) for n in batch):
            known = {name: row[name] for name in ("file", "mesh", "key", "mass")}
            self.rows[n] = index.blank_row(row["object"], state=index.STOPPED, **known)
        ended = sum(row["state"] in index.ENDED for row in self.rows)
        self.store(f"objects {ended + 1} to {ended + len(batch)} of {len(self.rows)}")
        answers, stopped = self._divide(batch, self._prepared)
        for n, answer in answers.items():
            self.rows[n] |= {} if isinstance(answer, Part) else answer
        parts = [answer for answer in answers.values() if isinstance(answer, Part)]
        names = {part.number: part.seconds for part in parts}
        retry = self._retry
        while parts and not stopped:
            stopped, retry = self._cases(parts, retry), False  # once, and not in every round
            mine = [part for part in parts if part.number in self._mine]
            grown = [] if stopped else [self._alone(part.number, self._grown, part) for part in mine]
            parts = self._gathered(part for part in grown if part)
        ends = [self._alone(n, self._ending, n, seconds, stopped) for n, seconds in names.items() if n in self._mine]
        for n, row in self._gathered([*filter(None, ends), *self._failed]):
            self.rows[n] = row
        self._mine.clear()
        self._failed.clear()
        self.store()
        return not stopped

    # --- planning -----------------------------------------------------------------------------------------------------

    def _divide(self, numbers: list[int], function: Callable[[int], Any]) -> tuple[dict[int, Any], bool]:
        """What ``function`` gives for each object, or its state and why not; and whether a signal came."""
        claims = Claims(self._comm, [1] * len(numbers))
        stopper = Stopper(claims.stop, self._work.time_limit)
        answers, fatal = dict[int, Any](), None
        with stopper, limited_memory(self._work.memory, claims.node.size):
            for position in claims:
                n = numbers[position]
                try:
                    with stopper.case():
                        answers[n] = function(n)
                except AbandonedError:
                    break
                except (Exception, TimeLimitError) as error:  # whatever an object dies of is its row
                    if isinstance(error, StudyError) and error.code in FATAL:
                        fatal = error
                        claims.stop()
                    answers[n] = _why(error, stopper.limit)
            request = self._comm.Ibarrier()
            while not request.Test():
                time.sleep(0.02)  # leaves the core to ranks that still plan
        claims.free()
        gathered = self._comm.allgather((answers, stopper.name, fatal))
        if fatals := [refusal for *_, refusal in gathered if refusal is not None]:
            raise fatals[0]
        together = {n: answer for some, *_ in gathered for n, answer in some.items()}
        return dict(sorted(together.items())), any(name for _, name, _ in gathered)

    def _prepared(self, n: int) -> Part:
        begin, listed = time.perf_counter(), self._folder.objects[n]
        overrides, path = self._folder.overrides_of(listed), self._out / f"{listed.name}.hdf"
        if other := holder(path):
            raise in_use(path, other)
        plan, work = self._study(self._folder.scene(listed), overrides)
        if work.grown and (rounds := rounds_in(path, plan)):
            plan, work = work.grown(rounds)
        _, torn = file_of(path, plan)
        self._mine[n] = plan, work
        return Part(n, path, plan, tuple(torn), time.perf_counter() - begin)

    # --- solving ------------------------------------------------------------------------------------------------------

    def _cases(self, parts: list[Part], retry: bool) -> bool:
        """Solve what is missing of some objects, and what has failed if asked to; whether a signal came."""
        writers = [ResultWriter(part.path, part.plan.layout, self._comm, part.plan.wanted) for part in parts]
        files = Files(self._out, writers)

        def states() -> list[np.ndarray]:
            return [settle(w, part.plan.units, part.torn, retry) for w, part in zip(writers, parts, strict=True)]

        codes = np.concatenate(on_rank0(self._comm, states))
        if self._comm.rank == 0:  # in each round of further grasps and finer meshes counts begin anew
            missing, s = np.count_nonzero(codes == quantities.MISSING), "s" * (len(parts) > 1)
            print(f"{len(parts)} object{s}: {missing} of {codes.size} cases to solve", flush=True)
        units = [files.counted(i, part.plan.units) for i, part in enumerate(parts)]
        session = Session(units, self._work, files, self._comm, codes)
        code = session.solve()
        for part, writer in zip(parts, writers, strict=True):
            if part.number in self._mine:
                _, work = self._mine[part.number]
                end = work, part.path, part.plan, writer.session, session.signal
                self._alone(part.number, finish, *end)
        # Nobody reads a file that is being finished.
        self._comm.Barrier()
        return code == messages.STOPPED

    def _alone(self, n: int, function: Callable[..., T], *arguments: Any) -> T | None:
        """What a function gives for an object of this rank; None where it fails, which becomes the object's row."""
        if any(n == number for number, _ in self._failed):
            return None
        try:
            return function(*arguments)
        except Exception as error:
            if isinstance(error, StudyError) and error.code in FATAL:
                if self._comm.size > 1:  # the others wait for this rank
                    self._comm.Abort(complain(error, speaks=True))
                raise
            self._failed.append((n, self.rows[n] | _why(error, self._work.time_limit)))
            return None

    def _grown(self, part: Part) -> Part | None:
        """The object with its next round of further grasps in its file; None where it has enough."""
        plan, work = self._mine[part.number]
        with open_result(part.path) as result:
            added = work.more(result)
        if not added or not work.grown:
            return None
        plan, work = work.grown((*plan.layout.rounds, added))
        begin_round(part.path, plan)
        self._mine[part.number] = plan, work
        return part._replace(plan=plan, torn=())

    def _ending(self, n: int, seconds: float, stopped: bool) -> tuple[int, Row]:
        """The row of an object as its file stands, which is packed if nothing is missing there."""
        path, (plan, work) = self._out / f"{self._folder.objects[n].name}.hdf", self._mine[n]
        with open_result(path) as result:
            row = self.rows[n] | row_of(result) | {"preparing": seconds}
        if stopped:  # also where no case is missing, a further round may be
            row |= {"state": index.STOPPED, "reason": ""}
        if row["state"] != index.STOPPED:
            pack(work, path, plan)
        return n, row

    def _gathered(self, items: Iterable[Any]) -> list[Any]:
        """What all ranks give together, in the order of the objects' numbers."""
        together = [item for some in self._comm.allgather(list(items)) for item in some]
        return sorted(together, key=lambda item: item.number if isinstance(item, Part) else item[0])

    # --- the index ----------------------------------------------------------------------------------------------------

    def store(self, text: str = "") -> None:
        """Write the index, by one rank, which prints a text."""
        if text and self._comm.rank == 0:
            print(text, flush=True)
        about = {"scene_file": self._folder.scene_file, "overrides": "\n".join(self._folder.overrides)}
        on_rank0(self._comm, index.write_index, self._out / f"{index.INDEX}.hdf", self.rows, about)


def _rows_of(folder: ObjectFolder, out: Path, retry_failed: bool) -> tuple[list[Row], bool]:
    """A row for every object: what an earlier run has stored, or nothing yet; whether any changed; by one process."""
    path = out / f"{index.INDEX}.hdf"
    known = {row["object"]: row for row in index.read_index(path)[0]} if path.exists() else {}
    again = {index.FAILED, index.REFUSED, index.NO_GRASP, index.SOME_FAILED} if retry_failed else set()
    if gone := known.keys() - {listed.name for listed in folder.objects}:
        print(f"note: {len(gone)} of {len(known)} objects in {path} are not in this run; their files stay", flush=True)
    rows = []
    for listed in folder.objects:
        row = index.blank_row(listed.name, file=f"{listed.name}.hdf", mesh=os.path.relpath(listed.mesh, out))
        before = known.get(listed.name, row)
        try:
            scene = folder.scene(listed)
        except SceneError as error:
            rows.append(row | _why(error, math.inf))
            continue
        key, mass = key_of(scene), scene.object.mass_g
        if before["key"] not in ("", key) and (out / row["file"]).exists():
            change = _change(out / row["file"], scene)
            text = f"{path}: object '{listed.name}' was solved from another scene or mesh ({change})"
            raise StudyError(messages.OTHER_FILE, f"{text}; choose another folder with -o, or move this one away")
        if before["key"] == key and (before["done"] < 1 or (out / row["file"]).exists()):
            kept = retry_failed and before["done"] > 0 and has_coarser(out / row["file"])
            lacks = {"state": index.MISSING} if kept or before["state"] in again else {}
            row = before | {"mesh": row["mesh"]} | lacks
        rows.append(row | {"key": key} | ({} if mass is None else {"mass": in_si("mass_g", mass)}))
    columns = "object", "mesh", "state", "reason"
    stored, now = ([[row[name] for name in columns] for row in these] for these in (known.values(), rows))
    return rows, stored != now


def _change(path: Path, scene: Scene) -> str:
    """What differs between the scene that an object's file was made from and its scene now."""
    with open_result(path) as result:
        with suppress(StudyError):  # the mesh cannot be read now, or the file is of another version
            scene = with_mass(scene)
            if scene.candidates.sampled:  # a file has what was sampled in its place
                poses = parse_scene(result.scene, check_files=False).candidates.poses
                where = scene.candidates.model_copy(update={"sampled": None, "poses": poses})
                scene = scene.model_copy(update={"candidates": where, "accuracy": listed_accuracy(scene)})
        alike = scene.digest == result.digest
        return "candidates.sampled or refine" if alike else differences(result.scene, scene.effective_toml())


def _why(error: BaseException, limit: float) -> Row:
    """State of an object that could not be planned, and why."""
    state, reason = index.FAILED, sentence(error, limit)
    if isinstance(error, StudyError):
        state = index.REFUSED if error.code == messages.USAGE else index.FAILED
        state = index.NO_GRASP if isinstance(error, NoGraspError) else state
        reason = str(error.problems[0]) if isinstance(error, SceneError) else error.message
    return {"state": state, "reason": shortened(reason, REASON_LETTERS)}


def row_of(result: Any) -> Row:
    """What the index says of an open result file."""
    ds = judge(dataset(result))
    codes, done, flags = result.status, ds.status.values == quantities.DONE, ds.flags.values
    row: Row = {"cases": codes.size, "seconds": float(np.nansum(result.read("work/seconds_total")))}
    for name, code in (("done", quantities.DONE), ("failed", quantities.FAILED)):
        row[name] = int(np.count_nonzero(codes == code))  # also of samples of uncertain inputs
    if mass := task_keys(ds, "object").get("mass_g"):  # also what the scene's density makes
        row["mass"] = in_si("mass_g", mass)
    if (codes == quantities.MISSING).any():
        return row | {"state": index.STOPPED, "reason": ""}
    usable, payload = done & (flags & LOST == 0), np.nan_to_num(values_of(ds, "payload"))
    # A grasp that holds the object with less safety than is asked for is one.
    holding = usable if usable.any() else done & (flags & LOST == Flag.TOO_WEAK) & (payload > 0)
    row["reason"] = _reason(result, flags[holding if holding.any() else done] & LOST)
    if not holding.any():
        return row | {"state": index.FAILED if row["failed"] and not done.any() else index.NO_GRASP}
    if not holding[at := ds.attrs["best"]]:
        at = tuple(map(int, np.unravel_index(largest(np.where(holding, payload, -1.0)), holding.shape)))
    k, best = at[-1], int(np.ravel_multi_index(at[:-1], done.shape[:-1]))
    maps = [name for name in ("payload", "opening", "e_n", "quality", "payload_error") if name in ds]
    row |= {name: float(values_of(ds, name)[at]) for name in maps}
    row |= {"force": float(ds.normal_force.values[k]), "best": best, "grasps": int(usable[..., k].sum())}
    return row | {"state": index.SOME_FAILED if row["failed"] else index.DONE}


def _reason(result: Any, lost: np.ndarray) -> str:
    """The flags ``lost`` in words, and the most frequent message of what failed or is no grasp."""
    texts = [flag_words(int(np.bitwise_or.reduce(lost)))]
    messages_ = [str(text) for text in result.messages[result.status != quantities.DONE] if text]
    if messages_:
        text, count = Counter(messages_).most_common(1)[0]
        texts.append(f"{count} of {result.status.size} cases: {text}")
    return shortened("; ".join(filter(None, texts)), REASON_LETTERS)
