"""Thin-walled object: from its wall and two poses of the fingers to the coupled problem, as small as symmetry allows.

Everything is done in the *grasp frame*: the object's, turned about its axis until finger 1 stands at angle 0. There the
planes x = 0 (between the fingers) and y = 0 (through both) are the candidates for symmetry. A pad is meshed on its
positive side only; finger 2 of a half model has its other half on that side of the plane, so it is turned by half a
turn about its approach (``flipped``), and its results are turned back.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.assembly import IntArray
from softjaw.fem.objects.gap import Pose, about_z
from softjaw.fem.objects.outer_surface import OuterSurface
from softjaw.fem.objects.stacked import wall_surface
from softjaw.fem.shell.element import Shell
from softjaw.fem.shell.facing import Wall
from softjaw.fem.shell.wall_material import WallMaterial
from softjaw.fem.shell.wall_mesh import BodyMesh, MeshSize, body_mesh
from softjaw.fem.shell.wall_model import LinearShell, LinearWall, NonlinearWall
from softjaw.friction.patch import NEGLIGIBLE, FloatArray

HALF_TURN = np.diag([-1.0, -1.0, 1.0])
HELD = 100.0  # stiffness of all springs, per direction, over that of a square of the wall that is drawn


def supported(mesh: BodyMesh, material: WallMaterial, support: str = "free") -> tuple[Shell[BodyMesh], FloatArray]:
    """Shell of a body with springs, and which of its numbers ``(6 k,)`` its support fixes.

    "clamped": the flat bottom does not move, or both rims of a tube; "standing": the rim of the bottom keeps its
    height; "free". The springs hold the rigid motions that are left, and resist no others: they are so stiff that the
    wall as a whole stays where it is, as a rigid object does.
    """
    constrained = np.zeros((len(mesh.X), 6), dtype=bool)
    if support == "clamped":
        lines = mesh.s <= max(mesh.surface.flat[0], mesh.s[0]) + NEGLIGIBLE
        # the mesh of a tube begins off the axis
        if mesh.s[0] > NEGLIGIBLE:
            lines |= mesh.s >= min(mesh.surface.flat[1], mesh.s[-1]) - NEGLIGIBLE
        constrained[np.unique(mesh.number[:, lines])] = True
    elif support == "standing":
        constrained[mesh.foot, 2] = True
    fixed = constrained.ravel() | mesh.symmetric
    stiffness = HELD * material.young_modulus * float(mesh.thickness.mean())
    springs = _springs(mesh, fixed.reshape(-1, 6), stiffness)
    return Shell(mesh, material.young_modulus, material.poisson_ratio, springs), fixed


def _springs(mesh: BodyMesh, fixed: NDArray[np.bool_], stiffness: float) -> tuple[IntArray, FloatArray]:
    """Nodes and stiffness of springs that hold the rigid motions which numbers ``fixed (k, 6)`` leave.

    There are as many conditions on the displacements of a few nodes as motions, so loads in balance meet no force.
    """
    motions, unit = np.zeros((6, *fixed.shape)), np.eye(3)[:, None]
    motions[:3, :, :3], motions[3:, :, :3] = unit, np.cross(unit, mesh.X / np.abs(mesh.X).max())
    motions[3:, :, 3:] = np.cross(unit, mesh.D / np.linalg.norm(mesh.D, axis=1, keepdims=True))
    at_fixed = motions[:, fixed]
    squares, mixed = np.linalg.eigh(at_fixed @ at_fixed.T)
    free = mixed[:, squares < 1e-9].T  # what is fixed moves by rounding alone
    # between the pads, which lie at 0 and at half a turn, and away from the ends
    angles = [at for at in np.pi * np.array([-0.25, 0.25, 0.75, 1.25, 1.75]) if mesh.theta[0] < at < mesh.theta[-1]]
    i = [np.abs(mesh.theta - at).argmin() for at in angles]
    j = [np.abs(mesh.s - mesh.s[0] - share * np.ptp(mesh.s)).argmin() for share in (0.25, 0.75)]
    nodes = np.unique(mesh.number[np.ix_(i, j)])
    basis = np.linalg.qr((free @ motions[:, nodes, :3].reshape(6, -1)).T)[0]
    return nodes, stiffness * mesh.share / len(nodes) * basis @ basis.T


class ThinWalled(NamedTuple):
    """Object that gives way.

    ``thickness`` of the wall [m], or pairs (z, thickness); ``support`` as in `supported`; ``open_top, open_bottom``:
    whether it has no lid, and no base.
    """

    surface: OuterSurface
    thickness: float | tuple[tuple[float, float], ...]
    material: WallMaterial
    support: str = "free"
    open_top: bool = True
    base_thickness: float | None = None
    open_bottom: bool = False


class Grasp(NamedTuple):
    """Both fingers at first touch in the grasp frame, turned by ``angle`` about the object's axis [rad].

    One pose where the plane between the fingers is one of symmetry; ``flipped``: whether a pose was turned by half a
    turn about its approach; ``mirrors``: planes of symmetry x = 0, y = 0.
    """

    angle: float
    poses: tuple[Pose, ...]
    flipped: tuple[bool, ...]
    mirrors: tuple[bool, bool]

    @property
    def pad_symmetry(self) -> tuple[bool, bool]:
        """Planes of symmetry of the pads: ``y = 0`` of the grasp frame is the pads' own."""
        return False, self.mirrors[1]


