"""Streams that are waited for."""

import os
import threading

import numpy as np
from tests.unit.radio.test_stream import drain, pipe_fixture, source  # noqa: F401  # fixture


def test_no_block_within_the_timeout_is_none_and_nothing_is_lost(pipe: tuple[int, int]) -> None:
    reading, writing = pipe
    stream = source(reading)
    samples = np.arange(30_000).astype(np.complex64)
    os.write(writing, samples[:100].tobytes())
    assert stream.read(timeout_s=0.02) is None
    assert stream.read(timeout_s=0.0) is None
    os.write(writing, samples[100:].tobytes())
    os.close(writing)
    np.testing.assert_array_equal(drain(stream), samples)


def test_a_descriptor_that_does_not_block_is_waited_for(pipe: tuple[int, int]) -> None:
    reading, writing = pipe
    os.set_blocking(reading, False)
    stream = source(reading)

    def write() -> None:
        os.write(writing, bytes(8000))
        os.close(writing)

    timer = threading.Timer(0.05, write)
    timer.start()
    assert len(drain(stream)) == 1000
    timer.join()
