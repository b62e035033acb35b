"""Units of length, for meshes and scenes alike: each is ``times / over`` metres, so that converting rounds once."""

from __future__ import annotations

LENGTHS = {"mm": (1, 1000), "cm": (1, 100), "m": (1, 1), "inch": (0.0254, 1)}
