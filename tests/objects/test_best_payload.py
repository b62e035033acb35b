"""The best grasp that `init` and `run` give against a dense scan of the object: `tests/tools/dense_scan.py` made it."""

import json

import pytest

from tests.tools.dense_scan import TABLE, best_of_run

KNOWN = json.loads(TABLE.read_text())


@pytest.mark.long
@pytest.mark.parametrize("name", KNOWN)
def test_the_best_grasp_of_a_run_holds_what_the_best_of_a_dense_scan_holds(name, tmp_path):
    """Where a run has held more than the scan, later ones stay near that."""
    assert best_of_run(name, tmp_path) >= 0.95 * max(KNOWN[name]["payload_kg"], KNOWN[name]["run_kg"])
