"""The window of safe forces of every candidate: enough to hold the object's weight, not so much that it is crushed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from softjaw.study.case.build import geometry
from softjaw.study.case.candidates import axes
from softjaw.study.case.result import MARGIN
from softjaw.study.result.layout import DONE, Derived
from softjaw.study.result.result_writer import ResultWriter
from softjaw.study.scene import Scene

FloatArray = NDArray[np.float64]
LOW, HIGH = "force_low", "force_high"


def derived(scene: Scene) -> list[Derived]:
    """Bounds of the window, as far as the scene asks for them."""
    over = tuple(axis.name for axis in axes(scene)[:-1])
    found = []
    if scene.object.mass is not None:
        found.append(Derived(
            LOW, "N", "smallest force that holds the object", "Normal force per finger at which safety_factor (curved)"
            " passes 1, between the solved forces by straight lines, and from 0 at 0 N. NaN: none of them holds it.",
            over,
        ))  # fmt: skip
    if getattr(scene.object, "wall", None) is not None:
        found.append(Derived(
            HIGH, "N", "largest force that the wall bears", "Normal force per finger at which the indentation passes"
            " object.allowed_dent_mm or the stress the yield strength, between the solved forces by straight lines, and"
            " from 0 at 0 N; where neither does, the largest solved force: the wall bears at least that. NaN where the"
            " wall was taken as rigid.", over,
        ))  # fmt: skip
    return found


def finalise(writer: ResultWriter, scene: Scene) -> None:
    """Fill the bounds, by one rank, after all cases."""
    wanted = [d.name for d in derived(scene)]
    if not wanted:
        return
    forces = np.asarray(scene.load.normal_force)
    done = writer.codes().reshape(writer.layout.shape) == DONE
    if LOW in wanted:
        factor = np.where(done, writer.read("safety_factor/ccm"), np.nan)
        writer.write_derived(LOW, first_crossing(forces, factor, 1.0))
    if HIGH in wanted:
        writer.write_derived(HIGH, _largest(writer, scene, forces, done))


def _largest(writer: ResultWriter, scene: Scene, forces: FloatArray, done: NDArray[np.bool_]) -> FloatArray:
    """Largest force that the wall bears; NaN where it was taken as rigid, so that nothing is known of it."""
    limits = {
        "indentation": scene.object.allowed_dent,
        "wall_stress": geometry().material_of(scene.object).yield_strength,
    }
    values = {name: np.where(done, writer.read(f"{name}/{name}"), np.nan) for name in limits}
    known = np.isfinite(values["indentation"])
    solved = np.where(known.any(axis=-1), np.where(known, forces, 0.0).max(axis=-1), np.nan)
    crossings = [first_crossing(forces, values[name], most) for name, most in limits.items() if most is not None]
    return np.fmin.reduce([solved, *crossings])


def first_crossing(forces: ArrayLike, values: ArrayLike, limit: float) -> FloatArray:
    """Force at which values first pass a limit, by straight lines from 0 at no force; NaN where they never do.

    A solved value within `MARGIN` of the limit has passed it.

    Parameters
    ----------
    forces : (k,) array
        Ascending [N].
    values : (..., k) array
        NaN where there is none; what comes after is not used.
    limit : float

    Examples
    --------
    >>> first_crossing([1.0, 2.0], [[0.5, 1.5], [0.5, 0.9]], 1.0).tolist()
    [1.5, nan]
    """
    x = np.concatenate([[0.0], np.asarray(forces, float)])
    values = np.asarray(values, float)
    y = np.concatenate([np.zeros((*values.shape[:-1], 1)), values], axis=-1)
    known = np.cumprod(np.isfinite(y), axis=-1).astype(bool)
    above = known & (y >= limit * (1.0 - MARGIN))
    k = np.maximum(above.argmax(axis=-1), 1)[..., None]
    low, high = np.take_along_axis(y, k - 1, -1)[..., 0], np.take_along_axis(y, k, -1)[..., 0]
    share = np.clip((limit - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    found = x[k[..., 0] - 1] + share * (x[k[..., 0]] - x[k[..., 0] - 1])
    return np.where(above.any(axis=-1), found, np.nan)
