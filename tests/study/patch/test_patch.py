"""Pressure fields from elsewhere: closed forms, the same answer from every kind of file, units, scores."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import pyvista as pv
from scipy.spatial.transform import Rotation

import softjaw as sj
from softjaw.friction.frame import FrameFlag, principal_direction
from softjaw.friction.patch import ContactPatch
from softjaw.study.patch.answer import SURFACES, EvaluatedPatch, as_record, check_facing, grasp_record, read_patch
from softjaw.study.patch.faces import corner_geometry
from softjaw.study.patch.patch_reader import Reading
from tests.generators import cylinder_grid
from tests.study.launching import ROOT, answer

MU = 0.5
EXAMPLE = ROOT / "jobs" / "cylinder-pressure.csv"
SAME = {"rel": 1e-9, "abs": 1e-12}
PATCH = sj.read_pressure(EXAMPLE)
FLAT = sj.ContactPatch([[0.01, 0, 0], [-0.01, 0, 0]], [1e-4] * 2, [[0, 0, 1]] * 2, [1e4] * 2)
OPPOSED = replace(FLAT, normal=np.array([[0, 0, 1.0], [0, 0.3, -1.0]]), pressure=np.array([1e4, 5e3]))


def cylinder_mesh(R=0.03, alpha=np.pi / 3, L=0.04, n=15, m=9, triangles=False):
    """Points ``(k, 3)`` and quadrilaterals (or triangles) of a cylinder along x; normals point to +z."""
    phi, x = np.linspace(-alpha, alpha, n + 1), np.linspace(-L / 2, L / 2, m + 1)
    points = np.array([[s, R * np.sin(f), R * np.cos(f)] for f in phi for s in x])
    i, j = (g.ravel() for g in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    first = i * (m + 1) + j
    quads = np.stack([first, first + 1, first + m + 2, first + m + 1], axis=1)
    return points, np.vstack([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) if triangles else quads


def table(path, headers, columns):
    lines = [",".join(headers), *(",".join(map(repr, row)) for row in np.column_stack(columns).tolist())]
    path.write_text("\n".join(lines) + "\n")
    return path


def centres(path, patch, length="m", pressure="pa"):
    a, p = {"m": 1.0, "mm": 1e3}[length], {"pa": 1.0, "kpa": 1e-3}[pressure]
    headers = [*(f"{c}_{length}" for c in "xyz"), f"area_{length}2", "nx", "ny", "nz", f"pressure_{pressure}"]
    return table(path, headers, [a * patch.centroid, a**2 * patch.area, patch.normal, p * patch.pressure])


def corners(path, points, cells, pressure):
    headers = [f"{c}{k + 1}_m" for k in range(cells.shape[1]) for c in "xyz"]
    return table(path, [*headers, "pressure_pa"], [points[cells].reshape(len(cells), -1), pressure])


def vtk(path, points, cells, on_cells=(), on_points=(), kinds=None):
    points, faces = np.asarray(points, float), np.concatenate([[len(c), *c] for c in cells])
    if path.suffix == ".vtu":
        grid = pv.UnstructuredGrid(faces, kinds or [{3: 5, 4: 9}[len(c)] for c in cells], points)
    else:
        grid = pv.PolyData(points, faces)
    for data, pairs in ((grid.cell_data, on_cells), (grid.point_data, on_points)):
        for name, values in pairs:
            data[name] = np.asarray(values)
    grid.save(path, binary=False)
    return path


def told(*words):
    return answer("patch", *words, "--mu", MU)


def faceted(triangles=False, **shape):
    """Mesh of a cylinder under a pressure that differs from face to face, and its patch."""
    points, cells = cylinder_mesh(triangles=triangles, **shape)
    centroid, area, normal = corner_geometry(points[cells])
    pressure = 2e4 * (1 - np.abs(centroid[:, 1]) / 0.03) * (1 + 5 * centroid[:, 0])
    return points, cells, ContactPatch(centroid, area, normal, pressure, points[cells])


def friction(answer):
    patch = answer["patches"][0]
    every = [value for model in patch["friction"].values() for value in model.values()]
    return [patch["S"], patch["F_N"], *every]


@pytest.mark.parametrize("triangles", [False, True], ids=["quadrilaterals", "triangles"])
def test_every_kind_of_file_gives_the_same_friction(tmp_path, triangles):
    points, cells, patch = faceted(triangles)
    data = [("other", patch.pressure[::-1]), ("pressure", patch.pressure)]
    units = "--unit", "m", "--pressure-unit", "pa"
    by_corners = told(corners(tmp_path / "corners.csv", points, cells, patch.pressure))
    for file, words in (
        (centres(tmp_path / "centres.csv", patch), ()),
        (vtk(tmp_path / "patch.vtu", points, cells, data), units),
        (vtk(tmp_path / "patch.vtp", points, cells, data), units),
        (vtk(tmp_path / "mm.vtp", 1e3 * points, cells, [("p_kpa", 1e-3 * patch.pressure)]),
         ("--unit", "mm", "--pressure-name", "p")),
    ):  # fmt: skip
        answer = told(file, *words)
        if file.name == "centres.csv":  # without corners the origin lies in the nearest face's centre
            continue
        assert friction(answer) == pytest.approx(friction(by_corners), **SAME)
        assert np.allclose(answer["patches"][0]["frame"]["origin"], by_corners["patches"][0]["frame"]["origin"])


def test_pressure_at_points_is_averaged_over_each_face_and_triangles_leave_their_last_corner_empty(tmp_path):
    points, cells, patch = faceted(n=16)
    at_points = 1e4 + 1e5 * np.abs(points[:, 1])
    file = vtk(tmp_path / "p.vtu", points, cells, on_points=[("pressure", at_points)])
    answer = told(file, "--unit", "m", "--pressure-unit", "pa")
    assert answer["patches"][0]["S"] == pytest.approx(at_points[cells].mean(axis=1) @ patch.area, rel=1e-12)
    both = vtk(tmp_path / "both.vtu", points, cells, [("pressure", patch.pressure)], [("pressure", at_points)])
    answer = told(both, "--unit", "m", "--pressure-unit", "pa")  # that of the cells comes first
    assert answer["patches"][0]["S"] == pytest.approx(patch.pressure @ patch.area, rel=1e-12)
    # Unit square of a quadrilateral of half its area and two triangles: S = p, f = mu p.
    rows = ["0,0,0,.5,0,0,.5,1,0,0,1,0,2", ".5,0,0,1,0,0,1,1,0,,,,2", ".5,0,0,1,1,0,.5,1,0,,,,2"]
    names = [f"{c}{k}" for k in (1, 2, 3, 4) for c in "xyz"]
    file = tmp_path / "mixed.csv"
    file.write_text("\n".join([",".join([*names, "pressure"]), *rows]))
    answer = told(file, "--unit", "m", "--pressure-unit", "pa")
    points = [[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [1, 1, 0], [0.5, 1, 0], [0, 1, 0]]
    mixed = vtk(tmp_path / "mixed.vtu", points, [[0, 1, 4, 5], [1, 2, 3], [1, 3, 4]], [("pressure", [2, 2, 2])])
    assert answer["patches"][0]["S"] == pytest.approx(2.0, rel=1e-14)
    assert answer["patches"][0]["friction"]["ccm"]["f_x_max"] == pytest.approx(MU * 2.0, rel=1e-14)
    assert friction(told(mixed, "--unit", "m", "--pressure-unit", "pa")) == pytest.approx(friction(answer), **SAME)


@pytest.mark.parametrize(("head", "row"), [
    ("x_mm;y_mm;z_mm;area_mm2;nx;ny;nz;pressure_kpa", "1;2;3;100;0;0;2;5"),
    ("x [mm],Y [mm],z (mm),area [mm^2],n_x,n_y,n_z,Pressure [kPa]", "1,2,3,100,0,0,2,5"),
    ("normal_x\tnormal_y\tnormal_z\tx_mm\ty_mm\tz_mm\tarea_cm2\tpressure_mpa", "0\t0\t1\t1\t2\t3\t1\t.005"),
])  # fmt: skip
def test_spellings_of_names_units_and_separators(tmp_path, head, row):
    file = tmp_path / "one.csv"
    file.write_text(f"\ufeff# a comment\n{head}\n\n{row}\n", encoding="utf-8")
    patch = told(file, "--flip-normals")["patches"][0]
    assert patch["S"] == pytest.approx(0.5, rel=1e-14)
    assert patch["frame"]["origin"] == pytest.approx([1e-3, 2e-3, 3e-3])
    assert patch["frame"]["axes"][2] == pytest.approx([0, 0, -1])


def test_unused_columns_are_named_pressure_and_x_can_be_chosen_and_surfaces_that_know_more_fit_better(tmp_path):
    file = tmp_path / "abaqus.csv"
    file.write_text("node,x_m,y_m,z_m,area_m2,nx,ny,nz,CPRESS,pressure_pa\n7,0,0,0,1e-4,0,0,1,100,9\n")
    chosen = told(file, "--pressure-name", "CPRESS", "--pressure-unit", "kpa")
    assert chosen["patches"][0]["S"] == pytest.approx(10.0)
    assert f"not used of {file}: node, pressure_pa" in chosen["notes"]
    assert f"not used of {file}: node, CPRESS" in told(file)["notes"]
    patch = replace(cylinder_grid(0.03, 0.3, 0.06, 9, 12), pressure=np.full(108, 1e4))
    long = told(file := centres(tmp_path / "long.csv", patch))
    given = told(file, "--long-side=0,1,0")
    assert np.abs(long["patches"][0]["frame"]["axes"][0]) == pytest.approx([1, 0, 0], abs=1e-9)
    assert any("--long-side" in text for text in long["notes"])
    curved, turned = (a["patches"][0]["friction"]["ccm"] for a in (long, given))
    assert turned["f_y_max"] == pytest.approx(curved["f_x_max"], rel=1e-12)
    assert not any("--long-side" in text for text in given["notes"])
    surfaces = told(EXAMPLE)["patches"][0]["limit_surface"]["ccm"]
    assert list(surfaces) == ["exact", *SURFACES]
    three, full, quartic = (surfaces[name] for name in ("three_motions", "full", "quartic"))
    assert full["E_rad"] < three["E_rad"]
    assert full["E_dir"] < three["E_dir"]
    assert quartic["E_rad"] < three["E_rad"]
    assert quartic["E_dir"] < 0.25 * full["E_dir"]
    ratio = {name: surfaces[name]["volume"] / surfaces["exact"]["volume"] for name in SURFACES}
    assert 1.05 < ratio["three_motions"] < 1.2
    assert ratio["quartic"] == pytest.approx(1.0, abs=0.01)


def test_the_grasp_of_equal_ellipsoids_has_its_closed_form():
    """quality = 14/9 pi^2 d^2 f_x^2 f_y^2 tau_z per unit force; d over the object's, tau over the contact's length."""
    answer = told(EXAMPLE, "--distance", 60, "--object-length", 90, "--contact-length", 50,
                  "--surface", "three_motions")  # fmt: skip
    patch, grasp = answer["patches"][0], answer["grasp"]
    for model, limits in patch["friction"].items():
        f_x, f_y, tau = (limits[f"{name}_max"] / patch["S"] for name in ("f_x", "f_y", "tau_z"))
        expected = 14 / 9 * math.pi**2 * (60 / 90) ** 2 * f_x**2 * f_y**2 * tau / 0.05
        assert grasp["score"][model]["quality"] == pytest.approx(expected, rel=1e-9)
        lower, upper = grasp["score"][model]["epsilon"]
        about_the_line = 2 * (t := tau / 0.05) / math.hypot(1, t)
        assert about_the_line * (1 - 2e-4) <= lower <= about_the_line * (1 + 1e-9) <= upper * (1 + 2e-9)
    assert grasp["misalignment"] == pytest.approx(0.0, abs=1e-9)


def opposite(patch, distance):
    turn = np.diag([1.0, -1.0, -1.0])
    return replace(patch, centroid=patch.centroid @ turn + [0, 0, distance], normal=patch.normal @ turn)


def test_two_files_score_as_one_whose_copy_faces_it_and_given_normals_outrank_the_corners(tmp_path):
    _, _, patch = faceted(n=9, m=8)
    patch = replace(patch, pressure=np.full(72, 1e4))
    one = centres(tmp_path / "one.csv", patch)
    height = float(patch.centroid[:, 2].max())
    two = centres(tmp_path / "two.csv", opposite(patch, 2 * height + 0.06))
    quick = "--surface", "three_motions"
    alone, both = told(one, "--distance", 60, *quick), told(one, "--other", two, *quick)
    assert both["grasp"]["distance"] == pytest.approx(0.06)
    for model, found in both["grasp"]["score"].items():
        assert found["quality"] == pytest.approx(alone["grasp"]["score"][model]["quality"], rel=1e-6)
    aside = opposite(patch, 2 * height + 0.06)
    two = centres(tmp_path / "aside.csv", replace(aside, centroid=np.add(aside.centroid, [0.05, 0, 0])))
    assert not both["grasp"]["slips"]
    assert told(one, "--other", two, *quick)["grasp"]["slips"]
    # One cell wound the other way changes nothing but a note, which names it; without normals it is refused.
    points, cells, patch = faceted()
    arrays = [("pressure", patch.pressure), ("Normals", patch.normal)]
    right = vtk(tmp_path / "right.vtu", points, cells, arrays)
    turned = cells.copy()
    turned[40] = turned[40, ::-1]
    other = vtk(tmp_path / "other.vtu", points, turned, arrays)
    reading = "--unit", "m", "--pressure-unit", "pa"
    against = vtk(tmp_path / "a.vtu", points, cells[:, ::-1], arrays)
    one, two = told(right, *reading), told(other, *reading)
    assert told(against, *reading)["patches"][0]["frame"]["flag"] == 0  # all wound alike: nothing to say
    assert friction(two) == pytest.approx(friction(one), **SAME)
    assert (one["patches"][0]["frame"]["flag"], two["patches"][0]["frame"]["flag"]) == (0, int(FrameFlag.WINDING))
    [note] = set(two["notes"]) - set(one["notes"])
    assert "1 of 135 loaded faces" in note
    assert "cell 40" in note


def test_the_direction_of_a_patch_hangs_on_no_rounding():
    """Of a square pressed evenly the file's axis nearest to its plane, of equal components the first, positive."""
    rng = np.random.default_rng(0)
    r = np.array([[x, y, 0.0] for x in (-1, 1) for y in (-1, 1)])
    long = r * [2.0, 1.0, 1.0]
    half = 0.5000000005  # two equal components at which the ninth decimal place turns
    leaning = Rotation.align_vectors([[half, half, np.sqrt(1 - 2 * half**2)]], [[0, 0, 1]])[0]
    cases = [
        (r, leaning, [1, 0, 0]), (r, Rotation.from_euler("x", 0.3), [1, 0, 0]),
        (r, Rotation.from_rotvec([-np.pi / 4, 0, 0]) * Rotation.from_euler("z", 0.2), [1, 0, 0]),
        (r, Rotation.align_vectors([[1, 1, 1]], [[0, 0, 1]])[0], [1, 0, 0]),
        (long, Rotation.from_euler("z", -np.pi / 4), np.array([1, -1, 0]) / np.sqrt(2)),
        (long, Rotation.from_euler("z", 3 * np.pi / 4), np.array([1, -1, 0]) / np.sqrt(2)),
    ]
    for places, turn, expected in cases:
        for _ in range(40):
            noise = 4e-16 * rng.uniform(-1, 1, (2, 4, 3))
            normals = turn.apply(np.tile([0.0, 0, 1], (4, 1))) + noise[1]
            patch = ContactPatch(turn.apply(places) + noise[0], np.ones(4), normals, np.ones(4))
            np.testing.assert_allclose(principal_direction(patch), expected, atol=1e-9)


