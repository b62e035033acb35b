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

from softjaw.study.accuracy.choose import Choice, Solve, choose, e_n, stored_costs, unchanged
from softjaw.study.accuracy.combinations import allowed, explicit
from softjaw.study.accuracy.convergence import extrapolate, flagged, flags_of, places, unsure
from softjaw.study.accuracy.cost_study import CostStudy, Measured, load, new_study, plain, save, setting_of
from softjaw.study.accuracy.measure import measure_once, warm_up
from softjaw.study.accuracy.parameters import Level, Parameter, contact_parameters, weight, with_level
from softjaw.study.case import candidates
from softjaw.study.case.probes import Probe, demanding, held_out, probes, probes_at
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]
FORMAL = 2.0  # highest order that is believed
ALIKE = 1e-6  # errors that differ by less of themselves are equal
FEWEST = 3  # meshes: two coarse ones can agree by chance
MOST_WEIGHT = 40.0  # no mesh is more than so many times as heavy as the scene's own


def settled(scene: Scene, output: Path, say: Callable[[str], None]) -> tuple[Scene, Choice | None]:
    """The scene with the chosen values put in, and the choice; the scene as it is where it names no target."""
    if scene.accuracy.e_n is None:
        return scene, None
    choice = _from_file(scene) if scene.accuracy.cost_file else _from_meshes(scene, output, say)
    say(str(choice))
    return with_choice(scene, choice), choice


def with_choice(scene: Scene, choice: Choice) -> Scene:
    """The scene with the chosen values put in, its sweep kept."""
    point = scene.with_values(choice.values)
    sections = ("effects", "gripper", "accuracy", "object")
    return scene.model_copy(update={name: getattr(point, name) for name in sections})


def cost_path(output: Path) -> Path:
    """Where the small study of a run is kept.

    >>> cost_path(Path("results/bottle.hdf")).as_posix()
    'results/bottle-target.hdf'
    """
    return output.with_name(f"{output.stem}-target.hdf")


def _from_meshes(scene: Scene, output: Path, say: Callable[[str], None]) -> Choice:
    path = cost_path(output)
    found, others, cases = quick_probes(scene)
    study = new_study(scene, found, getattr(scene.object, "name", None) or output.stem, "")
    if path.exists():
        # A study of another scene, or of other probes, would choose for the wrong cases.
        old = load(path)
        if old.digest == study.digest and old.candidates == study.candidates:
            study = old
    if not study.measured:
        say(f"accuracy.e_n = {scene.accuracy.e_n:g}: choosing the mesh on {'; '.join(study.candidates)}")
        # Times of a cold start would enter the choice's price per case.
        warm_up(found[0])
    return quick_choice(scene, study, found, others, cases, lambda: save(path, study))


def _from_file(scene: Scene) -> Choice:
    study, measured = stored_costs(scene)
    named = [label for label in study.candidates if label in measured.scene.candidates.labels]
    found, others = [], []
    # Probes that are no candidates by name cannot be solved again, so the prediction has to do.
    if len(named) == len(study.candidates):
        found = probes(measured.scene, named)
        others = held_out(measured.scene, found)
        warm_up(found[0])
    solve = measure_once if found else None
    choice = choose(measured, study, float(scene.accuracy.e_n or 0.0), explicit(scene), found, others, solve)
    save(Path(str(scene.accuracy.cost_file)), study)
    return choice


def refinement_series(scene: Scene) -> list[Level]:
    """Meshes of pad and wall together, the coarsest first; only what the scene leaves open changes."""
    own = plain(scene)
    # the kind of elements stays that of the scene, so what it says of that excludes nothing
    given = {key: value for key, value in explicit(scene).items() if key != "gripper.element"}
    parameters = {p.name: p for p in contact_parameters(own)[0]}
    pads = _open(parameters.get(f"pad mesh, {own.gripper.element}"), given)
    walls = _open(parameters.get("wall mesh"), given) or _open(parameters.get("object grid"), given)
    # Coarse first, like the pads, so that the pairs refine together.
    walls.sort(key=lambda level: -level.size)
    made = pads or walls
    if pads and walls:
        pairs = zip(pads, walls, strict=False)
        made = [Level(f"{p.name}; wall {w.name}", p.values + w.values, p.size) for p, w in pairs]
    # A mesh much heavier than the scene's own would cost more than the run that it is chosen for.
    most = MOST_WEIGHT * weight(own)
    return [level for level in made if weight(with_level(own, level)) <= most]


def _open(parameter: Parameter | None, given: Mapping[str, Any]) -> list[Level]:
    return [level for level in parameter.levels if allowed(level, given)] if parameter else []


def quick_probes(scene: Scene) -> tuple[list[Probe], list[Probe], int]:
    """Probes at the lowest and the highest force, the cases that the choice is tried on, and all cases of the run."""
    units, forces = candidates.units(scene, lambda point: point.axis_symmetry), scene.load.normal_force
    found = probes_at(scene, demanding(units), tuple(dict.fromkeys((forces[0], forces[-1]))))
    return found, held_out(scene, found), len(units) * len(forces)


