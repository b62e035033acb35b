"""Load at which a finger slips in MuJoCo, beside what the result file predicts: grasps x forces x five loads.

    python jobs/mujoco-slip.py results/slip.hdf

Every model is the one that `softjaw export --format mjcf` writes. Its object is held fast without weight, the finger is
pressed along its contact normal and gets the freedom to slide and to turn about it, and a load in its contact frame is
raised from nothing until it moves.
Needs ``pip install mujoco``.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import mujoco
import numpy as np

from softjaw.study.export.point_contact import cell
from softjaw.study.export.rigid_body import RigidBody, body_of
from softjaw.study.export.selection import GripperFrame, RankedGrasp, grasps
from softjaw.study.export.simulators import as_mjcf
from softjaw.study.grippers import Hand
from softjaw.study.result.read import open as open_result

# Shares of the largest f_x, f_y and tau_z in a load.
LOADS = {
    "f_x": (1, 0, 0),
    "f_y": (0, 1, 0),
    "tau_z": (0, 0, 1),
    "f_x, tau_z": (1, 0, 1),
    "f_x, f_y, tau_z": (1, 1, 1),
}
STEPS, TOP = 2000, 1.5  # of 1 ms, from no load to so many times the predicted one
MOVES = (1e-4, 1e-4, 1e-2)  # speeds [m/s, m/s, rad/s] from which a finger slips
FREE = (("x", "mjJNT_SLIDE", (1, 0, 0)), ("y", "mjJNT_SLIDE", (0, 1, 0)), ("turn", "mjJNT_HINGE", (0, 0, 1)))


def fixture(grasp: RankedGrasp, body: RigidBody, finger: int) -> mujoco.MjModel:
    """The exported model with a fast object, and a finger that can slide along x and y and turn about its normal."""
    spec = mujoco.MjSpec.from_string(as_mjcf(grasp, body))
    spec.delete(spec.joint("object"))
    spec.delete(spec.equality("drive"))
    spec.option.gravity = [0, 0, 0]
    spec.joint(f"close{finger}").axis = [0, 0, 1]
    spec.actuator(f"press{finger}").biasprm[0] = cell(grasp).contacts[finger - 1].F_N
    for name, kind, axis in FREE:
        spec.body(f"finger{finger}").add_joint(name=name, type=getattr(mujoco.mjtJoint, kind), axis=axis)
    return spec.compile()


def slip(model: mujoco.MjModel, load: np.ndarray, steps: int = STEPS) -> float:
    """Multiple of a load ``(f_x, f_y, tau_z)`` [N, N, N m] at which the finger slips; inf where it never does."""
    data = mujoco.MjData(model)
    dofs = [model.joint(name).dofadr[0] for name, *_ in FREE]
    for _ in range(300):  # until the finger presses
        mujoco.mj_step(model, data)
    for i in range(steps):
        data.qfrc_applied[dofs] = (at := TOP * (i + 1) / steps) * load
        mujoco.mj_step(model, data)
        if (np.abs(data.qvel[dofs]) > MOVES).any():
            return at
    return float("inf")


def predicted(grasp: RankedGrasp, finger: int, shares: tuple[int, ...]) -> np.ndarray:
    """The load ``(3,)`` with these shares that lies on the ellipsoid from three motions [N, N, N m]."""
    contact = cell(grasp).contacts[finger - 1]
    w = np.asarray(shares) / np.linalg.norm(shares)
    return w * contact.F_N * np.array([contact.mu_x, contact.mu_y, contact.r])


def ratios(grasp: RankedGrasp, body: RigidBody, finger: int = 1, steps: int = STEPS) -> list[float]:
    """Simulated over predicted load of every one of `LOADS`."""
    model = fixture(grasp, body, finger)
    return [slip(model, predicted(grasp, finger, shares), steps) for shares in LOADS.values()]


def rows(file: str, count: int = 5) -> Iterator[list[str]]:
    """Lines of the table: the first ``count`` grasps at every force."""
    ds = open_result(file)
    for force in ds.normal_force.values:
        for grasp in grasps(ds, GripperFrame(Hand(closing="x")), force=float(force), top=count):
            contact = cell(grasp).contacts[0]
            place = grasp.place.rpartition(",")[0]
            axes = [contact.mu_x * contact.F_N, contact.mu_y * contact.F_N, 1e3 * contact.r * contact.F_N]
            found = [f"{value:.3f}" for value in ratios(grasp, body_of(ds, grasp.case))]
            yield [place, f"{force:g}", *(f"{value:.3f}" for value in axes), *found]


def main() -> None:
    """Print the table in Markdown."""
    head = ["grasp", "force [N]", "f_x [N]", "f_y [N]", "tau_z [N mm]", *LOADS]
    print("| " + " | ".join(head) + " |\n|" + "---|" * len(head))
    worst = 0.0
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    for row in rows(sys.argv[1]):
        print("| " + " | ".join(row) + " |", flush=True)
        worst = max(worst, *(abs(float(value) - 1) for value in row[-len(LOADS) :]))
    print(f"\nlargest difference: {100 * worst:.2f} %")


if __name__ == "__main__":
    main()
