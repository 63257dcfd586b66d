"""Ground stations that acknowledge pulses, each with a number of its own.

Anyone can make up such a number. A station that has acknowledged a pulse exists; others are
limited in number, and ignored for a while when they acknowledge nothing of much.
"""

import math
from collections.abc import Collection
from dataclasses import dataclass

from uavrt.allowance import Allowance
from uavrt.units import ns_from_s

PLAIN = 0
"""Store number of all the ground stations that do not acknowledge."""
MOST_STORES = 8
"""Most ground stations that are sent all pulses; their numbers can be made up by anyone."""
NEW_STORES, NEW_STORES_PER_S = 4, 0.1
"""Allowance of receipts of new stores: at once, then each second."""
STORE_SILENCE_NS = ns_from_s(10.0)
"""Silence after which a ground station is not waited for [ns]; its pulses are on disk."""
DEAF_SENDS = 64
DEAF_NS = ns_from_s(10.0)
"""Messages, and time [ns], without any acknowledgement after which a store is ignored: it is
made up, or does not receive."""
DEAF_AGAIN_NS = ns_from_s(60.0)
MOST_DEAF = 64
PATIENCE, SENDS_OF_PATIENCE = 8, 32
"""Times that the content of a burst is sent to a store that has acknowledged none; once, after
this many in all: at 40 % loss each way one of 32 is answered but in one case in a million."""

Place = tuple[int, int]
"""A ground station: system and component id."""


@dataclass(slots=True)
class Store:
    """A ground station that acknowledges."""

    place: Place
    heard_ns: int
    since_ns: int
    """Time at which it appeared [ns]."""
    on_disk: bool = True
    """Whether pulses it lacks may be on disk and not in memory."""
    acknowledges: bool = False
    """Whether it has acknowledged a pulse, and so exists."""
    sends: int = 0
    """Messages sent to it without any acknowledgement."""
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


class Stores:
    """The stores that are present, and whose missing pulses may be on disk."""

    def __init__(self) -> None:
        self._stores: dict[int, Store] = {}
        self._new = Allowance(burst=NEW_STORES, per_s=NEW_STORES_PER_S)
        self._deaf: dict[int, int] = {}
        """When stores that acknowledged nothing were ignored."""
        self._plain_on_disk = False
        self.refused = 0
        """Receipts of stores beyond `MOST_STORES`."""

    def __len__(self) -> int:
        return len(self._stores)

    def __contains__(self, number: int) -> bool:
        return number in self._stores

    def __getitem__(self, number: int) -> Store:
        return self._stores[number]

    @property
    def present(self) -> frozenset[int]:
        """The stores that are present."""
        return frozenset(self._stores)

    @property
    def proven(self) -> frozenset[int]:
        """The stores that have acknowledged a pulse, and so exist."""
        return frozenset(n for n, store in self._stores.items() if store.acknowledges)

    def any_proven(self, numbers: Collection[int]) -> bool:
        """Whether one of some stores that are present has acknowledged a pulse."""
        return any(self._stores[number].acknowledges for number in numbers)

    def any_waits(self, numbers: Collection[int]) -> bool:
        """Whether a pulse that one store has must go again for others that lack it.

        Not for those that have acknowledged nothing: they may be made up, and must not fill the
        window. One that exists gets missing pulses from the disk.
        """
        if self.any_proven(numbers):
            return True
        for number in numbers:
            self._stores[number].on_disk = True
        return False

    def may_come(self, number: int, now_ns: int) -> bool:
        """Whether to accept a new store; if not, its receipt is counted as refused."""
        deaf_ns = self._deaf.get(number)
        ignored = deaf_ns is not None and now_ns - deaf_ns < DEAF_AGAIN_NS
        if not ignored and self._new.take(now_ns) and len(self.proven) < MOST_STORES:
            return True
        self.refused += 1
        return False

    def to_replace(self) -> int | None:
        """The store that must go before another can come, None while there is room."""
        if len(self._stores) < MOST_STORES:
            return None
        unproven = [n for n, store in self._stores.items() if not store.acknowledges]
        return min(unproven, key=lambda number: self._stores[number].heard_ns)

    def add(self, number: int, place: Place, now_ns: int) -> None:
        """Add a store that came."""
        self._stores[number] = Store(place, now_ns, since_ns=now_ns)

    def silent(self, now_ns: int) -> list[int]:
        """Stores that are not waited for: silent, or without any acknowledgement."""
        return [
            number
            for number, store in self._stores.items()
            if now_ns - store.heard_ns > STORE_SILENCE_NS or store.deaf(now_ns)
        ]

    def remove(self, number: int, now_ns: int | None = None) -> Store:
        """Remove a store; at a given time, ignore it for a while if it acknowledges nothing."""
        if now_ns is not None and self._stores[number].deaf(now_ns):
            self._deaf[number] = now_ns
            while len(self._deaf) > MOST_DEAF:
                del self._deaf[next(iter(self._deaf))]
        return self._stores.pop(number)

    def on_disk(self, *, unproven: bool) -> int | None:
        """A store whose pulses may be on disk; None without any.

        `unproven`: whether also one that has acknowledged nothing.
        """
        for number, store in self._stores.items():
            if store.on_disk and (store.acknowledges or unproven):
                return number
        return PLAIN if self._plain_on_disk and not self._stores else None

    def note_on_disk(self, number: int, *, on_disk: bool = True) -> None:
        """Note whether pulses that a store lacks, or `PLAIN`, may be on disk."""
        if number == PLAIN:
            self._plain_on_disk = on_disk
        elif number in self._stores:
            self._stores[number].on_disk = on_disk

    def disk_has_news(self) -> None:
        """Note that pulses may be on disk that are not in memory: a flight was opened."""
        for number in (PLAIN, *self._stores):
            self.note_on_disk(number)
