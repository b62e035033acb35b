"""Outline of a triangle mesh: where its upright wall begins and ends, its centre line, and the lids that close it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline

from softjaw.fem.errors import MeshError
from softjaw.fem.objects.mesh_object import MeshObject
from softjaw.fem.objects.pose import FloatArray
from softjaw.fem.objects.profile import POLE, Curve, joint, line, rounding, spline
from softjaw.fem.objects.section_rays import Rays, cast, centroids
from softjaw.fem.objects.smoothing import smooth_spline

LEVELS = 400  # heights of the first look at a mesh
FEW = 64  # rays per height of that look
STEEP = 1.0  # slope dr/dz from which a surface counts as bottom or top, not as wall
STEEPEST = 4.0  # slope up to which the outline is followed by its length
LEAST = 0.3  # of the height has to be wall
END = 0.1  # of the height may be folded at either end, as a hollow bottom is, and count as bottom or top
DOME = 0.9  # a rounding that reaches this far to the axis is drawn as a dome


@dataclass(frozen=True)
class Wall:
    """Upright part of a mesh.

    Attributes
    ----------
    ends : (float, float)
        First and last height [m].
    lids : (float or None, float or None)
        Heights of the bottom and of the top [m]; None at an end that was asked for, not found.
    centre : callable
        Centres ``(k, 2)`` by height and order of the derivative [m].
    radius : float
        Mean [m].
    """

    ends: tuple[float, float]
    lids: tuple[float | None, float | None]
    centre: Callable
    radius: float


def find_wall(mesh: MeshObject, facet: float, rim: float, wanted: tuple[float, float] | None, tolerance: float) -> Wall:
    """Wall of a mesh, between the part that counts as its bottom and the part that counts as its top.

    Parameters
    ----------
    facet : float
        Size of the triangles [m]: smaller folds do not matter.
    rim : float
        Height at either end that is left to the rounding of the edge [m].
    wanted : (float, float) or None
        Heights to keep to [m].
    tolerance : float
        Centres this close to the axis are on it [m].
    """
    low, high = (float(v) for v in mesh.bounds[:, 2])
    z = low + (np.arange(LEVELS) + 0.5) * (high - low) / LEVELS
    centre = np.nan_to_num(centroids(mesh.points, mesh.triangles, z))
    rays = cast(mesh.points, mesh.triangles, z, centre, FEW)
    r = np.nan_to_num(rays.outer).mean(axis=1)
    at_end = np.abs(z - 0.5 * (low + high)) > (0.5 - END) * (high - low)
    bad, slope = folded(rays, facet).any(axis=1) & at_end, np.gradient(r, z)
    first, last = _run(bad | (slope > STEEP)), len(z) - 1 - _run((bad | (slope < -STEEP))[::-1])
    found = max(z[min(first, len(z) - 1)], low + rim), min(z[max(last, 0)], high - rim)
    asked = wanted or (low, high)
    ends = max(found[0], asked[0]), min(found[1], asked[1])
    if ends[1] - ends[0] < LEAST * (min(asked[1], high) - max(asked[0], low)) or ends[1] <= ends[0]:
        raise MeshError(
            f"the mesh has no upright wall: of z = {asked[0]:.4g} m to {asked[1]:.4g} m only {ends[0]:.4g} m to "
            f"{max(ends):.4g} m is neither bottom nor top; check the mesh's axis, or treat the object as rigid"
        )
    inside = (z >= ends[0]) & (z <= ends[1])
    radius = float(r[inside].mean())
    lids = low if ends[0] == found[0] else None, high if ends[1] == found[1] else None
    return Wall(ends, lids, _centre_line(z[inside], centre[inside], ends, 2 * radius, tolerance), radius)


def folded(rays: Rays, facet: float) -> NDArray[np.bool_]:
    """Rays ``(k, n)`` that miss the surface or cross it at places further apart than a facet."""
    return ~(rays.outer - rays.inner <= facet)


def _run(found: NDArray[np.bool_]) -> int:
    """Length of the run of True at the beginning."""
    return int(len(found) if found.all() else np.argmin(found))


def _centre_line(
    z: FloatArray, centre: FloatArray, ends: tuple[float, float], wavelength: float, tolerance: float
) -> Callable:
    """Smooth line through centres ``(k, 2)``, upright beyond the ends and exactly on the axis where nearly so."""
    centre = np.where(np.abs(centre).max(axis=0) <= tolerance, 0.0, centre)
    reach = ends[0] - wavelength, ends[1] + wavelength
    f = continued(z, centre, wavelength, reach)

    def value(height: FloatArray, order: int = 0) -> FloatArray:
        inside = (height >= reach[0]) & (height <= reach[1])
        return np.where((inside | (order == 0))[:, None], f(np.clip(height, *reach), nu=order), 0.0)

    return value


def continued(x: FloatArray, y: FloatArray, wavelength: float, ends: tuple[float, float]) -> BSpline:
    """Smooth spline near samples that goes over to the first and the last one beyond them."""
    step = float(np.median(np.diff(x)))
    before = np.arange(ends[0], x[0] - 0.5 * wavelength, step)
    after = np.arange(ends[1], x[-1] + 0.5 * wavelength, -step)[::-1]
    values = np.concatenate([np.repeat(y[:1], len(before), axis=0), y, np.repeat(y[-1:], len(after), axis=0)])
    return smooth_spline(np.concatenate([before, x, after]), values, wavelength, ends)


def by_length(z: FloatArray, r: FloatArray) -> FloatArray:
    """Places ``s (k,)`` of heights along an outline; a ledge steeper than ``STEEPEST`` gets less than its length."""
    slope = np.clip(np.diff(r) / np.diff(z), -STEEPEST, STEEPEST)
    return np.concatenate([[0.0], np.cumsum(np.diff(z) * np.hypot(1.0, slope))])


def curve_of(z: BSpline, r: BSpline) -> Curve:
    """Outline of two splines on the same knots."""
    breaks = z.t[3:-3]
    powers = [np.stack([f(breaks[:-1], nu=k) / g for k, g in enumerate((1, 1, 2, 6))], axis=1) for f in (z, r)]
    return Curve(breaks - breaks[0], np.stack(powers, axis=1))


def lid(curve: Curve, height: float | None, rim: float, *, first: bool) -> list[Curve]:
    """Rounded edge and flat lid that carry one end of an outline to the axis, in the order of its s.

    The lid lies at ``height``, or where an edge rounded by ``rim`` ends [m]. Where the rounding would come close to the
    axis, a dome is drawn.
    """
    s = curve.breaks[:1] if first else curve.breaks[-1:]
    p, d1, d2 = (curve.derivative(s, order)[0] for order in range(3))
    mirror = np.array([-1.0, 1.0]) if first else np.ones(2)  # the first end is a last one, seen backwards
    speed = np.linalg.norm(d1)
    d1, d2 = d1 / speed, (d2 - (d2 @ d1) * d1 / speed**2) / speed**2
    t, inwards = (-d1 if first else d1) * mirror, np.array([0.0, -1.0])
    fall = 1.0 - t @ inwards
    radius = min(rim, 0.25 * p[1]) if height is None else abs(height - p[0]) / fall
    if radius * np.sqrt(1.0 - (t @ inwards) ** 2) > DOME * p[1]:
        pole = np.array([p[0] + mirror[0] * radius * fall, 0.0])
        if first:
            return [spline(np.array([pole, p]), POLE, joint(d1, d2))]
        return [spline(np.array([p, pole]), joint(d1, d2), POLE)]
    arc, length = rounding(p * mirror, t, inwards, radius)
    end = np.array([arc[-1][0], 0.0])
    if first:
        edge = spline(arc[::-1] * mirror, joint(-inwards), joint(d1, d2), length[-1] - length[::-1])
        return [line(end * mirror, arc[-1] * mirror), edge]
    return [spline(arc, joint(d1, d2), joint(inwards), length), line(arc[-1], end)]
