"""What ParaView reads: the object with its maps, and all pads with their pressure."""

import numpy as np
import pytest
import pyvista as pv

from softjaw.study.cli import main
from softjaw.study.messages import USAGE
from tests.study.view_files import FAILED, GRID, PRESSURE, SIZE, make, quality

RING = 0.14181  # circumference of an ellipse with semi-axes 25 and 20 mm [m]


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
