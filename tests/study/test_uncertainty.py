"""Uncertain inputs: samples, the study that is solved with them, intervals, and whether grasps differ beyond them."""

from collections import Counter

import numpy as np
import pytest
from scipy.stats import norm

import softjaw
from softjaw.study.case.candidates import axes, candidates
from softjaw.study.case.poses import axis_poses, moved
from softjaw.study.case.result import CaseResult
from softjaw.study.ranking import Sure, judge, sure
from softjaw.study.result.read import half_width
from softjaw.study.result.store import open_result
from softjaw.study.result.write import NOT_FINER
from softjaw.study.run.plan import make_plan
from softjaw.study.run.rounds import off_target
from softjaw.study.scene import SceneError, parse_scene
from softjaw.study.scene.sections import Uncertainty
from softjaw.study.show.best_grasps import best
from softjaw.study.show.status import largest_stated_error, unfinished
from tests.study.formula_results import written
from tests.study.scenes import BALL, NO_COUPLING, OVAL, QUICK, pose_of, scene_of

RIGID = "effects.sheet='rigid'"
SPREAD = ("uncertainty.samples=8", 'uncertainty.spread={ "friction.mu" = 0.08, gripper.shear_modulus_kpa = 4 }')
PLACES = {"stations": "[0, 10]", "elements": "[8, 4, 3]"}


def plain(*changes, **more):
    return scene_of(BALL, *QUICK, RIGID, *changes, **{**PLACES, **more})


def scene(*changes, **more):
    return plain(*SPREAD, *changes, **more)


def test_inputs_take_the_middles_of_equal_intervals_once_and_a_scene_is_solved_as_given_and_with_each():
    uncertain, means = Uncertainty(samples=16, spread={"a": 0.2, "b": 3.0}), {"a": 1.0, "b": -5.0}
    samples = uncertain.inputs(means)
    expected = norm.ppf((np.arange(16) + 0.5) / 16) / norm.ppf(0.975)
    for key, mean, width in (("a", 1.0, 0.2), ("b", -5.0, 3.0)):
        assert np.sort([sample[key] for sample in samples]) == pytest.approx(mean + width * expected, rel=1e-8)
    # the inputs are independent
    assert abs(np.corrcoef([[s["a"], s["b"]] for s in samples], rowvar=False)[0, 1]) < 0.3
    assert uncertain.inputs(means) == samples
    swept = scene("sweep.score.object_length_mm=['longest', 'per_axis']")
    assert [len(axis.values) for axis in axes(swept)] == [2, 9, 2, 1, 1]
    assert len(axes(swept)[1].options) == 9
    points = swept.points
    assert (len(points), swept.cases) == (18, 36)
    assert points[0] == {"score.object_length_mm": "longest"}
    assert points[9] == {"score.object_length_mm": "per_axis"}
    assert [p["friction.mu"] for p in points[1:9]] == [p["friction.mu"] for p in points[10:]]
    units = make_plan(scene()).units
    assert [u.scene.friction.mu for u in units[::2]] == [0.8, *(p["friction.mu"] for p in scene().points[1:])]
    assert {u.scene.gripper.shear_modulus_kpa for u in units[:2]} == {40.0}
    assert plain().points == [{}]
    assert [a.name for a in axes(plain())] == ["station", "angle", "normal_force"]
    digests = {plain().digest, scene().digest, scene("uncertainty.samples=9").digest,
               scene("uncertainty.spread.friction.mu=0.07").digest}  # fmt: skip
    assert len(digests) == 4
    assert parse_scene(scene().effective_toml()).uncertainty == scene().uncertainty


@pytest.mark.parametrize(("key", "change"), [
    *((key, f'uncertainty.spread={{"{key}" = 1.0}}') for key in ("friction.nu", "mu", "load.normal_force_n",
      "gripper.elements", "object.shape", "gripper.max_opening_mm")), ("friction.mu", "sweep.friction.mu=[0.4, 0.8]"),
])  # fmt: skip
def test_only_a_single_number_that_is_not_swept_can_be_uncertain(key, change):
    with pytest.raises(SceneError) as error:
        scene(change)
    assert error.value.problems[0].key.replace('"', "") == f"uncertainty.spread.{key}"


