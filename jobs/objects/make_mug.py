"""Write mug.stl beside this file, as drawing programs export such things: no closed surface anywhere, in millimetres.

An outer wall without a bottom, an inner wall turned inside out, no rim between them, a handle that passes through both,
and a third of the triangles wound the wrong way. Run: ``python jobs/objects/make_mug.py``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import trimesh

HEIGHT, RADIUS, TAPER, WALL = 95.0, 38.0, 4.0, 3.5  # mm
RING, ROD = 26.0, 6.0  # radii of the handle [mm]
AROUND, ALONG = 48, 12


def wall(offset: float, *, bottom: bool) -> trimesh.Trimesh:
    """A tapered tube, open at the top, moved inwards by ``offset``."""
    z = np.linspace(offset, HEIGHT, ALONG)
    outline = np.column_stack([RADIUS + TAPER * z / HEIGHT - offset, z])
    outline = np.concatenate([[[0.0, offset]], outline]) if bottom else outline
    return trimesh.creation.revolve(outline, sections=AROUND)


def mug() -> trimesh.Trimesh:
    """All parts together."""
    handle = trimesh.creation.torus(RING, ROD, major_sections=40, minor_sections=16)
    handle.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [1, 0, 0]))
    handle.apply_translation([RADIUS + 0.6 * RING, 0.0, HEIGHT / 2])
    inner = wall(WALL, bottom=True)
    inner.invert()
    parts = trimesh.util.concatenate([wall(0.0, bottom=False), inner, handle])
    faces = parts.faces.copy()
    faces[::3] = faces[::3, ::-1]
    return trimesh.Trimesh(parts.vertices, faces, process=False)


if __name__ == "__main__":
    mug().export(Path(__file__).with_suffix("").with_name("mug.stl"))
