"""Colours of the three-dimensional views: the report's colour maps as 17 stops each, for windows and pages alike."""

from __future__ import annotations

import numpy as np

from softjaw.study.show.pictures import COLOURS

NEUTRAL, OPEN, CROSSED = "#dfe3e6", "#b6bfc6", "#8d8590"  # no candidate, not solved, failed (crossed out)
PAD, CROSS, FORCE = "#8a9199", "#1d2429", "#00a5bf"
STOPS = {  # of matplotlib's maps of these names, evenly spaced
    "viridis": """440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c 1fa088 28ae80 3fbc73 5ec962 84d44b
        addc30 d8e219 fde725""",
    "cividis": """00224e 002e6a 1a386f 32436d 434e6c 535a6d 61656f 6f7073 7d7c78 8c8878 9b9476 aba072 bcae6c cdbb63
        dec958 f0d846 fee838""",
    "magma_r": """fcfdbf fde0a1 fec287 fea571 fb8761 f4695c e55064 cf4070 b5367a 9b2e7f 812581 681c81 4f127b 341069
        1c1044 090720 000004""",
    "plasma_r": """f0f921 f9dd25 fdc328 fdab33 f89441 f07f4f e56b5d d9586a cb4679 bb3488 a82296 9410a2 7d03a8 6400a7
        4b03a1 2f0596 0d0887""",
    "inferno_r": """fcffa4 f2e865 f9c932 fcaa0f f98c0a f1711f e35933 d04545 ba3655 a22b62 88226a 6f196e 550f6d 3b0964
        1f0c48 0a0722 000004""",
}


def stops(quantity: str) -> np.ndarray:
    """Colours ``(17, 3)`` from the lowest to the highest value of a quantity, 0..255."""
    name = COLOURS.get(quantity, "cividis")
    return np.array(
        [[int(h[k : k + 2], 16) for k in (0, 2, 4)] for h in STOPS[name if name in STOPS else "cividis"].split()]
    )


def table(quantity: str, count: int = 256) -> list[str]:
    """The same as ``count`` colours ``#rrggbb``."""
    given = stops(quantity)
    at = np.linspace(0, len(given) - 1, count)
    rgb = np.stack([np.interp(at, np.arange(len(given)), given[:, k]) for k in range(3)], axis=1)
    return [f"#{r:02x}{g:02x}{b:02x}" for r, g, b in rgb.round().astype(int)]
