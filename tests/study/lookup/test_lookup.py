"""Lookup between candidates and forces: values, honest errors, symmetry, and points that have no value."""

from dataclasses import replace

import numpy as np
import pytest

from softjaw.study.case.build import build_object
from softjaw.study.flags import Flag
from softjaw.study.lookup import GraspMap
from softjaw.study.lookup.point import INSIDE, JUMP, NO_RESULT, OUTSIDE, SNAP
from softjaw.study.quantities import Axis
from softjaw.study.result.interpolation import OF_ANGLES, OF_FORCES
from softjaw.study.result.read import open as open_dataset
from softjaw.study.result.read import scene_of
from softjaw.study.show.best_grasps import best
from tests.study import formula_results as known
from tests.study.formula_results import FORCES, SCENE, STATIONS, linear

MESH = '[object]\nshape = "mesh"\nmesh = "x.stl"\nunit = "mm"\n[candidates]' + SCENE.partition("[candidates]")[2]
ROUND = SCENE.replace("semi_axis_b_mm = 20", "semi_axis_b_mm = 25")
ANGLES = np.arange(9) * np.pi / 9


def grid_axes(stations=STATIONS, angles=ANGLES, *rest, **more):
    return known.grid_axes(stations, angles, *rest, **more)


def make(path, formula=linear, axes=None, **more):
    return known.make(path, formula, axes or grid_axes(), **more)


def smooth(station, angle, force):
    return 0.01 * (1 + 0.3 * np.sin(60 * station + 1)) * (1 + 0.2 * np.cos(2 * angle)) * (1 + 0.1 * force) ** 0.3


@pytest.fixture(scope="module")
def straight(tmp_path_factory):
    return GraspMap(make(tmp_path_factory.mktemp("lookup") / "straight.hdf"))


def points(count, seed=1):
    random = np.random.default_rng(seed)
    return random.uniform(0, 0.04, count), random.uniform(-7, 7, count), random.uniform(1, 8, count)


def test_lines_and_power_laws_are_met_and_the_error_of_a_point_holds_that_of_the_cases(straight, tmp_path):
    station, angle, force = points(300)
    found = straight.at(station, angle, force)
    assert found.ok.all()
    assert found.e_n == pytest.approx(linear(station, angle, force), rel=1e-12)
    assert found.error("e_n") == pytest.approx(np.zeros(300), abs=1e-15)
    errors = {"e_n__error": 0.02, "opening_loaded__error": 1e-4}
    path = make(tmp_path / "two.hdf", meshes=2, opening_loaded__opening_loaded=0.03, **errors)
    point = GraspMap(path).at(0.02, 0.0, 3.0)
    assert point.error("e_n") == pytest.approx(0.02 * point.e_n, rel=1e-12)
    assert point.error("opening_loaded") == pytest.approx(1e-4, rel=1e-12)
    assert "0.1 mm" in str(point)


@pytest.mark.parametrize("power", [0.0, 0.3, 0.9, 1.0])
def test_between_two_forces_alone_the_error_is_how_far_a_law_is_from_constant_and_from_proportional(tmp_path, power):
    axes = grid_axes([0.0], [0.0], [1.0, 2.0])
    path = make(tmp_path / "two.hdf", lambda station, angle, force: 0.01 * force**power, axes)
    point = GraspMap(path).at(0.0, 0.0, 1.5)
    assert point.e_n == pytest.approx(0.01 * 1.5**power, rel=1e-12)
    away = min(power, 1.0 - power) * np.log(2.0)
    assert 0.3 * away - 1e-12 <= point.error("e_n") / point.e_n <= 4.0 * away + 1e-12


