"""Every worked case of the reference table: patch, mesh or contacts in, every expected value in its tolerance out."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path
from unittest import mock

import numpy as np
import pytest
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from jobs.graspit import graspit_vertices
from softjaw.friction.frame import FrameFlag, contact_frame, contact_length, in_frame
from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import friction_limits, friction_support, friction_wrench, pure_torque
from softjaw.lsfit.ellipsoid import Ellipsoid, axis_aligned_ellipsoid, full_ellipsoid, three_motion_ellipsoid
from softjaw.lsfit.form import exponents, monomials
from softjaw.lsfit.quartic import Quartic
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.samples import fit_error, normalised_samples, sample_rank
from softjaw.lsfit.span import zhou_ellipsoid, zhou_quartic
from softjaw.lsfit.surface import FitFlag, supported_shadow
from softjaw.scoring.closed_form import epsilon_l1, epsilon_linf, volume_l1, volume_linf
from softjaw.scoring.contact import PolytopeBody, SoftContact, fibonacci_vertices, hull_volume
from softjaw.scoring.epsilon import epsilon
from softjaw.scoring.pose import pose_volume
from softjaw.scoring.quality import score
from tests import generators as made
from tests.lsfit.test_span import as_they_are, objective
from tests.oracles import body_volume, least_squares_quartic
from tests.scoring.grasps import contact_axes

TABLE = json.loads((Path(__file__).parent / "data" / "friction_table.json").read_text())["cases"]
CASES = {case["id"]: case for case in TABLE}
MODEL = {"ccm": "ccm", "pcm_flat": "pcm", "pcm_projected": "pcm_projected"}
X_HINT = np.array([0.0, 0.0, 1.0])  # of the contacts of a grasp, to be projected on their tangent planes
FIELDS = {
    None: None,
    "1+0.8*y": lambda r: 1 + 0.8 * r[:, 1],
    "exp(-((x-0.3)^2+y^2))": lambda r: np.exp(-((r[:, 0] - 0.3) ** 2 + r[:, 1] ** 2)),
}


def maxima(inputs, names, patch=None):
    patch, mu = made.build(inputs["patch"]) if patch is None else patch, inputs["mu"]
    found = {}
    for model in inputs.get("models", ["ccm"]):
        limits = friction_limits(patch, mu, MODEL[model])
        prefix = "" if model == "ccm" else f"{model}."
        found |= {f"{prefix}fx": limits.f_x, f"{prefix}fy": limits.f_y, f"{prefix}tau": limits.tau_z}
        found |= {f"{prefix}FN_sum": limits.S, f"{prefix}FN_proj": limits.F_N, f"{prefix}en": limits.e_n}
    if "tau_pure" in names:
        found["tau_pure"] = pure_torque(patch, mu)
    return found


def wrenches(inputs, _):
    planar = [made.cor_twists(inputs["cors"]), *[[[*v, 0.0]] for v in inputs["translations"]]]
    twists = np.zeros((sum(map(len, planar)), 6))
    twists[:, [0, 1, 5]] = np.vstack(planar)
    screws = [made.screw_twist(s["axis"], s["point"], float(s["pitch"])) for s in inputs["screws"]]
    twists = np.vstack([twists, *screws])
    patch, mu = made.build(inputs["patch"]), inputs["mu"]
    patch = replace(patch, centroid=patch.centroid - np.array(inputs["reference_point"], float))
    return {"W": friction_wrench(patch, twists, mu), "H": friction_support(patch, twists, mu)}


def mesh_of(inputs):
    mesh, pressure = dict(inputs["mesh"]), FIELDS[inputs.get("pressure")]
    kind = mesh.pop("gen")
    if kind == "cyl_mesh":
        return made.mesh_patch(made.cyl_mesh(**mesh), pressure)
    if kind == "bumpy":
        return made.mesh_patch(made.grid_mesh(mesh["n"], mesh["n"], 1, 1, made.bump), pressure)
    corners = made.grid_mesh(mesh["n"], mesh["m"], mesh["halfx"], mesh["halfy"])
    axis = np.array(mesh["rotation_axis"]) / np.linalg.norm(mesh["rotation_axis"])
    turn = Rotation.from_rotvec(mesh["angle"] * axis)
    return made.mesh_patch(turn.apply(corners.reshape(-1, 3)).reshape(corners.shape) + mesh["translation"], pressure)


def frames(inputs, _):
    patch = mesh_of(inputs)
    frame = contact_frame(patch, inputs["x_hint"])
    assert not frame.flag & (FrameFlag.ORIENTATION | FrameFlag.NO_CORNERS)
    limits = friction_limits(in_frame(patch, frame), inputs["mu"])
    places = {"COP": frame.centre_of_pressure, "O": frame.origin, "N": frame.axes[2], "x": frame.axes[0]}
    return places | {"fx": limits.f_x, "fy": limits.f_y, "tau": limits.tau_z}


def samples(inputs):
    patch, mu, rho, sampling = made.build(inputs["patch"]), inputs["mu"], inputs["rho"], inputs["sampling"]
    model, grid = MODEL[inputs.get("model", "ccm")], sampling["scheme"] == "cor_grid"
    twist = made.cor_grid(sampling["n"], rho) if grid else fibonacci_twists(sampling["K"], rho)
    limits = friction_limits(patch, mu, model)
    W, T = normalised_samples(friction_wrench(patch, twist, mu, model), twist, mu * limits.S, rho)
    if "noise" in inputs:
        W = W * made.lcg_noise(len(W), inputs["noise"]["amp"], inputs["noise"]["seed"])[:, None]
    f_x, f_y, tau_z = np.array(limits.per_unit_force) / mu / [1, 1, rho]
    return W, T, three_motion_ellipsoid(f_x, f_y, tau_z, rho=1.0)


def errors_of(name, surface, W, T):
    return {f"{name}.{error}": value for error, value in fit_error(surface, W, T)._asdict().items()}


def mean_square(surface, W):
    return float(np.mean((surface.value(W) - 1) ** 2))


def fits(inputs, names):
    W, T, three = samples(inputs)
    if "lam" in inputs:
        return zhou_fits(inputs, W, T)
    quartic = least_squares_quartic(W, T, gamma=0.0)
    convex = convex_quartic(W, T, gamma=inputs.get("gamma", 0.0))[0]
    full = full_ellipsoid(W)
    found = {"ell_full.A": full.A, "quartic_ls.obj_mean_sq": mean_square(quartic, W)}
    found["obj_unconstrained"] = found["quartic_ls.obj_mean_sq"]
    found["obj_sos"] = mean_square(convex, W)
    # A quartic of least squares that is convex is the convex quartic of least squares.
    found["quartic_ls.convex"] = found["obj_sos"] <= found["obj_unconstrained"] * (1 + 1e-9)
    surfaces = {"ell3": three, "ell_diag": axis_aligned_ellipsoid(W), "ell_full": full, "quartic_ls": quartic}
    surfaces |= {"quartic_sos": convex, "quartic_sdp": convex}
    for name, surface in surfaces.items():
        found |= errors_of(name, surface, W, T)
    return found


def zhou_fits(inputs, W, T):
    weights, found = [inputs[name] for name in ("lam", "beta", "gamma")], {}
    for name, method in (("quartic", zhou_quartic), ("ellipsoid", zhou_ellipsoid)):
        surface = method(as_they_are(W, T), tuple(weights))
        found |= {f"{name}.objective": objective(surface, W, T, *weights)} | errors_of(name, surface, W, T)
    return found


def fits_in_six_dimensions(inputs, _):
    patch, mu, rho, sampling = made.build(inputs["patch"]), inputs["mu"], inputs["rho"], inputs["sampling"]
    unit = made.lcg_sphere(sampling["d"], sampling["K"], sampling["seed"])
    point = np.array(inputs["ref_point"], float)
    twist = unit / [1, 1, 1, rho, rho, rho]
    about = made.moved(patch, np.eye(3), -point)  # motions are those of the reference point
    W, T = normalised_samples(friction_wrench(about, twist, mu), twist, mu * friction_limits(patch, mu).S, rho)
    full = full_ellipsoid(W)
    E = exponents(6, 4)
    M = monomials(W, E)
    quartic = Quartic.of_coefficients(np.linalg.solve(M.T @ M + 1e-6 * np.eye(len(E)), M.sum(axis=0)), 6)
    return {
        "W_absmax": np.abs(W).max(axis=0), "W_first3": W[:3], "ell_full.A": full.A,
        **errors_of("ell_full", full, W, T), **errors_of("quartic_ls_reg1e-6", quartic, W, T),
    }  # fmt: skip


def bodies(inputs):
    return [Ellipsoid.of_axes(inputs[f"semi_axes{i}"]) for i in (1, 2)]


def measures(bodies, rho):
    return [measure for body in bodies for measure in (body.volume / rho, body.shadow_area)]


def linearised(axes, kind, m=None):
    return PolytopeBody(graspit_vertices(axes) if kind == "graspit" else fibonacci_vertices(axes, m))


def grasps(inputs, names):
    if "N1" in inputs:
        return any_pose(inputs, names)
    d, rho = inputs["d"], inputs["rho"]
    smooth = *measures(bodies(inputs), rho), d / rho
    found = {"volume_Linf": volume_linf(*smooth), "volume_L1": volume_l1(*smooth)}
    if "vertices" in inputs:
        shapes = [linearised(inputs[f"semi_axes{i}"], inputs["vertices"], inputs["m"]) for i in (1, 2)]
        polytopes = *measures(shapes, rho), d / rho
        found["volume_Linf_polytope"], found["volume_L1_polytope"] = volume_linf(*polytopes), volume_l1(*polytopes)
        found["ratio_to_smooth"] = found["volume_Linf_polytope"] / found["volume_Linf"]
    centre = np.array(inputs.get("com", [0, 0, 0]), float)
    if centre[1:].any():
        facing = {"O1": [-d / 2, 0, 0], "N1": [1, 0, 0], "O2": [d / 2, 0, 0], "N2": [-1, 0, 0]}
        return found | any_pose({**inputs, **facing}, {name for name in names if "epsilon" in name})
    axes = [np.array(inputs[f"semi_axes{i}"]) / [1, 1, rho] for i in (1, 2)]
    arms = [(side * d / 2 - centre[0]) / rho for side in (-1, 1)]
    return found | {"epsilon_Linf": epsilon_linf(*axes, *arms), "epsilon_L1": epsilon_l1(*axes, *arms)}


def any_pose(inputs, names):
    lengths, found = (inputs["rho"], inputs["rho"], inputs["com"]), {}
    for name in names:
        m = re.search(r"fib(\d+)_polytope$", name)
        shapes = [linearised(body.semi_axes, "fib", int(m[1])) if m else body for body in bodies(inputs)]
        contacts = [
            SoftContact(inputs[f"O{i}"], contact_axes(inputs[f"N{i}"], X_HINT), shape)
            for i, shape in enumerate(shapes, start=1)
        ]
        kind = "l1" if "_L1" in name else "linf"
        if name.startswith("epsilon"):
            bound = epsilon(contacts, *lengths, kind=kind, tolerance=1e-5)
            found[name] = (bound.lower + bound.upper) / 2
        else:
            found[name] = getattr(pose_volume(*contacts, *lengths), kind)
    return found


def end_to_end(inputs, _):
    patch, mu, rho = made.build(inputs["patch"]), inputs["mu"], inputs["contact_length"]
    sizes = inputs["d"], inputs["object_length"], rho
    found = {}
    for name, model in MODEL.items():
        contact = friction_limits(patch, mu, model).per_unit_force
        found[f"score_{name}"] = score(contact, contact, *sizes).quality
    S = friction_limits(patch, mu).S
    coarse, fine = (
        normalised_samples(friction_wrench(patch, twist, mu), twist, S, rho)[0]
        for twist in (fibonacci_twists(2000, rho), fibonacci_twists(8000, rho))
    )
    V, A = body_volume(coarse, fine), supported_shadow(lambda t: friction_support(patch, t, mu) / S, 3, 256)
    found |= {"V_exact_LS_normalised": V / mu**3, "A_exact_shadow_normalised": A / mu**2}
    return found | {"score_ccm_exact_LS": volume_linf(V, A, V, A, inputs["d"] / inputs["object_length"])}


def hard(inputs, names, description):
    if "raises" in names:
        return {"raises": refused(made.build(inputs["patch"]), inputs["corruption"])}
    if "rank" in names:
        return colinear(inputs, description)
    if "zero-pressure" in description:
        other = re.search(r"plus lcg_patch\((\d+),(\d+)\)", description)
        empty_faces_change_nothing(made.build(inputs["patch"]), made.lcg_patch(int(other[1]), int(other[2])))
    if "units" in description:
        units_change_no_sample(made.build(inputs["patch"]))
    return maxima(inputs, names)


def refused(patch, corruption):
    """Whether the patch with one bad value, such as "NaN pressure in element 3", is refused by the face's number."""
    bad, name, face = re.match(r"(\S+) (\w+) in element (\d+)", corruption).groups()
    array = getattr(patch, {"centre": "centroid", "position": "centroid"}.get(name, name)).copy()
    array[int(face)] = {"NaN": np.nan, "Inf": np.inf, "negative": -1.0, "zero": 0.0}[bad]
    with pytest.raises(ValueError, match=rf"\[{face}\D.*face {face}\b"):
        replace(patch, **{name: array})
    return True


