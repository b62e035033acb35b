"""A measured pressure field: what the contact can carry, and what a planar model would claim. Needs no PETSc.

    python jobs/examples/measured_pressure.py

The table has a face per line: centre, area, normal, pressure. A sensor film on a known surface gives such a table, and
so does ParaView from any finite element program (.vtu, .vtp).
"""

# %% The patch, in the coordinates of its file
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import softjaw as sj

MU = 0.8
patch = sj.read_pressure(Path(__file__).parents[1] / "cylinder-pressure.csv")
print(f"{len(patch.area)} faces under up to {1e-3 * patch.pressure.max():.1f} kPa carry {patch.load.sum():.2f} N")

# %% Largest friction along x and y and about z, in three models
limits = sj.friction_limits(patch, MU)
for model, found in limits.items():
    print(f"{model:14} f_x {found.f_x:.2f} N  f_y {found.f_y:.2f} N  tau_z {1e3 * found.tau_z:.1f} N mm"
          f"  e_n {1e3 * found.e_n:.2f} mm")  # fmt: skip

# %% Limit surfaces: which forces and torques does it hold together?
fits = {kind: sj.fit_ellipsoid(patch, MU, kind) for kind in ("three_motions", "full")}
fits["quartic"] = sj.fit_quartic(patch, MU)
for kind, fit in fits.items():
    print(f"{kind:14} off by {100 * fit.fit_error.Erad:.1f} %, claims up to {100 * fit.overclaim:.1f} % too much")
held = fits["quartic"].surface.holds([[0, 5, 0.05], [0, 5, 0.15]])
print(f"5 N along y with 50 N mm: {'holds' if held[0] else 'slips'}; with 150 N mm: {'holds' if held[1] else 'slips'}")

# %% The section through f_y and tau_z, with wrenches of the friction itself
turns = np.linspace(0, np.pi, 60)
length = 0.02  # [m], about half the contact, so that slips are spread evenly
twist = np.column_stack([0 * turns, np.cos(turns), np.sin(turns) / length])
wrench = sj.friction_wrench(patch, twist, MU)
figure, plot = plt.subplots(figsize=(5, 4))
plot.plot(wrench[:, 1], 1e3 * wrench[:, 5], "k.", label="friction")
around = np.linspace(-np.pi / 2, np.pi / 2, 181)
direction = np.column_stack([0 * around, np.sin(around), length * np.cos(around)])
for kind, fit in fits.items():
    curve = fit.surface.radius(direction)[:, None] * direction
    plot.plot(curve[:, 1], 1e3 * curve[:, 2], label=kind)
plot.set(xlabel="f_y [N]", ylabel="tau_z [N mm]", title="Limit surface of the measured contact")
plot.legend()
Path("results").mkdir(exist_ok=True)
figure.savefig("results/measured-pressure.png", dpi=150)
print("drawn: results/measured-pressure.png")

# %% A grasp by two such contacts, 60 mm apart
score = sj.grasp_quality(patch, mu=MU, distance=0.06)
print(f"quality {score.quality:.3f}, epsilon {score.epsilon:.3f}")
