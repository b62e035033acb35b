"""The report as text in the file itself: what somebody learns who has nothing but the file."""

from __future__ import annotations

import h5py

from softjaw.study.result.layout import REPORT_BYTES
from softjaw.study.result.read import dataset
from softjaw.study.result.store import open_result
from softjaw.study.show.report.verdict import plain_report
from tests.study.sealing import sealed
from tests.study.view_files import make


def test_it_says_what_it_is_the_best_grasps_the_failures_and_how_to_read_them(tmp_path):
    with open_result(make(tmp_path / "thing.hdf")) as result:
        text = plain_report(dataset(result))
    assert text.startswith(
        "<b>thing</b>: 3 stations (-20 to 20 mm) x 2 angles (0 to 90 deg) x 2 normal forces (1 to 5 N)\n"
    )
    assert "Grasp at station 0 mm, angle 0 deg" in text
    assert "1 x failed: no </script> convergence (station 20 mm, angle 90 deg, 5 N)" in text
    assert "10 of 12 cases are solved, 1 failed, 1 are not computed." in text
    assert "0 missing, 1 done, 2 failed" in text.partition("How to read the file")[2]
    assert str(tmp_path) not in text  # the same bits wherever it is solved
    assert max(map(len, text.splitlines())) <= 120
    assert len(text.encode()) < REPORT_BYTES


def test_a_study_that_failed_everywhere_has_its_reasons(tmp_path):
    path = make(tmp_path / "thing.hdf")
    with h5py.File(path, "r+") as file:
        file["study/status/code"][...] = 2
    with open_result(sealed(path)) as result:
        text = plain_report(dataset(result))
    assert "No grasp is solved. 0 of 12 cases are solved, 12 failed, 0 are not computed." in text
    assert "11 x failed" in text
