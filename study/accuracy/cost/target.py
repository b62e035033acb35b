"""``accuracy.e_n`` in a scene: the scene with mesh, steps and effects chosen, before a run plans its file.

Without a cost study a small one is made: pad and wall are refined together, from coarse upward, until a mesh meets the
target on probes, the hardest contact among them, and then on cases that it was not chosen by. Either study is kept, so
the same command chooses the same again and a run can be resumed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.accuracy.cost.choose import Choice, allowed, choose, explicit, nothing
from softjaw.study.accuracy.cost.errors import flagged, flags_of, limit, places, unsure
from softjaw.study.accuracy.cost.knobs import Knob, Level, contact_knobs, weight, with_level
from softjaw.study.accuracy.cost.measure import Measured, measure_once, warm_up
from softjaw.study.accuracy.cost.study import CostStudy, costs, load, new_study, plain, save, setting_of
from softjaw.study.case import candidates as grasps
from softjaw.study.case.probes import Probe, demanding, held_out, probes, probes_at
from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.result.derived import MEANING
from softjaw.study.scene import Scene, parse_scene
from softjaw.study.scene.problems import SceneError
from softjaw.study.scene.text import changes, toml_text

FloatArray = NDArray[np.float64]
FORMAL = 2.0  # highest order that is believed
ALIKE = 1e-6  # errors that differ by less of themselves are equal
FEWEST = 3  # meshes: two coarse ones can agree by chance
MOST_WEIGHT = 40.0  # no mesh is more than so many times as heavy as the scene's own
CHOSEN = ("gripper.elements", "gripper.element")  # with the sections effects and accuracy: what a choice may change
FREE = tuple(f"{name}." for name in ("accuracy", "candidates", "load", "effects", "limit_surface", "score", "sweep",
                                     "task", "run", "uncertainty"))  # fmt: skip


def settled(scene: Scene, output: Path, say: Callable[[str], None]) -> tuple[Scene, Choice | None]:
    """The scene with the chosen values put in, and the choice; the scene as it is where it names no target."""
    if scene.accuracy.e_n is None:
        return scene, None
    choice = _from_file(scene, say) if scene.accuracy.cost_file else _fresh(scene, output, say)
    return with_choice(scene, choice), choice


def with_choice(scene: Scene, choice: Choice) -> Scene:
    """The scene with the chosen values put in, its sweep kept."""
    sections = {"effects": scene.effects, "gripper": scene.gripper, "accuracy": scene.accuracy, "object": scene.object}
    point = scene.with_values(choice.values)
    return scene.model_copy(update={name: getattr(point, name) for name in sections})


def cost_path(output: Path) -> Path:
    """Where the small study of a run is kept.

    >>> cost_path(Path("results/bottle.hdf")).as_posix()
    'results/bottle-target.hdf'
    """
    return output.with_name(f"{output.stem}-target.hdf")


def _fresh(scene: Scene, output: Path, say: Callable[[str], None]) -> Choice:
    path = cost_path(output)
    found, others, cases = quick_probes(scene)
    study = new_study(scene, found, getattr(scene.object, "name", None) or output.stem, "")
    if path.exists():
        old = load(path)
        if old.digest == study.digest and old.candidates == study.candidates:
            study = old
    if not study.measured:
        say(f"accuracy.e_n = {scene.accuracy.e_n:g}: choosing the mesh on {'; '.join(study.candidates)}")
        warm_up(found[0])
    choice = quick_choice(scene, study, found, others, cases, lambda: save(path, study))
    say(str(choice))
    return choice


def _from_file(scene: Scene, say: Callable[[str], None]) -> Choice:
    path = Path(str(scene.accuracy.cost_file))
    study = load(path)
    measured = stored_scene(path, study)
    refuse_other(path, scene, measured)
    what = costs(measured, with_judging=False)
    named = [label for label in study.candidates if label in measured.candidates.labels]
    found = probes(measured, named) if len(named) == len(study.candidates) else []
    if found:
        warm_up(found[0])
    others = held_out(measured, found) if found else []
    choice = choose(what, study, float(scene.accuracy.e_n), explicit(scene), found, others, measure_once)
    save(path, study)
    say(str(choice))
    return choice


def stored_scene(path: Path, study: CostStudy) -> Scene:
    """The scene that a study was made from."""
    try:
        return parse_scene(study.scene, path, check_files=False)
    except SceneError as error:
        raise StudyError(OTHER_FILE, f"{path}: its scene cannot be read by this version: {error}") from error


def refuse_other(path: Path, scene: Scene, measured: Scene) -> None:
    """Refuse a study of another object, pad or friction; meshes, candidates and forces may differ."""
    differ = [
        f"{key} is {there} there and {here} here"
        for key, there, here in changes(measured.effective_toml(), scene.effective_toml())
        if key not in CHOSEN and not key.startswith(FREE)
    ]
    if differ:
        raise StudyError(
            OTHER_FILE,
            f"accuracy.cost_file: {path} was measured for another scene ({'; '.join(differ[:3])}); expected one of this"
            " object and gripper: run 'softjaw cost' for this scene, or remove the key",
        )


def expected(scene: Scene) -> str:
    """What ``check`` can say of the target that a scene's cost study has measured, without solving anything."""
    goal = f"e_n within {100 * scene.accuracy.e_n:g} %"
    path = Path(scene.accuracy.cost_file)
    study = load(path)
    measured = stored_scene(path, study)
    refuse_other(path, scene, measured)
    return f"{goal}: {choose(costs(measured, with_judging=False), study, scene.accuracy.e_n, explicit(scene))}"


