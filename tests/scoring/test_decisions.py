"""No decision hangs on rounding: grasps in any position, with numbers changed by a few units in the last place."""

import collections

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.contact import PolytopeBody, SoftContact, fibonacci_vertices, hull_volume
from softjaw.scoring.epsilon import epsilon, separating_wrench
from softjaw.scoring.pose import pose_volume
from softjaw.scoring.quality import ScoreFlag, contact_flag, grasp_score, score
from tests.scoring.grasps import facing
from tests.turns import TURNS, shaken

LENGTHS = 0.2, 0.05
A, FLAT, SLIPPERY = (0.8, 0.6, 0.015), (0.8, 0.6, 0.0), (0.0, 0.6, 0.015)
BOX = np.stack(np.meshgrid([-0.8, 0, 0.8], [-0.6, 0, 0.6], [-0.015, 0, 0.015]), axis=-1).reshape(-1, 3)
POINTS = fibonacci_vertices(A, 20)
CLEAN, NO_TORQUE, NO_FORCE = ScoreFlag.CLEAN, ScoreFlag.NO_TORQUE, ScoreFlag.NO_FORCE


def pair(one, two, tilt=0.0, apart=0.06):
    return facing(one, two, apart, tilt)


def moved(rng, contacts):
    R, p = Rotation.random(random_state=rng).as_matrix(), 0.1 * rng.normal(size=3)
    there = []
    for k in contacts:
        if isinstance(k.body, Ellipsoid):
            body = Ellipsoid.of_axes(shaken(rng, k.body.semi_axes))
        else:
            body = PolytopeBody(shaken(rng, k.body.vertices))
        there.append(SoftContact(shaken(rng, R @ k.position + p), shaken(rng, k.axes @ R.T), body))
    return there, R, p


def outcomes(decide, contacts, times=TURNS):
    rng = np.random.default_rng(0)
    return collections.Counter(decide(*moved(rng, contacts)) for _ in range(times))


@pytest.mark.parametrize(("contacts", "method", "flag", "volume"), [
    (pair(A, A), "antipodal", CLEAN, True), (pair(A, A, 0.3), "pose", CLEAN, True),
    (pair(BOX, BOX), "antipodal", CLEAN, True), (pair(BOX, BOX, 0.2), "pose", CLEAN, True),
    (pair(BOX, A, 0.1), "pose", CLEAN, True), (pair(A, FLAT), "antipodal", NO_TORQUE, True),
    (pair(FLAT, FLAT), "antipodal", NO_TORQUE, False), (pair(FLAT, FLAT, 0.2), "pose", NO_TORQUE, False),
    (pair(SLIPPERY, SLIPPERY), "antipodal", NO_FORCE, False),
    (pair((0.0, 0.0, 0.0), A), "antipodal", NO_FORCE | NO_TORQUE, False),
    (pair(BOX * [1, 1, 0], BOX * [1, 1, 0]), "antipodal", NO_TORQUE, False),
])  # fmt: skip
def test_the_method_of_a_score_and_what_contacts_lack(contacts, method, flag, volume):
    """Margins: 1e-4 of the angle to the line, 1e-12 of the largest load; volumes agree on both sides."""
    found = []

    def decide(k, R, p):
        s = grasp_score(k, *LENGTHS, p, with_epsilon=False)
        found.append((s.quality, s.quality_l1))
        return s.method, s.flag, s.quality > 0

    assert outcomes(decide, contacts) == {(method, flag, volume): TURNS}
    assert np.ptp(found, axis=0).max() <= 1e-11 * np.max(found)


def test_rounding_of_no_torque_is_no_torque():
    """A flat body in another frame has a torque of 1e-17."""
    for noise in (0.0, 1e-17, 6e-17):
        for unit in (1.0, 1e3):
            axes = 0.8, 0.6, unit * noise
            assert contact_flag([Ellipsoid.of_axes(axes)], 0.05 * unit) == NO_TORQUE
            assert score(axes, axes, 0.06 * unit, 0.2 * unit, 0.05 * unit).flag == NO_TORQUE
    assert contact_flag([Ellipsoid.of_axes([0.8, 6e-17, 0.01])], 0.05) == NO_FORCE
    assert contact_flag([Ellipsoid.of_axes([0.8, 1e-6, 1e-9])], 0.05) == CLEAN


@pytest.mark.parametrize("unit", [1e-12, 1e-9, 1e-6, 1e-3, 1e3, 1e9])
@pytest.mark.parametrize(("one", "two"), [(A, (0.5, 0.9, 0.025)), (BOX, A), (BOX, POINTS), (FLAT, BOX)])
def test_volumes_do_not_depend_on_the_unit_of_length(unit, one, two):
    """What is flat enough to be given a thickness is judged in loads of one size: in metres a patch of nanometres was
    20 % short of its L1 volume, and a polytope had 5000 times its volume."""
    length = np.array([1, 1, unit])
    metre = pose_volume(*pair(one, two, 0.3), *LENGTHS)
    contacts = pair(np.multiply(one, length), np.multiply(two, length), 0.3, 0.06 * unit)
    other = pose_volume(*contacts, *np.multiply(LENGTHS, unit))
    assert (other.linf, other.l1) == pytest.approx((metre.linf, metre.l1), rel=1e-9)


def test_hulls_are_flat_or_not_and_epsilon_goes_to_zero_where_nothing_decides():
    """Margin 1e-12 of the longest extent."""
    rng = np.random.default_rng(0)
    for _ in range(TURNS):
        R = Rotation.random(random_state=rng).as_matrix()
        assert [hull_volume(shaken(rng, BOX * size @ R.T)) for size in ([1, 1, 0], [1, 0, 0])] == [0, 0]
        assert hull_volume(shaken(rng, BOX @ R.T)) == pytest.approx(8 * 0.8 * 0.6 * 0.015, rel=1e-12)
    assert hull_volume(BOX * [1, 1, 1e-6]) == pytest.approx(8e-6 * 0.8 * 0.6 * 0.015, rel=1e-12)
    # At the angle of friction 0 is on the boundary: neither side of the decision gives more than its tolerance.
    contacts = pair((0.8, 0.6, 0.15), (0.8, 0.6, 0.15), np.arctan(0.6))
    assert outcomes(lambda k, R, p: epsilon(k, *LENGTHS, p).upper < 1e-6, contacts, 4) == {True: 4}


@pytest.mark.parametrize(("contacts", "closed"), [
    (pair(A, A), True), (pair(A, FLAT), True), (pair(A, A, np.radians(30)), True), (pair(A, A, np.radians(32)), False),
    (pair(FLAT, FLAT), False), (pair(SLIPPERY, SLIPPERY), False), (pair(A, A)[:1], False),
])  # fmt: skip
def test_whether_some_wrench_is_not_resisted_at_all(contacts, closed):
    """Margin 1e-9 of the largest wrench, and of the singular values of what the contacts span."""

    def decide(k, R, p):
        C = np.array([contact.wrench_map(*LENGTHS, p) for contact in k])
        D = np.array([contact.body.semi_axes[:, None] * Ci[:, 1:].T for contact, Ci in zip(k, C, strict=True)])
        return separating_wrench(C[:, :, 0], D) is None

    assert outcomes(decide, contacts, 100) == {closed: 100}
