"""Meshes as simulators, drawing programs and scanners give them, by script: eleven kinds of what is wrong."""

from collections.abc import Callable
from functools import partial

import numpy as np
import trimesh
from trimesh.creation import box, capsule, cylinder, icosphere
from trimesh.transformations import rotation_matrix

from tests.objects.bodies import hollow_bowl, mug, outline_body, punctured, revolved, scan, slabs, spoiled

Mesh = trimesh.Trimesh
Maker = Callable[[], Mesh]
LETTER = [(0, 0), (0.06, 0), (0.06, 0.025), (0.025, 0.025), (0.025, 0.08), (0, 0.08)]  # outline of an L [m]


def raw(points: np.ndarray, faces: np.ndarray) -> Mesh:
    return Mesh(points, faces, process=False)


def joined(*parts: Mesh) -> Mesh:
    return trimesh.util.concatenate(list(parts))


def moved(mesh: Mesh, x: float = 0.0, y: float = 0.0, z: float = 0.0, turn: float = 0.0) -> Mesh:
    mesh.apply_transform(rotation_matrix(np.radians(turn), [1, 0, 0]))
    mesh.apply_translation([x, y, z])
    return mesh


def letter() -> Mesh:
    """An L of 40 mm depth, of 20 triangles."""
    low = np.column_stack([LETTER, np.zeros(6)])
    caps = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]])
    sides = [[[i, j, i + 6], [j, j + 6, i + 6]] for i, j in ((k, (k + 1) % 6) for k in range(6))]
    return raw(np.vstack([low, low + np.array([0, 0, 0.04])]), np.concatenate([caps[:, ::-1], caps + 6, *sides]))


def hammer(sections: int = 24) -> Mesh:
    return joined(moved(cylinder(0.012, 0.16, sections=sections), z=0.08), moved(box((0.09, 0.028, 0.03)), z=0.145))


def handle(sections: int = 24) -> Mesh:
    feet = (moved(cylinder(0.007, 0.04, sections=sections), x=x, z=0.02) for x in (-0.05, 0.05))
    bar = cylinder(0.008, 0.13, sections=sections)
    bar.apply_transform(rotation_matrix(np.pi / 2, [0, 1, 0]))
    return joined(moved(bar, z=0.04), *feet)


def bottle(around: int = 32) -> Mesh:
    neck = [(0.026, 0.12), (0.013, 0.14), (0.013, 0.15), (0.013, 0.17), (0, 0.17)]
    return revolved([(0, 0), (0.03, 0), (0.03, 0.1), *neck], around)


SHAPES: dict[str, Maker] = {
    "box": lambda: box((0.05, 0.04, 0.09)), "plate": lambda: box((0.12, 0.008, 0.09)), "L": letter, "bottle": bottle,
    "mug": mug, "bowl": lambda: hollow_bowl(0.04, 0.004, 0.035), "hammer": hammer, "handle": handle,
}  # fmt: skip


def soup(mesh: Mesh, seed: int = 0) -> Mesh:
    corners = np.array(mesh.triangles)
    turned = np.random.default_rng(seed).random(len(corners)) < 0.5
    corners[turned] = corners[turned, ::-1]
    return raw(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))


def turned(mesh: Mesh, seed: int = 0, share: float = 0.3) -> Mesh:
    faces = mesh.faces.copy()
    chosen = np.random.default_rng(seed).random(len(faces)) < share
    faces[chosen] = faces[chosen, ::-1]
    return raw(mesh.vertices, faces)


def doubled(mesh: Mesh) -> Mesh:
    return raw(np.vstack([mesh.vertices] * 2), np.vstack([mesh.faces, mesh.faces[:, ::-1] + len(mesh.vertices)]))


def lined(mesh: Mesh, wall: float = 0.0015) -> Mesh:
    return joined(mesh, raw(mesh.vertices - wall * mesh.vertex_normals, mesh.faces[:, ::-1]))


