"""A study on two nodes, which are namespaces of this machine with a network and a host name each."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from softjaw.study.doctor import launch_environment
from tests.study.launching import ROOT, contents, differing, launch

pytestmark = [pytest.mark.long, pytest.mark.ranks]
NODES = ROOT / "tests" / "two_nodes.sh"


def on_two_nodes(ranks, *words):
    """A command on so many ranks of each node; its output."""
    done = subprocess.run(
        [NODES, str(ranks), *map(str, words)], cwd=ROOT, env=launch_environment(), capture_output=True, text=True,
        timeout=300, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture
def nodes():
    """Skip where namespaces cannot be made."""
    if os.geteuid() or not shutil.which("ip"):
        pytest.skip("needs root and iproute2")
    if subprocess.run(["unshare", "--net", "--uts", "true"], check=False, capture_output=True).returncode:
        pytest.skip("this kernel makes no namespaces")


@pytest.mark.usefixtures("nodes")
def test_the_nodes_have_names_of_their_own():
    assert sorted(on_two_nodes(2, "hostname").split()) == ["nodea", "nodea", "nodeb", "nodeb"]


@pytest.mark.usefixtures("nodes")
def test_two_nodes_write_the_file_of_one_process(tmp_path):
    scene = ROOT / "jobs" / "smoke.toml"
    study = ("-m", "softjaw", "run", scene, "-o")
    on_two_nodes(2, sys.executable, *study, tmp_path / "two.hdf")
    assert launch(0, *study, tmp_path / "one.hdf")[0] == 0
    expected = contents(tmp_path / "one.hdf")
    assert len(expected) > 100
    assert not differing(tmp_path / "two.hdf", expected)
