"""VTKHDF files: what is written is what VTK reads, cell by cell and step by step."""

from __future__ import annotations

import h5py
import numpy as np
import pytest
import pyvista as pv
from vtkmodules.vtkIOHDF import vtkHDFReader

from softjaw.study.cli import main
from softjaw.study.messages import CANNOT_WRITE, StudyError
from softjaw.study.result.skeleton import create
from softjaw.study.result.vtkhdf import fill_grid, write_grid
from softjaw.study.result.write import ResultWriter, record
from softjaw.study.run.plan import make_plan
from softjaw.study.scene import parse_scene
from tests.study.view_files import GRID, PRESSURE, SCENE, SIZE, make, quality, solved

RING = 0.14181  # circumference of an ellipse with semi-axes 25 and 20 mm [m]


def steps_of(path):
    """The grid at every step, as VTK reads it."""
    reader = vtkHDFReader()
    reader.SetFileName(str(path))
    reader.UpdateInformation()
    information = reader.GetOutputInformation(0)
    for time in information.Get(reader.GetExecutive().TIME_STEPS()):
        reader.UpdateTimeStep(time)
        yield time, pv.wrap(reader.GetOutputDataObject(0)).copy()


@pytest.fixture
def squares():
    """Two quadrilaterals in a row."""
    x, y = np.meshgrid(np.arange(3.0), np.arange(2.0), indexing="ij")
    return np.stack([x, y, x * y], axis=-1).reshape(-1, 3), np.array([[0, 2, 3, 1], [2, 4, 5, 3]])


def test_a_grid_comes_back_as_it_was(tmp_path, squares):
    points, cells = squares
    path = tmp_path / "a.vtkhdf"
    on_cells = {"e_n, 5 N": np.array([0.25, np.nan]), "candidate": np.array([3, -1]), "normal": np.eye(3)[:2]}
    write_grid(path, points, cells, on_cells, {"displacement": 2 * points}, about="two squares")
    grid = pv.read(path)
    assert isinstance(grid, pv.UnstructuredGrid)
    assert np.array_equal(grid.points, points)
    assert np.array_equal(grid.cells.reshape(2, 5), np.column_stack([[4, 4], cells]))
    assert (grid.celltypes == pv.CellType.QUAD).all()
    for name, values in on_cells.items():
        assert np.array_equal(grid.cell_data[name], values, equal_nan=name.startswith("e_n"))
    assert np.array_equal(grid.point_data["displacement"], 2 * points)
    assert [p.name for p in tmp_path.iterdir()] == ["a.vtkhdf"]


def test_steps_share_their_cells_and_have_their_own_points_and_values(tmp_path, squares):
    points, cells = squares
    path, forces = tmp_path / "a.hdf", [0.5, 2.0, 7.0]
    moved = points + np.array([[[0, 0, f]] for f in forces])
    values = {"p": np.array([[f, 10 * f] for f in forces]), "n": np.array([[[f, 0, 0]] * 2 for f in forces])}
    write_grid(path, moved, cells, values, {"q": moved[..., 2]}, steps=forces)
    found = list(steps_of(path))
    assert [time for time, _ in found] == forces
    for k, (force, grid) in enumerate(found):
        assert np.array_equal(grid.points, moved[k])
        assert grid.n_cells == 2
        assert grid["p"].tolist() == [force, 10 * force]
        assert grid["n"][:, 0].tolist() == [force, force]
        assert np.array_equal(grid["q"], moved[k][:, 2])
    assert isinstance(pv.read(path), pv.UnstructuredGrid)


def test_old_readers_are_served(tmp_path, squares):
    """HDF5 1.10 and VTK 9.1 read superblock 0, version 1.0 and a type of fixed length."""
    write_grid(tmp_path / "a.hdf", *squares, {})
    with h5py.File(tmp_path / "a.hdf") as file:
        assert file["VTKHDF"].attrs["Version"].tolist() == [1, 0]
        assert file["VTKHDF"].attrs.get_id("Type").dtype == np.dtype("S16")
        assert file.id.get_create_plist().get_version()[0] == 0


def test_a_place_that_cannot_be_written_is_told(tmp_path, squares):
    with pytest.raises(StudyError, match=r"cannot be written") as refused:
        write_grid(tmp_path / "no" / "a.hdf", *squares, {})
    assert refused.value.code == CANNOT_WRITE


def test_object_and_pads_of_a_result_file(tmp_path, capsys):
    result = make(tmp_path / "thing.hdf")
    path = tmp_path / "seen.vtkhdf"
    assert main(["view", str(result), "--candidate", "2", "--vtkhdf", str(path)]) == 0
    written = [line.removeprefix("written: ") for line in capsys.readouterr().out.splitlines()]
    assert written == [str(path), *(str(tmp_path / f"seen-pads{more}.vtkhdf") for more in ("", "-over-force"))]
    body = pv.read(path)
    cell, status = body["candidate"], body["status, 5 N"]
    for candidate, index in enumerate(np.ndindex(3, 2)):
        own = body["quality, 5 N"][cell == candidate]
        expected = quality((*index, 1)) if status[cell == candidate][0] == 1 else np.nan
        assert own == pytest.approx(np.full(len(own), expected), nan_ok=True)
    assert np.isnan(body["quality, 1 N"][cell == -1]).all()
    assert (status[cell == 5] == 2).all()
    assert body.compute_cell_sizes()["Area"][cell >= 0].sum() == pytest.approx(
        0.06 * 0.14181, rel=1e-3
    )  # ring x height
    pads = pv.read(written[1])
    assert pads.n_cells == 2 * np.prod(GRID)
    assert pads["area"].sum() == pytest.approx(2 * SIZE[0] * SIZE[1])
    assert pads.compute_cell_sizes()["Area"] == pytest.approx(pads["area"], rel=1e-6)
    assert np.abs(pads.cell_centers().points[pads["finger"] == 1, 0]) == pytest.approx(np.full(16, 0.025))
    forces, grids = zip(*steps_of(written[2]), strict=True)
    assert forces == (1.0, 5.0)
    assert [grid["pressure"].max() for grid in grids] == pytest.approx([PRESSURE, 5 * PRESSURE])


