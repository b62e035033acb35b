"""Errors of a case's quantities: all that is numerical and left, added up.

The mesh, from the contacts on two meshes and from two views of the coarser ones; what pairs of solutions on the coarse
mesh tell of the steps of the load path and of effects that are left out; and a floor, because two meshes that agree by
luck prove nothing.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from softjaw.scoring.payload import BOUND_GAP
from softjaw.study.case.contact import Contact, angles
from softjaw.study.case.evaluate import LIMITS, EvaluationSettings, overestimates, quality
from softjaw.study.case.task import payload_alone
from softjaw.study.quantities import TABLE, Quantity

# The error: a share of how far the coarser mesh, or a view of it, is away at most (`estimate`), and what no mesh tells
# (`Unseen`): a floor that falls with the number of elements that bear, or that bear across the contact, `DOUBTED` times
# as large where the mesh is coarse for it. Fitted to random scenes with a reference of half the element size
# (docs/accuracy.md): there the floor tells more than the distances do.
OF_FARTHEST, DOUBTED, FLOOR, POWER = 0.3, 2.0, 0.22, 0.75
# How many times the floor: shares that a model or the curvature takes off are small differences of large numbers.
WIDER = dict.fromkeys((q.name for q in TABLE if q.error == "absolute"), 10.0) | {
    "f_x_max": 0.2, "f_y_max": 0.2, "indentation": 4.0, "wall_stress": 5.5, "wall_strain": 5.5,
}  # fmt: skip
OF_WIDTH = {"closing": 0.33, "contact_area": 1.4, "p_max": 5.0}  # the same, of what depends on the contact's width
# Of the share of the load that edges of the object bear: where such an edge lies within an element tells no mesh.
OF_EDGES = dict.fromkeys((q.name for q in TABLE), 0.12) | {
    "payload": 0.02, "safety_factor": 0.02, "f_x_max": 0.04, "f_y_max": 0.04, "closing": 0.3, "contact_area": 0.2,
    "p_max": 3.0,
}  # fmt: skip
# Of the square of the overlap where one line of nodes bears, which tells little of the contact's width.
ONE_LINE, MOST_OVERLAP = 2.0, 0.45  # elements across a contact that one line of nodes makes; overlap that counts
OF_OVERLAP = {"closing": 2.0, "contact_area": 2.6, "p_max": 70.0, "payload": 0.4, "safety_factor": 0.4}
EDGES_ROUNDED = 1.6  # times the error of a payload on the coarse mesh alone, where the object's edges are rounded
OF_PAIRS = {"p_max": 3.0}  # of what pairs differ by: peaks that an effect makes at an edge grow as elements shrink
ALIGNED, LEANING = 0.2, np.radians(15.0)  # times the floor of a payload where contacts face each other; added per angle
# Of forces along the face, which pressures alone give by balance, where friction acts back: times the floor, and of the
# share of the load that the curvature takes off.
ACTING, OF_LOSS = 2.0, 0.5
# Of that share times that of the load on edges, where the contact lies round a corner: forces and what they make.
OF_CORNERS = {"f_x_max": 1.5, "f_y_max": 1.5, "tau_z_max": 1.0, "quality": 6.0, "payload": 2.0, "safety_factor": 2.0}
PAYLOADS = ("payload", "safety_factor")  # what arms and couples leave of the friction: little of it moves all of them


class Unseen(NamedTuple):
    """Shares that no difference of two meshes shows: floors of sums over a contact and of widths; load on edges.

    ``overlap`` is how far the pad is in the object, over the closing displacement, where one line of nodes bears.
    ``lines`` of nodes, at least, share the load; ``coarse``: whether the mesh is coarse for a contact.
    """

    floor: float = 0.0
    of_width: float = 0.0
    on_edges: float = 0.0
    overlap: float = 0.0
    lines: float = np.inf
    coarse: bool = False

    @classmethod
    def of(cls, contacts: Sequence[Any], coarse: bool = False) -> Unseen:
        """On these contacts; floors, at which meshes agree by luck, are higher on a ``coarse`` mesh."""
        doubt, lines = DOUBTED if coarse else 1.0, [c.lines for c in contacts]
        floor = doubt * FLOOR / min(c.elements for c in contacts) ** POWER
        of_width = doubt * FLOOR / min(c.across for c in contacts) ** POWER
        overlap = max(min(c.overlap, MOST_OVERLAP) * (n <= ONE_LINE) for c, n in zip(contacts, lines, strict=True))
        return cls(floor, of_width, max(c.on_edges for c in contacts), overlap, min(lines), coarse)

    def part(self, q: Quantity, walled: bool) -> float:
        """How much is stated of what meshes and floors tell: less of a contact that is resolved, more on one line."""
        payload, along = q.name in PAYLOADS, q.name.startswith("f_")
        if walled and not payload:
            return 2.0 if along else 1.0
        if q.name in (("contact_area", "quality", *PAYLOADS) if self.coarse else ("contact_area", "p_max")):
            return 1.0
        least, most = 0.8 if payload or along else 0.7, 1.0 if payload or along or q.name == "closing" else 1.4
        # one line of nodes tells little of the contact's width
        return float(np.interp(self.lines, (1.7, 1.9), (most, least)))

    def share(self, q: Quantity, contacts: Sequence[Any], acts: bool = False, part: float = 1.0) -> float:
        """Of a quantity's value, ``part`` of the floors; ``acts``: whether friction acts back, or should."""
        floor = self.of_width * OF_WIDTH[q.name] if q.name in OF_WIDTH else self.floor * WIDER.get(q.name, 1.0)
        floor *= part
        if q.name == "closing" and (pad := contacts[0].state.pad).shape.element == "hex8":
            # trilinear elements close less, the less the foam can be compressed
            floor *= 0.4 + 0.2 / (1.0 - 2.0 * pad.material.poisson_ratio)
        if q.name in PAYLOADS:  # of contacts that face each other friction and the drive's force tell it, on any mesh
            floor = floor * (ALIGNED + max(angles(*contacts)) / LEANING) + BOUND_GAP
        floor += OF_OVERLAP.get(q.name, 0.0) * self.overlap**2
        of_loss = OF_LOSS * max(1.0 - c.limits["ccm"].F_N / c.limits["ccm"].S for c in contacts)
        if acts and q.name.startswith("f_"):  # the more friction, the more of it acts back
            floor = ACTING * max(1.0, contacts[0].mu / 0.8) * floor + of_loss
        else:
            floor += OF_CORNERS.get(q.name, 0.0) * self.on_edges * of_loss
        return floor + self.on_edges * OF_EDGES[q.name]


