"""Ground stations that receive and acknowledge pulses, by their store numbers.

Anyone can invent a store number, so a station counts as confirmed only after it has
acknowledged a pulse. The number of unconfirmed stations is limited. A station that acknowledges
none of many messages is ignored for a while.
"""

from collections.abc import Collection
from dataclasses import dataclass

from uavrt.core.newest import Newest
from uavrt.core.units import ns_from_s
from uavrt.link.allowance import Allowance
from uavrt.link.tunnel.generations.wire import Ids

PLAIN = 0
"""Store number that stands for all ground stations that do not acknowledge pulses."""
MOST_STORES = 8
"""Largest number of ground stations that get all pulses; a limit is needed because store
numbers can be invented."""
NEW_STORES, NEW_STORES_PER_S = 4, 0.1
"""Number of new ground stations accepted at once, and per second."""
STORE_SILENCE_NS = ns_from_s(10.0)
"""Time without receipts after which a ground station is removed [ns]; its pulses stay on disk.
"""
UNRESPONSIVE_SENDS = 64
UNRESPONSIVE_NS = ns_from_s(10.0)
"""Time without an acknowledgement after which a ground station is ignored [ns], if at least
`UNRESPONSIVE_SENDS` messages were sent to it. It does not exist or does not receive."""
IGNORED_NS = ns_from_s(60.0)
MOST_IGNORED = 64


@dataclass(slots=True)
class Store:
    """A ground station that acknowledges pulses, and which messages it was sent."""

    place: Ids
    received_ns: int
    since_ns: int
    """Time at which the station appeared [ns]."""
    on_disk: bool = True
    """True if pulses that the station lacks may be on disk and not in memory."""
    acknowledges: bool = False
    """True once the station has acknowledged a pulse, which proves that it exists."""
    sends: int = 0
    """Number of messages sent to the station."""

    def unresponsive(self, now_ns: int) -> bool:
        """True if many messages over a long time have brought no acknowledgement."""
        tried = self.sends >= UNRESPONSIVE_SENDS and now_ns - self.since_ns >= UNRESPONSIVE_NS
        return tried and not self.acknowledges


class Stores:
    """Stations that acknowledge pulses, and whether they may lack pulses on disk."""

    def __init__(self) -> None:
        self._stores: dict[int, Store] = {}
        self._new = Allowance(burst=NEW_STORES, per_s=NEW_STORES_PER_S)
        self._ignored: Newest[int, int] = Newest(MOST_IGNORED)
        """Time since which a station that acknowledged nothing is ignored [ns], by number."""
        self._plain_on_disk = False
        self.refused = 0
        """Number of receipts from new ground stations that were refused."""

    def __len__(self) -> int:
        return len(self._stores)

    def __contains__(self, number: int) -> bool:
        return number in self._stores

    def __getitem__(self, number: int) -> Store:
        return self._stores[number]

    @property
    def present(self) -> frozenset[int]:
        """Numbers of the ground stations that are present."""
        return frozenset(self._stores)

    @property
    def confirmed(self) -> frozenset[int]:
        """Numbers of the ground stations that have acknowledged a pulse, so they exist."""
        return frozenset(n for n, store in self._stores.items() if store.acknowledges)

    def any_confirmed(self, numbers: Collection[int]) -> bool:
        """True if one of these ground stations has ever acknowledged a pulse."""
        return any(self._stores[number].acknowledges for number in numbers)

    def must_repeat(self, numbers: Collection[int]) -> bool:
        """True if a pulse must be sent again: one of these stations, known to exist, lacks it.

        Stations without any acknowledgement may be made up and must not fill the window; if
        they exist, they get the pulse from disk.
        """
        if self.any_confirmed(numbers):
            return True
        for number in numbers:
            self._stores[number].on_disk = True
        return False

    def admits(self, number: int, now_ns: int) -> bool:
        """True if a new ground station is accepted; otherwise its receipt counts as refused."""
        since_ns = self._ignored.get(number)
        ignored = since_ns is not None and now_ns - since_ns < IGNORED_NS
        if not ignored and self._new.take(now_ns) and len(self.confirmed) < MOST_STORES:
            return True
        self.refused += 1
        return False

    def to_replace(self) -> int | None:
        """Return the station to remove before another is added; None if there is room."""
        if len(self._stores) < MOST_STORES:
            return None
        unconfirmed = [n for n, store in self._stores.items() if not store.acknowledges]
        return min(unconfirmed, key=lambda number: self._stores[number].received_ns)

    def add(self, number: int, place: Ids, now_ns: int) -> None:
        """Add a newly received ground station by its store number."""
        self._stores[number] = Store(place, now_ns, since_ns=now_ns)

    def silent(self, now_ns: int) -> list[int]:
        """Return the stations to remove: those that are silent or never acknowledged."""
        return [
            number
            for number, store in self._stores.items()
            if now_ns - store.received_ns > STORE_SILENCE_NS or store.unresponsive(now_ns)
        ]

    def remove(self, number: int, now_ns: int | None = None) -> Store:
        """Remove a ground station; with `now_ns` ignore it for a while if it never answered."""
        if now_ns is not None and self._stores[number].unresponsive(now_ns):
            self._ignored[number] = now_ns
        return self._stores.pop(number)

    def on_disk(self, *, unconfirmed: bool) -> int | None:
        """Number of a ground station that may lack pulses on disk; None without any.

        With `unconfirmed`, also a station that has never acknowledged a pulse.
        """
        for number, store in self._stores.items():
            if store.on_disk and (store.acknowledges or unconfirmed):
                return number
        return PLAIN if self._plain_on_disk and not self._stores else None

    def note_on_disk(self, number: int, *, on_disk: bool = True) -> None:
        """Set whether pulses that a ground station (or `PLAIN`) lacks may be on disk."""
        if number == PLAIN:
            self._plain_on_disk = on_disk
        elif number in self._stores:
            self._stores[number].on_disk = on_disk

    def mark_all_on_disk(self) -> None:
        """Record that all stations may lack pulses on disk, because a flight was opened."""
        for number in (PLAIN, *self._stores):
            self.note_on_disk(number)
