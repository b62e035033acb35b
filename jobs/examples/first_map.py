"""First map of your own mesh: where to grasp it, and how sure that is.

    python jobs/examples/first_map.py                       the flask that comes with softjaw, 10 seconds
    mpirun -n 8 python jobs/examples/first_map.py           the same on 8 ranks

Put the path of your mesh in the first cell. The numbers stay in results/first-map.hdf; run again to resume.
"""

# %% The scene: what is grasped, where, how hard
from pathlib import Path

import matplotlib.pyplot as plt
from mpi4py import MPI

import softjaw as sj

MESH = Path(__file__).parents[1] / "objects" / "flask.stl"
FILE = Path("results/first-map.hdf")
scene = sj.Scene.from_dict({
    "object": {"name": "flask", "shape": "mesh", "mesh": str(MESH), "unit": "mm", "axis": "z", "mass_g": 60},
    "gripper": {"elements": [12, 6, 4], "max_opening_mm": 85},  # a coarse mesh, good to a few per cent
    "candidates": {"stations": 6, "stations_mm": [20, 95], "angles_deg": [0]},
    "load": {"normal_force_n": [2, 5]},
    "run": {"patches": "none"},
})  # fmt: skip

# %% The study
code = sj.run(scene, FILE, comm=MPI.COMM_WORLD)

# %% What came out, on the first rank
if MPI.COMM_WORLD.rank == 0:
    ds = sj.open(FILE)
    for point in sj.GraspMap(ds).best(3):
        print(point)
    e_n = 1e3 * ds["e_n"].isel(angle=0, normal_force=-1)
    figure, plot = plt.subplots(figsize=(6, 4))
    for model in ("ccm", "pcm"):
        plot.plot(1e3 * ds["station"], e_n.sel(model=model), marker="o", label=model)
    plot.set(xlabel="station [mm]", ylabel="e_n [mm]", title="Eccentricity parameter along the flask at 5 N")
    plot.legend()
    figure.savefig("results/first-map.png", dpi=150)
    print("drawn: results/first-map.png")
