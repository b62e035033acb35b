"""Outer surface of a thin-walled body traced on a triangle mesh: horizontal rays, smoothed and joined by splines.

A shell needs a structured mesh and a smooth face with normals and curvature; triangles, scanned ones above all, offer
neither. From a smooth centre line rays go out at even angles and at even steps along the outline. The radii they find
are freed from waves of the facets' size (``smoothing``) and split into the outline ``(z, a)(s)``, ``a`` the mean
radius, and the shape ``q(theta, s)`` of the sections: ``X = centre(z) + a q (cos theta, sin theta)``. Bottom and top
are closed by rounded lids as on other bodies; there the shape of the last section continues. Facets are chords: on a
round body the traced surface lies inside by about two thirds of their sagitta, ``size^2 / (8 radius)``.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.fem.objects.outer_surface import OuterSurface
from softjaw.fem.objects.profile import with_lids
from softjaw.fem.objects.revolution import Revolution
from softjaw.fem.objects.splines import SplineSurface, spline_surface
from softjaw.fem.objects.traced_outline import (
    FEW,
    Wall,
    by_length,
    cast,
    continued,
    curve_of,
    find_wall,
    folded,
    smooth_rings,
    smooth_spline,
)
from softjaw.fem.objects.triangle_tree import area_vectors
from softjaw.friction.patch import FloatArray

PER_WAVE = 16  # heights at which rays are cast
AROUND, MOST_ALONG = 256, 800
SYMMETRIC = 1e-6  # of the size: how exactly a symmetry has to be fulfilled ...
OFF = 0.03  # of the mean radius: a surface further from its mesh is refused


def _smooth_surface(
    mesh: MeshObject, wall: Wall, facet: float, wavelength: float, tolerance: float
) -> tuple[OuterSurface, float]:
    """Surface through the wall of a mesh with triangles of a size, with lids, and the waves that it may have [m].

    ``wavelength`` is about the shortest, ``tolerance`` how exactly a symmetry has to be fulfilled [m]. Raises
    `MeshError` for sections that are not star-shaped about their centres.
    """
    z = np.linspace(*wall.ends, MOST_ALONG)
    outer, inner = cast(mesh.points, mesh.triangles, z, wall.centre(z), FEW)
    # before any smoothing, which would draw a wall through the fold that is not there
    _refuse_folds(z, folded(outer, inner, facet))
    s = by_length(z, outer.mean(axis=1))
    # no shorter than the samples along and around the body can show
    wavelength = max(wavelength, 0.25 * PER_WAVE * s[-1] / MOST_ALONG, 8 * np.pi * wall.radius / AROUND)
    height = smooth_spline(s, z, wavelength, (0.0, s[-1]))
    s = np.linspace(0.0, s[-1], max(33, int(np.ceil(PER_WAVE * s[-1] / wavelength)) + 1))
    z = np.clip(height(s), *wall.ends)
    outer, inner = cast(mesh.points, mesh.triangles, z, wall.centre(z), 2048)  # rays at each height
    _refuse_folds(z, folded(outer, inner, facet))
    waves = np.maximum(8, 2 * np.pi * outer.mean(axis=1) / wavelength)  # waves round any section, at least
    R = smooth_rings(outer, waves, AROUND)
    R, symmetric, is_round = _symmetric(R, ~wall.centre(z).any(axis=0), tolerance)
    a = smooth_spline(s, R.mean(axis=1), wavelength, (0.0, s[-1]))
    curve, (start, stop), flat = with_lids(curve_of(height, a), Revolution.rim, wall.lids)
    # carried on over the lids, so that they have the shape of the last section
    q = continued(s + start, R / a(s)[:, None], wavelength, (0.0, float(curve.breaks[-1])))
    shape = _shape(q, AROUND)

    def section(theta: FloatArray, s: FloatArray, _z: FloatArray, _z_s: FloatArray) -> FloatArray:
        return shape.at(theta, s)[:, :3, :2].transpose(1, 0, 2)

    return OuterSurface(curve, (start, stop), flat, section, wall.centre, symmetric, is_round), wavelength


def _refuse_folds(z: FloatArray, bad: NDArray[np.bool_]) -> None:
    if bad.any():
        k = np.flatnonzero(bad.any(axis=1))
        ray = int(np.argmax(bad.sum(axis=0)))
        raise MeshError(
            f"a ray from the mesh's centre line does not meet the surface exactly once: z = {z[k[0]]:.4g} m to "
            f"{z[k[-1]]:.4g} m, mostly at {360 * ray / bad.shape[1]:.0f} degrees (handle, fold or hollow); cut it off"
            " in a mesh editor, or treat the object as rigid"
        )


def _symmetric(R: FloatArray, on_axis: FloatArray, tolerance: float) -> tuple[FloatArray, tuple[bool, bool], bool]:
    """Radii with the symmetries that they nearly have, made exact."""
    k = np.arange(R.shape[1])
    symmetric = []
    for axis, mirrored in ((0, R.shape[1] // 2 - k), (1, -k)):
        image = R[:, mirrored % len(k)]
        symmetric.append(bool(on_axis[axis] and np.abs(R - image).max() <= tolerance))
        if symmetric[-1]:
            # an exact symmetry lets the wall be meshed by halves
            R = 0.5 * (R + image)
    mean = R.mean(axis=1, keepdims=True)
    is_round = all(symmetric) and bool(np.abs(R - mean).max() <= tolerance)
    return (np.repeat(mean, len(k), axis=1) if is_round else R), (symmetric[0], symmetric[1]), is_round


class TraceReport(NamedTuple):
    """What was traced, and how well.

    ``largest, rms``: distance of the mesh's corners and middles of triangles on the wall to the traced surface [m], and
    the ``place`` (height [m], angle [rad]) of the largest; ``wavelength``: shorter waves are smoothed out [m].
    """

    largest: float
    rms: float
    place: tuple[float, float]
    wavelength: float


def traced(mesh: MeshObject) -> tuple[OuterSurface, TraceReport]:
    """Smooth surface near a closed mesh with the axis z, for a thin-walled body of the same outside.

    All of it but the bottom and the top. Raises `MeshError` for sections that a ray from the centre line leaves more
    than once, and where the surface does not fit.
    """
    facet, size = facet_size(mesh), float(np.ptp(mesh.bounds, axis=0).max())
    wall = find_wall(mesh, facet, SYMMETRIC * size)
    # the shortest wave has three facets, or a share of the wall's height
    length = min(3.0 * facet, 0.15 * (wall.ends[1] - wall.ends[0]))
    # a share of the facets' sagitta, which says nothing about the body
    tolerance = max(SYMMETRIC * size, 0.01 * facet**2 / (8 * wall.radius))
    surface, wavelength = _smooth_surface(mesh, wall, facet, length, tolerance)
    report = _report(surface, mesh, wall, wavelength)
    if report.largest > OFF * wall.radius:
        z, angle = report.place
        raise MeshError(
            f"near z = {z:.4g} m at {np.degrees(angle):.0f} degrees the smooth wall is {report.largest * 1e3:.3g} mm "
            "off the mesh (ledge, edge or bulge): smooth it in a mesh editor, or treat the object as rigid"
        )
    return surface, report


def facet_size(mesh: MeshObject) -> float:
    """Median over the area of the triangles' shortest sides [m]."""
    X = mesh.points[mesh.triangles]
    side = np.linalg.norm(X - np.roll(X, 1, axis=1), axis=2).min(axis=1)
    area = np.linalg.norm(area_vectors(mesh.points, mesh.triangles), axis=1)
    order = np.argsort(side)
    total = np.cumsum(area[order])
    return float(side[order][np.searchsorted(total, 0.5 * total[-1])])


