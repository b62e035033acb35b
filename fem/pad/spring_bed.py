"""The pad as a bed of independent springs: where to start a contact solve that has no contact yet."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.contact.problem import Gap
from softjaw.fem.pad.mesh import Pad

FloatArray = NDArray[np.float64]
BISECTIONS = 60
STIFF_VOLUME = 0.45  # Poisson's ratio above which squeezed columns are a worse start than columns that only move


class SpringBed:
    """Columns of foam of modulus E between the sheet and the object; ``gap`` as in ``fem.contact.press.Press``."""

    def __init__(self, pad: Pad, gap: Gap) -> None:
        self.pad, self.gap = pad, gap

    @cached_property
    def height(self) -> FloatArray:
        """Distance along the approach from every node of the undeformed front to the object, roughly ``(n,)`` [m]."""
        gap, normal, _ = self.gap(self.pad.nodes[self.pad.front_nodes])
        return np.maximum(gap, 0.0) / np.maximum(-normal[:, 2], 0.2)

    def force(self, travel: float) -> float:
        """Normal force on the whole pad [N]."""
        pressure = self.pad.modulus_per_thickness * np.maximum(0.0, travel - self.height)
        return float(self.pad.node_area @ pressure) / self.pad.share

    def force_scale(self, travel: float) -> float:
        """Force that a residual at this travel is judged by, never zero [N]."""
        one_node = self.pad.modulus_per_thickness * self.pad.node_area.max() * abs(travel)
        return max(self.force(travel), 1e-3 * one_node)

    def travel(self, force: float) -> float:
        """Travel at which the bed carries the force [m]."""
        low, high = 0.0, 1e-3 * self.pad.shape.size[2]
        while self.force(high) < force and high < 10 * self.pad.shape.size[2]:
            high *= 2.0
        for _ in range(BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.force(middle) < force else (low, middle)
        return high

    def guess(self, travel: float) -> FloatArray:
        """Vector of unknowns: columns shortened affinely, so that no element starts inverted, and their pressures."""
        pad = self.pad
        squeeze = np.clip(travel - self.height, 0.0, 0.6 * pad.shape.size[2])
        u = np.zeros(pad.dofs.shape)
        u[:, 2] = travel
        if pad.material.poisson_ratio <= STIFF_VOLUME:
            u[:, 2] -= squeeze[self._column] * (1.0 + pad.nodes[:, 2] / pad.shape.size[2])
        x = np.zeros(pad.size)
        x[pad.dofs[pad.dofs >= 0]] = u[pad.dofs >= 0]
        x[pad.travel_dof] = travel
        x[pad.travel_dof + 1 :] = squeeze
        return x

    @cached_property
    def _column(self) -> NDArray[np.int64]:
        """For every node the index, in ``front_nodes``, of the front's node above it (columns are straight)."""
        front = self.pad.nodes[self.pad.front_nodes].reshape(*self.pad.front_grid, 3)
        x, y = front[:, 0, 0], front[0, :, 1]
        i = np.abs(self.pad.nodes[:, 0, None] - x).argmin(axis=1)
        j = np.abs(self.pad.nodes[:, 1, None] - y).argmin(axis=1)
        return i * len(y) + j
