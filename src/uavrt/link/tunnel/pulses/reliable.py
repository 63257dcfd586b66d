"""Deliver every pulse over a link that loses messages; no I/O.

A ground station that acknowledges (`uavrt.link.tunnel.own_messages.private`) gets every pulse:
unacknowledged ones are sent again. A station that does not acknowledge gets each pulse once.

A message counts as lost once three later ones were acknowledged and the round trip has passed.
Every message also counts as lost after the time-out of RFC 6298, at least 0.4 s.

The content of a burst does not fit into its pulse message
(`uavrt.link.tunnel.own_messages.burst`). The content goes to a store that has acknowledged the
pulse; the pulse is delivered once both are acknowledged.

A store is a ground station's memory of pulses, with a number that anyone can make up. Before
its first acknowledgement it gets messages for all, and a few repetitions when nothing else
waits; then it gets all pulses.
"""

import math
from collections.abc import Callable, Iterable
from typing import Generic

from uavrt.core.messages import TunnelPayload
from uavrt.core.units import ns_from_s
from uavrt.link.tunnel.generations.wire import PAYLOAD_TYPE, Ids
from uavrt.link.tunnel.own_messages.private import payload_hash
from uavrt.link.tunnel.pulses.pulse_memory import PulseMemory
from uavrt.link.tunnel.pulses.receiving_stations import Stores
from uavrt.link.tunnel.pulses.underway import Entry, ItemKey, T

WINDOW = 64
"""Largest number of pulses that were sent and wait for an acknowledgement."""
PLAIN_AFTER_NS = ns_from_s(3.0)
"""Time without an acknowledgement after which a ground station counts as one that does not
acknowledge, and gets each pulse once [ns]. Stations acknowledge once a second. At 40 % loss, 3
% of them are late and get some pulses twice."""


