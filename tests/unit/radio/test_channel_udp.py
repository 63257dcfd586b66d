"""Channels over UDP on the loopback: sent, received, lost, out of order."""

import socket
from collections.abc import Iterable, Iterator
from contextlib import closing

import made
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from some import some

from uavrt.core.errors import ConfigError, RadioError
from uavrt.core.messages import ChannelBlock
from uavrt.radio.channels.channel_datagram import encode_channel_datagram
from uavrt.radio.channels.channel_sender import ChannelDatagramSender
from uavrt.radio.channels.channel_source import HELD_FRAMES, ChannelDatagramSource, FrameOrder
from uavrt.radio.udp_address import parse_udp_address
from uavrt.simulation.demo.demo_programs import free_udp_port

RATE_HZ = 3750.0
START_NS = 1_700_000_000_000_000_000
Taken = list[tuple[int, int]]
FRAME_NS = round(1024 * 1e9 / RATE_HZ)


def frame(number: int, start_ns: int = START_NS) -> tuple[int, np.ndarray]:
    """Frame whose samples count on from those of the frame before."""
    return start_ns + number * FRAME_NS, np.arange(1024 * number, 1024 * (number + 1)).astype(
        np.complex64
    )


def taken_of(order: FrameOrder, numbers: Iterable[int], start_ns: int = START_NS) -> Taken:
    """All that can be taken while frames come: each one's number, samples lost before it."""
    found = []
    for number in numbers:
        order.put(*frame(number, start_ns))
        while (got := order.take()) is not None:
            found.append((int(got[1][0].real) // 1024, got[2]))
    return found


@settings(max_examples=50)
@given(st.permutations(range(1, 1 + HELD_FRAMES)))
def test_frames_that_overtake_each_other_are_put_in_order(arrival: list[int]) -> None:
    order = FrameOrder(RATE_HZ)
    found = taken_of(order, (0, *arrival, 5, 6))
    assert found == [(number, 0) for number in range(7)]
    assert order.late == 0


@settings(max_examples=50)
@given(st.sets(st.integers(1, 30), max_size=20))
def test_frames_that_never_come_are_gaps_of_their_length(missing: set[int]) -> None:
    came = [number for number in range(40) if number not in missing]
    found = taken_of(FrameOrder(RATE_HZ), came)
    assert [number for number, _ in found] == came
    # Each gap stands before the frame that follows it.
    index = 0
    for number, lost in found:
        index += lost
        assert index == 1024 * number
        index += 1024


def test_a_frame_after_its_turn_or_twice_is_dropped_and_counted() -> None:
    order = FrameOrder(RATE_HZ)
    found = taken_of(order, (0, 1, 3, 3, 4, 5, 6, 7, 2, 8))
    assert [number for number, _ in found] == [0, 1, 3, 4, 5, 6, 7, 8]
    assert order.late == 2


def test_a_clock_that_is_set_back_starts_anew_after_three_frames() -> None:
    order = FrameOrder(RATE_HZ)
    taken_of(order, range(4))
    found = taken_of(order, range(4, 9), START_NS - 3_600_000_000_000)
    assert found == [(4, 0), (5, 0), (6, 0), (7, 0), (8, 0)]
    assert order.late == 0


def test_stamps_that_creep_are_followed_without_a_gap() -> None:
    order = FrameOrder(RATE_HZ)
    for number in range(2000):
        # A clock 200 ppm off: 109 ms after 2000 frames, 55 µs in each.
        late_ns = number * FRAME_NS // 5000
        assert taken_of(order, [number], START_NS + late_ns) == [(number, 0)]


def listening() -> ChannelDatagramSource:
    return ChannelDatagramSource(
        f"udp://127.0.0.1:{free_udp_port()}",
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=148.71e6,
    )


@pytest.fixture(name="source")
def source_fixture() -> Iterator[ChannelDatagramSource]:
    with closing(listening()) as opened:
        yield opened


def block(first: int, count: int, *, lost: int = 0, channel: int = 45) -> ChannelBlock:
    """Samples that say their index."""
    return made.channel_block(
        np.arange(first, first + count).astype(np.complex64),
        first,
        RATE_HZ,
        start_ns=START_NS,
        channel=channel,
        lost_before=lost,
    )


def test_what_is_sent_arrives_whole_however_the_blocks_are_cut(
    source: ChannelDatagramSource,
) -> None:
    port = parse_udp_address(source.name)[1]
    sender = ChannelDatagramSender({45: [port]})
    rng = np.random.default_rng(1)
    index = 0
    received = []
    while index < 200_000:
        count = int(rng.integers(1, 3000))
        sender.send(block(index, count))
        sender.send(block(index, count, channel=46))  # not asked for
        index += count
        while (got := source.read(0.0)) is not None:
            assert got.lost_before == 0
            received.append(got)
    sender.close()
    assert sender.datagrams == len(received) == index // 1024
    assert sender.dropped == sender.unheard == 0
    samples = np.concatenate([got.samples for got in received])
    np.testing.assert_array_equal(samples, np.arange(len(samples)))
    for got in received:
        assert abs(got.time_ns - START_NS - got.sample_index * 1e9 / RATE_HZ) < 2


def test_a_hundred_channels_in_a_burst_of_a_second_lose_nothing() -> None:
    sources = {channel: listening() for channel in range(100)}
    sender = ChannelDatagramSender(
        {channel: [parse_udp_address(source.name)[1]] for channel, source in sources.items()}
    )
    for channel in sources:
        sender.send(block(0, 4096, channel=channel))
    for source in sources.values():
        for number in range(4):
            # A port that another program used a moment ago may get what was meant for it:
            # that is counted in `refused` and passed over.
            got = some(source.read(5.0))
            time_ns, samples = frame(number)
            np.testing.assert_array_equal(got.samples, samples)
            assert abs(got.time_ns - time_ns) < 2
            assert got.lost_before == 0
        source.close()
    sender.close()
    assert sender.datagrams == 400


def test_nobody_listening_disturbs_nobody() -> None:
    sender = ChannelDatagramSender({45: [free_udp_port()]})
    for number in range(10):
        sender.send(block(1024 * number, 1024))
    sender.close()
    assert sender.datagrams == 10
    assert sender.dropped == 0


def test_what_is_no_frame_is_counted_and_passed_over(source: ChannelDatagramSource) -> None:
    port = parse_udp_address(source.name)[1]
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.sendto(b"hello", ("127.0.0.1", port))
        sock.sendto(encode_channel_datagram(frame(3)[1], START_NS), ("127.0.0.1", port))
    got = some(source.read(5.0))
    assert got.time_ns == START_NS
    assert source.refused == 1


def test_a_port_in_use_is_named(source: ChannelDatagramSource) -> None:
    with pytest.raises(RadioError, match=source.name.removeprefix("udp://")):
        ChannelDatagramSource(source.name, sample_rate_hz=RATE_HZ, center_frequency_hz=148.71e6)


@pytest.mark.parametrize("text", ["udp://", "udp://host", "host:0", "host:70000", ":20", "a:b"])
def test_what_is_no_address_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="UDP address"):
        parse_udp_address(text)


def test_addresses_are_read_with_and_without_their_scheme() -> None:
    assert parse_udp_address("udp://127.0.0.1:20090/") == ("127.0.0.1", 20090)
    assert parse_udp_address("localhost:10000") == ("localhost", 10000)
    assert parse_udp_address("udp://[::1]:10000") == ("::1", 10000)
