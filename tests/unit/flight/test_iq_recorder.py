"""Samples beside detection: a slow or full disk costs recording, never a caller's time."""

import json
import math
import shutil
import threading
from datetime import datetime
from pathlib import Path

import made
import numpy as np
import pytest
import sigmf
from numpy.typing import NDArray

from uavrt.core.errors import RecordingError
from uavrt.core.messages import IQBlock
from uavrt.flight.samples.iq_recorder import SETTLED_AFTER_S, IQRecorder
from uavrt.flight.samples.sample_file import SampleFile
from uavrt.radio.files.sigmf import sigmf_layout

RATE_HZ = 375_000.0
START_NS = 1_700_205_419_230_494_976
BLOCK = 7_500


def block(number: int, *, lost: int = 0) -> IQBlock:
    """Block of 20 ms whose samples tell their own index, after `lost` missing samples."""
    first = number * BLOCK + lost
    index = np.arange(first, first + BLOCK)
    samples = ((index % 30_000) + 1j * (index % 7 - 3)).astype(np.complex64) / 32_768.0
    return made.iq_block(
        samples.astype(np.complex64),
        first,
        RATE_HZ,
        time_ns=START_NS + round(first / RATE_HZ * 1e9),
        lost_before=lost,
    )


def recorder(base: Path, minimum_free_mb: float = 0.0) -> IQRecorder:
    return IQRecorder(
        base,
        sample_rate_hz=RATE_HZ,
        center_frequency_hz=148.7e6,
        minimum_free_mb=minimum_free_mb,
        hardware="Airspy Mini",
    )


def recorded(base: Path, *blocks: IQBlock, minimum_free_mb: float = 0.0) -> IQRecorder:
    """A recording that is closed."""
    recording = recorder(base, minimum_free_mb)
    for one in blocks:
        recording.put(one)
    recording.close()
    return recording


def stored(path: Path) -> NDArray[np.int64]:
    return np.fromfile(path, "<i2").reshape(-1, 2).astype(np.int64)


def check_places(recording: IQRecorder) -> None:
    """Each stretch of the file holds the samples of its `global_index`."""
    metadata = json.loads(recording.file.metadata_path.read_text())
    samples = stored(recording.file.data_path)
    captures = metadata["captures"]
    ends = [capture["core:sample_start"] for capture in captures[1:]] + [len(samples)]
    for capture, end in zip(captures, ends, strict=True):
        start = capture["core:sample_start"]
        index = capture["core:global_index"] + np.arange(end - start)
        assert np.array_equal(samples[start:end, 0], index % 30_000)


def test_a_recording_is_valid_sigmf_and_holds_the_samples(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "iq" / "band", *map(block, range(10)))
    handle = sigmf.fromfile(str(recording.file.metadata_path))
    handle.validate()
    assert handle.sample_count == 10 * BLOCK
    read = handle.read_samples()
    expected = np.concatenate([block(number).samples for number in range(10)])
    assert np.allclose(read, expected, atol=1e-6)
    assert handle.get_global_field("core:sample_rate") == RATE_HZ
    (capture,) = handle.get_captures()
    assert capture["core:frequency"] == 148.7e6
    assert capture["core:datetime"] == "2023-11-17T07:16:59.230494976Z"
    datetime.fromisoformat(capture["core:datetime"])
    assert recording.written_samples == 10 * BLOCK
    assert (recording.dropped_samples, recording.file.gaps, recording.trouble) == (0, 0, None)


def test_lost_samples_are_a_marked_gap(tmp_path: Path) -> None:
    recording = recorded(tmp_path / "band", block(0), block(1), block(2, lost=1234))
    handle = sigmf.fromfile(str(recording.file.metadata_path))
    handle.validate()
    first, second = handle.get_captures()
    assert first["core:sample_start"] == 0
    assert second["core:sample_start"] == 2 * BLOCK
    assert second["core:global_index"] == 2 * BLOCK + 1234
    (gap,) = handle.get_annotations()
    assert gap["core:label"] == "gap"
    assert gap["core:comment"] == "1234 samples are missing before this one"
    check_places(recording)


