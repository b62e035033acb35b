"""Friction and limit surfaces alone: how much curvature costs, on patches made by hand. Needs no PETSc and no file.

    python jobs/examples/friction_alone.py

A strip of even pressure bends round a cylinder, further and further. Along the axis its friction stays mu S; across it
falls as sin(t) / t, for the forces of the faces point in different directions.
"""

# %% A patch from arrays: centres [m], areas [m^2], normals, pressures [Pa]
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import softjaw as sj

MU, LENGTH, WIDTH, PRESSURE = 0.8, 0.04, 0.02, 1e4  # [-, m, m, Pa]


def bent(half_angle: float, n: int = 60, m: int = 40) -> sj.ContactPatch:
    """A strip of this width, bent round an axis along x until it spans twice the angle [rad]."""
    t = half_angle * (2 * (np.arange(m) + 0.5) / m - 1)
    x, t = (a.ravel() for a in np.meshgrid(LENGTH * ((np.arange(n) + 0.5) / n - 0.5), t, indexing="ij"))
    R = WIDTH / (2 * half_angle)
    normal = np.column_stack([0 * t, np.sin(t), np.cos(t)])
    centroid = np.column_stack([x, R * np.sin(t), R * (np.cos(t) - 1)])
    return sj.ContactPatch(centroid, np.full(t.size, LENGTH * WIDTH / t.size), normal, np.full(t.size, PRESSURE))


# %% Friction limits of the curved and of the planar model
angles = np.radians([5, 15, 30, 45, 60, 75])
print("half angle   f_y / mu S   sin(t) / t   e_n [mm]   planar e_n   quartic off by")
curves = []
for t in angles:
    patch = bent(t)
    ccm, pcm = (sj.friction_limits(patch, MU, x_axis=[1, 0, 0])[model] for model in ("ccm", "pcm"))
    fit = sj.fit_quartic(patch, MU, x_axis=[1, 0, 0])
    curves.append((ccm.f_y / (MU * ccm.S), np.sin(t) / t, ccm.e_n / pcm.e_n))
    print(f"{np.degrees(t):7.0f} deg {curves[-1][0]:12.5f} {curves[-1][1]:12.5f} {1e3 * ccm.e_n:10.2f}"
          f" {1e3 * pcm.e_n:12.2f} {100 * fit.fit_error.Erad:14.2f} %")  # fmt: skip

# %% The picture
figure, plot = plt.subplots(figsize=(6, 4))
for values, label in zip(np.transpose(curves), ("f_y / mu S", "sin(t) / t", "e_n over planar e_n"), strict=True):
    plot.plot(np.degrees(angles), values, "k--" if "sin" in label else "o-", label=label)
plot.set(xlabel="half angle t [deg]", ylabel="share of the planar model", title="What curvature costs")
plot.legend()
Path("results").mkdir(exist_ok=True)
figure.savefig("results/friction-alone.png", dpi=150)
print("drawn: results/friction-alone.png")
