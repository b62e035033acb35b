"""Thin shell element: four nodes, each with the mid-surface's place and a director; exact forces and tangent.

A material point of the shell is ``x = phi + zeta d`` with ``zeta`` from -1 to 1; the reference has ``phi = X`` (middle
of the wall) and ``d = D`` (half the wall thickness times the unit normal), so ``zeta = 1`` is the outer face. The
unknowns of a node are the displacement ``u = phi - X`` and the change ``w = d - D`` of the director: six numbers that
add up and need no rotations. All Green-Lagrange strains are quadratic forms of ``phi`` and ``d``.

An element has 26 strains: at each of the 2 x 2 Gauss points two membrane and two bending strains along local axes,
their shears sampled at the centre, the transverse shears at the middles of the four sides (Bathe and Dvorkin, Int. J.
Num. Meth. Eng. 21, 1985, which removes shear locking), and the thickness strain at the nodes, which has no Poisson
coupling with the others (so no thickness locking, and no inner unknowns). Terms of order thickness/radius are left out.

Arithmetic is strict IEEE, as in ``fem.pad.hexahedra``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.shell import element_kernel as kernel
from softjaw.fem.shell.element_kernel import A_0, A_G, B_0, B_G, GAUSS, N_G, STRAINS, FloatArray

IntArray = NDArray[np.int32]
SHEAR_CORRECTION = 5.0 / 6.0


@dataclass(frozen=True)
class Elements:
    """What never changes about the ``n`` elements of a shell.

    Attributes
    ----------
    nodes : (n, 4) array
    plane : (n, 4, 2, 3) array
        At each Gauss point, rows that make the local strains 11 and 22 from the covariant ``E11, E22, 2 E12``.
    twist : (n, 3) array
        The same at the centre for the local shear ``gamma_12``.
    membrane : (n, 4) array
        ``thickness dA E / (1 - nu^2)`` of each Gauss point [N].
    in_plane : (n,) array
        ``thickness G area`` for ``gamma_12`` [N m]. Bending stiffnesses are a third of the membrane's.
    shear, thickness : (n, 4, 4) arrays
        Stiffnesses of the transverse shears on the four sides and of the thickness strains of the four nodes.
    start : (n, 26) array
        The quadratic forms of the reference state; strains are the differences from it.
    area : (n, 4) array
        Reference area of each Gauss point [m^2].
    poisson_ratio : float
    """

    nodes: IntArray
    plane: FloatArray
    twist: FloatArray
    membrane: FloatArray
    in_plane: FloatArray
    shear: FloatArray
    thickness: FloatArray
    start: FloatArray
    area: FloatArray
    poisson_ratio: float

    @property
    def loops(self) -> tuple:
        """Leading arguments of the compiled loops."""
        return (
            self.nodes, self.plane, self.twist, self.membrane, self.in_plane, self.shear, self.thickness, self.start,
            self.poisson_ratio,
        )  # fmt: skip


def elements(X: FloatArray, D: FloatArray, nodes: IntArray, young_modulus: float, poisson_ratio: float) -> Elements:
    """Constants of the elements between nodes at ``X (k, 3)`` with directors ``D (k, 3)`` [m].

    The element's first direction crossed with its second must point to the side of ``D``. Two neighbouring nodes of an
    element may coincide (a triangle at the middle of a disc).

    Raises
    ------
    ValueError
        For an element without area at a Gauss point or facing against its directors.
    """
    E, nu = young_modulus, poisson_ratio
    G = E / (2.0 * (1.0 + nu))
    nodes = np.ascontiguousarray(nodes, dtype=np.int32)
    x, d = X[nodes], D[nodes]
    side = np.linalg.norm(d, axis=2)
    e1 = _bisecting_axis(*(np.einsum("i,nik->nk", s, x) for s in (A_0, B_0)))
    g_centre, _ = _metric(x, A_0, B_0, e1)
    points = [_metric(x, a, b, e1) for a, b in zip(A_G, B_G, strict=True)]
    g, area = np.stack([p[0] for p in points], 1), np.stack([p[1] for p in points], 1)
    facing = np.einsum("nk,nk->n", np.cross(*(np.einsum("i,nik->nk", s, x) for s in (A_0, B_0))), d.mean(axis=1))
    bad = np.flatnonzero(~((area > 0).all(axis=1) & (facing > 0)))
    if len(bad):
        raise ValueError(
            f"shell element {bad[0]} with nodes {nodes[bad[0]].tolist()} has no area or its directors "
            "point to its inner face; order its nodes counter-clockwise seen from outside"
        )
    h = side @ N_G.T  # half thickness at the Gauss points
    volume = 2.0 * h * area
    mix = _side_mixing()
    gP = np.einsum("nqba,qas->nqbs", g, mix)
    plane = np.stack([g[..., 0] ** 2, g[..., 1] ** 2, g[..., 0] * g[..., 1]], axis=-1)
    c = g_centre
    twist = np.stack(
        [2 * c[:, 0, 0] * c[:, 1, 0], 2 * c[:, 0, 1] * c[:, 1, 1], c[:, 0, 0] * c[:, 1, 1] + c[:, 0, 1] * c[:, 1, 0]],
        axis=1,
    )
    result = Elements(
        nodes,
        plane,
        twist,
        volume * E / (1.0 - nu**2),
        G * volume.sum(axis=1),
        np.einsum("nq,nqbs,nqbt->nst", SHEAR_CORRECTION * G * volume / h**2, gP, gP),
        np.einsum("nq,qi,qj->nij", E * volume / h**4, N_G, N_G),
        np.zeros((len(nodes), STRAINS)),
        area,
        float(nu),
    )
    kernel.forms(nodes, plane, twist, np.hstack([X, D]), result.start)
    return result


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
    f1 = e1 - np.einsum("nk,nk->n", e1, n)[:, None] * n
    f1 /= np.linalg.norm(f1, axis=1)[:, None]
    M = np.einsum("nak,nbk->nab", A, np.stack([f1, np.cross(n, f1)], axis=1))  # A_alpha . e_b
    M[area <= 0] = np.eye(2)
    return np.linalg.inv(M), area


def _side_mixing() -> FloatArray:
    """Weights ``(Gauss point, 2, side)`` that make 2 E13 and 2 E23 at the Gauss points from the sides' values."""
    mix = np.zeros((4, 2, 4))
    mix[:, 0, 0], mix[:, 0, 1] = 0.5 * (1 - GAUSS[:, 1]), 0.5 * (1 + GAUSS[:, 1])
    mix[:, 1, 2], mix[:, 1, 3] = 0.5 * (1 - GAUSS[:, 0]), 0.5 * (1 + GAUSS[:, 0])
    return mix
