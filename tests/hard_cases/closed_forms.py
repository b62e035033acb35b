"""Numbers of hard cases in closed form, from the scene alone; nothing of the solver is used."""

from collections.abc import Callable

import numpy as np

from softjaw.study.scene import Scene


def pressed_column(scene: Scene) -> dict[str, np.ndarray]:
    """Closing displacement and e_n of a neo-Hookean pad with Poisson's ratio 0 between plates."""
    g = scene.gripper
    p = np.array(scene.load.normal_force) / (g.pad_length * g.pad_width * g.shear_modulus)
    stretch = (np.sqrt(p**2 + 4.0) - p) / 2.0
    return {"closing": g.pad_thickness * (1.0 - stretch)} | uniform_pressure(scene)


def uniform_pressure(scene: Scene) -> dict[str, np.ndarray]:
    """e_n of a uniform pressure on a rectangle ``a x b``: the mean distance from its centre.

    ``(d + a^2 / (2 b) arsinh(b / a) + b^2 / (2 a) arsinh(a / b)) / 6`` with the diagonal ``d``.
    """
    a, b = scene.gripper.pad_length, scene.gripper.pad_width
    mean = (np.hypot(a, b) + a**2 / (2 * b) * np.arcsinh(b / a) + b**2 / (2 * a) * np.arcsinh(a / b)) / 6.0
    return {"e_n": np.full(len(scene.load.normal_force), mean)}


def frictionless(scene: Scene) -> dict[str, np.ndarray]:
    n = len(scene.load.normal_force)
    return {name: np.zeros(n) for name in ("f_x_max", "f_y_max", "tau_z_max")}


FORMULAS: dict[str, Callable[[Scene], dict[str, np.ndarray]]] = {
    "pressed column": pressed_column,
    "uniform pressure": uniform_pressure,
    "frictionless": frictionless,
}
