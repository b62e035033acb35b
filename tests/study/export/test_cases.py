"""Cases as CSV and JSON: what stands in files whose values are known."""

import csv
import io
import json

import numpy as np
import pytest

import softjaw
from softjaw.friction.motion import fibonacci_twists
from softjaw.study.export.cases import MEANING, as_csv, as_json, cases
from softjaw.study.lookup import GraspMap
from softjaw.study.quantities import Axis
from tests.study.formula_results import ANGLES, FORCES, STATIONS, grid_axes, linear, make, window, without_result

SMALL = grid_axes(STATIONS[:3], ANGLES[:2], FORCES[:3])


def test_every_case_is_exported_with_its_state_in_the_frame_of_the_object(tmp_path):
    ds = softjaw.open(make(tmp_path / "a.hdf", axes=SMALL, **without_result(2, "slid")))
    data, rows = json.loads(as_json(ds, "pcm")), list(csv.DictReader(io.StringIO(as_csv(ds, "pcm"))))
    e_n = ds.e_n.sel(model="pcm").values.ravel()
    assert len(data["cases"]) == len(rows) == 3 * 2 * 3
    assert data["meaning"] == MEANING
    row = int(np.ravel_multi_index((2, 1, 1), (3, 2, 3)))
    assert (data["cases"][row]["state"], data["cases"][row]["message"]) == ("failed", "slid")
    assert data["cases"][row]["maps"]["e_n"] is None
    assert data["cases"][row]["fingers"][0]["pose_origin"] is None
    assert rows[row]["e_n [m]"] == ""
    done = [i for i in range(len(rows)) if i != row]
    assert [float(rows[i]["e_n [m]"]) for i in done] == e_n[done].tolist()  # written and read back
    assert [data["cases"][i]["maps"]["e_n"] for i in done] == e_n[done].tolist()
    turn = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    path = make(tmp_path / "a.hdf", axes=SMALL, fingers__pose_rotation=turn, flags__flags=4096.0 + 256)
    case = next(cases(softjaw.open(path)))
    data = json.loads(as_json(softjaw.open(path)))["cases"][0]
    one = case["fingers"][0]
    assert one["frame_origin"] == pytest.approx(turn @ [0, 0, 0.001] + [0, 0, -0.02])
    assert one["frame_axes"] == pytest.approx(turn.T)  # rows x, y, N of a frame that is the pad's
    assert data["flag_words"] == ["not antipodal", "coarse"]


def test_an_exported_surface_is_the_one_that_is_looked_up(tmp_path):
    """``unit`` and ``coefficients`` as the export explains them, against ``GraspPoint.limit_surface``."""
    bound = np.full((3, 2), 4.0)
    path = make(tmp_path / "a.hdf", axes=SMALL, derived=window(SMALL), derived__force_high=bound)
    case = next(c for c in cases(softjaw.open(path)) if c["place"]["normal_force"] == FORCES[2])
    one = case["fingers"][0]
    surface = GraspMap(path).at(0, 0, FORCES[2]).limit_surface(1)
    w = fibonacci_twists(20, 1.0) * one["unit"]
    x, y, t = (w / one["unit"]).T
    powers = [x**i * y**j * t ** (4 - i - j) for i in range(4, -1, -1) for j in range(4 - i, -1, -1)]
    assert one["coefficients"] @ powers == pytest.approx(surface.value(w), rel=1e-12)
    assert one["semi_axes"] == pytest.approx(GraspMap(path).at(0, 0, FORCES[2]).semi_axes()[0])
    assert case["maps"]["force_high"] == 4.0


def test_the_texts_of_a_sweep_are_exported_as_they_are(tmp_path):
    axis = Axis("material", np.arange(2.0), "", "gripper.material", ("linear", "hyperfoam"))
    ds = softjaw.open(make(tmp_path / "a.hdf", axes=(axis, *SMALL), formula=lambda _, *place: linear(*place)))
    for rows in (json.loads(as_json(ds))["cases"], list(csv.DictReader(io.StringIO(as_csv(ds))))):
        assert [row["material"] for row in rows] == [text for text in axis.options for _ in range(18)]
