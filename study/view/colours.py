"""Colours of the three-dimensional views: the report's colour maps as 17 stops each, for windows and pages alike."""

from __future__ import annotations

import numpy as np

from study.pictures import COLOURS

NEUTRAL, OPEN, CROSSED = "#dfe3e6", "#b6bfc6", "#8d8590"  # no candidate, not solved, failed (crossed out)
PAD, CROSS, FORCE = "#8a9199", "#1d2429", "#00a5bf"
STOPS = {  # of matplotlib's maps of these names, evenly spaced
    "viridis": """440154 48186a 472d7b 424086 3b528b 33638d 2c728e 26828e 21918c 1fa088 28ae80 3fbc73 5ec962 84d44b
        addc30 d8e219 fde725""",
    "cividis": """00224e 002e6a 1a386f 32436d 434e6c 535a6d 61656f 6f7073 7d7c78 8c8878 9b9476 aba072 bcae6c cdbb63
        dec958 f0d846 fee838""",
    "magma_r": """fcfdbf fde0a1 fec287 fea571 fb8761 f4695c e55064 cf4070 b5367a 9b2e7f 812581 681c81 4f127b 341069
        1c1044 090720 000004""",
    "YlGnBu": """ffffd9 f6fbc5 edf8b1 daf0b3 c6e9b4 a2dbb8 7ecdbb 5fc1c0 40b5c4 2ea3c2 1d90c0 2076b3 225da8 24489d
        243392 162874 081d58""",
    "YlOrRd": """ffffcc fff6b6 ffeda0 fee38b fed976 fec561 feb24c fd9f44 fd8c3c fc6c33 fc4d2a ef3323 e2191c cf0c21
        bb0026 9d0026 800026""",
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