ALL_SEEN = Unseen()


def mesh_errors(
    fine: Sequence[Contact], coarse: Sequence[Contact], values: Mapping[str, Any], other: Mapping[str, Any],
    settings: EvaluationSettings, views: Sequence[Sequence[Contact]] = (),
    pairs: Sequence[tuple[Any, Any, float]] = (), unseen: Unseen = ALL_SEEN,
    left_out: float = 0.0, closes_less: float = 0.0,
) -> dict[str, float]:  # fmt: skip
    """Errors of all quantities that have one, from the contacts on the mesh and on a coarser one.

    ``values`` are those of the fine mesh, ``other`` what the coarser one says beside its contacts; keyed alike.
    ``views`` are the coarse contacts with their pressures at Gauss points and at nodes, ``pairs`` are solutions on
    the coarse mesh that differ too, and which share of that counts; ``left_out`` is a share of every value,
    ``closes_less`` one of the closing, of which others change by a part.
    """
    # of a wall that is taken as rigid: measured on bottles, cans and a marker, with half as much again
    parts = {"closing": 1.0, "quality": 0.5, "contact_area": 0.5, "p_max": 0.5, "e_n": 0.2, "tau_z_max": 0.2}
    fine_mesh, coarse_mesh = _on_mesh(values, fine), _on_mesh(other, coarse) | grasp_values(tuple(coarse), settings)
    viewed = [_sums(view) | grasp_values(tuple(view), settings) for view in views]
    compared = [(_all(low, settings), _all(high, settings), share) for low, high, share in pairs]
    acts = any(contact.state.points.friction is not None for _, high, _ in pairs for contact in high.contacts)
    walled = closes_less > 0.0 or any("wall" in q.needs and q.key in coarse_mesh for q in TABLE)
    errors = {}
    for q in (q for q in TABLE if q.error and q.key in coarse_mesh and q.name != "opening_loaded"):
        view_values = [view[q.key] for view in viewed if q.key in view]
        value, size = fine_mesh[q.key], _size(q, fine_mesh[q.key])
        # dents of walls converge with first order: as far as the coarser mesh's is away, they are off
        share = 1.0 if "wall" in q.needs else OF_FARTHEST
        part = unseen.part(q, walled)
        error = part * estimate(value, coarse_mesh[q.key], view_values, q.error, q.name in PAYLOADS, share)
        error += unseen.share(q, fine, acts or left_out > 0.0, part) * size
        if q.name in PAYLOADS:  # the larger, the more in doubt
            error = max(error, min(error * (1.0 + 1.6 * error), 1.0))
        if q.error == "relative" and not np.all(coarse_mesh[q.key]):
            error = max(error, 1.0)  # a payload of which the coarse mesh has nothing
        apart = [s * distance(low[q.key], high[q.key], q.error, value) for low, high, s in compared if q.key in low]
        more = left_out + closes_less * parts.get(q.name, 0.0)
        errors[q.of_error.key] = error + OF_PAIRS.get(q.name, 1.0) * sum(apart) + more * size
    if "maps/closing_error" in errors:  # the opening is less by what both pads close
        errors["maps/opening_loaded_error"] = 2.0 * errors["maps/closing_error"] * float(fine_mesh["maps/closing"][0])
    return errors


