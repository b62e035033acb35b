"""A planner that asks for the best reachable grasp, and for the friction there. After the map it needs no PETSc.

    python jobs/examples/planner.py

The map is solved once (10 seconds, on a coarse mesh) and stays in results/planner.hdf. All that follows are look-ups.
"""

# %% The map
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import softjaw as sj

FILE = Path("results/planner.hdf")
scene = sj.Scene.from_file(Path(__file__).parents[1] / "bottle-rigid.toml").with_values(**{
    "object.mass_g": 150,
    "gripper.elements": [12, 6, 4],
    "candidates.stations": 12,
    "candidates.angles_deg": [0, 45, 90, 135],  # the bottle is round, so all of them are solved as one
    "candidates.refine": None,
    "load.normal_force_n": [2, 5, 10],
    "run.patches": "none",
})  # fmt: skip
sj.run(scene, FILE)
grasps = sj.GraspMap(FILE)

# %% The robot stands at -x, a table lies at z = 0, and the hand is 90 mm high and opens to 70 mm
TOWARDS, HAND, OPENING = np.array([1.0, 0.0, 0.0]), 0.09, 0.07


def reachable(point):
    """Whether the hand comes to a grasp: wide enough, above the table, from its own side."""
    rotation, origin = point.pose
    closing = rotation[0][:, 2]  # finger 1's approach; the hand itself comes across it
    sideways = abs(closing @ TOWARDS) < np.sin(np.radians(30))
    return bool(point.opening < OPENING and origin[:, 2].min() > HAND / 2 and sideways)


best = grasps.best(48, by="payload")
point = next(point for point in best if reachable(point) and point.value("safety_factor") > 1)
print(f"{best.index(point)} better grasps are out of reach. The best reachable one, pressed with {point.force:.3g} N:")
print(point)

# %% What is left for a jerk: half a g more, in any direction, is held where it bears one and a half times its weight
held = point.value("payload") - point.error("payload")
print("in a jerk of g / 2 it is", "held" if held > 1.5 * 0.15 else "lost")
surface = point.limit_surface(finger=1)  # for what pulls at a finger itself, in its contact frame
print("finger 1 bears 1 N along x and 5 N mm at once:", bool(surface.holds([1.0, 0.0, 0.005])[0]))

# %% Between the solved stations, with the error of the interpolation; arrays go in, arrays come out
station = np.linspace(0.025, 0.175, 301)
e_n = grasps.value("e_n", station, 0.0, 5.0)
error = grasps.error("e_n", station, 0.0, 5.0)
solved = sj.open(FILE)["e_n"].sel(model="ccm", angle=0.0, normal_force=5.0)
figure, plot = plt.subplots(figsize=(6, 4))
plot.fill_between(1e3 * station, 1e3 * (e_n - error), 1e3 * (e_n + error), alpha=0.3, label="error")
plot.plot(1e3 * station, 1e3 * e_n, label="look-up")
plot.plot(1e3 * solved["station"], 1e3 * solved, "ko", label="solved")
plot.set(xlabel="station [mm]", ylabel="e_n [mm]", title="e_n at 5 N; no value where the contact changes its kind")
plot.legend()
figure.savefig("results/planner.png", dpi=150)
print("drawn: results/planner.png")

# %% Where there is no value, the point says why
beside = grasps.at(station_mm=67, angle_deg=0, force=20)
print(beside.ok, beside.reason)