def test_a_grasp_across_its_line_hangs_on_no_rounding():
    """A normal across the line points neither way, one 1e-5 off does."""

    def facing(turn, normal):
        places = ((normal, [0, 0, 0]), (Z, [0, 0, 0.06]))
        pair = [SimpleNamespace(rho=0.02, normal=turn.apply(n), origin=turn.apply(at)) for n, at in places]
        check_facing(pair, ("a", "b"))

    _, Y, Z = np.eye(3)
    for turn in Rotation.random(200, random_state=1):
        with pytest.raises(ValueError, match="towards"):
            facing(turn, Y)  # the second one looks away, the first one neither way
        with pytest.raises(ValueError, match="each other"):
            facing(turn, [0, 1, -1e-5])


def test_they_are_the_numbers_of_the_command_and_do_not_depend_on_the_coordinates():
    [patch] = as_record([EvaluatedPatch(read_patch(str(EXAMPLE), Reading()), 0.8)], None)["patches"]
    for model, limits in sj.friction_limits(PATCH, mu=0.8).items():
        found = patch["friction"][model]
        assert (limits.f_x, limits.f_y, limits.tau_z) == (found["f_x_max"], found["f_y_max"], found["tau_z_max"])
        assert (limits.e_n, limits.e_n_projected) == (found["e_n"], found["e_n_projected"])
    for kind in ("three_motions", "axis_aligned", "full", "quartic"):
        fit = sj.fit_quartic(PATCH, 0.8) if kind == "quartic" else sj.fit_ellipsoid(PATCH, 0.8, kind)
        known = patch["limit_surface"]["ccm"][kind]
        assert fit.surface.semi_axes == pytest.approx(patch["S"] * known["semi_axes"], rel=1e-12)
        assert fit.fit_error.Erad == known["E_rad"]
    turn = Rotation.from_euler("xyz", [0.4, -1.1, 2.0])
    places = turn.apply(PATCH.centroid.copy()) + np.array([0.3, -0.2, 0.1])
    moved = replace(PATCH, centroid=places, normal=turn.apply(PATCH.normal.copy()))
    one, other = (sj.friction_limits(patch, 0.8)["ccm"] for patch in (PATCH, moved))
    assert other._asdict() == pytest.approx(one._asdict(), rel=1e-9)
    motion = np.eye(3)
    here, there = (np.abs(sj.friction_wrench(patch, motion, 0.8)) for patch in (PATCH, moved))
    assert there == pytest.approx(here, abs=1e-9)  # the axes may point the other way
    assert np.diagonal(here[:, [0, 1, 5]]) == pytest.approx([one.f_x, one.f_y, one.tau_z])


