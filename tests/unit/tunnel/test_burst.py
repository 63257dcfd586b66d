"""What is inside a burst of a coded tag, on the wire and through a link that loses."""

import struct
from random import Random
from typing import Any

import made
import pytest
from hypothesis import given
from hypothesis import strategies as st
from some import some

from uavrt.core.errors import TunnelError
from uavrt.core.messages import BurstInside, Delivered, Pulse, PulsePose
from uavrt.drone.processes.connection_parts.pulse_outlet import PulseOutlet
from uavrt.link.tunnel.drone_exchange import Exchange
from uavrt.link.tunnel.generations.wire import MAX_PAYLOAD
from uavrt.link.tunnel.own_messages.burst import BURST_TYPE, decode_burst, encode_burst
from uavrt.link.tunnel.own_messages.private import Receipt, payload_hash

START_NS = 1_795_000_000_123_456_789
SECOND = 1_000_000_000
GROUND = (255, 190)


def burst_of(tag_id: int = 7, start_ns: int = START_NS, **fields: Any) -> Pulse:
    given: dict[str, Any] = {
        "burst_starts_ns": tuple(start_ns + ms * 1_000_000 for ms in (0, 25, 80, 111)),
        "burst_snrs_db": (11.25, 10.5, 12.0, -0.75),
        "also_possible_tag_ids": (9,),
    }
    given |= {"tag_id": tag_id, "frequency_hz": 150e6, "end_time_ns": start_ns + 2_500_000}
    return made.pulse(start_ns, snr_db=11.0, score=1.5, noise_psd=1e-9, **(given | fields))


def test_the_bytes_are_those_of_the_manual() -> None:
    pulse = burst_of(start_ns=1_795_000_000 * SECOND)
    payload = some(encode_burst(pulse))
    assert payload.hex(" ", -4) == (
        "01040100 07000000 000000b0 61bfda41 00000000 90d00300 00350c00 f0ef1000 65041a04"
        " b004b5ff 09000000"
    )
    assert decode_burst(payload) == BurstInside(
        tag_id=7,
        start_time_ns=pulse.start_time_ns,
        burst_starts_ns=pulse.burst_starts_ns,
        burst_snrs_db=pulse.burst_snrs_db,
        also_possible_tag_ids=(9,),
    )
    assert encode_burst(burst_of(burst_starts_ns=(), burst_snrs_db=())) is None


def test_the_longest_burst_fits_a_message() -> None:
    starts_ns = tuple(START_NS + n * 30_000_000 for n in range(8))
    pulse = burst_of(
        burst_starts_ns=starts_ns, burst_snrs_db=(999.0,) * 8, also_possible_tag_ids=(1,) * 20
    )
    payload = some(encode_burst(pulse))
    assert len(payload) <= MAX_PAYLOAD
    found = decode_burst(payload)
    assert len(found.also_possible_tag_ids) == 7
    # The wire's seconds are good to a quarter of a microsecond, and all pulses go with them.
    assert all(abs(a - b) < 500 for a, b in zip(found.burst_starts_ns, starts_ns, strict=True))


@given(st.binary(max_size=MAX_PAYLOAD))
def test_any_bytes_are_a_burst_or_refused(payload: bytes) -> None:
    try:
        found = decode_burst(payload)
    except TunnelError:
        return
    assert 1 <= len(found.burst_starts_ns) == len(found.burst_snrs_db) <= 8


@pytest.mark.parametrize(
    ("offset", "layout", "value", "said"),
    [
        (0, "<B", 2, "has version 2, not 1"),
        (1, "<B", 0, "0 pulses"),
        (1, "<B", 3, "bytes, not"),
        (2, "<B", 200, "has 200 others"),
        (8, "<d", float("nan"), "start_s nan"),
        (8, "<d", 1e10, r"start_s 1e\+10"),
        (20, "<i", -5, "impossible times"),
        (28, "<i", 700_000_000, "impossible times"),
    ],
)
def test_a_burst_that_cannot_be_is_refused(
    offset: int, layout: str, value: float, said: str
) -> None:
    payload = bytearray(encode_burst(burst_of()) or b"")
    struct.pack_into(layout, payload, offset, value)
    with pytest.raises(TunnelError, match=said):
        decode_burst(bytes(payload))


