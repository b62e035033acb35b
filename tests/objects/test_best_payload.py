"""The sampler's best grasp against a dense scan of the same object: `tests/tools/dense_scan.py` made the table."""

import json

import pytest

from tests.tools.dense_scan import TABLE, best_sampled, scene_of

KNOWN = json.loads(TABLE.read_text())


@pytest.mark.long
@pytest.mark.parametrize("name", KNOWN)
def test_the_best_of_the_sampled_grasps_holds_what_the_best_of_a_dense_scan_holds(name, tmp_path):
    """On the same mesh, without friction that acts back."""
    assert best_sampled(scene_of(name, tmp_path)) >= 0.95 * KNOWN[name]["payload_kg"]
