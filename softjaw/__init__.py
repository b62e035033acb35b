"""How well a two-finger gripper with soft jaws holds an object at each place where it could grasp it.

The names below are what a script needs; each is loaded when it is first asked for, so ``import softjaw`` takes no time
and needs neither PETSc nor MPI.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

_HOMES = {
    "ContactPatch": "friction.patch",
    "friction_limits": "friction.wrench",
    "friction_wrench": "friction.wrench",
    "axis_aligned_ellipsoid": "lsfit.ellipsoid",
    "convex_quartic": "lsfit.quartic_fit",
    "score": "scoring.quality",
    "Scene": "study.scene",
    "press": "study.solve",
    "run": "study.solve",
    "load_scene": "study.scene",
    "open": "study.result.read",
    "read_patch": "study.result.read",
    "read_field": "study.result.read",
    "GraspMap": "study.lookup",
    "StudyError": "study.messages",
}
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    """A public name, from the module that defines it."""
    if name not in _HOMES:
        raise AttributeError(f"module 'softjaw' has no attribute {name!r}")
    return getattr(import_module(f"softjaw.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    """The public names."""
    return [*globals(), *_HOMES]
