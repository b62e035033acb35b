"""Thin-walled objects in a study: their wall, the level that a candidate calls for, and what the wall bears."""

from collections.abc import Sequence
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.interpolate import RegularGridInterpolator

from softjaw.fem.contact.path import Pressed
from softjaw.fem.errors import CheckError
from softjaw.fem.objects.gap import about_z
from softjaw.fem.shell.element import Shell
from softjaw.fem.shell.thin_walled import Grasp, ThinWalled, object_factors
from softjaw.fem.shell.wall_mesh import MeshSize, all_round
from softjaw.fem.shell.wall_model import faces
from softjaw.friction.patch import FloatArray
from softjaw.study.case.build import outer_surface
from softjaw.study.case.geometry import material_of
from softjaw.study.case.result import UNDECIDED, surely_below
from softjaw.study.flags import Flag
from softjaw.study.quantities import ALONG, AROUND
from softjaw.study.scene import Scene
from softjaw.study.scene.objects import Walled
from softjaw.study.units import GRAVITY

DENTED_SHARE = 0.2  # of the object's half width between the fingers, beyond which an indentation is flagged
SLIGHT_PULL = 0.05  # of the normal force: a pull at the foot that says nothing


@lru_cache(maxsize=8)
def thin_body(shape: Walled) -> ThinWalled:
    """Wall of an object that has one (``shape.wall`` is not None)."""
    assert shape.wall is not None
    return ThinWalled(
        outer_surface(shape), shape.wall, material_of(shape), shape.support, shape.open_top, shape.base_wall,
        open_bottom=shape.open_bottom,
    )  # fmt: skip


def estimated_indentation(
    body: ThinWalled, grasp: Grasp, scene: Scene, closing: float, force: float
) -> tuple[float, float, float]:
    """Indentation of the linear wall at a force [N], where undeformed pads would overlap it [m], ratio and stress [Pa].

    The second is the largest ratio of an inward displacement to the wall's thickness there. ``closing`` is that of the
    pads on the rigid object [m]. One right-hand side with factors that all candidates share.
    """
    length, width, _ = scene.gripper.pad_size
    # A round object is the same at every angle, so all candidates share its factors.
    angle = 0.0 if body.surface.round else grasp.angle
    linear = object_factors(body, angle, grasp.mirrors, _estimate_size(body, length, width), 0.6 * width)
    mesh, area = linear.shell.mesh, linear.shell.node_area
    load = np.zeros((linear.shell.nodes, 6))
    pressed = np.zeros(linear.shell.nodes, dtype=bool)
    for pose in grasp.poses:
        local = pose.to_pad(mesh.outer)
        under = (np.abs(local[:, 0]) <= 0.5 * length) & (np.abs(local[:, 1]) <= 0.5 * width)
        under &= mesh.D @ pose.rotation[:, 2] < 0
        depth = np.where(under, np.maximum(closing - local[:, 2], 0.0), 0.0) * area
        if not depth.sum() > 0:  # the touch lies between the nodes
            depth = np.where(under, area, 0.0)
        if not depth.sum() > 0:
            raise CheckError("a pad stands beside the wall of the object: move the candidate onto its wall")
        # Of a pad that a plane of symmetry cuts in half only half of the force counts.
        part = force * (0.5 if grasp.mirrors[1] else 1.0)
        load[:, :3] += (part * depth / depth.sum())[:, None] * pose.rotation[:, 2]
        pressed |= depth > 0
    load[:, 3:] = load[:, :3]
    q = linear.solve(load.ravel())
    indentations = _indentations(linear.shell, q.reshape(-1, 6))
    dent, ratio = (float(v[pressed].max(initial=0.0)) for v in (indentations, indentations / mesh.thickness))
    return dent, ratio, max(float(face.von_mises.max()) for face in faces(linear.shell, q))


def _estimate_size(body: ThinWalled, length: float, width: float) -> MeshSize:
    """Mesh of the estimate: 4 mm round the body and 6 mm along it, less on a body or under pads that are small."""
    middle = body.surface.station(0.5 * sum(body.surface.heights))
    across = body.surface.jets(np.linspace(0.0, np.pi, 9), middle)[:, 0, :2]
    radius = float(np.linalg.norm(across, axis=1).min())
    share = min(1.0, radius / 0.02, length / 0.02, width / 0.012)
    return MeshSize(share * 0.004, share * 0.006, share * 0.012)


