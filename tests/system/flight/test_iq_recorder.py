"""A slow or full disk costs the recording of samples, never a caller's time."""

import os
import resource
import select
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import sigmf
from forked import in_child
from tests.unit.flight.test_iq_recorder import BLOCK, block, check_places, recorder
from until import until


@contextmanager
def stuck_disk(path: Path) -> Iterator[int]:
    """Make a pipe in the place of the data file: it takes 64 kB and then nothing more."""
    os.mkfifo(path)
    reader = os.open(path, os.O_RDONLY | os.O_NONBLOCK)
    try:
        yield reader
    finally:
        os.close(reader)


def test_a_stuck_disk_drops_blocks_and_never_holds_up_the_caller(tmp_path: Path) -> None:
    with stuck_disk(tmp_path / "band.sigmf-data") as reader:
        recording = recorder(tmp_path / "band")
        taken = [recording.put(block(number)) for number in range(400)]  # 8 s of samples
        # Two seconds may wait, beside what the pipe took and the block in the writer's hand.
        assert 90 <= sum(taken) <= 105
        assert recording.dropped_samples == taken.count(False) * BLOCK
        assert not any(taken[110:])

        # The disk comes back: what waited is written, then the newest samples after one gap.
        content = bytearray()
        number, accepted = 400, 0
        while accepted < 20:
            content += drained(reader)
            accepted += recording.put(block(number))
            number += 1
        closer = threading.Thread(target=recording.close, name="closer")
        closer.start()
        while closer.is_alive():
            content += drained(reader)
        content += drained(reader)
    (tmp_path / "band.sigmf-data").unlink()
    (tmp_path / "band.sigmf-data").write_bytes(content)
    assert len(content) == recording.written_samples * 4
    assert recording.written_samples + recording.dropped_samples == number * BLOCK
    assert recording.file.gaps >= 1
    check_places(recording)
    sigmf.fromfile(str(recording.file.metadata_path)).validate()


def drained(reader: int) -> bytes:
    """Take what the pipe holds, waiting a moment for it."""
    select.select([reader], [], [], 0.02)
    try:
        return os.read(reader, 1 << 20)
    except BlockingIOError:
        return b""


def record_beyond_a_full_disk(place: Path) -> tuple[int, int, int, str | None]:
    """Record ten blocks, ten of which two and a half have room, and ten more."""
    recording = recorder(place)

    def put(first: int) -> None:
        for number in range(first, first + 10):
            recording.put(block(number))
        end = (first + 10) * BLOCK
        until(lambda: recording.written_samples + recording.dropped_samples >= end)

    infinite = resource.RLIM_INFINITY
    put(0)
    # The half block must be taken back.
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(12.5 * BLOCK * 4), infinite))
    put(10)
    assert recording.trouble, "a full disk must be told"
    resource.setrlimit(resource.RLIMIT_FSIZE, (infinite, infinite))
    put(20)
    recording.close()
    check_places(recording)
    assert recording.file.data_path.stat().st_size == recording.written_samples * 4
    counted = recording.written_samples, recording.dropped_samples
    return *counted, recording.file.gaps, recording.trouble


def test_a_full_disk_costs_the_blocks_of_its_time_and_no_others(tmp_path: Path) -> None:
    told = in_child(record_beyond_a_full_disk, tmp_path / "band")
    assert told == (22 * BLOCK, 8 * BLOCK, 1, None)
