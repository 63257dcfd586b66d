from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace

import made
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from uavrt.core.messages import ChannelBlock
from uavrt.drone.ipc.sample_datagrams import (
    ENVELOPE,
    HEADER,
    MAX_CARRIERS,
    MAX_DATAGRAM_BYTES,
    MAX_SAMPLES,
    MAX_STRETCHES,
    ChannelReceiver,
    ChannelSender,
)
from uavrt.drone.supervisor.tree.process_tree import make_sample_sockets

RATE_HZ = 7500.0


@contextmanager
def road() -> Iterator[tuple[ChannelSender, ChannelReceiver]]:
    """The way of samples from the receiver to a worker."""
    ours, theirs = make_sample_sockets()
    with ours, theirs:
        yield ChannelSender(ours), ChannelReceiver(theirs)


def received(receiver: ChannelReceiver, sender: ChannelSender) -> Iterator[ChannelBlock]:
    """All blocks, while the sender sends what the socket had no place for."""
    while blocks := receiver.receive():
        yield from blocks
        sender.flush()


def block(start: int, count: int, channel: int = 3) -> ChannelBlock:
    return made.channel_block(
        (np.arange(start, start + count) * (1 + 1j)).astype(np.complex64),
        start,
        RATE_HZ,
        channel=channel,
    )


@given(st.lists(st.integers(1, 3 * MAX_SAMPLES), min_size=1, max_size=4))
def test_samples_arrive_whole_and_with_their_times(sizes: list[int]) -> None:
    with road() as (sender, receiver):
        start = 0
        for size in sizes:
            sender.send(block(start, size))
            sender.flush()
            start += size
        got = []
        for part in received(receiver, sender):
            assert part.lost_before == 0
            assert abs(part.time_ns - part.sample_index * 1e9 / RATE_HZ) <= 1
            got.append(part.samples)
        np.testing.assert_array_equal(np.concatenate(got), block(0, start).samples)


def test_a_stalled_detector_loses_the_oldest_samples_and_they_are_counted() -> None:
    with road() as (sender, receiver):
        sent = 0
        while sender.samples_dropped == 0:
            sender.send(block(sent, MAX_SAMPLES))
            sender.flush()
            sent += MAX_SAMPLES
        came = lost = 0
        for part in received(receiver, sender):
            came += len(part.samples)
            lost += part.lost_before
        assert lost == sender.samples_dropped
        assert came + lost == sent


def test_two_channels_on_one_socket_are_counted_apart() -> None:
    with road() as (sender, receiver):
        sender.send(block(0, 100, channel=1))
        sender.send(block(5000, 100, channel=2))
        sender.send(block(100, 100, channel=1))
        sender.send(block(5150, 100, channel=2))
        sender.flush()
        assert [part.lost_before for part in receiver.receive()] == [0, 0, 0, 50]


@given(st.integers(1, 100), st.integers(1, 2000))
def test_the_channels_of_a_radio_block_travel_together(channels: int, count: int) -> None:
    with road() as (sender, receiver):
        for channel in range(channels):
            sender.send(block(0, count, channel))
        assert not receiver.receive()
        sender.flush()
        complete = []
        channels_seen = []
        while blocks := receiver.receive():
            channels_seen += [part.channel for part in blocks]
            complete.append(receiver.complete)
            sender.flush()
        assert channels_seen == list(range(channels))
        assert complete == [False] * (len(complete) - 1) + [True]
        size = channels * (HEADER.size + 8 * count)
        assert len(complete) <= 1 + size // (MAX_DATAGRAM_BYTES - 8 * count - 100)


