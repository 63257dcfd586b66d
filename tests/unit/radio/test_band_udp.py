"""A band over UDP in datagrams of any size, as netcat cuts it."""

import socket
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from some import some

from uavrt.demo.programs import free_udp_port
from uavrt.radio.band_source import BandDatagramSource, ByteJoiner, misalignment
from uavrt.radio.udp_address import parse_udp_address

RATE_HZ = 375_000.0
START_NS = 1_700_000_000_000_000_000


def signal(count: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (
        (0.01 * rng.standard_normal((count, 2))).astype(np.float32).view(np.complex64).ravel()
    )


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


@settings(max_examples=60)
@given(
    sizes=st.lists(st.integers(1, 40), min_size=1, max_size=60), take_every=st.integers(1, 9)
)
def test_pieces_of_any_size_join_to_the_same_samples(sizes: list[int], take_every: int) -> None:
    data = signal(sum(sizes)).tobytes()
    joiner, parts, at = ByteJoiner(), [], 0
    for number, size in enumerate(sizes * 8):
        joiner.put(data[at : at + size])
        at += size
        if number % take_every == 0:
            parts.append(joiner.take()[0])
    parts.append(joiner.take()[0])
    assert np.concatenate(parts).tobytes() == data


@example(size=1, losses={40, 42})  # a gap within the sample that a gap has cut
@settings(max_examples=200)
@given(
    size=st.integers(1, 50),
    losses=st.sets(st.integers(1, 59), max_size=12),
)
def test_lost_pieces_of_equal_size_leave_every_sample_in_its_place(
    size: int, losses: set[int]
) -> None:
    samples = np.arange(1, 1 + 60 * size // 8).astype(np.complex64)
    data = samples.tobytes()
    joiner, index, found, lost = ByteJoiner(), 0, {}, 0

    def take() -> None:
        nonlocal index
        got, before, _ = joiner.take()
        index += before
        for value in got:
            found[index] = value
            index += 1

    for number in range(60):
        if number in losses:
            lost += 1
            continue
        joiner.put(data[number * size : (number + 1) * size], lost)
        lost = 0
        if joiner.has_gap:
            take()
    take()
    take()
    for place, value in found.items():
        assert value == samples[place]
    whole = {
        n
        for n in range(len(samples))
        if not losses & set(range(8 * n // size, (8 * n + 7) // size + 1))
    }
    assert set(found) == whole


@pytest.mark.parametrize("skip", range(4))
def test_the_exponents_tell_where_floats_begin(skip: int) -> None:
    data = signal(4096).tobytes()
    assert misalignment(data[(4 - skip) % 4 :]) == skip


def test_zeros_and_a_few_bytes_are_left_as_they_are() -> None:
    assert misalignment(bytes(4000)) == 0
    assert misalignment(b"abc" * 20) == 0


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
        sock = socket.socket(socket.AF_INET6, socket.SOCK_DGRAM)
        sock.sendto(signal(100).tobytes(), ("::1", port))
    except OSError:
        # A system without IPv6 has one localhost only.
        assert len(source._sockets) == 1
        return
    sock.close()
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
