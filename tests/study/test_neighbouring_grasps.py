"""Grasps of a bottle at neighbouring stations: over its waist a pad bears on both ends, with a hole between them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from softjaw.study import pipeline
from softjaw.study.scene import load_scene
from tests.study.launching import ROOT
from tests.study.scenes import units_of

WAIST = 67.5  # station in the middle of the waist [mm], where the bottle is its own mirror image


@lru_cache(maxsize=4)
def grasps(first, last, count, forces="[1, 2]"):
    """Stations [mm] ``(count,)`` and results of every force ``[station][force]`` of the shipped scene."""
    overrides = (
        f"candidates.stations={count}", f"candidates.stations_mm=[{first}, {last}]", "candidates.angles_deg=[0]",
        f"load.normal_force_n={forces}",
    )  # fmt: skip
    scene = load_scene(ROOT / "jobs" / "bottle-rigid.toml", overrides)
    made = [[result for _, result in pipeline.solve_unit(unit)] for unit in units_of(scene)]
    return np.linspace(first, last, count), made


def values(results, name, force):
    """A map's values of the curved model ``(count,)``, or a finger's, of the first finger."""
    found = np.array([path[force].values[name] for path in results])
    return found if found.ndim == 1 else found[:, 0]


def jumps(line):
    """How far each value is from the middle of its neighbours, over itself."""
    return np.abs(line[1:-1] - 0.5 * (line[2:] + line[:-2])) / np.abs(line[1:-1])


def test_over_the_hole_the_frame_stands_on_the_pad():
    """At 1 N in the middle of the waist the pad's middle hangs 0.3 mm over the bottle of 58 mm diameter."""
    _, [_, [result]] = grasps(WAIST - 0.25, WAIST, 2, "[1]")
    origin, axes = (result.values[f"fingers/frame_{name}"][0] for name in ("origin", "axes"))
    assert result.values["fingers/frame_flag"][0] == 0
    np.testing.assert_allclose(axes, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(origin[:2], 0, atol=1e-8)
    assert 58e-3 < result.values["maps/contact_distance"] < 59e-3
    pressure, centroid = result.patch["pressure"][0], result.patch["centroid"][0]
    nearest = np.argsort(np.linalg.norm(centroid - origin, axis=1))[:4]
    assert (pressure[nearest] == 0).all()
    assert origin[2] == pytest.approx(centroid[nearest, 2].mean(), abs=2e-5)


@pytest.mark.long
@pytest.mark.parametrize("force", [0, 1])
def test_frame_distance_and_quality_are_continuous_over_stations(force):
    """Stations 60 to 75 mm in steps of 0.25 mm at 1 and 2 N.

    Quality itself grows sixfold within 4 mm where the second end begins to bear, up to 23 % from station to station;
    a jump is what is left of a value beside the middle of its neighbours. Where the end begins to bear there is a kink,
    which half the step halves.
    """
    stations, results = grasps(60, 75, 61)
    quality, distance = (values(results, f"maps/{name}", force) for name in ("quality", "contact_distance"))
    begins = stations[1:-1][jumps(quality) > 0.02]
    assert all((np.abs(np.abs(begins - WAIST) - at) <= 0.75).all() for at in [(4.0, 6.5)[force]])
    assert jumps(distance).max() < 2e-3
    assert np.abs(np.diff(values(results, "fingers/frame_axes", force)[:, 2], axis=0)).max() < 0.07
    np.testing.assert_allclose(quality, quality[::-1], rtol=1e-6)
