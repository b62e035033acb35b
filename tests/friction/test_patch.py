"""A patch is checked once, when it is made."""

from dataclasses import replace

import numpy as np
import pytest

from softjaw.friction.patch import ContactPatch, NoContactError
from tests.generators import lcg_patch


@pytest.mark.parametrize(("name", "index", "value", "match"), [
    ("centroid", (2, 1), np.nan, r"centroid\[2, 1\] is nan.*face 2"), ("area", (4,), np.inf, r"area\[4\] is inf"),
    ("normal", (1, 0), -np.inf, r"normal\[1, 0\] is -inf"), ("pressure", (3,), np.nan, r"pressure\[3\] is nan"),
    ("pressure", (3,), -1.0, r"pressure\[3\] is -1.0: it must not be negative.*clip"),
    ("area", (0,), -2e-4, r"area\[0\] is -0.0002: it must not be negative"),
    ("normal", (5,), 0.0, r"normal\[5\] is zero"),
])  # fmt: skip
def test_a_bad_value_is_named_with_its_place_and_the_remedy(name, index, value, match):
    patch = lcg_patch(1, 10)
    array = getattr(patch, name).copy()
    array[index] = value
    with pytest.raises(ValueError, match=match):
        replace(patch, **{name: array})


def test_corners_need_three_per_face_no_force_is_an_error_and_a_patch_cannot_be_changed():
    patch = lcg_patch(1, 10)
    wrong = {name: getattr(patch, name)[:-1] for name in ("centroid", "area", "normal")}
    for name, values in [*wrong.items(), ("corners", np.zeros((10, 2, 3))), ("corners", np.zeros((10, 12)))]:
        with pytest.raises(ValueError, match=name):
            replace(patch, **{name: values})
    with pytest.raises(NoContactError):
        replace(patch, pressure=np.zeros(10))
    with pytest.raises(NoContactError):
        ContactPatch(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)), np.zeros(0))
    with pytest.raises(ValueError, match="read-only"):
        patch.pressure[0] = 1.0
    source = np.ones(3)
    ContactPatch(np.eye(3), source, np.eye(3), source)
    source[0] = 2.0
    patch = lcg_patch(2, 500)
    np.testing.assert_array_equal(replace(patch, area=patch.area).normal, patch.normal)
    for scale in (3.0, 1e-310, 1e308):
        np.testing.assert_allclose(np.linalg.norm(replace(patch, normal=scale * patch.normal).normal, axis=1), 1)