def test_a_sample_out_of_range_is_refused_and_moved_pads_face_each_other(tmp_path):
    with pytest.raises(SceneError) as error:
        softjaw.run(scene("friction.mu=0.05"), tmp_path / "never.hdf")
    assert error.value.problems[0].key == 'uncertainty.spread."friction.mu"'
    wide = make_plan(scene('uncertainty.spread={"friction.mu" = 0.9}'))  # a sample of 0.1 has no such spread of its own
    least = 0.8 - 0.9 * norm.ppf(15 / 16) / norm.ppf(0.975)
    assert min(unit.scene.friction.mu for unit in wide.units) == pytest.approx(least)
    assert not list(tmp_path.iterdir())
    before = axis_poses(0.03, 0.4, 0.2)
    one, two = moved(before, 0.002, 0.1)
    for pose, old in zip((one, two), before, strict=True):
        assert pose.rotation[:, 2] == pytest.approx(old.rotation[:, 2], abs=1e-14)  # the same approach
        assert pose.rotation[:, 0] @ old.rotation[:, 0] == pytest.approx(np.cos(0.1))
        assert pose.origin - old.origin == pytest.approx(0.002 * pose.rotation[:, 0], abs=1e-12)
    assert one.rotation[:, 0] == pytest.approx(two.rotation[:, 0])
    assert np.cross(before[0].rotation[:, 0], one.rotation[:, 0]) @ one.rotation[:, 2] == pytest.approx(np.sin(0.1))
    shifted, there = (candidates(scene(f"candidates.{key}"))[0] for key in ("shift_mm=10", "stations_mm=[10, 20]"))
    for one, other in zip(shifted.poses, there.poses, strict=True):
        assert one.origin == pytest.approx(other.origin, abs=1e-15)
    assert (shifted.station, there.station) == (0.0, 0.01)
    turned = candidates(scene("candidates.roll_deg=30", where=pose_of(approach=(-1, 0, 0))))
    rolled = candidates(scene("candidates.roll_deg=30"))
    assert turned[0].poses[0].rotation == pytest.approx(rolled[0].poses[0].rotation, abs=1e-12)


@pytest.mark.parametrize("count", [20, 60, 200])
def test_the_interval_of_an_input_is_its_spread(count):
    inputs = Uncertainty(samples=count, spread={"a": 0.5}).inputs({"a": 7.0})
    changes = np.array([sample["a"] - 7.0 for sample in inputs])
    # between samples the range is taken along straight lines
    assert half_width(changes) == pytest.approx(0.5, rel=0.02)
    assert (changes**2 <= half_width(-(changes**2))).mean() >= 0.94  # as at an optimum
    assert np.isnan(half_width(np.append(changes[1:], np.nan)))


def test_maps_have_what_the_samples_say_and_grasps_that_inputs_move_alike_are_told_apart(tmp_path):
    assert softjaw.run(scene(), tmp_path / "ball.hdf") == 0
    ds = softjaw.open(tmp_path / "ball.hdf")
    assert softjaw.run(plain(), tmp_path / "plain.hdf") == 0
    given = softjaw.open(tmp_path / "plain.hdf")
    assert ds.e_n.dims == given.e_n.dims
    np.testing.assert_allclose(ds.quality, given.quality, rtol=1e-9)  # of the contact solve
    values = ds.quality_samples.values
    assert values.shape == (*given.status.shape, 8)
    third = softjaw.press(plain().with_values(scene().points[3]), station=0.0, angle=0.0, force=2.0)
    assert third.value("quality") == pytest.approx(values[0, 0, 0, 2], rel=1e-12)
    changes = np.abs(values - ds.quality.sel(model="ccm").values[..., None])
    expected = np.quantile(changes, 0.95, axis=-1, method="hazen")
    assert ds.quality_interval.values == pytest.approx(expected, rel=1e-12)
    table = best(judge(ds))
    errors = {column.name: column.error for column in table.columns}
    assert (errors["quality"], errors["quality_interval"]) == ("", "")  # which never stands for the mesh's error
    assert sure(ds, "quality", 0) is None
    # at the middle of a ball pads face each other: e_n does not depend on mu, and quality goes with its fifth power
    moduli = np.array([p["gripper.shear_modulus_kpa"] for p in scene().points[1:]])
    mu = np.array([p["friction.mu"] for p in scene().points[1:]])
    order = np.argsort(moduli)
    assert (np.diff(ds.e_n_samples.values[0, 0, 0, order]) < 0).all()  # a stiffer pad has a smaller contact
    scaled = ds.quality_samples.values[0, 0, 0] / mu**5
    assert (np.diff(scaled[order]) < 0).all()
    # Values of 1.1 and 1.0 that are both uncertain by a half, by one input, and by one input each.
    x = np.linspace(-0.5, 0.5, 40)
    value, error = np.array([1.1, 1.0]), np.zeros(2)
    assert Sure(value, error, np.array([x, x])).apart(0, 1) is True
    assert Sure(value, error, np.array([x, -x])).apart(0, 1) is False
    assert Sure(value, np.array([0.08, 0.08]), np.array([x, x])).apart(0, 1) is False
    assert Sure(value, np.array([0.06, 0.06]), np.zeros((2, 1))).apart(0, 1) is True
    assert Sure(value, error, np.array([x, np.full(40, np.nan)])).apart(0, 1) is None
    half, _ = Sure(value, np.array([3.0, 0.0]), np.array([8 * x, x])).half_width
    assert half == pytest.approx(np.hypot(3.0, 4.0 * 0.95 * 40 / 39), rel=1e-2)


