"""Which candidates are probes, and the units of work that solve them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from softjaw.study.scene import Scene


def probe_candidates(scene: Scene, units: Sequence[Any]) -> tuple[int, ...]:
    """Numbers of the candidates that are probes, rising; none where no further solve is asked for.

    Unless they are named they are units at quantiles of the e_n that a Winkler foundation gives, so they do not depend
    on how many ranks there are.
    """
    own = scene.uncertainty
    if not own.parts:
        return ()
    from softjaw.study.accuracy.cost.probes import spread  # here and below: most scenes need none of it

    if not changes(scene):
        return ()
    forces = len(scene.load.normal_force)
    first = {unit.index: unit.rows[0][0] // forces for unit in units}
    if isinstance(own.probes, int):
        return tuple(sorted(first[unit.index] for unit in spread(units, own.probes)))
    named = own.numbers(scene.candidates.labels)
    serving = {rows[0] // forces: first[unit.index] for unit in units for rows in unit.rows}
    return tuple(sorted({serving[number] for number in named}))


def changes(scene: Scene) -> tuple[str, ...]:
    """What is changed in the further solves of a probe, in words."""
    from softjaw.study.accuracy.uncertainty.variations import variations

    return tuple(variation.name for variation in variations(scene))


def with_probes(scene: Scene, units: Sequence[Any], chosen: Sequence[int]) -> tuple[Any, ...]:
    """The units of work, those of the probes marked, and as much more expensive as they are."""
    if not chosen:
        return tuple(units)
    forces, times = len(scene.load.normal_force), 1 + len(changes(scene))
    return tuple(
        replace(unit, probe=True, cost=times * unit.cost) if unit.rows[0][0] // forces in chosen else unit
        for unit in units
    )
