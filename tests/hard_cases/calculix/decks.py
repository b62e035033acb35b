"""Numbers of CalculiX for a hard case: a quarter of a pad of Blatz-Ko foam that is pressed to a plane, ``plane.inp``.

``python -m tests.hard_cases.calculix.decks`` writes them beside this file, once, with ``ccx`` (Debian: calculix-ccx).
In the deck the foam is ``*HYPERFOAM`` with alpha = -2, Blatz-Ko's law (as two equal terms: ccx 2.20 finds a singular
matrix for one), and the whole contact face slides freely on the plane: a displacement alone. Units are mm, N, MPa.
"""

import json
import re
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

HERE = Path(__file__).resolve().parent
FORCES = [30.0, 100.0]


def block(deck, head):
    body = deck.partition(f"*{head}\n")[2].partition("*")[0]
    return [float(word) for word in re.split(r"[,\s]+", body) if word]


def solved():
    with tempfile.TemporaryDirectory() as folder:
        shutil.copy(HERE / "plane.inp", folder)
        subprocess.run(["ccx", "-i", "plane"], cwd=folder, check=True, capture_output=True)
        return (Path(folder) / "plane.dat").read_text()


def steps_of(text):
    """Displacements and reactions of every step, as dictionaries by node."""
    blocks = re.split(r"\n *(displacements|forces) [^\n]*time[^\n]*\n", text)[1:]
    tables = [
        {int(r[0]): np.array(r[1:4], float) for r in map(str.split, body.strip().splitlines()) if len(r) == 4}
        for body in blocks[1::2]
    ]
    return list(zip(tables[::2], tables[1::2], strict=True))


def numbers(steps, places, closings, forces):
    """Closing displacement [m] and e_n [m], the mean arm of the loads, at the forces, by splines through the steps."""
    found = []
    for moved, reaction in steps:
        r = np.array([x + moved[k] for k, x in places.items()])
        load = np.array([reaction[k][2] for k in places])
        found.append((4 * abs(load.sum()), (load * np.hypot(r[:, 0], r[:, 1])).sum() / load.sum()))
    F, arm = np.array(found).T
    return {"closing": (CubicSpline(F, closings)(forces) / 1e3).tolist(),
            "e_n": (CubicSpline(F, arm)(forces) / 1e3).tolist()}  # fmt: skip


def main():
    deck = (HERE / "plane.inp").read_text()
    nodes = np.reshape(block(deck, "NODE, NSET=NPAD"), (-1, 4))
    places = {int(k): nodes[int(k) - 1, 1:] for k in block(deck, "NSET, NSET=FRONT")}
    closings = [float(d) for d in re.findall(r"^FRONT, 3, 3, (\S+)$", deck, re.M)]
    maps = numbers(steps_of(solved()), places, closings, FORCES)
    data = {"code": "CalculiX 2.20", "deck": "plane.inp", "forces_n": FORCES, "maps": maps}
    (HERE / "plane.json").write_text(json.dumps(data, indent=1) + "\n")


if __name__ == "__main__":
    main()
