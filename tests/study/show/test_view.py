"""Views in three dimensions, also for ParaView: whose triangle it is, where pads stand; and the report as text."""

import base64
import json
import math
import re
import shutil

import h5py
import matplotlib
import numpy as np
import pytest
import pyvista as pv
import trimesh
from trimesh.triangles import area as areas

from softjaw.fem.objects.gap import Pose
from softjaw.fem.objects.shapes import EllipticCylinder
from softjaw.study.cli import main
from softjaw.study.messages import CANNOT_WRITE, OTHER_FILE, USAGE, StudyError
from softjaw.study.quantities import ALONG, AROUND
from softjaw.study.ranking import judge
from softjaw.study.result.layout import REPORT_BYTES
from softjaw.study.result.read import open, scene_of
from softjaw.study.scene import SceneError
from softjaw.study.show.grasps import order
from softjaw.study.show.object_surface import NOBODY, Cells, between, coloured, cut, moved, pressed
from softjaw.study.show.report import contact
from softjaw.study.show.report.verdict import plain_report
from softjaw.study.show.view.model import View, quantity_of, view_of
from softjaw.study.show.view.object3d import object_block, payload
from softjaw.study.show.view.pads import corners_of, pads_of
from tests.study.formula_results import sealed
from tests.study.launching import refusal
from tests.study.scenes import mesh_of, text_of
from tests.study.view_files import CLOSING, FAILED, GRID, PRESSURE, SIZE, make, quality

RING = 0.14181  # circumference of an ellipse with semi-axes 25 and 20 mm [m]


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return make(tmp_path_factory.mktemp("view") / "thing.hdf")


@pytest.fixture
def shown(file):
    return view_of(judge(open(file)), None, (None, None), None)


def corners_on(body):
    points, triangles = body.surface()
    return np.asarray(points, float)[triangles]


def test_cutting_keeps_the_area_and_each_candidate_owns_its_interval_and_what_its_pads_meet():
    corners = corners_on(EllipticCylinder(0.03, 0.02, 0.1))
    whole = areas(corners).sum()
    for normal, offset in (((0, 0, 1.0), 0.0123), ((0.6, 0.8, 0), 0.004), ((0, 1.0, 0), 0.0)):
        corners = cut(corners, np.array(normal), offset)
        d = corners @ normal - offset
        assert not ((d.min(axis=1) < -1e-9) & (d.max(axis=1) > 1e-9)).any()
    assert areas(corners).sum() == pytest.approx(whole, rel=1e-12)
    # Two pads of 50 mm x 22 mm on a plate of two triangles, the second 30 mm further; a third one passes.
    corners = np.array([[[-1, -1, 0], [1, -1, 0], [1, 1, 0]], [[-1, -1, 0], [1, 1, 0], [-1, 1, 0]]]) * 0.1
    places = [(0.0, 0.0, 0.0), (0.03, 0.0, -1e-3), (0.0, 0.0, 2e-3)]
    feet = [(n, Pose(np.eye(3), np.array(x)), 2e-3) for n, x in enumerate(places)]
    cut_up, cell = pressed(corners, feet, (0.05, 0.022))
    area = [areas(cut_up[cell == n]).sum() for n in (0, 1, 2, NOBODY)]
    assert area == pytest.approx([50e-3 * 22e-3, 30e-3 * 22e-3, 0.0, 0.04 - 80e-3 * 22e-3], rel=1e-9)
    cells = Cells(np.array([0.03, -0.01, 0.01]), np.radians([0, 90]), 2, 0.05, 0.022)
    corners, cell = coloured(corners_on(EllipticCylinder(0.03, 0.03, 0.2)), cells)
    area = areas(corners)
    ring = 2 * math.pi * 0.03 * 0.02
    for candidate in range(6):
        assert area[cell == candidate].sum() == pytest.approx(ring / 2, rel=2e-3)
    z = corners[..., 2].mean(axis=1)
    assert cell[np.argmin(z)] == NOBODY
    assert set(cell[np.abs(z - 0.03) < 0.009]) == {0, 1}  # station 0 is the highest, in the order of the scene
    first = corners[cell == 0][..., :2].mean(axis=1)
    assert (np.abs(first[:, 0]) > np.abs(first[:, 1]) - 1e-9).all()
    assert first[:, 0].min() < -0.02
    assert first[:, 0].max() > 0.02


