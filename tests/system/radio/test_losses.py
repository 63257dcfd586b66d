"""Samples lost without a word in a pipe, while it is read."""

import os
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from uavrt.core.clock import Clock
from uavrt.radio.formats import CS16
from uavrt.radio.sample_stream import StreamSource


@pytest.fixture
def pipe() -> Iterator[tuple[int, int]]:
    reading, writing = os.pipe()
    yield reading, writing
    os.close(reading)


def test_a_gap_in_a_pipe_is_found_while_it_is_read(pipe: tuple[int, int]) -> None:
    """A radio of 250 kS/s that loses 0.2 s after 1.5 s and is stalled once before."""
    rate_hz, write = 250e3, 2048
    reading, writing = pipe

    def send() -> None:
        begin_s, lost_s = time.monotonic(), 0.0
        for number in range(420):
            if number == 190:
                lost_s = 0.2
            due_s = begin_s + lost_s + (number + 1) * write / rate_hz
            if number == 80:
                due_s += 0.12
            time.sleep(max(0.0, due_s - time.monotonic()))
            os.write(writing, np.full(2 * write, number, "<i2").tobytes())
        os.close(writing)

    source = StreamSource(
        reading, CS16, sample_rate_hz=rate_hz, center_frequency_hz=148e6, clock=Clock.start()
    )
    sender = threading.Thread(target=send)
    sender.start()
    gaps, parts = [], []
    try:
        while (block := source.read(timeout_s=5.0)) is not None:
            parts.append(block.samples.real.copy())
            if block.lost_before:
                gaps.append((block.lost_before, round(float(parts[-1][0]) * 32768)))
    except EOFError:
        pass
    sender.join()
    whole = np.round(np.concatenate(parts) * 32768).astype(int)
    np.testing.assert_array_equal(whole, np.repeat(np.arange(420), write))
    assert sum(lost for lost, _ in gaps) == pytest.approx(0.2 * rate_hz, rel=0.1)
    assert source.samples_lost == sum(lost for lost, _ in gaps)
    # The gap lies where it was, within two writes, or half before and half behind.
    assert all(188 <= number <= 194 for _, number in gaps)
