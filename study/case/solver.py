"""One solver of a candidate: the states of all forces, meshes and levels of the effects that somebody asks it for.

What is asked for is a solution at a force, on a mesh, at levels of the effects. How it is started is known here and
nowhere else: on the coarse mesh the load path leads through all forces of the scene, on the scene's mesh each force
starts from the coarse states at it and below, on a finer one from the state on the mesh before. So forces do not depend
on each other, or on who asks first. A state, or the failure in its place, is solved once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, repeat
from typing import Any, NamedTuple, TypeVar

from softjaw.fem.errors import CheckError, ConvergenceError
from softjaw.fem.objects.gap import Pose
from softjaw.fem.petsc import Seconds
from softjaw.study.case.build import build_object, forces_apart, has_wall, pad_elements
from softjaw.study.case.contact import Contact
from softjaw.study.case.errors import Unseen, grasp_values, mesh_errors
from softjaw.study.case.evaluate import EvaluationSettings, settings_of
from softjaw.study.case.geometry import Finger, approach
from softjaw.study.case.pressing import OnRigid, OnWall, PressedContact, pressing, refuse_along_axis
from softjaw.study.case.result import surely_below
from softjaw.study.scene import Scene
from softjaw.study.scene.sections import COARSE, FINE, FINEST, MOST_ELEMENTS

LONG_STEPS = COARSE - 1  # the coarse mesh, with a load path of half as many steps
NEGLIGIBLE_FORCE = 1e-3  # of the largest one; below it a failed load step says nothing of the forces above
# Of what longer steps change, that the steps of the load path leave: to steps of a quarter it is a third in the mean.
OF_LONG_STEPS = 0.5
MOST_STARTS = 3  # coarse states that a force on the scene's mesh is started from, before it starts from nothing
NO_ERROR = "the error of the mesh is not known, for on the coarser one {reason}"
PART_OF_ERROR = "what load steps and rounded edges leave is not known, for on the coarse mesh {reason}"
NOT_REFINED = "on a finer mesh, which accuracy.target asks for, it was not solved ({reason})"
Failure = ConvergenceError | CheckError
State = TypeVar("State")


class Levels(NamedTuple):
    """Levels of the effects that a solver is made for, by their names in a scene."""

    sheet: str
    object: str
    friction_pressure_coupling: str


@dataclass(frozen=True, eq=False)
class Solution:
    """Both fingers in equilibrium at one force on one mesh.

    ``fingers``: what was pressed. ``contacts``: of both fingers.
    """

    fingers: OnRigid | OnWall
    contacts: Sequence[PressedContact]

    @cached_property
    def views(self) -> list[tuple[Contact, ...]]:
        """Contacts of the same pressures at Gauss points, and at nodes."""
        return list(zip(*(c.views for c in self.contacts), strict=True))


class Solved(NamedTuple):
    """Solutions of one case on all its meshes, the finest first, and a note on meshes that have none.

    The ``pairs`` of solutions on the coarse mesh differ by the steps of the load path or by an effect, with the share
    of it that is left; the ``edges`` by how far the object's are rounded: as on the scene's mesh, and twice as far.
    """

    meshes: Sequence[Solution]
    note: str = ""
    pairs: Sequence[tuple[Solution, Solution, float]] = ()
    edges: tuple[Solution, Solution] | None = None

    @property
    def fine(self) -> Solution:
        """That on the finest mesh, which is the result."""
        return self.meshes[0]

    @property
    def coarse(self) -> Solution | None:
        """That on the next coarser mesh, which tells the error."""
        return self.meshes[1] if len(self.meshes) > 1 else None

    def errors(
        self, values: Mapping[str, Any], other: Mapping[str, Any], settings: EvaluationSettings, left_out: float = 0.0,
        closes_less: float = 0.0,
    ) -> dict[str, float]:  # fmt: skip
        """Errors of the values of a case that has a coarser mesh; see `mesh_errors`."""
        fine, coarse = self.fine.contacts, self.meshes[1]
        pairs = list(self.pairs)
        if self.edges:
            # they are rounded over a part of an element, and what that does falls with it
            sizes = [mesh.contacts[0].state.pad.shape.elements[0] for mesh in (self.meshes[-2], self.fine)]
            pairs.append((*self.edges, sizes[0] / sizes[1]))
        unseen = Unseen.of(fine, any(contact.coarse for contact in fine))
        shares = left_out, closes_less
        return mesh_errors(fine, coarse.contacts, values, other, settings, coarse.views, pairs, unseen, *shares)


def followed(
    load_path: Callable[[Sequence[float]], Iterator[State]], forces: Sequence[float]
) -> Iterator[State | Failure]:
    """What a load path has at every force; where it ends, the same failure for all forces from there on."""
    states, started = load_path(forces), False
    for k, force in enumerate(forces):
        try:
            yield next(states)
            started = True
        except (ConvergenceError, CheckError) as failure:
            # A force this small can fail before contact is established; the larger ones are still worth trying.
            if started or not force < NEGLIGIBLE_FORCE * max(forces[k + 1 :], default=0.0):
                yield from repeat(failure, len(forces) - k)
                return
            yield failure
            states = load_path(forces[k + 1 :])


class CandidateSolver:
    """Solutions of one candidate.

    ``scene``: its levels of effects do not count: they are asked for. ``poses``: of the pads before they touch.
    ``rounder``: solver of the candidate where edges of a mesh are rounded twice as far. ``finest``: finest mesh of each
    force that ``accuracy.target`` may ask for, or which is solved whatever the error, ``together`` with other samples.
    """

    def __init__(self, scene: Scene, poses: Sequence[Pose], rounder: CandidateSolver | None = None) -> None:
        self.scene, self.poses, self.walled, self.rounder = scene, poses, has_wall(scene.object), rounder
        fingers = self.fingers  # at once: where a pad misses the object there is no solver
        if self.walled:
            refuse_along_axis(fingers)
        self.forces = tuple(scene.load.normal_force)  # the load path; forces are asked for by their number in it
        self.finest: tuple[int, ...] = (FINEST,) * len(self.forces)
        self.together = False
        self._pressing: dict[tuple[int, Levels], OnRigid | OnWall] = {}
        self._paths: dict[tuple[int, Levels, int], Iterator[Any]] = {}
        self._states: dict[tuple[int, int, Levels, int], Any] = {}  # or failures, of every part
        self._solutions: dict[tuple[int, int, Levels], Solution] = {}
        self._spent = Seconds()  # by what was put away

    @cached_property
    def fingers(self) -> list[Finger]:
        """Both of them at first touch; what they know of a mesh takes megabytes, so it is put away, too."""
        return fingers_of(self.scene, self.poses)

    @cached_property
    def settings(self) -> EvaluationSettings:
        """What is computed from two contacts."""
        return settings_of(self.scene)

    def at_levels(self, levels: Levels) -> Scene:
        """The scene with these levels of its effects."""
        # values that the scene itself could have, so nothing is checked again
        effects = self.scene.effects.model_copy(update=levels._asdict())
        return self.scene.model_copy(update={"effects": effects})

    def pressing(self, mesh: int, levels: Levels) -> OnRigid | OnWall:
        """What presses both fingers on a mesh."""
        # each load path has a solver of its own, or what one needed would change the other
        if (mesh, levels) not in self._pressing:
            scene, fingers = self.at_levels(levels), self.fingers
            if mesh > FINE:
                gripper = scene.gripper.model_copy(update={"elements": pad_elements(scene, mesh)})
                scene = scene.model_copy(update={"gripper": gripper})
                fingers = fingers_of(scene, self.poses) if self.rounder else fingers
            stride = 2 if mesh == LONG_STEPS else 1
            self._pressing[mesh, levels] = pressing(scene, fingers, self.poses, mesh <= COARSE, stride)
        return self._pressing[mesh, levels]

    def solve(self, k: int, mesh: int, levels: Levels) -> Solution:
        """Both fingers at the ``k``-th force.

        Raises `ConvergenceError, CheckError` if there is no acceptable state; the same each time.
        """
        if (k, mesh, levels) not in self._solutions:
            fingers = self.pressing(mesh, levels)
            states = [self._state(k, mesh, levels, part) for part in range(len(fingers.parts))]
            for state in states:
                if isinstance(state, Failure):
                    raise state
            self._solutions[k, mesh, levels] = Solution(fingers, fingers.contacts(states))
        return self._solutions[k, mesh, levels]

    def case(self, k: int, levels: Levels, left_out: float = 0.0) -> Solved:
        """Solutions of a case on the scene's meshes, and on finer ones where ``accuracy.target`` asks for them.

        ``left_out`` is the error that effects add which are left out.

        Raises `ConvergenceError, CheckError` if there is no acceptable state on the scene's mesh.
        """
        solved = Solved([self.solve(k, FINE, levels)])
        if not forces_apart(self.scene):
            return solved
        try:
            coarse = self.solve(k, COARSE, levels)
            solved = Solved([solved.fine, coarse])
            if levels.friction_pressure_coupling != "none":
                solved = solved._replace(pairs=[(coarse, self.solve(k, LONG_STEPS, levels), OF_LONG_STEPS)])
            if self.rounder:
                plain = levels._replace(friction_pressure_coupling="none")
                edges = self.solve(k, COARSE, plain), self.rounder.solve(k, FINE, plain)
                solved = solved._replace(edges=edges)
        except (ConvergenceError, CheckError) as failure:
            solved = solved._replace(note=(PART_OF_ERROR if solved.coarse else NO_ERROR).format(reason=failure))
        return self._refined(solved, k, levels, left_out) if isinstance(solved.fine.fingers, OnRigid) else solved

    @property
    def seconds(self) -> Seconds:
        """Where the time of all solves so far has gone."""
        spent = [self._spent, *(p.solver.seconds for fingers in self._pressing.values() for p in fingers.parts)]
        return Seconds(*(sum(getattr(s, name) for s in spent) for name in ("assembly", "factorisation", "total")))

    def error(self, solved: Solved) -> float:
        """Relative error of the quantity that ``accuracy.target`` is for; NaN where there is one mesh alone."""
        if solved.coarse is None:
            return math.nan
        errors = solved.errors(grasp_values(tuple(solved.fine.contacts), self.settings), {}, self.settings)
        return errors[f"maps/{self.scene.accuracy.target_of}_error"]

    def _refined(self, solved: Solved, k: int, levels: Levels, left_out: float) -> Solved:
        """The case as it is where its error is surely below the target, else on further meshes.

        Where a finer mesh has no state the case keeps the answer of the one before, with a note.
        """
        if (target := self.scene.accuracy.target) is None:
            return solved
        for mesh in range(FINE + 1, self.finest[k] + 1):
            # undecided, and unknown, is refined, which is right in both cases
            too_large = math.prod(pad_elements(self.scene, mesh)) > MOST_ELEMENTS
            if too_large or (not self.together and surely_below(self.error(solved) + left_out, target)):
                break
            try:
                solved = solved._replace(meshes=[self.solve(k, mesh, levels), *solved.meshes])
            except (ConvergenceError, CheckError, ArithmeticError) as error:
                return solved._replace(note=join_notes(solved.note, NOT_REFINED.format(reason=error)))
        return solved

    def _state(self, k: int, mesh: int, levels: Levels, part: int) -> Any:
        """State of one part at the ``k``-th force, or why there is none."""
        # with friction that acts back every force is a branch of a path that is the mesh's own
        coupled = levels.friction_pressure_coupling != "none"
        on_path = not coupled and (mesh == COARSE or not forces_apart(self.scene))
        for i in range(0 if on_path else k, k + 1):
            if (i, mesh, levels, part) not in self._states:
                solve = self._next if on_path else self._alone
                self._states[i, mesh, levels, part] = solve(i, mesh, levels, part)
        return self._states[k, mesh, levels, part]

    def _next(self, i: int, mesh: int, levels: Levels, part: int) -> Any:
        """The ``i``-th state on a load path, whose states before are known; one that was put away is followed again."""
        if (mesh, levels, part) not in self._paths:
            load_path = self.pressing(mesh, levels).parts[part].load_path
            self._paths[mesh, levels, part] = islice(followed(load_path, self.forces), i, None)
        return next(self._paths[mesh, levels, part])

    def _alone(self, k: int, mesh: int, levels: Levels, part: int) -> Any:
        """A state that depends on no other one of its mesh."""
        try:
            return self.pressing(mesh, levels).parts[part].at(self.forces[k], self._starts(k, mesh, levels, part))
        except (ConvergenceError, CheckError) as failure:
            return failure

    def _starts(self, k: int, mesh: int, levels: Levels, part: int) -> list[Any]:
        """States on the mesh before that a state is started from, the nearest first; none with friction acting back."""
        if levels.friction_pressure_coupling != "none":
            return []
        forces = range(k, -1, -1) if mesh == FINE else (k,)
        states = (self._state(i, mesh - 1, levels, part) for i in forces)
        return [state for state in states if not isinstance(state, Failure)][:MOST_STARTS]

    def put_away(self) -> None:
        """Give the memory of meshes and factors back; solutions stay, and what else is asked for makes them anew."""
        self._spent = self.seconds
        if self.rounder:
            self.rounder.put_away()
        for fingers in self._pressing.values():
            for part in fingers.parts:
                part.destroy()
            fingers.parts, fingers.fingers = [], []
        self._pressing, self._paths = {}, {}
        self.__dict__.pop("fingers", None)


def fingers_of(scene: Scene, poses: Sequence[Pose]) -> list[Finger]:
    """Both fingers of these poses at first touch."""
    return [approach(build_object(scene.object), pose, scene.gripper) for pose in poses]


def join_notes(*notes: str) -> str:
    """Notes in one line, without empty ones."""
    return "; ".join(note for note in notes if note)
