"""Levels of the knobs that change what is made of a contact, and not the contact."""

from __future__ import annotations

from softjaw.study.scene import Scene

SAMPLES = (50, 100, 200, 500, 1000, 2000, 4000)
SURFACES = (
    ("three motions", "three_motions", "least_squares"), ("axis-aligned ellipsoid", "axis_aligned", "least_squares"),
    ("full ellipsoid", "full", "least_squares"), ("full ellipsoid, zhou", "full", "zhou"),
    ("quartic", "quartic", "least_squares"), ("quartic, zhou", "quartic", "zhou"),
)  # fmt: skip
HULL = 3000  # wrenches whose hull stands for the limit surface itself
POINTS = {"hull of 20 points": None, "hull of 50 points": 50}
WINKLER = "Winkler foundation, planar contact"


def judging_knobs(scene: Scene) -> dict[str, list[str]]:
    """Levels of every knob, the cheapest first; the last is the reference."""
    samples = sorted({*SAMPLES, scene.limit_surface.samples})
    return {
        "contact model": [WINKLER, "finite elements, planar", "finite elements, curved"],
        "motions sampled": [str(n) for n in samples],
        "limit surface": [*(name for name, *_ in SURFACES), f"hull of {HULL} wrenches"],
        "score": [*POINTS, "exact"],
    }


def expected_seconds(knob: str, level: str) -> float:
    """Rough time of one case [s], before anything is measured."""
    slow = {"hull of 20 points": 0.5, "hull of 50 points": 5.0}
    return slow.get(level, 0.03) * (1 if knob == "score" else 2)