@pytest.mark.parametrize("along", [None, *(pytest.param(axis, marks=pytest.mark.long) for axis in range(3))])
def test_the_estimate_covers_the_true_error_of_cases_left_out(tmp_path, along):
    """Every second node is left out of the file, along one axis or along all."""
    fine = [np.linspace(0, 0.06, 13), np.arange(16) * np.pi / 16, np.linspace(1, 9, 13)]
    kept = [x[::2] if along in (a, None) else x for a, x in enumerate(fine)]
    coarse = GraspMap(make(tmp_path / "a.hdf", smooth, grid_axes(*kept)))
    grid = np.meshgrid(*fine, indexing="ij")
    true, estimate = np.abs(coarse.value("e_n", *grid) - smooth(*grid)), coarse.error("e_n", *grid)
    left_out = estimate > 0
    assert left_out.mean() > 0.4
    assert (true <= estimate)[left_out].mean() >= 0.95
    assert true[~left_out].max() < 1e-15
    most = 6 * {0: 1.0, 1: OF_ANGLES, 2: OF_FORCES, None: OF_ANGLES}[along]  # covers without crying wolf
    assert np.median(estimate[left_out]) < most * np.median(true[left_out])


def test_one_point_is_the_same_as_an_array_of_points_and_units_are_those_of_people(straight):
    place = points(200)
    together = straight.value("tau_z_max", *place)
    assert together.shape == (200,)
    alone = [straight.value("tau_z_max", *map(float, p)) for p in zip(*place, strict=True)]
    assert alone == pytest.approx(together, rel=1e-12)
    grid = straight.at(STATIONS[:, None], 0.3, FORCES)
    assert grid.e_n.shape == grid.state.shape == (5, 4)
    assert grid.semi_axes().shape == (5, 4, 2, 3)
    found = straight.at(station_mm=15, angle_deg=40, force=3).e_n
    assert found == pytest.approx(straight.at(0.015, np.radians(40), 3).e_n, rel=1e-14)
    for named, given in (
        ("station", {"station": 0.01, "angle": 0.1, "force": 3, "station_mm": 10}),
        ("angle", {"station": 0.01, "force": 3}),
        ("force", {"station": 0.01, "angle": 0.1}),
        ("station", {"candidate": 0, "force": 3}),
    ):
        with pytest.raises(ValueError, match=named):
            straight.at(**given)
    with pytest.raises(ValueError, match="model is 'round'"):
        straight.value("e_n", 0.01, 0.1, 3.0, "round")
    with pytest.raises(KeyError, match="safety_factor"):
        _ = straight.at(0.01, 0.1, 3).value("safety_factor")
    with pytest.raises(KeyError, match="fingers/S"):
        straight.at(0.01, 0.1, 3).value("finger_S")
    assert (straight.at(0.01, 0.1, 3).station, straight.at(0.01, 0.1, 3).force) == (0.01, 3.0)


@pytest.mark.parametrize(("place", "word"), [
    ((0.05, 0.0, 2.0), "station 50 mm, solved: 0 mm to 40 mm"), ((0.01, 0.0, 9.0), "force 9 N, solved: 1 N to 8 N"),
    ((-1e-6, 0.0, 2.0), "station -0.001 mm"), ((np.nan, 0.0, 2.0), "station nan"), ((0.01, 0.0, 0.5), "force 0.5 N"),
])  # fmt: skip
def test_nothing_is_extrapolated(straight, place, word):
    point = straight.at(*place)
    assert (point.state, point.ok) == (OUTSIDE, False)
    assert np.isnan([point.e_n, point.error("e_n"), straight.value("e_n", *place)]).all()
    assert word in point.reason
    assert point.reason in str(point)
    assert straight.at(0.04 * (1 + 1e-12), 0, 8).ok  # rounding at the edge


@pytest.mark.parametrize(("code", "word"), [(2, "failed: the contact slid off"), (0, "is not solved yet")])
def test_beside_a_case_without_result_there_is_no_value(tmp_path, code, word):
    there = GraspMap(make(tmp_path / "a.hdf", **known.without_result(code, "the contact slid off")))
    beside = there.at(0.019, 0.5, 1.9)
    assert beside.state == NO_RESULT
    assert np.isnan([beside.e_n, there.value("e_n", 0.019, 0.5, 1.9)]).all()
    assert np.isnan(beside.fingers("f_x_max")).all()
    assert beside.reason.endswith(word)
    assert "station 20 mm, angle 20 deg, 2 N" in beside.reason
    assert there.at(0.01, ANGLES[1], 2).e_n == pytest.approx(linear(0.01, 0, 2))  # a solved case next to it
    assert there.value("e_n", 0.02, float(ANGLES[0]), 1.5) == pytest.approx(linear(0.02, 0, 1.5))
    with pytest.raises(ValueError, match="station 20 mm"):
        beside.limit_surface(1)
    assert list(there.at([0.019, 0.035], 0.5, 1.9).reason) == [beside.reason, ""]


