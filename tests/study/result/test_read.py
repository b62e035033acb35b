"""A result file as a dataset: dimensions, coordinates and attributes; no value where a case has none."""

import json

import numpy as np
import pytest
import xarray as xr
from scipy.interpolate import CubicSpline

import softjaw
from softjaw.study.flags import Flag
from softjaw.study.quantities import DONE, FAILED, MISSING, STATES
from softjaw.study.result.derived import crossing, force_ranges
from softjaw.study.result.interpolation import at_force, force_claims, plain
from softjaw.study.result.read import FIELDS, read_field
from softjaw.study.result.store import open_result
from softjaw.study.scene import parse_scene
from tests.study.fake_run import fake_plan, fake_result
from tests.study.formula_results import ANGLES, FORCES, STATIONS, linear, make, written
from tests.study.scenes import BALL, text_of

TUBE = 'shape = "revolution"\nprofile_mm = [[0, 30], [40, 30], [60, 30], [100, 30]]\nwall_mm = 1\nwall_material = "PP"'


@pytest.fixture(scope="module")
def half(tmp_path_factory):
    plan = fake_plan()
    cases = [*map(fake_result, range(10)), "no contact at this force"]
    rows = iter([*cases, *[None] * (plan.layout.rows - len(cases))])
    return written(tmp_path_factory.mktemp("read") / "half.hdf", plan.layout, lambda _: next(rows), plan.header)


def test_between_two_forces_values_and_errors_are_those_of_the_look_up(tmp_path):
    errors = {"e_n__error": 0.02, "curvature_loss__error": 0.01}
    path = make(tmp_path / "a.hdf", meshes=2, curvature_loss__curvature_loss=-0.1, **errors)
    between = at_force(softjaw.open(path), 3.0)
    law = linear(STATIONS, 0.0, 3.0)
    assert between.e_n.sel(model="ccm", angle=0).values[:, 0] == pytest.approx(law, rel=1e-12)
    assert between.e_n_error.sel(angle=0).values[:, 0] == pytest.approx(0.02)
    # what is not positive lies on a straight line, and has the cases' own error
    assert between.curvature_loss.values == pytest.approx(-0.1)
    assert between.curvature_loss_error.values == pytest.approx(0.01)
    curved = make(tmp_path / "b.hdf", lambda station, angle, force: 0.01 + 0.002 * force, meshes=2, **errors)
    between, point = at_force(softjaw.open(curved), 3.0), softjaw.GraspMap(curved).at(STATIONS, 0.0, 3.0)
    assert point.e_n == pytest.approx(between.e_n.sel(model="ccm", angle=0).values[:, 0], rel=1e-12)
    stated = (between.e_n_error * between.e_n.sel(model="ccm")).sel(angle=0).values[:, 0]
    assert point.error("e_n") == pytest.approx(stated, rel=1e-12)
    assert (stated > 0.021 * point.e_n).all()
    # values that are not positive somewhere leave those of other maps power laws
    law, zeros = np.array([[[1.0, 2.0, 8.0]]]), np.zeros((1, 1, 3))
    forces, side = plain("force", "N", [1.0, 2.0, 4.0]), np.zeros((2, 1, 1, 3), bool)
    claims, power = force_claims(np.array([law, zeros]), forces, side)
    assert power.ravel().tolist() == [True, False]
    assert claims[0] == pytest.approx(force_claims(law, forces, side[0])[0])


def test_maps_stand_over_their_coordinates_with_units_and_definitions(tmp_path):
    ds = softjaw.open(make(tmp_path / "a.hdf"))
    assert isinstance(ds, xr.Dataset)
    assert ds.e_n.dims == ("station", "angle", "normal_force", "model")
    assert ds.finger_f_x_max.dims == ("station", "angle", "normal_force", "finger", "model")
    for name, values in zip(ds.e_n.dims, (STATIONS, ANGLES, FORCES), strict=False):
        assert ds[name].values.tolist() == values.tolist()
    here = ds.e_n.sel(station=0.02, angle=0, normal_force=4.0, method="nearest")
    assert here.sel(model="pcm") == pytest.approx(1.1 * float(here.sel(model="ccm")))
    assert (ds.e_n.units, ds.station.units, ds.angle.units, ds.normal_force.units) == ("m", "m", "rad", "N")
    for name, variable in ds.data_vars.items():
        assert variable.attrs["long_name"], name
        assert isinstance(variable.attrs["units"], str), name
    assert ds.attrs["digest"] == "d" * 64
    assert "elliptic_cylinder" in ds.attrs["scene"]


