"""Centre lines by closed forms: a bent tube, a mug with its handle, a straight bottle, a hole in the side."""

import numpy as np
import pytest
import trimesh

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.centre_line import centre_line
from softjaw.fem.objects.traced_outline import largest_loops


def bent(radius=0.018, bend=0.15, angle=1.0, around=48, along=80):
    """Tube of a circular section along an arc of radius ``bend`` in the plane y = 0, symmetric about z = 0."""
    t = np.linspace(-angle / 2, angle / 2, along)
    ring = np.linspace(0, 2 * np.pi, around, endpoint=False)
    middle = np.column_stack([bend * (np.cos(t) - 1), 0 * t, bend * np.sin(t)])
    out = np.column_stack([np.cos(t), 0 * t, np.sin(t)])
    points = middle[:, None] + radius * (np.cos(ring)[:, None] * out[:, None] + np.sin(ring)[:, None] * [0, 1, 0])
    i, j = np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij")
    a, b = (i * around + j).ravel(), (i * around + (j + 1) % around).ravel()
    sides = np.concatenate([np.stack([a, b, a + around], 1), np.stack([b, b + around, a + around], 1)])
    ends = [np.stack([np.full(around - 2, s), s + np.arange(1, around - 1), s + np.arange(2, around)], 1)
            for s in (0, (along - 1) * around)]  # fmt: skip
    mesh = trimesh.Trimesh(points.reshape(-1, 3), np.concatenate([sides, ends[0][:, ::-1], ends[1]]), process=False)
    mesh.fix_normals()
    return np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)


def test_the_line_of_a_bent_tube_is_its_arc_and_no_handle_or_cavity_pulls_it_aside():
    points, triangles = bent()
    line = centre_line(points, triangles, 0.025)
    for z in (-0.03, 0.0, 0.03):
        place, tangent = line.at(z)
        t = np.arcsin(z / 0.15)
        # a section across z is not one across the arc: its middle lies off by about radius^2 / bend
        assert place == pytest.approx([0.15 * (np.cos(t) - 1), 0, z], abs=1.5 * 0.018**2 / 0.15)
        assert tangent == pytest.approx([-np.sin(t), 0, np.cos(t)], abs=0.03)
    assert not line.straight
    assert line.radius(-0.03, 0.03) == pytest.approx(0.15, rel=0.1)
    remarks = [line.remark(*where) for where in ((0.0, 0.03), (0.0, 0.17), (0.2, 0.03))]
    assert [bool(remark) for remark in remarks] == [False, True, True]
    moved = line.straightened(points)
    assert np.hypot(*moved[np.abs(points[:, 2]) < 0.04, :2].T) == pytest.approx(0.018, abs=3.5e-3)
    assert line.straightened(moved, -1.0) == pytest.approx(points, abs=1e-15)
    mesh = trimesh.creation.cylinder(0.03, 0.2, sections=64)
    mesh.vertices += 1e-5 * np.random.default_rng(0).normal(size=mesh.vertices.shape)
    line = centre_line(np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64), 0.025)
    assert line.straight
    np.testing.assert_allclose(line.at(0.0123)[0], [0, 0, 0.0123], atol=1e-15)
    body = trimesh.creation.cylinder(0.04, 0.1, sections=64)
    cavity = trimesh.creation.cylinder(0.035, 0.08, sections=64)
    cavity.apply_translation([0.003, 0, 0])
    cavity.invert()
    handle = trimesh.creation.torus(0.02, 0.004)
    handle.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    handle.apply_translation([0.07, 0, 0])
    mug = trimesh.util.concatenate([body, cavity, handle])
    points, triangles = np.asarray(mug.vertices), np.asarray(mug.faces, dtype=np.int64)
    middle, loops = largest_loops(points, triangles, np.array([0.001, 0.045]))
    np.testing.assert_allclose(middle, 0.0, atol=1e-9)
    assert loops.tolist() == [3, 1]  # the handle is cut twice; the cavity has no material
    sheet = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0, 0.1]], float)
    with pytest.raises(MeshError):
        centre_line(sheet, np.array([[0, 1, 2]]), 0.02)
