"""Numbers of CalculiX for a hard case: a quarter of a pad of Blatz-Ko foam on a plane.

Run once, from the repository's root, where ``ccx`` (Debian: calculix-ccx) is installed: ``python -m
tests.hard_cases.calculix.decks``. It writes the input deck and the numbers beside this file. Nothing of softjaw is
used: mesh, foam (``*HYPERFOAM`` with alpha = -2, which is Blatz-Ko's law; as two equal terms, because ccx 2.20 finds a
singular matrix for one) and the arms of the pressure are CalculiX's or written here. Units are mm, N, MPa.
"""

from __future__ import annotations

import json
import re
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

HERE = Path(__file__).resolve().parent
PAD = np.array([25.0, 11.0, 15.0])  # a quarter of 50 x 22 x 15
SHEAR = 0.04
FOAM = f"*MATERIAL, NAME=FOAM\n*HYPERFOAM, N=2\n{SHEAR / 2}, -2., {SHEAR / 2}, -2., 0.25, 0.25\n"


def pad(counts):
    """Nodes by number, C3D20R elements, and the lattice places of the nodes; the contact face is z = 0."""
    n = 2 * np.array(counts)
    numbers, nodes = {}, []
    for place in np.ndindex(*(n + 1)):
        if sum(i % 2 for i in place) <= 1:
            numbers[place] = len(nodes) + 1
            nodes.append(PAD * np.array(place) / n)
    corners = [(0, 0, 0), (2, 0, 0), (2, 2, 0), (0, 2, 0), (0, 0, 2), (2, 0, 2), (2, 2, 2), (0, 2, 2)]
    edges = [(0, 1), (1, 2), (2, 3), (3, 0), (4, 5), (5, 6), (6, 7), (7, 4), (0, 4), (1, 5), (2, 6), (3, 7)]
    shape = corners + [tuple((a + b) // 2 for a, b in zip(corners[i], corners[j], strict=True)) for i, j in edges]
    elements = [
        [numbers[tuple(2 * c + s for c, s in zip(cell, place, strict=True))] for place in shape]
        for cell in np.ndindex(*counts)
    ]
    return np.array(nodes), elements, numbers, n


def listed(name, numbers):
    """A node set."""
    rows = [", ".join(map(str, numbers[i : i + 12])) for i in range(0, len(numbers), 12)]
    return f"*NSET, NSET={name}\n" + ",\n".join(rows) + "\n"


def node_lines(nodes):
    """Lines of a block of nodes."""
    return "\n".join(f"{i}, " + ", ".join(f"{v:.9g}" for v in x) for i, x in enumerate(nodes, 1)) + "\n"


def element_lines(elements):
    """Lines of a block of elements; a line has at most 16 entries."""
    rows = [[i, *e] for i, e in enumerate(elements, 1)]
    return "\n".join(",\n".join(", ".join(map(str, r[i : i + 15])) for i in range(0, len(r), 15)) for r in rows) + "\n"


def pad_lines(nodes, elements, places, n):
    """The pad with its sets: planes of symmetry, bonded back, contact face."""
    sets = {name: [k for place, k in places.items() if place[axis] == at]
            for name, axis, at in (("XSYM", 0, 0), ("YSYM", 1, 0), ("BACK", 2, n[2]), ("FRONT", 2, 0))}  # fmt: skip
    text = "*NODE, NSET=NPAD\n" + node_lines(nodes) + "*ELEMENT, TYPE=C3D20R, ELSET=PAD\n" + element_lines(elements)
    text += "".join(listed(name, found) for name, found in sets.items())
    return text + FOAM + "*SOLID SECTION, ELSET=PAD, MATERIAL=FOAM\n"


def plane_deck(closings):
    """The whole contact face pressed to a plane, free to slide on it: a displacement alone, without contact."""
    nodes, elements, places, n = pad((10, 5, 6))
    text = pad_lines(nodes, elements, places, n)
    text += "*BOUNDARY\nBACK, 1, 3\nXSYM, 1, 1\nYSYM, 2, 2\n"
    for d in closings:
        text += f"*STEP, NLGEOM, INC=200\n*STATIC\n0.5, 1.\n*BOUNDARY\nFRONT, 3, 3, {d}\n"
        text += "*NODE PRINT, NSET=FRONT, FREQUENCY=999\nU, RF\n*END STEP\n"
    return text, {k: nodes[k - 1] for place, k in places.items() if place[2] == 0}


def solved(deck):
    """The printed results of CalculiX."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "deck.inp").write_text(deck)
        subprocess.run(["ccx", "-i", "deck"], cwd=folder, check=True, capture_output=True)
        return (Path(folder) / "deck.dat").read_text()


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
    """Write the deck and its numbers."""
    closings, forces = [2.2, 2.6, 3.8, 4.9, 5.2], [30.0, 100.0]
    text, places = plane_deck(closings)
    (HERE / "plane.inp").write_text(text)
    maps = numbers(steps_of(solved(text)), places, closings, forces)
    data = {"code": "CalculiX 2.20", "deck": "plane.inp", "forces_n": forces, "maps": maps}
    (HERE / "plane.json").write_text(json.dumps(data, indent=1) + "\n")


if __name__ == "__main__":
    main()
