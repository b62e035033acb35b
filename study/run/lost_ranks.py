"""What the ranks of a node are solving since when, so that those which are done can give up one that never comes back.

A case that hangs inside a library cannot be ended from within: the process that holds it hears no signal in Python.
Another process of the node can see that, mark the case as failed, and end the run when everything else is done.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from mpi4py import MPI

SHARE = 2.0  # of the time limit, after which a rank that has not even heard its own alarm counts as lost
IDLE = -1


class LostRanks:
    """One row for each rank of a node in shared memory; creating and freeing are collective over the node.

    Parameters
    ----------
    node : communicator
        Ranks that share memory.
    limit : float
        Time limit of a case [s].
    """

    def __init__(self, node: Any, limit: float) -> None:
        self.patience, self._node = SHARE * limit, node
        size = 2 * MPI.DOUBLE.Get_size() * node.size if node.rank == 0 else 0
        self._window = MPI.Win.Allocate_shared(size, MPI.DOUBLE.Get_size(), comm=node)
        memory, _ = self._window.Shared_query(0)
        self._unit, self._since = np.frombuffer(memory, float).reshape(2, node.size)
        if node.rank == 0:
            self._unit[:] = IDLE
        node.Barrier()

    def begin(self, unit: int) -> None:
        """Note that this rank begins a case of the unit with this index."""
        self._since[self._node.rank] = time.monotonic()  # one clock for all processes of a node
        self._unit[self._node.rank] = unit

    def end(self) -> None:
        """Note that this rank solves nothing."""
        self._unit[self._node.rank] = IDLE

    def units(self) -> list[int]:
        """Units whose ranks have been in one case for much longer than its time limit."""
        late = (self._unit != IDLE) & (time.monotonic() - self._since > self.patience)
        return [int(unit) for unit in self._unit[late]]

    def free(self) -> None:
        """Give the memory back."""
        self._unit = self._since = np.empty(0)
        self._window.Free()
