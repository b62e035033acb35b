"""``accuracy.e_n`` in a scene: the scene with mesh, steps and effects chosen, before a run plans its file.

The choice follows from a cost study that is kept, so the same command chooses the same again and a run can go on.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from softjaw.study.accuracy.cost.choose import Choice, choose, explicit
from softjaw.study.accuracy.cost.file import CostStudy, load, save
from softjaw.study.accuracy.cost.measure import measure_once, warm_up
from softjaw.study.accuracy.cost.study import costs, new_study
from softjaw.study.messages import OTHER_FILE, StudyError
from softjaw.study.scene import Scene
from softjaw.study.scene.problems import SceneError

CHOSEN = ("gripper.elements", "gripper.element")  # with the sections effects and accuracy: what a choice may change


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
    from softjaw.study.accuracy.cost.quick import quick_choice, quick_probes

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
    say(_told(choice))
    return choice


def _from_file(scene: Scene, say: Callable[[str], None]) -> Choice:
    from softjaw.study.accuracy.cost.probes import held_out, probes

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
    say(_told(choice))
    return choice


def stored_scene(path: Path, study: CostStudy) -> Scene:
    """The scene that a study was made from."""
    from softjaw.study.scene import parse_scene

    try:
        return parse_scene(study.scene, path, check_files=False)
    except SceneError as error:
        raise StudyError(OTHER_FILE, f"{path}: its scene cannot be read by this version: {error}") from error


def refuse_other(path: Path, scene: Scene, measured: Scene) -> None:
    """Refuse a study of another object, pad or friction; meshes, candidates and forces may differ."""
    from softjaw.study.scene.text import changes

    free = (
        "accuracy.",
        "candidates.",
        "load.",
        "effects.",
        "limit_surface.",
        "score.",
        "sweep.",
        "task.",
        "run.",
        "uncertainty.",
    )
    differ = [
        f"{key} is {there} there and {here} here"
        for key, there, here in changes(measured.effective_toml(), scene.effective_toml())
        if key not in CHOSEN and not key.startswith(free)
    ]
    if differ:
        raise StudyError(
            OTHER_FILE,
            f"accuracy.cost_file: {path} was measured for another scene ({'; '.join(differ[:3])}); expected one of this"
            " object and gripper: run 'softjaw cost' for this scene, or remove the key",
        )


def expected(scene: Scene) -> str:
    """What ``check`` can say of the target without solving anything; empty where the scene names none."""
    if scene.accuracy.e_n is None:
        return ""
    goal = f"e_n within {100 * scene.accuracy.e_n:g} %"
    if scene.accuracy.cost_file is None:
        return f"{goal}: the mesh is chosen when the run starts, by solving some ten cases on several meshes"
    path = Path(scene.accuracy.cost_file)
    study = load(path)
    measured = stored_scene(path, study)
    refuse_other(path, scene, measured)
    return f"{goal}: {_told(choose(costs(measured, with_judging=False), study, scene.accuracy.e_n, explicit(scene)))}"


def _told(choice: Choice) -> str:
    from softjaw.study.accuracy.cost.words import choice_text

    return choice_text(choice)
