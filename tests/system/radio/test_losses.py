"""Samples lost without a word in a pipe, while it is read."""

import fcntl
import os
import termios
from collections.abc import Iterator

import numpy as np
import pytest

from uavrt.core.clock import Clock
from uavrt.radio.formats import CS16
from uavrt.radio.sample_stream import StreamSource

RATE_HZ, WRITE = 250e3, 2048


class Stepped(Clock):
    """Stands where the test sets it, however late the computer is."""

    time_s = 1000.0

    def now_ns(self) -> int:
        return round(self.time_s * 1e9)


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    reading, writing = os.pipe()
    yield reading, writing
    os.close(reading)


def unread(descriptor: int) -> bool:
    """Whether the pipe holds bytes."""
    return any(fcntl.ioctl(descriptor, termios.FIONREAD, bytes(4)))


def test_a_gap_in_a_pipe_is_found_while_it_is_read(
    pipe: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A radio of 250 kS/s that loses 0.2 s after 1.5 s and is stalled once before."""
    reading, writing = pipe
    source = StreamSource(
        reading, CS16, sample_rate_hz=RATE_HZ, center_frequency_hz=148e6, clock=Stepped(0)
    )
    gaps, parts = [], []

    def take(timeout_s: float) -> None:
        if (block := source.read(timeout_s=timeout_s)) is None:
            return
        parts.append(block.samples.real.copy())
        if block.lost_before:
            gaps.append((block.lost_before, round(float(parts[-1][0]) * 32768)))

    take(0.001)
    begin_s = Stepped.time_s
    for number in range(420):
        stalled_s = 0.12 if number == 80 else 0.0
        lost_s = 0.2 if number >= 190 else 0.0
        due_s = begin_s + lost_s + stalled_s + (number + 1) * WRITE / RATE_HZ
        monkeypatch.setattr(Stepped, "time_s", max(Stepped.time_s, due_s))
        os.write(writing, np.full(2 * WRITE, number, "<i2").tobytes())
        while unread(reading):
            take(0.002)
    os.close(writing)

    def take_the_rest() -> None:
        while True:
            take(60.0)

    with pytest.raises(EOFError):
        take_the_rest()
    whole = np.round(np.concatenate(parts) * 32768).astype(int)
    np.testing.assert_array_equal(whole, np.repeat(np.arange(420), WRITE))
    assert sum(lost for lost, _ in gaps) == pytest.approx(0.2 * RATE_HZ, rel=0.1)
    assert source.samples_lost == sum(lost for lost, _ in gaps)
    # The gap lies where it was, within two writes, or half before and half behind.
    assert all(188 <= number <= 194 for _, number in gaps)
