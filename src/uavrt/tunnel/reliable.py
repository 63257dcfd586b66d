"""Delivery of pulses without loss over a link that loses, without I/O.

A ground station that acknowledges (`uavrt.tunnel.private`) gets every pulse: unacknowledged
ones are sent again. A plain one gets each pulse once. Pulses that do not fit in memory stay in
the flight's database, and are read again when there is room.

A message is lost when three later ones were acknowledged and the round trip has passed; or when
it is not acknowledged within the retransmission time-out of RFC 6298 with a floor of 0.4 s.

The oldest pulse goes first, while all leave within `LIVE_S`; with more to send the newest goes
first, for the display, and the backlog follows.

The content of a burst does not fit into its pulse message (`uavrt.tunnel.burst`). It goes to a
store that has acknowledged the pulse, and only with both is the pulse delivered. A ground
station of an older version never acknowledges the content; then the pulse alone counts, after
some tries.

A store is a number that anyone can make up. One that has acknowledged no pulse yet gets what
goes to all, and a few repetitions when nothing else waits; after its first acknowledgement it
gets all.
"""

import math
from bisect import bisect_left, insort
from collections import OrderedDict
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Generic, Literal, TypeVar

from uavrt.allowance import Allowance
from uavrt.messages import TunnelPayload
from uavrt.tunnel.private import payload_hash
from uavrt.tunnel.round_trips import FIRST_RTO_S, RoundTrips
from uavrt.tunnel.wire import PAYLOAD_TYPE
from uavrt.units import NANOSECONDS_PER_SECOND, ns_from_s

T = TypeVar("T")

WINDOW = 64
"""Most pulses on their way without an acknowledgement."""
PROBES, PROBE_NS = 4, ns_from_s(1.0)
"""Repetitions for stores that have acknowledged nothing yet, all of them together: at once, and
one more each second. At 40 % loss each way one of four is answered in five cases of six."""
MOST_PROBES = 64
"""Most pulses in memory for such stores only; the rest waits on disk."""
DONE = 256
"""Recently acknowledged pulses, which another store may acknowledge a little later."""
CAPACITY = 2048
"""Pulses in memory, about 4 MB; the rest waits on disk."""
DEAF_SENDS = 64
DEAF_NS = ns_from_s(10.0)
"""Messages, and time [ns], without any acknowledgement after which a store is ignored: it is
made up, or does not receive."""
NEW_STORES, NEW_STORES_PER_S = 4, 0.1
"""Allowance of receipts of new stores: at once, then each second."""
DEAF_AGAIN_NS = ns_from_s(60.0)
MOST_DEAF = 64
MOST_STORES = 8
"""Most ground stations that are sent all pulses; their numbers can be made up by anyone."""
REFILL_AT = 256
"""Number of pulses in memory below which those on disk are read."""
REORDERING = 3
BACKOFF = 1.5
MAX_BACKOFF = 4.0
LIVE_S = 2.0
STORE_SILENCE_NS = ns_from_s(10.0)
"""Silence after which a ground station is not waited for [ns]; its pulses are on disk."""
PLAIN_AFTER_NS = ns_from_s(3.0)
"""Time in which a ground station must acknowledge, else it gets each pulse once [ns]. Stations
acknowledge once a second: at 40 % loss 3 % do not manage, and get some twice."""
PLAIN = 0
"""Store number of all the ground stations that do not acknowledge."""
UNANSWERED_NS = ns_from_s(1.2)
"""Time without any acknowledgement after which another link is tried [ns]."""
ROUGH_BYTES = 137
"""Size of a pulse's frame, to estimate the time for the backlog."""
PATIENCE, SENDS_OF_PATIENCE = 8, 32
"""Times that the content of a burst is sent to a store that has acknowledged none; once, after
this many in all: at 40 % loss each way one of 32 is answered but in one case in a million."""

ItemKey = tuple[int, int]
"""Tag id and start time of a pulse."""
_EntryKey = ItemKey | tuple[int, int, int]
"""Key of a pulse; with a third number, of its content."""
Place = tuple[int, int]
"""A ground station: system and component id."""


