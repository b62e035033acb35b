"""The answer in a sentence: where to grasp, how wide to open, how hard to press, what is held then."""

from __future__ import annotations

from typing import Any

import numpy as np

from softjaw.study.ranking import task_keys
from softjaw.study.show.grasps import Index, at, forces, number, place
from softjaw.study.units import in_si, shown, shown_text

UNSEEN = 0.005  # of a force: an error below it is not seen in three digits
PLAIN = {"\N{NO-BREAK SPACE}": " ", "\N{DEGREE SIGN}": " deg"}


def answer(ds: Any, index: Index) -> str:
    """What to do with a grasp, the best one as a rule; ``index`` is its case at the force that is shown."""
    where = place(ds, index)
    for mark, text in PLAIN.items():
        where = where.replace(mark, text)
    parts = [f"grasp at {where or 'the only candidate'}{_pads(ds, index)}"]
    if np.isfinite(opening := at(ds, "opening", index)):
        parts.append(f"open the gripper wider than {shown_text(opening, 'm', 3)}")
    return f"{', '.join(parts)}, {_press(ds, index)}"


def force_to_use(ds: Any, index: Index) -> tuple[float, float]:
    """Smallest force that holds the object at a candidate, and its error [N]; NaN where it is not known."""
    names = ("force_low", "force_low_error")
    low, error = (float(ds[n].values[index[:-1]]) if n in ds else float("nan") for n in names)
    return low, error


def _press(ds: Any, index: Index) -> str:
    """How hard to press, and what is held then."""
    force, held = forces(ds)[index[-1]], at(ds, "payload", index)
    mass, safety = task_keys(ds, "object").get("mass_g"), task_keys(ds).get("safety", 1.0)
    aims = task_keys(ds).get("weight_direction", "worst") != "worst"
    every = "in the direction of its weight" if aims else "in whichever direction it pulls"
    here = f"press with {force:.3g} N per finger"
    if not np.isfinite(held):
        return here
    now = f"holds {_mass(held)}{_error(ds, index)} {every}"
    if mass is None or "force_low" not in ds:
        return f"{here}: it then {now}"
    low, error = force_to_use(ds, index)
    wanted = f"{safety:g} times the object's {_mass(in_si('mass_g', mass))}"
    if not np.isfinite(low):
        return f"{here}: it then {now}, but no solved force holds {wanted}"
    margin = f" +- {error:.2g}" if error > UNSEEN * low else ""
    return f"press with {low:.3g}{margin} N per finger: it then holds {wanted} {every} ({_mass(held)} at {force:.3g} N)"


def _mass(mass: float) -> str:
    return shown_text(mass, "kg", 3) if mass < 1 else f"{mass:.3g} kg"


def _error(ds: Any, index: Index) -> str:
    """Error of the payload, where the file knows it."""
    error = at(ds, "payload_error", index)
    return f" +- {number(100 * error, 2)} %" if np.isfinite(error) else ""


def _pads(ds: Any, index: Index) -> str:
    """Middle of both pads, the way finger 1 closes and their long side, in the frame of the object's own file."""
    if "finger_pose_origin" not in ds:
        return ""
    middle, turn = ds.finger_pose_origin.values[index].mean(axis=0), ds.finger_pose_rotation.values[index][0]
    if not np.isfinite([*middle, *turn.ravel()]).all():
        return ""
    # adding 0 turns -0 into 0
    x = ", ".join(f"{v + 0.0:.4g}" for v in np.round(shown(middle, "m"), 2))
    closing, long_side = (", ".join(f"{v + 0.0:.3g}" for v in np.round(turn[:, k], 3)) for k in (2, 0))
    return f" (pads about [{x}] mm, closing along [{closing}], long side along [{long_side}])"
