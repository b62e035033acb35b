"""What a stiffer pad changes: the same grasp with foams from soft to hard, one case after the other in memory.

    python jobs/examples/stiffer_pad.py

On the waist of a bottle a soft pad lies close all along, a stiff one bears on its two ends. So it turns harder, and
presses harder too.
"""

# %% One scene, one grasp
from pathlib import Path

import matplotlib.pyplot as plt

import softjaw as sj

SCENE = Path(__file__).parents[1] / "bottle-rigid.toml"
STATION, FORCE = 0.067, 7.0  # the waist of the bottle [m], per finger [N]
scene = sj.Scene.from_file(SCENE).with_values(**{"gripper.elements": [12, 6, 4], "accuracy.meshes": 2})

# %% From soft to hard foam
moduli = [10, 20, 40, 80, 160]  # [kPa]
cases = []
print("  G [kPa]   e_n [mm]        payload [g]   planar model claims   largest pressure [kPa]   closing [mm]")
for G in moduli:
    case = sj.press(scene.with_values(**{"gripper.shear_modulus_kpa": G}), station=STATION, angle=0.0, force=FORCE)
    cases.append(case)
    e_n, error = 1e3 * case.e_n, 1e3 * case.errors["e_n"]
    more = 100 * (case.limits["pcm"].tau_z / case.limits["ccm"].tau_z - 1)
    pressure, closing = 1e-3 * case.value("p_max"), 1e3 * case.value("closing")
    print(f"{G:9} {e_n:7.2f} +- {error:.2f} {1e3 * case.payload:15.0f} {more:16.1f} % more torque {pressure:15.1f}"
          f" {closing:18.2f}")  # fmt: skip

# %% The picture
figure, plot = plt.subplots(figsize=(6, 4))
for model in ("ccm", "pcm"):
    plot.semilogx(moduli, [1e3 * case.value("e_n", model) for case in cases], marker="o", label=model)
plot.set(xlabel="shear modulus of the foam [kPa]", ylabel="e_n [mm]", title=f"{cases[0].label}, {FORCE:g} N")
plot.legend()
Path("results").mkdir(exist_ok=True)
figure.savefig("results/stiffer-pad.png", dpi=150)
print("drawn: results/stiffer-pad.png")
