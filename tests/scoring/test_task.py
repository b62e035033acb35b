"""Loads that grasps hold: statics on paper, linear programmes for polytopes, and what cannot depend on conventions."""

import math

import numpy as np
import pytest
from scipy.optimize import linprog

from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.bodies import PolytopeBody, fibonacci_vertices, touching_points
from softjaw.scoring.contact import SoftContact, contact_axes
from softjaw.scoring.task import GRAVITY, hold_task, least_grip_force, weight_wrench

A, B = (0.8, 0.6, 0.010), (0.5, 0.9, 0.008)
D = 0.06
DOWN = [0, 0, -1]
BOTH = pytest.mark.parametrize("normal", ["up_to", "fixed"])


def facing(a, b, tilt=0.0):
    """Contacts on the x axis whose own x is the space's z."""
    c, s = math.cos(tilt), math.sin(tilt)
    bodies = [body if hasattr(body, "support") else Ellipsoid(body) for body in (a, b)]
    return [
        SoftContact([side * D / 2, 0, 0], contact_axes([-side * c, s, 0], [0, 0, 1]), body)
        for side, body in zip((-1, 1), bodies, strict=True)
    ]


@BOTH
def test_weight_across_is_shared_as_a_lever_shares_it(normal):
    """Each contact bears the weight in proportion to the other's distance; a share reaches ``f_x F`` first."""
    for x in (-0.02, 0.0, 0.005):
        load = weight_wrench(0.5, DOWN, [x, 0, 0])
        shares = 0.5 * GRAVITY * np.array([0.5 - x / D, 0.5 + x / D])
        least = max(shares / [A[0], B[0]])
        assert least_grip_force(facing(A, B), load, normal=normal) == pytest.approx(least, rel=1e-7)
        result = hold_task(facing(A, B), 10, load, normal)
        assert result.safety_factor == pytest.approx(10 / least, rel=1e-7)
        assert result.gap <= 1e-8 * result.safety_factor


@BOTH
def test_weight_where_both_contacts_slip_at_once(normal):
    """With the centre of mass at ``f_x`` of one to ``f_x`` of the other, ``F = m g / (f_1 + f_2)``."""
    x = D / 2 * (B[0] - A[0]) / (A[0] + B[0])
    load = weight_wrench(0.5, DOWN, [x, 0, 0])
    assert least_grip_force(facing(A, B), load, 1.5, normal) == pytest.approx(1.5 * 0.5 * GRAVITY / 1.3, rel=1e-7)
    assert hold_task(facing(A, B), 10, load, normal).limits == ("slides along x", "slides along x")


@BOTH
def test_weight_beside_the_line_turns_equal_contacts(normal):
    """Half the weight and half its moment for each: ``F = W/2 sqrt(1 / f_x^2 + y^2 / tau^2)``."""
    for y, limit in ((0.003, "slides along x"), (0.03, "turns about its normal")):
        least = 0.5 * GRAVITY / 2 * math.hypot(1 / A[0], y / A[2])
        load = weight_wrench(0.5, DOWN, [0, y, 0])
        assert least_grip_force(facing(A, A), load, normal=normal) == pytest.approx(least, rel=1e-7)
        assert hold_task(facing(A, A), 10, load, normal).limits == (limit, limit)


@BOTH
def test_torque_about_the_line_is_the_sum_of_both(normal):
    result = hold_task(facing(A, B), [10, 10], [0, 0, 0, 1, 0, 0], normal)
    assert result.safety_factor == pytest.approx(10 * (A[2] + B[2]), rel=1e-7)
    assert result.limits == ("turns about its normal", "turns about its normal")
    assert result.motion[3] > 0
    assert np.abs(result.motion[[1, 2, 4, 5]]).max() < 1e-6 * result.motion[3]


def test_a_pull_along_the_line_is_held_unless_the_normal_forces_are_fixed():
    pull = [3.0, 0, 0, 0, 0, 0]
    result = hold_task(facing(A, B), 10, pull)
    assert result.safety_factor == pytest.approx(10 / 3, rel=1e-7)
    assert result.limits == ("lets go", "is pushed back along its normal")
    assert result.motion[0] > 0
    fixed = hold_task(facing(A, B), 10, pull, "fixed")
    assert (fixed.safety_factor, fixed.gap, fixed.holds) == (0, 0, False)
    assert least_grip_force(facing(A, B), pull, normal="fixed") == math.inf


