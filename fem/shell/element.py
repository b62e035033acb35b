"""Thin shell element: four nodes, each with the mid-surface's place and a director; exact forces and tangent.

A material point of the shell is ``x = phi + zeta d`` with ``zeta`` from -1 to 1; the reference has ``phi = X`` (middle
of the wall) and ``d = D`` (half the wall thickness times the unit normal), so ``zeta = 1`` is the outer face. The
unknowns of a node are the displacement ``u = phi - X`` and the change ``w = d - D`` of the director: six numbers that
add up and need no rotations. All Green-Lagrange strains are quadratic forms of ``phi`` and ``d``.

An element has 26 strains: at each of the 2 x 2 Gauss points two membrane and two bending strains along local axes,
their shears sampled at the centre, the transverse shears at the middles of the four sides (Bathe and Dvorkin, Int. J.
Num. Meth. Eng. 21, 1985, which removes shear locking), and the thickness strain at the nodes, which has no Poisson
coupling with the others (so no thickness locking, and no inner unknowns). Terms of order thickness/radius are left out.

Arithmetic is strict IEEE, as in ``fem.materials``.
"""

from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import bsr_matrix

from softjaw.fem.assembly import IntArray, Pattern, pairs
from softjaw.fem.shell import element_kernel as kernel
from softjaw.fem.shell.element_kernel import A_0, A_G, B_0, B_G, GAUSS, N_G, STRAINS
from softjaw.friction.patch import FloatArray

SHEAR_CORRECTION = 5.0 / 6.0
NO_STEP = np.empty((0, 6))


@dataclass(frozen=True)
class ShellMesh:
    """Mesh of the middle surface.

    ``X, D (k, 3)``: nodes on the middle surface and their directors, half the wall thickness times the outward unit
    normal [m]; the outer face is ``X + D``; ``elements (n, 4)``: node numbers, counter-clockwise seen from outside; two
    neighbours may be the same node.
    """

    X: FloatArray
    D: FloatArray
    elements: IntArray

    @property
    def outer(self) -> FloatArray:
        """Nodes of the outer face ``(k, 3)`` [m]."""
        return self.X + self.D

    @property
    def thickness(self) -> FloatArray:
        """Wall thickness at every node ``(k,)`` [m]."""
        return 2.0 * np.linalg.norm(self.D, axis=1)


MeshT = TypeVar("MeshT", bound=ShellMesh)


def grid_elements(number: IntArray) -> IntArray:
    """Elements ``(n, 4)`` over a grid of node numbers ``(rows, columns)``; first direction along the rows' index.

    An element all of whose corners fall on fewer than three nodes is left out.
    """
    corners = [number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]]
    elements = np.stack([corner.ravel() for corner in corners], axis=1).astype(np.int32)
    distinct = 1 + (np.diff(np.sort(elements, axis=1), axis=1) != 0).sum(axis=1)
    return elements[distinct >= 3]


def patch(X: FloatArray, normal: FloatArray, thickness: float) -> ShellMesh:
    """Mesh of a grid of places ``X (rows, columns, 3)`` with unit normals; node ``row * columns + column``."""
    number = np.arange(X.shape[0] * X.shape[1], dtype=np.int32).reshape(X.shape[:2])
    D = 0.5 * thickness * np.broadcast_to(normal, X.shape)
    return ShellMesh(X.reshape(-1, 3), np.ascontiguousarray(D.reshape(-1, 3)), grid_elements(number))


def folded(X: FloatArray, D: FloatArray, nodes: IntArray) -> NDArray[np.bool_]:
    """Which elements ``(n,)`` do not face the side of their directors; nearer to edge-on than 1e-9 counts as folded."""
    x, d = X[nodes], D[nodes].mean(axis=1)
    normal = np.cross(*(np.einsum("i,nik->nk", s, x) for s in (A_0, B_0)))
    least = 1e-9 * np.linalg.norm(normal, axis=1) * np.linalg.norm(d, axis=1)
    return np.asarray(~(np.einsum("nk,nk->n", normal, d) > least))


