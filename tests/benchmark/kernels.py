"""Time and accuracy of friction, limit surfaces and scores, each beside what an independent implementation gives."""

from __future__ import annotations

import itertools
import math
import time
from functools import partial

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from softjaw.friction.frame import contact_frame
from softjaw.friction.motion import cor_grid, fibonacci_twists
from softjaw.friction.torque import pure_torque
from softjaw.friction.wrench import friction_limits, friction_wrench
from softjaw.lsfit.ellipsoid import Ellipsoid, axis_aligned_ellipsoid, full_ellipsoid, three_motion_ellipsoid
from softjaw.lsfit.fit_error import fit_error
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.samples import normalised_samples, six_samples
from softjaw.lsfit.span import span_quartic
from softjaw.lsfit.zhou import zhou_quartic
from softjaw.scoring.bodies import fibonacci_vertices, polytope_volume
from softjaw.scoring.closed_form import epsilon_linf, volume_linf
from softjaw.scoring.contact import SoftContact, contact_axes
from softjaw.scoring.epsilon import epsilon
from softjaw.scoring.pose import pose_volume
from softjaw.scoring.quality import score
from tests.benchmark.table import fastest, line, span, title
from tests.generators import (
    build,
    cyl_mesh,
    cylinder_grid,
    disc_polar,
    friction_sums_reference,
    lcg_noise,
    lcg_patch,
    lcg_sphere,
    mesh_patch,
)

AXES = (0.8, 0.6, 0.15), (0.5, 0.9, 0.25)  # of the reference grasp, with arms 1.3 apart and all torques over 0.7
DISTANCE, RHO = 1.3, 0.7


def friction() -> None:
    """Friction of 2400 faces."""
    title("Friction, 2400 faces")
    patch, twist = lcg_patch(1, 2400), cor_grid(21, 2.0)
    columns = patch.centroid.T.copy(), patch.normal.T.copy(), patch.load
    six = np.zeros((len(twist), 6))
    six[:, [0, 1, 5]] = twist
    exact = friction_sums_reference(*columns, six)[:, :6]
    error = np.abs(friction_wrench(patch, twist, 1.0) - exact).max() / patch.load.sum()
    seconds = fastest(lambda: friction_wrench(patch, twist, 0.8))
    rate = f"{2400 * 441 / seconds / 1e6:.0f} M pairs/s"
    line("COR sweep, 441 motions", rate, "at least 400", f"{error:.0e} of the normal force, against numpy")
    limits = friction_limits(patch, 1.0)
    H = friction_sums_reference(*columns, np.eye(6)[[0, 1, 5]])[:, 6]
    error = np.abs(np.array([limits.f_x, limits.f_y, limits.tau_z]) / H - 1).max()
    line(
        "three exact maxima", span(fastest(lambda: friction_limits(patch, 0.8), 0.3)), "at most 0.24 ms", f"{error:.0e}"
    )
    mesh = mesh_patch(cyl_mesh(1.0, math.pi / 3, 2.0, 48, 50), lambda r: 1 + 0.8 * r[:, 1])
    N = contact_frame(mesh, [1.0, 0, 0]).axes[2]
    angle = abs(math.degrees(math.atan2(N[1], N[2])) - 15.8376)
    cost = span(fastest(lambda: contact_frame(mesh, [1.0, 0, 0]), 0.3))
    line("contact frame", cost, "at most 1 ms", f"normal to {angle:.2f} degrees (a facet turns by 2.5)")
    field = {"kind": "gauss", "x0": 0.5, "y0": 0.2, "sx": 0.4, "sy": 0.3}
    skew = build({"gen": "rect_grid", "args": {"a": 2.0, "b": 1.0, "nx": 60, "ny": 40}, "pressure": field})
    error = pure_torque(skew, 1.0) / pure_torque(skew, 1.0, tolerance=1e-14) - 1
    line("torque without net force", span(fastest(lambda: pure_torque(skew, 0.8), 0.3)), "at most 5 ms", f"{error:.0e}")


