"""Objects solved one after the other in this process: ``python -m tests.objects.solve SEED FOLDER NAME...``.

Every outcome is written as soon as it is known. What takes longer than its limit ends the process wherever it is; the
survey notes that and starts another one for the rest.
"""

from __future__ import annotations

import json
import re
import signal
import sys
import time
from collections import Counter
from contextlib import redirect_stdout
from dataclasses import asdict, dataclass, field
from io import StringIO
from pathlib import Path
from typing import Any

import numpy as np

from softjaw.fem.objects.gap import Pose
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.study import pipeline
from softjaw.study.case.build import build_object, check_object
from softjaw.study.case.candidates import check_candidates, units, with_sampled_grasps
from softjaw.study.case.result import CaseResult
from softjaw.study.cli import main as softjaw
from softjaw.study.flags import flags_in
from softjaw.study.messages import StudyError
from softjaw.study.scene import Scene, SceneError, load_scene
from softjaw.study.scene.text import toml_text
from tests.objects.bad_meshes import bad_meshes
from tests.objects.random_scenes import random_scene

LIMIT = 240.0  # CPU time of an object [s]
STALLED = 10  # times as much time on the clock
FORMATS = ("stl", "obj", "ply", "off", "glb", "3mf")
COARSE = (
    "gripper.elements=[10, 6, 4]", "accuracy.meshes=1", "load.normal_force_n=[5]", "candidates.sampled=3",
    "run.patches='none'",
)  # fmt: skip
FACE = (81, 45)  # points of a pad's face that are asked whether they lie inside
RANDOM = 50  # scenes of shapes without a mesh


@dataclass
class Outcome:
    """What became of an object; ``inside`` is how deep a pad starts inside the triangles, at most [m]."""

    name: str
    kind: str
    seconds: float = 0.0
    cases: int = 0
    solved: int = 0
    flags: dict[str, int] = field(default_factory=dict)
    failures: list[tuple[str, str]] = field(default_factory=list)
    refused: str = ""
    inside: float = 0.0
    notes: list[str] = field(default_factory=list)

    def save(self, folder: Path) -> None:
        (folder / f"{file_name(self.name)}.json").write_text(json.dumps(asdict(self), indent=1))

    @staticmethod
    def load(file: Path) -> Outcome:
        return Outcome(**json.loads(file.read_text()))


def file_name(name: str) -> str:
    return re.sub(r"[^\w.]+", "-", name)


def objects(seed: int) -> dict[str, str]:
    """Kind of every object of the survey by its name."""
    scenes = {f"scene {k}": f"random {random_scene(seed, k)[0]}" for k in range(RANDOM)}
    return {name: kind for name, (kind, _) in bad_meshes(seed).items()} | scenes


def scene_of(name: str, seed: int, folder: Path) -> Scene:
    """The scene of an object: of a mesh as `softjaw init` writes it, on coarse pads."""
    path = folder / f"{file_name(name)}.toml"
    if name.startswith("scene "):
        path.write_text(toml_text(random_scene(seed, int(name[6:]))[1]))
        return load_scene(path)
    made = bad_meshes(seed)
    ending = FORMATS[list(made).index(name) % len(FORMATS)]
    mesh = path.with_suffix(f".{ending}")
    made[name][1]().export(mesh)
    with redirect_stdout(StringIO()):
        code = softjaw(["init", "mesh", "--mesh", str(mesh), "--unit", "m", "-o", str(path), "--force"])
    if code:
        raise StudyError(code, "softjaw init refuses the mesh")
    return load_scene(path, COARSE)


def start_inside(mesh: MeshObject, pose: Pose, size: tuple[float, float, float]) -> float:
    """How far [m] triangles reach past the face of a pad at first touch, as the pad comes to them."""
    x, y = (side * np.linspace(-0.5, 0.5, n) for side, n in zip(size, FACE, strict=False))
    face = np.stack(np.meshgrid(x, y, [0.0], indexing="ij"), axis=-1).reshape(-1, 3)
    far = float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))) + max(size)
    return far - mesh.first_touch(Pose(pose.rotation, pose.origin - far * pose.rotation[:, 2]), face, np.inf)


def solve(outcome: Outcome, seed: int, folder: Path) -> None:
    scene = with_sampled_grasps(scene_of(outcome.name, seed, folder))
    check_object(scene)
    obj: Any = build_object(scene.object)
    outcome.notes = list(getattr(obj, "notes", ()))
    made = units(scene)
    check_candidates(scene)
    for unit in made:
        forces, results = unit.scene.load.normal_force, []
        outcome.cases += len(forces)
        try:
            results += [result for _, result in pipeline.solve_unit(unit)]
        except Exception as error:  # as in a run: the rest of the forces fail
            outcome.failures += [(unit.candidate.label, f"crash: {type(error).__name__}: {error}")]
        for force, result in zip(forces, results, strict=False):
            if not isinstance(result, CaseResult):
                outcome.failures.append((f"{unit.candidate.label}, {force:g} N", result.message))
                continue
            outcome.solved += 1
            words = [flag.word for flag in flags_in(int(result.values["maps/flags"]))]
            outcome.flags = dict(Counter(outcome.flags) + Counter(words))
            if isinstance(obj, MeshObject):
                poses = (contact.pose for contact in result.contacts)
                depth = max(start_inside(obj, pose, unit.scene.gripper.pad_size) for pose in poses)
                outcome.inside = max(outcome.inside, depth)


def solved(name: str, seed: int, folder: Path) -> Outcome:
    start, outcome = time.process_time(), Outcome(name, objects(seed)[name])
    try:
        solve(outcome, seed, folder)
    except (StudyError, SceneError) as error:
        outcome.refused = str(error)
    except Exception as error:  # a crash of the program is what is looked for
        outcome.refused = f"crash: {type(error).__name__}: {error}"
    outcome.seconds = time.process_time() - start
    return outcome


def main(words: list[str]) -> None:
    seed, folder = int(words[0]), Path(words[1])
    for name in words[2:]:
        # the default action of both signals ends the process, also in the middle of compiled code
        signal.setitimer(signal.ITIMER_PROF, LIMIT)
        signal.setitimer(signal.ITIMER_REAL, STALLED * LIMIT)
        solved(name, seed, folder).save(folder)


if __name__ == "__main__":
    main(sys.argv[1:])
