"""Solvers of one candidate and the contacts that they give: each finger by itself, or both on a thin wall.

Either follows the load path and gives the contacts of every force; what comes after does not ask which it was.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np

from softjaw.fem.contact.edge import contact_area, largest_pressure
from softjaw.fem.contact.extract import extract, turned
from softjaw.fem.contact.path import LoadPath, Pressed
from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.shell.grip import Grip
from softjaw.fem.shell.thin_walled import Grasp, WallMesh, grasp, wall_between
from softjaw.fem.shell.wall_problem import WallProblem
from softjaw.friction.patch import ContactPatch
from softjaw.friction.wrench import FrictionLimits
from softjaw.study.case.build import forces_apart, pad_shape
from softjaw.study.case.candidates import turn_of_pose
from softjaw.study.case.contact import ALIKE, Contact
from softjaw.study.case.model import Finger, contact_rules, pad_of, press_of, settings
from softjaw.study.case.wall import thin_body, wall_values
from softjaw.study.flags import Flag
from softjaw.study.quantities import MODELS
from softjaw.study.scene import Scene

EXCESS = 0.05  # of the commanded force: beyond it the force along the contact normal is another one
OVERLAP = 0.1  # of the closing displacement, beyond which the mesh is coarse for the contact
FEW_ELEMENTS, NARROW = 6, 2  # loaded ones in all, and along length or width, below which it is coarse too
BENT = np.radians(120.0)  # between the object's normals at neighbouring loaded faces, beyond which it is coarse too
LOCKING = 0.45  # Poisson's ratio above which trilinear elements are too stiff
HARDLY = 1e-3  # of the largest force: where such a force is not reached, those above begin anew
STARTS = 3  # states of the coarser mesh that a force on the fine one is started from, before it starts from nothing
NO_ERROR = "the error of the mesh is not known, for on the coarser one {reason}"
MESH_HOLE = 0.01  # of a pad's face before a hole of the mesh, beyond which that is flagged
STEEPEST = np.radians(60.0)  # of an approach against the planes across a thin-walled object's axis
UPRIGHT, HALF_TURN = (1.0, 1.0, 1.0), (-1.0, -1.0, 1.0)  # signs of the axes of a pad's frame
State = TypeVar("State")


class PressedContact(Contact):
    """A contact that was solved: one finger at one force, its patch in the pad's frame.

    ``signs`` are those of the axes of the frame that the state was solved in, in the finger's own one.
    """

    def __init__(
        self,
        scene: Scene,
        finger: Finger,
        state: Pressed,
        signs: tuple[float, float, float] = UPRIGHT,
    ) -> None:
        self.finger, self.state, self._signs = finger, state, signs
        self._reduced = scene.friction.used_by_pressing
        self._views: list[Contact] = []  # shared by all copies, so that the first one asked fills it for all
        super().__init__(self._extracted(), scene.friction.mu, finger.pose, whole_face=True)
        self.nodal_instead = state.instead and state.pad.contact == "nodal"

    def _extracted(self, rule: str = "") -> ContactPatch:
        """Patch in the finger's own frame, from the pressures at the points of a rule."""
        patch = extract(self.state.pad, self.state, rule)
        return patch if self._signs == UPRIGHT else turned(self.state.pad, patch, self._signs)

    def of(self, finger: Finger) -> PressedContact:
        """The same contact of another finger, which stands where the object looks the same."""
        # Touched here, because cached properties are copied only when they have been computed.
        _ = self.ellipsoids, self.tau_pure, self.area, self.largest_pressure  # computed once for both
        other = self.at(finger.pose)
        other.finger = finger
        return other

    @cached_property
    def used(self) -> np.ndarray:
        """Friction wrench on the pad ``(f_x, f_y, tau_z)`` while it is pressed, in the contact frame [N, N, N m]."""
        points, pad = self.state.points, self.state.pad
        if points.friction is None:
            return np.zeros(3)
        # in a plane of symmetry the other half's forces across it and torques cancel
        one = np.array([not mirrored for mirrored in pad.symmetry], float)
        friction = points.friction * self._signs
        force = friction.sum(axis=(0, 1)) / pad.share * [*one, 1.0]
        arm = points.position * self._signs - self.frame.origin
        torque = np.cross(arm, friction).sum(axis=(0, 1)) / pad.share
        torque = torque * [one[1], one[0], one.prod()]
        return np.array([*(self.frame.axes[:2] @ force), self.frame.axes[2] @ torque])

    @cached_property
    def limits(self) -> dict[str, FrictionLimits]:
        """As of any contact; in the curved model less what pressing has used, where the scene says so."""
        found = super().limits
        return found | {"ccm": found["ccm"].less(self.used)} if self._reduced else found

    @cached_property
    def area(self) -> float:
        """Area of the contact, with its edge inside the faces [m^2]."""
        return contact_area(self.patch, self.state.pad.shape.patch_faces)

    @cached_property
    def largest_pressure(self) -> float:
        """Largest pressure [Pa], as the mean over a few elements tells it."""
        shape = self.state.pad.shape
        return largest_pressure(self.patch, shape.patch_faces, shape.per_side)

    @property
    def views(self) -> list[Contact]:
        """The contact of the same pressures at Gauss points and at nodes; a finer mesh would make them alike."""
        if not self._views:
            patches = (self._extracted(rule) for rule in ("weighted", "nodal"))
            self._views += [Contact(patch, self.mu, self.pose, whole_face=True) for patch in patches]
            _ = [view.ellipsoids for view in self._views]  # computed once for both fingers, as in `of`
        return [view.at(self.pose) for view in self._views]

    @property
    def force_excess(self) -> float:
        """Force along the contact normal over the one commanded, which is along the approach, less 1."""
        return self.limits["ccm"].F_N / self.state.force - 1.0

    @property
    def e_n_commanded(self) -> list[float]:
        """``max tau_z / (mu F)`` in each of `MODELS`, with the force ``F`` that is commanded [m]."""
        return [self.unit_limits[name].tau_z / self.state.force for name in MODELS]

    @property
    def on_few_elements(self) -> bool:
        """Whether so few elements are loaded that the contact's shape is theirs."""
        return bool(np.count_nonzero(self.loaded) < FEW_ELEMENTS * self.state.pad.shape.per_side**2)

    @property
    def coarse(self) -> bool:
        """Whether the mesh is coarse for this contact, or its elements are too stiff for the foam."""
        shape, law = self.state.pad.shape, self.state.pad.material
        (n, m, _), k = shape.elements, shape.per_side
        loaded = self.loaded.reshape(n, k, m, k)
        widths = [np.count_nonzero(loaded.any(axes)) for axes in ((1, 2, 3), (0, 1, 3))]
        # a single line of nodes loads the elements on both sides of it
        shared = self.state.pad.contact == "nodal"
        few = self.on_few_elements or min(widths) - shared < NARROW
        normals = self.patch.normal.reshape(n * k, m * k, 3)
        # a blade thinner than an element is met on its flanks alone, or not on them, as the faces happen to lie
        pairs = zip(_neighbours(normals), _neighbours(loaded.reshape(n * k, m * k)), strict=True)
        bent = any((np.einsum("ijc,ijc->ij", a, b)[p & q] < np.cos(BENT)).any() for (a, b), (p, q) in pairs)
        overlaps = self.state.checks.penetration_depth > OVERLAP * self.state.closing
        # Trilinear elements alone lock when the foam is nearly incompressible.
        return bool(overlaps or few or bent or (shape.element == "hex8" and law.poisson_ratio > LOCKING))

    @property
    def free_face(self) -> float:
        """How far the unloaded part of the contact face has come beyond first touch [m]."""
        return float(self.patch.centroid[self.patch.pressure == 0, 2].max(initial=0.0))


