"""Track the pulse messages that were sent and wait for an acknowledgement."""

import math
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Generic, Literal, TypeVar

from uavrt.core.newest import Newest
from uavrt.core.units import NANOSECONDS_PER_SECOND, ns_from_s

T = TypeVar("T")

FIRST_RTO_S = 1.0
MIN_RTO_S = 0.4
UNANSWERED_NS = ns_from_s(1.2)
"""Time without any acknowledgement after which another link is tried [ns]."""
REORDERING = 3
BACKOFF = 1.5
MAX_BACKOFF = 4.0
DONE = 256
"""Number of acknowledged pulses that are remembered, since another station may acknowledge them
later."""

ItemKey = tuple[int, int]
"""Tag id and start time [ns, UTC] of a pulse."""
EntryKey = ItemKey | tuple[int, int, int]
"""Key of a message in memory: tag id and start time of a pulse, and a third number if the
message holds a burst's single pulses."""


class RoundTrips:
    """Smoothed round trip and retransmission time-out, by RFC 6298."""

    def __init__(self) -> None:
        self.smoothed_s: float | None = None
        self._variation_s = 0.0

    def add(self, trip_s: float) -> None:
        """Add the round trip of a message that was sent once [s]."""
        if self.smoothed_s is None:
            self.smoothed_s, self._variation_s = trip_s, trip_s / 2
        else:
            self._variation_s += (abs(trip_s - self.smoothed_s) - self._variation_s) / 4
            self.smoothed_s += (trip_s - self.smoothed_s) / 8

    @property
    def timeout_s(self) -> float:
        """Time after which a message without acknowledgement counts as lost [s]."""
        if self.smoothed_s is None:
            return FIRST_RTO_S
        return max(MIN_RTO_S, self.smoothed_s + 4 * self._variation_s)


@dataclass(slots=True, eq=False)
class Entry(Generic[T]):
    """A message in memory: a pulse, or a burst's single pulses."""

    key: EntryKey
    time_ns: int
    item: T
    inside: bytes | None = None
    """Payload with a burst's single pulses; None for a pulse message."""
    live: bool = True
    """True for a new pulse, which all stations get; False for a pulse that was read from disk
    for one station."""
    state: Literal["waiting", "sent"] = "waiting"
    sent_ns: int = 0
    order: int = 0
    overtaken: int = 0
    sends: int = 0
    tries: int = 0
    """Number of times the message was sent; two copies sent together count once."""
    twin: bool = False
    """True while the second of two copies waits to be sent."""
    missing_at: set[int] = field(default_factory=set)
    """Numbers of present ground stations that have not acknowledged this entry."""
    stored_at: set[int] = field(default_factory=set)
    """Numbers of ground stations that have acknowledged this entry."""
    hashes: list[int] = field(default_factory=list)

    @property
    def pulse(self) -> ItemKey:
        """Key of the pulse, also for a burst's single pulses."""
        return self.key[0], self.key[1]


class UnacknowledgedMessages(Generic[T]):
    """Sent messages without an acknowledgement, in the order of sending."""

    def __init__(self) -> None:
        self._sent: OrderedDict[EntryKey, Entry[T]] = OrderedDict()
        self._by_hash: dict[int, Entry[T]] = {}
        self._done: Newest[int, Entry[T]] = Newest(DONE)
        """Pulses acknowledged or given up, by the hashes of their payloads."""
        self._order = 0
        self._trips = RoundTrips()
        self._unanswered_since_ns: int | None = None
        self.fresh_trip_s: float | None = None
        """Round trip measured by the last receipt [s]; None if it measured none."""

    def __len__(self) -> int:
        return len(self._sent)

    def add(self, entry: Entry[T], number: int, now_ns: int, *, awaited: bool) -> None:
        """Add a message sent now, by its payload's hash; `awaited`: an answer is expected."""
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
        """Unfinished pulse with a given payload hash; None if there is none."""
        return self._by_hash.get(number)

    def finished(self, number: int) -> Entry[T] | None:
        """Recently acknowledged or abandoned pulse with a payload hash, or None."""
        return self._done.get(number)

    def remove(self, entry: Entry[T]) -> None:
        """Remove a message, if it is present."""
        self._sent.pop(entry.key, None)

    def finish(self, entry: Entry[T]) -> None:
        """Remove a pulse for which no more acknowledgements are expected."""
        self.remove(entry)
        for number in entry.hashes:
            self._by_hash.pop(number, None)
            self._done[number] = entry

    def restart(self) -> list[Entry[T]]:
        """Remove and return all messages, because another link is used."""
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
        """Time at which the next message counts as lost [ns]; infinite without any."""
        return min(map(self._deadline_ns, self._sent.values()), default=math.inf)

    def late(self, now_ns: int) -> list[Entry[T]]:
        """Return the messages that were not acknowledged in time."""
        return [e for e in self._sent.values() if self._deadline_ns(e) <= now_ns]

    def acknowledged(self, entries: Iterable[Entry[T]], now_ns: int) -> list[Entry[T]]:
        """Process acknowledged messages: measure round-trip times. Return the messages that
        count as lost, because several later ones were acknowledged.
        """
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
        """True if no sent message was acknowledged for too long a time."""
        since_ns = self._unanswered_since_ns
        return since_ns is not None and now_ns - since_ns > UNANSWERED_NS

    def expect_no_answer(self) -> None:
        """Stop waiting for acknowledgements of sent messages, because a station is gone."""
        self._unanswered_since_ns = None
