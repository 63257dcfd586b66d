"""Keep pulses that wait to be sent in memory, and decide the order of sending.

Pulses that do not fit into memory stay in the flight's database and are read later. If all
pulses can be sent within `LIVE_S`, the oldest is sent first. With more, the newest is sent
first, for the display, and the backlog follows. Pulses for stations that have never
acknowledged one are sent last, as probes.
"""

import math
from bisect import bisect_left, insort
from collections import OrderedDict
from collections.abc import Callable, Iterable
from typing import Generic

from uavrt.core.units import ns_from_s
from uavrt.link.tunnel.pulses.receiving_stations import PLAIN, Stores
from uavrt.link.tunnel.pulses.underway import (
    Entry,
    EntryKey,
    ItemKey,
    T,
    UnacknowledgedMessages,
)

PROBES, PROBE_NS = 4, ns_from_s(1.0)
"""Largest number of probes at once; time to the next [ns]. A probe repeats a pulse for stations
that never acknowledged. At 40 % loss each way, one of four is answered in five cases of six."""
MOST_PROBES = 64
"""Largest number of pulses in memory only for stations that never acknowledged one."""
CAPACITY = 2048
"""Largest number of pulses in memory, about 4 MB; further pulses stay on disk."""
REFILL_AT = 256
"""Number of pulses in memory below which more pulses are read from disk."""
LIVE_S = 2.0
ROUGH_BYTES = 137
"""Approximate frame size of a pulse [bytes], used to estimate how long the backlog takes."""


