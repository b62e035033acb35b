"""95 % intervals in a result file: what they are, and how they follow from cases and probes once all are solved.

What has a closed form is taken from it; errors of a few probes are carried to all cases.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from softjaw.study.case.candidates import axes
from softjaw.study.case.result import TIE
from softjaw.study.case.variations import by_formula, variations
from softjaw.study.flags import LOST
from softjaw.study.result.layout import DONE, Derived
from softjaw.study.scene import Scene

if TYPE_CHECKING:
    from softjaw.study.result.write import ResultWriter

FloatArray = NDArray[np.float64]
NAMES = {"e_n": "m", "quality": ""}
SIGNED = ("mu", "modulus")
WORDS = {
    "mesh": "the mesh (the difference to one with half as many elements per direction; the error is usually smaller)",
    "mu": "mu", "modulus": "the shear modulus", "wall": "the thickness of the wall", "pose": "the gripper's pose",
}  # fmt: skip
RULES = {
    "mesh": "Carried from the probes: twice the root mean square over probes and forces of change x contact area, over"
            " the contact area of the case.",
    "map": "The map of the error.",
    "mu": "In closed form: e_n does not depend on mu; half the difference between the qualities with mu + and - its"
          " half-width, which goes with mu^5 where the contacts face each other and is scored again elsewhere.",
    "modulus": "In closed form: the state depends on force over modulus only, so it is minus the slope of ln(value)"
               " over ln(force) times the half-width.",
    "pose": "Carried from the probes: at each force twice the root mean square of their changes (of two sides the"
            " larger); at least the map's own slope along the stations times the shift, where the pads lie along it.",
    "probes": "Carried from the probes: at each force twice the root mean square of their changes (of two sides the"
              " larger).",
}  # fmt: skip
TIMES = 2.0  # root mean squares of the probes that an uncertainty interval is wide: about 95 of 100 cases lie within


def interval(name: str) -> str:
    """Name of the dataset with the half-widths of a quantity."""
    return f"{name}_interval"


def part(name: str, of: str, signed: bool) -> str:
    """Name of the dataset with one part of them, relative: with a sign where it is known at every case."""
    return f"{name}_change_{of}" if signed else f"{name}_interval_{of}"


def derived(scene: Scene) -> list[Derived]:
    """Uncertainty intervals and their parts, where the scene asks for them."""
    own = scene.uncertainty
    if not own.parts:
        return []
    known, over = by_formula(scene), tuple(axis.name for axis in axes(scene))
    made = []
    for name, units in NAMES.items():
        text = (
            f"Half-width around {name} (CCM) within which about 95 of 100 cases lie: root of the sum of squares of"
            f" the parts {', '.join(own.parts)}, times the value."
        )
        made.append(Derived(interval(name), units, f"half-width of the uncertainty interval of {name}", text, over))
        for of in own.parts:
            signed = of in SIGNED and of in known
            rule = RULES[_rule(of, known)]
            text = f"Relative change of {name} (CCM) by {WORDS[of]}"
            text += ", positive where it grows with it. " if signed else ", without sign. "
            made.append(
                Derived(part(name, of, signed), "", f"part of {of} in the interval of {name}", text + rule, over)
            )
    return made


def _rule(of: str, known: tuple[str, ...]) -> str:
    if of == "mesh":
        return "map" if of in known else "mesh"
    return of if of in known or of == "pose" else "probes"


def finalise(writer: ResultWriter, scene: Scene) -> None:
    """Fill the uncertainty intervals, by one rank, after all cases."""
    own = scene.uncertainty
    if not own.parts:
        return
    known = by_formula(scene)
    for name in NAMES:
        values = _done(writer, f"{name}/ccm")
        total = np.zeros(values.shape)
        for of in own.parts:
            share = _share(writer, scene, name, values, of, known)
            # A failed case has no interval, whatever the probes say.
            share = np.where(np.isfinite(values), share, np.nan)
            writer.write_derived(part(name, of, of in SIGNED and of in known), share)
            total += share**2
        writer.write_derived(interval(name), np.sqrt(total) * np.abs(values))


def _done(writer: ResultWriter, path: str) -> FloatArray:
    """A map, NaN where a case is not solved."""
    return np.where(writer.codes().reshape(writer.layout.shape) == DONE, writer.read(path), np.nan)


def _share(
    writer: ResultWriter, scene: Scene, name: str, values: FloatArray, of: str, known: tuple[str, ...]
) -> FloatArray:
    """One part of an uncertainty interval, relative, of every case."""
    own = scene.uncertainty
    if of not in known:
        return _from_probes(writer, scene, name, values, of)
    if of == "mesh":
        return _done(writer, f"{name}_error/{name}_error")
    if of == "modulus":
        force = np.asarray(scene.load.normal_force)
        return change_by_modulus(force, values, own.shear_modulus_percent / 100)
    if name == "e_n":
        return np.zeros(values.shape)
    from softjaw.study.case.probing import change_by_mu

    return change_by_mu(writer.result(), scene, values)


def _from_probes(writer: ResultWriter, scene: Scene, name: str, values: FloatArray, of: str) -> FloatArray:
    """What the further solves of the probes say of every case."""
    layout, solves = writer.layout, variations(scene)
    mine = [i for i, v in enumerate(solves) if v.part == of]
    flat = values.reshape(-1, values.shape[-1])
    at = list(layout.probes)
    # Probes that failed divide by NaN or 0; the mean below leaves them out.
    with np.errstate(divide="ignore", invalid="ignore"):
        changes = (
            writer.read(f"probes/{name}").reshape(len(at), flat.shape[-1], -1)[..., mine] / flat[at][..., None] - 1
        )
    change = largest_side(changes, [solves[i].pair for i in mine])
    sound = _sound(writer, at, change)
    if of == "mesh":
        area = _done(writer, "contact_area/contact_area").reshape(flat.shape)
        share = carried(sound, area[at], area)
    else:
        share = carried_by_force(sound, flat.shape)
    if of == "pose":
        # fmax: where one of the two is not known, the other still counts.
        share = np.fmax(share, _slope(scene, values).reshape(flat.shape))
    return at_least_own(share, change, layout.probes, flat).reshape(values.shape)


def _slope(scene: Scene, values: FloatArray) -> FloatArray:
    """Change by the shift that neighbouring stations show; 0 where there are none in the direction of the shift."""
    where = scene.candidates
    # Poses have no order to take a slope along, and a rolled pad does not lie along the stations.
    if where.poses or where.roll or len(where.station_values) < 2:
        return np.zeros(values.shape)
    return change_along(np.array(where.station_values), values, scene.uncertainty.pose)


def _sound(writer: ResultWriter, at: list[int], change: FloatArray) -> FloatArray:
    """Changes of the probes but of those that fail in the hand, unless all do."""
    # Flags are stored as floats, NaN where a case has none.
    flags: Any = np.nan_to_num(writer.read("flags/flags").reshape(-1, change.shape[-1])[at]).astype(int)
    sound = np.where(flags & LOST, np.nan, change)
    return sound if np.isfinite(sound).any() else change


# --- sensitivities, on plain arrays -----------------------------------------------------------------------------------


def carried(change: FloatArray, area: FloatArray, all_areas: FloatArray) -> FloatArray:
    """Error of the mesh of every case from that of the probes: it falls with the number of loaded faces.

    Parameters
    ----------
    change : (p, k) array
        Relative differences between two meshes at the probes, for each force; NaN where there are none.
    area : (p, k) array
        Their contact areas.
    all_areas : (..., k) array
        Those of all cases.

    Returns
    -------
    (..., k) array
        Twice the root mean square of change x area over probes and forces, over the area of each case.

    Examples
    --------
    >>> carried(np.array([[0.02, 0.01]]), np.array([[1.0, 2.0]]), np.array([[1.0, 2.0, 4.0]])).tolist()
    [[0.04, 0.02, 0.01]]
    """
    return TIMES * _rms(change * area, None) / all_areas


def carried_by_force(change: FloatArray, shape: tuple[int, ...]) -> FloatArray:
    """Relative change of every case from that of the probes: twice its root mean square at each force.

    Parameters
    ----------
    change : (p, k) array
        NaN where there is none.
    shape : tuple of int
        Of all cases, the last one being the force.

    Examples
    --------
    >>> carried_by_force(np.array([[0.1, 0.3], [-0.1, np.nan]]), (1, 2)).round(12).tolist()
    [[0.2, 0.6]]
    """
    return np.broadcast_to(TIMES * _rms(change, 0), shape).copy()


def _rms(values: FloatArray, axis: int | None) -> FloatArray:
    known = np.isfinite(values)
    count = known.sum(axis=axis)
    mean = np.where(known, values, 0.0) ** 2
    # A force at which no probe was solved has no mean: it stays NaN, without a warning.
    return np.sqrt(np.divide(mean.sum(axis=axis), count, out=np.full(np.shape(count), np.nan), where=count > 0))


def at_least_own(share: FloatArray, change: FloatArray, probes: tuple[int, ...], values: FloatArray) -> FloatArray:
    """The uncertainty interval of a probe, and of its images, is no narrower than what was seen there.

    ``share`` and ``values`` are ``(candidates, k)``, ``change`` ``(p, k)``.
    """
    found = share.copy()
    for own, number in zip(np.abs(change), probes, strict=True):
        # Images of a probe by symmetry have its values but for rounding.
        alike = np.isclose(values, values[number], rtol=TIE, atol=0.0, equal_nan=True).all(axis=-1)
        found[alike] = np.fmax(found[alike], own)
    return found


def largest_side(changes: FloatArray, pairs: list[int]) -> FloatArray:
    """Several inputs of one part together: of each the larger side, added as independent ones.

    ``changes`` is ``(..., v)``, ``pairs`` tells the input of each of the ``v`` solves.

    >>> largest_side(np.array([0.3, -0.1, 0.4]), [0, 0, 1]).round(12).tolist()
    0.5
    """
    sides = [np.abs(changes[..., [p == pair for p in pairs]]) for pair in dict.fromkeys(pairs)]
    return np.sqrt(sum(side.max(axis=-1) ** 2 for side in sides))


def _log(values: FloatArray) -> FloatArray:
    """Logarithm; NaN where there is none."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.log(np.where(values > 0, values, np.nan))


