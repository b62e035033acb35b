"""Contact of pads with an object as one mixed complementarity problem, whether the object is rigid or a wall gives way.

Unknowns ``x = [q | pad 1 | pad 2]``: those of the wall, if there is one (``fem.shell.wall_problem``), and per pad
``[u | delta | l]``: free displacements, closing displacement of the backing plate, and one pressure ``p_i = kappa l_i``
per node of the contact face, with ``kappa = E / thickness`` so that all unknowns are lengths. The residual is::

    R_u     = r_int(u) - int N_a (p n - t) dA                 p = sum N_i p_i, t: friction that acts back, if any
    R_delta = force on the backing plate - F                  (force)
              s (mean closing - its goal), and the difference of both plates' forces   (closing displacement)
    R_l     = kappa [A_i l_i - max(0, A_i l_i - G_i)]         G_i = int N_i g dA   (active set)
              kappa G_i   with   l_i >= 0                     (complementarity)

All rows are forces [N].  ``A_i = int N_i dA``, all integrals are over the reference area, and ``p`` is the nominal
pressure. Both pads press with the same force, each with a closing displacement of its own.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from softjaw.fem.assembly import Pattern, gather, shifted
from softjaw.fem.contact.friction import Anchor, Friction, stick_or_slip
from softjaw.fem.objects.gap import IN_PLACE, Pose
from softjaw.fem.pad.foam import Foam
from softjaw.fem.pad.mesh import Pad
from softjaw.fem.shell.facing import FAR
from softjaw.friction.patch import NEGLIGIBLE, FloatArray

PARTS = 4  # along a side of the area of one point, of which some may lie beyond a rim

Gap = Callable[[FloatArray], tuple[FloatArray, FloatArray, FloatArray]]


def borne(pressure: FloatArray, active: NDArray[np.bool_]) -> FloatArray:
    """Nodal pressures ``(n,)`` [Pa] without what is none: of idle nodes, and what rounding leaves of active ones.

    Whether a node below `NEGLIGIBLE` of the largest pressure bears anything is not decided by the solve, whose
    tolerance is about as large. Tension stays, for the checks to see.
    """
    return np.where(active & bearing(pressure), pressure, np.minimum(pressure, 0.0))


def bearing(pressure: FloatArray) -> NDArray[np.bool_]:
    """Where pressures are more than rounding."""
    return pressure > NEGLIGIBLE * pressure.max(initial=0.0)


@dataclass
class Control:
    """What drives the pads: the normal force on each whole pad [N], or the mean closing [m] without ``force``."""

    force: float | None = None
    closing: float = 0.0


class ContactPoints(NamedTuple):
    """Quadrature points of the meshed contact face in the pad's frame.

    ``position, normal (faces, points, 3)``: deformed points [m] and the object's outward unit normals there; ``depth``:
    how far the deepest Gauss point is inside the object [m]; the solve keeps nodes outside, each by itself or with the
    weighted mean round it, not every point; ``load (faces, points)``: normal force [N];
    ``friction (faces, points, 3)``: tangential force on the pad [N], None without friction.
    """

    position: FloatArray
    normal: FloatArray
    depth: float
    load: FloatArray
    friction: FloatArray | None = None

    @property
    def force(self) -> FloatArray:
        """Contact force of the meshed part on the object ``(3,)`` [N]."""
        normal = np.einsum("fq,fqi->i", self.load, self.normal)
        return -normal if self.friction is None else -normal - self.friction.sum(axis=(0, 1))


class Finger:
    """One pad: where it stands, what it can touch, and which unknowns of the whole problem belong to it.

    Parameters
    ----------
    pad : Pad
    gap : callable
        Points ``(n, 3)`` of the pad's frame at first touch to signed distance, gradient and Hessian of the undeformed
        object.
    offset : int
        Its first unknown.
    pose : Pose
        The pad's frame at first touch; the points of a rigid object are taken in the pad's frame.
    wall : Wall, optional
        The part of the outer face of a wall that it can touch.

    Attributes
    ----------
    unknowns, pressures : slice
        Its unknowns, and those of them that are pressures over ``kappa`` [m].
    nodes : (facets, k) array
        Number, among the nodes of the contact face, of the nodes of every facet.
    local_dofs, dofs : (facets, 3, k) arrays
        Displacements of these nodes, numbered by the pad and in the whole problem; -1 is fixed.
    faced : (facets, points) array
        Area of the points that faces something: of a wall what lies within its ends at first touch [m^2].
    """

    def __init__(self, pad: Pad, gap: Gap, offset: int = 0, pose: Pose = IN_PLACE, wall: Any = None) -> None:
        self.pad, self.foam, self.offset, self.gap, self.pose, self.wall = pad, Foam(pad), offset, gap, pose, wall
        self.R, self.bed = np.ascontiguousarray(pose.rotation), SpringBed(pad, gap)
        self.unknowns = slice(offset, offset + pad.size)
        self.closing_dof = offset + pad.closing_dof
        self.pressures = slice(self.closing_dof + 1, offset + pad.size)
        self.kappa, self.area = pad.modulus_per_thickness, pad.node_area
        self.nodes = pad.pressure_index[pad.face_nodes]
        self.local_dofs = np.ascontiguousarray(pad.dofs[pad.face_nodes].transpose(0, 2, 1))
        self.dofs = shifted(self.local_dofs, offset)
        self.pressure_dofs = shifted(pad.closing_dof + 1 + self.nodes, offset)
        self.foam_entries = shifted(self.foam.rows, offset), shifted(self.foam.columns, offset)
        # decided once: a point that left and faced a wall as it slides across a rim would do so for ever
        self.faced = pad.face_area if wall is None else pad.face_area * self._within()
        # part of a node's area that must face something: with less of it, that would bear all of the node's pressure
        self.carries = self.nodal(self.faced @ pad.face_N) > 0.3 * self.area

    def _within(self) -> FloatArray:
        """Share of the pieces of the points that lies within the ends of the wall ``(facets, points)``."""
        points = self.points(np.zeros(self.unknowns.stop), self.pad.pieces_N(PARTS)).reshape(-1, 3)
        past = self.wall.past_ends(self.pose.to_object(points)).reshape(-1, *[len(self.pad.side_weights), PARTS] * 2)
        return np.asarray(1.0 - past.mean(axis=(2, 4)).reshape(self.pad.face_area.shape))

    def pressure(self, x: FloatArray) -> FloatArray:
        """Nominal pressures of the contact face's nodes at the state ``x`` of the whole problem [Pa]."""
        return self.kappa * x[self.pressures]

    def points(self, x: FloatArray, N: FloatArray | None = None) -> FloatArray:
        """Points of the deformed contact face in the pad's frame ``(facets, points, 3)`` [m].

        ``N (points, k)`` are the facets' shape functions there; by default the points are those of the quadrature.
        """
        corners = (self.pad.nodes + self.pad.displacement(x[self.unknowns]))[self.pad.face_nodes]
        return np.einsum("qa,fai->fqi", self.pad.face_N if N is None else N, corners)

    def nodal(self, values: FloatArray) -> FloatArray:
        """Sums ``(n,)`` over the facets of values ``(facets, k)`` at their nodes."""
        return np.asarray(np.bincount(self.nodes.ravel(), values.ravel(), len(self.area)), dtype=float)

    def active(self, x: FloatArray, weighted_gap: FloatArray) -> NDArray[np.bool_]:
        """Active set ``(n,)`` at the state ``x`` with these weighted gaps [m^3]."""
        return self.area * x[self.pressures] - weighted_gap > 0.0