# --- a small study for one run ----------------------------------------------------------------------------------------


def ladder(scene: Scene) -> list[Level]:
    """Meshes of pad and wall together, the coarsest first; only what the scene leaves open changes."""
    given = explicit(scene)
    own = plain(scene)
    knobs = {k.name: k for k in contact_knobs(own)[0]}
    kind = "pad mesh, hex27" if own.gripper.element == "hex27" else "pad mesh, hex8"
    pads = _open(knobs.get(kind), given)
    walls = _open(knobs.get("wall mesh"), given) or _open(knobs.get("object grid"), given)
    if not pads or not walls:
        made = pads or sorted(walls, key=lambda level: -level.size)
    else:
        pairs = zip(pads, sorted(walls, key=lambda v: -v.size), strict=False)
        made = [Level(f"{p.name}; wall {w.name}", p.values + w.values, p.size) for p, w in pairs]
    most = MOST_WEIGHT * weight(own)
    return [level for level in made if weight(with_level(own, level)) <= most]


def _open(knob: Knob | None, given: Mapping[str, Any]) -> list[Level]:
    # the kind of elements stays that of the scene, so that it need not be told apart
    free = {key: value for key, value in given.items() if key != "gripper.element"}
    return [level for level in knob.levels if allowed(level, free)] if knob else []


def quick_probes(scene: Scene) -> tuple[list[Probe], list[Probe], int]:
    """Probes at the lowest and the highest force, the cases that the choice is tried on, and all cases of the run."""
    units, forces = grasps.units(scene, lambda point: point.axis_symmetry), scene.load.normal_force
    found = probes_at(scene, demanding(units), tuple(dict.fromkeys((forces[0], forces[-1]))))
    return found, held_out(scene, found), len(units) * len(forces)


@dataclass(frozen=True)
class Judged:
    """What meshes are worth, the coarsest first.

    Attributes
    ----------
    levels : list of Level
        Those that solve every case that any mesh solves.
    cases : list of str
        In words.
    error : (levels, cases) array
        Relative distance of e_n from the limit of all meshes, and the doubt of that limit: the largest of this mesh
        and all finer ones. NaN where that is not known.
    good : (levels,) array of bool
        Whether a mesh keeps the target, and neither it nor a finer one is flagged.
    flagged : (levels,) array of bool
        Whether a mesh carries a flag that the finest does not.
    known : bool
        Whether no case is flagged as coarse on the finest mesh too, so that its error is not known.
    told : str
        How the limit was found, and what stands against trusting it.
    """

    levels: list[Level]
    cases: list[str]
    error: FloatArray
    good: NDArray[np.bool_]
    flagged: NDArray[np.bool_]
    known: bool
    told: str

    @property
    def chosen(self) -> int | None:
        """The coarsest good mesh, if there is one."""
        return int(self.good.argmax()) if self.good.any() else None

    @property
    def best(self) -> int:
        """The most accurate mesh without a flag that the finest does not carry; of equals the coarsest."""
        worst = np.where(self.flagged, np.inf, np.nanmax(self.error, axis=1))
        return int(np.argmax(worst <= worst.min() * (1 + ALIKE)))


