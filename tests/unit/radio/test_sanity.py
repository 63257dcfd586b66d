"""What cannot be samples is refused; what can be is let through."""

from contextlib import suppress

import made
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from uavrt.core.errors import RadioGarbled, RadioStalled
from uavrt.core.messages import IQBlock
from uavrt.radio.sanity import DEAD_S, SampleCheck

RATE_HZ = 375_000.0


def block(samples: NDArray[np.complex64]) -> IQBlock:
    return made.iq_block(samples, 0, RATE_HZ)


def noise(rms: float, seed: int = 1, count: int = 32_768) -> NDArray[np.complex64]:
    parts = np.random.default_rng(seed).standard_normal((count, 2), np.float32)
    return (parts.view(np.complex64)[:, 0] * np.float32(rms / np.sqrt(2))).astype(np.complex64)


ALMOST_DEAD = block(np.zeros(round(0.9 * DEAD_S * RATE_HZ), np.complex64))


@given(st.floats(1e-9, 1.0), st.integers(0, 100))
def test_any_level_a_receiver_can_have_ends_a_silence(rms: float, seed: int) -> None:
    check = SampleCheck("the radio")
    check.check(ALMOST_DEAD)
    check.check(block(noise(rms, seed, 4096)))
    check.check(ALMOST_DEAD)
    with pytest.raises(RadioStalled):
        check.check(ALMOST_DEAD)


def test_a_saturated_receiver_is_let_through_and_a_level_above_it_is_not() -> None:
    samples = np.where(np.arange(4096) % 2, 1 + 1j, -1 - 1j).astype(np.complex64)
    SampleCheck("the radio").check(block(samples))
    with pytest.raises(RadioGarbled):
        SampleCheck("the radio").check(block(2.0 * samples))


@given(st.binary(max_size=256))
@settings(max_examples=20)
def test_random_bytes_never_raise_anything_else(content: bytes) -> None:
    samples = np.frombuffer(content[: len(content) // 8 * 8], np.complex64)
    check = SampleCheck("the radio")
    with suppress(RadioGarbled):
        check.check(block(samples))
    check.check(block(noise(0.01)))
    with pytest.raises(RadioGarbled):
        check.check(block(np.full(8, np.nan, np.complex64)))


@pytest.mark.parametrize("seed", range(5))
def test_a_block_of_random_bytes_is_refused(seed: int) -> None:
    content = np.random.default_rng(seed).bytes(8 * 32_768)
    with pytest.raises(RadioGarbled, match="the radio sends values that are not samples"):
        SampleCheck("the radio").check(block(np.frombuffer(content, np.complex64)))


@pytest.mark.parametrize("shift", range(1, 4))
def test_samples_cut_within_a_number_are_refused(shift: int) -> None:
    content = noise(0.01).tobytes()[shift : shift - 8]
    with pytest.raises(RadioGarbled):
        SampleCheck("the radio").check(block(np.frombuffer(content, np.complex64)))


def test_zeros_are_borne_for_a_second_and_forgiven_by_one_sample() -> None:
    check = SampleCheck("the radio")
    zeros = block(np.zeros(round(0.45 * DEAD_S * RATE_HZ), np.complex64))
    for _ in range(5):
        check.check(zeros)
        check.check(zeros)
        check.check(block(noise(1e-6)))
    check.check(zeros)
    check.check(zeros)
    with pytest.raises(RadioStalled, match="only zeros"):
        check.check(zeros)


def test_an_empty_block_neither_ends_nor_lengthens_a_silence() -> None:
    check = SampleCheck("the radio")
    check.check(ALMOST_DEAD)
    for _ in range(100):
        check.check(block(np.zeros(0, np.complex64)))
    with pytest.raises(RadioStalled):
        check.check(ALMOST_DEAD)