@pytest.mark.parametrize(("symmetry", "share"), [(1, 1 / 4), (2, 1 / 4), (4, 1 / 2), (0, 3 / 8)])
def test_cells_repeat_as_the_object_does(symmetry, share):
    """Angles 0, 45, 90 degrees repeat after 180, where nobody has those between, or after 90, where 90 is 0 again."""
    cells = Cells(np.array([0.0]), np.radians([0, 45, 90]), symmetry, 0.05, 0.022)
    phi = np.radians(np.linspace(0, 360, 7200, endpoint=False) + 0.0123)
    at = cells.at(np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=1))
    assert (at == 0).mean() == pytest.approx(share, abs=1e-3)
    assert (at == 1).mean() == pytest.approx(1 / 2 if symmetry == 4 else 1 / 4, abs=1e-3)


def test_an_angle_that_is_asked_for_may_lie_any_number_of_half_turns_away(file):
    ds = judge(open(file))
    for turns in (-1, 0, 1, 2):
        assert view_of(ds, None, (0.02, ds.angle.values[1] + turns * np.pi), None)[1][-2] == 1


def test_a_lone_angle_claims_what_its_pads_cover_and_a_wall_moves_bilinearly_between_its_places():
    phi = np.radians(np.arange(0, 360, 0.1))
    x = 0.03 * np.stack([np.cos(phi), np.sin(phi), 0 * phi], axis=1)
    alone = Cells(np.array([0.0]), np.array([0.0]), 2, 0.05, 0.02).at(x)
    assert (alone == 0).mean() == pytest.approx(2 * math.asin(1 / 3) / math.pi, abs=2e-3)
    assert (Cells(np.array([0.0]), np.array([0.0]), 0, 0.05, 0.02).at(x) == 0).all()
    i, j = np.meshgrid(np.arange(AROUND), np.arange(ALONG), indexing="ij")
    grid = np.stack([np.cos(2 * np.pi * i / AROUND), 1.0 * j, 0.0 * j], axis=-1)
    assert between(grid, np.array([3.0, 3.5]), np.array([7.25, ALONG - 1.0]))[:, 1] == pytest.approx([7.25, ALONG - 1])
    both = between(grid, np.array([AROUND - 0.5, -0.5]), np.array([0.0, 0.0]))[:, 0]
    assert both == pytest.approx([0.5 * (1 + math.cos(2 * math.pi / AROUND))] * 2)
    u = np.zeros((AROUND, ALONG, 3))
    u[0] = (-1e-3, 0, 0)  # under finger 1
    shifts = moved(np.array([[12.0, 5.0], [0.0, 5.0], [np.nan, 5.0]]), u, angle=math.pi / 2)
    assert shifts[0] == pytest.approx([-1e-3, 0, 0])  # a quarter of the way round
    assert not shifts[1:].any()


@pytest.mark.parametrize("side", [[0.2113, 0.7887], [0.15, 0.85], [0.1127, 0.5, 0.8873]])
def test_faces_between_places_of_their_rule_fill_the_whole_pad(side):
    places = np.concatenate([np.array(side) + i for i in range(4)])
    corners = corners_of(np.stack(np.meshgrid(places, places, indexing="ij"), axis=-1), len(side))
    assert corners[[0, -1], [0, -1]] == pytest.approx(np.array([[0.0, 0.0], [4.0, 4.0]]), abs=1e-12)