def _indentations(shell: Shell, q: FloatArray) -> FloatArray:
    """Inward displacement ``(k,)`` of the outer face's nodes, less the motion of the wall as a whole [m]."""
    v = q[:, :3] + q[:, 3:]
    drift = shell.node_area @ v / shell.node_area.sum()
    drift[:2][list(shell.mesh.symmetry)] = 0.0  # the mean over one side of a plane of symmetry is no drift
    normal = shell.mesh.D / np.linalg.norm(shell.mesh.D, axis=1)[:, None]
    return -np.einsum("ki,ki->k", v - drift, normal)


def wall_values(grasp: Grasp, contacts: Sequence[Any], shell: Shell) -> dict[str, Any]:
    """What the wall bears in one case, from its pressed contacts; keyed as in ``study.quantities``."""
    wall = contacts[0].state.wall
    q, both = wall.q.reshape(-1, 6), faces(shell, wall.q)
    force, approach = np.sum([c.pressure_wrench[:3] for c in contacts], axis=0), contacts[0].pose.rotation[:, 2]
    return {
        "maps/indentation": float(_indentations(shell, q).max(initial=0.0)),
        "maps/wall_stress": max(float(f.von_mises.max()) for f in both),
        "maps/wall_strain": max(float(np.abs(f.principal_strain).max()) for f in both),
        "maps/support_force": float(np.linalg.norm(force - (force @ approach) * approach)),
        "wall/place": _places(grasp, shell, q),
    }


def wall_flags(scene: Scene, state: Pressed, values: dict[str, Any]) -> Flag:
    """Flags of a case that its wall adds."""
    flags = Flag.SNAPPED * state.wall.snapped
    flags |= Flag.DENTED * (not surely_below(values["maps/indentation"], DENTED_SHARE * 0.5 * values["maps/opening"]))
    friction = 2.0 * scene.friction.mu * state.force
    flags |= Flag.SLIDES_OUT * (values["maps/support_force"] > friction + UNDECIDED * state.force)
    strength = thin_body(scene.object).material.yield_strength
    return flags | Flag.YIELDS * (strength is not None and not surely_below(values["maps/wall_stress"], strength))


def foot_note(scene: Scene, state: Pressed, shell: Shell) -> str:
    """A note where a table would have to pull the foot down by more than the weight that is on it."""
    if scene.object.support != "standing":
        return ""
    mesh, wall = shell.mesh, state.wall
    support = shell.residual(wall.q).reshape(-1, 6)[mesh.foot, 2] - wall.load[mesh.foot, 2]
    pulled = -float(np.minimum(support, 0.0).sum()) / mesh.share
    weight = GRAVITY * (scene.object.mass or 0.0)
    if pulled <= max(weight, SLIGHT_PULL * state.force):
        return ""
    what = f"the {weight:.2g} N that it weighs" if weight else "nothing that is known"
    return (
        f"the table pulls the foot down with {pulled:.2g} N in all, against {what}: a foot that lifts, or an object"
        ' that is held in the air, gives way more; see it with support = "free"'
    )


def _places(grasp: Grasp, shell: Shell, q: FloatArray) -> FloatArray:
    """Deformed outer face ``(AROUND * ALONG, 3)`` of the whole object in its own frame [m].

    The angles begin at finger 1, so that images of a grasp are stored alike but for their turn.
    """
    mesh = shell.mesh
    angles = 2 * np.pi * np.arange(AROUND) / AROUND
    theta, s = np.meshgrid(angles, np.linspace(mesh.s[0], mesh.s[-1], ALONG), indexing="ij")
    lines, parts = all_round(mesh, q[mesh.number])
    moved = RegularGridInterpolator((lines, mesh.s), parts[..., :3] + parts[..., 3:], bounds_error=False,
                                    fill_value=None)  # fmt: skip
    at = lines[0] + (theta - lines[0]) % (2 * np.pi)
    place = mesh.surface.jets(theta, s)[:, 0] + moved(np.stack([at.ravel(), s.ravel()], axis=1))
    return place @ about_z(-grasp.angle)
