"""Each ground station gets every pulse, whoever else is there, came before or comes later."""

from collections.abc import Callable
from random import Random

import pytest

from uavrt.core.messages import TunnelPayload
from uavrt.link.tunnel.generations.wire import Ids
from uavrt.link.tunnel.own_messages.private import payload_hash
from uavrt.link.tunnel.pulses.reliable import ReliableSender
from uavrt.link.tunnel.pulses.underway import ItemKey

SECOND = 1_000_000_000
GROUND, OTHER = (255, 190), (245, 190)
INSIDE_TYPE = 5


def payload_of(number: int) -> bytes:
    return number.to_bytes(8, "little")


def inside_of(number: int) -> bytes | None:
    """Every other pulse is a burst."""
    return b"inside" + payload_of(number) if number % 2 else None


def make_sender() -> ReliableSender[int]:
    sender = ReliableSender(payload_of, inside_of, INSIDE_TYPE)
    sender.station_present(True, 0)
    return sender


def taken(sender: ReliableSender[int], now_ns: int) -> list[TunnelPayload]:
    found = []
    while (outgoing := sender.take(now_ns, 1200.0)) is not None:
        found.append(outgoing)
    return found


def test_what_is_read_for_one_station_is_read_for_the_other_too() -> None:
    sender = make_sender()
    for store, place in ((7, GROUND), (8, OTHER)):
        sender.receipt(store, (), place, 0)
    sender.stores.note_on_disk(7, on_disk=False)
    sender.pulses.refill(7, [((2, 2), 2)], more=False)
    assert sender.pulses.keys(7) == {(2, 2)}
    assert sender.pulses.keys(8) == set()


class Disk:
    """The flight's database, read while other things go on."""

    def __init__(self, sender: ReliableSender[int], random: Random) -> None:
        self._sender, self._random = sender, random
        self.recorded: list[int] = []
        self.delivered: set[tuple[int, ItemKey]] = set()
        self._answer: Callable[[], None] | None = None

    def turn(self) -> None:
        """Answer what was asked, or ask."""
        if self._answer is not None:
            if self._random.random() < 0.5:
                self._answer()
                self._answer = None
            return
        store = self._sender.pulses.wanted()
        if store is None:
            return
        without = self._sender.pulses.keys(store) | {k for s, k in self.delivered if s == store}
        self._sender.stores.note_on_disk(store, on_disk=False)
        items = [((2, n), n) for n in self.recorded if (2, n) not in without]

        def answer() -> None:
            new = [(k, n) for k, n in items if (store, k) not in self.delivered]
            self._sender.pulses.refill(store, new[:20], more=len(items) > 20)

        self._answer = answer


class Station:
    """A ground station with a store of its own; several may call themselves alike."""

    def __init__(self, number: int, place: Ids) -> None:
        self.number, self.place = number, place
        self.got: set[bytes] = set()
        self._due: list[int] = []

    def hear(self, outgoing: TunnelPayload) -> None:
        if outgoing.place in (None, self.place):
            self.got.add(outgoing.payload)
            self._due.append(payload_hash(outgoing.payload))

    def receipt(self) -> list[int]:
        due, self._due = self._due[:15], self._due[15:]
        return due


@pytest.mark.parametrize("seed", range(30))
def test_every_station_gets_every_pulse_and_what_is_inside(seed: int) -> None:
    random, sender = Random(seed), make_sender()
    disk = Disk(sender, random)
    loss = random.choice((0.0, 0.1, 0.3))
    comes_ns = {n: random.randrange(20) * SECOND for n in range(1, random.randrange(2, 5))}
    stations: list[Station] = []
    for tick in range(3000):
        now_ns = tick * SECOND // 10
        if tick % 5 == 0 and len(disk.recorded) < 60:
            number = tick // 5
            sender.pulses.add((2, number), number)
            disk.recorded.append(number)
        for number in [n for n, at_ns in comes_ns.items() if now_ns >= at_ns]:
            del comes_ns[number]
            stations.append(Station(number, random.choice((GROUND, OTHER))))
        disk.turn()
        for outgoing in taken(sender, now_ns):
            for station in stations:
                if random.random() >= loss:
                    station.hear(outgoing)
        for station in stations:
            if random.random() >= loss:
                new = sender.receipt(station.number, station.receipt(), station.place, now_ns)
                for key in new:
                    assert payload_of(key[1]) in station.got, "delivered, and not there"
                disk.delivered |= {(station.number, key) for key in new}
    everything = {payload_of(n) for n in disk.recorded}
    everything |= {p for n in disk.recorded if (p := inside_of(n)) is not None}
    for station in stations:
        assert station.got == everything
    assert len(sender.pulses) == 0
