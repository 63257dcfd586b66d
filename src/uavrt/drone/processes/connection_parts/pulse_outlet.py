"""Deliver pulses to ground stations, and read pulses from disk that a station lacks.

This part of the connection process links the pulse sender (`uavrt.link.tunnel.pulses.reliable`)
to the flight's database (`uavrt.flight.database.spool`). `Disk` reads the database in the
background, so that a slow disk does not delay other pulses.
"""

from collections import deque
from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path

from uavrt.core.errors import RecordingError, TunnelError
from uavrt.core.log import get_logger
from uavrt.core.messages import Delivered, PulseKey, PulsePose
from uavrt.core.newest import Newest
from uavrt.core.runtime.disk_thread import Disk, at_once
from uavrt.core.units import ns_from_s
from uavrt.flight.database.spool import undelivered
from uavrt.link.tunnel.own_messages.burst import BURST_TYPE, encode_burst
from uavrt.link.tunnel.own_messages.private import Receipt
from uavrt.link.tunnel.pulses.delivery import PulseDelivery
from uavrt.link.tunnel.pulses.receiving_stations import PLAIN
from uavrt.link.tunnel.pulses.reliable import ReliableSender
from uavrt.link.tunnel.pulses.underway import ItemKey

log = get_logger()

REFILL = 512
FLIGHTS = 4
"""Number of flights whose undelivered pulses are still sent; the recorder has the same
limit."""
RECENT = 2_000
RECENT_NS = ns_from_s(60.0)
"""Time for which the last `RECENT` delivered pulses are remembered [ns]. The recorder commits
every three seconds; if a commit takes longer than this time, some pulses are sent twice."""
REFILL_PERIOD_NS = ns_from_s(0.5)


class PulseOutlet:
    """Sends pulses to ground stations, also unsent ones from the flights' databases."""

    def __init__(
        self,
        encode: Callable[[PulsePose], bytes],
        note: Callable[[Delivered], None],
        disk: Disk = at_once,
        *,
        first_refill_ns: int = 0,
    ) -> None:
        self.sender: ReliableSender[PulsePose] = ReliableSender(
            encode, lambda item: encode_burst(item.pulse), BURST_TYPE
        )
        self.delivery = PulseDelivery()
        self._note = note
        self._disk = disk
        self._reading = False
        self._flights: deque[str] = deque(maxlen=FLIGHTS)
        self._recent: Newest[tuple[int, ItemKey], int] = Newest(RECENT)
        self._next_refill_ns = first_refill_ns
        self.bad_receipts = 0
        self.receipts = 0

    def flight(self, directory: str, *, resumed: bool = False) -> None:
        """Add a flight, new or (`resumed`) begun before this process was restarted.

        Pulses of a new flight are not read from disk yet, because the recorder is still
        creating its database.
        """
        if directory not in self._flights:
            self._flights.append(directory)
        if resumed:
            self.sender.stores.mark_all_on_disk()

    def recorded(self, keys: Sequence[PulseKey]) -> None:
        """Note that pulses are on disk; read those that a station may lack from there."""
        known = [self.delivery.recorded(key) for key in keys]
        if not all(known):
            self.sender.stores.mark_all_on_disk()

    def add(self, pulse_pose: PulsePose) -> None:
        """Queue a pulse with its pose for all ground stations."""
        self.sender.pulses.add(pulse_pose.pulse.key, pulse_pose)

    def receipt(
        self, payload: bytes, place: tuple[int, int], now_ns: int
    ) -> tuple[bool, float | None]:
        """Handle a station's receipt; return (valid, round trip).

        The first is True for a confirmed station, the second is a time [s] or None.
        """
        try:
            receipt = Receipt.decode(payload)
        except TunnelError as error:
            self.bad_receipts += 1
            log.seldom(self.bad_receipts, "bad receipt", reason=error.message)
            return False, None
        self.receipts += 1
        stores = self.sender.stores
        before = stores.present, stores.confirmed
        new = self.sender.receipt(receipt.store, receipt.hashes, place, now_ns)
        self._delivered(receipt.store, new, now_ns)
        if stores.present - before[0] or stores.confirmed - before[1]:
            self.delivery.station_appeared()
        return receipt.store in stores.confirmed, self.sender.underway.fresh_trip_s

    def tick(self, now_ns: int) -> None:
        """Report pulses as delivered that were sent to stations that send no receipts; read
        unsent pulses from disk.
        """
        self._delivered(PLAIN, self.sender.pulses.sent_plain(), now_ns)
        due = now_ns >= self._next_refill_ns and not self._reading
        store = self.sender.pulses.wanted() if due else None
        if store is not None:
            self._next_refill_ns = now_ns + REFILL_PERIOD_NS
            self._refill(store)

    def counters(self) -> dict[str, float]:
        """Counts of pulses and receipts, for the health report."""
        sender = self.sender
        return {
            "pulses_waiting_for_recorder": self.delivery.unrecorded,
            "pulses_to_send": sender.pulses.waiting,
            "pulses_unacknowledged": len(sender.underway),
            "pulses_sent": sender.first_sends,
            "pulses_sent_again": sender.repeats,
            "pulses_acknowledged": sender.acknowledged_pulses,
            "pulses_put_back": sender.pulses.put_back,
            "receipts": self.receipts,
            "receipts_bad": self.bad_receipts,
            "receipts_of_too_many": sender.stores.refused,
            **({"burst_insides_sent": sender.insides_sent} if sender.insides_sent else {}),
        }

    def _delivered(self, store: int, keys: list[ItemKey], now_ns: int) -> None:
        if not keys:
            return
        for key in keys:
            self._recent[store, key] = now_ns
        while next(iter(self._recent.values())) < now_ns - RECENT_NS:
            self._recent.popitem(last=False)
        self._note(Delivered(time_ns=now_ns, store=store, pulses=tuple(keys)))

    def _refill(self, store: int) -> None:
        sender, pulses = self.sender, self.sender.pulses
        without = pulses.keys(store) | {k for number, k in self._recent if number == store}
        room = min(REFILL, pulses.room(store))
        newest_first = tuple(reversed(self._flights))
        self._reading = True
        sender.stores.note_on_disk(store, on_disk=False)
        job = partial(_read, newest_first, store, room, without)
        if not self._disk(job, partial(self._refilled, store)):
            self._reading = False
            pulses.refill(store, (), more=True)

    def _refilled(self, store: int, result: tuple[list[PulsePose], bool]) -> None:
        self._reading = False
        found, more = result
        items = [(item.pulse.key, item) for item in found]
        # Some may have arrived while the disk was read.
        new = [(key, item) for key, item in items if (store, key) not in self._recent]
        self.sender.pulses.refill(store, new, more=more)


def _read(
    flights: Sequence[str], store: int, room: int, without: Collection[ItemKey]
) -> tuple[list[PulsePose], bool]:
    """Read up to `room` unsent pulses, except those in `without`; also return if more exist."""
    found: list[PulsePose] = []
    more = False
    for directory in flights:
        try:
            pulses, rest = undelivered(directory, store, room - len(found), without)
        except RecordingError as error:
            log.debug("spool", reason=str(error))
            more = more or Path(directory).is_dir()  # else it was removed: nothing comes
            continue
        found += pulses
        more = more or rest
        if len(found) >= room:
            return found, True
    return found, more
