"""A grasp lifts its object from a table in MuJoCo, as a row of pictures; three times its payload stays there.

    python jobs/examples/lift.py

The grasp is solved once (10 seconds, on a coarse mesh) and stays in results/lift.hdf. Needs ``pip install mujoco``.
"""

# %% The grasp, and the scene that softjaw writes for it
import subprocess
import sys
from pathlib import Path

import matplotlib.pyplot as plt
import mujoco
import numpy as np
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

import softjaw as sj

FILE, MODEL = Path("results/lift.hdf"), Path("results/lift.xml")
scene = sj.Scene.from_file(Path(__file__).parents[1] / "flask-mesh.toml").with_values(**{
    "gripper.elements": [8, 4, 2],
    "accuracy.meshes": 1,
    "candidates.stations_mm": [60],
    "candidates.angles_deg": [90],
    "load.normal_force_n": [5],
})  # fmt: skip
sj.run(scene, FILE)
subprocess.run([sys.executable, "-m", "softjaw", "export", FILE, "--format", "mjcf", "-o", MODEL], check=True)
payload = float(sj.open(FILE)["payload"].sel(model="ccm").max())

# %% A table below the object, and a hand that rises by 60 mm
RISE, SECONDS, PICTURES = 0.06, 2.0, 5


def lifted(mass):
    """Model, states at the times of the pictures, and how far the object has risen [m], for a mass [kg]."""
    spec = mujoco.MjSpec.from_string(MODEL.read_text())
    up = -spec.option.gravity / np.linalg.norm(spec.option.gravity)
    body = spec.body("object")
    body.fullinertia, body.mass = body.fullinertia * mass / body.mass, mass
    rest = mujoco.MjData(model := spec.compile())
    mujoco.mj_forward(model, rest)
    low = min(corners(model, rest, "object") @ up)
    turn = np.array([1 + up[2], -up[1], up[0], 0.0])  # from z to up
    spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.15, 0.15, 0.01], pos=low * up,
                            quat=turn / np.linalg.norm(turn))  # fmt: skip
    hand = spec.body("hand")
    hand.add_joint(name="rise", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=up)
    hand.mass, hand.inertia, hand.gravcomp = 1.0, [1e-3] * 3, 1.0
    hand.explicitinertial = True
    lift = spec.add_actuator(name="rise", target="rise", trntype=mujoco.mjtTrn.mjTRN_JOINT)
    lift.set_to_position(kp=1e5, dampratio=1.0)
    model = spec.compile()
    data, states = mujoco.MjData(model), []
    for picture in range(PICTURES):
        for _ in range(round(SECONDS / (PICTURES - 1) / model.opt.timestep) * (picture > 0)):
            data.actuator("rise").ctrl = RISE * min(1.0, data.time / (0.75 * SECONDS))
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        states.append([corners(model, data, name) for name in ("object", "foam1", "foam2")])
    return states, up, low, (data.body("object").xpos - rest.body("object").xpos) @ up


def corners(model, data, name):
    """Points of the object's mesh or of a pad's box in space."""
    geom = model.geom(name)
    if name == "object":
        mesh = model.mesh("object")
        points = model.mesh_vert[mesh.vertadr[0] : mesh.vertadr[0] + mesh.vertnum[0]]
    else:
        points = geom.size * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    return points @ data.geom(name).xmat.reshape(3, 3).T + data.geom(name).xpos


# %% Light objects rise, heavy ones do not
faces = mujoco.MjModel.from_xml_path(str(MODEL)).mesh_face
BOX = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
figure = plt.figure(figsize=(11, 5.6), layout="tight")
for row, share in enumerate((0.9, 3.0)):
    states, up, low, height = lifted(share * payload)
    print(f"{1e3 * share * payload:.0f} g, {share:g} times the payload, rose by {1e3 * height:.1f} mm")
    side = np.linalg.svd(up[None])[2][1:]  # two directions along the table
    for k, (body, *pads) in enumerate(states):
        axes = figure.add_subplot(2, PICTURES, row * PICTURES + k + 1, projection="3d")
        view = np.vstack([side, up]).T
        axes.add_collection3d(Poly3DCollection((body @ view)[faces], facecolors="#d9a066", shade=True))
        for pad in pads:
            sides = [(pad @ view)[face] for face in BOX]
            axes.add_collection3d(Poly3DCollection(sides, facecolors="#5f7a91", alpha=0.8))
        axes.set(xlim=(-0.06, 0.06), ylim=(-0.06, 0.06), zlim=(low, low + 0.18), xticks=[], yticks=[], zticks=[],
                 title=f"{share:g} x payload, {SECONDS * k / (PICTURES - 1):.1f} s")  # fmt: skip
        axes.set_box_aspect((2, 2, 3))
figure.savefig("results/lift.png", dpi=120)
print("drawn: results/lift.png")
