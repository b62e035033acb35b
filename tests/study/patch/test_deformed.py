"""``softjaw patch --deformed``: the pad of a scene from points of its face, and what is refused."""

from functools import partial

import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from softjaw.study.case.contact import Contact
from softjaw.study.cli import main
from softjaw.study.messages import OTHER_FILE, USAGE
from softjaw.study.scene import parse_scene
from tests.study.launching import answer
from tests.study.scenes import OVAL, QUICK, results_of, scene_of

NOISE = 0.1  # mm
told = partial(answer, "patch", "--deformed")
CYLINDER = OVAL.replace("20", "25", 1)
BOTTLE = 'shape = "revolution"\nprofile_mm = [[0, 26], [30, 33], [70, 31], [105, 24], [130, 22], [150, 20], [200, 12]]'


def scene_text(shape, station, force, elements):
    place = {"stations": f"[{station}]", "forces": f"[{force}]", "elements": list(elements)}
    return scene_of(shape, *QUICK, "friction.mu=0.6", "effects.model_size='full'", **place).effective_toml()


def face_of(text):
    """S and e_n of the first finger of a solved case, and its deformed face, seen from the backing plate [mm]."""
    [result] = results_of(parse_scene(text))
    contact = result.contacts[0]
    state = contact.state
    face = (state.contact_face - [0, 0, state.closing]).reshape(*state.pad.contact_grid, 3)
    # as softjaw patch takes its frame: from the loaded faces alone
    limits = Contact(contact.patch, contact.mu).limits["ccm"]
    return limits.S, limits.e_n, 1e3 * face


def table(file, face, contour, seed=0, noise=NOISE):
    n, m, _ = face.shape
    rows = [(n - 1) / 2] if contour else np.linspace(0, n - 1, 41)
    at = np.stack(np.meshgrid(rows, np.linspace(0, m - 1, 101 if contour else 41), indexing="ij"), -1)
    points = RegularGridInterpolator((np.arange(n), np.arange(m)), face)(at).reshape(-1, 3)
    points += noise * np.random.default_rng(seed).normal(size=points.shape)
    columns = slice(1, 3) if contour else slice(0, 3)
    np.savetxt(file, points[:, columns], "%.5f", ",", header=",".join(["x_mm", "y_mm", "z_mm"][columns]), comments="")
    return file


def test_a_contour_gives_what_any_patch_gives(tmp_path):
    """On a coarse mesh, so that it is fast; without noise."""
    text = scene_text(CYLINDER, 0, 5, (6, 6, 2))
    (tmp_path / "scene.toml").write_text(text)
    S, e_n, face = face_of(text)
    answer = told(table(tmp_path / "contour.csv", face, True, noise=0.0), tmp_path / "scene.toml", "--distance", 50)
    [found] = answer["patches"]
    assert answer["mu"] == 0.6
    assert not any("noise" in note for note in answer["notes"])  # it is judged
    assert found["S"] == pytest.approx(S, rel=0.02)
    assert found["friction"]["ccm"]["e_n"] == pytest.approx(e_n, rel=0.02)
    # in the coordinates of the file: the loaded face lies below the undeformed one
    assert found["frame"]["origin"][2] == pytest.approx(1e-3 * face[..., 2].min(), rel=0.05)
    assert found["frame"]["axes"][0] == pytest.approx([1, 0, 0], abs=1e-3)
    assert answer["grasp"]["score"]["ccm"]["quality"] > 0
    assert found["rank"] == 3


@pytest.mark.parametrize(("text", "part", "code"), [
    ("x_mm,y_mm\n0,0\n1,1", ":1", USAGE), ("y,z\n0,0\n1,1", "--unit mm", USAGE), ("y_mm,z_mm\n0,0\n1,one", ":3", USAGE),
    ("y_mm,z_mm\n0,0\n30,0\n", ":3", USAGE), ("y_m,z_m\n0,0\n-0.001,-0.2\n", ":3", USAGE),
    ("y_mm,z_mm\n" + "\n".join(f"{y},{0.05 * y * y}" for y in range(-10, 11)), "change its sign", USAGE),
    ("y_mm,z_mm\n" + "0,0\n" * 30, "spread", USAGE), ("y_mm,z_mm\n" + "0,0\n" * 20_001, "thin them", USAGE),
])  # fmt: skip
def test_points_that_are_no_face_are_refused_with_their_place(tmp_path, capsys, text, part, code):
    file, scene = tmp_path / "points.csv", tmp_path / "scene.toml"
    file.write_text(text)
    scene.write_text(scene_text(CYLINDER, 0, 5, (4, 4, 2)))
    assert main(["patch", "--deformed", str(file), str(scene)]) == code
    said = capsys.readouterr().err
    assert str(file) in said
    assert part in said


@pytest.mark.parametrize(("words", "part", "code"), [
    (["--deformed", "{file}"], "SCENE", USAGE), (["{file}", "{scene}"], "--deformed", USAGE),
    (["--deformed", "{file}", "{scene}", "--other", "{file}"], "--other", USAGE),
    (["--deformed", "{file}", "{scene}", "--pressure-name", "p"], "--pressure-name", USAGE),
    (["--deformed", "{file}", "{file}"], "", USAGE), (["--deformed", "none.csv", "{scene}"], "none.csv", OTHER_FILE),
    (["--deformed", "{scene}", "{scene}"], ".csv", USAGE),
])  # fmt: skip
def test_options_that_do_not_belong_together_are_refused(tmp_path, capsys, words, part, code):
    file, scene = tmp_path / "points.csv", tmp_path / "scene.toml"
    file.write_text("y_mm,z_mm\n0,0\n")
    scene.write_text(scene_text(CYLINDER, 0, 5, (4, 4, 2)))
    assert main(["patch", *(word.format(file=file, scene=scene) for word in words)]) == code
    assert part in capsys.readouterr().err


@pytest.mark.long
@pytest.mark.parametrize(("shape", "station", "force", "contour"), [
    (CYLINDER, 0, 5, True), (BOTTLE, 60, 5, False), (BOTTLE, 100, 5, False), (BOTTLE, 130, 3, False),
])  # fmt: skip
def test_a_camera_sees_e_n_within_5_percent_and_S_within_10(tmp_path, shape, station, force, contour):
    """The face of a case on a finer mesh, with 0.1 mm of noise, back through the command on the scene's own mesh."""
    S, e_n, face = face_of(scene_text(shape, station, force, (24, 14, 7)))
    (tmp_path / "scene.toml").write_text(scene_text(shape, station, force, (20, 10, 6)))
    for seed in (1, 2):
        answer = told(table(tmp_path / "points.csv", face, contour, seed), tmp_path / "scene.toml")
        [found] = answer["patches"]
        got = found["S"] / S - 1, found["friction"]["ccm"]["e_n"] / e_n - 1
        print(f"{shape.split()[2]} at {station} mm, {force} N: S {got[0]:+.1%}, e_n {got[1]:+.1%}")
        assert abs(got[0]) < 0.10
        assert abs(got[1]) < 0.05
