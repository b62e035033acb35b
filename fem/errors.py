"""What can go wrong in a contact solve, each with a sentence a user can act on."""

from typing import Any


class ConvergenceError(RuntimeError):
    """A nonlinear solve stopped without an answer.

    ``end``, where the residual did not fall any more: the last iterate and the norm of the residual there.
    """

    end: tuple[Any, float] | None = None


class SpentError(RuntimeError):
    """The Newton iterations that one state may take are spent."""


class NotReachedError(ConvergenceError):
    """However far the backing plate moved, the force stayed below the one that was asked for."""


class CheckError(RuntimeError):
    """A solve converged to a state that breaks a law of contact or of the material."""


class MeshError(ValueError):
    """A mesh that cannot serve as an object; the message says why and what to do."""
