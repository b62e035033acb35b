"""A result file opens as plots in the tools people have: silx, nexusformat, xarray.

They live in an environment of their own (``tests/browse``), made once in the user's cache and used again: minutes the
first time. Where it cannot be had the tests that need it are skipped and say what was missing.
"""

import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from matplotlib.image import imread

from softjaw.study.result.store import open_result
from tests.study.launching import ROOT, solve

pytestmark = pytest.mark.long

BROWSE = ROOT / "tests" / "browse"
STATIONS = ("--set", "candidates.stations_mm=[-12, 0, 12]")


def or_skip(words, **options):
    try:
        done = subprocess.run([str(w) for w in words], capture_output=True, text=True, timeout=900, **options)
    except (OSError, subprocess.TimeoutExpired) as error:
        pytest.skip(f"cannot be installed here: {error}")
    if done.returncode:
        last = (done.stderr.strip() or done.stdout.strip() or "no message").splitlines()[-1]
        pytest.skip(f"cannot be installed here: {' '.join(str(w) for w in words[:4])}: {last}")


def answer(words, **options):
    done = subprocess.run([str(w) for w in words], capture_output=True, text=True, timeout=180, **options)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.fixture(scope="module")
def python():
    """The interpreter of an environment in the user's cache, by what it has to hold; skips where that cannot be had."""
    key = hashlib.sha256((BROWSE / "requirements.txt").read_bytes()).hexdigest()[:12]
    folder = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache") / "softjaw" / f"viewers-{key}"
    if not (folder / "complete").exists():
        shutil.rmtree(folder, ignore_errors=True)
        or_skip([sys.executable, "-m", "venv", folder / "venv"])
        or_skip([folder / "venv/bin/pip", "install", "-q", "-r", BROWSE / "requirements.txt"])
        (folder / "complete").touch()
    return folder / "venv/bin/python"


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A study of 3 stations x 2 angles x 2 forces, solved by the program."""
    path = tmp_path_factory.mktemp("browsing") / "cylinder.hdf"
    solve(0, ROOT / "jobs/smoke.toml", path, *STATIONS)
    return path


def test_nexus_checks_find_no_error_silx_opens_at_a_drawn_map_and_xarray_has_coordinates(result, python, tmp_path):
    """nexusformat takes every virtual dataset for a stack of whole ones, so views become plain datasets for it."""
    plain = shutil.copy(result, tmp_path)
    with h5py.File(plain, "r+") as file:
        group = file["study/map"]
        for name in [name for name, node in group.items() if node.is_virtual]:
            values = group[name][()]
            del group[name]
            group[name] = values
    told = re.sub(r"\x1b\[[0-9;]*m", "", answer([python.with_name("nxcheck"), plain]))
    assert "Total number of errors: 0" in told
    assert "NXentry: /study" in told
    told = json.loads(answer([python, BROWSE / "silx_picture.py", result, tmp_path / "silx.png"]).splitlines()[-1])
    assert told["issues"] == {}
    assert told["plots"] > 20
    assert (told["default"], told["view"]) == ("/study/map", "Image")
    rgb = (imread(tmp_path / "silx.png")[..., :3] * 15).round().astype(int).reshape(-1, 3)
    assert len(np.unique(rgb[np.ptp(rgb, axis=1) > 2], axis=0)) > 20  # colours
    code = (
        "import sys, xarray; d = xarray.open_dataset(sys.argv[1], engine='h5netcdf', group='/study/e_n');"
        "print(float(d.ccm.sel(station=0.01, normal_force=1.9, angle=0, method='nearest')), d.ccm.units)"
    )
    value, units = answer([python, "-c", code, result]).split()
    with open_result(result) as read:
        assert float(value) == read.read("e_n/ccm")[2, 0, 1]
    assert units == "m"
