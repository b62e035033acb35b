"""The result file: what it holds, what viewers see, and what is refused when it comes from elsewhere."""

import os
import re
import subprocess
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest

import softjaw
from softjaw.study import quantities
from softjaw.study.case.result import CaseResult
from softjaw.study.messages import CANNOT_WRITE, OTHER_FILE, StudyError
from softjaw.study.quantities import BY_KEY, MODELS, NEEDS, TABLE, Axis, Quantity
from softjaw.study.result.layout import VERSION, Header, Layout, layout_of
from softjaw.study.result.lock import Lock, holder
from softjaw.study.result.skeleton import axes_of, create, groups, text_bytes, view_slice
from softjaw.study.result.store import open_result, torn_rows
from softjaw.study.result.write import ResultWriter, blank, record, verify
from tests.study.fake_run import fake_result
from tests.study.launching import refusal

HEADER = Header("abc", 'a = "µ"\n', "Flasche", labels=("left", "ötken"))


def axis(name, n, units=""):
    return Axis(name, np.arange(n, dtype=float), units, f"the {name}")


def small(**options):
    sizes = {"station": 5, "angle": 2, "normal_force": 3, **options.pop("sizes", {})}
    return Layout(tuple(axis(name, n, "m" if name == "station" else "") for name, n in sizes.items()), 4, **options)


@pytest.fixture
def path(tmp_path):
    created = tmp_path / "small.hdf"
    create(created, small(), HEADER)
    return created


def put(path, layout, row, values):
    writer = ResultWriter(path, layout, None)
    writer.write(row, values)
    writer.close()


def test_what_was_written_is_read(path):
    layout, result = small(), fake_result(3)
    patch = {name: values[:, :4] for name, values in result.patch.items()}
    put(path, layout, 10, record(layout, replace(result, patch=patch, message="grüße")))
    with open_result(path) as read:
        assert [a.name for a in read.axes] == ["station", "angle", "normal_force"]
        assert read.axes[0].units == "m"
        assert read.axes[0].long_name == "the station"
        for i, model in enumerate(MODELS):
            assert read.read(f"e_n/{model}")[1, 1, 1] == result.values["maps/e_n"][i]
        assert read.read("S/S")[1, 1, 1] == result.values["maps/S"]
        assert np.array_equal(read.read("fingers/f_x_max")[1, 1, 1], result.values["fingers/f_x_max"])
        assert np.array_equal(read.read("checks/adhesion")[1, 1, 1], result.values["checks/adhesion"])
        assert np.allclose(read.patch(10)["normal"], patch["normal"], rtol=0, atol=3e-5 * np.abs(patch["normal"]).max())
        assert np.isnan(read.patch(10)["centroid"]).all()
        assert [read.read(f"effects/sheet_{part}")[1, 1, 1] for part in ("level", "indicator", "reason")] == [1, 0.5, 1]
        assert read.messages[1, 1, 1] == "grüße"
        assert (read.status == 1).sum() == 1
        assert read.scene == 'a = "µ"\n'
        assert read.title == "Flasche"
        assert list(read.labels.ravel()[:3]) == ["left", "ötken", ""]
        assert "ccm" in read.definitions


def test_a_fresh_file_is_empty_everywhere(path):
    layout = small()
    with open_result(path) as read:
        for c in layout.columns[:-1]:
            values = read.read(c.path.removeprefix("/study/"))
            assert (np.isnan(values) if values.dtype.kind == "f" else values == -1).all(), c.key
        assert not read.status.any()
        assert not read.sessions
    assert layout.nbytes >= path.stat().st_size > 0.5 * layout.nbytes - 2**17


