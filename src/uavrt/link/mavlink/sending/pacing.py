"""Decide when each message to the ground is sent: no faster than the autopilot forwards and the
radio transmits.

PX4 buffers forwarded messages in a ring of 583 bytes, which holds three tunnel messages. It
forwards one message per pass of its main loop and drops the excess without a report. Messages
for the ground are therefore sent one at a time, separated by a gap.

Urgent messages are queued here. Pulses and files stay with their sources until there is room to
send the next one.
"""

from collections import deque
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Protocol

from uavrt.core.errors import ConfigError
from uavrt.core.messages import TunnelPayload
from uavrt.core.units import ns_from_s
from uavrt.link.mavlink.message import Message
from uavrt.link.mavlink.sending.rate import FRAME_OVERHEAD, LinkRate

MIN_GAP_S = 0.012
"""Shortest time between frames that an autopilot forwards [s]; PX4's main loop at ``-r 1200``
takes 8.33 ms."""
DIRECT_LINK_GAP_S = 0.001
"""Shortest time between frames on a direct link [s]; without it, bursts of 200 frames overran a
socket."""
HEADER_BYTES = 12


class Priority(IntEnum):
    """Sending priority of a message; the lowest number is sent first."""

    ACK = 0
    STATUS = 1
    PULSE = 2
    VALUE = 3
    OTHER = 4
    """Answers to stations that do not command the drone."""
    FILE = 5


CAPACITY = {Priority.ACK: 64, Priority.STATUS: 64, Priority.OTHER: 32}
"""Largest number of queued messages of each priority."""
URGENT = (Priority.ACK, Priority.STATUS)
ROOM_BYTES = {Priority.VALUE: 45, Priority.OTHER: 160, Priority.FILE: 280}
"""Number of bytes that a low-priority message must leave in the rate limiter's token bucket, so
that a pulse can follow at once. It equals the longest low-priority frame."""
OTHER_WAIT_NS = ns_from_s(2.0)
"""Longest time that pulses delay an answer to a station that does not command the drone [ns].
"""


Item = TunnelPayload | Message


class Source(Protocol):
    """Protocol of a message source, which stores messages and returns one at a time."""

    def wait_ns(self, now_ns: int) -> int | None:
        """Time until the source has a message to send [ns]; None without any."""

    def take(self, now_ns: int, rate_bytes_s: float) -> Item | None:
        """Return the next message to send; `rate_bytes_s` is the present rate of the link."""


@dataclass(slots=True)
class PacingCounters:
    """Counts of the messages that a paced queue has sent and dropped."""

    released: int = 0
    dropped: dict[Priority, int] = field(default_factory=lambda: dict.fromkeys(CAPACITY, 0))


class PacedQueue:
    """Sends messages from bounded priority queues and from sources, one per gap of 12 ms or
    more.

    A full queue drops its oldest message and counts it: an old status is useless, and a lost
    acknowledgement is requested again.
    """

    def __init__(
        self, gap_s: float = 0.020, rate: LinkRate | None = None, *, straight: bool = False
    ) -> None:
        floor_s = DIRECT_LINK_GAP_S if straight else MIN_GAP_S
        if not gap_s >= floor_s:
            raise ConfigError(
                f"tunnel_gap_s = {gap_s} is so short that the autopilot would lose messages",
                remedy=f"Set it to {floor_s} or more; 0.020 is the default",
            )
        self._gap_ns = ns_from_s(gap_s)
        self._floor_ns = ns_from_s(floor_s)
        self._queues: dict[Priority, deque[Item]] = {p: deque() for p in CAPACITY}
        self._sources: dict[Priority, Source] = {}
        self._free_ns: int | None = None
        self._other_since_ns: int | None = None
        self.rate = rate or LinkRate()
        self.frame_extra_bytes = 0
        """Number of bytes added to each frame, such as the 13 of a signature."""
        self.counters = PacingCounters()

    def __len__(self) -> int:
        return sum(map(len, self._queues.values()))

    def add_source(self, source: Source, priority: Priority) -> None:
        """Send the messages of `source` with the given priority."""
        self._sources[priority] = source
        self._sources = dict(sorted(self._sources.items()))

    def put(self, item: Item, priority: Priority) -> None:
        """Queue an `ACK`, `STATUS` or `OTHER` message; a full queue drops its oldest."""
        queue = self._queues[priority]
        if len(queue) >= CAPACITY[priority]:
            queue.popleft()
            self.counters.dropped[priority] += 1
        queue.append(item)

    def wait_ns(self, now_ns: int) -> int | None:
        """Time until a message may be sent [ns]; None when none waits."""
        gap_ns = 0 if self._free_ns is None else max(0, self._free_ns - now_ns)
        if self._urgent(now_ns) is not None:
            return gap_ns
        waits = {p: w for p, s in self._sources.items() if (w := s.wait_ns(now_ns)) is not None}
        if self._queues[Priority.OTHER]:
            waits[Priority.OTHER] = 0
        if not waits:
            return None
        ready = [priority for priority, wait in waits.items() if wait == 0]
        if not ready:
            return max(gap_ns, min(waits.values()))
        return max(gap_ns, self.rate.wait_ns(now_ns, ROOM_BYTES.get(min(ready), 0)))

    def _urgent(self, now_ns: int) -> deque[Item] | None:
        """Return the queue whose message may exceed the rate limit; None if there is none."""
        other = self._queues[Priority.OTHER]
        if not other:
            self._other_since_ns = None
        elif self._other_since_ns is None:
            self._other_since_ns = now_ns
        elif now_ns - self._other_since_ns >= OTHER_WAIT_NS:
            return other
        return next((self._queues[p] for p in URGENT if self._queues[p]), None)

    def take(self, now_ns: int) -> Item | None:
        """Return the message to send now and start the gap before the next one."""
        if self.wait_ns(now_ns) != 0:
            return None
        queue = self._urgent(now_ns)
        item = self._from_sources(now_ns) if queue is None else queue.popleft()
        if item is None:
            return None
        if queue is self._queues[Priority.OTHER]:
            self._other_since_ns = None
        # Catch up after a late wake-up, so that the mean gap holds on a busy computer.
        due_ns = now_ns if self._free_ns is None else max(self._free_ns, now_ns - self._gap_ns)
        self._free_ns = max(due_ns + self._gap_ns, now_ns + self._floor_ns)
        self.counters.released += 1
        self.rate.spend(_size(item) + self.frame_extra_bytes, now_ns)
        return item

    def _from_sources(self, now_ns: int) -> Item | None:
        other = self._queues[Priority.OTHER]
        for priority in sorted((*self._sources, Priority.OTHER)):
            if priority is Priority.OTHER:
                if other:
                    self._other_since_ns = None
                    return other.popleft()
                continue
            source = self._sources[priority]
            if source.wait_ns(now_ns) != 0:
                continue
            given = source.take(now_ns, self.rate.bytes_s(now_ns))
            if given is not None:
                return given
        return None


def _size(item: Item) -> int:
    """Size of a message's unsigned frame [bytes]."""
    if isinstance(item, TunnelPayload):
        return FRAME_OVERHEAD + len(item.payload)
    return HEADER_BYTES + len(item.pack().rstrip(b"\0"))
