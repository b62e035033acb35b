"""Both fingers of a candidate pressed on one mesh, each by itself or both on a wall, and the contacts they give."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property, partial
from typing import Any

import numpy as np

from softjaw.fem.contact.edge import contact_area, largest_pressure
from softjaw.fem.contact.extract import extract, turned
from softjaw.fem.contact.path import Pressed
from softjaw.fem.errors import CheckError
from softjaw.fem.shell.grip import Grip
from softjaw.fem.shell.thin_walled import Grasp, grasp, wall_between
from softjaw.fem.shell.wall_mesh import MeshSize
from softjaw.fem.shell.wall_problem import WallProblem
from softjaw.friction.patch import ContactPatch, cross
from softjaw.friction.wrench import FrictionLimits
from softjaw.study.case.build import MAX_SLOPE, pad_shape
from softjaw.study.case.contact import Contact
from softjaw.study.case.geometry import Finger
from softjaw.study.case.model import contact_rules, image_signs, pad_of, press_of, require_planes
from softjaw.study.case.poses import turn_of_pose
from softjaw.study.case.result import UNDECIDED
from softjaw.study.case.wall import thin_body, wall_values
from softjaw.study.flags import Flag
from softjaw.study.scene import Scene

OBLIQUE = 1.0 / 1.05  # cosine below which the force along the normal is 5 % from the commanded one
SHARP = np.radians(20.0)  # by which normals of neighbouring faces turn more than usual, from which it is an edge
BENT = np.radians(120.0)  # between the object's normals at neighbouring loaded faces, beyond which it is coarse too
OVERLAPS = 0.1  # share of the closing displacement, beyond which the mesh is coarse for the contact
MESH_HOLE = 0.01  # of a pad's face before a hole of the mesh, beyond which that is flagged
UPRIGHT, HALF_TURN = (1.0, 1.0, 1.0), (-1.0, -1.0, 1.0)  # signs of the axes of a pad's frame


class PressedContact(Contact):
    """A contact that was solved: one finger at one force, its patch in the pad's frame.

    ``signs`` are those of the axes of the frame that the state was solved in, in the finger's own one.
    """

    def __init__(
        self, scene: Scene, finger: Finger, state: Pressed, signs: tuple[float, float, float] = UPRIGHT
    ) -> None:
        self.state, self._signs, self.hole_share = state, signs, finger.hole_share
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
        other.hole_share = finger.hole_share
        return other

    def drive(self, pressure: np.ndarray) -> np.ndarray:
        """As of any contact; where friction acts back it bears a part of it, which the pressure does not tell."""
        return self.state.force * self.pose.rotation[:, 2]

    @cached_property
    def used(self) -> np.ndarray:
        """Friction wrench on the pad ``(f_x, f_y, tau_z)`` while it is pressed, in the contact frame [N, N, N m]."""
        points, pad = self.state.points, self.state.pad
        if points.friction is None:
            return np.zeros(3)
        # in a plane of symmetry the other half's forces across it and torques cancel
        keeps = np.array([not mirrored for mirrored in pad.symmetry], float)
        friction = points.friction * self._signs
        force = friction.sum(axis=(0, 1)) / pad.share * [*keeps, 1.0]
        torque = cross(points.position * self._signs - self.frame.origin, friction).sum(axis=(0, 1)) / pad.share
        torque = torque * [keeps[1], keeps[0], keeps.prod()]
        return np.array([*(self.frame.axes[:2] @ force), self.frame.axes[2] @ torque])

    @cached_property
    def limits(self) -> dict[str, FrictionLimits]:
        """As of any contact; in the curved model less what pressing has used, where the scene says so."""
        limits = super().limits
        return limits | {"ccm": limits["ccm"].less(self.used)} if self._reduced else limits

    @cached_property
    def area(self) -> float:
        """Area of the contact, with its edge inside the faces [m^2]."""
        shape = self.state.pad.shape
        return contact_area(self.patch, shape.patch_faces, shape.size[2])

    @cached_property
    def largest_pressure(self) -> float:
        """Largest pressure [Pa], as the mean over a few elements tells it; no less than that over the contact."""
        shape = self.state.pad.shape
        fitted = largest_pressure(self.patch, shape.patch_faces, shape.per_side)
        return max(fitted, float(self.patch.load.sum()) / self.area)

    @property
    def views(self) -> list[Contact]:
        """The contact of the same pressures at Gauss points and at nodes; a finer mesh would make them alike."""
        if not self._views:
            patches = (self._extracted(rule) for rule in ("weighted", "nodal"))
            self._views += [Contact(patch, self.mu, self.pose, whole_face=True) for patch in patches]
            _ = [view.ellipsoids for view in self._views]  # computed once for both fingers, as in `of`
        return [view.at(self.pose) for view in self._views]

    @property
    def on_few_elements(self) -> bool:
        """Whether so few elements are loaded that the contact's shape is theirs."""
        # with fewer loaded elements the mesh is coarse too
        return bool(np.count_nonzero(self.loaded) < 6 * self.state.pad.shape.per_side**2)

    @property
    def elements(self) -> float:
        """Elements that bear, at least 1; those of two faces a side, as a triquadratic one tells more."""
        return max(np.count_nonzero(self.loaded) / 4.0, 1.0)

    @property
    def across(self) -> float:
        """Elements that bear across the longest extent of the contact, at least 1; two faces make a side."""
        loaded = self.loaded.reshape(self.state.pad.shape.patch_faces)
        longest = max(np.count_nonzero(loaded.any(axis=axis)) for axis in (0, 1))
        return max(np.count_nonzero(loaded) / (2.0 * longest), 1.0)

    @property
    def lines(self) -> float:
        """Elements across the contact, at its narrowest, that share the load; some bear little."""
        load = self.patch.load.reshape(self.state.pad.shape.patch_faces)
        return min(float(sums.sum() ** 2 / (sums**2).sum()) for sums in (load.sum(axis=0), load.sum(axis=1))) / 2.0

    @property
    def on_edges(self) -> float:
        """Share of the load on elements in or beside which the object has an edge; round ones count in part."""
        shape = self.state.pad.shape
        (n, m), k = shape.patch_faces, shape.per_side
        loaded, edges = self.loaded.reshape(n, m), np.zeros((n, m))
        sides = (_neighbours(each) for each in (self.patch.normal.reshape(n, m, 3), loaded, edges))
        for (a, b), (first, second), pair in zip(*sides, strict=True):
            turns, inside = np.arccos(np.clip(np.einsum("ijc,ijc->ij", a, b), -1.0, 1.0)), first & second
            usual = min(2.0 * np.median(turns[inside]), SHARP) if inside.any() else 0.0
            sharp = np.where(first | second, np.clip((turns - usual) / SHARP, 0.0, 1.0), 0.0)
            for faces in pair:  # of the edge, on both of its sides
                np.maximum(faces, sharp, out=faces)
        share = np.where(loaded, edges, 0.0).reshape(n // k, k, m // k, k).max(axis=(1, 3))
        load = self.patch.load.reshape(n // k, k, m // k, k).sum(axis=(1, 3))
        return float((share * load).sum() / load.sum())

    @property
    def overlap(self) -> float:
        """How far the pad is in the object at most, over the closing displacement."""
        return self.state.checks.penetration_depth / self.state.closing

    @property
    def coarse(self) -> bool:
        """Whether the mesh is coarse for this contact, or its elements are too stiff for the foam."""
        shape, law = self.state.pad.shape, self.state.pad.material
        (n, m, _), k = shape.elements, shape.per_side
        loaded = self.loaded.reshape(n, k, m, k)
        widths = [np.count_nonzero(loaded.any(axes)) for axes in ((1, 2, 3), (0, 1, 3))]
        # a single line of nodes loads the elements on both sides of it
        few = self.on_few_elements or min(widths) - (self.state.pad.contact == "nodal") < 2
        normals = self.patch.normal.reshape(n * k, m * k, 3)
        # a blade thinner than an element is met on its flanks alone, or not on them, as the faces happen to lie
        pairs = zip(_neighbours(normals), _neighbours(loaded.reshape(n * k, m * k)), strict=True)
        bent = any((np.einsum("ijc,ijc->ij", a, b)[p & q] < np.cos(BENT)).any() for (a, b), (p, q) in pairs)
        # Trilinear elements alone lock when the foam is nearly incompressible.
        # Poisson's ratio above which trilinear elements are too stiff
        return bool(self.overlap > OVERLAPS or few or bent or (shape.element == "hex8" and law.poisson_ratio > 0.45))

    @property
    def free_face(self) -> float:
        """How far the unloaded part of the contact face has come beyond first touch [m]."""
        return float(self.patch.centroid[self.patch.pressure == 0, 2].max(initial=0.0))


def _neighbours(grid: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Values on a grid of faces beside those of their neighbours, along the one side and the other."""
    return [(grid[:-1], grid[1:]), (grid[:, :-1], grid[:, 1:])]


def state_flags(contacts: Sequence[PressedContact]) -> int:
    """Flags of the solved states of both fingers."""
    first, second = contacts
    between_faces = float((second.pose.origin - first.pose.origin) @ first.pose.rotation[:, 2])
    flags = Flag.COLLISION * (first.free_face + second.free_face > between_faces * (1.0 - UNDECIDED))
    flags |= Flag.UNSTABLE * (min(c.state.checks.ellipticity for c in contacts) <= 0)
    flags |= Flag.JUMPED * any(c.state.path_dependent for c in contacts)
    leaning = min(float(c.frame.axes[2, 2]) for c in contacts)  # cosine between normal and approach
    flags |= Flag.OBLIQUE * (leaning < OBLIQUE + UNDECIDED)
    flags |= Flag.MESH_HOLE * (max(c.hole_share for c in contacts) > MESH_HOLE)
    for c in contacts:
        flags |= Flag.NODAL * c.nodal_instead | Flag.COARSE * c.coarse
    return flags


class OnRigid:
    """Fingers on a rigid object, which do not feel each other.

    ``parts``: load paths of what is pressed by itself: of two fingers that are images of each other the first alone.
    ``fingers_solved, planes``: fingers that are solved, and planes of symmetry of each.
    """

    def __init__(
        self, scene: Scene, fingers: Sequence[Finger], poses: Sequence[Any], coarser: bool, stride: int = 1
    ) -> None:
        self.scene, self.fingers = scene, fingers
        first, second = poses
        alike = turn_of_pose(first, second, scene.object.axis_symmetry) is not None
        self.image = (1, 1) if alike else image_signs(fingers[0], fingers[1], scene.gripper.pad_size)
        self.parts = [press_of(scene, finger, coarser, stride) for finger in (fingers[:1] if self.image else fingers)]
        self.fingers_solved, self.planes = 2, min(sum(part.pad.symmetry) for part in self.parts)

    def contacts(self, states: Sequence[Any]) -> list[PressedContact]:
        """Contacts of both fingers from the states of the parts."""
        # Of two fingers that are images only the first has a state, so the lengths differ.
        contacts = [PressedContact(self.scene, f, state) for f, state in zip(self.fingers, states, strict=False)]
        if self.image == (1, 1):
            contacts.append(contacts[0].of(self.fingers[1]))
        elif self.image:
            i, j = self.image
            contacts.append(PressedContact(self.scene, self.fingers[1], states[0], (float(i), float(j), 1.0)))
        return contacts

    def wall_values(self, contacts: Sequence[PressedContact]) -> dict[str, Any]:
        """What the wall bears, keyed as in ``study.quantities``; a rigid object has none."""
        return {}


class OnWall:
    """Fingers on a thin wall, which press against each other through it; one part, attributes as of `OnRigid`."""

    def __init__(self, scene: Scene, fingers: Sequence[Finger], coarser: bool, stride: int = 1) -> None:
        self.scene, self.fingers = scene, fingers
        self.grasp = grasp_of(scene, fingers, coarser)
        grip = _grip(scene, fingers, self.grasp, coarser, stride)
        self.parts, self.shell = [grip], grip.problem.model.shell
        self.fingers_solved, self.planes = len(self.grasp.poses), sum(self.grasp.mirrors)

    def contacts(self, states: Sequence[Any]) -> list[PressedContact]:
        """See `OnRigid`."""
        [state], flipped = states, self.grasp.flipped
        contacts = [
            PressedContact(self.scene, finger, pressed, HALF_TURN if turned else UPRIGHT)
            for finger, pressed, turned in zip(self.fingers, state.fingers, flipped, strict=False)
        ]
        if len(state.fingers) == 1:
            # a plane of symmetry lies between the fingers, in which y of the pad changes its sign
            signs = (-1.0, 1.0, 1.0) if flipped[0] else (1.0, -1.0, 1.0)
            contacts.append(PressedContact(self.scene, self.fingers[1], state.fingers[0], signs))
        return contacts

    def wall_values(self, contacts: Sequence[PressedContact]) -> dict[str, Any]:
        """See `OnRigid`."""
        return wall_values(self.grasp, contacts, self.shell)


def pressing(
    scene: Scene, fingers: Sequence[Finger], poses: Sequence[Any], coarser: bool = False, stride: int = 1
) -> OnRigid | OnWall:
    """Both fingers at first touch, pressed at the levels that the scene names; an ``auto`` is the cheapest one.

    ``coarser`` halves the elements of every direction; ``stride`` is that of a load path with friction acting back.
    """
    if scene.effects.object.endswith("shell"):
        return OnWall(scene, fingers, coarser, stride)
    return OnRigid(scene, fingers, poses, coarser, stride)


def refuse_along_axis(fingers: Sequence[Finger]) -> None:
    """Lids, bottoms and rims of a thin-walled object are not pressed."""
    steepest = max(abs(float(f.pose.rotation[2, 2])) for f in fingers)
    if steepest > np.sin(MAX_SLOPE):
        raise CheckError(
            f"a finger approaches a thin-walled object {np.degrees(np.arcsin(min(steepest, 1.0))):.0f} degrees off the "
            f"planes across its axis, at most {np.degrees(MAX_SLOPE):.0f} expected: turn it, or remove wall_mm"
        )


def grasp_of(scene: Scene, fingers: Sequence[Finger], coarser: bool = False) -> Grasp:
    """Grasp frame and the planes of symmetry that meshes and scene allow."""
    even = pad_shape(scene.gripper, coarser).elements[1] % 2 == 0
    wanted = scene.effects.model_size
    body, poses = thin_body(scene.object), (fingers[0].pose, fingers[1].pose)
    grasp_frame = grasp(body, poses, (wanted != "full", wanted != "full" and even))
    # One plane was asked for where both exist: that between the fingers is given up.
    if wanted == "half" and all(grasp_frame.mirrors):
        grasp_frame = grasp(body, poses, (False, True))
    if not coarser:
        require_planes(wanted, sum(grasp_frame.mirrors))
    return grasp_frame


def _grip(scene: Scene, fingers: Sequence[Finger], grasp_frame: Grasp, coarser: bool, stride: int) -> Grip:
    """Both fingers on the wall."""
    size = MeshSize(*scene.accuracy.wall_sizes)
    mesh = size.halved() if coarser else size
    body, linear = thin_body(scene.object), scene.effects.object == "linear_shell"
    coupled = scene.effects.friction_pressure_coupling == "tangential"
    wall, faces = wall_between(body, grasp_frame, scene.gripper.pad_size, mesh, linear=linear)

    sides = zip(fingers, grasp_frame.flipped, strict=False)
    gaps = [(finger.half_turned if flipped else finger).gap for finger, flipped in sides]

    def problem(rule: str) -> WallProblem:
        pad = pad_of(scene, grasp_frame.pad_symmetry, rule, coarser)
        pads = [(pad, *where) for where in zip(gaps, grasp_frame.poses, faces, strict=True)]
        return WallProblem(wall, pads, scene.friction.mu if coupled else None)

    problems = [partial(problem, rule) for rule in contact_rules(scene, walled=True)]
    return Grip(problems, dict(scene.petsc), stride)