class Station:
    """The ground's half of a trial: keeps what comes, acknowledges what it reads."""

    def __init__(self) -> None:
        self.pulses: set[bytes] = set()
        self.insides: dict[tuple[int, int], BurstInside] = {}
        self._due: list[int] = []

    def take(self, payload_type: int, payload: bytes) -> None:
        if payload_type == BURST_TYPE:
            inside = decode_burst(payload)
            self.insides[inside.tag_id, round(inside.start_time_ns / 1e6)] = inside
        else:
            self.pulses.add(payload)
        self._due.append(payload_hash(payload))

    def receipt(self) -> bytes:
        hashes, self._due = self._due[:15], self._due[15:]
        return Receipt(store=77, hashes=tuple(hashes)).encode()


def fly(
    pulses: list[Pulse], station: Station, *, loss: float
) -> tuple[PulseOutlet, list[tuple[int, int]], dict[int, int]]:
    """Send pulses a second apart through a link that loses both ways, until all is quiet."""
    delivered: list[Delivered] = []
    outlet = PulseOutlet(Exchange().pulse, delivered.append)
    outlet.sender.station_present(True, 0)
    random, now_ns, sent = Random(3), 0, {0: 0, BURST_TYPE: 0}
    waiting = list(pulses)
    while (waiting or len(outlet.sender.pulses)) and now_ns < 600 * SECOND:
        now_ns += SECOND // 10
        if waiting and now_ns % SECOND == 0:
            outlet.add(PulsePose(pulse=waiting.pop(0), pose=None))
        outlet.tick(now_ns)
        while (given := outlet.sender.take(now_ns, 1200.0)) is not None:
            sent[given.payload_type] += 1
            if random.random() >= loss:
                station.take(given.payload_type, given.payload)
        if now_ns % (SECOND // 5) == 0:
            receipt = station.receipt()
            if random.random() >= loss:
                outlet.receipt(receipt, GROUND, now_ns)
    outlet.tick(now_ns)
    return outlet, [key for one in delivered for key in one.pulses], sent


def bursts(count: int) -> list[Pulse]:
    return [burst_of(start_ns=START_NS + n * SECOND) for n in range(count)]


def test_no_inside_of_a_burst_is_lost_at_20_percent_loss() -> None:
    pulses, station = bursts(60), Station()
    _, delivered, _ = fly(pulses, station, loss=0.2)
    assert len(station.pulses) == 60
    assert set(station.insides) == {(7, round(p.start_time_ns / 1e6)) for p in pulses}
    assert set(delivered) == {pulse.key for pulse in pulses}


def test_a_burst_is_delivered_with_its_inside_and_not_before() -> None:
    station, pulses = Station(), bursts(1)
    outlet = PulseOutlet(Exchange().pulse, lambda _delivered: None)
    sender = outlet.sender
    sender.station_present(True, 0)
    outlet.receipt(Receipt(store=77).encode(), GROUND, 0)
    outlet.add(PulsePose(pulse=pulses[0], pose=None))
    first = some(sender.take(SECOND, 1200.0))
    assert (first.payload_type, first.place) == (0, None), "as ever, to all"
    assert sender.take(SECOND, 1200.0) is None
    assert sender.receipt(77, [payload_hash(first.payload)], GROUND, SECOND) == []
    second = some(sender.take(SECOND, 1200.0))
    assert (second.payload_type, second.place) == (BURST_TYPE, GROUND)
    assert sender.pulses.keys(77) == {pulses[0].key}, (
        "it is not fetched from the disk meanwhile"
    )
    station.take(second.payload_type, second.payload)
    number = payload_hash(second.payload)
    assert sender.receipt(77, [number], GROUND, 2 * SECOND) == [pulses[0].key]
    assert len(sender.pulses) == 0


def test_a_beep_has_no_inside() -> None:
    pulse = burst_of(burst_starts_ns=(), burst_snrs_db=(), also_possible_tag_ids=())
    outlet, delivered, sent = fly([pulse], Station(), loss=0.0)
    assert delivered == [pulse.key]
    assert sent == {0: 1, BURST_TYPE: 0}
    assert "burst_insides_sent" not in outlet.counters()
