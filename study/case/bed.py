"""Both pads on a bed of springs over any triangle surface: what each meets, and what the grasp promises.

A gripper closes along a line, so what each pad meets is a height field over its face: of every line along the approach
the first point of the object from one side and from the other. Both fields come from one pass over the triangles. They
need no closed mesh and no normals, and inner walls or thin parts behind do not count.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property

import numpy as np
from numba import njit
from scipy.spatial import QhullError

from softjaw.fem.objects.gap import IntArray, Pose
from softjaw.friction.patch import ContactPatch, FloatArray, NoContactError
from softjaw.study.case.contact import Contact, angle
from softjaw.study.case.fit import Jaws, bed_closing
from softjaw.study.case.task import Task, payload_alone

GRID = (25, 11)  # points of a pad's face along length and width
CRUSHED = 0.25  # strain of the bed at its highest pressure that leaves half of a grasp
INNER = (slice(1, -1), slice(1, -1))  # of height fields that reach one cell beyond the pad's face
ALONG, ACROSS = (np.gradient(np.eye(n), axis=0) for n in GRID)  # differences of neighbouring cells


def cells(pad: FloatArray, low: FloatArray, high: FloatArray) -> tuple[list[FloatArray], list[FloatArray]]:
    """Places of cells along both sides of a face, one more even step at both ends, and x and y of its own [m].

    They divide what of the face an object between ``low (2,)`` and ``high (2,)`` can meet, so that a small object gets
    as many as a large one, and the same ones wherever it lies under the pad.
    """
    low, high = np.maximum(low, -0.5 * pad), np.minimum(high, 0.5 * pad)
    if (low >= high).any():
        raise NoContactError("the pad misses the object")
    middle, sides = 0.5 * (low + high), high - low
    wider = [m + d * ((np.arange(-1, n + 1) + 0.5) / n - 0.5) for m, d, n in zip(middle, sides, GRID, strict=True)]
    return wider, list(np.meshgrid(*(part[1:-1] for part in wider), indexing="ij"))


@njit(cache=True)
def height_fields(points, triangles, x, y):
    """Lowest and highest z of a surface over the grid ``x (m,)`` times ``y (n,)``: two ``(m, n)`` arrays.

    Infinite (positive in the lowest, negative in the highest) where a line along z misses every triangle. ``points
    (k, 3)`` are in the frame of the grid, whose steps are even.
    """
    m, n = len(x), len(y)
    low, high = np.full((m, n), np.inf), np.full((m, n), -np.inf)
    dx, dy = x[1] - x[0], y[1] - y[0]
    for t in range(len(triangles)):
        p, q, r = triangles[t, 0], triangles[t, 1], triangles[t, 2]
        ax, bx, cx, ay, by, cy = points[p, 0], points[q, 0], points[r, 0], points[p, 1], points[q, 1], points[r, 1]
        x_min, x_max, y_min, y_max = min(ax, bx, cx), max(ax, bx, cx), min(ay, by, cy), max(ay, by, cy)
        if x_max < x[0] or x_min > x[-1] or y_max < y[0] or y_min > y[-1]:
            continue
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:  # seen from its edge: its neighbours have the line
            continue
        first, last = max(0, math.ceil((x_min - x[0]) / dx)), min(m - 1, math.floor((x_max - x[0]) / dx))
        start, stop = max(0, math.ceil((y_min - y[0]) / dy)), min(n - 1, math.floor((y_max - y[0]) / dy))
        for i in range(first, last + 1):
            for j in range(start, stop + 1):
                u = ((bx - x[i]) * (cy - y[j]) - (by - y[j]) * (cx - x[i])) / area
                v = ((cx - x[i]) * (ay - y[j]) - (cy - y[j]) * (ax - x[i])) / area
                w = 1.0 - u - v
                if u >= -1e-12 and v >= -1e-12 and w >= -1e-12:
                    z = u * points[p, 2] + v * points[q, 2] + w * points[r, 2]
                    low[i, j], high[i, j] = min(low[i, j], z), max(high[i, j], z)
    return low, high


class Side:
    """What one pad meets: closing at which each cell of its face touches ``height (m, n)`` [m], normals, pressures."""

    def __init__(self, height: FloatArray, x: FloatArray, y: FloatArray, jaws: Jaws) -> None:
        self.jaws, self.x, self.y = jaws, x, y
        self.touch, self.steps = float(height.min()), (x[1, 0] - x[0, 0], y[0, 1] - y[0, 0])
        self.height, self.cell = np.ascontiguousarray(height - self.touch), self.steps[0] * self.steps[1]
        depth = bed_closing(self.height, jaws.force / (jaws.stiffness * self.cell))
        self.pressure = jaws.stiffness * np.maximum(depth - self.height, 0.0)
        z = np.where(np.isfinite(self.height), self.height, jaws.pad[2])
        slope = np.stack([ALONG @ z / self.steps[0], z @ ACROSS.T / self.steps[1]], axis=-1)
        # a cell whose neighbour misses the object, or lies far behind it, is at a silhouette: its slope says nothing;
        # one that is steeper than this is the object's flank
        self.slope = np.where((np.abs(slope) > 3.0).any(axis=-1, keepdims=True), 0.0, slope)

    @cached_property
    def centre(self) -> FloatArray:
        """Centre of pressure on the face ``(2,)`` [m]."""
        return np.array([(self.pressure * self.x).sum(), (self.pressure * self.y).sum()]) / self.pressure.sum()

    @property
    def normal(self) -> FloatArray:
        """Mean direction into the object in the pad's frame, weighted by pressure; z is the approach ``(3,)``."""
        x, y = (self.pressure[..., None] * self.slope).sum(axis=(0, 1)) / self.pressure.sum()
        # the height grows where the surface recedes: its outward normal leans towards that side
        direction = np.array([-x, -y, 1.0])
        return direction / np.linalg.norm(direction)

    @property
    def peak(self) -> float:
        """What the highest pressure leaves: foam that is crushed somewhere carries little there, and solves badly."""
        strain = float(self.pressure.max()) / (self.jaws.stiffness * self.jaws.pad[2])
        return 1.0 / (1.0 + (strain / CRUSHED) ** 2)

    def contact(self, pose: Pose) -> Contact:
        """The loaded cells as a contact, in the frame of a pad that stands at ``pose`` in the object's frame."""
        on = self.pressure > 0.0
        normal = np.column_stack([-self.slope[on], np.ones(np.count_nonzero(on))])
        centroid = np.column_stack([self.x[on], self.y[on], self.height[on]])
        patch = ContactPatch(centroid, np.full(len(normal), self.cell), normal, self.pressure[on])
        return Contact(patch, self.jaws.mu, pose)