def test_fixed_normal_forces_that_differ_balance_one_pull_only():
    for pull, factor, holds in ((2.0, 1.0, True), (4.0, 0.5, False), (-2.0, 0.0, False)):
        result = hold_task(facing(A, B), [8, 10], [pull, 0, 0, 0, 0, 0], "fixed")
        assert result.safety_factor == pytest.approx(factor, rel=1e-9)
        assert result.holds == holds
    assert not hold_task(facing(A, B), [8, 10], [2, 0, 100, 0, 0, 0], "fixed").holds
    assert hold_task(facing(A, B), [8, 10], [2, 0, 1, 0, 0, 0], "fixed").holds


def test_a_wedge_under_fixed_forces_needs_a_load_to_hold_it_down():
    """Frictionless across the wedge but for f_y: the normal forces push by 2 F sin t, friction takes 2 F f_y cos t."""
    t, f_y, F = 0.3, 0.1, 10.0
    contacts = facing((0.5, f_y, 0.01), (0.5, f_y, 0.01), tilt=t)
    result = hold_task(contacts, F, [0, -1, 0, 0, 0, 0], "fixed")
    push, friction = 2 * F * math.sin(t), 2 * F * f_y * math.cos(t)
    assert result.lowest_factor == pytest.approx(push - friction, rel=1e-6)
    assert result.safety_factor == pytest.approx(push + friction, rel=1e-6)
    assert not result.holds
    assert not hold_task(contacts, F, [0, 1, 0, 0, 0, 0], "fixed").holds


@BOTH
def test_one_contact_alone(normal):
    """A finger below carries a weight up to its grip force; one beside the object carries none."""
    below = [SoftContact([0, 0, 0], contact_axes([0, 0, 1], [1, 0, 0]), Ellipsoid(A))]
    load = weight_wrench(1.0, DOWN)
    assert hold_task(below, GRAVITY, load, normal).safety_factor == pytest.approx(1, rel=1e-7)
    assert hold_task(below, 20, load, normal).holds == (normal == "up_to")
    assert hold_task(facing(A, B)[:1], 10, load, normal).safety_factor == 0


@BOTH
def test_contacts_without_torque_hold_what_makes_none(normal):
    flat = facing((*A[:2], 0), (*A[:2], 0))
    assert hold_task(flat, 10, weight_wrench(0.5, DOWN), normal).safety_factor == pytest.approx(
        2 * A[0] * 10 / (0.5 * GRAVITY), rel=1e-7
    )
    assert hold_task(flat, 10, weight_wrench(0.5, DOWN, [0, 0.001, 0]), normal).safety_factor == 0
    none = facing((0, 0, 0), (0, 0, 0))
    assert hold_task(none, 10, weight_wrench(0.5, DOWN), normal).safety_factor == 0


@BOTH
def test_polytopes_against_a_linear_programme_in_their_vertices(normal):
    contacts = facing(*(PolytopeBody(fibonacci_vertices(axes, 15)) for axes in (A, B)))
    load = weight_wrench(0.5, [0.1 if normal == "up_to" else 0, 0.4, -1], [0.004, 0.01, 0.002])
    columns = []
    for contact in contacts:
        f = 10 * np.hstack([np.ones((15, 1)), contact.body.vertices]) @ contact.wrench_map(1, 1).T
        columns.append(f.T)
    owner = np.repeat(np.eye(3)[:2], [15, 15], axis=0).T
    owner = np.hstack([owner[:2], np.zeros((2, 1))])
    equal = np.hstack([*columns, load[:, None]])
    if normal == "fixed":
        exact = linprog([*np.zeros(30), -1], A_eq=np.vstack([equal, owner]), b_eq=[*np.zeros(6), 1, 1])
    else:
        exact = linprog([*np.zeros(30), -1], A_eq=equal, b_eq=np.zeros(6), A_ub=owner, b_ub=[1, 1])
    assert hold_task(contacts, 10, load, normal).safety_factor == pytest.approx(-exact.fun, rel=1e-7)


class Plain:
    """An ellipsoid that passes for something else."""

    volume = shadow_area = float("nan")

    def __init__(self, semi_axes):
        self.body = Ellipsoid(semi_axes)

    def support(self, t):
        return self.body.support(t) * (1 + 1e-8 * np.cos(7 * np.arctan2(*np.atleast_2d(t).T[:2])))


