"""How well a two-finger gripper with soft jaws holds an object at each place where it could grasp it.

The names below are what a script needs, and docs/python.md shows them on one page. Each is loaded when it is first
asked for, so ``import softjaw`` takes no time. Only `press` and `run` need PETSc, and only `run` needs MPI.
"""

from importlib import import_module
from typing import Any

# What type checkers know of these names stands in __init__.pyi.
_HOMES = {
    "Scene": "study.scene", "press": "study.solve", "run": "study.solve", "open": "study.result.read",
    "read_patch": "study.result.read", "GraspMap": "study.lookup", "ContactPatch": "friction.patch",
    "read_pressure": "study.patch.measures", "friction_limits": "study.patch.measures",
    "friction_wrench": "study.patch.measures", "fit_ellipsoid": "study.patch.measures",
    "fit_quartic": "study.patch.measures", "grasp_quality": "study.patch.measures", "StudyError": "study.messages",
}  # fmt: skip
__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    """A public name, from the module that defines it."""
    if name not in _HOMES:
        raise AttributeError(f"module 'softjaw' has no attribute {name!r}")
    # Before numba is loaded, which refuses to compile where it cannot keep what it compiles.
    import_module("softjaw.study.doctor").keep_compiled_loops()
    return getattr(import_module(f"softjaw.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    """The public names."""
    return [*globals(), *_HOMES]
