"""What GraspIt!'s linearisation makes of the quality: the hull of 20 points on each ellipsoid instead of the ellipsoid.

    python jobs/graspit.py results/smoke.hdf

GraspIt! (A. T. Miller and P. K. Allen 2004) puts its points on the limit surface, so the volume is too small.
"""

from __future__ import annotations

import sys

import numpy as np
from numpy.typing import ArrayLike

import softjaw as sj
from softjaw.lsfit.ellipsoid import Ellipsoid
from softjaw.scoring.closed_form import volume_linf
from softjaw.scoring.contact import PolytopeBody


def graspit_vertices(semi_axes: ArrayLike) -> np.ndarray:
    """The 20 vertices of GraspIt!'s soft contact, ``(20, 3)``.

    Directions at the latitudes 90, 45, 0, -45, -90 degrees with 1, 5, 8, 5, 1 points, pushed out radially to the
    ellipsoid.
    """
    rings = [(90, 1), (45, 5), (0, 8), (-45, 5), (-90, 1)]
    latitude = np.radians(np.concatenate([np.full(k, angle) for angle, k in rings]))
    longitude = np.concatenate([2 * np.pi * np.arange(k) / k for _, k in rings])
    u = np.column_stack([np.cos(latitude) * np.cos(longitude), np.cos(latitude) * np.sin(longitude), np.sin(latitude)])
    return u / np.linalg.norm(u / np.asarray(semi_axes, float), axis=1, keepdims=True)


def volume_share(first: ArrayLike, second: ArrayLike, torques: float) -> float:
    """Linearised over exact volume of the grasp wrench space of two ellipsoids that face each other.

    ``torques`` is the length by which torques are divided [m], which decides where GraspIt!'s points lie.
    """
    axes = [np.asarray(a, float) / [1.0, 1.0, torques] for a in (first, second)]
    hulls, exact = (
        [(body.volume, body.shadow_area) for body in bodies]
        for bodies in ([PolytopeBody(graspit_vertices(a)) for a in axes], map(Ellipsoid.of_axes, axes))
    )
    return volume_linf(*hulls[0], *hulls[1], 1.0) / volume_linf(*exact[0], *exact[1], 1.0)


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit(__doc__)
    data = sj.open(sys.argv[1])
    semi_axes = data.limit_surface_semi_axes.sel(model="ccm").transpose(..., "finger", "component").values
    pairs = semi_axes.reshape(-1, *semi_axes.shape[-2:])
    shares = [volume_share(one, other, 0.05) for one, other in pairs if min(one.min(), other.min()) > 0]
    print(f"GraspIt!'s volume over the exact one: {min(shares):.3f} to {max(shares):.3f} in {len(shares)} cases")
