"""Who solves what, and since when: counters and clocks in the memory that the ranks of a node share."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

NEXT, STOP, SPOKEN, TAKEN = range(4)  # what the counters of a node are for; those of the groups come last
PATIENCE_LIMITS = 2.0  # of the time limit, after which a rank that has not even heard its own alarm counts as lost
IDLE = -1


def _shared(node: Any, count: int, kind: type) -> tuple[Any, np.ndarray]:
    """A window and ``count`` numbers of eight bytes in it, which all ranks of the node see."""
    # All of it at one rank, so that it is one block, which `Shared_query(0)` finds.
    window = MPI.Win.Allocate_shared(8 * count if node.rank == 0 else 0, 8, comm=node)
    memory: Any = window.Shared_query(0)[0]
    return window, np.frombuffer(memory, kind)


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
        self._window, self._shared = _shared(self.node, TAKEN + len(sizes), np.int64)
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
            left = self._sizes[self._groups] - self._shared[TAKEN:][self._groups]
            if left.max() <= 0:
                return
            yield from self._of(self._groups[left.argmax()])

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


class LostRanks:
    """What the ranks of a node solve since when; creating and freeing are collective over the node.

    A case that hangs inside a library cannot be ended from within: the process that holds it hears no signal in Python.
    Another process of the node can see that, mark the case as failed, and end the run when everything else is done.

    ``node``: ranks that share memory. ``limit``: time limit of a case [s].
    """

    def __init__(self, node: Any, limit: float) -> None:
        self.patience, self._node = PATIENCE_LIMITS * limit, node
        self._window, numbers = _shared(node, 2 * node.size, float)
        self._share, self._since = numbers.reshape(2, node.size)
        if node.rank == 0:
            self._share[:] = IDLE
        node.Barrier()

    def begin(self, position: int) -> None:
        """Note that this rank begins a case of the share of the work at this position."""
        # Time before share: between the two a look must not pair the new share with an old time.
        self._since[self._node.rank] = time.monotonic()  # one clock for all processes of a node
        self._share[self._node.rank] = position

    def end(self) -> None:
        """Note that this rank solves nothing."""
        self._share[self._node.rank] = IDLE

    def positions(self) -> list[int]:
        """Shares whose ranks have been in one case for much longer than its time limit."""
        late = (self._share != IDLE) & (time.monotonic() - self._since > self.patience)
        return [int(position) for position in self._share[late]]

    def free(self) -> None:
        """Give the memory back."""
        # No view may outlive the window that it looks into.
        self._share = self._since = np.empty(0)
        self._window.Free()