def elements(
    X: FloatArray, D: FloatArray, nodes: IntArray, young_modulus: float, poisson_ratio: float
) -> tuple[tuple[IntArray, FloatArray, FloatArray, FloatArray], FloatArray]:
    """Constants of the elements between nodes at ``X (k, 3)`` with directors ``D (k, 3)`` [m], and their areas.

    The element's first direction crossed with its second must point to the side of ``D``. Two neighbouring nodes of an
    element may coincide (a triangle at the middle of a disc).

    Raises `ValueError`: for an element without area at a Gauss point or facing against its directors.

    Returns
    -------
    nodes, weights, stiffness, start
        ``weights`` as in ``fem.shell.element_kernel``; ``stiffness`` of the strains: in the middle surface at each
        Gauss point ``thickness dA E / (1 - nu^2)`` [N], in bending a third of that; of the shear at the centre, the
        transverse shears on the four sides and the thickness strains; ``start``: the quadratic forms of the reference
        state, from which strains are differences.
    area : (n, 4) array
        Of each Gauss point [m^2].
    """
    E, nu = young_modulus, poisson_ratio
    G = E / (2.0 * (1.0 + nu))
    nodes = np.ascontiguousarray(nodes, dtype=np.int32)
    x, d = X[nodes], D[nodes]
    side = np.linalg.norm(d, axis=2)
    # an axis that treats both directions alike: results do not depend on which side of an element comes first
    e1 = _bisecting_axis(*(np.einsum("i,nik->nk", s, x) for s in (A_0, B_0)))
    g_centre, _ = _metric(x, A_0, B_0, e1)
    points = [_metric(x, a, b, e1) for a, b in zip(A_G, B_G, strict=True)]
    g, area = np.stack([p[0] for p in points], 1), np.stack([p[1] for p in points], 1)
    bad = np.flatnonzero(~(area > 0).all(axis=1) | folded(X, D, nodes))
    if len(bad):
        raise ValueError(
            f"shell element {bad[0]} with nodes {nodes[bad[0]].tolist()} has no area or its directors "
            "point to its inner face; order its nodes counter-clockwise seen from outside"
        )
    h = side @ N_G.T  # half thickness at the Gauss points
    volume = 2.0 * h * area
    gP = np.einsum("nqba,qas->nqbs", g, _side_mixing())
    plane = np.stack([g[..., 0] ** 2, g[..., 1] ** 2, g[..., 0] * g[..., 1]], axis=-1)
    c = g_centre
    twist = np.stack(
        [2 * c[:, 0, 0] * c[:, 1, 0], 2 * c[:, 0, 1] * c[:, 1, 1], c[:, 0, 0] * c[:, 1, 1] + c[:, 0, 1] * c[:, 1, 0]],
        axis=1,
    )
    weights = _weights(plane, twist)
    stiffness = np.zeros((len(nodes), STRAINS, STRAINS))
    for q in range(4):
        in_plane = (volume[:, q] * E / (1.0 - nu**2))[:, None, None] * np.array([[1.0, nu], [nu, 1.0]])
        for first, share in ((2 * q, 1.0), (8 + 2 * q, 3.0)):  # the mean of zeta^2 over the wall is 1/3
            stiffness[:, first : first + 2, first : first + 2] = in_plane / share
    stiffness[:, 16, 16], stiffness[:, 17, 17] = G * volume.sum(axis=1), G * volume.sum(axis=1) / 3.0
    stiffness[:, 18:22, 18:22] = np.einsum("nq,nqbs,nqbt->nst", SHEAR_CORRECTION * G * volume / h**2, gP, gP)
    stiffness[:, 22:, 22:] = np.einsum("nq,qi,qj->nij", E * volume / h**4, N_G, N_G)
    start = np.zeros((len(nodes), STRAINS))
    kernel.forms(nodes, weights, np.hstack([X, D]), start)
    return (nodes, weights, stiffness, start), area


