"""The same contact problem by GetFEM, a general finite element library: time on one mesh, and at equal accuracy."""

import json
import subprocess
import time
from pathlib import Path

import numpy as np

from softjaw.fem.contact.press import Press
from softjaw.fem.materials import material
from softjaw.fem.objects.shapes import EllipticCylinder
from tests.benchmark.table import line, title
from tests.fem import reference
from tests.fem.reference import SIZE

PYTHON = "/usr/bin/python3"  # sees Debian's python3-getfem
SEMI_AXES, SHEAR = (0.025, 0.0125), 20e3
FORCES = np.linspace(1.25, 10, 8)  # N
SAME = (48, 24, 12)  # of the whole pad, of which both solve a quarter
CHEAPER = (((10, 6, 3), "hex8"), ((14, 8, 4), "hex8"), ((20, 10, 6), "hex8"), ((10, 6, 3), "hex27"),
           ((28, 14, 8), "hex8"), ((10, 16, 3), "hex27"))  # fmt: skip
FINE = ((16, 24, 6), "hex27")


def pressed(elements, element):
    """Closing displacement and mean arm of the pressure at each of `FORCES` [m], iterations, unknowns, CPU time [s]."""
    gap = reference.placed(EllipticCylinder(*SEMI_AXES, 0.2), reference.facing(SEMI_AXES[0]))
    start, rule = time.process_time(), {"hex8": "blended", "hex27": "weighted"}[element]
    press = Press(reference.pad_of(elements, (True, True), rule, element, material("blatz_ko", SHEAR)), gap)
    states = list(press.load_path(FORCES))
    spent, size = time.process_time() - start, press.problem.size
    press.destroy()
    arms = [
        float((s.points.load * np.hypot(*np.moveaxis(s.points.position[..., :2], -1, 0))).sum() / s.points.load.sum())
        for s in states
    ]
    return np.array([s.closing for s in states]), np.array(arms), sum(s.work.iterations for s in states), size, spent


def by_getfem(closings, elements):
    """Forces at each closing displacement [N], iterations, unknowns and CPU time [s]; None without GetFEM."""
    task = {"size": SIZE, "elements": [elements[0] // 2, elements[1] // 2, elements[2]], "shear_modulus": SHEAR,
            "semi_axes": SEMI_AXES, "closings": list(closings)}  # fmt: skip
    if subprocess.run([PYTHON, "-c", "import getfem"], capture_output=True).returncode:
        return None
    words = [PYTHON, str(Path(__file__).with_name("getfem_pad.py"))]
    done = subprocess.run(words, input=json.dumps(task), capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


def compare() -> None:
    title("The same contact problem by GetFEM")
    pressed(*CHEAPER[0])  # what is compiled at first use is not counted
    closings, arms, iterations, size, seconds = pressed(SAME, "hex8")
    other = by_getfem(closings, SAME)
    if other is None:
        line("GetFEM", "not found", f"{PYTHON} needs python3-getfem: apt-get install python3-getfem")
        return
    name = "x".join(map(str, SAME))
    line(f"softjaw, hex8 {name}, {size} unknowns, {iterations} iterations", f"{seconds:.1f} s")
    line(f"GetFEM, {other['unknowns']} unknowns, {other['iterations']} iterations", f"{other['seconds']:.1f} s")
    line("GetFEM over softjaw, same mesh", f"{other['seconds'] / seconds:.1f}", "at least 10")
    true = pressed(*FINE)[1]
    # at the forces that we were given; the planar e_n is this arm
    theirs = np.array(other["arms"]) - (np.array(other["forces"]) - FORCES) * np.gradient(arms, FORCES)
    goal = np.abs(theirs / true - 1).max()
    line("largest error of the mean arm of the pressure, GetFEM", f"{100 * goal:.2f} %")
    line("the same, softjaw on the same mesh", f"{100 * np.abs(arms / true - 1).max():.2f} %")
    for elements, element in CHEAPER:
        _, found, _, _, spent = pressed(elements, element)
        error, name = np.abs(found / true - 1).max(), "x".join(map(str, elements))
        line(f"the same, softjaw, {element} {name}, {spent:.2f} s", f"{100 * error:.2f} %")
        if error <= goal:
            line("GetFEM over softjaw, equal accuracy", f"{other['seconds'] / spent:.0f}", "at least 40")
            return
