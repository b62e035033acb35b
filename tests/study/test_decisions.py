"""Outcomes of a study that rounding does not decide: rankings, levels of effects, flags, windows, probes, look-ups."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from softjaw.friction.frame import FrameFlag
from softjaw.study.case import wall
from softjaw.study.case.contact import ANTIPODAL, pose_flags
from softjaw.study.case.effects import DOUBT, STEPS, STIFF_PLATE, decided
from softjaw.study.case.pressing import OBLIQUE, state_flags
from softjaw.study.case.result import TIE
from softjaw.study.flags import Flag
from softjaw.study.ranking import Sure, falling, judged, largest, nearest, ranking
from softjaw.study.result.derived import crossing
from softjaw.study.result.interpolation import CLOSING_GAP_RATIO, circle
from tests.turns import ULPS, seeded, seeds, tries

scores = st.lists(st.sampled_from([0.0, 1e-3, 0.1, 0.1, 0.25, 3.0, math.nan]), min_size=1, max_size=12)


def moved(values, seed):
    """The values, each off by at most eight ulp."""
    return np.asarray(values, float) * (1.0 + np.random.default_rng(seed).choice(ULPS, np.shape(values)))


@tries
@given(scores, seeds)
def test_equal_grasps_keep_their_order(values, seed):
    flags = np.random.default_rng(seed).choice([0, 1024], len(values))
    assert ranking(moved(values, seed), flags).tolist() == ranking(np.array(values), flags).tolist()
    assert falling(moved(values, seed)).tolist() == falling(np.array(values)).tolist()
    assert largest(moved(values, seed)) == largest(np.array(values))


@tries
@given(st.lists(st.floats(0.01, 10.0), min_size=1, max_size=12))
def test_a_ranking_is_one(values):
    """What differs by more than a tie stands in falling order, and nothing is lost."""
    order = falling(np.array(values))
    assert sorted(order.tolist()) == list(range(len(values)))
    ranked = np.array(values)[order]
    assert (ranked[:-1] >= ranked[1:] * (1 - len(values) * TIE)).all()


@tries
@given(st.floats(0.1, 50.0), st.floats(1e-3, 10.0), seeds)
def test_of_two_equally_near_forces_the_lower_is_taken(low, step, seed):
    forces = low + step * np.arange(4)
    assert nearest(moved(forces, seed), moved([low + 1.5 * step], seed)[0]) == 1
    assert nearest(forces, low + 1.51 * step) == 2


@tries
@given(scores, seeds)
def test_rounding_is_no_difference_of_two_grasps(values, seed):
    one, other = values[0], moved(values, seed)[0]
    pair = Sure(np.array([one, other]), np.zeros(2), np.zeros((2, 1)))
    assert pair.apart(0, 1) is False
    assert pair.apart(1, 0) is False
    assert Sure(np.array([1.1, 1.0]), np.full(2, 0.05), np.zeros((2, 1))).apart(0, 1) is True


@tries
@given(st.lists(st.sampled_from([0.5, 1.0, 1.5]), min_size=1, max_size=5), seeds)
def test_a_window_ends_at_the_same_force(values, seed):
    """Values that just reach the limit, also where they fall again or the forces end."""
    forces = 1.0 + np.arange(len(values))
    one = crossing(forces, values, 1.0)[0]
    other = crossing(forces, moved(values, seed), 1.0)[0]
    assert other == pytest.approx(one, rel=1e-9, nan_ok=True)


@seeded
def test_a_grasp_that_just_holds_is_not_too_weak(seed):
    factor = moved([[2.0, 2.0, 1.8, 2.2]], seed)
    over = ("angle", "normal_force")
    known = {"flags": (over, np.zeros((1, 4), np.int64)), "force_low": ("angle", [1.0])}
    factors = {"safety_factor": ((*over, "model"), factor[..., None])}
    ds = xr.Dataset(known | factors, {"model": ["ccm"]}, {"scene": "[task]\nsafety = 2.0"})
    assert (judged(ds) & Flag.TOO_WEAK > 0).tolist() == [[False, False, True, False]]


@pytest.mark.parametrize("ulp", ULPS[::4])
def test_an_indicator_on_its_limit_takes_the_dearer_level(ulp):
    """On the bound below which nothing is measured it is measured; on the target it is taken."""
    on, [step] = 1.0 + ulp, STEPS["sheet"]
    for change, level in ((0.01 / (1 + DOUBT) * on, "elastic plate"), (0.0099 / (1 + DOUBT), "rigid")):
        assert decided("sheet", step, STIFF_PLATE * on, lambda: (change, 0.0, 0.0), 0.01).level == level  # noqa: B023


def facing(turn, lean, mu, distance=0.06, free=0.0, upright=1.0):
    """Two contacts on one line whose normals lean by an angle to it, turned as a whole."""
    made = []
    for side, angle in ((1.0, lean), (-1.0, np.pi)):
        R = (turn * Rotation.from_rotvec([0.0, angle, 0.0])).as_matrix()
        origin = turn.apply([0.0, 0.0, -0.5 * side * distance])
        pose = SimpleNamespace(origin=origin, rotation=turn.as_matrix())
        made.append(SimpleNamespace(
            mu=mu, normal=R[:, 2], origin=origin, free_face=free, coarse=False, nodal_instead=False,
            frame=SimpleNamespace(flag=FrameFlag(0), axes=np.diag([1.0, 1.0, upright])), pose=pose, hole_share=0.0,
            state=SimpleNamespace(checks=SimpleNamespace(ellipticity=1.0), path_dependent=False),
        ))  # fmt: skip
    return made


@seeded
def test_flags_of_a_pair_do_not_hang_on_its_rotation(seed):
    """Contacts that face each other without friction, and some that lean by just the angle that is too much."""
    turn = Rotation.random(random_state=seed)
    assert pose_flags(facing(turn, 0.0, 0.0)) == 0
    assert pose_flags(facing(turn, ANTIPODAL, 1.0)) == Flag.NOT_ANTIPODAL
    assert state_flags(facing(turn, 0.0, 1.0, 0.06, 0.03)) == Flag.COLLISION
    assert state_flags(facing(turn, 0.0, 1.0, 0.06, 0.0299)) == 0
    assert state_flags(facing(turn, 0.0, 1.0, upright=moved([OBLIQUE], seed)[0])) == Flag.OBLIQUE
    assert state_flags(facing(turn, 0.0, 1.0, upright=1.0001 * OBLIQUE)) == 0


@seeded
def test_a_wall_that_pushes_along_nothing_does_not_slide(seed):
    """Without friction the force on a straight wall's support is rounding; a newton is not."""
    random = np.random.default_rng(seed)
    scene = SimpleNamespace(friction=SimpleNamespace(mu=0.0), object=None)
    body = SimpleNamespace(material=SimpleNamespace(yield_strength=5e7))
    state = SimpleNamespace(wall=SimpleNamespace(snapped=False), force=10.0)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wall, "thin_body", lambda shape: body)
        place = {"maps/opening": 0.06, "maps/indentation": 5.9e-3}
        values = {"maps/support_force": abs(random.normal(0.0, 1e-12)), "maps/wall_stress": moved([5e7], seed)[0]}
        assert wall.wall_flags(scene, state, place | values) == Flag.YIELDS
        values = {"maps/support_force": 1.0, "maps/wall_stress": 4e7}
        assert wall.wall_flags(scene, state, place | values) == Flag.SLIDES_OUT
        values = {"maps/support_force": 0.0, "maps/wall_stress": 4e7, "maps/indentation": moved([6e-3], seed)[0]}
        assert wall.wall_flags(scene, state, place | values) == Flag.DENTED
        values = {"maps/opening": 0.04, "maps/indentation": 17e-3, "maps/support_force": 0.0, "maps/wall_stress": 4e7}
        assert wall.wall_flags(scene, state, values) == Flag.DENTED


@tries
@given(st.floats(-3.0, 3.0), seeds)
def test_a_circle_is_closed_or_not_whatever_its_first_angle(first, seed):
    """The gap that closes it is just as wide as is allowed."""
    step = math.pi / (1 + CLOSING_GAP_RATIO)
    angles = np.array([first, first + step])
    assert len(circle("angle", "rad", moved(angles, seed), math.pi, True).x) == 3
    assert len(circle("angle", "rad", [first, first + 0.99 * step], math.pi, True).x) == 2
