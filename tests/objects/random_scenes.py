"""Random scenes of rigid objects: shapes, pads, foams, forces and poses as a user could write them, from a seed."""

from collections.abc import Callable
from typing import Any

import numpy as np

Table = dict[str, Any]
FOAMS = ("blatz_ko", "blatz_ko", "blatz_ko", "neo_hookean", "hyperfoam", "linear")
LEAST, MOST = 0.1, 0.6  # the highest force over shear modulus and area of a pad
MOST_N = 12.0
LIMIT = 60.0  # CPU time of the solves of a scene [s]
OFF = 0.3  # of the pads' width: how far a pose may be off the middle


def number(x: float) -> float:
    return round(float(x), 3)


def _pairs(z: Any, r: Any) -> list[list[float]]:
    return [[number(a), number(b)] for a, b in zip(z, r, strict=True)]


def outline(rng: np.random.Generator) -> Table:
    height, inner = rng.uniform(60, 250), rng.integers(3, 8)
    z = np.sort(np.r_[0, height, rng.uniform(0.05, 0.95, inner) * height])
    r = np.clip(rng.uniform(10, 45) * np.exp(rng.normal(0, 0.25, len(z))), 6, 50)
    return {"shape": "revolution", "profile_mm": _pairs(z, r)}


def cone(rng: np.random.Generator) -> Table:
    z, ends = np.linspace(0, rng.uniform(60, 200), 4), rng.uniform(8, 45, 2)
    return {"shape": "revolution", "profile_mm": _pairs(z, np.linspace(*ends, 4))}


def ellipse(rng: np.random.Generator) -> Table:
    a = rng.uniform(8, 45)
    b, length = np.clip(a * rng.uniform(0.4, 2.5), 5, 60), rng.uniform(40, 200)
    return {"shape": "elliptic_cylinder", "semi_axis_a_mm": number(a), "semi_axis_b_mm": number(b),
            "length_mm": number(length)}  # fmt: skip


def ball(rng: np.random.Generator) -> Table:
    return {"shape": "sphere", "radius_mm": number(rng.uniform(6, 60))}


def box(rng: np.random.Generator) -> Table:
    return {"shape": "box", "size_mm": [number(s) for s in rng.uniform(20, 100, 3)],
            "edge_radius_mm": number(rng.uniform(0.5, 9))}  # fmt: skip


def superellipse(rng: np.random.Generator) -> Table:
    a, b = rng.uniform(12, 45, 2)
    same = {"a_mm": number(a), "b_mm": number(b), "exponent": number(rng.uniform(2, 8))}
    return {"shape": "sections", "sections": [{"z_mm": number(z), **same} for z in np.linspace(0, 150, 4)]}


def stacked(rng: np.random.Generator) -> Table:
    """Sections of several sizes and forms one above the other, a little beside each other."""
    count, size = rng.integers(4, 8), rng.uniform(15, 40, 2)
    z = np.cumsum(rng.uniform(20, 50, count))
    a, b = size[:, None] * np.exp(rng.normal(0, 0.12, (2, count)))
    e, shift = rng.uniform(2, 5, count), rng.uniform(-3, 3, (count, 2))
    return {"shape": "sections", "sections": [
        {"z_mm": number(z[i] - z[0]), "a_mm": number(a[i]), "b_mm": number(b[i]), "exponent": number(e[i]),
         "shift_mm": [number(s) for s in shift[i]]} for i in range(count)
    ]}  # fmt: skip


KINDS: dict[str, Callable[[np.random.Generator], Table]] = {
    made.__name__: made for made in (outline, cone, ellipse, ball, box, superellipse, stacked)
}


def gripper(rng: np.random.Generator) -> Table:
    size, foam = rng.uniform((20, 12, 6), (60, 30, 20)), str(rng.choice(FOAMS))
    elements = [int(n) for n in (2 * rng.integers(4, 8), 2 * rng.integers(3, 6), rng.integers(3, 6))]
    keys = dict(zip(("pad_length_mm", "pad_width_mm", "pad_thickness_mm"), map(number, size), strict=True))
    more = {"poisson_ratio": number(rng.uniform(0.1, 0.45))} if foam in ("neo_hookean", "linear") else {}
    return {**keys, "material": foam, "shear_modulus_kpa": number(rng.uniform(15, 80)), "elements": elements, **more}


def forces(rng: np.random.Generator, pads: Table) -> list[float]:
    """Three rising forces per finger [N], the highest in proportion to what the pad bears."""
    stiffness = 1e-3 * pads["shear_modulus_kpa"] * pads["pad_length_mm"] * pads["pad_width_mm"]
    highest = min(MOST_N, stiffness * rng.uniform(LEAST, MOST))
    shares = np.sort(rng.uniform((0.1, 0.4), (0.4, 0.9)))
    return [number(max(0.1, highest * share)) for share in (*shares, 1.0)]


def span(body: Table) -> tuple[float, float]:
    match body:
        case {"profile_mm": [[low, _], *_, [high, _]]} | {"sections": [{"z_mm": low}, *_, {"z_mm": high}]}:
            return low, high
        case {"length_mm": length} | {"size_mm": [_, _, length]}:
            return -length / 2, length / 2
    return -body["radius_mm"], body["radius_mm"]


def places(rng: np.random.Generator, body: Table, pads: Table) -> Table:
    """One grasp: at a station with any angle and roll, or a pose off the middle and a little askew."""
    low, high = span(body)
    share = 0.5 if body["shape"] == "sphere" else rng.uniform(0.15, 0.85)
    z, roll = low + (high - low) * share, rng.choice([0, 90, rng.uniform(-90, 90)])
    quarter = rng.choice([0, 90]) + rng.uniform(-10, 10)
    around = quarter if body["shape"] in ("box", "sections") else rng.uniform(0, 90)
    if rng.random() < 0.6:
        return {"stations_mm": [number(z)], "angles_deg": [number(around)], "roll_deg": number(roll)}
    t, r, dip = np.radians([around, roll, rng.uniform(-10, 10)])
    approach = np.array([np.cos(t) * np.cos(dip), np.sin(t) * np.cos(dip), np.sin(dip)])
    beside = np.array([-np.sin(t), np.cos(t), 0])
    point = rng.uniform(-OFF, OFF) * pads["pad_width_mm"] * beside + [0, 0, z]
    long_side = np.cos(r) * np.array([0, 0, 1]) + np.sin(r) * beside
    vectors = {"point_mm": point, "approach": approach, "long_side": long_side}
    return {"poses": [{key: [number(x) for x in v] for key, v in vectors.items()}]}


def random_scene(seed: int, k: int) -> tuple[str, Table]:
    """Kind and tables of the ``k``-th scene of a seed; it does not hang on how many others are made."""
    rng = np.random.default_rng([seed, k])
    kind = str(rng.choice(list(KINDS)))
    body, pads = KINDS[kind](rng), gripper(rng)
    return kind, {
        "object": {"name": f"{kind} {k}", **body}, "gripper": pads,
        "friction": {"mu": number(rng.uniform(0.3, 1.2))}, "load": {"normal_force_n": forces(rng, pads)},
        "candidates": places(rng, body, pads), "accuracy": {"meshes": 1}, "run": {"patches": "none"},
    }  # fmt: skip
