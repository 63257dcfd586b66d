"""A band over UDP in datagrams of any size, as netcat cuts it."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from uavrt.radio.band_source import ByteJoiner, misalignment

RATE_HZ = 375_000.0
START_NS = 1_700_000_000_000_000_000


def signal(count: int, seed: int = 1) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return (
        (0.01 * rng.standard_normal((count, 2))).astype(np.float32).view(np.complex64).ravel()
    )


@settings(deadline=None, max_examples=60)
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
@given(size=st.integers(1, 50), losses=st.sets(st.integers(1, 59), max_size=12))
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