def test_nothing_is_interpolated_across_a_snap_in(tmp_path):
    """Nor does the jump enter the estimated errors on either side."""

    def flags(values):
        values[..., 3:] = 8192
        return values

    def jump(station, angle, force):
        return linear(station, angle, force) * np.where(force > 3.5, 0.5, 1.0)

    there = GraspMap(make(tmp_path / "a.hdf", jump, grid_axes(forces=[1, 2, 3, 4, 6, 8]), flags__flags=flags))
    between = there.at(0.011, 0.1, 3.2)
    assert between.state == SNAP
    assert np.isnan([between.e_n, there.value("e_n", 0.011, 0.1, 3.2)]).all()
    assert "the wall snaps in between" in between.reason
    assert "3 N and" in between.reason
    for force, sign in ((2.5, 0), (3, 0), (4, 8192), (4.5, 8192)):
        point = there.at(0.011, 0.1, force)
        assert (point.state, point.flags, point.value("flags")) == (INSIDE, sign, sign)
        assert point.e_n == pytest.approx(jump(0.011, 0.1, force))
        assert point.error("e_n") == pytest.approx(0, abs=1e-15)


def test_where_the_contact_changes_its_kind_there_is_no_smooth_value(tmp_path):
    """From 20 mm on the pads bear on both ends, at 40 mm in two pieces; other rims are no change."""

    def rims(values):
        values[:2], values[2:] = 1, 15
        return values

    def pieces(values):
        values[...] = 1
        values[4] = 2
        return values

    two = {"fingers__rims": rims, "fingers__pieces": pieces, "fingers__holes": 0}
    there = GraspMap(make(tmp_path / "a.hdf", **two))
    found = there.at([0.005, 0.015, 0.025, 0.035, 0.03], 0.1, 2.5)
    assert found.state.tolist() == [INSIDE, JUMP, INSIDE, JUMP, INSIDE]
    assert np.isnan(found.e_n[[1, 3]]).all()
    assert np.isnan(there.value("e_n", 0.015, 0.1, 2.5))
    assert there.value("e_n", 0.025, 0.1, 2.5) == pytest.approx(linear(0.025, 0.1, 2.5))
    assert "(1 piece) and " in found.reason[1]
    assert "(2 pieces, on both ends)" in found.reason[3]
    for place, (station, force) in (((0.0149, 0.1, 2.5), (0.01, 2.0)), ((0.036, 6.9, 3.9), (0.04, 4.0))):
        point = there.at(*place)
        assert point.nearest.ok
        assert point.nearest.place[0, [0, 2]] == pytest.approx([station, force])
        assert point.nearest.e_n == pytest.approx(linear(station, 0, force))
    assert there.at(0.01, 0.1, 2).nearest.e_n == pytest.approx(there.at(0.01, 0.1, 2).e_n)
    ds = open_dataset(make(tmp_path / "b.hdf", fingers__pieces=np.arange(len(FORCES))[:, None] + 1))
    about = {"units": "N", "definition": ""}
    low = (ds.status.dims[:-1], np.full(ds.status.shape[:-1], 0.5 * (FORCES[0] + FORCES[1])), about)
    ds = ds.assign(safety_factor=0.1 * ds.e_n, force_low=low, force_high=low)
    ds.attrs["derived"] = "force_low force_high"
    for point in GraspMap(ds).best(2):  # the force to use lies between two kinds of contact
        assert point.ok
        assert point.place[0, 2] == FORCES[1]
        assert point.flags == Flag.TOO_WEAK | Flag.TOO_STRONG


