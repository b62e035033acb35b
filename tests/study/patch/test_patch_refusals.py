"""What ``softjaw patch`` refuses: each refusal names the file, the place, and the key or option that it is about."""

from dataclasses import replace

import numpy as np
import pytest

from softjaw.study.cli import main
from softjaw.study.messages import OTHER_FILE, USAGE
from tests.study.patch.test_patch import EXAMPLE, centres, cylinder_mesh, faceted, vtk

HEAD = "x_mm,y_mm,z_mm,area_mm2,nx,ny,nz,pressure_kpa"
FACE = "0,0,0,1,0,0,1,5"
CORNER_HEAD = ",".join(f"{c}{k}_mm" for k in (1, 2, 3) for c in "xyz") + ",pressure_kpa"
SI = "--unit", "m", "--pressure-unit", "pa"
POINTS, CELLS = cylinder_mesh()
ONES = np.ones(len(CELLS))
CUBE = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
PRESSED = [("pressure", ONES)]
TURNED = [c[::-1] if i % 5 == 2 else c for i, c in enumerate(CELLS.tolist())]


@pytest.fixture
def refused(capfd):
    def ask(*words):
        code = main(["patch", *map(str, words)])
        output, errors = capfd.readouterr()
        assert output == ""
        assert all(line.startswith("error: ") for line in errors.splitlines())
        return code, errors

    return ask


@pytest.mark.parametrize(("text", "place", "key"), [
    ("", "", ""),
    (HEAD, "", "one line"),
    ("1,2,3\n4,5,6", ":1", "x_mm"),
    (f"{HEAD.replace('area_mm2,', '')}\n{FACE}", ":1", "area"),
    (f"{HEAD.replace('kpa', 'psi')}\n{FACE}", ":1", "pressure_psi"),
    (f"{HEAD.replace('x_mm', 'x')}\n{FACE}", ":1", "--unit mm"),
    (f"{HEAD.replace('_kpa', '')}\n{FACE}", ":1", "--pressure-unit"),
    (f"{HEAD},x_m\n{FACE},0", ":1", "x_mm and x_m"),
    (f"{HEAD}\n{FACE}\n0,0,0,1,0,0,1,-5", ", line 3", "pressure: found -5000 Pa"),
    (f"{HEAD}\n{FACE}\n0,0,0,-1,0,0,1,5", ", line 3", "area: found -1e-06 m^2"),
    (f"{HEAD}\n0,0,0,0,0,0,1,5", "", "load"),
    (f"{HEAD}\n{FACE}\n0,0,0,0,0,0,1,5", ", line 3", "area: found 0 under 5000 Pa"),
    (f"{HEAD}\n{FACE}\n0,0,0,1,0,0,1,nan", ":3", "pressure_kpa"),
    (f"{HEAD}\n{FACE}\n0,0,0,1,0,,1,5", ":3", "ny"),
    (f"{HEAD}\n{FACE}".replace(",", ";").replace("1;0;0", "1,5;0;0"), ":2", '"1,5"'),
    (f"{HEAD}\n{FACE}\n0,0,0,1,0,0,1", ":3", "7 cells"),
    (f"{HEAD}\n{FACE}\n0,0,0,1,0,0,0,5", ", line 3", "normal: found 0, 0, 0"),
    (f"{HEAD}\n0,0,0,1,0,0,1,0", "", "load"),
    (f"{HEAD}\n{FACE}\n1,0,0,1,0,0,-1,5\n2,0,0,1,0,0,1,5", "", "1 of 3"),
    (f"{HEAD}\n{FACE}\n0,0,1,1,0,0,-1,5", "", "cancel"),
    (f"{CORNER_HEAD.replace('z3_mm', 'c')}\n0,0,0,1,0,0,0,1,0,5", ":1", "z3"),
    (f"{CORNER_HEAD}\n0,0,0,1,0,0,2,0,0,5\n0,0,0,1,0,0,0,1,0,5", ", line 2", "area: found 0"),
    # on a line too, but rounding leaves an area of 2e-23 m^2
    (f"{CORNER_HEAD}\n.1,.1,.1,.2,.2,.8,.3,.3,1.5,5\n0,0,0,1,0,0,0,1,0,5", ", line 2", "area: found 0"),
])  # fmt: skip
def test_a_table_that_is_no_patch(tmp_path, refused, text, place, key):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    code, errors = refused(file)
    assert code == USAGE
    assert f"{file}{place}" in errors
    assert key in errors


