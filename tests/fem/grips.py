"""Thin-walled cylinders between two fingers, small enough for tests."""

from functools import cache, partial

import numpy as np

from softjaw.fem.materials import material
from softjaw.fem.objects.gap import Pose
from softjaw.fem.objects.outer_surface import of_revolution
from softjaw.fem.objects.revolution import Revolution
from softjaw.fem.shell.grip import Grip
from softjaw.fem.shell.thin_walled import ThinWalled, grasp, wall_between
from softjaw.fem.shell.wall_material import WallMaterial, wall_material
from softjaw.fem.shell.wall_mesh import MeshSize
from softjaw.fem.shell.wall_problem import WallProblem
from tests.fem import reference
from tests.fem.reference import dense, placed

SIZE = (0.03, 0.02, 0.02)
COARSE = MeshSize(0.003, 0.005, 0.010)
FOAM = 24e3  # shear modulus of the pads [Pa]
e_n = partial(reference.e_n, model="pcm")


@cache
def can() -> Revolution:
    z = [0.0, 0.003, 0.05, 0.1, 0.150, 0.180, 0.190, 0.205]
    return Revolution(np.column_stack([z, [0.033, 0.035, 0.035, 0.035, 0.035, 0.013, 0.013, 0.013]]))


def thin(thickness: float = 4e-4, law: WallMaterial | None = None, support: str = "standing") -> ThinWalled:
    return ThinWalled(of_revolution(can()), thickness, law or wall_material("pet"), support)


def pose(theta: float, z: float, radius: float = 0.035) -> Pose:
    c, s = np.cos(theta), np.sin(theta)
    approach, long_side = np.array([-c, -s, 0.0]), np.array([0.0, 0.0, 1.0])
    rotation = np.column_stack([long_side, np.cross(approach, long_side), approach])
    return Pose(rotation, np.array([0.0, 0.0, z]) - radius * approach)


def grip(
    body: ThinWalled, z=0.075, elements=(6, 4, 3), allowed=(True, True), level="nonlinear", mesh=COARSE, theta=0.0,
    radius=0.035, mu=None,
) -> Grip:  # fmt: skip
    poses = pose(theta, z, radius), pose(theta + np.pi, z, radius)
    held = grasp(body, poses, allowed)
    model, walls = wall_between(body, held, SIZE, mesh, linear=level == "linear")
    pad = reference.pad_of(elements, held.pad_symmetry, law=material("blatz_ko", FOAM), size=SIZE)
    pads = [(pad, gap_at(p), p, wall) for p, wall in zip(held.poses, walls, strict=True)]
    return Grip([lambda: WallProblem(model, pads, mu)])


def gap_at(at: Pose):
    return placed(can(), at)


def stirred(problem: WallProblem, rng: np.random.Generator) -> np.ndarray:
    """Unknowns of pads that are pressed 1.5 mm into the wall, all of them moved at random."""
    x = np.zeros(problem.size)
    x[: problem.model.size] = 2e-6 * rng.normal(size=problem.model.size)
    for f in problem.fingers:
        part, pad = x[f.unknowns], f.pad
        u = 2e-5 * rng.normal(size=pad.dofs.shape) + [0, 0, 1.5e-3]
        part[pad.dofs[pad.dofs >= 0]] = u[pad.dofs >= 0]
        part[pad.closing_dof] = 1.5e-3
        part[pad.closing_dof + 1 :] = 4e-4 * np.abs(rng.normal(size=len(pad.node_area)))
    return x


def check_tangent(problem: WallProblem, x: np.ndarray, h: float, within: float) -> None:
    """Compare the tangent with central differences of ``h`` for the wall's and each finger's unknowns, part by part."""
    K, rng = dense(problem, x), np.random.default_rng(2)
    parts = [slice(0, problem.model.size), *(f.unknowns for f in problem.fingers)]
    for moved in parts:
        step = np.zeros(problem.size)
        step[moved] = rng.normal(size=step[moved].size)
        change = (problem.residual(x + h * step) - problem.residual(x - h * step)) / (2 * h)
        assert np.abs(change - K @ step).max() <= within * np.abs(change).max() + 1e-3