def test_viewers_find_a_plot_from_the_root_down_the_map_at_the_largest_force(path):
    with h5py.File(path) as file:
        assert file.attrs["NX_class"] == "NXroot"
        entry = file[file.attrs["default"]]
        assert entry.attrs["NX_class"] == "NXentry"
        plot = entry[entry.attrs["default"]]
        assert plot.attrs["NX_class"] == "NXdata"
        signals = [plot.attrs["signal"], *plot.attrs["auxiliary_signals"]]
        assert signals == ["payload", "quality", "e_n"]
        # silx draws nothing over an axis of two values: that one is named '.' and keeps its dimension scale.
        assert list(plot.attrs["axes"]) == ["station", "."]
        for name in signals:
            assert plot[name].shape == (5, 2)
            assert plot[name].attrs["interpretation"] == "image"
            assert [d[0].name.rpartition("/")[2] for d in plot[name].dims] == ["station", "angle"]
        assert plot["quality"].attrs["long_name"] == "grasp quality, ccm"
        whole = entry["quality"]
        assert [whole.attrs["signal"], *whole.attrs["auxiliary_signals"]] == ["ccm", "pcm", "pcm_projected"]
        assert list(whole.attrs["axes"]) == ["station", ".", "normal_force"]
        assert list(whole.attrs["default_slice"]) == [".", ".", "2"]
        assert entry["e_n/ccm"].attrs["units"] == "m"
        assert entry["patch/normal"].dims[5][0].shape == (3,)
    for row in (16, 17):  # the second and third force at station 2, angle 1
        put(path, layout := small(), row, record(layout, CaseResult({"maps/quality": [row, 0.0, 0.0]})))
    with h5py.File(path) as file:
        shown = file["study/map/quality"][()]
        assert shown[2, 1] == 17.0
        assert np.isnan(np.delete(shown.ravel(), 5)).all()
    assert torn_rows(path, layout) == []


@pytest.mark.parametrize("older", [True, False])
def test_a_file_that_has_not_the_quantities_of_this_version_opens(tmp_path, monkeypatch, older):
    """One that was written before epsilon was added, and one that has it where this version does not."""
    path, layout = tmp_path / "other.hdf", small()
    if older:
        layout = small(stored=tuple(c.path for c in layout.columns if "/epsilon" not in c.path))
    create(path, layout, HEADER)
    put(path, layout, 10, record(layout, CaseResult({"maps/quality": [1.0, 2.0, 3.0], "maps/flags": 0.0})))
    if not older:
        monkeypatch.setattr(quantities, "TABLE", tuple(q for q in TABLE if "epsilon" not in q.name))
    ds = softjaw.open(path)
    assert "epsilon" not in ds
    assert ds.quality.values[1, 1, 1].tolist() == [1.0, 2.0, 3.0]
    with refusal(OTHER_FILE):
        verify(path, small(), HEADER)
    with h5py.File(path, "r+") as file:
        file["study/quality/pcm"][1, 1, 1] = 7.0
    with pytest.raises(StudyError, match=r"quality/pcm of case 10"):
        softjaw.open(path)


def test_every_dimension_has_a_scale_beside_the_data(path):
    """xarray refuses datasets of which only some dimensions have one."""
    with h5py.File(path) as file:
        for dataset in small().datasets:
            found = file[dataset.path]
            names = [d[0].name.rpartition("/")[2] for d in found.dims]
            assert all(name in found.parent for name in names)


@pytest.mark.parametrize("need", NEEDS)
def test_a_scene_that_asks_for_one_thing_alone_has_lengths_for_all_its_datasets(need):
    assert all(len(dataset.shape) > 0 for dataset in small(has=(need,)).datasets)


def test_every_dataset_says_what_it_is(tmp_path):
    layout = small(has=NEEDS)
    create(tmp_path / "whole.hdf", layout, HEADER)
    seen = set()

    def look(name, node):
        if isinstance(node, h5py.Dataset):
            assert node.attrs["long_name"], name
            assert node.dtype.kind in "SV" or isinstance(node.attrs["units"], str), name
            key = name if name in BY_KEY else f"maps/{name.partition('/')[0]}{'_error' * name.endswith('/error')}"
            if key in BY_KEY and "CLASS" not in node.attrs:  # the scales beside them
                seen.add(key)
                assert len(node.attrs["definition"]) > 5, name
            elif "CLASS" not in node.attrs:  # structure, and what says which candidates and motions were taken
                assert re.fullmatch(r"(checksums|map)/.*|.*/(candidate|motion|label|sessions)|[a-z]+", name), name

    with h5py.File(tmp_path / "whole.hdf") as file:
        file["study"].visititems(look)
        assert seen == set(BY_KEY)  # every dataset has a row, every row a dataset