def test_pads_stand_where_the_file_says_and_arrows_add_up_to_the_friction_of_the_whole(shown):
    """Files keep faces of patches to 3e-5 of the largest value of their case."""
    view, index = shown
    assert index == (1, 0, 1)
    # it is fitted to faces, so that the largest of their colours is another number
    assert ": largest fitted pressure " in contact.patch(view, index)["caption"]
    one, two = view.pads(index)
    assert one.face[..., 0] == pytest.approx(np.full((5, 5), 0.025), abs=1e-6)
    assert two.face[..., 0] == pytest.approx(np.full((5, 5), -0.025), abs=1e-6)
    assert np.ptp(one.face.reshape(-1, 3), axis=0) == pytest.approx([0, SIZE[1], SIZE[0]], abs=3e-6)
    assert one.back[:, 0] == pytest.approx(np.full(4, 0.025 + SIZE[2] - CLOSING))
    assert one.pose.to_pad(one.back)[:, 2] == pytest.approx(np.full(4, CLOSING - SIZE[2]))
    assert one.sides().shape == (17, 4, 3)
    area = 0.5 * np.linalg.norm(
        np.cross(*np.diff(one.quads()[:, [0, 2, 1, 3]].reshape(-1, 2, 2, 3), axis=2)[:, :, 0].swapaxes(0, 1)), axis=1
    )
    assert area == pytest.approx(one.area.ravel(), rel=1e-4)
    # Flat front, slip along x: every force along x, mu left out; a turn about the middle gives no net force.
    places, forces = one.friction("x")
    assert len(places) == one.loaded.sum() == 4
    load = 5 * PRESSURE * SIZE[0] * SIZE[1] / 16
    assert forces == pytest.approx(np.broadcast_to(load * one.frame[0], (4, 3)), rel=1e-4, abs=1e-4 * load)
    assert one.friction("y")[1].sum(axis=0) @ one.frame[1] == pytest.approx(4 * load, rel=1e-4)
    places, forces = one.friction("turn")
    assert np.abs(forces.sum(axis=0)).max() < 1e-4 * load
    arms = np.linalg.norm(places - one.origin, axis=1)
    assert (np.cross(places - one.origin, forces) @ one.frame[2]) == pytest.approx(arms * load, rel=1e-4)


@pytest.mark.parametrize("axis", "xyz")
def test_a_mesh_is_drawn_in_the_frame_of_its_file(tmp_path, axis):
    box = trimesh.creation.box(extents=(30, 40, 80)).apply_translation((100, -50, 7))
    box.export(tmp_path / "box.stl")
    scene = text_of(mesh_of(tmp_path / "box.stl") + f'\naxis = "{axis}"')
    drawn = View(judge(open(make(tmp_path / "a.hdf", scene=scene)))).surface.points
    np.testing.assert_allclose(1e3 * drawn.min(axis=0), box.bounds[0], atol=1e-3)
    np.testing.assert_allclose(1e3 * drawn.max(axis=0), box.bounds[1], atol=1e-3)
    box.apply_scale(1.1).export(tmp_path / "box.stl")
    other = View(judge(open(tmp_path / "a.hdf")))
    assert other.surface.points.size == 0
    assert "object.mesh" in other.note
    with pytest.raises(SceneError, match=r"object\.mesh"):
        scene_of(other.ds)


def test_no_pads_are_invented_and_a_case_is_chosen_by_number_place_or_score(file, tmp_path, shown):
    view, _ = shown
    assert view.pads(FAILED) == []
    assert view.pads((0, 0, 1)) == []
    assert pads_of(view.ds, None, (1, 0, 1), {}) == []
    bare, index = view_of(judge(open(make(tmp_path / "bare.hdf", patches=False))), 2, (None, None), 5)
    one = bare.pads(index)[0]
    assert one.pressure.size == 0
    assert one.face.shape == (2, 2, 3)
    assert len(one.friction("x")[0]) == 0
    chosen = {
        (None, None, None, 1.0): (1, 0, 0),
        (4, None, None, 4.0): (2, 0, 1),
        (None, 0.019, None, None): (2, 0, 1),  # the better angle there
        (None, 0.019, 1.5, None): (2, 1, 1),
        (None, -0.02, 0.0, None): (0, 0, 1),  # also what is not solved
    }
    for (candidate, station, angle, force), index in chosen.items():
        assert view_of(view.ds, candidate, (station, angle), force)[1] == index
    with refusal(USAGE, match="0 to 5"):
        view_of(view.ds, 6, (None, None), None)
    for name in ("beauty", "flags"):  # whose bits no colour tells
        with pytest.raises(StudyError, match="quality, e_n"):
            quantity_of(view.ds, name)


def unpacked(packed, kind="<f4"):
    return np.frombuffer(base64.b64decode(packed), kind)


def every(view):
    return [i for k in (1, 0) for i in order(view.ds, k)]


