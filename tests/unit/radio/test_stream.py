import os
import threading
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from some import some

from uavrt.core.errors import FormatError
from uavrt.radio.formats import CF32, CS16
from uavrt.radio.opening import open_stream
from uavrt.radio.sample_stream import StreamSource

RATE_HZ = 250_000.0
CENTER_HZ = 148.7e6


@pytest.fixture(name="pipe")
def pipe_fixture() -> Iterator[tuple[int, int]]:
    reading, writing = os.pipe()
    yield reading, writing
    for descriptor in (reading, writing):
        try:
            os.close(descriptor)
        except OSError:
            continue


def source(reading: int, stored: object = CF32, **options: object) -> StreamSource:
    return StreamSource(
        reading,
        stored,  # type: ignore[arg-type]
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=CENTER_HZ,
        **options,  # type: ignore[arg-type]
    )


def drain(stream: StreamSource) -> np.ndarray:
    parts = []
    try:
        while (block := stream.read(timeout_s=10.0)) is not None:
            parts.append(block.samples.copy())
    except EOFError:
        pass
    return np.concatenate(parts)


@settings(max_examples=20)
@given(
    sizes=st.lists(st.integers(1, 5000), min_size=1, max_size=30),
    repeat=st.integers(1, 40),
    tail=st.integers(0, 3),
)
def test_writes_of_any_size_give_the_same_samples(
    sizes: list[int], repeat: int, tail: int
) -> None:
    written = np.arange(sum(sizes) * repeat, dtype=np.uint8).tobytes()
    written = written[: len(written) // 4 * 4]
    if not written:
        return
    reading, writing = os.pipe()

    def write() -> None:
        at = 0
        for size in sizes * repeat:
            os.write(writing, written[at : at + size])
            at += size
        os.write(writing, bytes(tail))
        os.close(writing)

    writer = threading.Thread(target=write, name="writer")
    writer.start()
    stream = source(reading, CS16)
    read = drain(stream)
    writer.join()
    os.close(reading)
    back = (read.view(np.float32) * 32768).round().astype("<i2").tobytes()
    assert back == written
    assert stream.trailing_bytes == tail


def test_an_empty_stream_is_refused_with_the_remedy(pipe: tuple[int, int]) -> None:
    reading, writing = pipe
    stream = source(reading)
    os.close(writing)
    with pytest.raises(FormatError, match="no samples came"):
        stream.read()


def test_integers_piped_as_floats_are_refused(pipe: tuple[int, int]) -> None:
    reading, writing = pipe
    stream = source(reading)
    rng = np.random.default_rng(2)
    os.write(writing, rng.integers(-3000, 3000, 60_000).astype("<i2").tobytes())
    os.close(writing)
    with pytest.raises(FormatError, match="--format"):
        stream.read()


def test_a_start_time_given_rules_the_times(pipe: tuple[int, int]) -> None:
    reading, writing = pipe
    stream = source(reading, start_time_ns=5_000_000_000)
    os.write(writing, bytes(8 * 50_000))
    first = some(stream.read())
    count = len(first.samples)
    second = some(stream.read())
    assert first.time_ns == 5_000_000_000
    assert second.time_ns == 5_000_000_000 + round(count / RATE_HZ * 1e9)


def test_memory_of_a_block_is_used_again(pipe: tuple[int, int]) -> None:
    reading, writing = pipe
    stream = source(reading, CS16)
    os.write(writing, bytes(4 * 60_000))
    first, second = stream.read(), stream.read()
    assert np.shares_memory(some(first).samples, some(second).samples)


@pytest.mark.parametrize(
    ("name", "options", "remedy"),
    [
        ("sigmf", {}, "pipe"),
        ("wav", {}, "pipe"),
        ("mp3", {}, "--format"),
        ("cu8", {"sample_rate_hz": None}, "--sample-rate"),
        ("cu8", {"center_frequency_hz": None}, "--center-frequency"),
        (None, {"sample_rate_hz": float("nan")}, "--sample-rate"),
        (None, {"center_frequency_hz": -1.0}, "--center-frequency"),
    ],
)
def test_a_stream_that_is_not_fully_described_is_refused(
    pipe: tuple[int, int], name: str | None, options: dict[str, float | None], remedy: str
) -> None:
    told: dict[str, float | None] = {
        "sample_rate_hz": RATE_HZ,
        "center_frequency_hz": CENTER_HZ,
    }
    with pytest.raises(FormatError, match=remedy):
        open_stream(pipe[0], name, **(told | options))  # type: ignore[arg-type]
