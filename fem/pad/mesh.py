"""The pad: a foam block bonded to a rigid backing plate, meshed with hexahedra through scikit-fem.

The mesh covers the whole pad, or the half or quarter that symmetry leaves. Unknowns are numbered
``[free displacements | closing of the backing plate | nodal pressures]``: the nodes of the bonded back share one
unknown, the closing, so that the force on the plate is the residual of that unknown. On an elastic plate only the nodes
that the finger holds do; the others are free, and the backing plate connects them to the closing displacement.
"""

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from skfem import Basis, ElementHex1, ElementHex2, ElementLineP1, ElementLineP2, MeshHex

from softjaw.fem.assembly import IntArray
from softjaw.fem.materials import Material
from softjaw.fem.pad.backing_plate import BackStiffness, back_stiffness, mount_stiffness
from softjaw.fem.pad.shape import BackingPlate, PadShape, TiltingMount
from softjaw.friction.patch import FloatArray

# these orders give 2 x 2 x 2 and 3 x 3 x 3 Gauss points
BASES = {"hex8": (ElementHex1, 3), "hex27": (ElementHex2, 5)}  # element, order of the quadrature
# Square of the distance of a face rule's outer points from its middle over half the side, by the number of points.
RULES = {
    "weighted": {2: 1 / 3, 3: 3 / 5},  # Gauss
    # 1/2 and 2/3 of the way to Lobatto: errors of either kind cancel (Ainsworth and Wajid, 2010, "optimally blended")
    "blended": {2: 2 / 3, 3: 13 / 15},
    "nodal": {2: 1.0, 3: 1.0},  # Lobatto: the points are the nodes
}
SIDES = {2: (ElementLineP1(), [0, 1]), 3: (ElementLineP2(), [0, 2, 1])}  # element along a side, its nodes in order