def test_every_dataset_has_its_numbers_and_cases_without_a_result_a_state_and_a_message(half):
    ds = softjaw.open(half)
    with open_result(half) as result:
        done = result.status == DONE
        for d in result.layout.datasets:
            path = d.path.removeprefix("/study/")
            group, _, name = path.partition("/")
            if group in ("map", "checksums", "status", "wrenches", "patch", "derived") or path in FIELDS:
                continue
            one = name if group not in ("fingers", "checks", "effects") else f"{group[:-1]}_{name}"
            if name in ("ccm", "pcm", "pcm_projected"):
                found = ds[group].sel(model=name)
            else:
                found = ds[one if one in ds and group not in ("limit_surface", "work") else f"{group}_{name}"]
            values = result.read(path)
            assert np.array_equal(found.values[done], np.nan_to_num(values)[done] if name == "flags" else values[done],
                                  equal_nan=True), path  # fmt: skip
    status = ds.status.values.ravel()
    assert status.tolist() == [DONE] * 10 + [FAILED] + [MISSING] * (status.size - 11)
    assert ds.status.attrs["flag_meanings"].split() == [state.replace(" ", "_") for state in STATES]
    for name, variable in ds.data_vars.items():
        if variable.dtype.kind == "f" and variable.dims[:3] == ds.status.dims:
            assert np.isnan(variable.values.reshape(status.size, -1)[10:]).all(), name
    assert ds.message.values.ravel()[10] == "no contact at this force"
    assert ds.message.values.ravel()[3] == "a note"
    assert (ds.flags.values.ravel()[10:] == 0).all()


def test_flags_are_bits_that_attributes_name_patches_are_read_on_demand(tmp_path, half):
    ds = softjaw.open(make(tmp_path / "a.hdf", flags__flags=float(Flag.SLIPS | Flag.COARSE)))
    ds.to_netcdf(tmp_path / "a.nc")
    with xr.open_dataset(tmp_path / "a.nc") as stored:
        assert np.array_equal(stored.e_n, ds.e_n, equal_nan=True)
        assert json.loads(stored.attrs["provenance"]) == json.loads(ds.attrs["provenance"])
    words = dict(zip(ds.flags.attrs["flag_masks"], ds.flags.attrs["flag_meanings"].split(), strict=True))
    assert {words[m] for m in words if int(ds.flags[0, 0, 0]) & m} == {"slips", "coarse"}
    one = softjaw.read_patch(half, station=1, angle=0, normal_force=1)
    with open_result(half) as result:
        stored = result.patch(int(np.ravel_multi_index((1, 0, 1), result.layout.shape)))
    for name, values in stored.items():
        assert np.array_equal(one[name].values, values, equal_nan=True)
    assert one.pressure.dims == ("finger", "face")
    some = softjaw.read_patch(half, angle=0, normal_force=slice(1, 3))
    assert some.normal.dims == ("station", "normal_force", "finger", "face", "component")
    assert np.array_equal(some.normal.values[1, 0], one.normal.values)
    assert np.isnan(some.pressure.values[3:]).all()
    assert some.pressure.units == "Pa"
    with pytest.raises(KeyError):
        read_field(half, "wall/place")


@pytest.mark.parametrize(("values", "limit", "force"), [
    ([0.3, 0.6, 1.2, 2.4], 0.1, 1 / 3),  # proportional to the force: on a line from nothing, ...
    ([0.3, 0.6, 1.2, 2.4], 0.45, 1.5),  # ... and between solved ones
    ([[1.0, 2.0, 4.0, 8.0], [0.5, 1.0, 2.0, 4.0]], 2.0, [2.0, 4.0]),  # met exactly, in a whole map
    ([0.0, 2.0, 0.5, 3.0], 1.0, 1.5),  # falls again: the first time counts
    ([0.1, 0.2, 0.3, 0.4], 1.0, np.nan),
    ([np.nan] * 4, 1.0, np.nan),
    ([0.1, np.nan, 5.0, 5.0], 1.0, np.nan),
])  # fmt: skip
def test_the_force_at_which_a_limit_is_crossed(values, limit, force):
    """As look-ups interpolate, by power laws; from a force at which there is nothing by a straight line."""
    assert crossing([1.0, 2.0, 4.0, 8.0], values, limit)[0] == pytest.approx(force, rel=1e-12, nan_ok=True)


@pytest.mark.parametrize("power", [0.8, 1.0, 4 / 3])
@pytest.mark.parametrize("wanted", [0.5, 3.0])
def test_below_and_between_solved_forces_a_crossing_is_where_the_law_of_the_contact_has_it(power, wanted):
    """A law that bends over the forces is off, within the error; without a stated error there is none of the force."""
    x = np.array([1.0, 2.0, 4.0, 8.0])
    at, error = crossing(x, x**power, wanted**power, 0.02)
    assert at == pytest.approx(wanted, rel=1e-12)
    assert 0.02 / power * wanted * (1 - 1e-9) < error < 0.3 * wanted
    law = CubicSpline([-3, 0, 1, 2, 3], [-3.9, 0.0, 1.25, 2.35, 3.4])  # of logarithms: exponents from 1.3 to 1
    at, error = crossing(x, 2 ** law(np.log2(x)), 2 ** law(np.log2(wanted)), 0.0)
    assert abs(at - wanted) < error < 0.25 * wanted
    assert np.isnan(crossing(x, x**power, wanted**power)[1])


