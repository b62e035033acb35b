"""How a contact patch hangs together: pieces, holes, and which rims of the pad carry load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy import ndimage

from softjaw.study.quantities import RIMS

NOTHING = 1e-6  # of the largest pressure, up to which a face is not loaded: rounding must not make pieces


def topology(pressure: ArrayLike, faces: tuple[int, int]) -> dict[str, int]:
    """Pieces, holes and loaded rims of a patch.

    Parameters
    ----------
    pressure : (n,) array
        Of all faces of the pad, those across its width running fastest; without pressure a face is not loaded.
    faces : (int, int)
        Faces along the pad's length and across its width.

    Returns
    -------
    dict
        ``pieces`` (faces that touch at a corner belong together), ``holes`` (not loaded, with load all round) and
        ``rims``, a sum of `study.quantities.RIMS`.

    Examples
    --------
    >>> topology([1, 1, 1, 1, 0, 1, 1, 1, 1, 0, 0, 0], (4, 3))
    {'pieces': 1, 'holes': 1, 'rims': 13}
    """
    p = np.asarray(pressure, float).reshape(faces)
    loaded = p > NOTHING * p.max()
    pieces = ndimage.label(loaded, np.ones((3, 3)))[1]
    # Padded, so that all that is not loaded and reaches a rim is one region, which is no hole.
    holes = ndimage.label(np.pad(~loaded, 1, constant_values=True))[1] - 1
    rows = (loaded[0], loaded[-1], loaded[:, 0], loaded[:, -1])
    rims = sum(bit for bit, row in zip(RIMS, rows, strict=True) if row.any())
    return {"pieces": pieces, "holes": holes, "rims": rims}


def of_fingers(contacts: Sequence[Any], faces: tuple[int, int]) -> dict[str, list[int]]:
    """`topology` of the patches of both fingers, keyed as in ``study.quantities``."""
    found = [topology(contact.patch.pressure, faces) for contact in contacts]
    return {f"fingers/{name}": [own[name] for own in found] for name in ("pieces", "holes", "rims")}