@pytest.mark.long
def test_the_quality_is_that_of_the_command_with_every_surface():
    judged = EvaluatedPatch(read_patch(str(EXAMPLE), Reading()), 0.8)
    for kind in ("three_motions", "quartic", "exact"):
        known = grasp_record(judged, None, kind, 0.06)["score"]
        for model, score in known.items():
            found = sj.grasp_quality(PATCH, mu=0.8, distance=0.06, surface=kind, model=model)
            assert found.quality == pytest.approx(score["quality"], rel=1e-12)
            assert found.epsilon == pytest.approx(score["epsilon"][0], rel=1e-2)


@pytest.mark.parametrize(("call", "error", "words"), [
    (lambda: sj.friction_limits([1, 2], 0.8), TypeError, "expected a ContactPatch"),
    (lambda: sj.friction_limits(FLAT, 0.8, x_axis=[0, 0, 1]), ValueError, "x_axis"),
    (lambda: sj.friction_limits(FLAT, 0.8, x_axis=[1, 0]), ValueError, "x_axis is .*three finite numbers"),
    (lambda: sj.friction_limits(FLAT, 0.8, x_axis=[np.nan, 0, 0]), ValueError, "x_axis is .*three finite numbers"),
    (lambda: sj.friction_limits(FLAT, "0.8"), ValueError, "mu is '0.8': .* one finite number"),
    (lambda: sj.friction_limits(FLAT, [0.8]), ValueError, "mu is .*one finite number"),
    (lambda: sj.grasp_quality(FLAT, mu=0.8, distance="5"), ValueError, "distance is '5': expected a positive length"),
    (lambda: sj.friction_limits(OPPOSED, 0.8), ValueError, "oppose their neighbours"),
    (lambda: sj.friction_wrench(FLAT, [0, 0, 1], 0.8, "pcn"), ValueError, "model is 'pcn'"),
    (lambda: sj.fit_ellipsoid(FLAT, 0.8, "quartic"), ValueError, "kind is 'quartic'.*three_motions"),
    (lambda: sj.fit_quartic(FLAT, 0.8, samples=2), ValueError, "samples is 2"),
    (lambda: sj.grasp_quality(FLAT, mu=0.8), ValueError, "neither.*second patch or a distance"),
    (lambda: sj.grasp_quality(FLAT, FLAT, mu=0.8, distance=0.1), ValueError, "both"),
    (lambda: sj.grasp_quality(FLAT, FLAT, mu=0.8), ValueError, "same place"),
    (lambda: sj.grasp_quality(FLAT, mu=0.8, distance=-1), ValueError, "distance is -1"),
    (lambda: sj.grasp_quality(FLAT, mu=0.8, distance=1, object_length=0), ValueError, "object_length is 0"),
    (lambda: sj.grasp_quality(FLAT, mu=0.8, distance=1, surface="round"), ValueError, "surface is 'round'.*exact"),
    (lambda: sj.grasp_quality(FLAT, mu=0.8, distance=1, model="x"), ValueError, "model is 'x'"),
    (lambda: sj.read_pressure("none.csv"), sj.StudyError, "none.csv: cannot be read"),
    (lambda: sj.read_pressure(EXAMPLE, unit="inch"), sj.StudyError, "unit: found .inch.*mm"),
    (lambda: sj.read_pressure(EXAMPLE, pressure_unit="bar"), sj.StudyError, "pressure_unit: found .bar"),
])  # fmt: skip
def test_what_is_no_argument_is_refused(call, error, words):
    with pytest.raises(error, match=words):
        call()


def test_what_a_file_says_beside_its_patch_is_a_warning(tmp_path):
    text = EXAMPLE.read_text().replace("pressure_kpa\n", "pressure_kpa,remark_kg\n")
    lines = [line if line.startswith("#") or "remark" in line else f"{line},1" for line in text.splitlines()]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    with pytest.warns(UserWarning, match="remark_kg"):
        assert sj.read_pressure(tmp_path / "a.csv").area.shape == (240,)


@pytest.mark.parametrize(("kilopascals", "noted"), [(0.001, True), (3.0, False)])
def test_faint_faces_far_away_that_set_the_length_of_a_contact_are_noted(tmp_path, kilopascals, noted):
    (tmp_path / "a.csv").write_text(f"{EXAMPLE.read_text()}80,0,-30,5.236,0,0,1,{kilopascals}\n")
    found = as_record([EvaluatedPatch(read_patch(str(tmp_path / "a.csv"), Reading()), 0.8)], None)
    assert found["patches"][0]["rho"] > 0.09
    assert any(note.startswith("rho is") for note in found["notes"]) == noted