@dataclass(slots=True, eq=False)
class _Entry(Generic[T]):
    key: _EntryKey
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


@dataclass(slots=True)
class _Store:
    place: Place
    heard_ns: int
    on_disk: bool = True
    """Whether pulses it lacks may be on disk and not in memory."""
    acknowledges: bool = False
    """Whether it has acknowledged a pulse, and so exists."""
    sends: int = 0
    """Messages sent to it without any acknowledgement."""
    since_ns: int = 0
    """Time at which it appeared [ns]."""
    reads_insides: bool = False
    """Whether it has acknowledged the content of a burst."""
    insides: int = 0
    """Number of such messages sent to it."""

    @property
    def patience(self) -> float:
        """Times that the content of a burst is sent to it."""
        if self.reads_insides:
            return math.inf
        return PATIENCE if self.insides < SENDS_OF_PATIENCE else 1

    def deaf(self, now_ns: int) -> bool:
        """Whether it was sent much for long, and has acknowledged nothing."""
        tried = self.sends >= DEAF_SENDS and now_ns - self.since_ns >= DEAF_NS
        return tried and not self.acknowledges


@dataclass(frozen=True, slots=True)
class _Done:
    """A pulse, or its content, that is no longer waited for."""

    pulse: ItemKey
    kept: set[int]
    """Stores that have it."""
    inside: bool
    has_inside: bool