@BOTH
def test_cutting_planes_agree_with_the_cones(normal):
    load = weight_wrench(0.5, [0, 0.4, -1], [0.004, 0.01, 0.002])
    smooth, cut = (hold_task(facing(a, b), 10, load, normal) for a, b in ((A, B), (Plain(A), Plain(B))))
    assert cut.safety_factor == pytest.approx(smooth.safety_factor, rel=2e-7)
    assert cut.gap <= 1e-6
    np.testing.assert_allclose(
        touching_points(Plain(A), [1.0, 2, 30])[0] @ [1, 2, 30], Ellipsoid(A).support([1, 2, 30])[0], rtol=1e-7
    )


@BOTH
def test_the_factor_depends_on_no_convention(normal):
    """Another frame and origin, a longer load, another unit of length: the same statement."""
    contacts, load = facing(A, B), weight_wrench(0.5, [0, 0.3, -1], [0.002, 0.01, 0])
    factor = hold_task(contacts, 10, load, normal).safety_factor
    Q, shift = contact_axes([1, 2, 3], [1, 0, 0]).T, np.array([0.3, -0.2, 0.1])
    moved = [SoftContact(Q @ k.position + shift, k.axes @ Q.T, k.body) for k in contacts]
    force = Q @ load[:3]
    there = np.concatenate([force, Q @ load[3:] + np.cross(shift, force)])
    assert hold_task(moved, 10, there, normal).safety_factor == pytest.approx(factor, rel=1e-6)
    assert hold_task(contacts, 20, 4 * load, normal).safety_factor == pytest.approx(factor / 2, rel=1e-7)
    milli = [SoftContact(1e3 * k.position, k.axes, Ellipsoid(k.body.semi_axes * [1, 1, 1e3])) for k in contacts]
    assert hold_task(milli, 10, load * np.repeat([1, 1e3], 3), normal).safety_factor == pytest.approx(factor, rel=1e-6)


@BOTH
def test_the_motion_works_against_every_load_the_contacts_can_bear(normal):
    """Virtual work: along the escape the load does 1, and no answer of the contacts takes more than the factor."""
    contacts, load = facing(A, B, tilt=0.05), weight_wrench(0.5, [0, 0.4, -1], [0.004, 0.01, 0.002])
    if normal == "fixed":
        contacts = facing(A, B)
    result = hold_task(contacts, 10, load, normal)
    assert result.motion @ load == pytest.approx(1, rel=1e-9)
    taken = 0.0
    for contact in contacts:
        felt = -result.motion @ contact.wrench_map(1, 1)
        least = felt[0] + contact.body.support(felt[1:])[0]
        taken += 10 * (least if normal == "fixed" else max(0, least))
    assert taken == pytest.approx(result.safety_factor, rel=1e-7)


def test_shaking_adds_inertia():
    """Lifting with g doubles the weight; falling with g leaves nothing to hold."""
    still, lifted = weight_wrench(0.5, DOWN, [0, 0.01, 0]), weight_wrench(0.5, DOWN, [0, 0.01, 0], [0, 0, GRAVITY])
    np.testing.assert_allclose(lifted, 2 * still, rtol=1e-14)
    assert not weight_wrench(0.5, [0, 0, -3], [0, 0.01, 0], [0, 0, -GRAVITY]).any()


def test_least_grip_force_is_the_one_at_which_the_factor_is_reached():
    load = weight_wrench(0.3, [0.2, 0.4, -1], [0.004, 0.01, 0.002])
    F = least_grip_force(facing(A, B), load, 2.0)
    assert hold_task(facing(A, B), F, load).safety_factor == pytest.approx(2, rel=1e-7)
    assert hold_task(facing(A, B), 0.501 * F, load).holds
    assert not hold_task(facing(A, B), 0.499 * F, load).holds


@pytest.mark.parametrize(
    ("call", "match"),
    [
        (lambda: hold_task(facing(A, B), 0, [1, 0, 0, 0, 0, 0]), "normal_forces is"),
        (lambda: hold_task(facing(A, B), 1, np.zeros(6)), "wrench is zero"),
        (lambda: hold_task(facing(A, B), 1, [1, 0, 0]), "wrench is .* expected 6"),
        (lambda: hold_task([], 1, np.ones(6)), "contacts is empty"),
        (lambda: hold_task(facing(A, B), 1, np.ones(6), "free"), "normal is 'free'"),
        (lambda: weight_wrench(0, DOWN), "mass is 0"),
        (lambda: weight_wrench(1, [0, 0, 0]), "direction is zero"),
        (lambda: weight_wrench(1, [0, 0, math.nan]), "direction is"),
        (lambda: least_grip_force(facing(A, B), np.ones(6), 0), "safety_factor is 0"),
    ],
)
def test_bad_arguments_are_named(call, match):
    with pytest.raises(ValueError, match=match):
        call()