@pytest.mark.parametrize(
    "datagram",
    [
        b"short",
        ENVELOPE.pack(0, 0, 0, 0),
        ENVELOPE.pack(1, 0, 0, 0) + bytes(HEADER.size - 1),
        ENVELOPE.pack(1, 0, 0, 0) + HEADER.pack(0, 0, 0.0, 0.0, 0, 3) + bytes(16),
        ENVELOPE.pack(1, 0, 0, 0) + HEADER.pack(0, 0, 0.0, 0.0, 0, 3) + bytes(32),
        ENVELOPE.pack(1, 0, 1, 0) + HEADER.pack(0, 0, 0.0, 0.0, 0, 0),
        ENVELOPE.pack(1, 0, 2**16 - 1, 0) + bytes(100),
        ENVELOPE.pack(1, 0, 0, 1) + HEADER.pack(0, 0, 0.0, 0.0, 0, 0),
        ENVELOPE.pack(1, 0, 0, 2**16 - 1) + bytes(100),
    ],
)
def test_a_datagram_that_is_no_blocks_is_refused_and_counted(datagram: bytes) -> None:
    ours, theirs = make_sample_sockets()
    with ours, theirs:
        receiver = ChannelReceiver(theirs)
        ours.send(datagram)
        assert receiver.receive() == []
        assert receiver.refused == 1


def test_a_datagram_begins_with_8_bytes_and_a_block_with_32() -> None:
    ours, theirs = make_sample_sockets()
    with ours, theirs:
        sender = ChannelSender(ours)
        sender.send(block(2, 1))
        sender.flush()
        head = "01000000 00000000 0200000000000000 ab11040000000000"
        tail = "000000e044baa141 0060ea45 0300 0100 00000040 00000040"
        assert theirs.recv(1000).hex() == (head + tail).replace(" ", "")


def test_when_the_converter_was_at_its_limits_is_told_once_for_all_channels() -> None:
    with road() as (sender, receiver):
        times_ns = ((5, 9), (2**60, 2**60 + 1))
        for channel in (1, 2):
            sender.send(replace(block(0, 100, channel), clipped_ns=times_ns))
        sender.flush()
        sender.send(block(100, 100, 1))
        sender.flush()
        one, two = receiver.receive()
        assert one.clipped_ns == times_ns
        assert one.clipped_ns is two.clipped_ns
        np.testing.assert_array_equal(two.samples, block(0, 100).samples)
        assert receiver.receive()[0].clipped_ns == ()


@given(st.integers(0, 3000), st.integers(1, 4), st.integers(1, 2 * MAX_SAMPLES))
def test_as_many_clipped_stretches_as_there_may_be_cost_no_sample(
    stretches: int, channels: int, count: int
) -> None:
    with road() as (sender, receiver):
        times_ns = tuple((2 * n, 2 * n + 1) for n in range(stretches))
        for channel in range(channels):
            sender.send(replace(block(0, count, channel), clipped_ns=times_ns))
        sender.flush()
        got = list(received(receiver, sender))
        assert sum(len(part.samples) for part in got) == channels * count
        assert got[0].clipped_ns == times_ns[-MAX_STRETCHES:]
        assert receiver.refused == 0


def test_the_bytes_of_a_clipped_stretch() -> None:
    ours, theirs = make_sample_sockets()
    with ours, theirs:
        sender = ChannelSender(ours)
        sender.send(replace(block(2, 1), clipped_ns=((1, 258),)))
        sender.flush()
        head = "01000000 01000000 0100000000000000 0201000000000000 0200000000000000"
        assert theirs.recv(1000).hex().startswith(head.replace(" ", ""))


@given(st.lists(st.floats(1e6, 6e9), max_size=MAX_CARRIERS))
def test_the_carriers_of_the_band_come_with_every_block(carriers_hz: list[float]) -> None:
    with road() as (sender, receiver):
        for channel in (1, 2):
            sender.send(replace(block(0, 100, channel), carriers_hz=tuple(carriers_hz)))
        sender.flush()
        assert [part.carriers_hz for part in receiver.receive()] == [tuple(carriers_hz)] * 2
        sender.send(block(100, 100))
        sender.flush()
        assert receiver.receive()[0].carriers_hz == ()