def judge(levels: Sequence[Level], found: Sequence[Sequence[Measured]], target: float) -> Judged:
    """Judge meshes by what was measured on them, ``found[level][probe]``."""
    values = np.array([np.concatenate([m.values[:, 0] for m in own]) for own in found])
    flags = np.array([flags_of(own) for own in found])
    names = places(found[0])
    alive = np.isfinite(values).any(axis=0)
    sound = np.isfinite(values[:, alive]).all(axis=1)
    kept = [level for level, own in zip(levels, sound, strict=True) if own]
    last = flags[sound][-1] if kept else np.zeros(len(names), np.int64)
    sure = alive & ~unsure(last)
    told = [f"{level.name} failed on a probe" for level, own in zip(levels, sound, strict=True) if not own]
    told += [f"no mesh solves {name}" for name, own in zip(names, alive, strict=True) if not own]
    told += [f"even the finest mesh is flagged at {names[k]}" for k in np.flatnonzero(alive & ~sure)]
    error = np.full((len(kept), len(names)), np.nan)
    if len(kept) < FEWEST or not sure.any():
        told.append(f"only {len(kept)} meshes could be solved on the probes" * (len(kept) < FEWEST))
        none = np.zeros(len(kept), bool)
        return Judged(kept, names, error, none, none, False, "; ".join(filter(None, told)))
    own = values[np.ix_(sound, sure)]
    end = limit([level.size for level in kept], own, FORMAL)
    error[:, sure] = _no_luck((np.abs(own - end.value) + end.doubt) / np.abs(end.value))
    carried = flagged(flags[sound], last)[:, sure].any(axis=1)
    told += [f"{level.name} is flagged where the finest mesh is not" for level in np.array(kept, object)[carried]]
    good = (np.nanmax(error, axis=1) <= target) & ~_no_luck(carried)
    told.insert(0, f"no order seen: {end.note}" if end.note else f"observed order {end.order:.1f}")
    return Judged(kept, names, error, good, carried, bool((sure | ~alive).all()), "; ".join(told))


def _no_luck(errors: NDArray[Any]) -> NDArray[Any]:
    """Errors ``(levels, ...)`` that are no smaller than those of any finer level: chance may make one small."""
    return np.maximum.accumulate(errors[::-1])[::-1]


def quick_choice(
    scene: Scene, study: CostStudy, found: Sequence[Probe], others: Sequence[Probe], cases: int,
    save: Callable[[], None], solve: Callable[[str, Probe, Level], Measured] = measure_once,
) -> Choice:  # fmt: skip
    """Climb the meshes until one meets the target; what ``study`` holds already is not solved again.

    A mesh that meets it on ``found`` is tried on ``others``, which from then on count like the probes.
    """
    target, own, levels = float(scene.accuracy.e_n), plain(scene), ladder(scene)
    if len(levels) < FEWEST:
        note = "the scene gives the mesh itself, so nothing is left to choose and its error is not known"
        return nothing(target, note)

    def solved(level: Level, probes: Sequence[Probe]) -> list[Measured]:
        setting = setting_of(own, level)
        return study.completed(setting, probes, lambda probe: solve(setting, probe, level), save)

    probes = list(found)
    for count in range(FEWEST, len(levels) + 1):
        judged = judge(levels[:count], [solved(level, probes) for level in levels[:count]], target)
        if judged.chosen is not None and len(probes) == len(found):
            probes += others
            judged = judge(levels[:count], [solved(level, probes) for level in levels[:count]], target)
        if judged.known and judged.chosen is not None and judged.chosen < len(judged.levels) - 1:
            break
    return _told(study, own, judged, sum(len(p.forces) for p in found), target, cases)


def _told(study: CostStudy, own: Scene, judged: Judged, on_probes: int, target: float, cases: int) -> Choice:
    if not np.isfinite(judged.error).any():
        return nothing(target, judged.told)
    i = judged.best if judged.chosen is None else judged.chosen
    level, error = judged.levels[i], judged.error[i]
    seconds = float(np.mean([m.seconds for m in study.of(setting_of(own, level))]))
    text = f"largest error at {judged.cases[int(np.nanargmax(error))]}; {judged.told}"
    text += f"; choosing took as long as {study.spent / seconds:.0f} of the run's {cases} cases"
    if judged.chosen is None:
        text = f"no mesh that was tried keeps the target, this is the best that was reached; {text}"
    elif not judged.known:
        text = f"kept but where even the finest mesh is flagged, so that the error is not known; {text}"
    parts = error[:on_probes], error[on_probes:]
    measured, rest = (float(np.nanmax(e)) if np.isfinite(e).any() else math.nan for e in parts)
    return Choice(dict(level.values), target, float(np.nanmax(error)), measured, seconds, text, rest,
                  met=judged.chosen is not None and judged.known)  # fmt: skip


def fill(writer: Any, choice: Choice | None) -> None:
    """Write what the choice promises into the file, by one rank, after all cases."""
    if choice is not None:
        values = (choice.predicted, choice.measured, choice.held_out, choice.seconds)
        for name, value in zip(MEANING, values, strict=True):
            writer.write_derived(name, value)


def overrides(choice: Choice | None) -> list[str]:
    """The chosen values as overrides that say where they come from."""
    if choice is None:
        return []
    texts = [toml_text({"x": {"x": value}}).splitlines()[1].partition(" = ")[2] for value in choice.values.values()]
    made = [f"{key}={text}  # chosen" for key, text in zip(choice.values, texts, strict=True)]
    return [*made, f"# {choice}"]
