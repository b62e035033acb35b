"""Who solves what, and since when: counters and clocks in the memory that the ranks of a node share."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from mpi4py import MPI

NEXT, STOP, SPOKEN = range(3)  # what the counters of a node are for
PATIENCE_LIMITS = 2.0  # of the time limit, after which a rank that has not even heard its own alarm counts as lost
IDLE = -1


def _shared(node: Any, count: int, kind: type) -> tuple[Any, np.ndarray]:
    """A window and ``count`` numbers of eight bytes in it, which all ranks of the node see."""
    # All of it at one rank, so that it is one block, which `Shared_query(0)` finds.
    window = MPI.Win.Allocate_shared(8 * count if node.rank == 0 else 0, 8, comm=node)
    memory: Any = window.Shared_query(0)[0]
    return window, np.frombuffer(memory, kind)


class Claims:
    """Positions ``0 .. count - 1``, each handed to one rank; creating and freeing are collective.

    Inside a node the next position comes from a counter in shared memory, which needs no help from a rank that is
    computing. Between nodes the positions are dealt out in turn: a counter on another node would wait until the rank
    that holds it leaves its solver.

    ``comm``: all ranks of the run. ``count``: number of positions. ``node``: the ranks that share this rank's memory;
    found from ``comm`` where it is not given.
    """

    def __init__(self, comm: Any, count: int, node: Any = None) -> None:
        self._own = node is None
        self.node = comm.Split_type(MPI.COMM_TYPE_SHARED) if node is None else node
        # Sorted, because all ranks have to number the nodes alike.
        leaders = sorted(set(comm.allgather(self.node.bcast(comm.rank))))
        self._first, self._step, self._count = leaders.index(self.node.bcast(comm.rank)), len(leaders), count
        self._window, self._shared = _shared(self.node, 3, np.int64)
        if self.node.rank == 0:
            self._shared[:] = 0
        # Nobody may count before the counters are 0.
        self.node.Barrier()
        # Locked once for all, so that a claim is a single operation.
        self._window.Lock_all()

    def __iter__(self) -> Iterator[int]:
        """Positions of this rank, until there are none left or somebody called `stop`."""
        while not self.stopped:
            position = self._first + self._add_one(NEXT) * self._step
            if position >= self._count:
                return
            yield position

    def _add_one(self, counter: int) -> int:
        return self._counted(self._window, counter)

    @staticmethod
    def _counted(window: Any, counter: int) -> int:
        """What a counter had before this rank added one."""
        before = np.zeros(1, np.int64)
        window.Fetch_and_op(np.ones(1, np.int64), before, 0, counter, MPI.SUM)
        # Only after this the answer has arrived.
        window.Flush(0)
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
        """Give the counter back."""
        stopped = self.stopped
        self._window.Unlock_all()
        # Memory of the window is gone after this; whoever still asks reads a copy.
        self._shared = np.array([0, stopped, 0], np.int64)
        self._window.Free()
        if self._own:
            self.node.Free()


class ObjectClaims(Claims):
    """Positions of several objects, one after the other: a rank stays with an object as long as it has positions.

    It takes an object that nobody on its node has begun, then helps with the one that has most positions left. Between
    nodes the objects are dealt out in turn.

    ``comm``: all ranks of the run. ``sizes``: number of positions of every object.
    """

    def __init__(self, comm: Any, sizes: Sequence[int]) -> None:
        super().__init__(comm, len(sizes))
        self._sizes = np.array(sizes, np.int64)
        self._mine = np.arange(self._first, len(sizes), self._step)
        self._of_objects, self._taken = _shared(self.node, max(len(sizes), 1), np.int64)
        if self.node.rank == 0:
            self._taken[:] = 0
        self.node.Barrier()
        self._of_objects.Lock_all()

    def __iter__(self) -> Iterator[int]:
        """Positions of this rank, until there are none left or somebody called `stop`."""
        for number in super().__iter__():
            yield from self._of(number)
        while self._mine.size and not self.stopped:
            left = self._sizes[self._mine] - self._taken[self._mine]
            if left.max() <= 0:
                return
            yield from self._of(int(self._mine[left.argmax()]))

    def _of(self, number: int) -> Iterator[int]:
        first = int(self._sizes[:number].sum())
        while not self.stopped and (i := self._counted(self._of_objects, number)) < self._sizes[number]:
            yield first + i

    def free(self) -> None:
        """Give the counters back."""
        self._of_objects.Unlock_all()
        self._taken = np.zeros(0, np.int64)
        self._of_objects.Free()
        super().free()


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