@dataclass
class Evaluated:
    """The contact face of one finger at one state; vectors of the points in the frame of what it touches.

    Attributes
    ----------
    points, normal : (n, 3) arrays
        Places of the quadrature points [m], and gradients of the gap there.
    gap : (n,) array
        Their gaps [m]; `FAR` where a point faces nothing.
    lam : (facets, k) array
        Nodal pressures [Pa].
    faces : (n,) array
        Whether a point faces something.
    weighted, active : (nodes,) arrays
        Weighted gaps [m^3], active set.
    load : (n, 3) array
        Forces of the points on what they touch, friction included [N].
    surface : Any
        Derivatives: the Hessian of a rigid object's gap, or what the points face on a wall.
    traction : (n, 3) array, optional
        Of friction on the pad [Pa].
    """

    points: FloatArray
    gap: FloatArray
    normal: FloatArray
    lam: FloatArray
    faces: NDArray[np.bool_]
    weighted: FloatArray
    active: NDArray[np.bool_]
    load: FloatArray
    surface: Any
    traction: FloatArray | None = None


class ContactProblem(ABC):
    """Residual of one or two pads on an object, driven by their backing plates; implements ``fem.petsc.Problem``.

    ``mu``: friction coefficient; without it no friction acts back on the pressures.
    """

    complementarity, non_negative = False, slice(0)
    pattern: Pattern
    longest_closing: float  # change of closing displacement in one iteration [m]

    def __init__(self, fingers: Sequence[Finger], mu: float | None) -> None:
        self.fingers = tuple(fingers)
        self.size = fingers[-1].unknowns.stop
        self.control = Control(closing=0.0)
        self.friction = None if mu is None else Friction(mu, self._damped())
        # makes a closing row a force like all others, so that one norm judges them
        self.closing_stiffness = sum(f.kappa * f.area.sum() for f in fingers)
        self._by_force: bool | None = None  # whether the last tangent was that under force control
        self._tangent_set = np.zeros(0, dtype=bool)
        self.begin()

    # -- evaluation ---------------------------------------------------------------------------------------------------

    @abstractmethod
    def _met(self, k: int, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray, Any]:
        """Of a finger at the state ``x`` what `Evaluated` calls points, gap, normal and surface."""

    def evaluate(self, x: FloatArray) -> list[Evaluated]:
        """Contact faces of all fingers at the state ``x``."""
        return [self._face(k, f, x) for k, f in enumerate(self.fingers)]

    def _face(self, k: int, f: Finger, x: FloatArray) -> Evaluated:
        points, gap, normal, surface = self._met(k, x)
        N, lam = f.pad.face_N, f.pressure(x)[f.nodes]
        # points that face nothing are left out, so that a pad over a rim is carried up to the rim
        area, faces = f.faced, (gap < FAR) & (f.faced.ravel() > 0.0)
        load = (area * (lam @ N.T)).reshape(-1, 1) * normal
        weighted = f.nodal((area * gap.reshape(area.shape)) @ N)
        gaps = np.where(f.carries, weighted, FAR * f.area)
        c = Evaluated(points, gap, normal, lam, faces, gaps, f.active(x, gaps), load, surface)
        if self.friction is not None:
            c.traction = self.traction(k, x, c)[0]
            c.load = load + area.reshape(-1, 1) * c.traction
        return c

    def residual(self, x: FloatArray) -> FloatArray:
        """Residual of all rows ``(size,)`` [N]; NaN where an element is inverted, so that the step is refused."""
        refused = np.full(self.size, np.nan)
        if not np.isfinite(x).all():
            return refused
        foam = [f.foam.force(x[f.unknowns]) for f in self.fingers]
        if not all(smallest > 0.0 for _, smallest in foam):
            return refused
        try:
            contacts = self.evaluate(x)
        # a point without a place on a wall: a shorter step will find it
        except ArithmeticError:
            return refused
        R = np.zeros(self.size)
        for f, c, (inner, _) in zip(self.fingers, contacts, foam, strict=True):
            force = -np.einsum("qa,fqi->fia", f.pad.face_N, (c.load @ f.R).reshape(*f.pad.face_area.shape, 3))
            R[f.unknowns] = inner + gather(f.local_dofs, force, f.pad.size)
            # zero where pressure or gap is and the other is not negative
            pressed = f.area * x[f.pressures]
            smaller = pressed - np.maximum(0.0, pressed - c.weighted)
            # vinewtonrsls keeps the pressures at their bounds itself; it needs the gap alone
            R[f.pressures] = f.kappa * (c.weighted if self.complementarity else smaller)
        self._active_set = np.concatenate([c.active for c in contacts])
        self._drive(x, R)
        return R

    def _drive(self, x: FloatArray, R: FloatArray) -> None:
        """Rows of the closing displacements; they hold the forces on the backing plates so far."""
        first, last = self.fingers[0], self.fingers[-1]
        if self.control.force is not None:
            for f in self.fingers:
                R[f.closing_dof] -= self.control.force * f.pad.share
            return
        if last is not first:
            # forces of whole pads, whatever part of each is meshed
            R[last.closing_dof] = R[last.closing_dof] / last.pad.share - R[first.closing_dof] / first.pad.share
        R[first.closing_dof] = self.closing_stiffness * (self.closing(x) - self.control.closing)

    @abstractmethod
    def tangent(self, x: FloatArray) -> None:
        """Fill ``pattern.values`` with the tangent at ``x``."""

    def keep(self, x: FloatArray, first: bool) -> bool:
        """Whether the last tangent may serve once more (see ``fem.petsc.Problem``).

        Not after a change of control or of the active set: that would leave pressures that are not quite zero. With
        friction every accepted state changes the tangent.
        """
        if self._by_force != (self.control.force is not None) or (first and self.friction is not None):
            return False
        return np.array_equal(self._active_set, self._tangent_set)

    def shorten(self, x: FloatArray, step: FloatArray) -> float:
        """Factor that keeps the change of closing displacements and the compression of every element within reason."""
        factor = min(f.foam.shorten(x[f.unknowns], step[f.unknowns], self.longest_closing) for f in self.fingers)
        return factor if self.friction is None else self.friction.shortened(x, step, factor)

    # -- friction that acts back --------------------------------------------------------------------------------------

    @abstractmethod
    def _damped(self) -> Any:
        """Index of the displacements by which steps with friction are judged."""

    def begin(self) -> None:
        """Begin another load path; without friction it does not matter."""
        if self.friction is not None:
            self.friction.accept([self._untouched(f) for f in self.fingers])

    def forget(self) -> None:
        """Be as a new problem, so that not a bit of what follows depends on what was evaluated before."""
        self.begin()

    def accept(self, x: FloatArray) -> None:
        """Note a state that the next one starts from; later friction is measured from its points and tractions."""
        # stick is measured from accepted states, not from iterates: a step that is repeated starts from the same place
        if self.friction is not None:
            contacts = zip(self.fingers, self.evaluate(x), strict=True)
            self.friction.accept([self._anchor(f, x, c) for f, c in contacts])

    def _untouched(self, f: Finger) -> Anchor:
        """What friction is measured from where nothing has touched yet."""
        n = f.pad.face_area.size
        nowhere, none = np.zeros((n, 3)), np.zeros((n, 4))
        return Anchor(nowhere, nowhere, np.zeros(n, dtype=bool), none.astype(np.int32), none)

    def _anchor(self, f: Finger, x: FloatArray, c: Evaluated) -> Anchor:
        """What friction is measured from after the state ``x``."""
        assert c.traction is not None
        return Anchor(c.points, c.traction, bearing(self.point_pressure(f, c)) & c.faces)

    def steepness(self, c: Evaluated) -> FloatArray:
        """Length of the gradient of the gap at the points ``(n,)`` [-]; the force of a contact goes with it."""
        return np.ones(len(c.gap))

    def point_pressure(self, f: Finger, c: Evaluated) -> FloatArray:
        """Nominal pressures of the points ``(n,)`` [Pa], negative ones of quadratic faces cut off."""
        return np.maximum(c.lam @ f.pad.face_N.T, 0.0).ravel() * self.steepness(c)

    def traction(
        self, k: int, x: FloatArray, c: Evaluated, derivatives: bool = False, before: FloatArray | None = None,
        share: float = 1.0,
    ) -> tuple[FloatArray, ...]:  # fmt: skip
        """Traction on the points of one pad ``(n, 3)`` [Pa], and its derivatives.

        They are those by what the point has moved along the object ``(n, 3, 3)`` [Pa/m], by the normal ``(n, 3, 3)``
        [Pa] and by the pressure ``(n, 3)`` [-]. ``before`` and ``share`` as in `stick_or_slip`.
        """
        assert self.friction is not None
        f, anchor, mu = self.fingers[k], self.friction.anchors[k], self.friction.mu
        stick = self.friction.stick * f.kappa
        # a point that was open has stuck nowhere that its motion could be measured from
        sticks = (anchor.closed & c.faces)[:, None]
        d = np.where(sticks, anchor.traction - stick * self._moved(x, c, anchor), 0.0)
        pressure = self.point_pressure(f, c)
        t, *changes = stick_or_slip(self.unit_normal(c), d, mu, pressure, derivatives, before, share)
        if not derivatives:
            return (t,)
        by_d, by_normal, by_pressure = changes
        return t, np.where(sticks[..., None], -stick * by_d, 0.0), by_normal, by_pressure

    def _moved(self, x: FloatArray, c: Evaluated, anchor: Anchor) -> FloatArray:
        """How far the points have moved along the object ``(n, 3)`` since the last accepted state [m]."""
        return c.points - anchor.at

    def unit_normal(self, c: Evaluated) -> FloatArray:
        """Outward unit normals at the points ``(n, 3)``, in the frame of the object."""
        return c.normal / self.steepness(c)[:, None]

    # -- states -------------------------------------------------------------------------------------------------------

    def contact_state(self, x: FloatArray, k: int = 0) -> tuple[FloatArray, FloatArray, ContactPoints]:
        """Of one finger, in its pad's frame: nodal pressures ``(n,)`` [Pa], mean gaps ``(n,)`` [m], quadrature."""
        f, c = self.fingers[k], self.evaluate(x)[k]
        place = f.points(x)
        # a point that faces no wall gets a normal across the approach, so that the rim counts as an edge of the object
        normal = np.where(c.faces[:, None], self.unit_normal(c) @ f.R, [1.0, 0.0, 0.0]).reshape(place.shape)
        pressure = borne(f.pressure(x), c.active)
        # a node may carry load over the rim, but its points beyond it press on nothing
        load = f.faced * (pressure[f.nodes] @ f.pad.face_N.T) * self.steepness(c).reshape(f.faced.shape)
        friction = None if c.traction is None else f.faced[..., None] * (c.traction @ f.R).reshape(place.shape)
        points = ContactPoints(place, normal, max(0.0, -self._lowest_gap(f, x, c)), load, friction)
        return pressure, c.weighted / f.area, points

    def _lowest_gap(self, f: Finger, x: FloatArray, c: Evaluated) -> float:
        return float(c.gap[c.faces].min(initial=FAR))

    def normal_force(self, x: FloatArray) -> float:
        """Normal force on a whole pad that the backing plates must exert at ``x`` [N], mean of the fingers."""
        return float(np.mean([f.foam.normal_force(x[f.unknowns]) for f in self.fingers]))

    def closing(self, x: FloatArray) -> float:
        """Closing displacement of the backing plates [m], mean of the fingers."""
        return float(np.mean([x[f.closing_dof] for f in self.fingers]))

    # -- starts and scales --------------------------------------------------------------------------------------------

    @property
    def rule(self) -> str:
        """How the gaps are collocated, see ``fem.pad.mesh.RULES``."""
        return self.fingers[0].pad.contact

    @property
    def thickness(self) -> float:
        """Of the pads [m]."""
        return self.fingers[0].pad.shape.size[2]

    @property
    def share(self) -> float:
        """Smallest part of a pad that is meshed."""
        return min(f.pad.share for f in self.fingers)

    @property
    def rounding(self) -> float:
        """Norm of the residual that rounding leaves [N]."""
        return sum(f.pad.rounding for f in self.fingers)

    def guess(self, closing: float) -> FloatArray:
        """Unknowns to start from at a closing displacement [m]: pads as beds of springs, the object undeformed."""
        x = np.zeros(self.size)
        for f in self.fingers:
            x[f.unknowns] = f.bed.guess(closing)
        return x

    def force_scale(self, closing: float) -> float:
        """Force that a residual at this closing displacement is judged by [N]."""
        return min(f.bed.force_scale(closing) for f in self.fingers)

    def closing_of_bed(self, force: float) -> float:
        """Closing displacement at which pads that are beds of springs carry a force [m]."""
        return float(np.mean([f.bed.closing(force) for f in self.fingers]))


