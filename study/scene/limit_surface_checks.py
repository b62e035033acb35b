"""Which limit surfaces a scene may ask for, and of which candidates it may store the wrenches."""

from __future__ import annotations

from collections.abc import Iterator

from softjaw.study.scene.errors import Finding, closest, shown
from softjaw.study.scene.score_sections import LimitSurface, Task
from softjaw.study.scene.sections import Candidates, Effects

LEVELS = {  # level of the effect: models of [limit_surface]
    "three_motions": ("three_motions",), "fitted_ellipsoid": ("full", "axis_aligned"), "quartic": ("quartic",),
}  # fmt: skip
PROGRAMMES = ("full", "quartic")  # models that can be fitted by a programme too


def surface_choice(surface: LimitSurface, effects: Effects) -> Iterator[Finding]:
    """A forced level is the model's, and only some models have several objectives."""
    level, models = effects.limit_surface, LEVELS.get(effects.limit_surface, ())
    if models and surface.model not in models:
        expected = f"the level of limit_surface.model, which is {shown(surface.model)}"
        remedy = f'write `model = "{models[0]}"` in [limit_surface], or "auto" here'
        yield Finding(("effects", "limit_surface"), shown(level), expected, remedy)
    if surface.objective == "zhou" and surface.model not in PROGRAMMES:
        found, expected = f'"zhou" with model {shown(surface.model)}', f"it with model {' or '.join(PROGRAMMES)}"
        yield Finding(("limit_surface", "objective"), found, expected, 'write `objective = "least_squares"`')


def sampled_candidates(surface: LimitSurface, candidates: Candidates) -> Iterator[Finding]:
    """Numbers and labels of wrench_samples that no candidate has."""
    wanted, labels = surface.wrench_samples, candidates.labels
    for i, name in enumerate(() if isinstance(wanted, str) else wanted):
        path = ("limit_surface", "wrench_samples", i)
        if isinstance(name, int) and not 0 <= name < len(labels):
            last = len(labels) - 1
            yield Finding(path, f"{name}", f"a candidate's number, 0 to {last}", "numbers count stations, then angles")
        elif isinstance(name, str) and name not in labels:
            near = closest(name, labels)
            remedy = f"did you mean {shown(near)}?" if near else f"write the candidate's number, 0 to {len(labels) - 1}"
            yield Finding(path, shown(name), f"a candidate's label, as {shown(labels[0])}", remedy)


def weight(task: Task) -> Iterator[Finding]:
    """The weight needs a direction."""
    if not any(abs(v) > 1e-9 for v in task.weight_direction):
        path = ("task", "weight_direction")
        yield Finding(path, shown(list(task.weight_direction)), "a direction", "write for example [0, 0, -1]")