class Pad:
    """Discrete pad in its own frame: contact face at ``z = 0``, back at ``z = -thickness``.

    Parameters
    ----------
    shape : PadShape
    material : Material
    symmetry : (bool, bool)
        Whether ``x = 0`` and ``y = 0`` are planes of symmetry; only the positive side is then meshed, of an even number
        of elements.
    contact : str
        The points of the contact face that gap and pressure are integrated with, of `RULES`: ``"weighted"`` takes Gauss
        points, ``"nodal"`` the nodes, so that each has a gap of its own, ``"blended"`` points between these.
    backing_plate : BackingPlate or TiltingMount, optional
        The plate behind the pad; rigid without.

    Attributes
    ----------
    dN, volume : (n, points, 3, nodes), (n, points) arrays
        Reference gradients [1/m] and volumes [m^3] of the quadrature points.
    nodes : (k, 3) array
        Node positions [m].
    element_nodes : (n, nodes) array
    back : BackStiffness or None
        Of an elastic backing plate.
    back_dofs : (k + 1,) array
        Its unknowns: the free displacements of the back, then the closing displacement.
    dofs : (k, 3) array
        Unknown of each displacement; -1 is fixed.
    face_nodes : (m, face nodes) array
        Nodes of the facets of the contact face.
    face_N, face_area : (points, face nodes), (m, points) arrays
        Shape functions and reference areas [m^2] at the quadrature points of the contact face.
    between_N : (points, face nodes) array
        Shape functions where the contact face may be inside the object although the solve has closed its gaps.
    side_weights : (points along a side,) array
        Weights of that quadrature along one side of a face.
    """

    def __init__(
        self,
        shape: PadShape,
        material: Material,
        symmetry: tuple[bool, bool] = (False, False),
        contact: str = "weighted",
        backing_plate: BackingPlate | TiltingMount | None = None,
    ) -> None:
        self.shape, self.material, self.symmetry, self.backing_plate = shape, material, symmetry, backing_plate
        element, order = BASES[shape.element]
        lines = [shape.lines(0, symmetry[0]), shape.lines(1, symmetry[1]), shape.lines(2, False)]
        basis = Basis(MeshHex.init_tensor(*lines), element(), intorder=order)
        self.nodes = np.ascontiguousarray(basis.doflocs.T)
        self.element_nodes = np.ascontiguousarray(basis.element_dofs.T.astype(np.int32))
        # scikit-fem broadcasts gradients that do not change from element to element; the kernel needs them all
        gradients = np.stack([np.broadcast_to(b[0].grad, (3, *basis.dx.shape)) for b in basis.basis])
        self.dN = np.ascontiguousarray(gradients.transpose(2, 3, 1, 0))
        self.volume = np.ascontiguousarray(basis.dx)
        self._number_unknowns(basis)
        self._describe_contact_face(lines, contact)

    def _number_unknowns(self, basis: Basis) -> None:
        """Number free displacements, then the closing displacement, then one pressure per node of the contact face."""
        # node positions come out of scikit-fem's map with rounding; mesh lines lie much further apart
        tol, count = 1e-9 * max(self.shape.size), len(self.nodes)

        def on_plane(axis: int, place: float) -> NDArray[np.int64]:
            """Nodes of the facets there."""
            return basis.get_dofs(lambda x: np.abs(x[axis] - place) < tol).flatten()

        self.contact_grid = len(self.lines(0)), len(self.lines(1))
        self.contact_nodes, back_nodes = (self._as_grid(on_plane(2, z)) for z in (0.0, -self.shape.size[2]))
        free = np.ones((count, 3), dtype=bool)
        self.back = self._on_plate(back_nodes)
        # an elastic plate leaves all of the back free that neither the finger nor a plane of symmetry holds
        free[back_nodes] = self.back.free.reshape(-1, 3) if self.back else False
        for axis in range(2):
            if self.symmetry[axis]:
                free[on_plane(axis, 0.0), axis] = False
        self.closing_dof = int(free.sum())
        self.dofs = np.full((count, 3), -1, dtype=np.int32)
        self.dofs[free] = np.arange(self.closing_dof, dtype=np.int32)
        self.dofs[back_nodes[~free[back_nodes, 2]], 2] = self.closing_dof
        self.back_dofs = np.append(self.dofs[back_nodes][free[back_nodes]], np.int32(self.closing_dof))
        self.pressure_index = np.full(count, -1, dtype=np.int32)
        self.pressure_index[self.contact_nodes] = np.arange(len(self.contact_nodes), dtype=np.int32)
        self.size = self.closing_dof + 1 + len(self.contact_nodes)

    def _on_plate(self, back_nodes: IntArray) -> BackStiffness | None:
        """Stiffness of what lies behind the nodes of the back."""
        if self.backing_plate is None:
            return None
        grid = self.nodes[back_nodes].reshape(*self.contact_grid, 3)
        lines = (tuple(map(float, line)) for line in (grid[:, 0, 0], grid[0, :, 1]))
        if isinstance(self.backing_plate, TiltingMount):
            return mount_stiffness(*lines, self.symmetry, self.backing_plate)
        return back_stiffness(*lines, self.symmetry, self.backing_plate)

    def _describe_contact_face(self, lines: list[FloatArray], contact: str) -> None:
        """Faces of the contact face as a tensor grid, and its quadrature."""
        per_side = self.shape.per_side
        step = per_side - 1
        grid = self.contact_nodes.reshape(self.contact_grid)
        windows = np.lib.stride_tricks.sliding_window_view(grid, (per_side, per_side))
        self.face_nodes = windows[::step, ::step].reshape(-1, per_side**2)
        area = np.outer(np.diff(lines[0]), np.diff(lines[1])).ravel()
        self.contact = contact
        self.face_N, self.side_weights = face_rule(per_side, contact)
        # at the same places whatever the rule, so that the depths of both compare
        self.between_N, _ = face_rule(per_side, "weighted")
        self.face_area = np.outer(area, np.outer(self.side_weights, self.side_weights))
        self.node_area = np.bincount(
            self.pressure_index[self.face_nodes].ravel(),
            (self.face_area @ self.face_N).ravel(),
            len(self.contact_nodes),
        )

    def pieces_N(self, parts: int) -> FloatArray:
        """Shape functions ``(places, face nodes)`` over grids of ``parts`` places a side in the pieces of points."""
        weights, inside = self.side_weights, (np.arange(parts) + 0.5) / parts
        places = (np.cumsum(weights) - weights)[:, None] + weights[:, None] * inside
        return _over_face(along_side(len(weights), places.ravel()))

    @property
    def share(self) -> float:
        """Part of the whole pad that is meshed: 1, 1/2 or 1/4."""
        return 0.5 ** sum(self.symmetry)

    @property
    def rounding(self) -> float:
        """Norm of the forces that rounding leaves where a stiff backing plate meets the closing displacement [N]."""
        if self.back is None:
            return 0.0
        return float(np.finfo(float).eps * self.shape.size[2] * np.linalg.norm(np.diag(self.back.K)[:-1]))

    @cached_property
    def modulus_per_thickness(self) -> float:
        """``E / thickness`` [Pa/m]: scales pressures to lengths and estimates the pad as a bed of springs."""
        return self.material.young_modulus / self.shape.size[2]

    def lines(self, axis: int) -> FloatArray:
        """Coordinates of the nodes along an axis, rising [m]."""
        ends = self.shape.lines(axis, axis < 2 and self.symmetry[axis])
        # those inside a triquadratic element lie in its middle
        return ends if self.shape.per_side == 2 else np.sort(np.append(ends, 0.5 * (ends[1:] + ends[:-1])))

    def places(self, nodes: FloatArray) -> tuple[IntArray, ...]:
        """Numbers along each axis of the mesh lines that nodes ``(n, d)`` lie on [m]."""
        # nodes inside elements are off their line by rounding, so the nearest line is theirs
        lines = (self.lines(axis) for axis in range(nodes.shape[1]))
        return tuple(np.abs(x[:, None] - line).argmin(axis=1) for x, line in zip(nodes.T, lines, strict=True))

    def _as_grid(self, chosen: NDArray[np.int64]) -> IntArray:
        """Nodes of a face as a grid, along x first."""
        column, row = self.places(self.nodes[chosen, :2])
        return chosen[np.lexsort((row, column))].astype(np.int32)

    def displacement(self, x: FloatArray) -> FloatArray:
        """Nodal displacements ``(k, 3)`` [m] of a vector of unknowns."""
        u = np.zeros(self.dofs.shape)
        u[self.dofs >= 0] = x[self.dofs[self.dofs >= 0]]
        return u


def face_rule(per_side: int, contact: str) -> tuple[FloatArray, FloatArray]:
    """Shape functions ``(points, face nodes)`` of a tensor rule with a point per node, and weights along a side."""
    # three points have one more in the middle, and weights that integrate a parabola
    a = math.sqrt(RULES[contact][per_side])
    points = np.linspace(0.5 - 0.5 * a, 0.5 + 0.5 * a, per_side)
    outer = 0.5 if per_side == 2 else 1.0 / (6.0 * a * a)
    weights = np.array([outer, outer]) if per_side == 2 else np.array([outer, 1.0 - 2.0 * outer, outer])
    return _over_face(along_side(per_side, points)), weights


def _over_face(side: FloatArray) -> FloatArray:
    """Shape functions ``(points, face nodes)`` over a grid of places from those along a side ``(places, nodes)``."""
    return np.einsum("pi,qj->pqij", side, side).reshape(len(side) ** 2, -1)


def along_side(per_side: int, s: FloatArray) -> FloatArray:
    """Shape functions ``(points, nodes)`` along a side of an element, from end to end, at places ``s`` in [0, 1]."""
    element, order = SIDES[per_side]
    return np.stack([element.lbasis(s[None], i)[0] for i in order], axis=1)