def test_a_target_takes_all_samples_of_a_case_to_the_same_mesh(tmp_path):
    """At this angle of an oval the first mesh's error depends on mu: the target lies between those of the samples."""
    coarse = scene_of(OVAL, NO_COUPLING, angles="[30, 210]", elements="[6, 4, 2]")
    case = softjaw.press(coarse, station=0.0, angle=np.radians(30.0), force=2.0)
    alone = coarse.with_values({"accuracy.target": 0.999 * case.errors["payload"] / case.payload})
    together = alone.with_values({"uncertainty": {"samples": 8, "spread": {"friction.mu": 0.08}}})
    assert softjaw.run(together, tmp_path / "a.hdf") == softjaw.run(alone, tmp_path / "b.hdf") == 0
    ds, given = softjaw.open(tmp_path / "a.hdf"), softjaw.open(tmp_path / "b.hdf")
    assert ds.payload.values.tobytes() == given.payload.values.tobytes()
    ds, image = ds.isel(angle=0), ds.isel(angle=1)
    for name in ("payload", "payload_interval", "pad_elements", "work_mesh"):
        np.testing.assert_array_equal(image[name], ds[name])
    given = given.isel(angle=0)
    assert ds.pad_elements.values.item() == given.pad_elements.values.item() > 6 * 4 * 2
    assert 0.04 < ds.payload_interval.values.item() / case.payload < 0.1
    assert ds.e_n_interval.values.item() / case.e_n < 1e-5  # which does not depend on mu
    with open_result(tmp_path / "a.hdf") as result:
        assert not unfinished(result)
    above = softjaw.open(tmp_path / "a.hdf")
    above = above.assign(payload_error=above.payload_error + 1.0)
    named = Counter({(0, 0, 0): 2, (0, 1, 0): 2})
    assert off_target(above, together, named) == ((0, 0, 0), (0, 1, 0))
    above["message"] = above.message.copy(data=np.full(above.message.shape, f"{NOT_FINER}late"))
    assert not off_target(above, together, named)  # which waits for --retry-failed

    def sample(index):
        """As while a round is solved: one sample is on the mesh before."""
        values = {"maps/payload": [1.0 + 0.01 * index[0]] * 3, "maps/payload_error": 0.01, "maps/flags": 0.0}
        return CaseResult(values | {"maps/pad_elements": 48.0 if index[0] == 3 else 144.0})

    ds = softjaw.open(written(tmp_path / "c.hdf", make_plan(together).layout, sample, scene=together.effective_toml()))
    assert np.isnan(ds.payload_interval.values).all()
    assert np.isnan(ds.payload_samples.values[0, 0, 0]).tolist() == [i == 3 for i in range(1, 9)]


def test_a_target_and_the_errors_beside_it_are_those_of_the_inputs_that_are_given(tmp_path):
    aimed = scene_of(BALL, 'uncertainty={ samples = 8, spread = { "friction.mu" = 0.08 } }', "accuracy.target=0.02")
    plan = make_plan(aimed)

    def sample(index):
        error = 0.5 if index[0] else 0.0202
        return CaseResult({"maps/payload": [1.0] * 3, "maps/payload_error": error, "work/mesh": 2.0})

    written(tmp_path / "a.hdf", plan.layout, sample, plan.header)
    with open_result(tmp_path / "a.hdf") as result:
        assert "payload errors up to 2.02 %, 1 of 1 above 2 %; the largest at " in largest_stated_error(result)