def _neighbours(grid: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Values on a grid of faces beside those of their neighbours, along the one side and the other."""
    return [(grid[:-1], grid[1:]), (grid[:, :-1], grid[:, 1:])]


def state_flags(contacts: Sequence[PressedContact]) -> int:
    """Flags of the solved states of both fingers."""
    one, two = contacts
    between_faces = float((two.finger.pose.origin - one.finger.pose.origin) @ one.finger.pose.rotation[:, 2])
    found = Flag.COLLISION * (one.free_face + two.free_face > between_faces * (1.0 - ALIKE))
    found |= Flag.UNSTABLE * (min(c.state.checks.ellipticity for c in contacts) <= 0)
    found |= Flag.JUMPED * any(c.state.path_dependent for c in contacts)
    found |= Flag.OBLIQUE * (max(abs(c.force_excess) for c in contacts) > EXCESS - ALIKE)
    found |= Flag.MESH_HOLE * (max(c.finger.hole_share for c in contacts) > MESH_HOLE)
    for c in contacts:
        found |= Flag.NODAL * c.nodal_instead | Flag.COARSE * c.coarse
    return found


@dataclass(frozen=True)
class Solved:
    """Contacts of one force: for every finger that on each mesh, the finest first.

    ``spent`` are the states whose work was done for it; ``note`` says why a coarser mesh has no state there, if so.
    """

    contacts: list[list[PressedContact]]
    spent: list[Pressed]
    note: str = ""


def solver(
    scene: Scene, fingers: list[Finger], poses: Sequence[Any], coarse: Solver | None = None, *, coarser: bool = False
) -> Solver:
    """Solver for both fingers at first touch at the levels that the scene names; an ``auto`` is the cheapest one.

    Parameters
    ----------
    coarse : Solver, optional
        Of the same candidate on the coarser mesh.
    coarser : bool
        Whether this is that one.
    """
    if getattr(scene.object, "wall", None) is not None:
        refuse_along_axis(fingers)
        if scene.effects.object.endswith("shell"):
            return OnWall(scene, fingers, coarse, coarser)
    return OnRigid(scene, fingers, coarse, coarser, poses)


def followed(
    load_path: Callable[[Sequence[float]], Iterator[State]], forces: Sequence[float]
) -> Iterator[State | ConvergenceError | CheckError]:
    """For every force what a load path has there or why it has nothing, up to the one at which it ends."""
    path, lowest = load_path(forces), True
    for k, force in enumerate(forces):
        try:
            yield next(path)
            lowest = False
        except (ConvergenceError, CheckError) as error:
            yield error
            # hardly a touch, which tells nothing of the forces above
            if not lowest or not force < HARDLY * max(forces[k + 1 :], default=0.0):
                return
            path = load_path(forces[k + 1 :])


class Solver(ABC):
    """Follows the load path of one candidate, or solves each force by itself from the states of a coarser mesh.

    Parameters
    ----------
    scene : Scene
    fingers : list of Finger
    coarse : Solver, optional
        Of the same candidate on the coarser mesh, which tells the error of the mesh.

    Attributes
    ----------
    apart : bool
        Whether its forces are independent of each other.
    paths : list
        Load paths of what is pressed by itself.
    fingers_solved, planes : int
        Fingers that are solved, and planes of symmetry of each.
    """

    paths: list[Any]
    fingers_solved: int
    planes: int

    def __init__(self, scene: Scene, fingers: list[Finger], coarse: Solver | None) -> None:
        self.scene, self.fingers, self.coarse = scene, fingers, coarse
        self.apart = coarse is not None and forces_apart(scene)
        self._followed: dict[tuple[float, ...], list[_Followed]] = {}
        self._seen: dict[tuple[tuple[float, ...], int], list[PressedContact]] = {}

    def load_path(self, forces: Sequence[float]) -> Iterator[Solved]:
        """Contacts at ascending forces; ends with ``ConvergenceError`` or ``CheckError`` where there are none."""
        for _, outcome in self.levels(forces, range(len(forces))):
            if not isinstance(outcome, Solved):
                raise outcome
            yield outcome

    def levels(
        self, forces: Sequence[float], wanted: Iterable[int]
    ) -> Iterator[tuple[int, Solved | ConvergenceError | CheckError]]:
        """Contacts or failure at the wanted forces, rising.

        Not a bit of one depends on which others are wanted.
        """
        for k in wanted:
            try:
                yield k, self.level(forces, k)
            except (ConvergenceError, CheckError) as error:
                yield k, error

    def level(self, forces: Sequence[float], k: int) -> Solved:
        """Contacts at the ``k``-th force.

        From the coarser mesh's states where the forces are apart, else on the load path through the forces below it.

        Raises
        ------
        ConvergenceError, CheckError
            If there is no acceptable state.
        """
        if self.coarse is None:
            return self._solved(self._states(forces, k))
        paths = self.coarse.followed(forces)
        if self.apart:
            fine = [own.at(forces[k], path.starts(k)) for own, path in zip(self.paths, paths, strict=True)]
        else:
            fine = self._states(forces, k)
        # an error can be told only where all have a coarser state
        if lacking := [path.ended for path in paths if path.state(k) is None]:
            return replace(self._solved(fine), note=NO_ERROR.format(reason=lacking[0]))
        return self._solved(fine, [path.state(k) for path in paths], self.coarse.seen(forces, k))

    def followed(self, forces: Sequence[float]) -> list[_Followed]:
        """Load paths through these forces, of which no state is solved twice."""
        key = tuple(forces)
        if key not in self._followed:
            self._followed[key] = [_Followed(path, forces) for path in self.paths]
        return self._followed[key]

    def seen(self, forces: Sequence[float], k: int) -> list[PressedContact] | None:
        """Contacts of both fingers at the ``k``-th force of the load path; None where it has no state."""
        states = [path.state(k) for path in self.followed(forces)]
        if any(state is None for state in states):
            return None
        key = tuple(forces), k
        if key not in self._seen:  # frames and limits take longer than to keep them
            self._seen[key] = self.contacts(states)
        return self._seen[key]

    def _states(self, forces: Sequence[float], k: int) -> list[Any]:
        """States at the ``k``-th force of the load path."""
        found = [(path.state(k), path) for path in self.followed(forces)]
        for state, path in found:
            if state is None:
                raise path.error(k)
        return [state for state, _ in found]

    def _solved(
        self, fine: Sequence[Any], coarse: Sequence[Any] = (), seen: list[PressedContact] | None = None
    ) -> Solved:
        """Contacts of both fingers on each mesh from the states of what is pressed by itself; ``seen``: coarse ones."""
        each = [self.contacts(fine), *([] if seen is None else [seen])]
        return Solved([list(c) for c in zip(*each, strict=True)], [*fine, *coarse])

    @abstractmethod
    def contacts(self, states: Sequence[Any]) -> list[PressedContact]:
        """Contacts of both fingers from the states of what is pressed by itself."""

    def wall_values(self, solved: Solved, mesh: int = 0) -> dict[str, Any]:
        """What the wall bears at one force on a mesh, keyed as in ``study.quantities``; a rigid object has none."""
        return {}

    def destroy(self) -> None:
        """Give the factors' memory back."""
        for path in self.paths:
            path.destroy()
        if self.coarse is not None:
            self.coarse.destroy()


class OnRigid(Solver):
    """Fingers on a rigid object do not feel each other."""

    def __init__(
        self, scene: Scene, fingers: list[Finger], coarse: Solver | None, coarser: bool, poses: Sequence[Any]
    ) -> None:
        super().__init__(scene, fingers, coarse)
        one, other = poses
        self.shared = turn_of_pose(one, other, scene.object.axis_symmetry) is not None
        solved = fingers[:1] if self.shared else fingers
        self.paths = [press_of(scene, f, coarser) for f in solved]
        self.fingers_solved, self.planes = 2, min(sum(own.pad.symmetry) for own in self.paths)

    def contacts(self, states: Sequence[Any]) -> list[PressedContact]:
        """See `Solver`."""
        # Of two fingers that are images only the first has states, so the lengths differ.
        found = [PressedContact(self.scene, f, state) for f, state in zip(self.fingers, states, strict=False)]
        # an image finger has its partner's states; only its place differs
        return [*found, found[0].of(self.fingers[1])] if self.shared else found


class _Followed:
    """States on a load path, from the lowest force upward, as far as they are asked for."""

    def __init__(self, press: LoadPath[Any], forces: Sequence[float]) -> None:
        self._path, self._states = followed(press.load_path, forces), list[Any]()
        self._errors: dict[int, Exception] = {}
        self.ended = ""  # why there are no more

    def state(self, k: int) -> Pressed | None:
        """State at the ``k``-th force; None where the path ends before."""
        while len(self._states) <= k and (found := next(self._path, None)) is not None:
            ends = isinstance(found, Exception)
            if isinstance(found, Exception):
                self._errors[len(self._states)] = found
            self._states.append(None if ends else found)
            self.ended = str(found) if ends else self.ended
        return self._states[k] if k < len(self._states) else None

    def error(self, k: int) -> Exception:
        """Why there is no state at the ``k``-th force."""
        return self._errors[max(i for i in self._errors if i <= k)]

    def starts(self, k: int) -> list[Any]:
        """What the fine mesh starts from at the ``k``-th force: the states there and below, the nearest first."""
        return [state for i in range(k, -1, -1) if (state := self.state(i)) is not None][:STARTS]


class OnWall(Solver):
    """Fingers on a thin wall press against each other through it."""

    def __init__(self, scene: Scene, fingers: list[Finger], coarse: Solver | None, coarser: bool) -> None:
        super().__init__(scene, fingers, coarse)
        self.held = grasp_of(scene, fingers, coarser)
        grip = _grip(scene, fingers, self.held, coarser)
        self.paths, self.shell = [grip], grip.problem.model.shell
        self.fingers_solved, self.planes = len(self.held.poses), sum(self.held.mirrors)

    def contacts(self, states: Sequence[Any]) -> list[PressedContact]:
        """See `Solver`."""
        [state], held = states, self.held
        found = [
            PressedContact(self.scene, f, own, HALF_TURN if flipped else UPRIGHT)
            for f, own, flipped in zip(self.fingers, state.fingers, held.flipped, strict=False)
        ]
        if len(state.fingers) == 1:
            # a plane of symmetry lies between the fingers, in which y of the pad changes its sign
            signs = (-1.0, 1.0, 1.0) if held.flipped[0] else (1.0, -1.0, 1.0)
            found.append(PressedContact(self.scene, self.fingers[1], state.fingers[0], signs))
        return found

    def wall_values(self, solved: Solved, mesh: int = 0) -> dict[str, Any]:
        """See `Solver`."""
        own = self.coarse if mesh else self
        assert isinstance(own, OnWall)
        return wall_values(self.scene, own.held, solved.contacts[0][mesh].state, own.shell)


def refuse_along_axis(fingers: Sequence[Finger]) -> None:
    """Lids, bottoms and rims of a thin-walled object are not pressed."""
    steepest = max(abs(float(f.pose.rotation[2, 2])) for f in fingers)
    if steepest > np.sin(STEEPEST):
        raise CheckError(
            f"a finger approaches a thin-walled object at {np.degrees(np.arcsin(min(steepest, 1.0))):.0f} degrees to "
            f"the planes across its axis; its wall is simulated up to {np.degrees(STEEPEST):.0f} degrees: turn the "
            "approach, or remove wall_mm"
        )


def grasp_of(scene: Scene, fingers: list[Finger], coarser: bool) -> Grasp:
    """Grasp frame and the planes of symmetry that meshes and scene allow."""
    even = pad_shape(scene.gripper, coarser).elements[1] % 2 == 0
    wanted = scene.effects.model_size
    body, poses = thin_body(scene.object), (fingers[0].pose, fingers[1].pose)
    held = grasp(body, poses, (wanted != "full", wanted != "full" and even))
    # One plane was asked for where both exist: that between the fingers is given up.
    if wanted == "half" and all(held.mirrors):
        held = grasp(body, poses, (False, True))
    # a coarser mesh for error estimates takes what it can use
    need = {"half": 1, "quarter": 2}.get(wanted, 0) if not coarser else 0
    if sum(held.mirrors) < need:
        raise ValueError(
            f"effects.model_size = '{wanted}' needs {need} plane(s) of symmetry, but object, fingers and mesh share "
            f"{sum(held.mirrors)} here; use 'auto'"
        )
    return held


def _grip(scene: Scene, fingers: list[Finger], held: Grasp, coarser: bool) -> Grip:
    """Both fingers on the wall."""
    size = WallMesh(*scene.accuracy.wall_sizes)
    mesh = size.halved() if coarser else size
    body, linear = thin_body(scene.object), scene.effects.object == "linear_shell"
    coupled = scene.effects.friction_pressure_coupling == "tangential"
    wall, faces = wall_between(body, held, scene.gripper.pad_size, mesh, linear=linear)

    gaps = [_gap(f, turned) for f, turned in zip(fingers, held.flipped, strict=False)]

    def problem(rule: str) -> WallProblem:
        pad = pad_of(scene, held.pad_symmetry, rule, coarser)
        pads = [(pad, *where) for where in zip(gaps, held.poses, faces, strict=True)]
        return WallProblem(wall, pads, scene.friction.mu if coupled else None)

    problems = [partial(problem, rule) for rule in contact_rules(scene, walled=True)]
    return Grip(problems, dict(scene.petsc), settings(scene))


def _gap(finger: Finger, turned: bool):
    """Gap function in the frame of the pad as it is solved."""
    if not turned:
        return finger.gap
    # Half a turn about the approach flips x and y, and with them normals and mixed derivatives.
    sign = [-1.0, -1.0, 1.0]

    def gap(x):
        g, normal, hessian = finger.gap(x * sign)
        return g, normal * sign, hessian * [[s * t for t in sign] for s in sign]

    return gap