def _shape(q: BSpline, around: int) -> SplineSurface:
    """Sections ``q (cos theta, sin theta, 0)`` in units of the mean radius, as splines round and along."""
    knots = q.t[3:-3]
    s = np.linspace(knots[0], knots[-1], 2 * (len(knots) - 1) + 1)  # splines of the shape per knot of the outline
    theta = np.linspace(0.0, 2 * np.pi, around + 1)
    e = np.stack([np.cos(theta), np.sin(theta), 0 * theta], axis=1)
    values = q(s)
    # a closed surface has to end where it began
    values = np.concatenate([values, values[:, :1]], axis=1).T
    return spline_surface(theta, s, values[:, :, None] * e[:, None, :])


def _report(surface: OuterSurface, mesh: MeshObject, wall: Wall, wavelength: float) -> TraceReport:
    """Distances between mesh and surface."""
    middle, normal = mesh.points[mesh.triangles].mean(axis=1), area_vectors(mesh.points, mesh.triangles)
    away = middle[:, :2] - wall.centre(middle[:, 2])
    outwards = np.einsum("ni,ni->n", away, normal[:, :2]) > 0  # not the inner wall of a hollow mesh
    x = np.concatenate([mesh.points[np.unique(mesh.triangles[outwards])], middle[outwards]])
    s = np.linspace(*surface.wall, 8 * len(surface.curve.breaks))
    z = surface.curve.derivative(s)[:, 0]
    x = x[(x[:, 2] >= z[0]) & (x[:, 2] <= z[-1])]
    d = x[:, :2] - wall.centre(x[:, 2])
    theta, s = np.arctan2(d[:, 1], d[:, 0]), np.interp(x[:, 2], z, s)
    off = np.abs(np.einsum("ni,ni->n", x - surface.jets(theta, s)[:, 0], surface.normals(theta, s)))
    k = int(off.argmax())
    place = float(x[k, 2]), float(theta[k])
    return TraceReport(float(off[k]), float(np.sqrt((off**2).mean())), place, wavelength)
