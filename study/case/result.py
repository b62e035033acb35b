"""What one case gives back, values to store or the reason why there are none, and how values are compared."""

from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import Any, NamedTuple

UNDECIDED = 1e-6  # of a limit: what is nearer to it is undecided
TIE = 1e-6  # relative difference of values that is none: images of one grasp, or equal within rounding


@dataclass(frozen=True)
class CaseResult:
    """Values of one case (candidate x force), keyed ``group/name`` as in ``study.quantities``.

    ``patch`` holds the faces of both fingers, keyed by dataset name, each ``(2, faces, ...)``; ``message`` is empty or
    says what the reader should know about a result that is valid. ``contacts`` are both fingers as they were solved,
    in the object's frame, for who has the case in memory; no file holds them.
    """

    values: dict[str, Any]
    patch: dict[str, Any] | None = None
    message: str = ""
    effects: dict[str, Any] = field(default_factory=dict)
    contacts: tuple[Any, ...] = ()


class CaseFailure(NamedTuple):
    """A case without a result; ``message`` is one sentence with the cause and the remedy."""

    message: str


class TimeLimitError(BaseException):
    """The case in flight has had its time; not an ``Exception``, so that no solver takes it for a failed step."""


class GraspNumbers(ABC):
    """The main numbers of a grasp by name, for who has a `value`: of a case in memory, or of points of a map."""

    @abstractmethod
    def value(self, name: str, model: str = "ccm") -> Any:
        """A quantity of the grasp in SI units, of one friction model where it has several."""

    @property
    def e_n(self) -> Any:
        """Eccentricity parameter of the weaker finger, CCM [m]."""
        return self.value("e_n")

    @property
    def quality(self) -> Any:
        """Grasp quality, CCM [-]."""
        return self.value("quality")

    @property
    def payload(self) -> Any:
        """Largest mass that is held, CCM [kg]."""
        return self.value("payload")

    @property
    def opening(self) -> Any:
        """Distance of the undeformed pads as they touch the object [m]: open the gripper wider."""
        return self.value("opening")


def surely_below(value: Any, limit: float) -> Any:
    """Whether a value, or each of several, is below a limit by more than `UNDECIDED`; no where undecided, or NaN.

    >>> surely_below(0.9, 1.0), surely_below(1.0 - 1e-12, 1.0), surely_below(1.1, 1.0)
    (True, False, False)
    """
    return value <= limit * (1.0 - UNDECIDED)