class JawsOnSurface:
    """Both pads on a surface, in one pose of the gripper."""

    def __init__(self, surface: tuple[FloatArray, IntArray], point: FloatArray, axes: FloatArray, jaws: Jaws) -> None:
        self.point, self.axes, self.jaws = point, axes, jaws
        self.local, self.triangles = np.ascontiguousarray((surface[0] - point) @ axes), surface[1]
        beside = self.local[:, :2]
        wider, (x, y) = cells(np.array(jaws.pad[:2]), beside.min(axis=0), beside.max(axis=0))
        low, high = height_fields(self.local, self.triangles, *wider)
        if not np.isfinite(low[INNER]).any():
            raise NoContactError("the pad misses the object")
        # finger 2 looks against the approach, with its short side reversed
        self.sides = Side(low[INNER], x, y, jaws), Side(-high[:, ::-1][INNER], x, -y[:, ::-1], jaws)
        self._fields = low, -high[:, ::-1]

    @property
    def opening(self) -> float:
        """Distance of the pads' faces at first touch [m]."""
        return -self.sides[0].touch - self.sides[1].touch

    @property
    def depth(self) -> float:
        """From the gripper's point to the middle between both contacts, along the approach [m]."""
        return 0.5 * (self.sides[0].touch - self.sides[1].touch)

    @property
    def middle(self) -> FloatArray:
        """Middle between both contacts on the line of approach ``(3,)`` [m]."""
        return self.point + self.depth * self.axes[:, 2]

    @property
    def tilt(self) -> FloatArray:
        """Approach that meets both contacts squarely, in the frame of the gripper ``(3,)``."""
        first, second = (side.normal for side in self.sides)
        mean = first + np.array([second[0], -second[1], second[2]]) * [-1.0, -1.0, 1.0]
        return mean / np.linalg.norm(mean)

    @property
    def shift(self) -> FloatArray:
        """From the middle of the pads to the middle of both centres of pressure ``(2,)`` [m]."""
        first, second = (side.centre for side in self.sides)
        return 0.5 * (first + second * [1.0, -1.0])

    @property
    def misalignment(self) -> tuple[float, float]:
        """Angle between one contact normal and the other reversed, and of their line to a normal [rad]."""
        first, two = self.sides[0].normal, self.sides[1].normal * [1.0, -1.0, -1.0]
        (x, y), (u, v) = self.sides[0].centre, self.sides[1].centre
        line = np.array([u - x, -v - y, self.opening])
        return angle(first, -two), max(angle(first, line), angle(-two, line))

    @property
    def contacts(self) -> list[Contact]:
        """Both contacts where they lie on the object."""
        frames = [self.axes @ turn for turn in (np.eye(3), np.diag([1.0, -1.0, -1.0]))]
        return [
            side.contact(Pose(axes, self.point + side.touch * axes[:, 2]))
            for side, axes in zip(self.sides, frames, strict=True)
        ]

    @property
    def peak(self) -> float:
        """What the highest pressure leaves on the finger where that is less."""
        return min(side.peak for side in self.sides)

    @property
    def on_edges(self) -> float:
        """Share of its force that a finger bears beside an edge of the object, where that is more."""
        shares = []
        for side, height in zip(self.sides, self._fields, strict=True):
            z = np.where(np.isfinite(height), height, side.touch + side.jaws.pad[2])
            edge = np.zeros(z.shape, dtype=bool)
            for field, mask, step in zip((z, z.T), (edge, edge.T), side.steps, strict=True):
                jump = np.abs(np.diff(field, axis=0)) > 3.0 * abs(step)
                mask[:-1] |= jump
                mask[1:] |= jump
            shares.append(float(side.pressure[edge[INNER]].sum() / side.pressure.sum()))
        return max(shares)

    def over(self, lids: FloatArray) -> bool:
        """Whether a pad lies over a hole, given by the corners ``(n, 3, 3)`` of the triangles that close it [m]."""
        corners = (lids - self.point) @ self.axes
        low, high = corners.min(axis=1), corners.max(axis=1)
        length, width, thick = self.jaws.pad
        # share of a pad's sides, from its middle: a solve looks so far at the surface
        reach = 0.6 * np.array([length, width])
        beside = ((low[:, :2] <= reach) & (high[:, :2] >= -reach)).all(axis=1)
        faces = self.sides[0].touch, -self.sides[1].touch
        return any(bool((beside & (low[:, 2] <= z + thick) & (high[:, 2] >= z - thick)).any()) for z in faces)


def grips(
    surface: tuple[FloatArray, IntArray], frames: Iterable[tuple[FloatArray, FloatArray]], jaws: Jaws,
    lids: FloatArray | None,
) -> Iterator[JawsOnSurface]:  # fmt: skip
    """Both pads in frames ``(point, axes)``, without those that miss the surface or lie over a hole."""
    for point, axes in frames:
        try:
            grip = JawsOnSurface(surface, point, axes, jaws)
        except NoContactError:
            continue
        if lids is None or not grip.over(lids):
            yield grip


def spring_payload(contacts: Sequence[Contact], task: Task, least: float = 0.0) -> float:
    """Payload of contacts on a bed of springs [kg], or less than ``least``; 0 where they bear no torque at all."""
    try:
        return payload_alone(contacts, task, least)["maps/payload"]
    except (ArithmeticError, QhullError, RuntimeError, ValueError):
        return 0.0
