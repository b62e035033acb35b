"""Which candidates are solved: the best on a bed of springs, and none that slips there where the scene says so."""

from __future__ import annotations

import numpy as np
import pytest

from softjaw.study.quantities import MISSING, SLIPS, WORSE
from softjaw.study.run.plan import make_plan
from softjaw.study.run.shares import shares
from softjaw.study.scene import parse_scene

ROUND = """
[object]
shape = "elliptic_cylinder"
semi_axis_a_mm = 30
semi_axis_b_mm = 30
length_mm = 100
[gripper]
elements = [8, 4, 2]
pad_length_mm = 20
[friction]
mu = {mu}
[load]
normal_force_n = [1, 2]
[candidates]
{more}
"""
POSE = "[[candidates.poses]]\npoint_mm = [0, {y}, 0]\napproach = [1, 0, 0]\nlong_side = [0, 0, 1]\n"


def units(more, mu=0.8):
    return make_plan(parse_scene(ROUND.format(more=more, mu=mu)), ordered=True).units


def test_only_the_best_are_solved_and_each_has_its_place():
    poses = "".join(POSE.format(y=y) for y in (0, 12, 24))
    assert [u.state for u in units(poses)] == [MISSING] * 3
    assert [u.state for u in units(f"solve_best = 1\n{poses}")] == [MISSING, WORSE, WORSE]
    assert [u.state for u in units(f"solve_best = 2\n{poses}")][::2] == [MISSING, WORSE]
    assert [u.state for u in units(f"solve_best = 7\n{poses}")] == [MISSING] * 3
    stations = units("stations_mm = [-20, 0, 20]\nangles_deg = [0, 90]\nsolve_best = 2")
    assert [u.state for u in stations].count(WORSE) == 1  # images of a grasp count once
    assert all(len(u.rows) == 2 for u in stations)


@pytest.mark.parametrize(("mu", "held"), [(3.0, True), (0.3, False)])
def test_a_contact_that_slips_comes_last_or_is_skipped(mu, held):
    """A pad beside the middle of a round section meets it askew: the normals lean out of the cone of friction."""
    poses = "".join(POSE.format(y=y) for y in (22, 0))
    last = units(poses, mu)
    assert [u.state for u in last] == [MISSING] * 2
    assert shares(last, np.full(100, MISSING), 1)[-1].unit.index == 0 or held
    assert last[0].hopeless or held
    skipped = units(f"solve_best = 'holding'\n{poses}", mu)
    assert [u.state for u in skipped] == [MISSING if held else SLIPS, MISSING]