@dataclass(frozen=True)
class MeshErrors:
    """What meshes are worth, the coarsest first.

    Attributes
    ----------
    levels : list of Level
        Those that solve every case that any mesh solves.
    cases : list of str
        In words.
    error : (levels, cases) array
        Relative distance of e_n from the limit of all meshes, and the error estimate of that limit: the largest of this
        mesh and all finer ones. NaN where that is not known.
    good : (levels,) array of bool
        Whether a mesh keeps the target, and neither it nor a finer one is flagged.
    flagged : (levels,) array of bool
        Whether a mesh carries a flag that the finest does not.
    known : bool
        Whether no case is flagged as coarse on the finest mesh too, so that its error is not known.
    note : str
        How the limit was found, and what stands against trusting it.
    """

    levels: list[Level]
    cases: list[str]
    error: FloatArray
    good: NDArray[np.bool_]
    flagged: NDArray[np.bool_]
    known: bool
    note: str

    @property
    def chosen(self) -> int | None:
        """The coarsest good mesh, if there is one."""
        return int(self.good.argmax()) if self.good.any() else None

    @property
    def best(self) -> int:
        """The most accurate mesh without a flag that the finest does not carry; of equals the coarsest."""
        worst = np.where(self.flagged, np.inf, np.nanmax(self.error, axis=1))
        return int(np.argmax(worst <= worst.min() * (1 + ALIKE)))


def mesh_errors(levels: Sequence[Level], found: Sequence[Sequence[Measured]], target: float) -> MeshErrors:
    """Errors of meshes by what was measured on them, ``found[level][probe]``."""
    values, flags = np.array([e_n(own) for own in found]), np.array([flags_of(own) for own in found])
    names = places(found[0])
    alive = np.isfinite(values).any(axis=0)
    # A mesh that fails where another does not gives no values to extrapolate.
    sound = np.isfinite(values[:, alive]).all(axis=1)
    kept = [level for level, own in zip(levels, sound, strict=True) if own]
    last = flags[sound][-1] if kept else np.zeros(len(names), np.int64)
    # A limit that is flagged itself is none to measure errors from.
    sure = alive & ~unsure(last)
    notes = [f"{level.name} failed on a probe" for level, own in zip(levels, sound, strict=True) if not own]
    notes += [f"no mesh solves {name}" for name, own in zip(names, alive, strict=True) if not own]
    notes += [f"even the finest mesh is flagged at {names[k]}" for k in np.flatnonzero(alive & ~sure)]
    error = np.full((len(kept), len(names)), np.nan)
    if len(kept) < FEWEST or not sure.any():
        few = [f"only {len(kept)} meshes could be solved on the probes"] if len(kept) < FEWEST else []
        none = np.zeros(len(kept), bool)
        return MeshErrors(kept, names, error, none, none, False, "; ".join(notes + few))
    own = values[np.ix_(sound, sure)]
    end = extrapolate([level.size for level in kept], own, FORMAL)
    error[:, sure] = _no_luck((np.abs(own - end.value) + end.error_estimate) / np.abs(end.value))
    carried = flagged(flags[sound], last)[:, sure].any(axis=1)
    notes += [f"{kept[i].name} is flagged where the finest mesh is not" for i in np.flatnonzero(carried)]
    # A flag on a finer mesh also spoils the coarser ones: these were unflagged by chance.
    good = (np.nanmax(error, axis=1) <= target) & ~_no_luck(carried)
    notes.insert(0, f"no order seen: {end.note}" if end.note else f"observed order {end.order:.1f}")
    return MeshErrors(kept, names, error, good, carried, bool((sure | ~alive).all()), "; ".join(notes))


def _no_luck(errors: NDArray[Any]) -> NDArray[Any]:
    """Errors ``(levels, ...)`` that are no smaller than those of any finer level: chance may make one small."""
    return np.maximum.accumulate(errors[::-1])[::-1]


def quick_choice(
    scene: Scene, study: CostStudy, found: Sequence[Probe], others: Sequence[Probe], cases: int,
    save: Callable[[], Any], solve: Solve = measure_once,
) -> Choice:  # fmt: skip
    """Refine the mesh until one meets the target; what ``study`` holds already is not solved again.

    A mesh that meets it on ``found`` is tried on ``others``, which from then on count like the probes.
    """
    target, own, levels = float(scene.accuracy.e_n or 0.0), plain(scene), refinement_series(scene)
    if len(levels) < FEWEST:
        note = "the scene gives the mesh itself, so nothing is chosen and the error is not known"
        return unchanged(target, note)

    def solved(level: Level) -> list[Measured]:
        setting = setting_of(own, level)
        return study.completed(setting, tried, lambda probe: solve(setting, probe, level), save)

    tried = list(found)
    for count in range(FEWEST, len(levels) + 1):
        errors = mesh_errors(levels[:count], [solved(level) for level in levels[:count]], target)
        if errors.chosen is not None and len(tried) == len(found):
            tried += others
            errors = mesh_errors(levels[:count], [solved(level) for level in levels[:count]], target)
        # Not the finest tried: with nothing finer beyond it, it would be judged by its own limit.
        if errors.known and errors.chosen is not None and errors.chosen < len(errors.levels) - 1:
            break
    return _choice(study, own, errors, sum(len(p.forces) for p in found), target, cases)


def _choice(study: CostStudy, own: Scene, errors: MeshErrors, on_probes: int, target: float, cases: int) -> Choice:
    if not np.isfinite(errors.error).any():
        return unchanged(target, errors.note)
    i = errors.best if errors.chosen is None else errors.chosen
    level, error = errors.levels[i], errors.error[i]
    seconds = float(np.mean([m.seconds for m in study.of(setting_of(own, level))]))
    note = f"largest error at {errors.cases[int(np.nanargmax(error))]}; {errors.note}"
    note += f"; choosing took as long as {study.spent / seconds:.0f} of the run's {cases} cases"
    if errors.chosen is None:
        note = f"no mesh that was tried meets the target, this is the best one; {note}"
    elif not errors.known:
        note = f"met, except where even the finest mesh is flagged and the error is not known; {note}"
    parts = error[:on_probes], error[on_probes:]
    measured, rest = (float(np.nanmax(e)) if np.isfinite(e).any() else math.nan for e in parts)
    return Choice(dict(level.values), target, float(np.nanmax(error)), measured, seconds, note, rest,
                  met=errors.chosen is not None and errors.known)  # fmt: skip
