"""Functions of patches: the numbers of ``softjaw patch``, in any coordinates, and what they refuse."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import softjaw as sj
from softjaw.study.patch.answer import EvaluatedPatch, as_record, grasp_record, read_patch
from softjaw.study.patch.patch_reader import Reading
from tests.study.launching import ROOT

EXAMPLE = ROOT / "jobs" / "cylinder-pressure.csv"
PATCH = sj.read_pressure(EXAMPLE)
FLAT = sj.ContactPatch([[0.01, 0, 0], [-0.01, 0, 0]], [1e-4] * 2, [[0, 0, 1]] * 2, [1e4] * 2)
OPPOSED = replace(FLAT, normal=np.array([[0, 0, 1.0], [0, 0.3, -1.0]]), pressure=np.array([1e4, 5e3]))


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
    assert vars(other) == pytest.approx(vars(one), rel=1e-9)
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
