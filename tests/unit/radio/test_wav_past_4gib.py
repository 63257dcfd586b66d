"""WAV files whose header lacks the number of samples; large ones are sparse."""

import struct
import time
from pathlib import Path

import pytest

from uavrt.radio.files.recording_source import Layout
from uavrt.radio.files.wav import wav_layout

RATE_HZ = 3_000_000
GIB4 = 1 << 32
FORMAT = struct.pack("<HHIIHH", 1, 2, RATE_HZ, 4 * RATE_HZ, 4, 16)
AUXI = b"auxi" + struct.pack("<I", 68)
AUXI += struct.pack("<16H", 2024, 5, 3, 1, 6, 0, 0, 250, *([0] * 8))
AUXI += struct.pack("<I", 148_700_000) + bytes(32)


def write_wav(
    path: Path,
    samples: bytes | int,
    *,
    said: int | None = None,
    before: bytes = b"",
    after: bytes = b"",
    riff: bytes = b"RIFF",
) -> int:
    """Write samples, or a number of zero bytes (sparse); return the number of bytes."""
    count = samples if isinstance(samples, int) else len(samples)
    size = (count if said is None else said) & 0xFFFFFFFF
    head = before + b"fmt " + struct.pack("<I", len(FORMAT)) + FORMAT
    with path.open("wb") as file:
        file.write(riff + struct.pack("<I", size + 36 & 0xFFFFFFFF) + b"WAVE" + head)
        file.write(b"data" + struct.pack("<I", size))
        if isinstance(samples, int):
            file.truncate(file.tell() + samples)
            file.seek(0, 2)
        else:
            file.write(samples)
        file.write(after)
    return count


def layout(path: Path) -> Layout:
    return wav_layout(path, center_frequency_hz=148.7e6)


def described_s(path: Path) -> float:
    """CPU time to describe a file: the least of three, for a busy machine spoils one."""
    spent_s = []
    for _ in range(3):
        begin_s = time.process_time()
        layout(path)
        spent_s.append(time.process_time() - begin_s)
    return min(spent_s)


@pytest.mark.parametrize("more", [0, 24_000_000, 2 * GIB4 + 400])
@pytest.mark.parametrize("after", [b"", AUXI])
def test_a_size_that_overflowed_at_4_gib_is_the_true_one(
    tmp_path: Path, more: int, after: bytes
) -> None:
    path = tmp_path / "a.wav"
    count = write_wav(path, GIB4 + more, after=after)
    found = layout(path)
    if more:
        assert found.segments[0].count == count // 4
        assert (found.start_from == "the file's header") == bool(after)
    else:  # a size of zero is unknown: to the end of the file
        assert found.segments[0].count == (count + len(after)) // 4
    assert found.fault_at_end is None


@pytest.mark.parametrize("said", [4, 5_000_000, 0, 0xFFFFFFFF, 0x7FFFFFFF])
def test_samples_reach_to_the_end_of_a_file_whose_header_was_never_completed(
    tmp_path: Path, said: int
) -> None:
    path = tmp_path / "a.wav"
    noise = bytes(range(1, 256)) * 40_000
    count = write_wav(path, noise[: len(noise) // 4 * 4], said=said)
    assert layout(path).segments[0].count == count // 4


def test_a_file_of_zeros_is_described_at_once(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    count = write_wav(path, GIB4 + 24_000_000, said=400)
    assert described_s(path) < 0.5
    assert layout(path).segments[0].count == count // 4


def test_chunks_after_the_samples_are_no_samples(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    listed = b"LIST" + struct.pack("<I", 5) + b"INFOx\0"
    write_wav(path, bytes(4000), after=AUXI + listed)
    found = wav_layout(path)
    assert found.segments[0].count == 1000
    assert found.center_frequency_hz == 148.7e6


@pytest.mark.parametrize("riff", [b"RF64", b"BW64"])
def test_the_chunk_after_the_samples_of_a_long_file_is_used(
    tmp_path: Path, riff: bytes
) -> None:
    path = tmp_path / "a.wav"
    count = GIB4 + 4000
    sizes = b"ds64" + struct.pack("<IQQQI", 28, count + 72, count, count // 4, 0)
    write_wav(path, count, said=0xFFFFFFFF, before=sizes, after=AUXI, riff=riff)
    found = wav_layout(path)
    assert found.segments[0].count == count // 4
    assert found.start_from == "the file's header"


def test_many_empty_chunks_end_the_search(tmp_path: Path) -> None:
    path = tmp_path / "a.wav"
    write_wav(path, bytes(4000), after=(b"junk" + bytes(4)) * 200_000)
    assert described_s(path) < 0.5
    assert layout(path).segments[0].count >= 1000