def test_angles_repeat_with_the_objects_symmetry_and_a_gap_is_bridged_for_round_objects_alone(tmp_path):
    around = GraspMap(make(tmp_path / "a.hdf", smooth))  # 0 to 160 deg; an elliptic cylinder repeats after 180
    last, first = (smooth(0.01, a, 2.0) for a in (ANGLES[-1], ANGLES[0]))
    assert around.at(0.01, np.radians(170), 2).e_n == pytest.approx((last + first) / 2)
    same, one = (around.at(0.01, np.radians(a), 2).e_n for a in ([20, 200, -160, 380], 20))
    assert same == pytest.approx(one)
    turned, here = (around.at(0.01, np.radians(a), 2).error("e_n") for a in (185, 5))
    assert turned == pytest.approx(here)
    far = GraspMap(make(tmp_path / "a.hdf", smooth, grid_axes(angles=[*ANGLES[:-1], ANGLES[-1] + np.pi])))
    assert far.at(0.01, ANGLES[-1], 2).e_n == pytest.approx(smooth(0.01, ANGLES[-1], 2.0))  # of the next period
    part = GraspMap(make(tmp_path / "a.hdf", axes=grid_axes(angles=[0, 0.1, 0.2])))
    assert part.at(0.01, 0.15, 2).ok
    steps = GraspMap(make(tmp_path / "c.hdf", axes=grid_axes(angles=np.radians([0, 25, 50, 75, 105]))))
    assert steps.at(0.01, np.radians([10, 30, 60, 90]), 2).ok.tolist() == [True, True, True, False]
    assert "angle 90 deg, solved: 0 deg to 11.459 deg" in part.at(0.01, np.pi / 2, 2).reason
    assert part.at(0.01, 0.15 + np.pi, 2).ok
    one = GraspMap(make(tmp_path / "b.hdf", axes=grid_axes(angles=[0.3])))
    assert one.at(0.01, force=2).e_n == pytest.approx(one.at(0.01, 0.3, 2).e_n, rel=1e-12)
    assert one.at(0.01, 0.4, 2).reason.endswith("solved: 17.189 deg only")
    bottle = GraspMap(make(tmp_path / "a.hdf", axes=grid_axes(angles=[0]), scene=ROUND))
    assert bottle.value("e_n", 0.01, np.linspace(-9, 9, 50), 2) == pytest.approx(np.full(50, linear(0.01, 0, 2)))
    assert bottle.at(0.01, force=2).ok


def test_half_a_turn_of_the_gripper_exchanges_the_fingers_and_explicit_poses_go_by_number_and_force(tmp_path):
    def second_finger(values):
        values[..., 1, :] *= 2
        return values

    there = GraspMap(make(tmp_path / "a.hdf", scene=MESH, fingers__f_x_max=second_finger))
    one, other = (there.at(0.01, np.radians(a), 2).fingers("f_x_max") for a in (40, 220))
    assert one == pytest.approx([1.6, 3.2])
    assert other == pytest.approx([3.2, 1.6])
    # between 160 deg and 180 deg, where 180 deg is 0 deg with the fingers exchanged
    assert there.at(0.01, np.radians(170), 2).fingers("f_x_max") == pytest.approx([2.4, 2.4])
    layout = grid_axes([0, 1, 2], [0], FORCES, poses=True)
    poses = GraspMap(make(tmp_path / "a.hdf", axes=layout, labels=("lid", "neck", "belly")))
    assert poses.at(candidate=1, force=3).e_n == pytest.approx(linear(1, 0, 3))
    assert poses.at(candidate=[0, 2], force=3).e_n == pytest.approx([linear(0, 0, 3), linear(2, 0, 3)])
    for wrong in (1.5, 3, -1):
        assert "candidates 0 to 2 and nothing between" in poses.at(candidate=wrong, force=3).reason
        assert np.isnan(poses.value("e_n", float(wrong), 0.0, 3.0))
    single = GraspMap(make(tmp_path / "one.hdf", axes=grid_axes([0], [0], FORCES, poses=True)))
    assert single.at(candidate=0, force=3).e_n == pytest.approx(linear(0, 0, 3))
    with pytest.raises(ValueError, match="explicit poses"):
        poses.at(0.01, 0.0, 3)