def test_the_page_holds_every_solved_case_with_pads_friction_and_limit_surface_where_the_file_says(shown):
    view, index = shown
    told, left_out = payload(view, index, "quality", every(view), "x", limit_surface=True)
    assert left_out == 0
    assert set(told["cases"]) == {f"{k} {c}" for k in (0, 1) for c in range(6)} - {"1 5", "1 0"}
    assert told["start"] == {"candidate": 2, "force": 1, "quantity": "quality"}
    assert told["notes"]["1 5"] == "failed: no &lt;/script&gt; convergence"
    assert told["words"]["1 5"][-1] == "failed: no </script> convergence"
    assert told["states"] == [[1] * 6, [0, 1, 1, 1, 1, 2]]
    assert told["quantities"][0]["values"][1][2] == pytest.approx(quality(index))
    assert told["quantities"][0]["values"][1][5] is None
    points, owner = unpacked(told["points"]).reshape(-1, 3), unpacked(told["owner"], "<i4")
    assert points == pytest.approx(1e3 * view.surface.points, rel=1e-6)
    assert (owner == view.surface.owner).all()
    assert (unpacked(told["triangles"], "<i4").reshape(-1, 3) == view.surface.triangles).all()
    one = payload(view, index, "quality", [index], "x", limit_surface=True)[0]["cases"]["1 2"]
    both = view.pads(index)
    faces = (unpacked(one["faces"], "<i2") * one["step"]).reshape(-1, 4, 3)
    assert len(faces) == 8  # four loaded faces of each pad
    assert np.abs(faces[:4, :, 0]) == pytest.approx(np.full((4, 4), 25 + 1e3 * both[0].lift), abs=2 * one["step"])
    assert unpacked(one["pressure"]) == pytest.approx(np.full(8, 5e-3 * PRESSURE))
    arrows = unpacked(one["arrows"]).reshape(-1, 2, 3)
    assert np.diff(arrows, axis=1)[:4, 0] == pytest.approx(np.broadcast_to(6.0 * both[0].frame[0], (4, 3)), abs=1e-4)
    body = unpacked(one["limit"]).reshape(one["rows"], -1, 3)
    assert np.abs(body).max(axis=(0, 1)) == pytest.approx([0.8 * 5, 0.7 * 5, 0.01 * 5e3], rel=1e-6)
    assert "limit" not in payload(view, index, "quality", [index], "x", limit_surface=False)[0]["cases"]["1 2"]


def test_the_page_says_what_it_leaves_out_to_stay_small(shown, monkeypatch):
    monkeypatch.setattr("softjaw.study.show.view.object3d.MOST", 0)
    view, index = shown
    told, left_out = payload(view, index, "quality", [index, *every(view)], "x", limit_surface=False)
    assert list(told["cases"]) == ["1 2"]
    assert left_out == 10
    assert "10" in object_block(view, index, "quality", "x", [index, *every(view)])["caption"]


def test_the_command_writes_the_page_and_refuses_names_that_nothing_would_open(file, tmp_path, capsys):
    for words, code in (
        (["--screenshot", tmp_path / "a.jpg"], USAGE), (["--html", tmp_path / "no" / "a.html"], CANNOT_WRITE),
        (["--candidate", "17", "--html", tmp_path / "a.html"], USAGE),
        (["--at", "500", "--html", tmp_path / "a.html"], USAGE),
    ):
        assert main(["view", str(file), *map(str, words)]) == code
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 4
    assert all(line.startswith("error: ") for line in errors)
    assert main(["view", str(tmp_path / "no.hdf"), "--html", str(tmp_path / "a.html")]) == OTHER_FILE
    assert not list(tmp_path.iterdir())
    assert main(["view", str(file), "--at", "20", "--force", "1", "--html", str(tmp_path / "a.html")]) == 0
    assert capsys.readouterr().out == f"written: {tmp_path / 'a.html'}\n"
    html = (tmp_path / "a.html").read_text()
    text = re.search(r'<script type="application/json">(.*?)</script>', html, re.S)[1]
    start = json.loads(text)["layout"]["meta"]["object3d"]["start"]
    assert start == {"force": 0, "candidate": 4, "quantity": "quality"}
    assert [p.name for p in tmp_path.iterdir()] == ["a.html"]
    shutil.copy(file, tmp_path / "b.hdf")
    assert main(["view", str(tmp_path / "b.hdf")]) == 0
    assert (tmp_path / "b-3d.html").exists()


