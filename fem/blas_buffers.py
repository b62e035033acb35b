"""Work memory of the BLAS libraries of this process, taken while there is room for it.

OpenBLAS takes its work memory, 32 or 128 MiB of addresses, at its first larger operation. Where a limit (``ulimit -v``,
a batch system, ``run.memory_gb``) leaves less, older versions ask for ever and newer ones end the process, both without
a word. So every library makes a first operation when the solver is loaded, after a look whether there is room.
"""

from __future__ import annotations

import mmap
from collections.abc import Callable

import numpy as np
import scipy.linalg

ROOM = 160 * 2**20  # bytes that are free before a library is let loose: the largest work memory and what goes with it


def take_buffers(*others: Callable[[], object]) -> None:
    """Let numpy's and scipy's BLAS take their work memory, then those that the operations ``others`` reach.

    Raises
    ------
    MemoryError
        Where addresses are too few for one of them.
    """
    one = np.eye(2)
    for operation in (lambda: np.linalg.solve(one, one), lambda: scipy.linalg.lu_factor(one), *others):
        try:
            mmap.mmap(-1, ROOM, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS, prot=mmap.PROT_READ).close()
        except OSError as error:
            text = f"a library of linear algebra takes {ROOM / 1e6:.0f} MB of addresses at once, and they are not there"
            raise MemoryError(text) from error
        operation()
