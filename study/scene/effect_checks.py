"""Which effects can be asked for together."""

from __future__ import annotations

from collections.abc import Iterator

from softjaw.study.scene.errors import Finding
from softjaw.study.scene.sections import Effects
from softjaw.study.scene.shape import Shape, Walled


def coupling(shape: Shape, effects: Effects) -> Iterator[Finding]:
    """Friction acts back on pads that press on rigid objects."""
    if effects.friction_pressure_coupling != "tangential":
        return
    where = ("effects", "friction_pressure_coupling")
    if isinstance(shape, Walled) and shape.wall is not None and effects.object != "rigid":
        found, remedy = '"tangential" with a thin wall', 'write object = "rigid" in [effects], or "none" here'
        yield Finding(where, found, "a rigid object", remedy)
