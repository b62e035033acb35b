"""The paper's figures: their table, what is drawn, and the trends that the README claims, on coarse meshes."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from jobs.figures import __main__ as figures
from jobs.figures import drawing, studies, surfaces
from jobs.figures.__main__ import FIGURES, Figure, draw, figures_of, targets
from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.wrench import friction_limits
from softjaw.lsfit.body import ExactSurface
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.study.messages import CANNOT_WRITE, OTHER_FILE, SOME_FAILED, USAGE
from softjaw.study.ranking import judge
from softjaw.study.result.layout import DONE
from softjaw.study.result.read import open
from softjaw.study.show.grasps import field
from softjaw.study.show.stored_surface import StoredSurface, exact_surface
from tests.generators import cylinder_grid
from tests.study.formula_results import grid_axes, make
from tests.study.launching import ROOT, launch, refusal

PNG = b"\x89PNG\r\n\x1a\n"
JOBS = ROOT / "jobs"
MOST = 250_000  # bytes of a picture on a page
PAD = ("gripper.elements=[12, 6, 4]", "accuracy.meshes=1")
WALL = ("accuracy.wall_element_mm=3",)
PLACES = ("candidates.stations_mm=[33.8, 68.9, 104, 150]", "load.normal_force_n=[3, 13]")
COARSE = {  # file: scene and overrides
    "fig4-curvature": ("fig4-curvature", ("gripper.elements=[8, 12, 4]",)),
    "fig5-candidate": ("fig5-candidate", (*PAD, *WALL)),
    "fig7-force-study": ("fig7-force-study", (*PAD, *WALL, "load.normal_force_n=[1, 4, 8, 13]")),
    "bottle": ("bottle", (*PAD, *WALL, *PLACES)),
    "bottle, rigid": ("bottle", (*PAD, *PLACES, 'effects.object="rigid"')),
    "cup": ("cup", (*PAD, *WALL, "candidates.stations_mm=[28, 54, 80]", "load.normal_force_n=[1, 4]")),
}


@pytest.mark.parametrize("figure", FIGURES, ids=lambda f: f.name)
def test_every_figure_has_scenes_and_a_picture_in_the_docs(figure):
    assert figure.scenes
    assert all((JOBS / f"{scene}.toml").is_file() for scene in figure.scenes)
    picture = (ROOT / "docs" / f"fig{figure.name}.png").read_bytes()
    assert picture.startswith(PNG)
    assert len(picture) <= MOST


def test_balls_are_drawn_in_their_colour_and_figures_go_by_number_and_letters():
    image = drawing.rendered(lambda p: drawing.dots(p, np.eye(3), 0.2, "red"), (1, 1, 1), (0, 0, 1), (60, 60))
    red = (image[..., 0] > 100) & (image[..., 1] < 60)
    assert 0.05 < red.mean() < 0.6
    names = {"4": "4ab 4c", "4a": "4ab", "6ab": "6ab", "6c": "6c", "7d": "7", "8b": "8", "4c 4 8": "4c 4ab 8"}
    for words, known in names.items():
        assert [f.name for f in figures_of(words.split())] == known.split()
    assert figures_of(["all"]) == list(FIGURES)
    assert [path.name for path in targets(figures_of(["4c"]), Path("one.png"))] == ["one.png"]
    assert [path.name for path in targets(figures_of(["4"]), Path("folder"))] == ["fig4ab.png", "fig4c.png"]


@pytest.mark.parametrize("words", [["9"], ["4d"], ["x"], [""], ["4", "-o", "one.png"]])
def test_unknown_figures_and_one_picture_for_two_are_refused(words):
    assert figures.main(words) == USAGE


def test_the_force_study_is_drawn_with_the_paper_s_normalisation_and_not_where_some_cases_failed(tmp_path):
    # One place over four forces: the curved model has seven eighths of the flat one's friction across.
    F = np.array([1.0, 2.0, 4.0, 8.0])
    known = {"S__S": F, "f_y_max__ccm": 0.7 * F, "f_y_max__pcm": 0.8 * F, "f_y_max__pcm_projected": 0.75 * F}
    path = make(tmp_path / "force.hdf", axes=grid_axes([0.0], [0.0], F), **known)
    ds = open(path)
    lines, e_n = studies.over_force(judge(ds)), 1e3 * ds.e_n.sel(model="ccm").values[0, 0]
    _, force = lines["force"]
    assert force["pcm"] == pytest.approx(np.full(4, 0.8))
    assert force["ccm"] == pytest.approx(np.full(4, 0.7))
    title, torque = lines["torque"]
    assert "50 mm" in title
    assert torque["ccm"] == pytest.approx(e_n / 50)  # tau_z / (F l) of a torque e_n F
    draw(Figure("7", ("x",), studies.force_study), {"x": path}, tmp_path / "7.png")
    assert (tmp_path / "7.png").read_bytes().startswith(PNG)
    path = make(tmp_path / "lost.hdf", axes=grid_axes([0.0], [0.0], [1.0, 2.0]), status__code=[[[1, 2]]])
    with refusal(SOME_FAILED):
        draw(Figure("7", ("x",), studies.force_study), {"x": path}, tmp_path / "8.png")
    assert not (tmp_path / "8.png").exists()


@pytest.mark.parametrize("code", [OTHER_FILE, CANNOT_WRITE])
def test_a_scene_that_cannot_be_solved_is_not_drawn(tmp_path, monkeypatch, code):
    asked = []
    monkeypatch.setattr(figures, "softjaw", lambda words: asked.append(words) or code)
    assert figures.main(["4c", "--results", str(tmp_path), "-o", str(tmp_path / "x.png")]) == code
    assert asked == [["run", str(JOBS / "fig4-curvature.toml"), "-o", str(tmp_path / "fig4-curvature.hdf")]]
    assert not (tmp_path / "x.png").exists()


@pytest.mark.parametrize("axes", [(1.0, 1.0, 1.0), (1.0, 0.7, 0.3)])
def test_the_exact_radius_is_that_of_an_ellipsoid_where_the_body_is_one(axes):
    """The wrenches of ``H(t) = |A t|`` are ``A^2 t / |A t|``; planes bound the body from outside."""
    A = np.array(axes)
    body = ExactSurface(lambda t: A**2 * t / np.linalg.norm(A * t, axis=1, keepdims=True))
    u = np.random.default_rng(3).normal(size=(200, 3))
    found, known = surfaces.exact_radius(SimpleNamespace(exact=body), u), 1 / np.linalg.norm(u / A, axis=1)
    assert found == pytest.approx(known, rel=2e-3)
    assert (found >= known * (1 - 1e-12)).all()


def test_errors_on_the_paper_s_grid_are_those_of_the_reference():
    """A curved contact under even pressure, 21 x 21 centres of rotation: case l12 of tests/data/friction_table.json."""
    patch = cylinder_grid(1.0, np.pi / 3, 2.0, 48, 48)
    limits = friction_limits(patch, 1.0)
    ellipsoid = Ellipsoid.of_axes(np.array(limits.per_unit_force) / [1.0, 1.0, 2.0])
    found = surfaces.errors_on_grid(StoredSurface(np.ones(3), ellipsoid, None, exact_surface(patch, "ccm", 2.0)))
    assert found["fit_error_ellipsoid"] == pytest.approx(0.003113307368265586, rel=1e-6)
    # the reference's quartic is fitted to the wrenches alone, ours to the motions, too
    assert 0.7 < found["fit_error"] / 0.0003705396009936843 < 1.0


@pytest.fixture(scope="module")
def coarse(tmp_path_factory):
    """Results of all scenes by their names; solved once."""
    folder, found = tmp_path_factory.mktemp("figures"), {}
    for name, (scene, overrides) in COARSE.items():
        found[name] = folder / f"{name}.hdf"
        words = [word for value in overrides for word in ("--set", value)]
        code, output, errors = launch(0, "-m", "softjaw", "run", JOBS / f"{scene}.toml", "-o", found[name], *words)
        assert (code, errors) == (0, ""), output
    return found


@pytest.fixture
def data(coarse):
    def of(name):
        found = judge(open(coarse[name]))
        assert (found.status == DONE).all()
        return found

    return of


@pytest.mark.long
@pytest.mark.parametrize("figure", FIGURES, ids=lambda f: f.name)
def test_every_figure_is_drawn_from_coarse_results(coarse, tmp_path, figure):
    assert "nan" not in draw(figure, coarse, tmp_path / "x.png")
    assert (tmp_path / "x.png").read_bytes().startswith(PNG)


@pytest.mark.long
def test_the_script_solves_on_two_ranks_and_goes_on_from_what_is_solved(tmp_path):
    words = ("-m", "mpi4py", "-m", "jobs.figures", "5a", "--results", tmp_path, "-o", tmp_path / "a.png")
    for ranks in (2, 0):
        code, output, errors = launch(ranks, *words)
        assert (code, errors) == (0, ""), output
        assert output.count("written: ") == 1
    assert (tmp_path / "a.png").read_bytes().startswith(PNG)


@pytest.mark.long
def test_fig5_the_contact_is_asymmetric_and_the_flat_model_claims_more(coarse, data, tmp_path):
    off = data("fig5-candidate").finger_frame_origin.values[0, 0, 0, 0]
    assert np.hypot(*off[:2]) > 0.015  # of pads that reach 25 mm to both sides
    for name, index in (("fig5-candidate", (0, 0, 0)), ("fig4-curvature", (0, 0, 0, 1))):
        known = {m: surfaces.exact_surface(data(name), index, m) for m in surfaces.MODELS}
        t = fibonacci_twists(200, 1.0)
        H = {m: found.exact.support(t) for m, found in known.items()}
        assert (H["ccm"] <= H["pcm"] * (1 + 1e-12)).all()


@pytest.mark.long
@pytest.mark.parametrize("name", ["bottle", "cup", "fig4-curvature", "fig5-candidate", "fig7-force-study"])
def test_fig6_the_quartic_fits_better_than_the_ellipsoid_everywhere(data, name):
    found = data(name)
    assert (field(found, "fit_error") < field(found, "fit_error_ellipsoid")).all()
    if found.status.ndim == 3:  # of one object
        # nearly all motions of the paper's grid are translations, which any surface through the axes fits
        grid = surfaces.on_grid_along(found, 0)
        assert grid["fit_error"].mean() < 1.25 * grid["fit_error_ellipsoid"].mean()
        assert (grid["fit_error_ellipsoid"] < 100 * field(found, "fit_error_ellipsoid")[..., 0]).all()


@pytest.mark.long
def test_fig7_torque_e_n_and_score_grow_with_the_force_and_so_does_what_the_planar_model_claims_too_much(data):
    lines = {name: values for name, (_, values) in studies.over_force(data("fig7-force-study")).items()}
    for name in ("torque", "e_n", "score"):
        assert (np.diff(lines[name]["ccm"]) > 0).all(), name
    assert lines["force"]["pcm"] == pytest.approx(np.full(4, 2.0))  # mu, at every force
    for name in ("force", "score"):
        lost = 1 - lines[name]["ccm"] / lines[name]["pcm"]
        assert (lost > 0).all(), name
        assert (np.diff(lost) > 0).all(), name
    # unlike in the paper: the patch is on a slope, but hardly curved where arms are long
    assert (1 - lines["e_n"]["ccm"] / lines["e_n"]["pcm"]).max() < 2e-3


@pytest.mark.long
def test_fig8_a_indentation_lowers_the_quality_but_raises_e_n_and_the_best_place_is_not_the_widest(data):
    walled, rigid = data("bottle"), data("bottle, rigid")
    ratio = {name: field(walled, name)[..., 1] / field(rigid, name)[..., 1] for name in ("e_n", "quality")}
    waist, upper = 1, 2
    assert (ratio["quality"] < 1.01).all()
    assert (ratio["quality"][waist] < 0.95).all()
    assert ratio["e_n"][upper, 1] > 1.1  # where the wall has given way at 13 N
    wide = studies.widest(walled)
    assert wide.tolist() == [True, False, True, False]
    for name in ("e_n", "quality"):
        assert field(walled, name)[waist].max() > field(walled, name)[wide].max(), name
    cup = data("cup")  # here it is the widest, until the rim dents
    assert field(cup, "e_n")[..., 0].argmax() // 2 == 2
    assert field(cup, "indentation")[2].max() > field(cup, "indentation")[0].max()