def limit_surfaces() -> None:
    """Fits to 441 samples of a cylinder, to noisy ones, and in six dimensions."""
    title("Limit surfaces, cylinder with half angle 60 degrees, 441 Fibonacci motions")
    patch = cylinder_grid(1.0, math.pi / 3, 2.0, 48, 48)
    limits, twist = friction_limits(patch, 1.0), fibonacci_twists(441, 2.0)
    W, T = normalised_samples(friction_wrench(patch, twist, 1.0), twist, limits.S, 2.0)
    f_x, f_y, tau_z = np.array(limits.per_unit_force) / [1, 1, 2]
    fits = {
        "ellipsoid from three motions": (lambda: three_motion_ellipsoid(f_x, f_y, tau_z, 1.0), ""),
        "ellipsoid with axes along x, y, tau": (lambda: axis_aligned_ellipsoid(W), ""),
        "ellipsoid of any orientation": (lambda: full_ellipsoid(W), "at most 0.1 ms"),
        "convex quartic with its certificate": (lambda: convex_quartic(W, T, gamma=0.0).surface, "at most 1 ms"),
    }
    for name, (fit, goal) in fits.items():
        errors = fit_error(fit(), W, T)
        figures = f"radius {errors.Erad:.4f}, direction {errors.Edir:.2f} degrees"
        line(name, span(fastest(fit, 0.3)), goal, figures)
    constrained()
    six_dimensions()


def constrained() -> None:
    """Programmes of the table's cases, whose least objectives are known."""
    patch = disc_polar(1.0, 40, 96)
    few, many = (
        normalised_samples(friction_wrench(patch, t, 1.0), t, patch.load.sum(), 2.0)
        for t in (fibonacci_twists(20, 2.0), fibonacci_twists(100, 2.0))
    )
    noisy = few[0] * lcg_noise(20, 0.3, 11)[:, None]

    def convex():
        return convex_quartic(noisy, few[1], gamma=0.0).surface

    error = np.mean((convex().value(noisy) - 1) ** 2) / 0.07303011056407738 - 1
    line(
        "convex quartic where convexity binds, 20 noisy samples",
        span(fastest(convex, 0.3)),
        "at most 5 ms",
        f"objective {error:+.0e}",
    )
    fit = partial(zhou_quartic, *many, even=False)
    error = fit().objective / 77.85994575252231 - 1
    line("quartic of Zhou et al., sums of lengths, 100 samples", span(fastest(fit, 0.3)), "", f"objective {error:+.0e}")


def six_dimensions() -> None:
    """Convex quartic of all six components."""
    patch, rho = cylinder_grid(1.0, math.pi / 3, 2.0, 48, 48), 2.0
    twist = lcg_sphere(6, 1024, 5) / [1, 1, 1, rho, rho, rho]
    W, T = six_samples(friction_wrench(patch, twist, 1.0), twist, patch.load.sum(), rho)
    errors = span_quartic(W, T).errors
    line(
        "convex quartic in six dimensions, 1024 samples",
        span(fastest(lambda: span_quartic(W, T), 0.3)),
        "at most 3 s",
        f"radius {errors.Erad:.4f}, direction {errors.Edir:.1f} degrees",
    )


def _tilted(degrees: float, body: Ellipsoid) -> list[SoftContact]:
    c, s = math.cos(math.radians(degrees)), math.sin(math.radians(degrees))
    return [SoftContact([-side / 2, 0, 0], contact_axes([side * c, s, 0], [0, 0, 1]), body) for side in (1.0, -1.0)]


def scores() -> None:
    """Scores of two soft contacts."""
    title("Scores of two contacts")
    one, two = (0.8, 0.7, 0.012), (0.8, 0.75, 0.011)
    exact = 14 / 9 * math.pi**2 * (DISTANCE / RHO) ** 2 * AXES[0][0] ** 2 * AXES[0][1] ** 2 * AXES[0][2] / RHO
    error = score(AXES[0], AXES[0], DISTANCE, RHO, RHO).quality / exact - 1
    cost = fastest(lambda: score(one, two, 0.06, 0.2, 0.05), 0.2)
    line("antipodal: volumes and epsilons, closed forms", span(cost), "at most 50 us", f"{error:.0e}")
    body = Ellipsoid(AXES[0])
    for degrees, value, source in ((0, None, "the closed form"), (10, 0.5156805591676639, "reference, itself to 1e-4")):
        contacts = _tilted(degrees, body)
        V, A = body.volume, body.shadow_area
        error = pose_volume(*contacts, 1.0, 1.0).linf / (value or volume_linf(V, A, V, A, 1.0)) - 1
        cost = span(fastest(lambda contacts=contacts: pose_volume(*contacts, 1.0, 1.0), 0.3))
        line(f"any pose: volume, tilted by {degrees} degrees", cost, "at most 10 ms", f"{error:+.0e}, against {source}")
    weakest()