@pytest.mark.parametrize(("sizes", "expected"), [
    ({}, [".", ".", "2"]), ({"angle": 1}, [".", "0", "."]), ({"angle": 1, "normal_force": 1}, [".", "0", "0"]),
    ({"station": 1, "angle": 1}, ["0", "0", "."]), ({"station": 1, "angle": 1, "normal_force": 1}, ["0", "0", "."]),
])  # fmt: skip
def test_viewers_open_at_stations_and_angles_at_the_highest_force(sizes, expected):
    assert view_slice(small(sizes=sizes)) == expected


def test_an_axis_of_two_values_has_a_name_beside_an_uneven_one_and_damage_in_a_done_row_is_found(tmp_path, path):
    even = small()
    uneven = Layout((*even.axes[:-1], replace(even.axes[-1], values=np.array([1.0, 2.0, 5.0]))), 4)
    assert axes_of(even, range(3)) == ["station", ".", "normal_force"]
    assert axes_of(uneven, range(3)) == ["station", "angle", "normal_force"]
    assert axes_of(uneven, (0, 1)) == ["station", "."]
    axes = (axis("object_radius", 3, "m"), *small().axes)
    layout = Layout(axes, 0, (Quantity("slope", ("object_radius",), "1", "slope", "a slope", "derived"),), NEEDS[:1])
    create(tmp_path / "s.hdf", layout, HEADER)
    with open_result(tmp_path / "s.hdf") as read:
        assert read.layout.shape == (3, 5, 2, 3)
        assert read.axes[0].name == "object_radius"
        assert read.read("e_n/error").shape == read.layout.shape
        assert read.patch(0) == {}
        assert read.derived("slope").shape == (3,)
    assert view_slice(layout) == ["0", ".", ".", "2"]
    assert "patch" not in groups(layout)
    assert layout_of(layout.text()).text() == layout.text()
    verify(tmp_path / "s.hdf", layout, HEADER)
    layout = small()
    result = CaseResult({"maps/e_n": [1.0, 2.0, 3.0], "work/seconds_total": 2.0})
    for row in (0, 3, 7, 11, 29):
        put(path, layout, row, record(layout, result))
    assert torn_rows(path, layout) == []
    with h5py.File(path, "r+") as file:
        file["study/work/seconds_total"][0, 0, 0] = 5.0
        file["study/e_n/pcm"][0, 0, 1] = 7.0  # not a done row
        file["study/status/message"][1, 0, 1] = b"other"
        file["study/status/code"][0, 1, 0] = 2
        file["study/patch/area"][4, 1, 2, 1, 3] = 0.0
    assert torn_rows(path, layout) == [0, 3, 7, 29]


def test_a_result_that_does_not_fit_is_a_bug_a_full_disk_told_and_only_an_own_file_resumed(tmp_path, monkeypatch, path):
    wrong = {name: CaseResult({name: 1.0}) for name in ("maps/nonsense", "maps/e_n")}
    wrong |= {"fingers/S": CaseResult({"fingers/S": [1, 2, 3]})}
    wrong |= {"patch/pressure": CaseResult({}, {"pressure": np.zeros((2, 5))})}
    for name, result in wrong.items():
        with pytest.raises(ValueError, match=name):
            record(small(), result)
    assert text_bytes("a\n b", 9) == b"a b"
    assert text_bytes("ä" * 5, 8).decode() == "ää ..."
    assert text_bytes("the pad leaves", 14) == b"the pad leaves"
    assert text_bytes("the pad leaves", 13) == b"the pad ..."
    assert blank(small(), "no contact")[-1] == b"no contact"
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "posix_fallocate", full)
    with refusal(CANNOT_WRITE, match=r"No space left .* MB are free"):
        create(tmp_path / "x.hdf", small(), HEADER)
    assert list(tmp_path.iterdir()) == [path]
    verify(path, small(), HEADER)
    with refusal(OTHER_FILE):
        verify(path, small(), replace(HEADER, digest="xyz"))
    with pytest.raises(StudyError):
        verify(path, small(has=NEEDS[:1]), HEADER)


