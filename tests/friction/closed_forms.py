"""Friction limits of patches with a closed form, for mu = 1, and the meshes that approach them.

Sources: integrals of ``p |P v|`` over the surface, for ``v = x, y`` (forces) and ``v = z x r`` (torque). On a cylinder
and a cap the speeds are ``sqrt(sin^2 + cos^2 (..))``, whence the elliptic integrals.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy import cos, pi, sin
from scipy.integrate import quad
from scipy.special import ellipe

from softjaw.friction.patch import ContactPatch
from tests.generators import PRESSURES, cap_polar, cylinder_grid, disc_polar, points_patch, rect_grid, wedge

ALPHA = pi / 3


@dataclass(frozen=True)
class Form:
    """Exact values, and the patch with ``n`` faces per side that approaches them with ``order``."""

    patch: Callable[[int], ContactPatch]
    S: float
    F_N: float
    f_x: float
    f_y: float
    tau_z: float
    order: float = 2.0
    model: str = "ccm"


def mean_distance(a: float, b: float) -> float:
    """Mean distance of the points of a rectangle from its centre."""
    A, B = a / 2, b / 2
    return math.hypot(A, B) / 3 + A**2 / (6 * B) * math.asinh(B / A) + B**2 / (6 * A) * math.asinh(A / B)


def strip(A: float, B: float, h: float) -> float:
    """Integral of ``sqrt(A^2 + B^2 x^2)`` over ``0 < x < h``."""
    return 0.5 * (h * math.hypot(A, B * h) + (A**2 / B * math.asinh(B * h / A) if A > 0 else 0))


def integral(f: Callable[[float], float], upper: float) -> float:
    return quad(f, 0, upper, epsabs=1e-14, epsrel=1e-13)[0]


def cylinder_torque(a: float, b: float, tm: float, L: float, flat: bool = False) -> float:
    """Cylinder along x, semi-axes ``a`` along z and ``b`` along y, up to the parameter ``tm`` on both sides."""

    def across(t: float) -> float:
        G = math.hypot(b * cos(t), a * sin(t))
        return G * 2 * strip(b * sin(t), 1.0 if flat else b * cos(t) / G, L / 2)

    return 2 * integral(across, tm)


def cap(p: Callable[[float], float], kind="uniform", order=2.0, alpha=ALPHA, **field: float) -> Form:
    """Unit spherical cap with the half angle ``alpha`` and the pressure ``p(t)`` at the polar angle ``t``."""
    S = 2 * pi * integral(lambda t: p(t) * sin(t), alpha)
    F_N = 2 * pi * integral(lambda t: p(t) * sin(t) * cos(t), alpha)
    f = 4 * integral(lambda t: p(t) * sin(t) * ellipe(sin(t) ** 2), alpha)
    tau = 2 * pi * integral(lambda t: p(t) * sin(t) ** 2, alpha)
    return Form(lambda n: pressed(cap_polar(1, alpha, n, 4 * n), kind, **field), S, F_N, f, f, tau, order)


def pressed(patch: ContactPatch, kind: str, **field: float) -> ContactPatch:
    return replace(patch, pressure=PRESSURES[kind](patch.centroid, **field))


def disc(a: float, b: float, kind: str, share: float, arm: float, order: float = 2.0) -> Form:
    """Plane ellipse; ``share``: S over its area, ``arm``: torque of the unit disc over S."""
    S = share * pi * a * b
    field = {} if kind == "uniform" else {"a": a, "b": b}
    tau = S * arm * 2 * a / pi * ellipe(1 - (b / a) ** 2)
    return Form(lambda n: pressed(disc_polar(a, n, 2 * n, b), kind, **field), S, S, S, S, tau, order)


def rectangle(a: float, b: float) -> Form:
    return Form(lambda n: rect_grid(a, b, n, n), a * b, a * b, a * b, a * b, a * b * mean_distance(a, b))


def cylinder(model: str, alpha: float = ALPHA, L: float = 2.0) -> Form:
    """Unit cylinder along x."""
    S, F_N = 2 * alpha * L, 2 * sin(alpha) * L
    curved = model == "ccm"
    tau = cylinder_torque(1, 1, alpha, L, not curved)
    return Form(lambda n: cylinder_grid(1.0, alpha, L, n, n), S, F_N, S, F_N if curved else S, tau, 2.0, model)


def roof(model: str, tilt: float = 0.6, W: float = 1.0, L: float = 2.0) -> Form:
    """Two rectangles that meet in a ridge along x."""
    S, c = 2 * W * L, cos(tilt)
    arm = {"ccm": c * mean_distance(L, 2 * W), "pcm": mean_distance(L, 2 * W * c)}[model]
    f_y = c * S if model == "ccm" else S
    return Form(lambda n: wedge(tilt, W, L, n, 2 * n), S, c * S, S, f_y, arm * S, 2.0, model)


def ring(R: float) -> Form:
    def patch(n: int) -> ContactPatch:
        phi = 2 * pi * np.arange(n) / n
        return points_patch(R * np.column_stack([cos(phi), sin(phi)]), np.full(n, 2 * pi * R / n))

    F = 2 * pi * R
    return Form(patch, F, F, F, F, F * R)


DEPTH = 1 - cos(ALPHA)
FORMS = {
    "rectangle": rectangle(2, 1),
    "uniform disc": disc(1, 1, "uniform", 1, 2 / 3),
    "Hertz disc": disc(1, 1, "hertz", 2 / 3, 3 * pi / 16, 1.5),
    "parabolic disc": disc(1, 1, "parab", 1 / 2, 8 / 15),
    "uniform ellipse": disc(2, 1, "uniform", 1, 2 / 3),
    "line": Form(lambda n: rect_grid(2.0, 1e-9, 2 * n, 1), 2e-9, 2e-9, 2e-9, 2e-9, 2e-9 * 2 / 4),
    "ring": ring(3.0),
    "cap": cap(lambda t: 1.0), "hemisphere": cap(lambda t: 1.0, alpha=pi / 2),
    "cap, pressure by depth": cap(lambda t: 1 - (1 - cos(t)) / DEPTH, "depth", h=DEPTH),
    "cap, root of the depth": cap(lambda t: math.sqrt(max(0, 1 - (1 - cos(t)) / DEPTH)), "hertzdepth", 1.5, h=DEPTH),
    "cylinder": cylinder("ccm"), "cylinder, flat": cylinder("pcm"), "wedge": roof("ccm"), "wedge, flat": roof("pcm"),
}  # fmt: skip