class SerialWriter(ResultWriter):
    """Writes without MPI."""

    def __init__(self, path, layout):
        self.path, self.layout, self._file = path, layout, h5py.File(path, "r+")


def study(path, scene=SCENE, lost=(), fill=True):
    """A result file of which all cases but the ``lost`` ones, which failed, are solved."""
    plan = make_plan(parse_scene(scene))
    layout = plan.layout
    create(path, layout, plan.header)
    assert path.stat().st_size <= layout.nbytes
    with h5py.File(path, "r+") as file:
        for row, index in enumerate(np.ndindex(layout.shape)):
            file["study/status/code"][index] = 2 if index in lost else 1
            if index in lost:
                continue
            places = layout.places(row)
            for column, value, place in zip(
                layout.columns, record(layout, solved(layout, index[-3:])), places, strict=True
            ):
                file[column.path][place] = value.astype(file[column.path].dtype)
    if fill:
        writer = SerialWriter(path, layout)
        fill_grid(writer)
        writer.close()
    return layout


def test_the_result_file_itself_is_a_grid_over_the_forces(tmp_path):
    """Maps on the object, pads where the poses put them; a failed case is empty and its pads have no area."""
    path, lost = tmp_path / "thing.hdf", (2, 1, 1)
    study(path, lost=[lost])
    first = pv.read(path)
    assert isinstance(first, pv.UnstructuredGrid)
    assert set(first.cell_data) == {"part", "candidate", "status", "quality", "e_n", "payload", "tau_z_max", "pressure"}
    for k, (force, grid) in enumerate(steps_of(path)):
        assert force == (1.0, 5.0)[k]
        part, cell, area = grid["part"], grid["candidate"], grid.compute_cell_sizes()["Area"]
        assert area[(part == 0) & (cell >= 0)].sum() == pytest.approx(0.06 * RING, rel=1e-3)
        assert np.isnan(grid["pressure"][part == 0]).all()
        assert (grid["status"][cell < 0] == -1).all()
        assert np.isnan(grid["quality"][cell < 0]).all()
        for candidate, place in enumerate(np.ndindex(3, 2)):
            index, own = (*place, k), cell == candidate
            pads = own & (part > 0)
            assert (grid["status"][own] == (2 if index == lost else 1)).all()
            if index == lost:
                assert np.isnan(grid["quality"][own]).all()
                assert np.isnan(grid["pressure"][pads]).all()
                assert area[pads].max() == 0
                continue
            assert grid["quality"][own] == pytest.approx(np.full(own.sum(), quality(index)), rel=1e-6)
            assert grid["pressure"][pads].max() == pytest.approx(PRESSURE * force)
            assert area[pads].sum() == pytest.approx(2 * SIZE[0] * SIZE[1], rel=1e-5)
            middle = grid.extract_cells(np.flatnonzero(own & (part == 1))).points.mean(axis=0)
            reach = (0.025, 0.02)[place[1]] * np.array([1 - place[1], place[1], 0])
            assert middle == pytest.approx(reach + np.array([0, 0, (-0.02, 0, 0.02)[place[0]]]), abs=1e-7)


def test_before_the_end_the_grid_shows_the_object_and_nothing_else(tmp_path):
    study(tmp_path / "thing.hdf", fill=False)
    for _, grid in steps_of(tmp_path / "thing.hdf"):
        area = grid.compute_cell_sizes()["Area"]
        assert area[grid["part"] > 0].max() == 0
        rounding = 2 * (2.0 - 0.5 * np.pi) * 0.002 * RING  # what edges of 2 mm take from wall and caps, near enough
        surface = 0.1 * RING + 2 * np.pi * 0.025 * 0.02 - rounding
        assert area[grid["part"] == 0].sum() == pytest.approx(surface, rel=2e-3)
        assert all(np.isnan(grid[name]).all() for name in ("quality", "e_n", "pressure"))
        assert np.abs(grid.bounds) == pytest.approx([0.025] * 2 + [0.02] * 2 + [0.05] * 2)


@pytest.mark.long
def test_pads_can_be_left_out_and_a_sweep_shows_its_first_point(tmp_path):
    scene = SCENE + '[output]\npatches = "none"\n[sweep]\n"object.length_mm" = [100, 200]\n'
    layout = study(tmp_path / "thing.hdf", scene)
    assert layout.shape == (2, 3, 2, 2)
    grid = pv.read(tmp_path / "thing.hdf")
    assert not grid["part"].any()
    assert "pressure" not in grid.cell_data
    assert grid.bounds[4:] == pytest.approx((-0.05, 0.05))
    assert np.nanmax(grid["quality"]) == quality((1, 0, 0))
