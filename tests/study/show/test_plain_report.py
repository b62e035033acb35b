"""The report as text in the file itself: what somebody learns who has nothing but the file."""

import h5py

from softjaw.study.result.layout import REPORT_BYTES
from softjaw.study.result.read import dataset
from softjaw.study.result.store import open_result
from softjaw.study.show.report.verdict import plain_report
from tests.study.sealing import sealed
from tests.study.view_files import make


def test_it_counts_the_cases_tells_their_reasons_and_names_no_folder(tmp_path):
    path = make(tmp_path / "thing.hdf")
    with open_result(path) as result:
        text = plain_report(dataset(result))
    for words in ("<b>thing</b>", "station 0 mm, angle 0 deg", "1 x failed", "no </script> convergence", "10 of 12"):
        assert words in text
    assert str(tmp_path) not in text  # the same bits wherever it is solved
    assert max(map(len, text.splitlines())) <= 120
    assert len(text.encode()) < REPORT_BYTES
    with h5py.File(path, "r+") as file:
        file["study/status/code"][...] = 2
    with open_result(sealed(path)) as result:
        text = plain_report(dataset(result))
    assert "0 of 12" in text
    assert "11 x failed" in text