@pytest.mark.long
def test_a_picture_without_a_screen_shows_object_pads_and_limit_surface(file, tmp_path, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    found = {}
    for name, words in {"best": [], "failed": ["--candidate", "5"], "turn": ["--motion", "turn"]}.items():
        path = tmp_path / f"{name}.png"
        assert main(["view", str(file), "--screenshot", str(path), *words]) == 0
        found[name] = (matplotlib.image.imread(path)[..., :3] * 255).astype(np.uint8)
    assert found["best"].shape == (900, 1400, 3)
    assert 0.05 < (np.ptp(found["best"][:, :930], axis=-1) > 60).mean() < 0.6  # is coloured
    below = found["best"][450:, 930:], found["failed"][450:, 930:]  # limit surface; a failed case has none
    assert (below[0].min(axis=-1) < 200).mean() > 4 * (below[1].min(axis=-1) < 200).mean()
    changed = (found["best"] != found["turn"]).any(axis=-1)
    assert 1e-4 < changed[:, :930].mean() < 0.05  # the arrows, and nothing else on the left


def test_it_counts_the_cases_tells_their_reasons_and_names_no_folder(tmp_path):
    path = make(tmp_path / "thing.hdf")
    text = plain_report(open(path))
    for words in ("<b>thing</b>", "station 0 mm, angle 0 deg", "1 x failed", "no </script> convergence", "10 of 12"):
        assert words in text
    assert str(tmp_path) not in text  # the same bits wherever it is solved
    assert max(map(len, text.splitlines())) <= 120
    assert len(text.encode()) < REPORT_BYTES
    with h5py.File(path, "r+") as file:
        file["study/status/code"][...] = 2
    text = plain_report(open(sealed(path)))
    assert "0 of 12" in text
    assert "11 x failed" in text


def test_the_object_has_the_maps_of_each_candidate_and_pads_stand_where_the_poses_put_them(tmp_path):
    seen = tmp_path / "seen.vtm"
    assert main(["export", str(make(tmp_path / "thing.hdf")), "--format", "vtk", "-o", str(seen)]) == 0
    blocks = pv.read(seen)
    body = blocks["object"]
    cell, status = body["candidate"], body["status, 5 N"]
    for candidate, index in enumerate(np.ndindex(3, 2)):
        values = body["quality, 5 N"][cell == candidate]
        expected = np.nan if (*index, 1) in (FAILED, (0, 0, 1)) else quality((*index, 1))
        assert values == pytest.approx(np.full(len(values), expected), nan_ok=True)
    assert np.isnan(body["quality, 1 N"][cell == -1]).all()
    assert {int(code) for code in status[cell == 5]} == {2}
    assert body.compute_cell_sizes()["Area"][cell >= 0].sum() == pytest.approx(0.06 * RING, rel=1e-3)
    assert blocks.keys() == ["object", "pads, 1 N", "pads, 5 N"]
    for force, missing in ((1, ()), (5, (0, 5))):  # candidates 0 and 5 have no result at 5 N
        pads = blocks[f"pads, {force} N"]
        assert sorted(set(pads["candidate"])) == [c for c in range(6) if c not in missing]
        assert pads["pressure"].max() == pytest.approx(PRESSURE * force, rel=1e-4)
        assert pads.compute_cell_sizes()["Area"] == pytest.approx(pads["area"], rel=1e-4)
        for candidate in set(pads["candidate"]):
            chosen = pads["candidate"] == candidate
            assert pads["area"][chosen].sum() == pytest.approx(2 * SIZE[0] * SIZE[1], rel=1e-4)
            for finger, side in ((1, 1.0), (2, -1.0)):
                face = pads.extract_cells(np.flatnonzero(chosen & (pads["finger"] == finger)))
                assert face.n_cells == np.prod(GRID)
                station, angle = divmod(int(candidate), 2)
                away = np.array([1.0 - angle, angle, 0.0])
                at = side * (0.025, 0.02)[angle] * away + [0, 0, (-0.02, 0.0, 0.02)[station]]
                assert np.asarray(face.cell_centers().points).mean(axis=0) == pytest.approx(at, abs=1e-6)
                assert face["normal"] @ away == pytest.approx(np.full(face.n_cells, -side), rel=1e-4)
    file = make(tmp_path / "thing.hdf", patches=False)
    assert main(["export", str(file), "--format", "vtk", "-o", str(tmp_path / "body.vtp")]) == 0
    assert "quality, 5 N" in pv.read(tmp_path / "body.vtp").cell_data
    for words in (["-o", str(tmp_path / "x.stl")], []):
        assert main(["export", str(file), "--format", "vtk", *words]) == USAGE
    assert not (tmp_path / "x.stl").exists()
