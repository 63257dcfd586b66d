"""Samples of a band by UDP, as a reader waits for them."""

import socket
from collections.abc import Iterator

import numpy as np
import pytest
from some import some
from tests.unit.radio.test_band_udp import RATE_HZ, START_NS, signal

from uavrt.radio.band_source import BandDatagramSource
from uavrt.radio.udp_address import parse_udp_address
from uavrt.simulation.demo.demo_programs import free_udp_port


@pytest.fixture
def source() -> Iterator[BandDatagramSource]:
    opened = BandDatagramSource(
        f"udp://localhost:{free_udp_port()}",
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=148.7e6,
        start_time_ns=START_NS,
    )
    yield opened
    opened.close()


def test_a_stream_in_datagrams_of_ever_other_sizes_arrives_whole(
    source: BandDatagramSource,
) -> None:
    samples = signal(400_000)
    data = samples.tobytes()
    rng = np.random.default_rng(2)
    place = ("127.0.0.1", parse_udp_address(source.name)[1])
    received, at = [], 0
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        while at < len(data):
            size = int(rng.integers(1, 16_384))
            sock.sendto(data[at : at + size], place)
            at += size
            if at % 5 == 0 and (block := source.read(0.0)) is not None:
                received.append(block)
    while (block := source.read(0.2)) is not None:
        received.append(block)
    assert source.samples_lost == source.realigned == 0
    np.testing.assert_array_equal(np.concatenate([b.samples for b in received]), samples)
    index = 0
    for block in received:
        assert block.sample_index == index
        assert abs(block.time_ns - START_NS - index * 1e9 / RATE_HZ) < 2
        index += len(block.samples)


def test_a_sender_to_the_other_localhost_is_heard_too(source: BandDatagramSource) -> None:
    port = parse_udp_address(source.name)[1]
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as sock:
            sock.sendto(signal(100).tobytes(), ("::1", port))
    except OSError:
        # A system without IPv6 has one localhost only.
        assert len(source._sockets) == 1
        return
    block = some(source.read(0.5))
    np.testing.assert_array_equal(block.samples, signal(100))


def test_samples_that_are_not_numbers_become_zeros(source: BandDatagramSource) -> None:
    bad = signal(200)
    bad[7] = complex(np.nan, np.inf)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.sendto(bad.tobytes(), ("127.0.0.1", parse_udp_address(source.name)[1]))
    block = some(source.read(0.5))
    bad[7] = 0.0
    np.testing.assert_array_equal(block.samples, bad)
