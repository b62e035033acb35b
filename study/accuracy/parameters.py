"""The parameters that trade accuracy for time, each a series of levels, the cheapest first.

A discretisation parameter changes the contact solve: its levels are values of scene keys. What a scene cannot use is
left out with the reason that the scene's own checks give, so an effect that is added to ``[effects]`` becomes a
parameter without a word here. An evaluation parameter changes what is computed from a solved contact.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, get_args

from softjaw.study.case.build import has_wall
from softjaw.study.quantities import EFFECTS
from softjaw.study.run.plan import wall_size
from softjaw.study.scene import Scene, SceneError
from softjaw.study.scene.sections import Accuracy, Effects, WallSize

HEX8 = (0.5, 0.5**0.5, 1.0, 2.0**0.5, 2.0, 2.0**1.5)  # elements along a side over those of the reference mesh
HEX27 = (0.3, 0.5, 0.7, 1.0)
WALL = (2.0, 2.0**0.5, 1.0, 0.5**0.5, 0.5)  # sizes over those of the scene
LIMITS = get_args(WallSize)[1].metadata  # of the sizes that a scene may give
STEPS_PER_ELEMENT = 4  # of a mesh object's automatic grid, as fem.objects.mesh_object has it
OWN = ("friction", "limit_surface")  # effects whose levels are evaluation parameters
EACH_ALONE = -1
WEIGHT_POWER = 1.6  # time of a contact solve over its unknowns
# Time over that of the level which is taken for granted, about; more than the unknowns say.
DEARER = {
    "gripper.element": {"hex27": 1.25}, "effects.sheet": {"elastic": 1.3},
    "effects.object": {"linear_shell": 0.75}, "effects.friction_pressure_coupling": {"tangential": 4.0},
}  # fmt: skip
SAMPLES = (50, 100, 200, 500, 1000, 2000, 4000)
SURFACES = {  # name -> model and objective of ``[limit_surface]``
    "three motions": ("three_motions", "least_squares"), "axis-aligned ellipsoid": ("axis_aligned", "least_squares"),
    "full ellipsoid": ("full", "least_squares"), "full ellipsoid, zhou": ("full", "zhou"),
    "quartic": ("quartic", "least_squares"), "quartic, zhou": ("quartic", "zhou"),
}  # fmt: skip
HULL = 3000  # wrenches whose hull is the reference solution of the limit surfaces
POINTS = {"hull of 20 points": 20, "hull of 50 points": 50}
SLOW = {"hull of 20 points": 0.5, "hull of 50 points": 5.0}  # s, expected of one case
WINKLER = "Winkler foundation, planar contact"


@dataclass(frozen=True)
class Level:
    """One setting of a parameter.

    Parameters
    ----------
    name : str
    values : tuple of pairs
        Scene keys with dots, and their values.
    size : float
        What the error is a power of (an element's size, ...); NaN where no order is expected.
    between : int
        Forces solved between those that are wanted; `EACH_ALONE` solves each from scratch.
    work : float
        Expected time over that of the scene as it is, by `weight`: measured times change from run to run.
    """

    name: str
    values: tuple[tuple[str, Any], ...] = ()
    size: float = math.nan
    between: int = 0
    work: float = 1.0


@dataclass(frozen=True)
class Parameter:
    """A refinement series: levels of one parameter, the cheapest first.

    ``formal`` is the highest order that an extrapolation may use; parameters of one ``family`` lead to the same limit.
    ``own`` is the place of the scene's own setting, -1 where that is no level. ``evaluation`` parameters leave the
    contact as it is.
    """

    name: str
    long_name: str
    levels: tuple[Level, ...]
    own: int = -1
    formal: float = math.nan
    family: str = ""
    evaluation: bool = False


@dataclass(frozen=True)
class Skipped:
    """A level that is not measured, and why."""

    parameter: str
    level: str
    reason: str


def contact_parameters(scene: Scene) -> tuple[list[Parameter], list[Skipped]]:
    """Discretisation parameters of a scene; every level is a scene that its checks accept."""
    made = [*_pad_meshes(scene), *_object_mesh(scene), _load_steps(), _collocation()]
    parameters, skipped = [], []
    for parameter in (*made, *_effects(scene)):
        good: list[Level] = []
        for level in parameter.levels:
            if reason := refusal(scene, level):
                skipped.append(Skipped(parameter.name, level.name, reason))
            else:
                paths = {0: 1.0, EACH_ALONE: 1.5}.get(level.between, float(level.between))
                good.append(replace(level, work=paths * weight(with_level(scene, level)) / weight(scene)))
        # By digest: a level may spell out what the scene has by default.
        own = (i for i, g in enumerate(good) if not g.between and with_level(scene, g).digest == scene.digest)
        # A single level leaves nothing to compare.
        if len(good) > 1:
            parameters.append(replace(parameter, levels=tuple(good), own=next(own, -1)))
    return parameters, skipped


def with_level(scene: Scene, level: Level) -> Scene:
    """The scene, without its sweep, with the values of a level."""
    return scene.with_values(dict(level.values))


def refusal(scene: Scene, level: Level) -> str:
    """Why a scene cannot have a level; empty if it can."""
    try:
        with_level(scene, level)
    except SceneError as error:
        return "; ".join(f"{p.key}: found {p.found}, expected {p.expected}" for p in error.problems)
    return ""


def value_of(scene: Scene, key: str) -> Any:
    """Value of a dotted key of a scene."""
    section, _, name = key.partition(".")
    return getattr(getattr(scene, section), name)


def weight(scene: Scene) -> float:
    """Expected time of one force, in any unit: by the unknowns of pad and wall, and by what effects cost."""
    times = math.prod(levels.get(value_of(scene, key), 1.0) for key, levels in DEARER.items())
    if has_wall(scene.object) and scene.effects.object != "rigid" and (wall := wall_size(scene)):
        return times * float(wall.pad + wall.shell) ** WEIGHT_POWER
    per_side = {"hex8": 1, "hex27": 2}[scene.gripper.element]
    return times * float(math.prod(per_side * n + 1 for n in scene.gripper.elements)) ** WEIGHT_POWER


def _even(value: float) -> int:
    # Even, so that planes of symmetry can halve the mesh.
    return max(2, 2 * math.floor(value / 2 + 0.5))


def elements(count: Sequence[int], factor: float) -> tuple[int, int, int]:
    """So many times the elements along every side, even along length and width.

    >>> elements((20, 10, 6), 0.5), elements((20, 10, 6), 1.0)
    ((10, 6, 3), (20, 10, 6))
    """
    # The scene's own mesh stays as it is, also where it is not even.
    if factor == 1.0:
        return count[0], count[1], count[2]
    return (_even(factor * count[0]), _even(factor * count[1]), max(2, math.floor(factor * count[2] + 0.5)))


def _pad_meshes(scene: Scene) -> Iterable[Parameter]:
    """Both kinds of elements; a triquadratic mesh has the nodes of a trilinear one of twice as many along a side."""
    own, kind = scene.gripper.elements, scene.gripper.element
    trilinear = own if kind == "hex8" else elements(own, 2.0)
    yield _pad_mesh("hex8", "trilinear", trilinear, HEX8, 2.0)
    yield _pad_mesh("hex27", "triquadratic", own if kind == "hex27" else trilinear, HEX27, 3.0)


def _pad_mesh(kind: str, degree: str, own: Sequence[int], factors: Sequence[float], formal: float) -> Parameter:
    # A set, because factors near each other round to the same mesh.
    counts = sorted({elements(own, f) for f in factors}, key=math.prod)
    levels = tuple(
        Level(" x ".join(map(str, n)), (("gripper.elements", list(n)), ("gripper.element", kind)),
              math.prod(n) ** (-1 / 3))
        for n in counts
    )  # fmt: skip
    name, long_name = f"pad mesh, {kind}", f"{degree} elements of the pad"
    return Parameter(name, long_name, levels, formal=formal, family="pad mesh")


def _object_mesh(scene: Scene) -> Iterable[Parameter]:
    """The wall's mesh, or the grid on which a mesh's distance is sampled; other objects are exact."""
    if has_wall(scene.object) and scene.effects.object != "rigid":
        least, most = (getattr(limit, name) for limit, name in zip(LIMITS, ("ge", "le"), strict=True))
        sizes = [min(max(round(f * scene.accuracy.wall_element_mm, 3), least), most) for f in WALL]
        levels = [
            Level(f"{size:g} mm", (("accuracy.wall_element_mm", size),), f) for f, size in zip(WALL, sizes, strict=True)
        ]
        yield Parameter("wall mesh", "elements of the wall, round the object", tuple(levels), formal=2.0)
    elif scene.object.shape == "mesh":
        own = scene.object.grid_step_mm
        sides = zip(scene.gripper.pad_size[:2], scene.gripper.elements, strict=False)
        start = 1e3 * min(side / n for side, n in sides) / STEPS_PER_ELEMENT if own == "auto" else own
        steps = dict.fromkeys((2 * start, 2**0.5 * start, "auto" if own == "auto" else own, start / 2**0.5))
        grid = {step: start if step == "auto" else float(step) for step in steps}
        levels = [Level("auto" if step == "auto" else f"{size:.3g} mm", (("object.grid_step_mm", step),), size)
                  for step, size in grid.items()]  # fmt: skip
        long_name = "step of the grid on which the object's distance is sampled"
        yield Parameter("object grid", long_name, tuple(levels), formal=2.0)


def _load_steps() -> Parameter:
    levels = (
        Level("one after the other"), Level("each from scratch", between=EACH_ALONE), Level("1 between", between=1),
        Level("3 between", between=3),
    )  # fmt: skip
    return Parameter("load steps", "forces solved on the way to each force", levels)


def _collocation() -> Parameter:
    _, *rules = get_args(Accuracy.model_fields["contact"].annotation)  # without "auto"
    levels = tuple(Level(rule, (("accuracy.contact", rule),)) for rule in rules)
    long_name = "gaps that vanish on average round nodes, or at nodes"
    return Parameter("gap collocation", long_name, levels, family="pad mesh")


def _effects(scene: Scene) -> Iterable[Parameter]:
    """A parameter for every effect with levels to choose from, in the order of `study.quantities.EFFECTS`."""
    for name, field in Effects.model_fields.items():
        levels = [level for level in get_args(field.annotation) if level != "auto"]
        if name in OWN or len(levels) < 2 or (name == "object" and not has_wall(scene.object)):
            continue
        order = [text.split()[0] for text in EFFECTS.get(name, ())]
        ranked = sorted(levels, key=lambda v: order.index(v.split("_")[0]) if v.split("_")[0] in order else len(order))
        if name == "object":  # chosen for every candidate, at most the finest
            ranked.insert(-1, "auto")
        steps = tuple(Level(v.replace("_", " "), ((f"effects.{name}", v),)) for v in ranked)
        yield Parameter(f"effect: {name.replace('_', ' ')}", "level of the effect", steps)


def evaluation_parameters(scene: Scene) -> list[Parameter]:
    """Parameters of what is computed from a solved contact; the last level is the reference solution."""
    series = {
        "contact model": [WINKLER, "finite elements, planar", "finite elements, curved"],
        "motions sampled": [str(n) for n in sorted({*SAMPLES, scene.limit_surface.samples})],
        "limit surface": [*SURFACES, f"hull of {HULL} wrenches"],
        "score": [*POINTS, "exact"],
    }
    return [Parameter(name, "", tuple(map(Level, levels)), evaluation=True) for name, levels in series.items()]


def expected_seconds(parameter: str, level: str) -> float:
    """Rough time of one case of an evaluation parameter [s], before anything is measured."""
    return SLOW.get(level, 0.03) * (1 if parameter == "score" else 2)
