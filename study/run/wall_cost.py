"""What a thin wall adds to the memory and the time of a study, by rules of thumb, before anything is solved."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from softjaw.study.case.build import outer_surface
from softjaw.study.scene.grasp_warnings import half_extent_mm

# Measured on a cup of 0.4 mm, 5 000 to 21 000 unknowns: a force takes 7 Newton steps of 15 us per unknown each; the
# factors, what they are made from and what is not given back take 16 kB per unknown of the wall.
SECONDS, BYTES = 1e-4, 1.6e4
DENSE = 8  # copies of a linear wall's dense stiffness: compliance, inverse, assembled entries and their factors
CUBE = 2.1e-10  # seconds per force and cube of the unknowns of that stiffness
MARGIN = 0.1  # of the pad's length, round what it covers


@dataclass(frozen=True)
class WallSize:
    """Unknowns of one candidate.

    Attributes
    ----------
    pad, shell : int
        Of the pads that are solved, and of the nonlinear shell.
    whole, touched : int
        Of the linear shell that all candidates share, and of its part that pads can touch.
    """

    pad: int
    shell: int
    whole: int
    touched: int

    @property
    def seconds(self) -> tuple[float, float, float]:
        """Time of one force on a rigid object, a linear and a nonlinear shell [s]."""
        rigid = SECONDS * self.pad
        return rigid, rigid + CUBE * self.touched**3, rigid + SECONDS * self.shell

    @property
    def memory(self) -> float:
        """Memory of the costlier of both shells [bytes]."""
        linear = BYTES * self.whole + 8.0 * DENSE * float(self.touched) ** 2
        return max(BYTES * self.shell, linear)


def wall_size(scene: Any) -> WallSize | None:
    """Unknowns of a candidate in the middle of the scene's stations; None where the wall has no outline to divide."""
    from softjaw.fem.objects.outer_surface import Turned
    from softjaw.fem.shell.wall_mesh import MeshSize, along, around

    try:
        surface, is_round = outer_surface(scene.object)
    except (AttributeError, ValueError):
        return None
    angle = 0.0 if scene.candidates.poses else scene.candidates.angles[0]
    turned, accuracy = Turned(surface, angle, is_round), scene.accuracy
    mirrors = _mirrors(scene, turned.symmetric)
    low, high, half = _covered(scene, surface)

    def grid(heights: tuple[float, float]) -> tuple[np.ndarray, np.ndarray]:
        size = MeshSize((0.0, math.pi), heights, half, accuracy.wall_around, accuracy.wall_along, accuracy.wall_coarse)
        return around(turned, size, mirrors), along(turned, size, False, scene.object.open_top, 0.0)

    theta, s = grid((low, high))
    wide, tall = grid(_heights(surface))
    radius, z = surface.curve.derivative(tall)[:, 1], surface.curve.derivative(tall)[:, 0]
    beside = np.abs(np.sin(theta)) * radius[(z >= low) & (z <= high)].max(initial=half) <= half
    ends = 4 >> sum(mirrors)  # one more line beside each end of a region
    touched = (np.count_nonzero(beside) + ends) * (np.count_nonzero((z >= low) & (z <= high)) + 2)
    return WallSize(_pad(scene, mirrors), 6 * len(theta) * len(s), 6 * len(wide) * len(tall), 6 * touched)


def _mirrors(scene: Any, symmetric: tuple[bool, bool]) -> tuple[bool, bool]:
    """Planes of symmetry of a grasp across the axis that the meshes can use."""
    if scene.candidates.poses or scene.effects.model_size == "full":
        return False, False
    even = scene.gripper.elements[1] % 2 == 0 and abs(math.sin(2 * scene.candidates.roll)) < 1e-9
    return symmetric[0] and scene.effects.model_size != "half", symmetric[1] and even


def _covered(scene: Any, surface: Any) -> tuple[float, float, float]:
    """Heights that a pad reaches over at the middle station, and half of what it covers round the object [m]."""
    gripper, where = scene.gripper, scene.candidates
    margin = MARGIN * max(gripper.pad_size[:2])
    ends = _heights(surface)
    middle = 0.5 * sum(ends) if where.poses else where.station_values[len(where.station_values) // 2]
    along = 1e-3 * half_extent_mm(where, gripper) + margin
    low, high = np.clip([middle - along, middle + along], *ends)
    return float(low), float(high), 0.5 * gripper.pad_size[1] + margin


def _heights(surface: Any) -> tuple[float, float]:
    z = surface.curve.derivative(np.linspace(*surface.wall, 257))[:, 0]
    return float(z.min()), float(z.max())


def _pad(scene: Any, mirrors: tuple[bool, bool]) -> int:
    """Unknowns of the pads that are solved, from the nodes of the whole pad."""
    nx, ny, nz = (n * (2 if scene.gripper.element == "hex27" else 1) + 1 for n in scene.gripper.elements)
    fingers = 1 if mirrors[0] else 2
    return round(3 * nx * ny * nz * fingers * (0.5 if mirrors[1] else 1.0))
