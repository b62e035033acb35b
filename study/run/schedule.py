"""Who solves what: ranks take units from a counter in the memory of their node, the most expensive ones first."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from mpi4py import MPI

NEXT, STOP, SPOKEN = range(3)  # what stands in the shared memory


class Claims:
    """Positions ``0 .. count - 1``, each handed to one rank; creating and freeing are collective.

    ``node`` are the ranks that share this rank's memory.

    Inside a node the next position comes from a counter in shared memory, which needs no help from a rank that is
    computing. Between nodes the positions are dealt out in turn: a counter on another node would wait until the rank
    that holds it leaves its solver.

    Parameters
    ----------
    comm : communicator
        All ranks of the run.
    count : int
        Number of positions.
    node : communicator, optional
        The ranks that share this rank's memory; found from ``comm`` where it is not given.
    """

    def __init__(self, comm: Any, count: int, node: Any = None) -> None:
        self._own = node is None
        self.node = comm.Split_type(MPI.COMM_TYPE_SHARED) if node is None else node
        leaders = sorted(set(comm.allgather(self.node.bcast(comm.rank))))
        self._first, self._step, self._count = leaders.index(self.node.bcast(comm.rank)), len(leaders), count
        item = MPI.INT64_T.Get_size()
        self._window = MPI.Win.Allocate_shared(3 * item if self.node.rank == 0 else 0, item, comm=self.node)
        memory, _ = self._window.Shared_query(0)
        self._shared = np.frombuffer(memory, np.int64)
        if self.node.rank == 0:
            self._shared[:] = 0
        self.node.Barrier()
        self._window.Lock_all()

    def __iter__(self) -> Iterator[int]:
        """Positions of this rank, until there are none left or somebody called `stop`."""
        one, taken = np.ones(1, np.int64), np.zeros(1, np.int64)
        while not self.stopped:
            self._window.Fetch_and_op(one, taken, 0, NEXT, MPI.SUM)
            self._window.Flush(0)
            position = self._first + int(taken[0]) * self._step
            if position >= self._count:
                return
            yield position

    def stop(self) -> None:
        """Ask all ranks of this node to begin nothing new."""
        self._shared[STOP] = 1

    @property
    def stopped(self) -> bool:
        """Whether a rank of this node asked to stop."""
        return bool(self._shared[STOP])

    def first_to_speak(self) -> bool:
        """Whether nobody on this node has asked this before; for a message that all ranks might give at once."""
        one, asked = np.ones(1, np.int64), np.zeros(1, np.int64)
        self._window.Fetch_and_op(one, asked, 0, SPOKEN, MPI.SUM)
        self._window.Flush(0)
        return not asked[0]

    def free(self) -> None:
        """Give the counter back."""
        stopped = self.stopped
        self._window.Unlock_all()
        self._shared = np.array([0, stopped, 0], np.int64)
        self._window.Free()
        if self._own:
            self.node.Free()
