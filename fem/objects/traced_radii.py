"""Radii of a triangle mesh on a grid of angles and of places along its outline: cast, checked, smoothed, mirrored."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import BSpline

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.fem.objects.pose import FloatArray
from softjaw.fem.objects.section_rays import Rays, cast
from softjaw.fem.objects.smoothing import smooth_rings, smooth_spline
from softjaw.fem.objects.traced_outline import FEW, Wall, by_length, folded

PER_WAVE = 16  # heights at which rays are cast
RAYS = 2048  # at each height
AROUND, MOST_ALONG = 256, 800
FEWEST_WAVES = 8  # that are kept round any section


@dataclass(frozen=True)
class Radii:
    """Smooth radii on the wall.

    Attributes
    ----------
    s, z : (k,) arrays
        Places along the outline, from 0 on, and their heights [m].
    R : (k, n) array
        Distance from the centre line at even angles from 0 [m]; rough along s.
    height : BSpline
        ``z(s)``.
    wavelength : float
        Waves shorter than this are taken out [m].
    symmetric : (bool, bool)
        Whether x = 0 and y = 0 are planes of symmetry; R then is so exactly.
    round : bool
    """

    s: FloatArray
    z: FloatArray
    R: FloatArray
    height: BSpline
    wavelength: float
    symmetric: tuple[bool, bool]
    round: bool


def trace_radii(mesh: MeshObject, wall: Wall, facet: float, wavelength: float, tolerance: float) -> Radii:
    """Radii of the wall of a mesh.

    Parameters
    ----------
    facet : float
        Size of the triangles [m]: smaller folds do not matter.
    wavelength : float
        Wanted; the grid may need a longer one [m].
    tolerance : float
        How exactly a symmetry has to be fulfilled [m].

    Raises
    ------
    MeshError
        For sections that are not star-shaped about their centres.
    """
    z = np.linspace(*wall.ends, MOST_ALONG)
    rays = cast(mesh.points, mesh.triangles, z, wall.centre(z), FEW)
    _refuse_folds(z, rays, facet)
    s = by_length(z, rays.outer.mean(axis=1))
    wavelength = max(wavelength, 0.25 * PER_WAVE * s[-1] / MOST_ALONG, 8 * np.pi * wall.radius / AROUND)
    height = smooth_spline(s, z, wavelength, (0.0, s[-1]))
    s = np.linspace(0.0, s[-1], max(33, int(np.ceil(PER_WAVE * s[-1] / wavelength)) + 1))
    z = np.clip(height(s), *wall.ends)
    rays = cast(mesh.points, mesh.triangles, z, wall.centre(z), RAYS)
    _refuse_folds(z, rays, facet)
    waves = np.maximum(FEWEST_WAVES, 2 * np.pi * rays.outer.mean(axis=1) / wavelength)
    R = smooth_rings(rays.outer, waves, AROUND)
    R, symmetric, is_round = _symmetric(R, ~wall.centre(z).any(axis=0), tolerance)
    return Radii(s, z, R, height, wavelength, symmetric, is_round)


def _refuse_folds(z: FloatArray, rays: Rays, facet: float) -> None:
    bad = folded(rays, facet)
    if bad.any():
        k = np.flatnonzero(bad.any(axis=1))
        ray = int(np.argmax(bad.sum(axis=0)))
        raise MeshError(
            f"between z = {z[k[0]]:.4g} m and {z[k[-1]]:.4g} m a ray from the mesh's centre line does not meet the "
            f"surface exactly once, most often at {360 * ray / bad.shape[1]:.0f} degrees (a handle, fold or hollow): "
            "choose stations elsewhere and leave these heights out with object.wall_heights_mm = [low, high], or treat "
            "the object as rigid"
        )


def _symmetric(R: FloatArray, on_axis: FloatArray, tolerance: float) -> tuple[FloatArray, tuple[bool, bool], bool]:
    """Radii with the symmetries that they nearly have, made exact."""
    k = np.arange(R.shape[1])
    found = []
    for axis, mirrored in ((0, R.shape[1] // 2 - k), (1, -k)):
        image = R[:, mirrored % len(k)]
        found.append(bool(on_axis[axis] and np.abs(R - image).max() <= tolerance))
        if found[-1]:
            R = 0.5 * (R + image)
    mean = R.mean(axis=1, keepdims=True)
    is_round = all(found) and bool(np.abs(R - mean).max() <= tolerance)
    return (np.repeat(mean, len(k), axis=1) if is_round else R), (found[0], found[1]), is_round
