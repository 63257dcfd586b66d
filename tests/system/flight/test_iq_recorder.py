"""A slow or full disk costs the recording of samples, never a caller's time."""

import json
import os
import select
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import sigmf
from command_line import python
from tests.unit.flight.test_iq_recorder import BLOCK, block, check_places, recorder


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


FULL_DISK = """
import json, resource, sys
sys.path[:0] = [sys.argv[2], sys.argv[2] + "/tests/drivers"]
from pathlib import Path
from tests.unit.flight.test_iq_recorder import BLOCK, block, check_places, recorder
import time

recording = recorder(Path(sys.argv[1]))
def put(numbers):
    for number in numbers:
        recording.put(block(number))
    while recording.written_samples + recording.dropped_samples < (numbers[-1] + 1) * BLOCK:
        time.sleep(0.01)
infinite = resource.RLIM_INFINITY
put(range(10))
# Room for two blocks and a half: the half must be taken back.
resource.setrlimit(resource.RLIMIT_FSIZE, (int(12.5 * BLOCK * 4), infinite))
put(range(10, 20))
assert recording.trouble, "a full disk must be told"
resource.setrlimit(resource.RLIMIT_FSIZE, (infinite, infinite))
put(range(20, 30))
recording.close()
check_places(recording)
print(json.dumps([recording.written_samples, recording.dropped_samples, recording.file.gaps,
                  recording.trouble, recording.file.data_path.stat().st_size]))
"""


def test_a_full_disk_costs_the_blocks_of_its_time_and_no_others(tmp_path: Path) -> None:
    root = str(Path(__file__).parents[3])
    child = python("-c", FULL_DISK, tmp_path / "band", root)
    assert child.returncode == 0, child.stderr
    written, dropped, gaps, trouble, size = json.loads(child.stdout)
    assert (written, dropped, gaps) == (22 * BLOCK, 8 * BLOCK, 1)
    assert trouble is None
    assert size == written * 4