class ReliableSender(Generic[T]):
    """Decides which pulse goes next.

    `encode`: payload of a pulse; called at each sending, since the generation may change.
    `inside`: payload of a pulse's content, None without any. `inside_type`: payload type of
    that.
    """

    def __init__(
        self,
        encode: Callable[[T], bytes],
        inside: Callable[[T], bytes | None] = lambda item: None,
        inside_type: int = PAYLOAD_TYPE,
    ) -> None:
        self._encode = encode
        self._inside, self._inside_type = inside, inside_type
        self._entries: dict[_EntryKey, _Entry[T]] = {}
        self._waiting: list[tuple[int, _EntryKey]] = []
        self._probes: OrderedDict[_EntryKey, _Entry[T]] = OrderedDict()
        """Pulses only for stores that may be made up."""
        self._probed_ns = -PROBES * PROBE_NS
        self._done: OrderedDict[int, _Done] = OrderedDict()
        """Finished pulses by their hashes."""
        self._sent: OrderedDict[_EntryKey, _Entry[T]] = OrderedDict()  # in order of sending
        self._by_hash: dict[int, _Entry[T]] = {}
        self._stores: dict[int, _Store] = {}
        self._order = 0
        self._station_since_ns: int | None = None
        self._plain_on_disk = False
        self.trips = RoundTrips()
        self.first_sends = 0
        self.repeats = 0
        self.acknowledged_pulses = 0
        self.fresh_trip_s: float | None = None
        """Round trip of the last receipt [s], if it showed one."""
        self._unanswered_since_ns: int | None = None
        self._sent_plain: list[ItemKey] = []
        self._settled: list[tuple[int, ItemKey]] = []
        self.insides_sent = 0
        """Messages with the content of bursts."""
        self._new_stores = Allowance(burst=NEW_STORES, per_s=NEW_STORES_PER_S)
        self._deaf: dict[int, int] = {}
        """When stores that acknowledged nothing were ignored."""
        self.stores_refused = 0
        """Receipts of stores beyond `MOST_STORES`."""
        self.put_back = 0
        """Pulses dropped from memory because it was full; they are on disk."""

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def in_flight(self) -> int:
        """Pulses sent and not yet acknowledged."""
        return len(self._sent)

    @property
    def waiting(self) -> int:
        """Pulses in memory that are to be sent."""
        return len(self._waiting)

    @property
    def stores(self) -> frozenset[int]:
        """The stores that are present."""
        return frozenset(self._stores)

    @property
    def proven(self) -> frozenset[int]:
        """The stores that have acknowledged a pulse, and so exist."""
        return frozenset(n for n, store in self._stores.items() if store.acknowledges)

    def keys(self, store: int) -> set[ItemKey]:
        """Pulses in memory that a store no longer needs, or gets from here.

        Others in memory may be for other stores alone, and must be read for this one, too. For
        `PLAIN` it is all of them.
        """
        return {
            entry.pulse
            for entry in self._entries.values()
            if store == PLAIN or store in entry.owed or store in entry.kept
        }

    def room(self, store: int) -> int:
        """Number of pulses from disk that may be added for a store."""
        known = self._stores.get(store)
        most = CAPACITY if known is None or known.acknowledges else MOST_PROBES
        return min(most, CAPACITY - len(self._entries))

    def add(self, key: ItemKey, item: T) -> None:
        """Add a pulse that is safe on disk; one that is here already is ignored."""
        if key not in self._entries:
            entry = _Entry(key, key[1], item, owed=set(self._stores))
            self._entries[key] = entry
            self._wait(entry)
            self._bound()

    def refill(self, store: int, items: Iterable[tuple[ItemKey, T]], *, more: bool) -> None:
        """Add pulses from disk that a store lacks.

        `store`: the store, or `PLAIN`. `items`: each (key, pulse); at most `CAPACITY` less what
        is here. `more`: whether there are others on disk.
        """
        for key, item in items:
            if key not in self._entries:
                owed = {store} & self._stores.keys()
                self._entries[key] = entry = _Entry(key, key[1], item, live=False, owed=owed)
                self._wait(entry)
            elif store in self._stores:
                self._entries[key].owed.add(store)
                self._wait_no_longer_as_probe(store)
        if more:
            self._ask_again(store)
        self._bound()

    def wanted(self) -> int | None:
        """A store whose pulses on disk there is room for; None when there is none."""
        if len(self._entries) >= REFILL_AT:
            return None
        for number, store in self._stores.items():
            if store.on_disk and (store.acknowledges or not self._probes):
                return number
        return PLAIN if self._plain_on_disk and not self._stores else None

    def reading(self, store: int) -> None:
        """Note that the disk is read for a store; `refill` follows."""
        if store == PLAIN:
            self._plain_on_disk = False
        elif store in self._stores:
            self._stores[store].on_disk = False

    def _ask_again(self, store: int) -> None:
        """Note that there is more on disk for a store, or for those that do not acknowledge."""
        if store == PLAIN:
            self._plain_on_disk = True
        elif store in self._stores:
            self._stores[store].on_disk = True

    def disk_has_news(self) -> None:
        """Note that pulses may be on disk that are not here: a flight was opened."""
        self._plain_on_disk = True
        for store in self._stores.values():
            store.on_disk = True

    def station_present(self, present: bool, now_ns: int) -> None:
        """Report whether any ground station's heartbeats come."""
        if not present:
            self._station_since_ns = None
        elif self._station_since_ns is None:
            self._station_since_ns = now_ns

    def unanswered(self, now_ns: int) -> bool:
        """Whether messages under way have been without any answer for too long."""
        since_ns = self._unanswered_since_ns
        return since_ns is not None and now_ns - since_ns > UNANSWERED_NS

    def link_changed(self) -> None:
        """Send the pulses under way again, by the new link."""
        self._unanswered_since_ns = None
        self.trips = RoundTrips()
        for entry in list(self._sent.values()):
            entry.tries = 0
            self._wait(entry)
        self._sent.clear()

    def receipt(
        self, store: int, hashes: Iterable[int], place: Place, now_ns: int
    ) -> list[ItemKey]:
        """Handle a receipt; return the pulses that are new in that store."""
        known = self._stores.get(store)
        if known is None and not self._believes_in(store, now_ns):
            self.stores_refused += 1
            return []
        if known is None:
            self._stores[store] = _Store(place, now_ns, since_ns=now_ns)
            for entry in self._entries.values():
                if store not in entry.kept and entry.inside is None:
                    entry.owed.add(store)
        else:
            known.place, known.heard_ns = place, now_ns
        self.fresh_trip_s = None
        new: list[ItemKey] = []
        orders: list[int] = []
        for number in hashes:
            entry_or_none = self._by_hash.get(number)
            if entry_or_none is None or store in entry_or_none.kept:
                new += self._late_word(number, store)
                continue
            entry = entry_or_none
            self._trust(store)
            if entry.inside is not None and store not in entry.owed:
                continue  # overheard: it has not acknowledged the pulse
            entry.kept.add(store)
            entry.owed.discard(store)
            if entry.inside is not None:
                self._stores[store].reads_insides = True
            if entry.inside is not None or not self._add_inside(entry, store):
                new.append(entry.pulse)
            if entry.sends == 1 and entry.state == "sent":
                self.fresh_trip_s = (now_ns - entry.sent_ns) / NANOSECONDS_PER_SECOND
                self.trips.add(self.fresh_trip_s)
            if entry.state == "sent":
                orders.append(entry.order)
            if not self._waits_for_anyone(entry):
                self._forget(entry)
                self.acknowledged_pulses += entry.inside is None
        if orders:
            self._unanswered_since_ns = now_ns if self._sent else None
        self._overtake(orders, now_ns)
        return new

    def _late_word(self, number: int, store: int) -> list[ItemKey]:
        """Handle a store's acknowledgement of a pulse that is no longer waited for."""
        done = self._done.get(number)
        if done is None or store in done.kept:
            return []
        done.kept.add(store)
        self._trust(store)
        if done.inside:
            self._stores[store].reads_insides = True
        if done.inside or done.has_inside:
            self._stores[store].on_disk = True  # both come again, unless it has both
            return []
        return [done.pulse]

    def _add_inside(self, entry: _Entry[T], store: int) -> bool:
        """Queue the content for a store that has the pulse; False without any."""
        payload = self._inside(entry.item)
        if payload is None:
            return False
        key = (*entry.pulse, 1)
        inside = self._entries.get(key)
        if inside is None:
            inside = _Entry(key, entry.time_ns, entry.item, inside=payload, live=False)
            self._entries[key] = inside
            inside.owed.add(store)
            self._wait(inside)
        inside.owed.add(store)
        return True

    def settled(self) -> list[tuple[int, ItemKey]]:
        """Stores that do not read contents, with their pulses, since the last call."""
        settled, self._settled = self._settled, []
        return settled

    def _trust(self, number: int) -> None:
        """Note that a store has acknowledged a pulse, and so exists."""
        if not self._stores[number].acknowledges:
            self._stores[number].acknowledges = True
            self._wait_no_longer_as_probe(number)

    def _wait_no_longer_as_probe(self, number: int) -> None:
        if self._stores[number].acknowledges:
            for entry in [e for e in self._probes.values() if number in e.owed]:
                del self._probes[entry.key]
                self._wait(entry)

    def _is_trusted(self, entry: _Entry[T]) -> bool:
        """Whether a store that exists lacks a pulse."""
        return any(self._stores[number].acknowledges for number in entry.owed)

    def _waits_for_anyone(self, entry: _Entry[T]) -> bool:
        """Whether a pulse that one store has must go again for another.

        Not for one that has acknowledged nothing: it may be made up, and must not fill the
        window. If it exists, it gets missing pulses from the disk.
        """
        if self._is_trusted(entry):
            return True
        for number in entry.owed:
            self._stores[number].on_disk = True
        return False

    def _room_for_store(self) -> bool:
        """Make room for another store; False when all have acknowledged something."""
        if len(self._stores) < MOST_STORES:
            return True
        idle = [n for n, store in self._stores.items() if not store.acknowledges]
        if idle:
            self._drop_store(min(idle, key=lambda number: self._stores[number].heard_ns))
        return bool(idle)

    def wait_ns(self, now_ns: int) -> int | None:
        """Time until a pulse may go [ns]; None when nothing is to go."""
        if self._station_since_ns is None:
            return None
        self._drop_silent_stores(now_ns)
        if self._waiting and len(self._sent) < WINDOW:
            grace_ns = self._station_since_ns + PLAIN_AFTER_NS - now_ns
            return 0 if self._stores else max(0, grace_ns)
        due_ns = [self._deadline_ns(entry) for entry in self._sent.values()]
        if self._probes:
            due_ns.append(self._probe_due_ns(now_ns))
        return max(0, min(due_ns) - now_ns) if due_ns else None

    def _probe_due_ns(self, now_ns: int) -> int:
        """When a pulse may next go to stores that may not exist."""
        return max(self._probed_ns, now_ns - PROBES * PROBE_NS) + PROBE_NS

    def take(self, now_ns: int, rate_bytes_s: float) -> TunnelPayload | None:
        """Return the payload that goes now, by the link's rate."""
        self._expire(now_ns)
        entry = self._next(now_ns, rate_bytes_s) if self.wait_ns(now_ns) == 0 else None
        if entry is None:
            return None
        payload = self._encode(entry.item) if entry.inside is None else entry.inside
        entry.sends += 1
        entry.tries += not entry.twin
        self._count(entry)
        place = None
        if (entry.sends > 1 or entry.inside is not None) and len(entry.owed) == 1:
            place = self._stores[next(iter(entry.owed))].place
        if entry.owed:
            self._note_sent(entry, payload, now_ns)
            self._add_twin(entry)
        else:
            self._forget(entry)
            self._sent_plain.append(entry.pulse)
        return TunnelPayload(
            payload, place, PAYLOAD_TYPE if entry.inside is None else self._inside_type
        )

    def _count(self, entry: _Entry[T]) -> None:
        """Count a message that goes."""
        for number in entry.owed:
            self._stores[number].sends += 1
            self._stores[number].insides += entry.inside is not None
        if entry.inside is not None:
            self.insides_sent += 1
        elif entry.sends == 1:
            self.first_sends += 1
        else:
            self.repeats += 1

    def _next(self, now_ns: int, rate_bytes_s: float) -> _Entry[T] | None:
        """Choose the pulse that goes, and remove it from the queue."""
        if self._waiting:
            backlog_s = len(self._waiting) * ROUGH_BYTES / rate_bytes_s
            _, key = self._waiting.pop(-1 if backlog_s > LIVE_S else 0)
            return self._entries[key]
        due_ns = self._probe_due_ns(now_ns)
        if not self._probes or due_ns > now_ns:
            return None
        self._probed_ns = due_ns
        return self._probes.pop(min(self._probes, key=lambda key: key[1]))

    def _add_twin(self, entry: _Entry[T]) -> None:
        """Send a repetition twice while nothing else waits.

        With few pulses under way each loss costs a time-out. At 20 % loss 4 % of the pulses
        would need a second one, with twins 0.8 %; the link is idle anyhow.
        """
        again = entry.sends > 1 and not entry.twin and self._is_trusted(entry)
        entry.twin = again and not self._waiting
        if entry.twin:
            del self._sent[entry.key]
            self._wait(entry)

    def sent_plain(self) -> list[ItemKey]:
        """Pulses sent, since the last call, to plain ground stations only: done."""
        done, self._sent_plain = self._sent_plain, []
        return done

    def _note_sent(self, entry: _Entry[T], payload: bytes, now_ns: int) -> None:
        self._order += 1
        if self._unanswered_since_ns is None and (self._is_trusted(entry) or not self.proven):
            self._unanswered_since_ns = now_ns
        entry.state, entry.sent_ns, entry.order = "sent", now_ns, self._order
        entry.overtaken = 0
        self._sent[entry.key] = entry
        number = payload_hash(payload)
        if number not in entry.hashes:
            entry.hashes.append(number)
            self._by_hash[number] = entry

    def _deadline_ns(self, entry: _Entry[T]) -> int:
        """Time at which a pulse under way counts as lost [ns]; later with each try."""
        backoff = min(MAX_BACKOFF, BACKOFF ** (entry.tries - 1))
        return entry.sent_ns + ns_from_s(self.trips.timeout_s * backoff)

    def _expire(self, now_ns: int) -> None:
        """Queue again what was not acknowledged in time."""
        late = [e for e in self._sent.values() if self._deadline_ns(e) <= now_ns]
        for entry in late:
            if entry.kept and not self._waits_for_anyone(entry):
                self._forget(entry)
                continue
            self._again(entry)

    def _again(self, entry: _Entry[T]) -> None:
        """Queue lost pulses again, but no content that no store reads."""
        if entry.inside is not None:
            for number in list(entry.owed):
                if entry.tries >= self._stores[number].patience:
                    entry.owed.discard(number)
                    self._settled.append((number, entry.pulse))
            if not entry.owed:
                self._forget(entry)
                return
        del self._sent[entry.key]
        self._wait(entry)

    def _overtake(self, orders: list[int], now_ns: int) -> None:
        """Count for each message on its way how many later ones have arrived."""
        if not orders:
            return
        orders.sort()
        trip_ns = ns_from_s(self.trips.smoothed_s or FIRST_RTO_S)
        lost = []
        for entry in self._sent.values():
            entry.overtaken += len(orders) - bisect_left(orders, entry.order)
            if entry.overtaken >= REORDERING and now_ns - entry.sent_ns > trip_ns:
                lost.append(entry)
        for entry in lost:
            self._again(entry)

    def _drop_silent_stores(self, now_ns: int) -> None:
        silent = [
            number
            for number, store in self._stores.items()
            if now_ns - store.heard_ns > STORE_SILENCE_NS or store.deaf(now_ns)
        ]
        if silent:
            self._unanswered_since_ns = None
        for number in silent:
            self._drop_store(number, now_ns)

    def _believes_in(self, number: int, now_ns: int) -> bool:
        """Whether to accept a new store: anyone can make up a number."""
        deaf_ns = self._deaf.get(number)
        if deaf_ns is not None and now_ns - deaf_ns < DEAF_AGAIN_NS:
            return False
        return self._new_stores.take(now_ns) and self._room_for_store()

    def _drop_store(self, number: int, now_ns: int | None = None) -> None:
        if now_ns is not None and self._stores[number].deaf(now_ns):
            self._deaf[number] = now_ns
            while len(self._deaf) > MOST_DEAF:
                del self._deaf[next(iter(self._deaf))]
        made_up = not self._stores.pop(number).acknowledges
        for entry in list(self._entries.values()):
            entry.owed.discard(number)
            if entry.owed:
                continue
            if entry.inside is not None:
                self._forget(entry)  # when the store is back, the disk has it
            elif entry.kept or (made_up and (entry.sends or not entry.live)):
                self._give_up(entry)
            elif entry.state == "sent" or entry.key in self._probes:
                self._sent.pop(entry.key, None)
                self._probes.pop(entry.key, None)
                self._wait(entry)

    def _give_up(self, entry: _Entry[T]) -> None:
        """Leave a pulse to the disk; plain stations have been sent it."""
        for number in entry.owed:
            self._stores[number].on_disk = True
        if entry.live and entry.sends and not entry.kept:
            self._sent_plain.append(entry.pulse)
        self._forget(entry)

    def _wait(self, entry: _Entry[T]) -> None:
        """Queue a pulse, behind all others if it is only for stores that may not exist."""
        entry.state = "waiting"
        new = entry.live and not entry.sends
        if new or not entry.owed or self._is_trusted(entry):
            insort(self._waiting, (entry.time_ns, entry.key))
            return
        self._probes[entry.key] = entry
        if len(self._probes) > MOST_PROBES:
            self._give_up(next(iter(self._probes.values())))

    def _forget(self, entry: _Entry[T]) -> None:
        if entry.state == "sent":
            self._sent.pop(entry.key, None)
        elif self._probes.pop(entry.key, None) is None:
            place = bisect_left(self._waiting, (entry.time_ns, entry.key))
            if place < len(self._waiting) and self._waiting[place][1] == entry.key:
                del self._waiting[place]
        is_inside = entry.inside is not None
        has_inside = not is_inside and self._inside(entry.item) is not None
        for number in entry.hashes:
            self._by_hash.pop(number, None)
            self._done[number] = _Done(entry.pulse, entry.kept, is_inside, has_inside)
        while len(self._done) > DONE:
            self._done.popitem(last=False)
        del self._entries[entry.key]

    def _bound(self) -> None:
        """Return the oldest to the disk; they are read again when there is room."""
        while len(self._entries) > CAPACITY and self._waiting:
            entry = self._entries[self._waiting[0][1]]
            for number in entry.owed:
                self._stores[number].on_disk = True
            self._plain_on_disk = self._plain_on_disk or not entry.owed
            self._forget(entry)
            self.put_back += 1
