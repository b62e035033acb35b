"""Who solves what: counters in the memory that the ranks of a node share."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

NEXT, STOP, SPOKEN, TAKEN = range(4)  # what the counters of a node are for; those of the groups come last


class Claims:
    """Positions ``0, 1, ...``, each handed to one rank; creating and freeing are collective.

    They stand in groups, as those of an object do. A rank takes a group that nobody on its node has begun, stays with
    it as long as it has positions, then helps with the one that has most left. Inside a node the next ones come from
    counters in shared memory, which need no help from a rank that is computing. Between nodes the groups are dealt out
    in turn: a counter on another node would wait until the rank that holds it leaves its solver.

    ``comm``: all ranks of the run. ``sizes``: number of positions of every group, 1 where no two belong together.
    ``node``: the ranks that share this rank's memory; found from ``comm`` where it is not given.
    """

    def __init__(self, comm: Any, sizes: Sequence[int], node: Any = None) -> None:
        self._own = node is None
        self.node = comm.Split_type(MPI.COMM_TYPE_SHARED) if node is None else node
        # Sorted, because all ranks have to number the nodes alike.
        leaders = sorted(set(comm.allgather(self.node.bcast(comm.rank))))
        self._sizes, self._first = np.array(sizes, np.int64), np.cumsum([0, *sizes])
        self._groups = np.arange(leaders.index(self.node.bcast(comm.rank)), len(sizes), len(leaders))
        # All of it at one rank, so that it is one block, which `Shared_query(0)` finds.
        size = 8 * (TAKEN + len(sizes)) if self.node.rank == 0 else 0
        self._window = MPI.Win.Allocate_shared(size, 8, comm=self.node)
        memory: Any = self._window.Shared_query(0)[0]
        self._shared = np.frombuffer(memory, np.int64)
        if self.node.rank == 0:
            self._shared[:] = 0
        # Nobody may count before the counters are 0.
        self.node.Barrier()
        # Locked once for all, so that a claim is a single operation.
        self._window.Lock_all()

    def __iter__(self) -> Iterator[int]:
        """Positions of this rank, until there are none left or somebody called `stop`."""
        while not self.stopped and (n := self._add_one(NEXT)) < len(self._groups):
            yield from self._of(self._groups[n])
        while not self.stopped and len(self._groups):
            remaining = self._sizes[self._groups] - self._shared[TAKEN:][self._groups]
            if remaining.max() <= 0:
                return
            yield from self._of(self._groups[remaining.argmax()])

    def _of(self, group: int) -> Iterator[int]:
        while not self.stopped and (i := self._add_one(TAKEN + group)) < self._sizes[group]:
            yield int(self._first[group]) + i

    def _add_one(self, counter: int) -> int:
        """What a counter had before this rank added one."""
        before = np.zeros(1, np.int64)
        self._window.Fetch_and_op(np.ones(1, np.int64), before, 0, counter, MPI.SUM)
        # Only after this the answer has arrived.
        self._window.Flush(0)
        return int(before[0])

    def stop(self) -> None:
        """Ask all ranks of this node to begin nothing new."""
        # A plain store: all ranks write the same 1, so it needs no turn of its own.
        self._shared[STOP] = 1

    @property
    def stopped(self) -> bool:
        """Whether a rank of this node asked to stop."""
        return bool(self._shared[STOP])

    def first_to_speak(self) -> bool:
        """Whether nobody on this node has asked this before; for a message that all ranks might give at once."""
        return self._add_one(SPOKEN) == 0

    def free(self) -> None:
        """Give the counters back."""
        # Memory of the window is gone after this; whoever still asks reads a copy.
        self._shared = self._shared.copy()
        self._window.Unlock_all()
        self._window.Free()
        if self._own:
            self.node.Free()
