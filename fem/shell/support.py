"""How a thin-walled body is held besides the gripper, and the force that this takes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from softjaw.fem.shell.body import BodyMesh
from softjaw.fem.shell.mesh import FloatArray
from softjaw.fem.shell.model import Shell
from softjaw.fem.shell.wall_material import WallMaterial

ON_LINE = 1e-9  # grid lines this close to the edge of the flat bottom are on it [m]
WEAK = 1.0  # N/m: stiffness of all weak springs of a whole body together, per direction


@dataclass(frozen=True)
class Supported:
    """Shell with its support.

    Attributes
    ----------
    shell : Shell
        Has the weak springs in ``shell.springs``.
    fixed : (6 k,) array of bool
        Numbers that are zero: by the planes of symmetry and by the support.
    held : (6 k,) array of bool
        Those of them that the support fixes.
    symmetry : (bool, bool)
        As the mesh's.
    """

    shell: Shell
    fixed: FloatArray
    held: FloatArray
    symmetry: tuple[bool, bool]

    def reaction(self, q: FloatArray, load: FloatArray | None = None) -> FloatArray:
        """Force ``(3,)`` [N] of the whole body's support and weak springs on it in the equilibrium ``q (6 k,)``.

        ``load (6 k,)`` are the outer forces on the held numbers, none by default. In a frictionless grasp of a slope
        this is what the pads fail to hold: more than friction could carry means that the body slides out.
        """
        force = -self.shell.springs * q
        at = self.held
        force[at] = self.shell.residual(q)[at] - (0.0 if load is None else load[at])
        total = force.reshape(-1, 6)[:, :3].sum(axis=0) * 2.0 ** sum(self.symmetry)
        total[:2][list(self.symmetry)] = 0.0  # the other side's cancel
        return total


def supported(mesh: BodyMesh, material: WallMaterial, support: str = "free", stiffness: float = WEAK) -> Supported:
    """Shell of a body that is held in one of the ways of ``SUPPORTS``.

    Parameters
    ----------
    mesh : BodyMesh
    material : WallMaterial
    support : str
        "clamped": the flat bottom does not move; "standing": the rim of the bottom keeps its height; "free".
    stiffness : float
        Of the weak springs that hold what is left of rigid motions, all together and per direction [N/m].

    Raises
    ------
    ValueError
        For an unknown support, or springs that would leave the body adrift.
    """
    if support not in SUPPORTS:
        raise ValueError(f"support '{support}' is unknown; choose one of {', '.join(SUPPORTS)}")
    if not stiffness > 0:
        raise ValueError(f"the weak springs need a positive stiffness, found {stiffness} N/m")
    shell = Shell(mesh, material.young_modulus, material.poisson_ratio)
    shell.springs.reshape(-1, 6)[:, :3] = (stiffness * mesh.share * shell.node_area / shell.node_area.sum())[:, None]
    held = np.zeros((shell.nodes, 6), dtype=bool)
    SUPPORTS[support](mesh, held)
    held = held.ravel() & ~mesh.symmetric
    return Supported(shell, held | mesh.symmetric, held, mesh.symmetry)


def _clamped(mesh: BodyMesh, held: FloatArray) -> None:
    lines = mesh.s <= max(mesh.surface.flat[0], mesh.s[0]) + ON_LINE
    held[np.unique(mesh.number[:, lines])] = True


def _standing(mesh: BodyMesh, held: FloatArray) -> None:
    held[mesh.foot, 2] = True


def _free(mesh: BodyMesh, held: FloatArray) -> None:
    """Nothing but the weak springs."""


SUPPORTS = {"clamped": _clamped, "standing": _standing, "free": _free}
