"""Why a candidate was not solved, by classes: what physics forbids, and what the program should have managed."""

from __future__ import annotations

import re
from dataclasses import dataclass


@dataclass(frozen=True)
class Reason:
    """A class of failures: its name, what its messages contain, and what no better program could have changed."""

    name: str
    pattern: str
    by: str = ""  # "physics", or "scene" where that is refused with good reason


REASONS = (
    Reason("crash", r"^crash: |Traceback"),
    Reason("killed at the time limit", r"time limit of"),
    Reason("a case took too long", r"may take|took too long|times the median|given up after"),
    Reason("a negative force as reason", r"(at|reached|of) -\d"),
    Reason("foam loses ellipticity", r"^the foam loses ellipticity", "physics"),
    Reason("pad compressed too far", r"^the pad is compressed too far", "physics"),
    Reason("limit point", r"limit point|largest force that", "physics"),
    Reason("the pad jumps", r"the pad jumps|lies beyond the one"),
    Reason("pad misses the object", r"misses the object|no pad meets|leaves the object", "physics"),
    Reason("pad grazes the object", r"grazes the object", "physics"),
    Reason("no grasp found", r"found no grasp between"),
    Reason("no first contact", r"found no first contact"),
    Reason("state converged but is wrong", r"converged but is wrong"),
    Reason("closing falls", r"closing displacement falls"),
    Reason("force not reached", r"the force stays below"),
    Reason("stuck", r"stuck at"),
    Reason("outline refused", r"profile's curve swings to the axis", "scene"),
    Reason("hole under a pad", r"has a hole under the pad"),
    Reason("mesh refused", r"holes|cross itself|crosses itself|open edges"),
)
OTHER = Reason("other", "")


def reason_of(message: str) -> Reason:
    """The class of a message; a case that was not tried has that of the force that ended its path."""
    told = re.sub(r"^not tried, because the load path ended at [^:]*: ", "", message)
    return next((reason for reason in REASONS if re.search(reason.pattern, told)), OTHER)