def grasp(body: ThinWalled, poses: tuple[Pose, Pose], allowed: tuple[bool, bool] = (True, True)) -> Grasp:
    """Grasp frame of two poses at first touch, and the ``allowed`` planes of symmetry that object and poses share."""
    approach = poses[0].rotation[:, 2]
    # an approach along the axis has no angle about it, and any will do
    angle = float(np.arctan2(-approach[1], -approach[0])) if np.hypot(*approach[:2]) > 1e-6 else 0.0
    turned = body.surface.turned(angle)
    turn = about_z(-angle)
    turned_poses = tuple(Pose(turn @ pose.rotation, turn @ pose.origin) for pose in poses)
    size = max(np.abs(pose.origin).max() for pose in turned_poses)

    def alike(p: Pose, q: Pose) -> bool:
        same = np.abs(p.rotation - q.rotation).max() <= NEGLIGIBLE
        return same and np.abs(p.origin - q.origin).max() <= NEGLIGIBLE * size

    # the plane y = 0 halves both pads, whichever way up, and the plane x = 0 makes one finger the other's image
    off = [(abs(pose.rotation[1, 1]) - 1.0, pose.origin[1] / size) for pose in turned_poses]
    across = allowed[1] and turned.symmetric[1] and bool(np.abs(off).max() <= NEGLIGIBLE)
    between = allowed[0] and turned.symmetric[0] and alike(_image(turned_poses[0]), turned_poses[1])
    flipped = tuple(across and pose.rotation[1, 1] < 0 for pose in turned_poses)
    halves = zip(turned_poses, flipped, strict=True)
    solved = tuple(Pose(p.rotation @ HALF_TURN, p.origin) if flip else p for p, flip in halves)
    n = 1 if between else 2
    return Grasp(angle, solved[:n], flipped[:n], (between, across))


def wall_between(body: ThinWalled, frame: Grasp, pad_size: Sequence[float], size: MeshSize, *, linear: bool = False):
    """Shell meshed finely where the pads of this grasp touch: the model, and what each finger can touch."""
    low, high, half = _footprint(frame, pad_size)
    # a pad may reach beyond the wall, where the outline has no station
    low, high = (float(end) for end in np.clip([low, high], *body.surface.heights))
    shell, fixed = _supported(body, frame, size._replace(heights=(low, high), half_width=half))
    meshed, flat = shell.mesh, body.surface.flat
    # through the meshed part of the wall and the rims of its flat ends
    surface = wall_surface(meshed.surface, max(meshed.s[0], flat[0]), min(meshed.s[-1], flat[1]))
    wall = Wall(surface, meshed.theta, meshed.s, meshed.number, 0.5 * meshed.thickness)
    return (LinearWall if linear else NonlinearWall)(shell, fixed), [wall] * len(frame.poses)


# the indicator of every candidate asks for the same factors
@lru_cache(maxsize=4)
def object_factors(
    body: ThinWalled, angle: float, mirrors: tuple[bool, bool], size: MeshSize, half: float
) -> LinearShell:
    """First stiffness of the object, meshed alike along its whole wall; made once per rank."""
    mesh_size = size._replace(heights=body.surface.heights, half_width=half)
    return LinearShell(*_supported(body, Grasp(angle, (), (), mirrors), mesh_size))


def _supported(body: ThinWalled, frame: Grasp, size: MeshSize) -> tuple[Shell[BodyMesh], FloatArray]:
    mesh = body_mesh(
        body.surface.turned(frame.angle), body.thickness, size, frame.mirrors,
        open_top=body.open_top, open_bottom=body.open_bottom, base_thickness=body.base_thickness,
    )  # fmt: skip
    return supported(mesh, body.material, body.support)


def _footprint(frame: Grasp, pad_size: Sequence[float]) -> tuple[float, float, float]:
    """Heights that the pads reach over, and half the width they cover round the object [m], with a margin."""
    margin = 0.1 * max(pad_size[:2])
    corners = np.array([[i * pad_size[0], j * pad_size[1], 0.0] for i in (-0.5, 0.5) for j in (-0.5, 0.5)])
    points = np.concatenate([pose.to_object(corners) for pose in frame.poses])
    ends = points[:, 2].min() - margin, points[:, 2].max() + margin, np.abs(points[:, 1]).max() + margin
    low, high, half = (float(np.round(v, 9)) for v in ends)  # alike for candidates that differ by rounding alone
    return low, high, half


def _image(pose: Pose) -> Pose:
    """Mirror image in x = 0 of a pad that is its own image in its plane y = 0."""
    mirror = np.diag([-1.0, 1.0, 1.0])
    return Pose(mirror @ pose.rotation @ np.diag([1.0, -1.0, 1.0]), mirror @ pose.origin)
