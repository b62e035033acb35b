"""The backing plate behind a pad as an elastic plate: its stiffness for the nodes of the pad's back, condensed once.

The plate has the outline of the pad. The finger holds it on a patch in its middle, which moves by the closing alone;
the rest bends. Its four-node shell elements have their corners on the nodes of the pad's back, which is glued to its
face, and on the edges of the patch that is held. Displacements of the plate are taken as small.
"""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from softjaw.fem.pad.shape import BackingPlate, TiltingMount
from softjaw.fem.shell.element import Shell, patch
from softjaw.fem.shell.wall_model import LinearShell
from softjaw.friction.patch import NEGLIGIBLE, FloatArray


class BackStiffness(NamedTuple):
    """Stiffness of the backing plate on the back of one mesh.

    ``free (rows, columns, 3)``: displacements of the back's nodes, along x then y, that the finger and the planes of
    symmetry leave free; ``K (k + 1, k + 1)``: forces on them, and last on the finger along the approach, by them and
    the closing displacement [N/m].
    """

    free: NDArray[np.bool_]
    K: FloatArray


# both fingers and all candidates share few plates: one per mesh and symmetry
@lru_cache(maxsize=8)
def back_stiffness(
    x: tuple[float, ...], y: tuple[float, ...], symmetry: tuple[bool, bool], plate: BackingPlate
) -> BackStiffness:
    """Stiffness for nodes on the lines ``x`` and ``y`` [m]; ``symmetry`` as in `fem.pad.mesh.Pad`."""
    shell, fixed, free, number = _plate(x, y, symmetry, plate)
    if not free.any():
        return BackStiffness(free, np.zeros((1, 1)))
    loose = free.any(axis=-1)
    nodes = number[loose]
    linear = LinearShell(shell, fixed)
    C = linear.compliance(nodes)
    linear.destroy()
    moving = free[loose].ravel()
    C = C[np.ix_(moving, moving)]
    approach = np.tile([0.0, 0.0, 1.0], len(nodes))[moving]
    # the compliance is symmetric but for rounding; Cholesky needs it exactly, and so does a symmetric tangent
    S = cho_solve(cho_factor(0.5 * (C + C.T)), np.eye(len(C)))
    S = 0.5 * (S + S.T)
    # a rigid motion along the approach needs no force: the finger's row and column follow from equilibrium
    Se = S @ approach
    return BackStiffness(free, np.block([[S, -Se[:, None]], [-Se[None], np.atleast_2d(approach @ Se)]]))


@lru_cache(maxsize=8)
def mount_stiffness(
    x: tuple[float, ...], y: tuple[float, ...], symmetry: tuple[bool, bool], mount: TiltingMount
) -> BackStiffness:
    """Stiffness of a rigid plate that may tilt by ``theta``, for nodes on the lines ``x`` and ``y`` [m].

    With the modes ``B = [y, -x]`` of tilting and the bond ``G`` of each node the energy is
    ``1/2 (u - c - B theta) G (u - c - B theta) + 1/2 k theta^2`` (small rotations; the plate moves along the approach
    alone). Its minimum over ``theta`` is ``1/2 (u - c) S (u - c)`` with ``S = G - G B (k + B^T G B)^-1 B^T G``.
    """
    X, Y = np.meshgrid(x, y, indexing="ij")
    weights = np.outer(*(0.5 * (np.diff(line, prepend=line[0]) + np.diff(line, append=line[-1])) for line in (x, y)))
    share = 0.5 ** sum(symmetry)
    G = (mount.glue * weights).ravel()
    # tilting is odd in a plane of symmetry, so that the plane forbids it
    modes = [mode.ravel() for mode, odd in ((Y, symmetry[1]), (-X, symmetry[0])) if not odd]
    S = np.diag(G)
    if modes:
        GB = G[:, None] * np.stack(modes, axis=1)
        k = mount.stiffness * share * np.eye(len(modes))
        S = S - GB @ np.linalg.solve(k + np.stack(modes) @ GB, GB.T)
    S = 0.5 * (S + S.T)
    e = np.ones(len(G))
    free = np.zeros((len(x), len(y), 3), dtype=bool)
    free[..., 2] = True
    return BackStiffness(free, np.block([[S, -(S @ e)[:, None]], [-(S @ e)[None], np.atleast_2d(e @ S @ e)]]))


def relative_compliance(
    x: tuple[float, ...], y: tuple[float, ...], symmetry: tuple[bool, bool], plate: BackingPlate, foam: float
) -> float:
    """Mean deflection of the plate under an even pressure over that of the foam ``thickness / E = foam`` [m/Pa].

    Zero where the finger holds every node of the backing plate.
    """
    shell, fixed, free, _ = _plate(x, y, symmetry, plate)
    if not free.any():
        return 0.0
    load = np.zeros((shell.nodes, 6))
    # a force on the plate's face works on the middle and on the director alike
    load[:, 2] = load[:, 5] = shell.node_area
    linear = LinearShell(shell, fixed)
    q = linear.solve(load.ravel()).reshape(-1, 6)
    linear.destroy()
    return float(shell.node_area @ (q[:, 2] + q[:, 5]) / shell.node_area.sum() / foam)


def _plate(x: tuple[float, ...], y: tuple[float, ...], symmetry: tuple[bool, bool], plate: BackingPlate):
    """Shell of the plate, its fixed numbers ``(6 k,)``; of the pad's nodes the displacements of its face that are free.

    These are ``(rows, columns, 3)``; the nodes' numbers in the shell ``(rows, columns)`` come last.
    """
    given, half = (np.array(x), np.array(y)), 0.5 * np.array(plate.support)
    # a line of the pad's this near to the edge of the patch is its edge; thinner elements would serve nothing
    near = [0.05 * np.diff(line).min() for line in given]
    lines = []
    for line, edge, apart in zip(given, half, near, strict=True):
        edges = [e for e in (-edge, edge) if line[0] < e < line[-1] and np.abs(line - e).min() > apart]
        lines.append(np.sort(np.append(line, edges)))
    X = np.stack([*np.meshgrid(*lines, indexing="ij"), np.zeros([len(line) for line in lines])], axis=-1)
    shell = Shell(patch(X, np.array([0.0, 0.0, 1.0]), plate.thickness), plate.young_modulus, plate.poisson_ratio)
    clamped = (np.abs(X[..., :2]) <= half + near).all(axis=-1)
    fixed = np.repeat(clamped[..., None], 6, axis=-1)
    for axis in range(2):
        if symmetry[axis]:
            fixed[np.abs(X[..., axis]) < NEGLIGIBLE, axis] = fixed[np.abs(X[..., axis]) < NEGLIGIBLE, 3 + axis] = True
    at = np.ix_(*(np.searchsorted(line, of_pad) for line, of_pad in zip(lines, given, strict=True)))
    return shell, fixed.ravel(), ~fixed[..., :3][at], np.arange(clamped.size).reshape(clamped.shape)[at]