def _weights(plane: FloatArray, twist: FloatArray) -> FloatArray:
    """Weights ``(n, 26, 4)`` of the products in each strain.

    ``plane (n, 4, 2, 3)`` are the rows that make the local strains 11 and 22 at each Gauss point from the covariant
    ``E11, E22, 2 E12``, ``twist (n, 3)`` the same at the centre for the local shear ``gamma_12``.
    """
    weights, half = np.zeros((len(twist), STRAINS, 4)), np.array([0.5, 0.5, 1.0])
    weights[:, :8, :3] = (plane * half).reshape(-1, 8, 3)
    weights[:, 8:16] = plane[..., [0, 1, 2, 2]].reshape(-1, 8, 4)
    weights[:, 16, :3], weights[:, 17] = twist * half, twist[:, [0, 1, 2, 2]]
    weights[:, 18:22, 0], weights[:, 22:, 0] = 1.0, 0.5
    return weights


def _bisecting_axis(A1: FloatArray, A2: FloatArray) -> FloatArray:
    """First axis ``(n, 3)`` of the right-angled frame whose diagonal bisects ``A1`` and ``A2 (n, 3)``."""
    n = np.cross(A1, A2)
    n /= np.linalg.norm(n, axis=1)[:, None]
    m = A1 / np.linalg.norm(A1, axis=1)[:, None] + A2 / np.linalg.norm(A2, axis=1)[:, None]
    m /= np.linalg.norm(m, axis=1)[:, None]
    return (m - np.cross(n, m)) / np.sqrt(2.0)


def _metric(x: FloatArray, a: FloatArray, b: FloatArray, e1: FloatArray) -> tuple[FloatArray, FloatArray]:
    """``g[b, alpha] = G^alpha . e_b (n, 2, 2)`` at one point of each element, and ``|A1 x A2| (n,)``."""
    A = np.stack([np.einsum("i,nik->nk", a, x), np.einsum("i,nik->nk", b, x)], axis=1)
    n = np.cross(A[:, 0], A[:, 1])
    area = np.linalg.norm(n, axis=1)
    n = n / np.where(area > 0, area, 1.0)[:, None]
    # laid into the tangent plane of this point: a warped element has another at each
    f1 = e1 - np.einsum("nk,nk->n", e1, n)[:, None] * n
    f1 /= np.linalg.norm(f1, axis=1)[:, None]
    M = np.einsum("nak,nbk->nab", A, np.stack([f1, np.cross(n, f1)], axis=1))  # A_alpha . e_b
    # only so that the inverse exists: the caller refuses an element without area
    M[area <= 0] = np.eye(2)
    return np.linalg.inv(M), area


def _side_mixing() -> FloatArray:
    """Weights ``(Gauss point, 2, side)`` that make 2 E13 and 2 E23 at the Gauss points from the sides' values."""
    mix = np.zeros((4, 2, 4))
    mix[:, 0, 0], mix[:, 0, 1] = 0.5 * (1 - GAUSS[:, 1]), 0.5 * (1 + GAUSS[:, 1])
    mix[:, 1, 2], mix[:, 1, 3] = 0.5 * (1 - GAUSS[:, 0]), 0.5 * (1 + GAUSS[:, 0])
    return mix


