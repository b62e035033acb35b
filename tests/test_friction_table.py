"""Every worked case of the reference table: patch or mesh by generator in, value within its tolerance out."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from friction.frame import FrameFlag, contact_frame, contact_length, in_frame
from friction.motion import cor_grid, cor_twists, fibonacci_twists, screw_twist
from friction.patch import ContactPatch
from friction.torque import pure_torque
from friction.wrench import friction_limits, friction_support, friction_wrench
from lsfit.body import body_volume, shadow_area
from lsfit.ellipsoid import three_motion_ellipsoid
from lsfit.misfit import misfit
from lsfit.samples import normalised_samples, sample_rank
from scoring.epsilon import epsilon_l1, epsilon_linf
from scoring.polytope import fibonacci_vertices, graspit_vertices, polytope_volume
from scoring.score import score
from scoring.volume import volume_l1, volume_linf
from tests.generators import arc_lengths, build, bump, cyl_mesh, grid_mesh, lcg_patch, mesh_patch

TABLE = json.loads((Path(__file__).parent / "data" / "friction_table.json").read_text())["cases"]
CASES = {case["id"]: case for case in TABLE}
MODEL = {"ccm": "curved", "pcm_flat": "flat", "pcm_projected": "projected", "pcm_unrolled": "unrolled"}


def compare(case, found):
    """Every expected value of the case, within its own tolerance; nothing expected may be missing."""
    assert set(found) == set(case["expected"])
    for name, expected in case["expected"].items():
        tolerance = {key: expected.get(key, 0.0) for key in ("rtol", "atol")}
        np.testing.assert_allclose(found[name], expected["value"], **tolerance, err_msg=f"{case['id']} {name}")


def ids(*categories):
    return [case["id"] for case in TABLE if case["category"] in categories]


def maxima(inputs, names):
    patch, mu = build(inputs["patch"]), inputs["mu"]
    found = {}
    for model in inputs.get("models", ["ccm"]):
        unrolled = arc_lengths(inputs["patch"]["gen"], inputs["patch"]["args"]) if model == "pcm_unrolled" else None
        limits = friction_limits(patch, mu, MODEL[model], unrolled)
        prefix = "" if model == "ccm" else f"{model}."
        found |= {f"{prefix}fx": limits.f_x, f"{prefix}fy": limits.f_y, f"{prefix}tau": limits.tau_z}
        found |= {} if prefix else {"FN_sum": limits.S, "FN_proj": limits.F_N, "en": limits.e_n}
    if "tau_pure" in names:
        found["tau_pure"] = pure_torque(patch, mu)
    return {name: found[name] for name in names}


@pytest.mark.parametrize("key", [*ids("maxima"), "x01", "x05", "x06"])
def test_maxima(key):
    case = CASES[key]
    compare(case, maxima(case["inputs"], case["expected"]))


@pytest.mark.parametrize("key", [k for k in ids("maxima") if "expected_order" in CASES[k]["continuum"]])
def test_the_mesh_is_as_far_from_the_closed_form_as_the_table_says(key):
    case = CASES[key]
    found = maxima(case["inputs"], case["expected"])
    for name, limit in case["continuum"].items():
        if name != "expected_order":
            error = abs(found[name] / limit["value"] - 1)
            assert error == pytest.approx(limit["rel_error_of_discrete"], rel=1e-3, abs=1e-12), name


@pytest.mark.parametrize("key", ids("wrench"))
def test_wrenches(key):
    inputs = CASES[key]["inputs"]
    planar = np.vstack([cor_twists(inputs["cors"]), *[[*v, 0.0] for v in inputs["translations"]]])
    twists = np.zeros((len(planar), 6))
    twists[:, [0, 1, 5]] = planar
    screws = [screw_twist(s["axis"], s["point"], float(s["pitch"])) for s in inputs["screws"]]
    twists = np.vstack([twists, *screws])
    patch, mu = build(inputs["patch"]), inputs["mu"]
    compare(CASES[key], {"W": friction_wrench(patch, twists, mu), "H": friction_support(patch, twists, mu)})


def rotation(axis, angle):
    x, y, z = np.asarray(axis) / np.linalg.norm(axis)
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def mesh_of(inputs):
    mesh = dict(inputs["mesh"])
    kind = mesh.pop("gen")
    pressure = {
        None: None,
        "1+0.8*y": lambda r: 1 + 0.8 * r[:, 1],
        "exp(-((x-0.3)^2+y^2))": lambda r: np.exp(-((r[:, 0] - 0.3) ** 2 + r[:, 1] ** 2)),
    }[inputs.get("pressure")]
    if kind == "cyl_mesh":
        return mesh_patch(cyl_mesh(**mesh), pressure)
    if kind == "bumpy":
        return mesh_patch(grid_mesh(mesh["n"], mesh["n"], 1, 1, bump), pressure)
    corners = grid_mesh(mesh["n"], mesh["m"], mesh["halfx"], mesh["halfy"])
    return mesh_patch(corners @ rotation(mesh["rotation_axis"], mesh["angle"]).T + mesh["translation"], pressure)


@pytest.mark.parametrize("key", ids("frame"))
def test_frames(key):
    inputs = CASES[key]["inputs"]
    patch = mesh_of(inputs)
    frame = contact_frame(patch, inputs["x_hint"])
    limits = friction_limits(in_frame(patch, frame), inputs["mu"])
    assert frame.flag == FrameFlag.CLEAN
    compare(
        CASES[key],
        {
            "COP": frame.centre_of_pressure, "O": frame.origin, "N": frame.axes[2], "x": frame.axes[0],
            "fx": limits.f_x, "fy": limits.f_y, "tau": limits.tau_z,
        },
    )  # fmt: skip


@pytest.mark.parametrize("key", ids("fit3d"))
def test_three_motion_ellipsoids(key):
    inputs = CASES[key]["inputs"]
    patch, mu, rho = build(inputs["patch"]), inputs["mu"], inputs["rho"]
    sampling = inputs["sampling"]
    twist = cor_grid(sampling["n"], rho) if sampling["scheme"] == "cor_grid" else fibonacci_twists(sampling["K"], rho)
    limits = friction_limits(patch, mu)
    W, T = normalised_samples(friction_wrench(patch, twist, mu), twist, mu * limits.S, rho)
    f_x, f_y, tau_z = np.array(limits.per_unit_force) / mu / [1, 1, rho]
    errors = misfit(three_motion_ellipsoid(f_x, f_y, tau_z, rho=1.0), W, T)
    compare(CASES[key], {f"ell3.{name}": value for name, value in errors._asdict().items()})


def ellipsoid_bodies(inputs):
    bodies = [three_motion_ellipsoid(*inputs[f"semi_axes{i}"], rho=inputs["rho"]) for i in (1, 2)]
    return [measure for body in bodies for measure in (body.volume, body.shadow_area)]


def test_volume_of_ellipsoids():
    inputs = CASES["g01"]["inputs"]
    sizes = *ellipsoid_bodies(inputs), inputs["d"], inputs["rho"]
    compare(CASES["g01"], {"volume_Linf": volume_linf(*sizes), "volume_L1": volume_l1(*sizes)})


@pytest.mark.parametrize("key", ["g04", "g06"])
def test_volume_of_polytopes(key):
    inputs = CASES[key]["inputs"]
    corners = [
        graspit_vertices(axes) if inputs["vertices"] == "graspit" else fibonacci_vertices(axes, inputs["m"])
        for axes in (inputs["semi_axes1"], inputs["semi_axes2"])
    ]
    sizes = *(x for c in corners for x in polytope_volume(c)), inputs["d"], inputs["rho"]
    smooth = volume_linf(*ellipsoid_bodies(inputs), inputs["d"], inputs["rho"])
    linf = volume_linf(*sizes)
    compare(
        CASES[key],
        {"volume_Linf_polytope": linf, "volume_L1_polytope": volume_l1(*sizes), "ratio_to_smooth": linf / smooth},
    )


def test_epsilon_of_unequal_contacts():
    inputs = CASES["e01"]["inputs"]
    contacts = [np.array(inputs[f"semi_axes{i}"]) / [1, 1, inputs["rho"]] for i in (1, 2)]
    arm = inputs["d"] / 2 / inputs["rho"]
    compare(
        CASES["e01"],
        {"epsilon_Linf": epsilon_linf(*contacts, -arm, arm), "epsilon_L1": epsilon_l1(*contacts, -arm, arm)},
    )


def test_score_from_end_to_end():
    inputs = CASES["k01"]["inputs"]
    patch, mu, rho = build(inputs["patch"]), inputs["mu"], inputs["contact_length"]
    sizes = inputs["d"], inputs["object_length"], rho
    found = {}
    for name, model in (("score_ccm", "curved"), ("score_pcm_flat", "flat")):
        contact = friction_limits(patch, mu, model).per_unit_force
        found[name] = score(contact, contact, *sizes).quality
    S = friction_limits(patch, mu).S
    coarse, fine = (
        normalised_samples(friction_wrench(patch, twist, mu), twist, S, rho)[0]
        for twist in (fibonacci_twists(2000, rho), fibonacci_twists(8000, rho))
    )
    phi = 2 * np.pi * np.arange(256) / 256
    translation = np.column_stack([np.cos(phi), np.sin(phi), 0 * phi])
    V, A = body_volume(coarse, fine), shadow_area(friction_support(patch, translation, mu) / S)
    found |= {"V_exact_LS_normalised": V / mu**3, "A_exact_shadow_normalised": A / mu**2}
    found["score_ccm_exact_LS"] = volume_linf(V, A, V, A, inputs["d"] / inputs["object_length"])
    compare(CASES["k01"], found)


def test_faces_without_pressure_change_no_bit():
    loaded, empty = lcg_patch(3, 50), lcg_patch(4, 50)
    both = ContactPatch(
        *(
            np.concatenate([getattr(loaded, name), factor * getattr(empty, name)])
            for name, factor in (("centroid", 1), ("area", 1), ("normal", 1), ("pressure", 0))
        )
    )
    assert friction_limits(both, 1.0) == friction_limits(loaded, 1.0)
    one, two = contact_frame(loaded, [1, 0, 0]), contact_frame(both, [1, 0, 0])
    np.testing.assert_array_equal(one.centre_of_pressure, two.centre_of_pressure)
    np.testing.assert_array_equal(one.axes, two.axes)
    assert contact_length(loaded) == contact_length(both)


def test_millimetres_or_metres_give_the_same_samples():
    metre = lcg_patch(3, 50)
    milli = replace(metre, centroid=1e3 * metre.centroid, area=1e6 * metre.area, pressure=1e-6 * metre.pressure)
    one, two = friction_limits(metre, 1.0), friction_limits(milli, 1.0)
    np.testing.assert_allclose([two.f_x, two.f_y, two.tau_z], [one.f_x, one.f_y, 1e3 * one.tau_z], rtol=1e-14)
    samples = []
    for patch, rho in ((metre, 2.0), (milli, 2e3)):
        twist = fibonacci_twists(100, rho)
        samples.append(normalised_samples(friction_wrench(patch, twist, 1.0), twist, one.S, rho))
    np.testing.assert_allclose(samples[1], samples[0], atol=1e-13)


def test_nan_pressure_is_refused():
    inputs = CASES["x07"]["inputs"]
    patch = build(inputs["patch"])
    corrupted = patch.pressure.copy()
    corrupted[3] = np.nan
    with pytest.raises(ValueError, match=r"pressure\[3\] is nan") as error:
        replace(patch, pressure=corrupted)
    compare(CASES["x07"], {"raises": "face 3" in str(error.value)})


def test_colinear_centres_of_rotation_are_found_rank_deficient():
    patch = build(CASES["x12"]["inputs"]["patch"])
    twist = cor_twists(np.column_stack([np.linspace(-10, 10, 41), np.zeros(41)]))
    W, _ = normalised_samples(friction_wrench(patch, twist, 1.0), twist, friction_limits(patch, 1.0).S, 2.0)
    rank = sample_rank(W)
    compare(CASES["x12"], {"rank": rank, "flagged": rank < 3})
