"""What holds for every patch and every motion: the planar models enclose the curved one from both sides."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from softjaw.friction.motion import fibonacci_twists
from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import friction_limits, friction_support, friction_wrench

# The same examples on every rank and every day, and no folder of past failures beside the project.
REPEATABLE = settings(derandomize=True, deadline=None, database=None, max_examples=80)
COMPONENT = st.floats(-1, 1, width=32)
ROUNDING = 1e-13


@st.composite
def patches(draw):
    """Up to eight faces anywhere, of any tilt, also overhanging ones; some carry nothing."""
    n = draw(st.integers(1, 8))
    r, normal = (draw(arrays(float, (n, 3), elements=COMPONENT)) for _ in range(2))
    normal[np.linalg.norm(normal, axis=1) < 1e-3] = [0, 0, 1]
    load = draw(arrays(float, n, elements=st.floats(0, 2, width=32)))
    load[0] += 1
    return ContactPatch(r, np.ones(n), normal, load)


@REPEATABLE
@given(patches(), arrays(float, (5, 3), elements=COMPONENT))
def test_projected_is_inside_curved_is_inside_flat(patch, twist):
    """Face by face: the shadow of a tilted friction disc is an ellipse with semi-axes 1 and n_z."""
    projected, curved, flat = (friction_support(patch, twist, 0.8, m) for m in ("pcm_projected", "ccm", "pcm"))
    slack = ROUNDING * np.maximum(flat, patch.load.sum())
    assert (projected <= curved + slack).all()
    assert (curved <= flat + slack).all()


@REPEATABLE
@given(patches(), arrays(float, (4, 6), elements=COMPONENT))
def test_friction_dissipates_and_no_other_motion_gets_more_out_of_it(patch, twist):
    """H(t) = w(t) . t >= w(s) . t for all s, in six dimensions as in three."""
    W, H = friction_wrench(patch, twist, 0.6), friction_support(patch, twist, 0.6)
    power = W @ twist.T
    slack = ROUNDING * patch.load.sum()
    np.testing.assert_allclose(np.diag(power), H, rtol=0, atol=slack)
    assert (H >= 0).all()
    assert (power <= H + slack).all()
    assert np.isfinite(W).all()


@REPEATABLE
@given(patches())
def test_three_motions_give_the_largest_force_and_torque(patch):
    limits = friction_limits(patch, 0.6)
    W = np.abs(friction_wrench(patch, fibonacci_twists(100, 1.0), 0.6))[:, [0, 1, 5]]
    # a normal may be off an axis by rounding: what it lets through is judged by the load
    slack = 1e-14 * 0.6 * limits.S * np.array([1.0, 1.0, max(1.0, np.abs(patch.centroid).max())])
    assert (W <= np.array([limits.f_x, limits.f_y, limits.tau_z]) * (1 + ROUNDING) + slack).all()
    assert limits.e_n == pytest.approx(limits.tau_z / (0.6 * limits.S), rel=1e-13)
