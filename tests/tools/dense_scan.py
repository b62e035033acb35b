"""The best payload of an object over a dense scan of grasps, which `tests/objects/test_best_payload.py` compares with.

    PYTHONPATH=. python tests/tools/dense_scan.py [NAME ...]

writes ``tests/data/dense_scan.json``. Grasps stand square on points that are spread over the surface, at four rolls;
nothing straightens or thins them, and no payload decides where they are. All that fit and do not slip are judged on a
bed of springs; the best of them, and as many others at random, are solved on a coarse mesh of the pads. The best one of
these has its payload on the mesh of ``init``: the largest of many on a coarse one is large by chance, too.
"""

import json
import math
import sys
import tempfile
from pathlib import Path

import numpy as np
import trimesh

import softjaw as sj
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.friction.patch import NoContactError
from softjaw.study import cli, ranking
from softjaw.study.case.bed import JawsOnSurface
from softjaw.study.case.build import build_object, own_frame, surface_triangles
from softjaw.study.case.evaluate import settings_of
from softjaw.study.case.fit import jaws_of
from softjaw.study.case.poses import explicit_poses, opposed_poses
from softjaw.study.case.sampler import axes_of, judged, sampled
from softjaw.study.case.solver import CandidateSolver, Levels
from softjaw.study.case.task import payload_alone, task_of
from softjaw.study.flags import LOST
from softjaw.study.result.read import values_of
from softjaw.study.scene import Scene
from softjaw.study.scene.grasps import GraspPose
from softjaw.study.scene.sections import FINE
from tests.objects.bodies import SCANS, hollow_bowl

TABLE = Path(__file__).parent.parent / "data" / "dense_scan.json"
PLACES, ROLLS, SOLVED, SEED = 400, 4, 40, 2026
RIGID = Levels("rigid", "rigid", "none")
FAILURES = (ArithmeticError, ConvergenceError, CheckError, NoContactError, RuntimeError, ValueError)


def box(size, at=(0.0, 0.0, 0.0)):
    return trimesh.creation.box(extents=size, transform=trimesh.transformations.translation_matrix(at))


def joined(*parts):
    return trimesh.util.concatenate(parts)


BODIES = {
    "box": lambda: box((0.04, 0.06, 0.12)),
    "long box": lambda: box((0.03, 0.05, 0.26)),
    "cylinder": lambda: trimesh.creation.cylinder(radius=0.03, height=0.12, sections=96),
    "plate": lambda: box((0.12, 0.08, 0.006)),
    "L": lambda: joined(box((0.12, 0.03, 0.02)), box((0.03, 0.09, 0.02), (0.045, 0.06, 0.0))),
    "hammer": lambda: joined(
        trimesh.creation.cylinder(radius=0.014, height=0.25, sections=64), box((0.11, 0.03, 0.03), (0.01, 0.0, 0.13))
    ),
    "bowl": lambda: hollow_bowl(0.06, 0.004, 0.05),
    **{path.stem[8:]: (lambda path=path: trimesh.load(path)) for path in sorted(SCANS.glob("*.stl"))},
}


def scene_of(name, folder):
    """The scene that ``init`` writes for a body, at one force and on one mesh of the pads."""
    path = Path(folder) / "body.stl"
    BODIES[name]().export(path)
    return Scene.from_dict({
        "object": {"shape": "mesh", "mesh": str(path), "unit": "m"},
        "gripper": {"max_opening_mm": 85, "elements": [16, 8, 5]},
        "candidates": {"sampled": 20},
        "load": {"normal_force_n": [10]},
        "accuracy": {"meshes": 1},
    })  # fmt: skip


def payload_at(scene, poses):
    """Payload of a grasp on the coarse mesh, without friction that acts back [kg]; 0 where it has none."""
    try:
        solver = CandidateSolver(scene, poses)
        contacts = solver.solve(0, FINE, RIGID).contacts
        settings = settings_of(scene, build_object(scene.object))
        payload = payload_alone(contacts, settings.surface.samples, settings.task)["maps/payload"]
        solver.put_away()
    except FAILURES:
        return 0.0
    return payload


def best_of_run(name, folder):
    """Best payload at 10 N in the result of ``init`` and ``run`` with their defaults [kg]."""
    mesh, scene, result = (str(Path(folder) / f"run.{end}") for end in ("stl", "toml", "hdf"))
    BODIES[name]().export(mesh)
    assert cli.main(["init", "mesh", "--mesh", mesh, "--unit", "m", "-o", scene]) == 0
    assert cli.main(["run", scene, "-o", result, "--set", "load.normal_force_n=[10]"]) in (0, 6)
    ds = sj.open(result)
    return float(np.nanmax(np.where(ranking.judged(ds) & LOST, np.nan, values_of(ds, "payload"))))


def scanned(scene):
    """Best payload of the dense scan [kg], and the grasp that has it: point [mm], approach, long side."""
    obj, jaws = build_object(scene.object), jaws_of(scene)
    points, triangles = (np.ascontiguousarray(part) for part in surface_triangles(scene.object))
    task, corners = task_of(scene, obj), points[triangles]
    coarse = scene.with_values({"gripper.elements": [10, 6, 4]})
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    seen = []
    for place, normal in sampled(corners, normals, PLACES, SEED):
        axes = axes_of(-normal, np.array([0.0, 0.0, 1.0]))
        for roll in np.arange(ROLLS) * math.pi / ROLLS:
            c, s = math.cos(roll), math.sin(roll)
            turned = axes @ np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
            try:
                grasp = judged(JawsOnSurface((points, triangles), place, turned, jaws), task)
            except NoContactError:
                continue
            if not grasp.state:
                seen.append((grasp.payload, place, turned))
    order = sorted(range(len(seen)), key=lambda i: -seen[i][0])
    others = np.random.default_rng(SEED).permutation(order[SOLVED:])[:SOLVED].tolist()
    best = (0.0, None)
    for i in order[:SOLVED] + others:
        _, place, axes = seen[i]
        payload = payload_at(coarse, opposed_poses(place, axes[:, 2], axes[:, 0]))
        if payload > best[0]:
            placed = own_frame(scene.object)
            mm = [round(1e3 * float(x), 1) for x in placed.to_object(place)]
            sides = [[round(float(v), 3) for v in placed.rotation @ axes[:, k]] for k in (2, 0)]
            best = (payload, [mm, *sides])
    return (solved_again(scene, best[1]), best[1]), len(seen)


def solved_again(scene, grasp):
    """Payload of a grasp of the table in a scene [kg]."""
    point, approach, long_side = map(tuple, grasp)
    pose = GraspPose(point_mm=point, approach=approach, long_side=long_side)
    return payload_at(scene, explicit_poses(pose, own_frame(scene.object)))


def main(names):
    table = json.loads(TABLE.read_text()) if TABLE.exists() else {}
    for name in names or BODIES:
        with tempfile.TemporaryDirectory() as folder:
            scene = scene_of(name, folder)
            (payload, grasp), count = scanned(scene)
            run = best_of_run(name, folder)
        table[name] = {"payload_kg": round(payload, 4), "grasp": grasp, "usable": count, "run_kg": round(run, 4)}
        print(f"{name}: {payload:.4f} kg of {count} usable grasps, a run: {run:.4f}, {run / payload:.3f}", flush=True)
        TABLE.write_text(json.dumps(table, indent=1) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
