"""Sending no faster than an autopilot forwards.

PX4 keeps forwarded messages in a ring of 583 bytes and takes out one per pass of its main
loop; what does not fit is dropped without a word (reference/mavlink.md §1). Three tunnel
messages fit, so those meant for the ground leave one at a time, a gap apart. Pure.
"""

from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum

from uavrt.errors import ConfigError
from uavrt.mavlink.discovery import Peer
from uavrt.mavlink.message import Message
from uavrt.units import ns_from_s

MIN_GAP_S = 0.012
"""A ``-r 1200`` serial link of PX4 has a pass of 8.33 ms; 12 ms lost nothing there."""


class Priority(IntEnum):
    """Who goes first."""

    ACK = 0
    STATUS = 1
    PULSE = 2


CAPACITY = {Priority.ACK: 64, Priority.STATUS: 64, Priority.PULSE: 4096}
"""Messages that may wait; 4096 pulses at 20 ms are 82 s."""


@dataclass(frozen=True, slots=True)
class Tunnelled:
    """A tunnel payload on its way to one receiver, or to all ground stations (None)."""

    payload: bytes
    target: Peer | None = None
    payload_type: int = 0


Item = Tunnelled | Message


@dataclass(slots=True)
class PacingCounters:
    """What went through the queue."""

    queued: int = 0
    released: int = 0
    dropped: dict[Priority, int] = field(default_factory=lambda: dict.fromkeys(Priority, 0))


class PacedQueue:
    """Bounded queues by priority, from which one message may leave per gap.

    When a queue is full its oldest message is dropped and counted: an operator wants the
    newest pulse, and all of them are recorded on board.

    Parameters
    ----------
    gap_s : float
        Time between two messages; at least 0.012 s.

    Raises
    ------
    ConfigError
        The gap is below the floor.
    """

    def __init__(self, gap_s: float = 0.020) -> None:
        if not gap_s >= MIN_GAP_S:
            raise ConfigError(
                f"tunnel_gap_s = {gap_s} would lose messages in the autopilot",
                remedy=f"Set it to {MIN_GAP_S} or more; 0.020 is the default",
            )
        self._gap_ns = ns_from_s(gap_s)
        self._queues: dict[Priority, deque[Item]] = {p: deque() for p in Priority}
        self._free_ns: int | None = None
        self.counters = PacingCounters()

    def __len__(self) -> int:
        return sum(map(len, self._queues.values()))

    def put(self, item: Item, priority: Priority) -> None:
        """Queue a message."""
        queue = self._queues[priority]
        if len(queue) >= CAPACITY[priority]:
            queue.popleft()
            self.counters.dropped[priority] += 1
        queue.append(item)
        self.counters.queued += 1

    def wait_ns(self, now_ns: int) -> int | None:
        """Time until a message may leave; None when none waits."""
        if not any(self._queues.values()):
            return None
        return 0 if self._free_ns is None else max(0, self._free_ns - now_ns)

    def first(self) -> Item | None:
        """Look at the message that is next."""
        return next((queue[0] for queue in self._queues.values() if queue), None)

    def take(self, now_ns: int) -> Item | None:
        """Give the message that may leave now, and start the gap."""
        if self.wait_ns(now_ns) != 0:
            return None
        queue = next(queue for queue in self._queues.values() if queue)
        # A late wake-up is made up for, so that the mean gap holds on a busy computer.
        due_ns = now_ns if self._free_ns is None else max(self._free_ns, now_ns - self._gap_ns)
        self._free_ns = max(due_ns + self._gap_ns, now_ns + ns_from_s(MIN_GAP_S))
        self.counters.released += 1
        return queue.popleft()