@pytest.mark.parametrize(
    ("values", "limit", "truth"),
    [([23.36, 37.82], 2.0, 7.67), ([23.36, 37.82], 0.5, 1.93), ([2348.0, 5197.0], 1000.0, 40.06)],
)
def test_a_crossing_far_below_forces_whose_law_bends_lies_within_its_error(values, limit, truth):
    """Safety factor and stress [MPa] of a steel can of 0.25 mm, dented by 10 mm at 100 N, and solved from 2 N on."""
    at, error = crossing([100.0, 200.0], values, limit, 0.01)
    assert abs(at - truth) < error


def test_a_wall_that_has_snapped_at_the_first_force_tells_nothing_of_smaller_ones():
    """The bottle of jobs/snap-in.toml on its coarse mesh: it is dented by 2 mm at 2.8 N, by 0.8 mm at 1.9 N."""
    dent, snapped = [0.599e-3, 1.202e-3, 2.896e-3, 4.919e-3], [False, False, True, True]
    x = np.array([1.5, 2.5, 3.0, 4.0])
    for first, limit, truth in ((2, 2e-3, 2.8), (2, 0.8e-3, 1.9), (1, 2e-3, 2.8)):  # solved from there on
        at, error = crossing(x[first:], dent[first:], limit, 0.01, snapped[first:])
        assert abs(at - truth) < error <= x[first]
    scene = parse_scene(text_of(TUBE, stations="[50]", forces="[3, 4]"), "x.toml", ["object.allowed_dent_mm=0.8"])
    known = {"indentation": dent[2:], "wall_stress": [0.0, 0.0], "indentation_error": [0.01, 0.01]}
    known |= {"flags": [Flag.SNAPPED, Flag.SNAPPED]}
    for lost in (None, 0):  # the first force without a result
        one = {name: np.array(v, float)[None, None] for name, v in known.items()}
        if lost is not None:
            for v in one.values():
                v[..., lost] = np.nan
        ranges = force_ranges(scene, one)
        high, error = (ranges[name].item() for name in ("force_high", "force_high_error"))
        assert high - error <= 1e-9
        assert high + error >= 3 * (1 - 1e-9)


def test_bounds_of_the_force_are_those_of_their_point_of_a_sweep_and_errors_hold_what_lies_between():
    scene = parse_scene(text_of(BALL, forces="[1, 4]") + "[task]\n", "x.toml",
                        ["object.mass_g=100", "sweep.task.safety=[1, 2, 4]"])  # fmt: skip
    factor = np.broadcast_to([1.0, 4.0], (3, 2, 1, 2))
    ranges = force_ranges(scene, {"safety_factor": factor, "payload_error": np.full(factor.shape, 0.01)})
    assert ranges["force_low"] == pytest.approx(np.broadcast_to([[[1.0]], [[2.0]], [[4.0]]], (3, 2, 1)))
    limits = ["object.allowed_dent_mm=1", "sweep.object.allowed_dent_mm=[0.5, 3, 9]"]
    scene = parse_scene(text_of(TUBE, stations="[50]", forces="[1, 2, 4]"), "x.toml", limits)
    dent = np.broadcast_to([1e-3, 2e-3, 4e-3], (3, 1, 1, 3))
    known = {"indentation": dent, "wall_stress": 0.0 * dent, "indentation_error": np.full(dent.shape, 0.01)}
    ranges = force_ranges(scene, known)
    assert ranges["force_high"].ravel() == pytest.approx([0.5, 3.0, 4.0])
    assert (ranges["force_high_error"].ravel()[:2] > [0.03, 0.025]).all()
    assert ranges["force_high_error"].ravel()[2] == 0.0
    for lost, bears in ((0, [0.5, 3.0, 4.0]), (1, [0.5, 3.0, 4.0]), (2, [0.5, 2.0, 2.0])):  # one case without a result
        holes = {name: np.where(np.arange(3) == lost, np.nan, value) for name, value in known.items()}
        high = force_ranges(scene, holes)["force_high"].ravel()
        assert (high <= np.array(bears) * (1 + 1e-9)).all()
        assert (high > 0).all()
    scene = parse_scene(text_of(TUBE, stations="[50]", forces="[4]"), "x.toml", limits[:1])
    ranges = force_ranges(scene, {name: values[0, ..., 2:] for name, values in known.items()})
    assert ranges["force_high"].ravel() == pytest.approx([1.0])
    assert np.isnan(ranges["force_high_error"]).all()  # one force tells no law
