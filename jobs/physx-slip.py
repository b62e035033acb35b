"""Friction of a sliding and turning finger in PhysX, beside what the result file predicts.

    python jobs/physx-slip.py results/slip.hdf

A ball with the friction and the torsional patch radius of `softjaw export --format physx` is pressed on a fixed plate
and pulled with OVER times the load that it should carry; what friction takes of the load follows from its acceleration.
PhysX is the one inside SAPIEN (``pip install sapien``), with the TGS solver.
"""

from __future__ import annotations

import sys

import numpy as np
import sapien
from sapien import physx

from softjaw.study.export.point_contact import RADIUS, PointContact, cell
from softjaw.study.export.selection import GripperFrame, grasps
from softjaw.study.grippers import Hand
from softjaw.study.result.read import open as open_result

LOADS = {"slide": (1, 0), "torque": (0, 1), "slide, torque": (1, 1)}  # shares of mu F_N and of tau_z
OVER, STEP, PRESSED, PULLED = 2.0, 1e-3, 300, 40
MASS, INERTIA = 0.02, 1e-3  # [kg, kg m^2]; PhysX turns nothing faster than 100 rad/s
FREE_BUT_TILT = [False, False, False, True, True, False]


def scene(contact: PointContact) -> tuple[sapien.Scene, physx.PhysxRigidDynamicComponent]:
    """A plate at z > 0, and a ball below it that cannot tilt."""
    settings = physx.PhysxSceneConfig()
    settings.gravity, settings.enable_tgs = [0, 0, 0], True
    physx.set_scene_config(settings)
    system = physx.PhysxCpuSystem()
    system.timestep = STEP
    made, material = sapien.Scene([system]), physx.PhysxMaterial(contact.mu, contact.mu, 0.0)
    plate, fixed = sapien.Entity(), physx.PhysxRigidStaticComponent()
    fixed.attach(physx.PhysxCollisionShapeBox([5.0, 5.0, 0.1], material))
    ball, body = sapien.Entity(), physx.PhysxRigidDynamicComponent()
    shape = physx.PhysxCollisionShapeSphere(RADIUS, material)
    shape.set_min_patch_radius(contact.r / contact.mu)
    body.attach(shape)
    for entity, component, height in ((plate, fixed, 0.1), (ball, body, -RADIUS)):
        entity.add_component(component)
        entity.set_pose(sapien.Pose([0, 0, height]))
        made.add_entity(entity)
    body.mass, body.inertia = MASS, [INERTIA] * 3
    body.set_locked_motion_axes(FREE_BUT_TILT)
    body.set_linear_damping(0.0)
    body.set_angular_damping(0.0)
    return made, body


def ratios(contact: PointContact) -> dict[str, tuple[float, float]]:
    """Friction force and torque over the predicted largest ones, of every load."""
    largest = contact.F_N * np.array([contact.mu, contact.r])
    found = {}
    for name, shares in LOADS.items():
        made, body = scene(contact)
        f, tau = OVER * largest * shares
        speeds = []
        for i in range(PRESSED + PULLED):
            pull = i >= PRESSED
            body.add_force_torque([f * pull, 0, contact.F_N], [0, 0, tau * pull])
            made.physx_system.step()
            speeds.append((body.linear_velocity[0], body.angular_velocity[2]))
        growth = np.diff(speeds, axis=0)[-PULLED // 2 :].mean(axis=0) / STEP
        carried = np.array([f, tau]) - growth * [MASS, INERTIA]
        found[name] = (float(carried[0] / largest[0]), float(carried[1] / largest[1]))
    return found


def main() -> None:
    """Print a line for each of the first five grasps at every force."""
    ds, worst = open_result(sys.argv[1]), 0.0
    for force in ds.normal_force.values:
        for grasp in grasps(ds, GripperFrame(Hand(closing="x")), force=float(force), top=5):
            found = ratios(cell(grasp).contacts[0])
            print(grasp.place, {name: tuple(f"{v:.3f}" for v in pair) for name, pair in found.items()}, flush=True)
            for pair, shares in zip(found.values(), LOADS.values(), strict=True):
                worst = max(worst, *(abs(v - 1) for v, share in zip(pair, shares, strict=True) if share))
    print(f"largest difference: {100 * worst:.2f} %")


if __name__ == "__main__":
    main()