def test_a_sweep_is_asked_at_one_of_its_points(tmp_path):
    sweep = (
        Axis("semi_axis_b", np.array([0.01, 0.025]), "m", "object.semi_axis_b_mm"),
        Axis("material", np.array([0.0, 1.0]), "", "gripper.material", ("blatz_ko", "neo_hooke")),
        Axis("elements", np.array([0.0]), "", "gripper.elements", ("8 x 4 x 2",)),
    )

    def formula(b, material, _, station, angle, force):
        return b + 10 * material + 0 * station * angle * force

    path = make(tmp_path / "a.hdf", formula, grid_axes(sweep=sweep), scene=ROUND)
    point = {"object.semi_axis_b_mm": 25, "gripper.material": "blatz_ko", "gripper.elements": [8, 4, 2]}
    for where, value in (
        ({"object.semi_axis_b_mm": 10, "gripper.material": "neo_hooke"}, 10.01),
        (point, 0.025),
    ):
        assert GraspMap(path, where=where).at(0.01, 0.1, 2).e_n == pytest.approx(value)
    for where, word in (
        ({}, r"missing object.semi_axis_b_mm: give one of .* = 10, 25"),
        (point | {"object.semi_axis_b_mm": 15}, "= 15: expected one of"),
        (point | {"gripper.material": "steel"}, "expected one of gripper.material = blatz_ko, neo_hooke"),
        (point | {"mu": 1}, "where has mu"),
    ):
        with pytest.raises(ValueError, match=word):
            GraspMap(path, where=where)


def test_a_part_of_a_dataset_stands_at_its_own_point_of_the_sweep_and_what_it_has_lost_is_named(tmp_path):
    sweep = (
        Axis("semi_axis_b", np.array([0.01, 0.02]), "m", "object.semi_axis_b_mm"),
        Axis("mu", np.array([0.5, 0.8]), "", "friction.mu"),
    )
    text = f'{SCENE}\n[sweep]\n"object.semi_axis_b_mm" = [10, 20]\n"friction.mu" = [0.5, 0.8]\n'
    axes = grid_axes(sweep=sweep)
    ds = open_dataset(make(tmp_path / "a.hdf", lambda b, mu, *place: b + mu + 0 * sum(place), axes, scene=text))
    for part, where in (
        (ds.isel(semi_axis_b=[1]), {"friction.mu": 0.5}), (ds.isel(semi_axis_b=1, mu=[0]), {}),
        (ds.isel(semi_axis_b=[1, 0], mu=0), {"object.semi_axis_b_mm": 20}),
    ):  # fmt: skip
        point = GraspMap(part, where).at(0.015, np.pi / 2, 2.0)
        assert point.e_n == pytest.approx(0.52)
        assert abs(point.pose[1][:, 1]) == pytest.approx([0.02, 0.02], abs=1e-6)
    for part, word in (
        (ds.isel(normal_force=1), "lost normal_force"), (ds[["e_n"]], "lost station"),
        (ds.isel(mu=1, drop=True), "lost friction.mu"),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=word):
            GraspMap(part, {"object.semi_axis_b_mm": 20} if "mu" not in part.dims else {})