class SpringBed:
    """Columns of foam of modulus E between plate and object; ``gap`` as in ``fem.contact.press.Press``."""

    def __init__(self, pad: Pad, gap: Gap) -> None:
        self.pad, self.gap = pad, gap

    @cached_property
    def height(self) -> FloatArray:
        """Distance along the approach from the undeformed contact nodes to the object, roughly ``(n,)`` [m]."""
        gap, normal, _ = self.gap(self.pad.nodes[self.pad.contact_nodes])
        # along the approach, not along the normal; 0.2 bounds it where the object turns away from the pad
        return np.maximum(gap, 0.0) / np.maximum(-normal[:, 2], 0.2)

    def force(self, closing: float) -> float:
        """Normal force on the whole pad [N]."""
        pressure = self.pad.modulus_per_thickness * np.maximum(0.0, closing - self.height)
        return float(self.pad.node_area @ pressure) / self.pad.share

    def force_scale(self, closing: float) -> float:
        """Force that a residual at this closing displacement is judged by, never zero [N]."""
        # before the bed touches its force is zero and would be no scale
        one_node = self.pad.modulus_per_thickness * self.pad.node_area.max() * abs(closing)
        return max(self.force(closing), 1e-3 * one_node)

    def closing(self, force: float) -> float:
        """Closing displacement at which the bed carries the force [m]."""
        order = np.argsort(self.height)
        height, area = self.height[order], self.pad.node_area[order]
        # the force is convex, so that of the columns that touch is the largest that the lowest k columns would have
        volume = force * self.pad.share / self.pad.modulus_per_thickness
        return float(((volume + np.cumsum(area * height)) / np.cumsum(area)).min())

    def guess(self, closing: float) -> FloatArray:
        """Vector of unknowns: columns shortened affinely, so that no element starts inverted, and their pressures."""
        pad = self.pad
        # at most 0.6 of the thickness: the start has to be a valid state, not a good one
        shortening = np.clip(closing - self.height, 0.0, 0.6 * pad.shape.size[2])
        u = np.zeros(pad.dofs.shape)
        u[:, 2] = closing
        # foam that hardly changes its volume would start with huge stresses
        # Poisson's ratio above which shortened columns are a worse start than columns that only move
        if pad.material.poisson_ratio <= 0.45:
            i, j = pad.places(pad.nodes[:, :2])  # of the node of the contact face above each: columns are straight
            u[:, 2] -= shortening[i * pad.contact_grid[1] + j] * (1.0 + pad.nodes[:, 2] / pad.shape.size[2])
        x = np.zeros(pad.size)
        x[pad.dofs[pad.dofs >= 0]] = u[pad.dofs >= 0]
        x[pad.closing_dof] = closing
        x[pad.closing_dof + 1 :] = shortening
        return x