class Shell(Generic[MeshT]):
    """Thin-walled object.

    ``springs``: nodes ``(m,)`` and the stiffness to ground of their displacements ``(3 m, 3 m)`` [N/m]. ``loops``:
    leading arguments of the compiled loops, see `elements`; ``size``: ``6 k``; ``start (6 k + 1,), column (nnz,)``:
    compressed rows of the tangent, columns ascending; ``node_area (k,)``: reference area that belongs to each
    node [m^2].
    """

    def __init__(
        self, mesh: MeshT, young_modulus: float, poisson_ratio: float,
        springs: tuple[IntArray, FloatArray] | None = None,
    ) -> None:  # fmt: skip
        self.mesh, self.young_modulus, self.poisson_ratio = mesh, float(young_modulus), float(poisson_ratio)
        self.loops, area = elements(mesh.X, mesh.D, mesh.elements, self.young_modulus, self.poisson_ratio)
        self.size = 6 * len(mesh.X)
        self.springs = springs or (np.zeros(0, dtype=np.int32), np.zeros((0, 0)))
        self._reference = np.hstack([mesh.X, mesh.D])
        self.node_area = np.bincount(mesh.elements.ravel(), (area @ kernel.N_G).ravel(), minlength=len(mesh.X))
        self._build_pattern()

    def _build_pattern(self) -> None:
        """Blocks of 6 x 6 between nodes that share an element, or springs."""
        nodes, n, sprung = self.loops[0], len(self.mesh.X), self.springs[0]
        rows, columns = pairs(nodes[:, :, None], nodes[:, None, :])
        between = pairs(sprung[:, None], sprung[None, :])
        graph = Pattern(n, np.concatenate([rows, between[0]]), np.concatenate([columns, between[1]]))
        count = np.diff(graph.start)
        row = np.repeat(np.arange(n), count)
        # the kernel adds whole blocks: where each begins, and how far apart its six rows are
        place = 36 * graph.start[row] + 6 * (np.arange(len(row)) - graph.start[row])
        self._place = place[graph.slots(rows, columns)].reshape(-1, 4, 4).astype(np.int32)
        self._width = (6 * count).astype(np.int32)
        blocks = np.zeros((len(row), 6, 6))
        matrix = bsr_matrix((blocks, graph.column, graph.start), shape=(self.size, self.size)).tocsr()
        self.start, self.column = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)
        inner = np.arange(3)[:, None] * self._width[between[0]][:, None, None] + np.arange(3)
        inner += place[graph.slots(*between)][:, None, None]
        self._sprung = inner.reshape(len(sprung), len(sprung), 3, 3).swapaxes(1, 2).ravel()

    @property
    def nodes(self) -> int:
        """Number of nodes ``k``."""
        return len(self.mesh.X)

    def residual(self, q: FloatArray) -> FloatArray:
        """Inner forces of the state ``q (6 k,)``, springs included: ``(6 k,)`` [N]."""
        out, (sprung, stiffness) = np.zeros((self.nodes, 6)), self.springs
        out[sprung, :3] = (stiffness @ q.reshape(-1, 6)[sprung, :3].ravel()).reshape(-1, 3)
        kernel.residual(*self.loops, self._reference + q.reshape(-1, 6), out)
        return out.ravel()

    def tangent(self, q: FloatArray, before: FloatArray | None = None) -> FloatArray:
        """Values ``(nnz,)`` of the tangent [N/m] in ``q (6 k,)``, at ``start`` and ``column``.

        ``before (6 k,)``: state at the previous tangent of the same Newton solve. With it the tangent is that of mixed
        integration points (Magisano, Leonetti, Garcea, Int. J. Num. Meth. Eng. 109, 2017): its geometric part uses the
        stresses that the last linear step predicted. The residual, and so the solution, is untouched; thin shells get
        there in far fewer iterations. Leave it out in the first iteration, also after every cut step.
        """
        values = np.zeros(self.start[-1])
        # assigned, not added: the kernel adds the elements to it
        values[self._sprung] = self.springs[1].ravel()
        q = q.reshape(-1, 6)
        # an array without rows, so that the compiled loop sees one type
        step = NO_STEP if before is None else q - before.reshape(-1, 6)
        kernel.tangent(*self.loops, self._reference + q, step, self._place, self._width, values)
        return values

    def entries(self, unknown: IntArray) -> tuple[IntArray, IntArray]:
        """Row and column ``(nnz,)`` of every value; ``unknown (6 k,)`` numbers the shell's numbers, -1 where fixed."""
        return np.repeat(unknown, np.diff(self.start)), unknown[self.column]