def partitioned(mesh: Mesh, count: int = 4) -> Mesh:
    """With walls inside that hang on edges of the surface, so that three triangles meet there."""
    edges = mesh.edges_unique[:: max(1, len(mesh.edges_unique) // count)]
    faces = np.column_stack([edges, np.full(len(edges), len(mesh.vertices))])
    return raw(np.vstack([mesh.vertices, mesh.centroid]), np.vstack([mesh.faces, faces]))


def capped(around: int = 32) -> Mesh:
    """A bottle whose cap is a second body on the same ring of edges."""
    ring = revolved([(0, 0.15), (0.013, 0.15), (0.013, 0.17), (0, 0.17)], around)
    return merged(joined(bottle(around), ring))


def merged(mesh: Mesh) -> Mesh:
    mesh.merge_vertices()
    return mesh


def bricks() -> Mesh:
    return merged(joined(moved(box((0.04, 0.03, 0.05)), z=0.025), moved(box((0.04, 0.03, 0.05)), y=0.03, z=0.075)))


def opened(mesh: Mesh, axis: int = 2, share: float = 0.02) -> Mesh:
    heights = mesh.triangles_center[:, axis]
    low, high = mesh.bounds[:, axis]
    return raw(mesh.vertices, mesh.faces[heights > low + share * (high - low)])


def in_wedges(radius: float, height: float, count: int = 8) -> Mesh:
    """A round wall as convex blocks that overlap, and a bottom."""
    parts = [moved(cylinder(radius, 0.006, sections=24), z=0.003)]
    for angle in np.arange(count) * 2 * np.pi / count:
        block = moved(box((0.006, 2.2 * radius * np.tan(np.pi / count), height)), x=radius - 0.003, z=0.5 * height)
        block.apply_transform(rotation_matrix(angle, [0, 0, 1]))
        parts.append(block)
    return joined(*parts)


def chain(count: int = 7) -> Mesh:
    parts = []
    for angle in np.linspace(0.0, np.pi, count):
        part = capsule(0.018, 0.008, count=(8, 12))
        part.apply_transform(rotation_matrix(-angle, [0, 1, 0]))
        part.apply_translation([-0.045 * np.cos(angle), 0.0, 0.045 * np.sin(angle)])
        parts.append(part)
    return joined(*parts)


def pierced(mesh: Mesh, seed: int, rings: int = 1) -> Mesh:
    fine = mesh if len(mesh.faces) > 400 else merged(mesh.subdivide().subdivide().subdivide())
    return punctured(fine, 3, rings, seed)


def fine(mesh: Mesh, faces: int = 520_000) -> Mesh:
    while len(mesh.faces) < faces:
        mesh = mesh.subdivide()
    return mesh


def of(change: Callable[..., Mesh], names: str, **options) -> dict[str, Maker]:
    return {name: lambda name=name: change(SHAPES[name](), **options) for name in names.split()}


def crossing() -> dict[str, Maker]:
    return {
        "hammer": hammer, "mug": mug, "handle": handle,
        "cross of boxes": lambda: joined(box((0.1, 0.03, 0.03)), box((0.03, 0.028, 0.11)), box((0.04, 0.04, 0.04))),
        "bottle with a ball": lambda: joined(bottle(), moved(icosphere(3, 0.036), z=0.07)),
        "plate with a rod": lambda: joined(SHAPES["plate"](), moved(cylinder(0.01, 0.06, sections=20), turn=90.0)),
    }  # fmt: skip


def convex_parts() -> dict[str, Maker]:
    """Convex bodies that overlap, as physics engines want them."""
    return {
        "waisted body": lambda: slabs(5),
        "cup": lambda: in_wedges(0.035, 0.08),
        "bowl": lambda: in_wedges(0.038, 0.03, 12),
        "handle": chain,
        "L": lambda: joined(moved(box((0.06, 0.04, 0.025)), z=0.0125),
                            moved(box((0.025, 0.04, 0.08)), -0.0175, z=0.04)),
        "bottle": lambda: joined(*(moved(cylinder(r, 0.05, sections=24), z=z)
                                   for r, z in ((0.03, 0.025), (0.03, 0.07), (0.022, 0.1), (0.014, 0.13)))),
    }  # fmt: skip


def open_surfaces() -> dict[str, Maker]:
    """Surfaces without a bottom, a lid or a back."""
    cup = [(0, 0), (0.034, 0), *((0.034 + 0.05 * z, z) for z in np.linspace(0.01, 0.09, 9))]
    shell = [(0.03 * np.cos(t), 0.05 + 0.03 * np.sin(t)) for t in np.linspace(-1.2, 1.2, 17)]
    return {
        **of(opened, "box bottle"),
        "cup of one wall": lambda: revolved(cup, 48),
        "tube": lambda: revolved([(0.03, z) for z in np.linspace(0, 0.1, 9)], 48),
        "part of a ball": lambda: revolved(shell, 48),
        "half shell": lambda: opened(outline_body(), 0, 0.45),
    }


def low_poly() -> dict[str, Maker]:
    """12 to 500 triangles: the objects of simulators."""
    tumbler = [(0, 0), (0.04, 0), (0.04, 0.09), (0.036, 0.09), (0.036, 0.004), (0, 0.004)]
    return {
        **of(lambda mesh: mesh, "box plate L"),
        "wedge": lambda: trimesh.convex.convex_hull([*box((0.05, 0.04, 0.09)).vertices[:5], [0.0, 0.02, 0.03]]),
        "bottle of 12 sides": lambda: bottle(12), "bottle of 6 sides": lambda: bottle(6), "hammer": lambda: hammer(8),
        "screwdriver": lambda: joined(moved(cylinder(0.014, 0.09, sections=6), z=0.045),
                                      moved(cylinder(0.004, 0.1, sections=6), z=0.13)),
        "handle": lambda: handle(8), "ball": lambda: icosphere(1, 0.03),
        "can": lambda: cylinder(0.033, 0.1, sections=10),
        "mug": lambda: joined(revolved(tumbler, 10),
                              moved(trimesh.creation.torus(0.025, 0.005, major_sections=10, minor_sections=5),
                                    0.055, 0.0, 0.045, 90.0)),
    }  # fmt: skip


def bad_meshes(seed: int) -> dict[str, tuple[str, Maker]]:
    """Kind and maker of every mesh by its name; ``seed`` says which triangles are spoiled."""
    scans = {name: partial(scan, name) for name in ("banana", "drill", "mustard", "cracker")}
    kinds = {
        "soup": of(soup, "box L bottle mug bowl hammer", seed=seed),
        "crossing bodies": crossing(),
        "convex parts that overlap": convex_parts(),
        "doubled or inner walls": of(doubled, "box bottle mug") | {
            f"lined {name}": make for name, make in of(lined, "box L bottle hammer").items()},
        "edges of three triangles": {
            "bottle with a cap": capped, "bricks": bricks, **of(partitioned, "box L bottle bowl")},
        "mixed winding": of(turned, "box plate bottle mug bowl handle", seed=seed),
        "doubled and degenerate triangles": of(spoiled, "plate L bottle mug bowl hammer", share=0.05, seed=seed),
        "open surfaces": open_surfaces(),
        "holes": of(pierced, "box plate bottle mug bowl hammer", seed=seed),
        "low poly": low_poly(),
        "very many triangles": of(fine, "box bottle mug"),
        "scans": scans,
        "scans with holes": {name: lambda make=make: punctured(make(), 3, seed=seed) for name, make in scans.items()},
    }  # fmt: skip
    return {f"{kind}: {name}": (kind, make) for kind, makers in kinds.items() for name, make in makers.items()}