class ReliableSender(Generic[T]):
    """Decides which pulse to send next, and which sent pulses count as lost."""

    def __init__(
        self,
        encode: Callable[[T], bytes],
        inside: Callable[[T], bytes | None] = lambda item: None,
        inside_type: int = PAYLOAD_TYPE,
    ) -> None:
        self._encode, self._inside_type = encode, inside_type
        self.stores = Stores()
        self.pulses: PulseMemory[T] = PulseMemory(inside, self.stores)
        self.underway = self.pulses.underway
        self.first_sends = 0
        self.repeats = 0
        self.insides_sent = 0
        """Number of sent messages with the single pulses of a burst."""
        self.acknowledged_pulses = 0
        self._station_since_ns: int | None = None

    def station_present(self, present: bool, now_ns: int) -> None:
        """Record whether any ground station's heartbeats arrive."""
        if not present:
            self._station_since_ns = None
        elif self._station_since_ns is None:
            self._station_since_ns = now_ns

    def link_changed(self) -> None:
        """Send all unacknowledged pulses again, because another link is now in use."""
        for entry in self.underway.restart():
            entry.tries = 0
            self.pulses.wait(entry)

    def receipt(
        self, store: int, hashes: Iterable[int], place: Ids, now_ns: int
    ) -> list[ItemKey]:
        """Handle a receipt; return the pulses that this ground station newly acknowledged."""
        if store in self.stores:
            known = self.stores[store]
            known.place, known.received_ns = place, now_ns
        elif self.stores.admits(store, now_ns):
            self._add_store(store, place, now_ns)
        else:
            return []
        new: list[ItemKey] = []
        acknowledged = []
        for number in hashes:
            entry = self.underway.by_hash(number)
            if entry is None or store in entry.stored_at:
                new += self._late_acknowledgement(number, store)
                continue
            self._confirm(store)
            is_inside = entry.inside is not None
            if is_inside and store not in entry.missing_at:
                continue  # overheard: it has not acknowledged the pulse
            entry.stored_at.add(store)
            entry.missing_at.discard(store)
            if is_inside or not self.pulses.add_inside(entry, store):
                new.append(entry.pulse)
            acknowledged.append(entry)
            if not self.stores.must_repeat(entry.missing_at):
                self.pulses.forget(entry)
                self.acknowledged_pulses += not is_inside
        for entry in self.underway.acknowledged(acknowledged, now_ns):
            self.pulses.wait(entry)
        return new

    def _add_store(self, store: int, place: Ids, now_ns: int) -> None:
        """Add a new ground station; if there are too many, it replaces another."""
        replaced = self.stores.to_replace()
        if replaced is not None:
            self._drop_store(replaced)
        self.stores.add(store, place, now_ns)
        self.pulses.send_all(store)

    def _late_acknowledgement(self, number: int, store: int) -> list[ItemKey]:
        """Handle a receipt of a pulse, by its payload's hash, that is no longer in memory."""
        done = self.underway.finished(number)
        if done is None or store in done.stored_at:
            return []
        done.stored_at.add(store)
        self._confirm(store)
        if done.inside is not None or self.pulses.inside(done.item) is not None:
            self.stores.note_on_disk(store)  # both come again, unless it has both
            return []
        return [done.pulse]

    def _confirm(self, store: int) -> None:
        """Record that a station has acknowledged a pulse, which proves that it exists."""
        if not self.stores[store].acknowledges:
            self.stores[store].acknowledges = True
            self.pulses.promote_probes(store)

    def wait_ns(self, now_ns: int) -> int | None:
        """Time until a pulse may be sent [ns]; None if there is none."""
        if self._station_since_ns is None:
            return None
        self._drop_silent_stores(now_ns)
        if self.pulses.waiting and len(self.underway) < WINDOW:
            grace_ns = self._station_since_ns + PLAIN_AFTER_NS - now_ns
            return 0 if len(self.stores) else max(0, grace_ns)
        due_ns = min(self.underway.next_deadline_ns(), self.pulses.probe_due_ns(now_ns))
        return None if due_ns == math.inf else max(0, int(due_ns) - now_ns)

    def take(self, now_ns: int, rate_bytes_s: float) -> TunnelPayload | None:
        """Return the payload to send now, at the link's present rate; None without any."""
        self._expire(now_ns)
        may_go = self.wait_ns(now_ns) == 0
        entry = self.pulses.next(now_ns, rate_bytes_s) if may_go else None
        if entry is None:
            return None
        payload = self._encode(entry.item) if entry.inside is None else entry.inside
        entry.sends += 1
        entry.tries += not entry.twin
        self._count(entry)
        place = None
        if (entry.sends > 1 or entry.inside is not None) and len(entry.missing_at) == 1:
            place = self.stores[next(iter(entry.missing_at))].place
        if entry.missing_at:
            awaited = self.stores.any_confirmed(entry.missing_at) or not self.stores.confirmed
            self.underway.add(entry, payload_hash(payload), now_ns, awaited=awaited)
            self._add_twin(entry)
        else:
            self.pulses.sent_to_plain(entry)
        return TunnelPayload(
            payload, place, PAYLOAD_TYPE if entry.inside is None else self._inside_type
        )

    def _count(self, entry: Entry[T]) -> None:
        """Count a sent message in total and for each ground station."""
        for number in entry.missing_at:
            self.stores[number].sends += 1
        if entry.inside is not None:
            self.insides_sent += 1
        elif entry.sends == 1:
            self.first_sends += 1
        else:
            self.repeats += 1

    def _add_twin(self, entry: Entry[T]) -> None:
        """Send a repetition twice while nothing else waits to be sent.

        With few unacknowledged pulses, each loss costs a time-out. At 20 % loss, 4 % of the
        pulses would need a second time-out, with two copies 0.8 %. The link is idle at that
        time.
        """
        again = entry.sends > 1 and not entry.twin and not self.pulses.waiting
        entry.twin = again and self.stores.any_confirmed(entry.missing_at)
        if entry.twin:
            self.pulses.wait(entry)

    def _expire(self, now_ns: int) -> None:
        """Queue messages again that were not acknowledged in time."""
        for entry in self.underway.late(now_ns):
            if entry.stored_at and not self.stores.must_repeat(entry.missing_at):
                self.pulses.forget(entry)
            else:
                self.pulses.wait(entry)

    def _drop_silent_stores(self, now_ns: int) -> None:
        silent = self.stores.silent(now_ns)
        if silent:
            self.underway.expect_no_answer()
        for number in silent:
            self._drop_store(number, now_ns)

    def _drop_store(self, number: int, now_ns: int | None = None) -> None:
        gone = self.stores.remove(number, now_ns)
        self.pulses.send_none(number, acknowledges=gone.acknowledges)
