"""Pulses in memory that some ground station lacks: in which order they go, and to whom.

Pulses that do not fit stay in the flight's database, and are read again when there is room.
The oldest goes first, while all leave within `LIVE_S`; with more to send the newest goes first,
for the display, and the backlog follows. What only stores lack that have acknowledged nothing
goes behind all others, as a probe.
"""

import math
from bisect import bisect_left, insort
from collections import OrderedDict
from collections.abc import Callable, Iterable
from typing import Generic

from uavrt.tunnel.stores import PLAIN, Stores
from uavrt.tunnel.underway import Entry, EntryKey, ItemKey, T, Underway
from uavrt.units import ns_from_s

PROBES, PROBE_NS = 4, ns_from_s(1.0)
"""Repetitions for stores that have acknowledged nothing yet, all of them together: at once, and
one more each second. At 40 % loss each way one of four is answered in five cases of six."""
MOST_PROBES = 64
"""Most pulses in memory for such stores only; the rest waits on disk."""
CAPACITY = 2048
"""Pulses in memory, about 4 MB; the rest waits on disk."""
REFILL_AT = 256
"""Number of pulses in memory below which those on disk are read."""
LIVE_S = 2.0
ROUGH_BYTES = 137
"""Size of a pulse's frame, to estimate the time for the backlog."""


class PulseMemory(Generic[T]):
    """The pulses in memory.

    `inside`: payload of a pulse's content, None without any.
    """

    def __init__(self, inside: Callable[[T], bytes | None], stores: Stores) -> None:
        self.inside, self._stores = inside, stores
        self._entries: dict[EntryKey, Entry[T]] = {}
        self._waiting: list[tuple[int, EntryKey]] = []
        self._probes: OrderedDict[EntryKey, Entry[T]] = OrderedDict()
        """Pulses only for stores that may be made up."""
        self._probed_ns = -PROBES * PROBE_NS
        self._sent_plain: list[ItemKey] = []
        self.underway: Underway[T] = Underway()
        self.put_back = 0
        """Pulses dropped from memory because it was full; they are on disk."""

    def __len__(self) -> int:
        return len(self._entries)

    @property
    def waiting(self) -> int:
        """Pulses in memory that are to be sent."""
        return len(self._waiting)

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
        unproven = store in self._stores and not self._stores[store].acknowledges
        return min(MOST_PROBES if unproven else CAPACITY, CAPACITY - len(self._entries))

    def wanted(self) -> int | None:
        """A store whose pulses on disk there is room for; None when there is none."""
        if len(self._entries) >= REFILL_AT:
            return None
        return self._stores.on_disk(unproven=not self._probes)

    def add(self, key: ItemKey, item: T) -> None:
        """Add a pulse that is safe on disk; one that is here already is ignored."""
        if key not in self._entries:
            self._enter(Entry(key, key[1], item, owed=set(self._stores.present)))
            self._bound()

    def refill(self, store: int, items: Iterable[tuple[ItemKey, T]], *, more: bool) -> None:
        """Add pulses from disk that a store lacks.

        `store`: the store, or `PLAIN`. `items`: each (key, pulse); at most `CAPACITY` less what
        is here. `more`: whether there are others on disk.
        """
        for key, item in items:
            if key not in self._entries:
                owed = {store} & self._stores.present
                self._enter(Entry(key, key[1], item, live=False, owed=owed))
            elif store in self._stores:
                self._entries[key].owed.add(store)
                self.wait_no_longer_as_probe(store)
        if more:
            self._stores.note_on_disk(store)
        self._bound()

    def add_inside(self, entry: Entry[T], store: int) -> bool:
        """Queue the content for a store that has the pulse; False without any."""
        payload = self.inside(entry.item)
        if payload is None:
            return False
        key = (*entry.pulse, 1)
        if key in self._entries:
            self._entries[key].owed.add(store)
        else:
            owed = {store}
            self._enter(Entry(key, entry.time_ns, entry.item, payload, live=False, owed=owed))
        return True

    def _enter(self, entry: Entry[T]) -> None:
        self._entries[entry.key] = entry
        self.wait(entry)

    def owe_all(self, store: int) -> None:
        """Send all pulses to a store that came."""
        for entry in self._entries.values():
            if store not in entry.kept and entry.inside is None:
                entry.owed.add(store)

    def owe_none(self, store: int, *, made_up: bool) -> None:
        """Send no more to a store that is gone; `made_up`: it acknowledged nothing."""
        for entry in list(self._entries.values()):
            entry.owed.discard(store)
            if entry.owed:
                continue
            if entry.inside is not None:
                self.forget(entry)  # when the store is back, the disk has it
            elif entry.kept or (made_up and (entry.sends or not entry.live)):
                self._give_up(entry)
            elif entry.state == "sent" or entry.key in self._probes:
                self._probes.pop(entry.key, None)
                self.wait(entry)

    def wait(self, entry: Entry[T]) -> None:
        """Queue a pulse, behind all others if it is only for stores that may not exist."""
        self.underway.remove(entry)
        entry.state = "waiting"
        new = entry.live and not entry.sends
        if new or not entry.owed or self._stores.any_proven(entry.owed):
            insort(self._waiting, (entry.time_ns, entry.key))
            return
        self._probes[entry.key] = entry
        if len(self._probes) > MOST_PROBES:
            self._give_up(next(iter(self._probes.values())))

    def wait_no_longer_as_probe(self, store: int) -> None:
        """Queue what a store lacks with all others, if it exists."""
        if self._stores[store].acknowledges:
            for entry in [e for e in self._probes.values() if store in e.owed]:
                del self._probes[entry.key]
                self.wait(entry)

    def next(self, now_ns: int, rate_bytes_s: float) -> Entry[T] | None:
        """Choose the pulse that goes, and remove it from the queue."""
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
        """When a pulse may next go to stores that may not exist; infinite without any."""
        if not self._probes:
            return math.inf
        return max(self._probed_ns, now_ns - PROBES * PROBE_NS) + PROBE_NS

    def forget(self, entry: Entry[T]) -> None:
        """Drop a pulse from memory."""
        if entry.state == "waiting" and self._probes.pop(entry.key, None) is None:
            place = bisect_left(self._waiting, (entry.time_ns, entry.key))
            if place < len(self._waiting) and self._waiting[place][1] == entry.key:
                del self._waiting[place]
        self.underway.finish(entry)
        del self._entries[entry.key]

    def sent_to_plain(self, entry: Entry[T]) -> None:
        """Drop a pulse that was sent to plain ground stations only: it is done."""
        self.forget(entry)
        self._sent_plain.append(entry.pulse)

    def sent_plain(self) -> list[ItemKey]:
        """Pulses sent, since the last call, to plain ground stations only: done."""
        done, self._sent_plain = self._sent_plain, []
        return done

    def _give_up(self, entry: Entry[T]) -> None:
        """Leave a pulse to the disk; plain stations have been sent it."""
        for number in entry.owed:
            self._stores.note_on_disk(number)
        if entry.live and entry.sends and not entry.kept:
            self._sent_plain.append(entry.pulse)
        self.forget(entry)

    def _bound(self) -> None:
        """Return the oldest to the disk; they are read again when there is room."""
        while len(self._entries) > CAPACITY and self._waiting:
            entry = self._entries[self._waiting[0][1]]
            for number in entry.owed or {PLAIN}:
                self._stores.note_on_disk(number)
            self.forget(entry)
            self.put_back += 1