class PulseMemory(Generic[T]):
    """Pulses that wait to be sent or acknowledged; `inside` encodes a burst's single pulses."""

    def __init__(self, inside: Callable[[T], bytes | None], stores: Stores) -> None:
        self.inside, self._stores = inside, stores
        self._entries: dict[EntryKey, Entry[T]] = {}
        self._waiting: list[tuple[int, EntryKey]] = []
        self._probes: OrderedDict[EntryKey, Entry[T]] = OrderedDict()
        """Pulses that only ground stations without any acknowledgement so far still lack."""
        self._probed_ns = -PROBES * PROBE_NS
        self._sent_plain: list[ItemKey] = []
        self.underway: UnacknowledgedMessages[T] = UnacknowledgedMessages()
        self.put_back = 0
        """Number of pulses removed from a full memory; they are read from disk later."""

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def waiting(self) -> int:
        """Number of pulses in memory that wait for sending."""
        return len(self._waiting)

    def keys(self, store: int) -> set[ItemKey]:
        """Keys of pulses in memory that a ground station lacks or has acknowledged.

        They need not be read from disk for it. A pulse that is in memory only for other
        stations is left out, so that it is read for this one. With `PLAIN`: all keys.
        """
        return {
            entry.pulse
            for entry in self._entries.values()
            if store == PLAIN or store in entry.missing_at or store in entry.stored_at
        }

    def room(self, store: int) -> int:
        """Number of pulses that may now be read from disk for a ground station."""
        unconfirmed = store in self._stores and not self._stores[store].acknowledges
        return min(MOST_PROBES if unconfirmed else CAPACITY, CAPACITY - len(self._entries))

    def wanted(self) -> int | None:
        """Return the station for which to read pulses from disk now; None if there is none."""
        if len(self._entries) >= REFILL_AT:
            return None
        return self._stores.on_disk(unconfirmed=not self._probes)

    def add(self, key: ItemKey, item: T) -> None:
        """Add a new pulse that is recorded on disk; one already in memory is ignored."""
        if key not in self._entries:
            self._enter(Entry(key, key[1], item, missing_at=set(self._stores.present)))
            self._bound()

    def refill(self, store: int, items: Iterable[tuple[ItemKey, T]], *, more: bool) -> None:
        """Add pulses from disk that a ground station lacks; `more`: True if further remain."""
        for key, item in items:
            if key not in self._entries:
                missing_at = {store} & self._stores.present
                self._enter(Entry(key, key[1], item, live=False, missing_at=missing_at))
            elif store in self._stores:
                self._entries[key].missing_at.add(store)
                self.promote_probes(store)
        if more:
            self._stores.note_on_disk(store)
        self._bound()

    def add_inside(self, entry: Entry[T], store: int) -> bool:
        """Queue a burst's single pulses for a station that has the burst; False without any."""
        payload = self.inside(entry.item)
        if payload is None:
            return False
        key = (*entry.pulse, 1)
        if key in self._entries:
            self._entries[key].missing_at.add(store)
        else:
            content = Entry(key, entry.time_ns, entry.item, payload, live=False)
            content.missing_at.add(store)
            self._enter(content)
        return True

    def _enter(self, entry: Entry[T]) -> None:
        self._entries[entry.key] = entry
        self.wait(entry)

    def send_all(self, store: int) -> None:
        """Mark all pulses in memory as not yet received by a new ground station."""
        for entry in self._entries.values():
            if store not in entry.stored_at and entry.inside is None:
                entry.missing_at.add(store)

    def send_none(self, store: int, *, acknowledges: bool) -> None:
        """Send nothing more to a removed station; `acknowledges`: it acknowledged pulses."""
        for entry in list(self._entries.values()):
            entry.missing_at.discard(store)
            if entry.missing_at:
                continue
            if entry.inside is not None:
                self.forget(entry)  # when the store is back, the disk has it
            elif entry.stored_at or (not acknowledges and (entry.sends or not entry.live)):
                self._give_up(entry)
            elif entry.state == "sent" or entry.key in self._probes:
                self._probes.pop(entry.key, None)
                self.wait(entry)

    def wait(self, entry: Entry[T]) -> None:
        """Queue a pulse; as a probe, if only stations without any acknowledgement lack it."""
        self.underway.remove(entry)
        entry.state = "waiting"
        new = entry.live and not entry.sends
        if new or not entry.missing_at or self._stores.any_confirmed(entry.missing_at):
            insort(self._waiting, (entry.time_ns, entry.key))
            return
        self._probes[entry.key] = entry
        if len(self._probes) > MOST_PROBES:
            self._give_up(next(iter(self._probes.values())))

    def promote_probes(self, store: int) -> None:
        """Queue a ground station's probes as normal pulses, once it has acknowledged one."""
        if self._stores[store].acknowledges:
            for entry in [e for e in self._probes.values() if store in e.missing_at]:
                del self._probes[entry.key]
                self.wait(entry)

    def next(self, now_ns: int, rate_bytes_s: float) -> Entry[T] | None:
        """Choose the pulse to send now, and remove it from the queue."""
        if self._waiting:
            backlog_s = len(self._waiting) * ROUGH_BYTES / rate_bytes_s
            _, key = self._waiting.pop(-1 if backlog_s > LIVE_S else 0)
            return self._entries[key]
        due_ns = self.probe_due_ns(now_ns)
        if due_ns > now_ns:
            return None
        self._probed_ns = int(due_ns)
        return self._probes.pop(min(self._probes, key=lambda key: key[1]))

    def probe_due_ns(self, now_ns: int) -> float:
        """Time at which the next probe may be sent [ns]; infinite if none waits."""
        if not self._probes:
            return math.inf
        return max(self._probed_ns, now_ns - PROBES * PROBE_NS) + PROBE_NS

    def forget(self, entry: Entry[T]) -> None:
        """Remove a pulse from memory; only the copy on disk remains."""
        if entry.state == "waiting" and self._probes.pop(entry.key, None) is None:
            place = bisect_left(self._waiting, (entry.time_ns, entry.key))
            if place < len(self._waiting) and self._waiting[place][1] == entry.key:
                del self._waiting[place]
        self.underway.finish(entry)
        del self._entries[entry.key]

    def sent_to_plain(self, entry: Entry[T]) -> None:
        """Remove a pulse that was sent only to stations without acknowledgements."""
        self.forget(entry)
        self._sent_plain.append(entry.pulse)

    def sent_plain(self) -> list[ItemKey]:
        """Return the pulses that were sent, since the last call, only to stations that do not
        acknowledge.
        """
        done, self._sent_plain = self._sent_plain, []
        return done

    def _give_up(self, entry: Entry[T]) -> None:
        """Remove a pulse from memory; ground stations that lack it get it from disk later."""
        for number in entry.missing_at:
            self._stores.note_on_disk(number)
        if entry.live and entry.sends and not entry.stored_at:
            self._sent_plain.append(entry.pulse)
        self.forget(entry)

    def _bound(self) -> None:
        """Remove the oldest pulses beyond `CAPACITY`; they are read from disk later."""
        while len(self._entries) > CAPACITY and self._waiting:
            entry = self._entries[self._waiting[0][1]]
            for number in entry.missing_at or {PLAIN}:
                self._stores.note_on_disk(number)
            self.forget(entry)
            self.put_back += 1