def test_limit_surfaces_come_between_those_of_the_cases_around_and_bounds_of_the_force_are_maps_too(tmp_path):
    def growing(values):  # in units of mu S
        values[..., 3, :, :, :] = known.quartic(16.0, 16.0, 16.0)  # at 8 N: half as far along every axis
        return values

    def lengthening(values):  # the torque's grows with the third power of the force
        values[..., 3, :, :, 2] = 0.032
        return values

    there = GraspMap(make(tmp_path / "b.hdf", limit_surface__semi_axes=lengthening))
    assert there.at(0.01, 0.1, 6).semi_axes()[0] == pytest.approx([4.8, 4.8, 0.032 * 1.5**3])
    there = GraspMap(make(tmp_path / "a.hdf", limit_surface__coefficients=growing))
    exact = there.at(0.01, 0.1, 4).limit_surface(2)
    assert exact.semi_axes == pytest.approx(np.array([1, 1, 0.02 / 4**0.25]) * 0.8 * 4, rel=1e-9)
    between = there.at(0.01, 0.1, 6)
    surface = between.limit_surface(1)
    assert surface.semi_axes == pytest.approx(np.array([8.5**-0.25, 8.5**-0.25, 0.02 / 10**0.25]) * 0.8 * 6, rel=1e-9)
    assert surface.holds([[2.8, 0, 0], [2.9, 0, 0]]).tolist() == [True, False]
    t = np.random.default_rng(2).normal(size=(50, 3))
    low, high = (there.at(0.01, 0.1, f).limit_surface(1).scaled(np.full(3, 6 / f)).support(t) for f in (8, 4))
    assert ((low <= surface.support(t)) & (surface.support(t) <= high)).all()
    assert between.limit_surface(1, fitted=False).semi_axes == pytest.approx([4.8, 4.8, 0.048])
    assert between.fingers("limit_surface/coefficients").shape == (2, 15)
    with pytest.raises(ValueError, match="expected 1 or 2"):
        between.limit_surface(0)
    with pytest.raises(ValueError, match="one point"):
        there.at(0.01, [0.1, 0.2], 6).limit_surface(1)
    layout = grid_axes()
    bound = np.broadcast_to(3 + 100 * STATIONS[:, None], (5, 9))
    (high,) = known.window(layout)
    derived = {"derived": (high, replace(high, name="force_high_error")), "derived__force_high_error": 0.25}
    there = GraspMap(make(tmp_path / "a.hdf", axes=layout, derived__force_high=bound, **derived))
    assert there.at(0.015, 0.1, 2).value("force_high") == pytest.approx(4.5)
    assert there.at(0.015, 0.1, 2).error("force_high") == pytest.approx(0.25)
    assert "force_high" in str(there.at(0.015, 0.1, 2))
    assert there.quantities["force_high"][0] == "N"


def test_the_best_grasps_are_those_of_show_as_points_which_know_the_poses_of_their_pads(tmp_path):
    held = np.random.default_rng(2).permutation(np.arange(float(len(STATIONS) * len(ANGLES) * len(FORCES))))
    held = 0.01 * held.reshape(len(STATIONS), len(ANGLES), len(FORCES))
    path = make(tmp_path / "a.hdf", smooth, payload__ccm=held)
    found, ds = GraspMap(path), open_dataset(path)
    for by, force in ((None, None), ("payload", None), ("payload", FORCES[0]), ("e_n", FORCES[1]), ("payload", 1.5)):
        table = best(ds, force=force, by=by, top=3)
        points = found.best(3, by, force)
        for row, point in zip(table.rows, points, strict=True):
            assert point.place[0].tolist() == [row["station"], row["angle"], table.facts["force"]]
            assert [point.payload, point.e_n] == pytest.approx([row["payload"], row["e_n"]], rel=1e-14)
    assert len(found.best(10_000)) == len(STATIONS) * len(ANGLES)
    with pytest.raises(ValueError, match="99 N was not solved"):
        found.best(force=99.0)
    R, x = found.at(STATIONS[0], ANGLES[1], FORCES[0]).pose
    assert [R, x] == [pytest.approx(ds[f"finger_pose_{name}"].values[0, 1, 0]) for name in ("rotation", "origin")]
    # between solved places, and at images of them, the pads touch the object at an angle of their own
    many, x = found.at(STATIONS[0], [(ANGLES[0] + ANGLES[1]) / 2, ANGLES[0] + np.pi], FORCES[0]).pose
    across, surface = np.linspace(-0.01, 0.01, 41), build_object(scene_of(ds).object)
    for R, origins in zip(many.reshape(-1, 3, 3), x.reshape(-1, 3), strict=True):
        gaps = surface.gap(origins + across[:, None] * R[:, 1])[0]
        assert abs(gaps.min()) < 2e-5