def test_problems_are_told_together_but_not_by_the_thousand_and_a_file_that_is_cut_short_not_read(tmp_path, refused):
    file = tmp_path / "bad.csv"
    file.write_text("\n".join([HEAD, *["0,0,0,1,0,0,x,y"] * 1000]))
    code, errors = refused(file)
    assert code == USAGE
    assert 5 < len(errors.splitlines()) < 15
    assert "1990" in errors
    file = vtk(tmp_path / "cut.vtu", POINTS, CELLS, PRESSED)
    file.write_bytes(file.read_bytes()[:-2000])
    code, errors = refused(file, *SI)
    assert (code, len(errors.splitlines())) == (OTHER_FILE, 1)


@pytest.mark.parametrize("name", ["none.csv", "none.vtu", "a.csv", "a.vtu", "a.vtp"])
def test_a_missing_or_damaged_file_cannot_be_read(tmp_path, refused, name):
    if "none" not in name:
        (tmp_path / name).write_bytes(b"\x00\xff\xfe" * 100)
    code, errors = refused(tmp_path / name, "--unit", "m")
    assert code == OTHER_FILE
    assert len(errors.splitlines()) == 1
    assert name in errors


@pytest.mark.parametrize(("name", "grid", "words", "code", "key"), [
    ("a.vtp", (POINTS, CELLS, PRESSED), (), USAGE, "--unit"),
    ("a.vtp", (POINTS, CELLS, PRESSED), ("--unit", "m"), USAGE, "--pressure-unit"),
    ("a.vtp", (POINTS, CELLS, [("CPRESS", ONES), ("n", np.ones((len(CELLS), 3)))]), ("--unit", "m"), USAGE,
     "--pressure-name CPRESS"),
    ("a.vtp", (POINTS, CELLS, [*PRESSED, ("pressure_kpa", ONES)]), SI, USAGE, "pressure, pressure_kpa"),
    ("a.vtu", (POINTS, [*CELLS[:-1], CELLS[-1] + 9], PRESSED), SI, OTHER_FILE, "point"),
    ("a.vtu", (CUBE, [[0, 1, 3, 2, 4, 5, 7, 6]], [("pressure", [1.0])], (), [12]), SI, USAGE, "cell 0"),
    ("a.vtu", (POINTS, TURNED, PRESSED), SI, USAGE, f"27 of {len(CELLS)}"),
], ids=["unit", "pressure unit", "pressure", "two", "points", "faces", "inside out"])  # fmt: skip
def test_a_grid_that_is_no_patch(tmp_path, refused, name, grid, words, code, key):
    found, errors = refused(vtk(tmp_path / name, *grid), *words)
    assert found == code
    assert key in errors


@pytest.mark.parametrize("words", [
    "--mu 0", "--mu x", "--distance -3", "--long-side 1,2", "--long-side 0,0,0", "--long-side 0,0,1", "--unit inch",
    "--surface sphere", "--object-length 60", "--distance 60 --other b.csv", "-o a.pdf",
])  # fmt: skip
def test_bad_usage(words, capsys):
    assert main(["patch", str(EXAMPLE), *words.split()]) == USAGE
    assert words.split()[0] in capsys.readouterr().err or words.startswith("-o")


def test_contacts_that_look_away_from_each_other_are_no_grasp(tmp_path, refused):
    _, _, patch = faceted()
    above = np.add(patch.centroid, [0, 0, 0.1])
    one = centres(tmp_path / "one.csv", patch)
    two = centres(tmp_path / "two.csv", replace(patch, centroid=above))
    three = centres(tmp_path / "three.csv", replace(patch, centroid=above, normal=-patch.normal))
    four = centres(tmp_path / "four.csv", replace(patch, normal=-patch.normal))
    assert refused(one, "--other", one)[0] == USAGE  # at one place
    code, errors = refused(one, "--other", two)
    assert (code, str(two) in errors) == (USAGE, True)
    code, errors = refused(four, "--other", two)
    assert (code, "--flip-normals" in errors) == (USAGE, True)
    assert main(["patch", str(one), "--other", str(three), "--surface", "three_motions"]) == 0
