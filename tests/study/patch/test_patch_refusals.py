"""What ``softjaw patch`` refuses: every message names the file, the place, what was found and what to do."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from softjaw.study.cli import main
from tests.study.launching import ROOT
from tests.study.patch.test_patch import EXAMPLE, faceted
from tests.study.patch_files import centres, cylinder_mesh, vtk

HEAD = "x_mm,y_mm,z_mm,area_mm2,nx,ny,nz,pressure_kpa"
FACE = "0,0,0,1,0,0,1,5"


@pytest.fixture
def refused(capsys):
    """Call ``softjaw patch``; its exit code and what it says, which is errors alone."""

    def ask(*words):
        code = main(["patch", *map(str, words)])
        said = capsys.readouterr()
        assert said.out == ""
        assert all(line.startswith("error: ") for line in said.err.splitlines())
        return code, said.err

    return ask


CORNER_HEAD = ",".join(f"{c}{k}_mm" for k in (1, 2, 3) for c in "xyz") + ",pressure_kpa"


@pytest.mark.parametrize(
    ("text", "place", "parts"),
    [
        ("", "", ["an empty file", "column names"]),
        (HEAD, "", ["one line", "one line per face"]),
        ("1,2,3\n4,5,6", ":1", ["numbers and no column names", "x_mm"]),
        (f"{HEAD.replace('area_mm2,', '')}\n{FACE}", ":1", ["also area", "name the columns"]),
        (f"{HEAD.replace('kpa', 'psi')}\n{FACE}", ":1", ["pressure_psi", "--pressure-name", "kpa"]),
        (f"{HEAD.replace('x_mm', 'x')}\n{FACE}", ":1", ["x: found no unit", "--unit mm"]),
        (f"{HEAD.replace('_kpa', '')}\n{FACE}", ":1", ["pressure: found no unit", "--pressure-unit"]),
        (f"{HEAD},x_m\n{FACE},0", ":1", ["x_mm and x_m", "remove one"]),
        (f"{HEAD}\n{FACE}\n0,0,0,1,0,0,1,-5", ", line 3", ["pressure: found -5000 Pa", "positive in compression"]),
        (f"{HEAD}\n0,0,0,1,0,0,1,-5", ", line 2", ["-5000 Pa", "change the sign"]),
        (f"{HEAD}\n{FACE}\n0,0,0,-1,0,0,1,5", ", line 3", ["area: found -1e-06 m^2"]),
        (f"{HEAD}\n0,0,0,0,0,0,1,5", "", ["no load on any"]),
        (f"{HEAD}\n{FACE}\n0,0,0,0,0,0,1,5", ", line 3", ["area: found 0 under 5000 Pa"]),
        (f"{HEAD}\n{FACE}\n0,0,0,1,0,0,1,nan", ":3", ["pressure_kpa", "nan", "a finite number"]),
        (f"{HEAD}\n{FACE}\n0,0,0,1,0,,1,5", ":3", ["ny", "an empty cell"]),
        (f"{HEAD}\n{FACE}\n0,zero,0,1,0,0,1,5", ":3", ["y_mm", "zero"]),
        (f"{HEAD}\n{FACE}".replace(",", ";").replace("1;0;0", "1,5;0;0"), ":2", ['"1,5"', "decimal point"]),
        (f"{HEAD}\n{FACE}\n0,0,0,1,0,0,1", ":3", ["7 cells", "8 as in the line of names"]),
        (f"{HEAD}\n{FACE}\n0,0,0,1,0,0,0,5", ", line 3", ["normal: found 0, 0, 0"]),
        (f"{HEAD}\n0,0,0,1,0,0,1,0", "", ["no load on any", "export a loaded state"]),
        (f"{HEAD}\n{FACE}\n1,0,0,1,0,0,-1,5\n2,0,0,1,0,0,1,5", ", line 3",
         ["normals in 1 of 3 loaded faces", "the first in line 3", "same side"]),
        (f"{CORNER_HEAD.replace('z3_mm', 'c')}\n0,0,0,1,0,0,0,1,0,5", ":1", ["also z3"]),
        (f"{CORNER_HEAD}\n0,0,0,1,0,0,2,0,0,5\n0,0,0,1,0,0,0,1,0,5", ", line 2", ["area: found 0"]),
        # on a line too, but rounding leaves an area of 2e-23 m^2
        (f"{CORNER_HEAD}\n.1,.1,.1,.2,.2,.8,.3,.3,1.5,5\n0,0,0,1,0,0,0,1,0,5", ", line 2", ["area: found 0"]),
    ],
)  # fmt: skip
def test_a_table_that_is_no_patch(tmp_path, refused, text, place, parts):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    code, said = refused(file)
    assert code == 2
    if "the first in" not in said:
        assert f"{file}{place}" in said
    for part in [*parts, "expected"]:
        assert part in said


def test_problems_are_told_together_but_not_by_the_thousand(tmp_path, refused):
    file = tmp_path / "bad.csv"
    file.write_text("\n".join([HEAD, *["0,0,0,1,0,0,x,y"] * 1000]))
    code, said = refused(file)
    assert code == 2
    assert 5 < len(said.splitlines()) < 15
    assert "and 1990 more" in said


@pytest.mark.parametrize("name", ["none.csv", "none.vtu"])
def test_a_missing_file_cannot_be_read(tmp_path, refused, name):
    code, said = refused(tmp_path / name)
    assert code == 3
    assert "cannot be read (No such file or directory)" in said


@pytest.mark.parametrize(("name", "what"), [("a.csv", "not a text file"), ("a.vtu", "no VTU"), ("a.vtp", "no VTP")])
def test_a_damaged_file_cannot_be_read(tmp_path, capfd, name, what):
    file = tmp_path / name
    file.write_bytes(b"\x00\xff\xfe" * 100)
    assert main(["patch", str(file), "--unit", "m"]) == 3
    said = capfd.readouterr().err  # VTK would write past Python's streams
    assert what in said
    assert len(said.splitlines()) == 1


def test_a_file_that_is_cut_short_cannot_be_read(tmp_path, capfd):
    points, cells = cylinder_mesh()
    file = vtk(tmp_path / "cut.vtu", points, cells, [("pressure", np.ones(len(cells)))])
    file.write_text(file.read_text()[:-2000])
    assert main(["patch", str(file), "--unit", "m", "--pressure-unit", "pa"]) == 3
    assert len(capfd.readouterr().err.splitlines()) == 1


def test_another_kind_of_file_is_refused(tmp_path, refused):
    assert refused(tmp_path / "a.xlsx")[0] == 2
    assert "found the ending .xlsx, expected one of .csv, .vtu, .vtp" in refused(tmp_path / "a.xlsx")[1]


def test_units_of_a_vtk_file_are_not_guessed(tmp_path, refused):
    points, cells = cylinder_mesh()
    file = vtk(tmp_path / "a.vtp", points, cells, [("pressure", np.ones(len(cells)))])
    assert (refused(file)[0], "add --unit" in refused(file)[1]) == (2, True)
    code, said = refused(file, "--unit", "m")
    assert (code, "--pressure-unit" in said) == (2, True)


def test_the_pressure_of_a_vtk_file_has_to_be_found(tmp_path, refused):
    points, cells = cylinder_mesh()
    file = vtk(tmp_path / "a.vtp", points, cells, [("CPRESS", np.ones(len(cells))), ("n", np.ones((len(cells), 3)))])
    code, said = refused(file, "--unit", "m")
    assert code == 2
    assert "pressure: found the arrays CPRESS" in said
    assert "--pressure-name CPRESS" in said


def test_a_cell_needs_its_points(tmp_path, refused):
    points, cells = cylinder_mesh()
    file = vtk(tmp_path / "a.vtu", points, [*cells[:-1], cells[-1] + 9], [("pressure", np.ones(len(cells)))])
    code, said = refused(file, "--unit", "m", "--pressure-unit", "pa")
    assert (code, "a point that does not exist" in said) == (3, True)


def test_pictures_have_an_ending_and_a_place(tmp_path, refused):
    code, said = refused(EXAMPLE, "-o", tmp_path / "a.pdf")
    assert (code, ".png or .svg" in said) == (2, True)
    code, said = refused(EXAMPLE, "-o", tmp_path / "none" / "a.png")
    assert (code, "cannot be written" in said) == (5, True)


def test_only_faces_are_read(tmp_path, refused):
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    file = vtk(tmp_path / "a.vtu", cube, [[0, 1, 3, 2, 4, 5, 7, 6]], [("pressure", [1.0])], kinds=[12])
    code, said = refused(file, "--unit", "m", "--pressure-unit", "pa")
    assert code == 2
    assert "cell 0: found a Hexahedron of 8 points" in said
    assert "Extract Surface" in said


def test_cells_turned_inside_out_are_refused(tmp_path, refused):
    points, cells, patch = faceted()
    turned = [c[::-1] if i % 5 == 2 else c for i, c in enumerate(cells.tolist())]
    file = vtk(tmp_path / "a.vtu", points, turned, [("pressure", patch.pressure)])
    code, said = refused(file, "--unit", "m", "--pressure-unit", "pa")
    assert code == 2
    assert f"in 27 of {len(cells)} loaded faces, the first in cell 2" in said
    assert "Consistency" in said


def test_normals_that_cancel_have_no_direction(tmp_path, refused):
    file = tmp_path / "both.csv"
    file.write_text(f"{HEAD}\n{FACE}\n0,0,1,1,0,0,-1,5")
    code, said = refused(file)
    assert (code, "cancel" in said) == (2, True)


def test_a_long_side_along_the_normal_is_no_long_side(refused):
    code, said = refused(EXAMPLE, "--long-side", "0,0,1")
    assert (code, "--long-side" in said, "parallel" in said) == (2, True, True)


@pytest.mark.parametrize(
    "words",
    ["--mu 0", "--mu x", "--distance -3", "--long-side 1,2", "--long-side 0,0,0", "--unit inch", "--surface sphere",
     "--object-length 60", "--distance 60 --other b.csv"],
)  # fmt: skip
def test_bad_usage(words, capsys):
    assert main(["patch", str(EXAMPLE), *words.split()]) == 2
    assert words.split()[0] in capsys.readouterr().err


def test_contacts_that_look_away_from_each_other_are_no_grasp(tmp_path, refused):
    _, _, patch = faceted()
    one = centres(tmp_path / "one.csv", patch)
    assert "at the same place" in refused(one, "--other", one)[1]
    above = np.add(patch.centroid, [0, 0, 0.1])
    two = centres(tmp_path / "two.csv", replace(patch, centroid=above))
    code, said = refused(one, "--other", two)
    assert (code, f"the normals of {two} point away" in said) == (2, True)
    three = centres(tmp_path / "three.csv", replace(patch, centroid=above, normal=-patch.normal))
    four = replace(patch, normal=-patch.normal)
    code, said = refused(centres(tmp_path / "four.csv", four), "--other", two)
    assert (code, "--flip-normals" in said) == (2, True)
    assert main(["patch", str(one), "--other", str(three), "--surface", "three_motions"]) == 0


def test_help_has_an_example_that_exists(capsys):
    assert main(["patch", "--help"]) == 0
    text = capsys.readouterr().out
    assert "softjaw patch jobs/cylinder-pressure.csv" in text
    assert (ROOT / "jobs/cylinder-pressure.csv").exists()
