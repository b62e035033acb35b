"""Outcomes of the finite element package that rounding does not decide: meshes, touch, profiles, symmetry, grids."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from softjaw.fem.contact.checks import refuse_fall
from softjaw.fem.contact.friction import FIRST_FORCE, POWER, load_steps
from softjaw.fem.contact.load_stepping import falls
from softjaw.fem.contact.problem import borne
from softjaw.fem.errors import CheckError
from softjaw.fem.objects.gap import NoContactError, Pose, first_touch
from softjaw.fem.objects.outer_surface import Section, of_sections
from softjaw.fem.objects.shapes import Box, Sphere
from softjaw.fem.objects.triangles import cleaned
from softjaw.fem.pad.backing_plate import back_stiffness
from softjaw.fem.pad.shape import BackingPlate
from softjaw.fem.shell.thin_walled import ThinWalled, grasp
from tests.turns import ULPS, seeded, seeds, tries

BODY = ThinWalled(of_sections([Section(z, 0.03) for z in (0.0, 0.05, 0.1)]), 1e-3, None)


def moved(values, seed):
    x = np.asarray(values, float)
    return x + np.abs(x).max() * np.random.default_rng(seed).choice(ULPS, x.shape)


def turned(points, seed):
    """Points at random scale, turned and moved at random, each number off by a few ulp; and the scale."""
    rng = np.random.default_rng(seed)
    scale = rng.uniform(0.03, 0.3)
    R = Rotation.random(random_state=rng).as_matrix()
    return moved(scale * np.asarray(points) @ R.T + rng.uniform(-0.1, 0.1, 3), seed), scale


def outcome(function, *arguments):
    try:
        return function(*arguments)
    except (ValueError, ArithmeticError, CheckError) as error:
        return type(error)


def body(mesh):
    return np.array(mesh.vertices), np.array(mesh.faces)


def union(*bodies):
    return body(trimesh.util.concatenate([trimesh.Trimesh(*mesh, process=False) for mesh in bodies]))


CUBE = body(trimesh.creation.box())
SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.0]])
FLAT_PIECE = SQUARE, np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])


def shifted(body, scale, by=(0.0, 0.0, 0.0)):
    return scale * body[0] + by, body[1]


def volume(points, triangles):
    return trimesh.Trimesh(points, triangles, process=False).volume


TWO_TURNED = CUBE[0], np.concatenate([CUBE[1][:2, ::-1], CUBE[1][2:]])
MESHES = {  # and their volumes, 0 for what is no closed surface
    "closed": (CUBE, 1.0),
    "two turned": (TWO_TURNED, 1.0),
    "inside out": ((CUBE[0], CUBE[1][:, ::-1]), 1.0),
    "inner piece": (union(CUBE, shifted(CUBE, 0.9)), 1.0),
    "two apart": (union(CUBE, shifted(CUBE, 0.5, [0.03, 0.02, 0.76])), 1.125),
    "standing on another": (union(CUBE, shifted(CUBE, 0.5, [0.03, 0.02, 0.75])), 1.125),
    "touching along an edge": (union(CUBE, shifted(CUBE, 0.5, [0.75, 0.75, 0.0])), 1.125),
    "crossing": (union(CUBE, shifted(CUBE, 1.0, [0.5, 0.3, 0.2])), 2.0),
    "thin": ((CUBE[0] * [1, 1, 1e-4], CUBE[1]), 1e-4),
    "open": ((CUBE[0], CUBE[1][1:]), 0.0),
    "flat": (FLAT_PIECE, 0.0),
    "flat beside another": (union(CUBE, shifted(FLAT_PIECE, 0.3, [1, 1, 1])), 0.0),
    "face on a face": (union(CUBE, shifted(CUBE, 1.0, [0.0, 0.0, 1.0])), 0.0),
}


@pytest.mark.parametrize("name", MESHES)
@seeded
def test_a_mesh_is_the_same_in_every_position(name, seed):
    (points, triangles), expected = MESHES[name]
    x, scale = turned(points, seed)
    mesh = cleaned(x, triangles)
    assert mesh.closed == (expected > 0)
    if mesh.closed:
        assert volume(mesh.points, mesh.triangles) == pytest.approx(expected * scale**3, rel=1e-6)


@seeded
def test_corners_that_rounding_of_a_file_moved_apart_are_one(seed):
    """Every triangle has corners of its own, in numbers of single precision; a slit of 1e-4 stays open."""
    x, scale = turned(CUBE[0], seed)
    rng = np.random.default_rng(seed)
    soup = x[CUBE[1]].reshape(-1, 3).astype(np.float32)
    soup = np.nextafter(soup, soup + rng.choice(np.float32([-1, 0, 1]), soup.shape)).astype(float)
    corners = np.arange(len(soup)).reshape(-1, 3)
    points, triangles, *_ = cleaned(soup, corners)
    assert (len(points), len(triangles)) == (8, 12)
    assert volume(points, triangles) == pytest.approx(scale**3, rel=1e-4)
    soup[:3] += 1e-2 * scale  # a hole that is as large as a side
    assert not cleaned(soup, corners).closed


def travel_past(shape, place, seed, reach=20.0):
    """Distance along y until one of three points, the first at ``place``, meets a shape; all of it turned at random."""
    turn = Rotation.random(random_state=np.random.default_rng(seed)).as_matrix()
    body = SimpleNamespace(gap=lambda x: shape.gap(x @ turn))
    R = turn @ [[0, 1, 0], [0, 0, 1], [1, 0, 0.0]]
    row = np.array([[0.0, 0.0, 0.0], [0.0, 0.01, 0.0], [0.01, 0.01, 0.0]])
    return first_touch(body, Pose(moved(R, seed), moved(turn @ place, seed)), row, reach)


@seeded
def test_a_pad_that_passes_at_the_surface_has_no_contact_and_one_that_starts_there_touches_at_once(seed):
    """Past a sphere it has none; along the side of a box it is known to graze."""
    half = np.random.default_rng(seed).uniform(0.01, 0.05)
    ball, box = Sphere(half), Box(np.full(3, 2 * half), 0.1 * half)
    for out in (0.0, 1e-8):
        with pytest.raises(NoContactError):
            travel_past(ball, [0.0, -0.1, half + out], seed, 5.0)
    assert travel_past(ball, [0.0, -0.1, half - 1e-5], seed, 5.0) == pytest.approx(0.1 - np.sqrt(2e-5 * half), abs=1e-5)
    for out in (0.0, 1e-8):
        with pytest.raises(NoContactError):
            travel_past(box, [0.0, -0.1, half + out], seed)
    assert 0.1 - half < travel_past(box, [0.0, -0.1, half - 1e-8], seed) < 0.1 - 0.8 * half
    rng = np.random.default_rng(seed)
    R = Rotation.random(random_state=rng).as_matrix()
    radius = rng.uniform(0.01, 0.05)

    def closing(outside):
        pose = Pose(moved(R, seed), moved(-(radius + outside) * R[:, 2], seed))
        return first_touch(Sphere(radius), pose, np.array([[0.0, 0.0, 0.0], [0.0, 0.005, 0.0]]), 0.5)

    assert closing(0.0) == pytest.approx(0.0, abs=2e-9)
    assert closing(1e-3) == pytest.approx(1e-3, abs=2e-12)
    with pytest.raises(NoContactError):
        closing(-1e-8)


@seeded
def test_a_node_bears_something_or_nothing(seed):
    """What rounding leaves of a pressure is none; tension is kept for the checks, idle or not."""
    scale = np.random.default_rng(seed).uniform(1e2, 1e6)
    noise = scale * np.random.default_rng(seed + 1).uniform(1e-18, 1e-11, 3)
    pressure = np.concatenate([moved(scale * np.array([1.0, 0.5, 1e-8, -1e-3, -1e-3, 0.5]), seed), noise])
    active = np.array([True, True, True, True, False, False, True, True, False])
    assert np.sign(borne(pressure, active)).tolist() == [1, 1, 1, -1, -1, 0, 0, 0, 0]
    assert borne(np.zeros(9), active).tolist() == [0.0] * 9


@seeded
def test_a_force_falls_by_more_than_rounding_and_a_closing_that_stays_is_no_fall(seed):
    """A plateau is no fall, at any force."""
    plateau = np.array([0.5, 1.0, 1.0, 1.0, 1.0, 1.5]) * np.random.default_rng(seed).uniform(1e-2, 1e3)
    assert falls(moved(plateau, seed)) is False
    assert falls(moved(plateau * [1, 1, 1, 1 - 1e-5, 1, 1], seed)) is True
    closing = np.random.default_rng(seed).uniform(1e-4, 1e-2)
    for share, accepted in ((1.0, True), (0.96, True), (0.94, False)):
        before, after = moved([closing, share * closing], seed)
        assert (outcome(refuse_fall, (1.0, before), (2.0, after)) is None) is accepted


@tries
@given(seeds, st.integers(1, 6))
def test_a_force_of_the_path_is_its_last_step(seed, steps):
    """Within rounding: neither a step more to itself nor one less."""
    stiffness = np.random.default_rng(seed).uniform(1.0, 1e3)
    force = float(moved([FIRST_FORCE * stiffness * steps**POWER], seed)[0])
    assert len(load_steps(0.0, force, stiffness)) == steps


@seeded
def test_nodes_on_the_rim_of_the_support_are_held(seed):
    x, y = np.linspace(-0.025, 0.025, 11), np.linspace(-0.011, 0.011, 5)
    scale = np.random.default_rng(seed).uniform(0.3, 3.0)
    support = tuple(scale * np.array([0.020, 0.011]))
    sheet = BackingPlate(1e-3, 2e9, 0.35, tuple(moved(support, seed)))
    quarter, full = ((x[5:], y[2:], (True, True)), (x, y, (False, False)))
    for lines, other, symmetry in (quarter, full):
        back = back_stiffness(tuple(moved(scale * lines, seed)), tuple(moved(scale * other, seed)), symmetry, sheet)
        held = ~back.free.any(axis=-1)
        assert held.sum() == (6 if all(symmetry) else 15)
        assert (~back.free).sum() == 3 * held.sum() + (4 if all(symmetry) else 0)  # of nodes on a plane of symmetry


@seeded
def test_sections_are_round_up_to_rounding(seed):
    rng, n = np.random.default_rng(seed), 4
    z = np.linspace(0.0, 0.1, n) * rng.uniform(0.5, 2.0)
    noise, rise = rng.choice(ULPS, n), np.abs(rng.choice(ULPS, n))

    def order(off=0.0, exponent=0.0, shift=0.0):
        sizes = zip(z, 0.03 * (1 + noise + off), 2.0 + 2 * rise + exponent, [shift, 0, 0, 0], strict=True)
        outer = of_sections([Section(h, 0.03, b, e, (s, 0.0)) for h, b, e, s in sizes])
        return outer.round, outer.symmetric

    assert order() == (True, (True, True))
    assert order(off=1e-6) == order(exponent=1e-6) == (False, (True, True))
    assert order(shift=1e-3) == (False, (False, True))


@tries
@given(seeds, st.integers(-9, 9))
def test_planes_of_symmetry_turn_by_quarters(seed, quarters):
    lopsided, even = (replace(BODY.surface, symmetric=(True, y), round=y) for y in (False, True))
    angle = moved(0.5 * np.pi * np.array([quarters, 9]), seed)[0]
    assert lopsided.turned(angle).symmetric == ((True, False) if quarters % 2 == 0 else (False, True))
    assert lopsided.turned(angle + 1e-8).symmetric == (False, False)
    assert even.turned(angle + 1e-8).symmetric == (True, True)


@seeded
def test_a_grasp_of_a_round_body_has_both_planes_at_every_angle(seed):
    """The pads' long sides up or down; nothing is left of a plane once a pad is off it by 1 um."""
    rng = np.random.default_rng(seed)
    phi, z, up = rng.uniform(-4, 4), rng.uniform(0.02, 0.08), rng.choice([-1.0, 1.0])

    def pose(angle, along, off):
        out, side = np.array([np.cos(angle), np.sin(angle), 0.0]), np.array([-np.sin(angle), np.cos(angle), 0.0])
        R = np.stack([[0.0, 0.0, along], np.cross(-out, [0.0, 0.0, along]), -out], axis=1)
        return Pose(moved(R, seed), moved(0.03 * out + off * side + [0.0, 0.0, z], seed))

    first, second, off = pose(phi, up, 0.0), pose(phi + np.pi, up, 0.0), pose(phi + np.pi, up, 1e-6)
    held = grasp(BODY, (first, second))
    assert held.mirrors == (True, True)
    assert len(held.poses) == 1
    assert held.flipped == (bool(first.rotation[:, 1] @ [-np.sin(phi), np.cos(phi), 0.0] < 0),)
    assert grasp(BODY, (first, off)).mirrors == (False, False)
