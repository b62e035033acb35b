"""Result files that tests have changed by hand: with the checksums of what they hold now."""

import h5py
import numpy as np

from softjaw.study.quantities import MISSING
from softjaw.study.result import checksums
from softjaw.study.result.datasets import CLOSING_SUMS, SUMS
from softjaw.study.result.hdf5 import StoredFile
from softjaw.study.result.layout import ROOT
from softjaw.study.result.store import Result


def sealed(path):
    """Give a file the checksums of its values, as somebody would who wants to deceive; its path."""
    with h5py.File(path, "r+") as file:
        stored = StoredFile(path, file)
        result = Result(path, stored, unchecked=True)
        layout, codes = result.layout, result.codes.ravel()
        sums = file[SUMS][()].reshape(layout.rows, -1)
        for column in layout.columns:
            values = file[column.path][()]
            rows = np.flatnonzero(codes != MISSING)
            sums[rows, layout.summed.index(column.path)] = checksums.of_rows(layout, values, rows)
        sums[:, -1] = [checksums.OF_STATE.get(code, 0) for code in codes]
        file[SUMS][...] = sums.reshape(file[SUMS].shape)
        for i, name in enumerate(layout.closing):
            file[CLOSING_SUMS][i] = checksums.of_array(file[f"{ROOT}/{name}"][()])
        sessions = file[f"{ROOT}/provenance/sessions"][()]
        for i in np.flatnonzero(sessions["start"] != b""):
            sessions[i]["crc"] = checksums.of_session(sessions[i])
        file[f"{ROOT}/provenance/sessions"][...] = sessions
        file[ROOT].attrs.modify("checksum", np.uint32(checksums.of_header(stored, layout)))
    return path