def colinear(inputs, description):
    count, low, high = re.search(r"\((\d+) on the x axis in \[(-?\d+),(-?\d+)\]", description).groups()
    x = np.linspace(float(low), float(high), int(count))
    patch = made.build(inputs["patch"])
    twist = made.cor_twists(np.column_stack([x, 0 * x]))
    S = friction_limits(patch, inputs["mu"]).S
    W, T = normalised_samples(friction_wrench(patch, twist, inputs["mu"]), twist, inputs["mu"] * S, 2.0)
    surfaces = [axis_aligned_ellipsoid(W), full_ellipsoid(W), least_squares_quartic(W, T), convex_quartic(W, T)[0]]
    ranks = {sample_rank(W), *(surface.rank for surface in surfaces)}
    assert len(ranks) == 1
    return {"rank": ranks.pop(), "flagged": all(surface.flag & FitFlag.RANK_DEFICIENT for surface in surfaces)}


def empty_faces_change_nothing(loaded, other):
    parts = (("centroid", 1), ("area", 1), ("normal", 1), ("pressure", 0))
    both = ContactPatch(*(np.concatenate([getattr(loaded, name), k * getattr(other, name)]) for name, k in parts))
    limits, same = (friction_limits(patch, 1.0) for patch in (loaded, both))
    assert same == pytest.approx(limits, rel=1e-12)  # sums over other numbers of faces may end in other bits
    one, two = contact_frame(loaded, [1, 0, 0]), contact_frame(both, [1, 0, 0])
    np.testing.assert_allclose(two.centre_of_pressure, one.centre_of_pressure, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(two.axes, one.axes, atol=1e-12)
    assert contact_length(both) == pytest.approx(contact_length(loaded), rel=1e-12)


def units_change_no_sample(metre):
    milli = replace(metre, centroid=1e3 * metre.centroid, area=1e6 * metre.area, pressure=1e-6 * metre.pressure)
    one, two = friction_limits(metre, 1.0), friction_limits(milli, 1.0)
    np.testing.assert_allclose([two.f_x, two.f_y, two.tau_z], [one.f_x, one.f_y, 1e3 * one.tau_z], rtol=1e-14)
    (W, T), (W_milli, T_milli) = (
        normalised_samples(friction_wrench(patch, twist, 1.0), twist, one.S, rho)
        for patch, rho in ((metre, 2.0), (milli, 2e3))
        for twist in [fibonacci_twists(100, rho)]
    )
    np.testing.assert_allclose([W_milli, T_milli], [W, T], atol=1e-13)
    quartics = [least_squares_quartic(*pair).coefficients for pair in ((W, T), (W_milli, T_milli))]
    np.testing.assert_allclose(quartics[1], quartics[0], rtol=1e-9, atol=1e-9)


SOLVERS = {
    "maxima": maxima, "wrench": wrenches, "frame": frames, "fit3d": fits, "fit6d": fits_in_six_dimensions,
    "gws": grasps, "score": end_to_end, "hard": hard,
}  # fmt: skip


def solve(case):
    more = [case["description"]] if case["category"] == "hard" else []
    return SOLVERS[case["category"]](case["inputs"], set(case["expected"]), *more)


def compare(case, found):
    """Every expected value of the case, within its own tolerance; nothing expected may be missing."""
    assert set(case["expected"]) <= set(found)
    for name, expected in case["expected"].items():
        tolerance = {key: expected.get(key, 0.0) for key in ("rtol", "atol")}
        np.testing.assert_allclose(found[name], expected["value"], **tolerance, err_msg=f"{case['id']} {name}")


@pytest.mark.parametrize("key", CASES)
def test_case(key):
    compare(CASES[key], solve(CASES[key]))


def test_the_cases_are_those_of_the_file_each_once():
    assert len(CASES) == len(TABLE) == 38
    assert {case["category"] for case in TABLE} == set(SOLVERS)


def test_pressures_over_twelve_decades_keep_their_digits_and_qhull_may_fail():
    wide = replace(made.lcg_patch(9, 300), pressure=10 ** np.linspace(-6, 6, 300))
    exact = math.fsum(math.hypot(*np.cross(n, np.eye(3)[0])) * f for n, f in zip(wide.normal, wide.load, strict=True))
    assert friction_limits(wide, 1.0).f_x == pytest.approx(exact, rel=1e-15)
    weak = replace(wide, pressure=np.where(np.arange(300) < 150, wide.pressure, 0.0))
    assert friction_limits(weak, 1.0).f_x > 0
    for distance in 10.0 ** np.arange(-12, 0):
        offset = np.array([[0.6, 0.8]]) * distance
        place = np.array([[0.25, -0.5]])
        exact_offset = (place + offset) - place
        W = friction_wrench(made.points_patch(place, [2.0]), made.cor_twists(place + offset), 0.5)[0]
        direction = np.array([exact_offset[0, 1], -exact_offset[0, 0]]) / np.linalg.norm(exact_offset)
        np.testing.assert_allclose(W[:2], direction, atol=1e-14)
    # A hull that Qhull refuses is joggled; its volume is right to 1e-4.
    vertices = fibonacci_vertices((0.8, 0.6, 0.15), 30)
    exact = hull_volume(vertices)

    def moody(points, qhull_options=None, **options):
        if qhull_options is None:
            raise QhullError("QH6271 topology error")
        return ConvexHull(points, qhull_options=qhull_options, **options)

    with mock.patch("softjaw.scoring.contact.ConvexHull", moody):
        np.testing.assert_allclose(hull_volume(vertices), exact, rtol=1e-4)
