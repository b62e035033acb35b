"""Scans of real objects, whole and spoiled: they load, and grasps are found on them."""

import pytest

from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.study.case.fit import Jaws
from softjaw.study.case.sampler import antipodal_grasps
from softjaw.study.case.task import Task
from tests.objects.bodies import SCANS, hollow_bottle, hollow_bowl, mug, punctured, scan, spoiled

JAWS = Jaws((0.05, 0.022, 0.015), stiffness=8e6, mu=0.8, force=5.0, max_opening=0.085)
MADE = {
    "bottle": lambda: hollow_bottle(0.2, 0.033, 0.014, 0.003),
    "bowl": lambda: hollow_bowl(0.06, 0.004, 0.05),
    "mug": mug,
    "banana with holes": lambda: punctured(scan("banana"), 3),
    "spoiled drill": lambda: spoiled(scan("drill")),
    **{path.stem[8:]: (lambda name=path.stem: scan(name)) for path in sorted(SCANS.glob("*.stl"))},
}


@pytest.mark.parametrize("name", MADE)
def test_it_loads_and_can_be_grasped(name, tmp_path):
    path = tmp_path / "body.stl"
    MADE[name]().export(path)
    obj = MeshObject.from_file(str(path), "m")
    grasps = [g for g in antipodal_grasps(obj.surface(), JAWS, Task(obj.centroid[0]), 6, samples=80) if not g.state]
    assert len(grasps) >= 3
    assert all(g.opening <= JAWS.max_opening for g in grasps)
    lower, upper = obj.bounds
    assert all(((g.point > lower - 0.01) & (g.point < upper + 0.01)).all() for g in grasps)


def test_defects_are_noted(tmp_path):
    path = tmp_path / "body.stl"
    punctured(scan("banana"), 3).export(path)
    assert MeshObject.from_file(str(path), "m").notes
