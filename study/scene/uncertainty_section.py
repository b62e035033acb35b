"""The section of a scene that says how far off its inputs may be, so that results carry bands."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import Field

from softjaw.study.scene.errors import Finding, closest, shown
from softjaw.study.scene.score_sections import Names
from softjaw.study.scene.sections import Candidates, Friction
from softjaw.study.scene.shapes import Section
from softjaw.study.units import si

Share = Annotated[float, Field(ge=0, le=50)]


class Uncertainty(Section):
    """How far inputs may be off (0: not asked), as half-widths within which about 95 of 100 cases lie.

    Errors that no formula gives are found by solving a few candidates, the probes, again with the input changed.
    """

    probes: Annotated[int, Field(ge=2, le=1000)] | Names = Field(
        5, description="how many candidates are solved again, or which ones, by number or label"
    )
    mesh: bool = Field(False, description="the error of the mesh, from one with half as many elements per direction")
    shear_modulus_percent: Share = Field(0.0, description="half-width of the pads' shear modulus")
    wall_thickness_percent: Share = Field(0.0, description="half-width of the thickness of a thin wall")
    mu: float = Field(0.0, ge=0, le=5, description="half-width of the friction coefficient")
    pose_mm: float = Field(0.0, ge=0, le=50, description="half-width of the gripper's place along the pads' long side")
    pose_deg: float = Field(0.0, ge=0, le=30, description="half-width of the gripper's turn about the approach")
    pose, pose_turn = si("pose_mm"), si("pose_deg")

    @property
    def parts(self) -> tuple[str, ...]:
        """What is asked for, of ``mesh, mu, modulus, wall, pose``."""
        asked = {
            "mesh": self.mesh, "mu": self.mu, "modulus": self.shear_modulus_percent,
            "wall": self.wall_thickness_percent, "pose": self.pose_mm or self.pose_deg,
        }  # fmt: skip
        return tuple(name for name, wanted in asked.items() if wanted)

    def numbers(self, labels: tuple[str, ...]) -> tuple[int, ...]:
        """Numbers of the candidates that are named, in the order given; empty where only their count is given."""
        named = () if isinstance(self.probes, int) else self.probes
        return tuple(dict.fromkeys(name if isinstance(name, int) else labels.index(name) for name in named))


def uncertainty_checks(own: Uncertainty, candidates: Candidates, friction: Friction) -> Iterator[Finding]:
    """Probes that are no candidates, and a friction coefficient that may be negative."""
    labels = candidates.labels
    for i, name in enumerate(() if isinstance(own.probes, int) else own.probes):
        path = ("uncertainty", "probes", i)
        if isinstance(name, int) and not 0 <= name < len(labels):
            remedy = "numbers count stations, then angles"
            yield Finding(path, f"{name}", f"a candidate's number, 0 to {len(labels) - 1}", remedy)
        elif isinstance(name, str) and name not in labels:
            near = closest(name, labels)
            remedy = f"did you mean {shown(near)}?" if near else f"write the candidate's number, 0 to {len(labels) - 1}"
            yield Finding(path, shown(name), f"a candidate's label, as {shown(labels[0])}", remedy)
    if own.mu and own.mu >= friction.mu:
        text = f"less than friction.mu, which is {friction.mu:g}"
        yield Finding(
            ("uncertainty", "mu"), f"{own.mu:g}", text, "the half-width is in the unit of mu, not in per cent"
        )


def wall_is_there(own: Uncertainty, shape: Any) -> Iterator[Finding]:
    """The thickness of a wall needs a wall."""
    if own.wall_thickness_percent and getattr(shape, "wall", None) is None:
        found, expected = f"{own.wall_thickness_percent:g}", "0 for an object without a wall"
        yield Finding(
            ("uncertainty", "wall_thickness_percent"), found, expected, "give object.wall_mm, or leave it out"
        )


def no_sweep(own: Uncertainty, sweep: dict[str, Any]) -> Iterator[Finding]:
    """Bands are computed for one point of a sweep only."""
    if own.parts and sweep:
        text = "leave [sweep] out here, or [uncertainty]"
        yield Finding(("uncertainty",), f"it beside a sweep over {', '.join(sweep)}", "a scene without a sweep", text)
