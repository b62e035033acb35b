"""One force on a thin wall by itself, from the state of a coarser mesh: the state of the load path, to the bit."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from softjaw.fem.shell.wall_mesh import MeshSize, body_mesh, interpolated
from tests.fem.grips import grip, thin

FORCES = (0.5, 2.0)
FINE = MeshSize(0.004, 0.008, 0.016)
SYMMETRIES = [(True, True), (True, False), (False, True), (False, False)]


def pressed(coarser=False, allowed=(True, True), thickness=4e-4, z=0.142):
    mesh, elements = (FINE.halved(), (4, 2, 1)) if coarser else (FINE, (6, 4, 2))
    return grip(thin(thickness), z, elements, allowed, mesh=mesh)


@cache
def starts(allowed=(True, True), **where):
    return tuple(pressed(True, allowed, **where).load_path(FORCES))


@cache
def ladder():
    return tuple(pressed().load_path(FORCES))


def apart(found, expected):
    one, other = (np.concatenate([s.wall.q, *(f.unknowns for f in s.fingers)]) for s in (found, expected))
    return np.abs(one - other).max() / expected.fingers[0].closing


@pytest.mark.parametrize("symmetry", SYMMETRIES)
def test_a_wall_is_interpolated_onto_the_same_mesh_and_onto_another(symmetry):
    """A squeeze to an oval, leaning more and more along the wall; directors turn with it and keep their length."""
    surface = thin().surface

    def state(mesh):
        theta, s = (np.broadcast_to(g, mesh.number.shape) for g in (mesh.theta[:, None], mesh.s))
        u, turned = np.empty((2, len(mesh.X), 3))
        part = 0.05 * np.sin(2.0 * s / mesh.s[-1])
        u[mesh.number] = 0.03 * np.stack([-part * np.cos(theta), part * np.sin(theta), part**2], -1)
        axis = part * np.sin(2 * theta)
        x, y, z = (mesh.D[mesh.number][..., i] for i in range(3))
        c, t = np.cos(axis), np.sin(axis)
        turned[mesh.number] = np.stack([c * x - t * y, t * x + c * y, z], -1)
        return np.hstack([u, turned - mesh.D]).ravel()

    one, other = (
        body_mesh(surface, 4e-4, MeshSize(heights=(0.05, 0.1), around=h, along=2 * h, coarse=3 * h), planes)
        for h, planes in ((0.003, symmetry), (0.002, (False, True)))
    )
    assert interpolated(one, state(one), one) == pytest.approx(state(one), abs=1e-17)
    assert interpolated(one, state(one), other) == pytest.approx(state(other), abs=2e-6)


def test_every_force_by_itself_leads_to_the_state_of_the_load_path():
    fine = pressed()
    for start, expected in zip(starts(), ladder(), strict=True):
        found = fine.at(start.force, [start])
        assert (found.fingers[0].steps, found.fingers[0].halvings) == (1, 0)
        assert found.fingers[0].iterations <= 7
        assert apart(found, expected) < 1e-8
        assert found.wall.opening == pytest.approx(expected.wall.opening, rel=1e-8)


@pytest.mark.parametrize(
    "start", ["none", "lower", *(pytest.param(own, marks=pytest.mark.long) for own in ("jumped", "far off"))]
)
def test_a_start_that_does_not_serve_is_replaced_by_one_below_or_by_first_contact(start):
    low, good = starts()
    far = good.unknowns + np.eye(good.pad.size)[good.pad.closing_dof] * 9e-3
    given = {
        "none": [], "lower": [low],
        "jumped": [replace(good, path_dependent=True), low],
        "far off": [replace(good, unknowns=far, wall=replace(good.wall, q=0 * low.wall.q))],
    }  # fmt: skip
    found = pressed().at(2.0, given[start])
    assert found.fingers[0].steps > 1
    assert apart(found, ladder()[1]) < 1e-8
    assert not found.path_dependent


@pytest.mark.long
def test_a_wall_that_gives_way_is_found_where_its_own_load_path_leads():
    """The finer mesh gives way earlier than the coarser one, and levels between start on the other side of that."""
    forces, where = (0.5, 1.5, 2.5, 3.0), {"thickness": 3e-4, "z": 0.075}
    coarse, expected = (list(pressed(coarser, **where).load_path(forces)) for coarser in (True, False))
    fine = pressed(**where)
    assert expected[-1].wall.snapped
    for k, own in enumerate(expected):
        found = fine.at(own.force, coarse[k::-1][:3])
        assert apart(found, own) < 1e-8
        assert found.path_dependent == own.path_dependent
