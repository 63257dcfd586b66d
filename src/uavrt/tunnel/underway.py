"""Messages with pulses that were sent and are not yet acknowledged."""

import math
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Generic, Literal, TypeVar

from uavrt.tunnel.round_trips import FIRST_RTO_S, RoundTrips
from uavrt.units import NANOSECONDS_PER_SECOND, ns_from_s

T = TypeVar("T")

UNANSWERED_NS = ns_from_s(1.2)
"""Time without any acknowledgement after which another link is tried [ns]."""
REORDERING = 3
BACKOFF = 1.5
MAX_BACKOFF = 4.0
DONE = 256
"""Recently acknowledged pulses, which another store may acknowledge a little later."""

ItemKey = tuple[int, int]
"""Tag id and start time of a pulse."""
EntryKey = ItemKey | tuple[int, int, int]
"""Key of a pulse; with a third number, of its content."""


@dataclass(slots=True, eq=False)
class Entry(Generic[T]):
    """A pulse in memory, or its content."""

    key: EntryKey
    time_ns: int
    item: T
    inside: bytes | None = None
    """Payload of a pulse's content, if it is that."""
    live: bool = True
    """Whether it is new, and goes to all; else it comes from disk, for one store."""
    state: Literal["waiting", "sent"] = "waiting"
    sent_ns: int = 0
    order: int = 0
    overtaken: int = 0
    sends: int = 0
    tries: int = 0
    """Number of sendings, twins counted once."""
    twin: bool = False
    """Whether the second of two copies waits."""
    owed: set[int] = field(default_factory=set)
    """Stores that are present and do not have it."""
    kept: set[int] = field(default_factory=set)
    """Stores that acknowledged it."""
    hashes: list[int] = field(default_factory=list)

    @property
    def pulse(self) -> ItemKey:
        """Key of the pulse that it is, or belongs to."""
        return self.key[0], self.key[1]


class Underway(Generic[T]):
    """Messages under way in the order of sending, and when each counts as lost."""

    def __init__(self) -> None:
        self._sent: OrderedDict[EntryKey, Entry[T]] = OrderedDict()
        self._by_hash: dict[int, Entry[T]] = {}
        self._done: OrderedDict[int, Entry[T]] = OrderedDict()
        """Finished pulses by their hashes."""
        self._order = 0
        self._trips = RoundTrips()
        self._unanswered_since_ns: int | None = None
        self.fresh_trip_s: float | None = None
        """Round trip of the last receipt [s], if it showed one."""

    def __len__(self) -> int:
        return len(self._sent)

    def add(self, entry: Entry[T], number: int, now_ns: int, *, awaited: bool) -> None:
        """Add a message that goes now.

        `number`: its hash. `awaited`: whether an answer is expected.
        """
        self._order += 1
        if self._unanswered_since_ns is None and awaited:
            self._unanswered_since_ns = now_ns
        entry.state, entry.sent_ns, entry.order = "sent", now_ns, self._order
        entry.overtaken = 0
        self._sent[entry.key] = entry
        if number not in entry.hashes:
            entry.hashes.append(number)
            self._by_hash[number] = entry

    def by_hash(self, number: int) -> Entry[T] | None:
        """The pulse in memory that a receipt names."""
        return self._by_hash.get(number)

    def finished(self, number: int) -> Entry[T] | None:
        """The pulse that a receipt names, if it was finished recently."""
        return self._done.get(number)

    def remove(self, entry: Entry[T]) -> None:
        """Remove a message, if it is under way."""
        self._sent.pop(entry.key, None)

    def finish(self, entry: Entry[T]) -> None:
        """Note that a pulse is no longer waited for."""
        self.remove(entry)
        for number in entry.hashes:
            self._by_hash.pop(number, None)
            self._done[number] = entry
        while len(self._done) > DONE:
            self._done.popitem(last=False)

    def restart(self) -> list[Entry[T]]:
        """Remove and return all messages: the link changed."""
        self._unanswered_since_ns = None
        self._trips = RoundTrips()
        sent = list(self._sent.values())
        self._sent.clear()
        return sent

    def _deadline_ns(self, entry: Entry[T]) -> int:
        """Time at which a message counts as lost [ns]; later with each try."""
        backoff = min(MAX_BACKOFF, BACKOFF ** (entry.tries - 1))
        return entry.sent_ns + ns_from_s(self._trips.timeout_s * backoff)

    def next_deadline_ns(self) -> float:
        """Time at which the first message counts as lost [ns]; infinite without any."""
        return min(map(self._deadline_ns, self._sent.values()), default=math.inf)

    def late(self, now_ns: int) -> list[Entry[T]]:
        """Messages that were not acknowledged in time."""
        return [e for e in self._sent.values() if self._deadline_ns(e) <= now_ns]

    def acknowledged(self, entries: Iterable[Entry[T]], now_ns: int) -> list[Entry[T]]:
        """Handle a receipt's pulses: measure round trips; return messages that are lost."""
        arrived = [entry for entry in entries if entry.state == "sent"]
        self.fresh_trip_s = None
        for entry in arrived:
            if entry.sends == 1:
                self.fresh_trip_s = (now_ns - entry.sent_ns) / NANOSECONDS_PER_SECOND
                self._trips.add(self.fresh_trip_s)
        if not arrived:
            return []
        self._unanswered_since_ns = now_ns if self._sent else None
        orders = sorted(entry.order for entry in arrived)
        trip_ns = ns_from_s(self._trips.smoothed_s or FIRST_RTO_S)
        lost = []
        for entry in self._sent.values():
            entry.overtaken += len(orders) - bisect_left(orders, entry.order)
            if entry.overtaken >= REORDERING and now_ns - entry.sent_ns > trip_ns:
                lost.append(entry)
        return lost

    def unanswered(self, now_ns: int) -> bool:
        """Whether messages under way have been without any answer for too long."""
        since_ns = self._unanswered_since_ns
        return since_ns is not None and now_ns - since_ns > UNANSWERED_NS

    def expect_no_answer(self) -> None:
        """Wait for no answer to what is under way: a station is gone."""
        self._unanswered_since_ns = None
