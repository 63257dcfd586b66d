import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from uavrt.ipc import samples as samples_module
from uavrt.ipc.sample_sockets import make_sample_sockets
from uavrt.ipc.samples import MAX_SAMPLES, ChannelReceiver, ChannelSender
from uavrt.messages import ChannelBlock

RATE_HZ = 7500.0


def block(start: int, count: int, channel: int = 3) -> ChannelBlock:
    return ChannelBlock(
        channel=channel,
        center_frequency_hz=148.71e6,
        samples=(np.arange(start, start + count) * (1 + 1j)).astype(np.complex64),
        sample_index=start,
        time_ns=round(start * 1e9 / RATE_HZ),
        sample_rate_hz=RATE_HZ,
    )


@given(st.lists(st.integers(1, 3 * MAX_SAMPLES), min_size=1, max_size=4))
def test_samples_arrive_whole_and_with_their_times(sizes: list[int]) -> None:
    ours, theirs = make_sample_sockets()
    with ours, theirs:
        sender, receiver = ChannelSender(ours), ChannelReceiver(theirs)
        start = 0
        for size in sizes:
            sender.send(block(start, size))
            start += size
        got = []
        while (part := receiver.receive()) is not None:
            assert part.lost_before == 0
            assert abs(part.time_ns - part.sample_index * 1e9 / RATE_HZ) <= 1
            got.append(part.samples)
            sender.flush()
        np.testing.assert_array_equal(np.concatenate(got), block(0, start).samples)


def test_a_stalled_detector_loses_the_oldest_samples_and_they_are_counted() -> None:
    ours, theirs = make_sample_sockets()
    with ours, theirs:
        sender, receiver = ChannelSender(ours), ChannelReceiver(theirs)
        sent = 0
        while sender.samples_dropped == 0:
            sender.send(block(sent, MAX_SAMPLES))
            sent += MAX_SAMPLES
        received = lost = 0
        while (part := receiver.receive()) is not None:
            received += len(part.samples)
            lost += part.lost_before
            sender.flush()
        assert lost == sender.samples_dropped
        assert received + lost == sent


def test_two_channels_on_one_socket_are_counted_apart() -> None:
    ours, theirs = make_sample_sockets()
    with ours, theirs:
        sender, receiver = ChannelSender(ours), ChannelReceiver(theirs)
        sender.send(block(0, 100, channel=1))
        sender.send(block(5000, 100, channel=2))
        sender.send(block(100, 100, channel=1))
        sender.send(block(5150, 100, channel=2))
        parts = [receiver.receive() for _ in range(4)]
        assert [part.lost_before for part in parts if part] == [0, 0, 0, 50]


def test_a_datagram_too_short_is_refused_and_counted() -> None:
    ours, theirs = make_sample_sockets()
    with ours, theirs:
        receiver = ChannelReceiver(theirs)
        ours.send(b"short")
        assert receiver.receive() is None
        assert receiver.refused == 1


def test_the_header_is_32_bytes() -> None:
    assert samples_module.HEADER.size == 32