def coarse_errors(
    contacts: Sequence[Any], values: Mapping[str, Any], views: Sequence[Sequence[Contact]],
    settings: EvaluationSettings, rounded: bool,
) -> dict[str, float]:  # fmt: skip
    """Errors of quantities of a case that is solved on the coarse mesh alone, from the two ``views`` of its contacts.

    All count in doubt: the distance to the farther view, and the floor. ``values`` are the case's own; ``rounded``:
    whether it is a mesh's, whose edges are rounded over a part of these large elements.
    """
    solved = _on_mesh(values, contacts)
    viewed = [_sums(view) | grasp_values(tuple(view), settings) for view in views]
    unseen, errors = Unseen.of(contacts), {}
    for q in (q for q in TABLE if q.error and q.key in viewed[0]):
        apart = max(distance(solved[q.key], view[q.key], q.error) for view in viewed)
        # friction that is left out here may move any of them as much
        share = max(unseen.share(q, contacts), unseen.floor * (1.3 if q.name in PAYLOADS else 1.0))
        doubt = DOUBTED * (EDGES_ROUNDED if rounded and q.name in PAYLOADS else 1.0)
        errors[q.of_error.key] = doubt * (apart + share * _size(q, solved[q.key]))
    return errors


def _size(q: Quantity, value: ArrayLike) -> float:
    """What a share of a value is in the unit of its error."""
    return 1.0 if q.error == "relative" else float(np.max(np.abs(value)))


def estimate(
    fine: ArrayLike, coarse: ArrayLike, views: Sequence[ArrayLike], kind: str, remainder: bool = False,
    share: float = OF_FARTHEST,
) -> float:  # fmt: skip
    """Error of a number on the finer mesh: a ``share`` of the way to the farthest of the coarser one and its ``views``.

    The difference of two meshes alone passes through zero where the contact's edge lies alike on both; those to the
    views of the coarse contact do not. A ``remainder`` of larger numbers is in doubt more than in proportion, twice
    as much where one is a whole value away.
    """
    farthest = max(distance(fine, other, kind) for other in (coarse, *views))
    return share * farthest * (1.0 + remainder * min(farthest, 1.0))


def distance(value: ArrayLike, other: ArrayLike, kind: str, of: ArrayLike | None = None) -> float:
    """How far a number, or that of the finger where it is most, is from another solution's.

    ``kind`` as in `quantities.Quantity.error`, a share ``of`` the number itself by default; NaN where that is zero.
    """
    v, o = np.asarray(value, float), np.asarray(other, float)
    apart, size = np.abs(o - v), v if of is None else np.asarray(of, float)
    if kind == "relative":
        apart = np.divide(apart, size, out=np.full(v.shape, np.nan), where=size > 0)
    return float(apart.max())


def _all(solution: Any, settings: EvaluationSettings) -> dict[str, Any]:
    """All values that have an error, of a solution."""
    contacts = solution.contacts
    values = {"maps/closing": np.mean([c.state.closing for c in contacts])} | solution.fingers.wall_values(contacts)
    return _on_mesh(values, contacts) | grasp_values(tuple(contacts), settings)


def _on_mesh(values: Mapping[str, Any], contacts: Sequence[Contact]) -> dict[str, Any]:
    """Values of a case, with those of each finger that its contacts alone tell."""
    # of one value for each friction model the curved one's, which comes first; fits would double the time
    curved = {key: np.ravel(value)[:1] for key, value in values.items()}
    faces = {"maps/contact_area": [c.area for c in contacts], "maps/p_max": [c.largest_pressure for c in contacts]}
    return curved | _sums(contacts) | faces


@lru_cache(maxsize=32)  # of a candidate: each effect, refinement and pair of solutions asks for some of them again
def grasp_values(contacts: tuple[Contact, ...], settings: EvaluationSettings) -> dict[str, Any]:
    """Quality of the ellipsoids and payload ``(1,)`` in the curved model."""
    values = {"maps/quality": quality(contacts, settings)}
    values |= payload_alone(contacts, settings.task)
    return {key: [value] for key, value in values.items()}


def _sums(contacts: Sequence[Contact]) -> dict[str, Sequence[float]]:
    """Quantities whose errors follow from sums over the contacts, of each finger where it has its own."""
    ccm = [c.limits["ccm"] for c in contacts]
    values: dict[str, Sequence[float]] = {
        key: [getattr(limits, name) for limits in ccm] for name, key in (("e_n", "e_n"), *LIMITS)
    }
    values["curvature_loss"] = [1.0 - sum(limits.F_N for limits in ccm) / sum(limits.S for limits in ccm)]
    values |= {key: [value] for key, value in overestimates(contacts).items()}
    return {f"maps/{key}": value for key, value in values.items()}
