"""Flags of a case: the bit in the file, the word in a table, the sentence in the stored message, all in one place.

Lower packages raise small flags of their own; `raised` gives them their bits of the file by their names.
"""

from __future__ import annotations

import math
from enum import IntFlag

DEGREES_90 = "more than 90 deg from the contact normal"


class Flag(IntFlag):
    """What the reader of a case should know; flags add up.

    ``word`` is what a column of a table has room for, ``sentence`` what a message says of it, ``more`` what
    its definition in the file adds.
    """

    word: str
    sentence: str
    more: str

    def __new__(cls, bit: int, word: str = "", sentence: str = "", more: str = "") -> Flag:
        """A bit with its texts."""
        made = int.__new__(cls, bit)
        made._value_ = bit
        made.word, made.sentence, made.more = word, sentence, more
        return made

    def __invert__(self) -> int:  # type: ignore[override]
        """All other bits: Python's own forgets those above where members carry texts."""
        return ~int(self)

    NO_TORQUE = 1 << 0, "no torque", "a contact carries no torque about its normal"
    NO_FORCE = 1 << 1, "no force", "a contact carries no force along one of its axes"
    CYCLE = 1 << 2, "cycle", "the contact normal alternated between faces, their mean was used"
    HOLE = 1 << 3, "hole", "no face on the line through the centre of pressure along the contact normal"
    NO_CORNERS = 1 << 4, "no corners", "the faces of a patch have no corners, the nearest one gave the contact frame"
    ORIENTATION = 1 << 5, "mixed", (
        "normals of a patch point to opposite sides, its normal force and frame cannot be trusted"
    )  # fmt: skip
    OVERHANG = 1 << 6, "overhang", f"some loaded faces of a patch are turned {DEGREES_90}"
    WINDING = 1 << 7, "winding", "some faces are wound against their normals, the normals were used"
    NOT_ANTIPODAL = 1 << 8, "not antipodal", "contacts more than 5 deg from antipodal"
    NODAL = 1 << 9, "nodal", "mortar contact did not converge, node-to-surface contact used"
    SLIPS = 1 << 10, "slips", "the line that joins the contacts leaves a friction cone, so the grasp slips"
    COLLISION = 1 << 11, "pads collide", "the pads run into each other beside the object, which is not simulated"
    COARSE = 1 << 12, "coarse", "the mesh is coarse for this contact, so its errors are large", (
        "the contact face overlaps the object by more than a tenth of the closing, fewer than six elements carry load,"
        " only one along its length or its width does, the object's normal turns by more than 120 deg between loaded"
        " neighbours, trilinear elements have a Poisson's ratio above 0.45, or the error is above accuracy.target"
    )  # fmt: skip
    SNAPPED = 1 << 13, "snapped", "the wall has snapped in on the way to this force", (
        "the force fell while the fingers closed, more force would open them, it grew less than half as fast as before"
        " on average, or the wall closed more than twice as fast"
    )  # fmt: skip
    SLIDES_OUT = 1 << 14, "slides out", (
        "the pads push the object along its axis with more than friction can hold, so it slides out"
    )  # fmt: skip
    YIELDS = 1 << 15, "yields", "the wall's stress is above its yield strength, the indentation stays"
    NO_FIT = 1 << 16, "no fit", "limit surface fit failed, three-motion ellipsoid used"
    UNSTABLE = 1 << 17, "unstable", "the foam lost ellipticity, strains may localise"
    JUMPED = 1 << 18, "jumped", (
        "the path of equilibria ends, folds or forks on the way to this force, the state depends on the load path"
    )  # fmt: skip
    NOT_BORNE = 1 << 19, "no hold", "friction cannot balance the squeeze itself, so nothing is held", (
        "the normal forces do not face each other: their couple, or their push to one side, comes before any load"
    )  # fmt: skip
    DENTED = 1 << 22, "dented", "the wall is dented deep", (
        "by more than a fifth of the object's half width between the fingers: what is held there has another shape"
    )  # fmt: skip
    LEFT_OUT = 1 << 23, "uncoupled", "friction that acts back on the pressure moves e_n and is left out", (
        "on the coarse mesh by more than accuracy.target, or 1 % where the scene names no target"
    )  # fmt: skip
    OBLIQUE = 1 << 24, "oblique", "a contact normal lies oblique to the approach", (
        "by 18 deg or more, so that the force along it is not the one that the gripper commands: see force_excess"
    )  # fmt: skip
    MESH_HOLE = 1 << 25, "mesh hole", "a hole of the mesh lies under a pad, where nothing is known of the object"
    # of no file: derived where a file holds the safe force range
    TOO_WEAK = 1 << 20, "too weak", "this force does not hold the object's mass with the safety that [task] asks for"
    TOO_STRONG = 1 << 21, "too strong", "this force dents the wall deeper than is allowed, or makes it yield"
    # of no file: of the few best grasps, where the scene names a gripper
    OUT_OF_REACH = 1 << 26, "out of reach", (
        "the hand does not open so wide, has not this force, or meets the object from whichever side it comes"
    )  # fmt: skip


DERIVED = Flag.TOO_WEAK | Flag.TOO_STRONG | Flag.OUT_OF_REACH
HARM = Flag.SLIDES_OUT | Flag.YIELDS | Flag.TOO_STRONG  # what a smaller force may cure
BORNE = HARM | Flag.TOO_WEAK  # what another force may cure
LOST = Flag.SLIPS | Flag.COLLISION | Flag.NOT_BORNE | Flag.OUT_OF_REACH | BORNE  # of a grasp that fails or does harm
OF_FILE = sum(flag for flag in Flag if not flag & DERIVED)  # mask of the bits that a file holds


def raised(flag: IntFlag) -> Flag:
    """Bits of the file for a flag of a lower package, whose members have the same names here.

    >>> from softjaw.friction.frame import FrameFlag
    >>> raised(FrameFlag.HOLE | FrameFlag.ORIENTATION) == Flag.HOLE | Flag.ORIENTATION
    True
    """
    return Flag(sum(Flag[str(member.name)] for member in flag))


def flags_in(value: int) -> list[Flag]:
    """The flags that add up to a value, the lowest bit first; bits that mean nothing are left out.

    >>> [flag.word for flag in flags_in(8 + 1024)]
    ['hole', 'slips']
    """
    return [flag for flag in Flag if value & flag]


def flag_words(value: int, misalignment: float = math.nan) -> str:
    """Flags as a cell of a table; ``misalignment`` of the contacts [rad] is shown with its flag.

    >>> flag_words(8 + 1024), flag_words(256, 0.21)
    ('hole, slips', 'not antipodal by 12 deg')
    """
    angle = {Flag.NOT_ANTIPODAL: f" by {math.degrees(misalignment):.0f} deg"} if math.isfinite(misalignment) else {}
    return ", ".join(flag.word + angle.get(flag, "") for flag in flags_in(value))


def flag_sentences(value: int) -> str:
    """What a stored message says of a case with these flags.

    >>> flag_sentences(1)
    'a contact carries no torque about its normal'
    """
    return "; ".join(flag.sentence for flag in flags_in(value))


def flag_definitions() -> str:
    """What the bits of a file mean, for the file itself."""
    texts = (f"{int(f)} {f.sentence}{f': {f.more}' * bool(f.more)}" for f in Flag if f & OF_FILE)
    return f"Sum of: {'; '.join(texts)}."