@pytest.mark.parametrize("seconds", [8, 100])
@pytest.mark.parametrize("lost", [0, 40])
def test_a_late_first_reading_is_corrected(tmp_path: Path, seconds: int, lost: int) -> None:
    """30 ms late at first, as on a busy machine, and corrected by 4 ms a second.

    Of a recording that ends before that, as far as it was known.
    """
    recording = SampleFile(
        tmp_path / "band",
        sample_rate_hz=100.0,
        center_frequency_hz=148e6,
        description="",
        sync=False,
        settled_after_s=SETTLED_AFTER_S,
    )
    late_ns = [max(0, 30_000_000 - 4_000_000 * number) for number in range(seconds)]
    for number in range(seconds):
        index = 100 * number + (lost if number > 3 else 0)
        time_ns = START_NS + index * 10_000_000 + late_ns[number]
        recording.append(np.zeros(100, np.complex64), index, time_ns)
    recording.close()
    sigmf.fromfile(str(recording.metadata_path)).validate()
    segments = sigmf_layout(recording.metadata_path).segments
    off_ns = [one.time_ns - START_NS - one.sample_index * 10_000_000 for one in segments]
    known_ns = [late_ns[3], late_ns[-1]] if lost else [late_ns[-1]]
    assert np.allclose(off_ns, known_ns, atol=1000)
    assert [one.lost_before for one in segments] == [0, lost][: len(segments)]


def test_metadata_is_valid_before_the_first_sample_and_while_recording(tmp_path: Path) -> None:
    recording = recorder(tmp_path / "band")
    assert json.loads(recording.file.metadata_path.read_text())["captures"] == []
    for number in range(5):
        recording.put(block(number, lost=number))
        json.loads(recording.file.metadata_path.read_text())
    recording.close()
    sigmf.fromfile(str(recording.file.metadata_path)).validate()


def test_loud_and_broken_samples_are_stored_at_the_edge_and_counted(tmp_path: Path) -> None:
    samples = np.array([2.0 - 2.0j, 0.5 + 1.0j, math.nan + 0.25j, 1e30 + 0j], np.complex64)
    recording = recorded(tmp_path / "band", IQBlock(samples, 0, START_NS, RATE_HZ))
    assert stored(recording.file.data_path).tolist() == [
        [32767, -32768],
        [16384, 32767],
        [0, 8192],
        [32767, 0],
    ]
    assert recording.file.clipped_samples == 3


def test_a_block_may_be_reused_by_its_source_at_once(tmp_path: Path) -> None:
    recording = recorder(tmp_path / "band")
    one = block(0)
    kept = one.samples.copy()
    recording.put(one)
    one.samples[:] = 0.0
    recording.close()
    assert np.array_equal(stored(recording.file.data_path)[:, 0], np.rint(kept.real * 32768))


def test_nothing_is_written_under_an_existing_name(tmp_path: Path) -> None:
    recorder(tmp_path / "band").close()
    with pytest.raises(RecordingError, match="exists already"):
        recorder(tmp_path / "band")


def test_a_place_that_cannot_be_written_is_refused_with_a_remedy(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError) as caught:
        recorder(tmp_path / "file" / "band")
    assert caught.value.remedy


def test_below_the_free_space_limit_samples_are_only_counted(tmp_path: Path) -> None:
    free_mb = shutil.disk_usage(tmp_path).free / 1e6
    recording = recorded(tmp_path / "band", *map(block, range(5)), minimum_free_mb=free_mb * 10)
    assert recording.dropped_samples == 5 * BLOCK
    assert recording.file.data_path.stat().st_size == 0
    assert recording.trouble == "the disk is nearly full"


def test_its_thread_has_a_name_and_ends(tmp_path: Path) -> None:
    recording = recorder(tmp_path / "band")
    assert "iq-recorder" in [thread.name for thread in threading.enumerate()]
    recording.close()
    recording.close()
    assert "iq-recorder" not in [thread.name for thread in threading.enumerate()]
    assert not recording.put(block(0))