def change_by_modulus(force: FloatArray, values: FloatArray, share: float) -> FloatArray:
    """Relative change of values for a modulus larger by ``share``, where they depend on force over modulus only.

    It is minus the slope of ln(value) over ln(force), times the share.

    Parameters
    ----------
    force : (k,) array
        At least two [N].
    values : (..., k) array
        Positive; NaN where there is none.
    share : float

    Examples
    --------
    >>> change_by_modulus(np.array([1.0, 2.0, 4.0]), np.array([1.0, 2.0, 4.0]), 0.1).round(12).tolist()
    [-0.1, -0.1, -0.1]
    """
    return -share * np.gradient(_log(values), np.log(force), axis=-1)


def change_along(station: FloatArray, values: FloatArray, shift: float) -> FloatArray:
    """Relative change of a map for a shift along its stations, as its own slope tells, without sign.

    Parameters
    ----------
    station : (s,) array
        At least two [m].
    values : (s, ...) array
        Positive; NaN where there is none.
    shift : float
        [m].

    Examples
    --------
    >>> change_along(np.array([0.0, 1.0, 2.0]), np.exp([0.0, 3.0, 6.0]), 0.1).round(12).tolist()
    [0.3, 0.3, 0.3]
    """
    return np.abs(shift * np.gradient(_log(values), station, axis=0))
