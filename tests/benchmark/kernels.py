"""Time of friction, limit surfaces and scores on patches of known size; tests hold their accuracy."""

import math
from collections.abc import Callable

import numpy as np

from softjaw.friction.frame import contact_frame
from softjaw.friction.wrench import friction_limits, friction_wrench, pure_torque
from softjaw.lsfit.ellipsoid import Ellipsoid, full_ellipsoid
from softjaw.lsfit.quartic_fit import convex_quartic
from softjaw.lsfit.span import span_quartic, span_samples, zhou_quartic
from softjaw.scoring.contact import SoftContact
from softjaw.scoring.epsilon import epsilon
from softjaw.scoring.pose import pose_volume
from softjaw.scoring.quality import score
from tests.benchmark.table import fastest, line, span, title
from tests.generators import cor_grid, cyl_mesh, cylinder_grid, disc_polar, lcg_noise, lcg_patch, lcg_sphere, mesh_patch
from tests.oracles import samples
from tests.scoring.grasps import contact_axes

FACES, MOTIONS = 2400, 441

Work = Callable[[], object]


def friction() -> dict[str, tuple[Work, str]]:
    patch, twist = lcg_patch(1, FACES), cor_grid(21, 2.0)
    mesh = mesh_patch(cyl_mesh(1.0, math.pi / 3, 2.0, 48, 50), lambda r: 1 + 0.8 * r[:, 1])
    return {
        f"friction of {FACES} faces, {MOTIONS} motions": (lambda: friction_wrench(patch, twist, 0.8), "at most 2.6 ms"),
        "three exact maxima": (lambda: friction_limits(patch, 0.8), "at most 0.24 ms"),
        "contact frame": (lambda: contact_frame(mesh, [1.0, 0, 0]), "at most 1 ms"),
        "torque without net force": (lambda: pure_torque(patch, 0.8), "at most 5 ms"),
    }


def limit_surfaces() -> dict[str, tuple[Work, str]]:
    """Fits to a cylinder, to noisy samples where convexity binds, and in six dimensions."""
    cylinder, disc = cylinder_grid(1.0, math.pi / 3, 2.0, 48, 48), disc_polar(1.0, 40, 96)
    W, T = samples(cylinder, MOTIONS)
    few, many = (samples(disc, K) for K in (20, 100))
    noisy = few[0] * lcg_noise(20, 0.3, 11)[:, None]
    six = samples(cylinder, twist=lcg_sphere(6, 1024, 5) / [1, 1, 1, 2, 2, 2])
    return {
        "ellipsoid of any orientation": (lambda: full_ellipsoid(W), "at most 0.1 ms"),
        "convex quartic with its certificate": (lambda: convex_quartic(W, T, gamma=0.0), "at most 1 ms"),
        "the same where convexity binds": (lambda: convex_quartic(noisy, few[1], gamma=0.0), "at most 5 ms"),
        "quartic of Zhou et al., 100 samples": (lambda: zhou_quartic(span_samples(*many)), ""),
        "convex quartic in six dimensions, 1024 samples": (lambda: span_quartic(*six), "at most 3 s"),
    }


def scores() -> dict[str, tuple[Work, str]]:
    body, angle = Ellipsoid.of_axes((0.8, 0.6, 0.15)), math.radians(10)
    c, s = math.cos(angle), math.sin(angle)
    pair = [SoftContact([-x / 2, 0, 0], contact_axes([x * c, s, 0], np.eye(3)[2]), body) for x in (1.0, -1.0)]
    one, two = np.array([0.8, 0.7, 0.012]), np.array([0.8, 0.75, 0.011])
    return {
        "antipodal: volumes and epsilons": (lambda: score(one, two, 0.06, 0.2, 0.05), "at most 50 us"),
        "any pose: volume": (lambda: pose_volume(*pair, 1.0, 1.0), "at most 10 ms"),
        "any pose: epsilon between bounds": (lambda: epsilon(pair, 1.0, 1.0, (0, 0, 0)), ""),
    }


def every_kernel(seconds: float = 0.3) -> None:
    for part in (friction, limit_surfaces, scores):
        title(part.__name__.replace("_", " ").capitalize())
        for name, (work, goal) in part().items():
            line(name, span(fastest(work, seconds)), goal)
