"""How a contact patch hangs together."""

from __future__ import annotations

import numpy as np
import pytest

from softjaw.study.case.topology import topology

RING = np.array([[0, 0, 0, 0, 0], [0, 1, 1, 1, 0], [0, 1, 0, 1, 0], [0, 1, 1, 1, 0], [0, 0, 0, 0, 0]])


@pytest.mark.parametrize(
    ("loaded", "pieces", "holes", "rims"),
    [
        (np.zeros((5, 5)), 0, 0, 0),
        (np.ones((5, 5)), 1, 0, 15),
        (RING, 1, 1, 0),
        (np.eye(5), 1, 0, 15),  # faces that meet at a corner are one piece
        (np.diag([1, 1, 0, 1, 1]), 2, 0, 15),
        (np.diag([0, 1, 1, 1, 0]), 1, 0, 0),
        (np.pad(RING, [(0, 0), (0, 5)]) + np.pad(RING, [(0, 0), (5, 0)]), 2, 2, 0),
        (np.outer([1, 0, 0, 1], [0, 1, 1, 0]), 2, 0, 3),
        (np.outer([0, 1, 1, 0], [1, 0, 0, 0]), 1, 0, 4),
    ],
)  # fmt: skip
def test_pieces_holes_and_rims(loaded, pieces, holes, rims):
    assert topology(3e4 * loaded.ravel(), loaded.shape) == {"pieces": pieces, "holes": holes, "rims": rims}
