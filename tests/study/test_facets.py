"""Meshes through whole cases: a mirrored mesh gives mirrored results, facets of a ball that of the ball."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from softjaw.study import pipeline
from softjaw.study.case.candidates import units
from softjaw.study.scene import parse_scene

SCENE = """
[object]
{}
[gripper]
pad_length_mm = 30
pad_width_mm = 20
pad_thickness_mm = 12
shear_modulus_kpa = 40
elements = {}
[friction]
mu = 0.8
[candidates]
stations_mm = [{}]
angles_deg = [{}]
[load]
normal_force_n = [2]
"""
pytestmark = pytest.mark.long


def mesh(body, folder, name):
    body.export(folder / f"{name}.stl")
    return f'shape = "mesh"\nmesh = "{folder / name}.stl"\nunit = "mm"'


def solved(shape, elements=(10, 6, 4), station=0.0, angle=0.0):
    scene = parse_scene(SCENE.format(shape, list(elements), station, angle))
    (unit,) = units(scene, lambda point: point.axis_symmetry)
    ((_, result),) = pipeline.solve_unit(unit)
    return result


def test_a_mirrored_mesh_gives_mirrored_results(tmp_path):
    body = trimesh.creation.icosphere(3, 30)
    body.vertices *= [0.7, 0.9, 1.3]
    body.vertices += 0.0015 * body.vertices[:, [1, 2, 0]] * body.vertices[:, [2, 0, 1]]
    # STL files hold numbers of single precision: both meshes have the same
    body.vertices = body.vertices.astype(np.float32)
    other = trimesh.Trimesh(body.vertices * [1, -1, 1], body.faces[:, ::-1], process=False)
    one, two = (
        solved(mesh(own, tmp_path, name), station=35, angle=sign * 20)
        for own, name, sign in ((body, "one", 1), (other, "two", -1))
    )
    names = [name for name in one.values if name in ("maps/quality", "maps/e_n") or "overestimate" in name]
    assert len(names) > 3
    for name in names:
        assert np.asarray(two.values[name]) == pytest.approx(np.asarray(one.values[name]), rel=1e-6), name


def test_a_ball_of_facets_is_the_ball(tmp_path):
    facets = trimesh.creation.uv_sphere(30, count=[25, 48])
    ball = solved('shape = "sphere"\nradius_mm = 30', (20, 14, 6))
    found = solved(mesh(facets, tmp_path, "ball"), (20, 14, 6), station=30)
    assert found.values["maps/quality"] == pytest.approx(ball.values["maps/quality"], rel=5e-3)
