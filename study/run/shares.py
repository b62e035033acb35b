"""How a plan's units of work are divided among ranks: whole candidates first, at the end their forces.

What a rank solves for a candidate whose forces are divided is the coarse path and its own forces on the fine mesh. The
coarse path takes 3 to 15 % of the time of the fine forces, 20 to 50 % on thin walls, so it is solved again rather than
waited for.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any, NamedTuple

import numpy as np

from softjaw.study.quantities import MISSING


class Share(NamedTuple):
    """Forces of one unit of work that one rank solves, by number and rising."""

    unit: Any
    forces: tuple[int, ...]

    @property
    def cost(self) -> float:
        """Work, in the measure of the unit's own; along one load path all forces up to the last one cost."""
        return self.unit.cost * (len(self.forces) / len(self.unit.rows[0]) if self.unit.apart else 1.0)

    def divided(self, parts: int) -> list[Share]:
        """The same forces in at most so many shares, of which none has more than one force more than another."""
        # dealt in turn, because the load of the coarse path and of the fine forces grows with their number
        return [self._replace(forces=self.forces[i::parts]) for i in range(min(parts, len(self.forces)))]


def costliest_first(listed: Iterable[Share]) -> list[Share]:
    """Equal costs keep their order; no rank then ends long after the others."""
    return sorted(listed, key=lambda share: -share.cost)


def makespan(costs: Sequence[float], ranks: int) -> float:
    """Time until the last unit ends when ranks take the most expensive remaining unit whenever they are free.

    >>> makespan([3.0, 3.0, 2.0, 2.0, 2.0], 2)
    7.0
    """
    busy = np.zeros(max(ranks, 1))
    for cost in sorted(costs, reverse=True):
        busy[busy.argmin()] += cost
    return float(busy.max())


def shares(units: Iterable[Any], codes: np.ndarray, ranks: int) -> list[Share]:
    """What is missing of some units by ``codes (rows,)``, in order of work, cut so that all ``ranks`` stay busy."""
    waiting = costliest_first(Share(unit, forces) for unit in units if (forces := _missing(unit, codes)))
    remaining, divided = sum(share.cost for share in waiting), list[Share]()
    for share in waiting:
        remaining -= share.cost
        # what follows keeps the others busy meanwhile
        undivided = not share.unit.apart or remaining >= ranks * share.cost
        divided += [share] if undivided or ranks == 1 else share.divided(ranks)
    return costliest_first(divided)


def divided(objects: Sequence[Sequence[Any]], codes: np.ndarray, ranks: int) -> tuple[list[Share], list[int]]:
    """What is missing of some objects, given by their units, in the order of work, and in what groups ranks take it.

    Object after object, the costliest first, each a group; forces are divided where little comes after. Of one object
    every share is a group.
    """
    undivided = [shares(units, codes, 1) for units in objects]
    costs = [sum(share.cost for share in some) for some in undivided]
    remaining, todo, sizes = sum(costs), list[Share](), list[int]()
    for k in sorted(range(len(costs)), key=lambda k: -costs[k]):
        remaining -= costs[k]
        busy = remaining >= ranks * max((share.cost for share in undivided[k]), default=0.0)
        some = undivided[k] if busy else shares(objects[k], codes, ranks)
        todo += some
        sizes += [len(some)] if len(objects) > 1 else [1] * len(some)
    return todo, sizes


def _missing(unit: Any, codes: np.ndarray) -> tuple[int, ...]:
    """Forces of a unit of which a case is missing for some candidate that it serves."""
    return tuple(k for k, rows in enumerate(zip(*unit.rows, strict=True)) if any(codes[r] == MISSING for r in rows))