def weakest() -> None:
    """Search for the weakest wrench."""
    bodies = [Ellipsoid(axes) for axes in AXES]
    contacts = [
        SoftContact([-side * DISTANCE / 2, 0, 0], contact_axes([side, 0, 0], [0, 0, 1]), body)
        for side, body in zip((1.0, -1.0), bodies, strict=True)
    ]
    for degrees, pair, lengths in ((0, contacts, (RHO, RHO)), (10, _tilted(10, bodies[0]), (1.0, 1.0))):
        bound = epsilon(pair, *lengths, (0, 0, 0))
        figure = f"{bound.lower:.6f} to {bound.upper:.6f}"
        if degrees == 0:
            scaled = [np.array(axes) / [1, 1, RHO] for axes in AXES]
            figure += f", closed form {epsilon_linf(*scaled, -DISTANCE / 2 / RHO, DISTANCE / 2 / RHO):.6f}"
        cost = span(fastest(lambda pair=pair, lengths=lengths: epsilon(pair, *lengths, (0, 0, 0)), 0.3))
        line(f"any pose: epsilon between bounds, tilted by {degrees} degrees", cost, "2 to 4 s elsewhere", figure)


def linearised(points: tuple[int, ...]) -> None:
    """Volume by a hull of sums in six dimensions, as linearised contacts need it, beside the exact volume."""
    title("Volume of the reference grasp: points per contact, hull in six dimensions, and the exact values")
    V = [Ellipsoid(axes) for axes in AXES]
    sizes = [x for body in V for x in (body.volume, body.shadow_area)]
    exact = volume_linf(*sizes, DISTANCE, RHO)
    cost = span(fastest(lambda: volume_linf(*sizes, DISTANCE, RHO), 0.1))
    line("exact, smooth contacts", cost, "", f"{exact:.6f}")
    for m in points:
        vertices = [fibonacci_vertices(axes, m) for axes in AXES]
        closed = volume_linf(*(x for v in vertices for x in polytope_volume(v)), DISTANCE, RHO)
        hull, seconds, note = _hull(vertices)
        share = f"{100 * (hull / exact - 1):+.1f} % of the smooth volume"
        line(f"{m} points, hull of {(m + 1) ** 2} wrenches{note}", span(seconds), "", share)
        cost = span(fastest(lambda v=vertices: [polytope_volume(x) for x in v], 0.1))
        line(f"{m} points, the same volume in closed form", cost, "", f"{closed / hull - 1:+.0e} from the hull")


def _hull(vertices: list[np.ndarray]) -> tuple[float, float, str]:
    """Volume of the sums of both contacts' wrenches, the empty wrench among them, its time and a note."""
    cones = []
    for side, (f_x, f_y, tau) in zip((1.0, -1.0), (v.T for v in vertices), strict=True):
        N, x = np.array([side, 0, 0]), np.array([0.0, 0, 1])
        f = N + np.outer(f_x, x) + np.outer(f_y, np.cross(N, x))
        torque = (np.cross([-side * DISTANCE / 2, 0, 0], f) + np.outer(tau, N)) / RHO
        cones.append(np.vstack([np.zeros(6), np.hstack([f, torque])]))
    sums = np.array([a + b for a, b in itertools.product(*cones)])
    start = time.perf_counter()
    try:
        return ConvexHull(sums).volume, time.perf_counter() - start, ""
    except QhullError:
        start = time.perf_counter()
        return ConvexHull(sums, qhull_options="QJ").volume, time.perf_counter() - start, ", joggled"