@pytest.mark.parametrize("spoil", [
    lambda file: file.attrs.__delitem__("program"),
    lambda file: file.attrs.modify("layout_version", 99),
    lambda file: file.attrs.modify("layout_version", VERSION - 1),
    lambda file: file["study/layout"].write_direct(np.array(b"{}", file["study/layout"].dtype)),
    lambda file: file["study"].pop("layout"),
], ids=["program", "newer", "older", "empty", "none"])  # fmt: skip
def test_a_file_of_another_kind_is_refused_when_it_is_opened(path, spoil):
    with h5py.File(path, "r+") as file:
        spoil(file)
    with refusal(OTHER_FILE), open_result(path):
        pass


@pytest.mark.parametrize("kind", ["missing", "empty", "text", "folder"])
def test_what_is_no_hdf5_file_is_refused(path, kind):
    path.unlink()
    if kind != "missing":
        path.write_text("" if kind == "empty" else "station,e_n\n1,2\n")
    with refusal(OTHER_FILE), open_result(path.parent if kind == "folder" else path):
        pass


def virtual(file, name, secret):
    layout = h5py.VirtualLayout((5, 2, 3), "<f8")
    layout[...] = h5py.VirtualSource(str(secret), "x", (5, 2, 3))
    file.create_virtual_dataset(name, layout)


@pytest.mark.parametrize("put", [
    virtual, lambda file, name, secret: file.create_dataset(name, (5, 2, 3), "<f8", external=[(str(secret), 0, 240)]),
    lambda file, name, secret: file.__setitem__(name, h5py.ExternalLink(str(secret), "/x")),
    lambda file, name, secret: file.__setitem__(name, h5py.SoftLink("/study/e_n/pcm")),
    lambda file, name, secret: file.create_dataset(name, (50, 2, 3), "<f8"),
    lambda file, name, secret: file.create_dataset(name, (5, 2, 3), "<f4"),
], ids=["virtual", "external data", "external link", "soft link", "shape", "type"])  # fmt: skip
def test_data_from_elsewhere_are_not_read(path, tmp_path, put):
    secret = tmp_path / "secret"
    secret.write_bytes(b"s" * 400)
    with h5py.File(path, "r+") as file:
        del file["study/e_n/ccm"]
        put(file, "study/e_n/ccm", secret)
    with open_result(path) as read:
        assert read.read("e_n/pcm").shape == (5, 2, 3)
        with refusal(OTHER_FILE):
            read.read("e_n/ccm")


def test_a_lock_keeps_a_second_run_away_goes_with_its_holder_and_withdraws_when_overtaken(tmp_path):
    first, second = Lock(tmp_path / "x.hdf", "first"), Lock(tmp_path / "x.hdf", "second")
    first.take_first()
    first.confirm()
    assert holder(tmp_path / "x.hdf") == "first"
    with pytest.raises(StudyError):
        second.take_first()
    first.remove()
    first.release()
    assert holder(tmp_path / "x.hdf") == ""
    second.take_first()
    second.confirm()
    second.release()
    lock = Lock(tmp_path / "x.hdf", "first")
    lock.take_first()
    lock.path.write_text("second")  # between the exclusive and the shared lock
    with pytest.raises(StudyError):
        lock.confirm()
    lock.release()


def test_a_row_that_a_run_stores_anew_while_a_file_is_read_is_no_damage(path):
    layout, result = small(), fake_result(3)
    patch = {name: values[:, :4] for name, values in result.patch.items()}
    put(path, layout, 10, record(layout, replace(result, patch=patch)))
    code = (  # another process, as HDF5 shares files within one
        "import sys, zlib, h5py\n"
        "with h5py.File(sys.argv[1], 'r+') as file:\n"
        "    values, sums = file['study/e_n/ccm'], file['study/checksums/rows']\n"
        "    values[1, 1, 1] *= 2.0\n"
        f"    sums[1, 1, 1, {layout.summed.index('/study/e_n/ccm')}] = zlib.crc32(values[1, 1, 1].tobytes())\n"
    )
    with open_result(path) as read:
        assert read.read("S/S")[1, 1, 1] == result.values["maps/S"]
        unlocked = {**os.environ, "HDF5_USE_FILE_LOCKING": "FALSE"}
        assert subprocess.run([sys.executable, "-c", code, path], env=unlocked, check=False).returncode == 0
        assert read.read("e_n/ccm")[1, 1, 1] == 2.0 * result.values["maps/e_n"][0]
