"""Delivery of pulses without loss over a link that loses, without I/O.

A ground station that acknowledges (`uavrt.tunnel.private`) gets every pulse: unacknowledged
ones are sent again. A plain one gets each pulse once.

A message is lost when three later ones were acknowledged and the round trip has passed; or when
it is not acknowledged within the retransmission time-out of RFC 6298 with a floor of 0.4 s.

The content of a burst does not fit into its pulse message (`uavrt.tunnel.burst`). It goes to a
store that has acknowledged the pulse, and only with both is the pulse delivered. A ground
station of an older version never acknowledges the content; then the pulse alone counts, after
some tries.

A store is a number that anyone can make up. One that has acknowledged no pulse yet gets what
goes to all, and a few repetitions when nothing else waits; after its first acknowledgement it
gets all.
"""

import math
from collections.abc import Callable, Iterable
from typing import Generic

from uavrt.messages import TunnelPayload
from uavrt.tunnel.private import payload_hash
from uavrt.tunnel.pulse_memory import PulseMemory
from uavrt.tunnel.stores import Place, Stores
from uavrt.tunnel.underway import Entry, ItemKey, T
from uavrt.tunnel.wire import PAYLOAD_TYPE
from uavrt.units import ns_from_s

WINDOW = 64
"""Most pulses on their way without an acknowledgement."""
PLAIN_AFTER_NS = ns_from_s(3.0)
"""Time in which a ground station must acknowledge, else it gets each pulse once [ns]. Stations
acknowledge once a second: at 40 % loss 3 % do not manage, and get some twice."""


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
        self._encode, self._inside_type = encode, inside_type
        self.stores = Stores()
        self.pulses: PulseMemory[T] = PulseMemory(inside, self.stores)
        self.underway = self.pulses.underway
        self.first_sends = 0
        self.repeats = 0
        self.insides_sent = 0
        """Messages with the content of bursts."""
        self.acknowledged_pulses = 0
        self._station_since_ns: int | None = None
        self._settled: list[tuple[int, ItemKey]] = []

    def station_present(self, present: bool, now_ns: int) -> None:
        """Report whether any ground station's heartbeats come."""
        if not present:
            self._station_since_ns = None
        elif self._station_since_ns is None:
            self._station_since_ns = now_ns

    def link_changed(self) -> None:
        """Send the pulses under way again, by the new link."""
        for entry in self.underway.restart():
            entry.tries = 0
            self.pulses.wait(entry)

    def receipt(
        self, store: int, hashes: Iterable[int], place: Place, now_ns: int
    ) -> list[ItemKey]:
        """Handle a receipt; return the pulses that are new in that store."""
        if store in self.stores:
            known = self.stores[store]
            known.place, known.heard_ns = place, now_ns
        elif self.stores.may_come(store, now_ns):
            self._welcome(store, place, now_ns)
        else:
            return []
        new: list[ItemKey] = []
        acknowledged = []
        for number in hashes:
            entry = self.underway.by_hash(number)
            if entry is None or store in entry.kept:
                new += self._late_word(number, store)
                continue
            self._trust(store)
            is_inside = entry.inside is not None
            if is_inside and store not in entry.owed:
                continue  # overheard: it has not acknowledged the pulse
            entry.kept.add(store)
            entry.owed.discard(store)
            if is_inside:
                self.stores[store].reads_insides = True
            if is_inside or not self.pulses.add_inside(entry, store):
                new.append(entry.pulse)
            acknowledged.append(entry)
            if not self.stores.any_waits(entry.owed):
                self.pulses.forget(entry)
                self.acknowledged_pulses += not is_inside
        for entry in self.underway.acknowledged(acknowledged, now_ns):
            self._again(entry)
        return new

    def _welcome(self, store: int, place: Place, now_ns: int) -> None:
        """Add a store that came, in place of another if there are too many."""
        replaced = self.stores.to_replace()
        if replaced is not None:
            self._drop_store(replaced)
        self.stores.add(store, place, now_ns)
        self.pulses.owe_all(store)

    def _late_word(self, number: int, store: int) -> list[ItemKey]:
        """Handle a store's acknowledgement of a pulse that is no longer waited for."""
        done = self.underway.finished(number)
        if done is None or store in done.kept:
            return []
        done.kept.add(store)
        self._trust(store)
        if done.inside is not None:
            self.stores[store].reads_insides = True
        if done.inside is not None or self.pulses.inside(done.item) is not None:
            self.stores.note_on_disk(store)  # both come again, unless it has both
            return []
        return [done.pulse]

    def _trust(self, store: int) -> None:
        """Note that a store has acknowledged a pulse, and so exists."""
        if not self.stores[store].acknowledges:
            self.stores[store].acknowledges = True
            self.pulses.wait_no_longer_as_probe(store)

    def settled(self) -> list[tuple[int, ItemKey]]:
        """Stores that do not read contents, with their pulses, since the last call."""
        settled, self._settled = self._settled, []
        return settled

    def wait_ns(self, now_ns: int) -> int | None:
        """Time until a pulse may go [ns]; None when nothing is to go."""
        if self._station_since_ns is None:
            return None
        self._drop_silent_stores(now_ns)
        if self.pulses.waiting and len(self.underway) < WINDOW:
            grace_ns = self._station_since_ns + PLAIN_AFTER_NS - now_ns
            return 0 if len(self.stores) else max(0, grace_ns)
        due_ns = min(self.underway.next_deadline_ns(), self.pulses.probe_due_ns(now_ns))
        return None if due_ns == math.inf else max(0, int(due_ns) - now_ns)

    def take(self, now_ns: int, rate_bytes_s: float) -> TunnelPayload | None:
        """Return the payload that goes now, by the link's rate."""
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
        if (entry.sends > 1 or entry.inside is not None) and len(entry.owed) == 1:
            place = self.stores[next(iter(entry.owed))].place
        if entry.owed:
            awaited = self.stores.any_proven(entry.owed) or not self.stores.proven
            self.underway.add(entry, payload_hash(payload), now_ns, awaited=awaited)
            self._add_twin(entry)
        else:
            self.pulses.sent_to_plain(entry)
        return TunnelPayload(
            payload, place, PAYLOAD_TYPE if entry.inside is None else self._inside_type
        )

    def _count(self, entry: Entry[T]) -> None:
        """Count a message that goes."""
        for number in entry.owed:
            self.stores[number].sends += 1
            self.stores[number].insides += entry.inside is not None
        if entry.inside is not None:
            self.insides_sent += 1
        elif entry.sends == 1:
            self.first_sends += 1
        else:
            self.repeats += 1

    def _add_twin(self, entry: Entry[T]) -> None:
        """Send a repetition twice while nothing else waits.

        With few pulses under way each loss costs a time-out. At 20 % loss 4 % of the pulses
        would need a second one, with twins 0.8 %; the link is idle anyhow.
        """
        again = entry.sends > 1 and not entry.twin and self.stores.any_proven(entry.owed)
        entry.twin = again and not self.pulses.waiting
        if entry.twin:
            self.pulses.wait(entry)

    def _expire(self, now_ns: int) -> None:
        """Queue again what was not acknowledged in time."""
        for entry in self.underway.late(now_ns):
            if entry.kept and not self.stores.any_waits(entry.owed):
                self.pulses.forget(entry)
            else:
                self._again(entry)

    def _again(self, entry: Entry[T]) -> None:
        """Queue lost pulses again, but no content that no store reads."""
        if entry.inside is not None:
            for number in list(entry.owed):
                if entry.tries >= self.stores[number].patience:
                    entry.owed.discard(number)
                    self._settled.append((number, entry.pulse))
            if not entry.owed:
                self.pulses.forget(entry)
                return
        self.pulses.wait(entry)

    def _drop_silent_stores(self, now_ns: int) -> None:
        silent = self.stores.silent(now_ns)
        if silent:
            self.underway.expect_no_answer()
        for number in silent:
            self._drop_store(number, now_ns)

    def _drop_store(self, number: int, now_ns: int | None = None) -> None:
        gone = self.stores.remove(number, now_ns)
        self.pulses.owe_none(number, made_up=not gone.acknowledges)
