"""Forces of a candidate on two meshes, on a rigid object and on a thin wall: each by itself, from the coarse one."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pytest

from softjaw.fem.contact.press import Press
from softjaw.fem.errors import ConvergenceError
from softjaw.study import pipeline
from softjaw.study.case.build import build_object
from softjaw.study.case.candidates import units
from softjaw.study.case.result import CaseFailure
from softjaw.study.flags import Flag
from softjaw.study.scene import parse_scene

# Fingers that are no images of each other, so that there are two coarse paths.
SCENE = """
[object]
shape = "revolution"
profile_mm = [[0, 30], [50, 30], [100, 20], [150, 12]]
[gripper]
elements = [8, 4, 2]
[candidates]
poses = [{point_mm = [0, 0, 75], approach = [1, 0, 0.02], long_side = [0, 0, 1]}]
[load]
normal_force_n = [1, 2, 5]
[accuracy]
meshes = 2
[effects]
friction_pressure_coupling = "none"
"""
WALL = ("object.wall_mm=0.8", "effects.object='nonlinear_shell'", "accuracy.wall_element_mm=5",
        "load.normal_force_n=[1, 2, 3]", "gripper.elements=[6, 4, 2]")  # fmt: skip
BOTH = pytest.mark.parametrize("overrides", [(), WALL], ids=["rigid", "wall"])
ROUGH = ("effects.friction_pressure_coupling='tangential'",)


def unit_of(*overrides):
    scene = parse_scene(SCENE, "scene.toml", overrides)
    [unit] = units(scene, lambda point: build_object(point.object).axis_symmetry)
    return unit


@lru_cache
def whole(overrides):
    """All forces in one go."""
    return dict(pipeline.solve_unit(unit_of(*overrides)))


def bits(result):
    """Everything of a case but its times."""
    values = {k: np.asarray(v).tobytes() for k, v in result.values.items() if not k.startswith("work/seconds")}
    return values, {k: v.tobytes() for k, v in result.patch.items()}, result.message, result.effects


@pytest.mark.parametrize("overrides", [(), ROUGH, WALL], ids=["rigid", "friction", "wall"])
def test_a_force_has_the_same_bits_whichever_others_are_asked_for(overrides):
    assert list(whole(overrides)) == [0, 1, 2]
    for wanted in ([2], [1], (2, 0)) if not overrides else ([2], [1]):
        found = dict(pipeline.solve_unit(unit_of(*overrides), wanted))
        assert list(found) == sorted(wanted)
        for k, result in found.items():
            assert bits(result) == bits(whole(overrides)[k])


@BOTH
def test_the_fine_mesh_has_the_state_that_it_has_along_a_load_path(overrides):
    names = ["maps/e_n", "maps/quality", "maps/p_max", "maps/closing", "fingers/f_x_max"]
    names += ["maps/indentation", "maps/wall_stress", "maps/support_force", "wall/place"] if overrides else []
    for k, alone in pipeline.solve_unit(unit_of(*overrides, "accuracy.meshes=1")):
        both = whole(overrides)[k].values
        assert max(both["work/load_steps"]) == 1
        errors = ["e_n", "closing", "indentation", "wall_stress", "wall_strain"][: 5 if overrides else 2]
        assert all(0.0 < both[f"maps/{name}_error"] < 1.5 for name in errors)
        # one mesh cannot tell that it is coarse by the error of e_n
        assert both["maps/flags"] & ~Flag.COARSE == alone.values["maps/flags"] & ~Flag.COARSE
        for name in names:
            assert both[name] == pytest.approx(alone.values[name], rel=1e-8, abs=1e-9), name


def test_a_failure_at_one_force_leaves_the_others_alone(monkeypatch):
    at, expected = Press.at, whole(())

    def fails(press, force, coarse):
        if force == 2.0:
            raise ConvergenceError("the pad is compressed too far")
        return at(press, force, coarse)

    monkeypatch.setattr(Press, "at", fails)
    found = dict(pipeline.solve_unit(unit_of()))
    assert isinstance(found[1], CaseFailure)
    for k in (0, 2):
        assert bits(found[k]) == bits(expected[k])


def test_where_the_coarse_path_ends_the_fine_mesh_is_solved_and_its_error_is_unknown(monkeypatch):
    load_path, expected = Press.load_path, whole(())

    def ends(press, forces):
        yield next(load_path(press, forces))
        raise ConvergenceError("the force stays below 2 N")

    monkeypatch.setattr(Press, "load_path", ends)
    found = dict(pipeline.solve_unit(unit_of()))
    assert bits(found[0]) == bits(expected[0])
    for k in (1, 2):
        assert "maps/e_n_error" not in found[k].values
        assert "the force stays below 2 N" in found[k].message
        assert min(found[k].values["work/load_steps"]) > 1
        for name in ("maps/e_n", "maps/quality", "maps/closing"):
            assert found[k].values[name] == pytest.approx(expected[k].values[name], rel=1e-8), name
        assert not found[k].values["maps/flags"] & Flag.JUMPED


def test_forces_are_apart_on_two_meshes():
    for overrides in ((), WALL, ("effects.friction_pressure_coupling='tangential'",)):
        assert unit_of(*overrides).apart
        assert not unit_of(*overrides, "accuracy.meshes=1").apart
