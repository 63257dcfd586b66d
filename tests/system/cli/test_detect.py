"""`uavrt detect` of samples that come through a pipe."""

import math
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import uavrt
from tests.unit.cli.test_detect import (  # noqa: F401  # fixture
    RADIO,
    SECONDS,
    folder_fixture,
    found,
)


def piped(folder: Path, *options: str, seconds: float, pause_s: float = 0.0) -> str:
    """What is said of samples that came through a pipe, a tenth of a second at a time."""
    program = subprocess.Popen(
        [
            *(sys.executable, "-m", "uavrt.cli", "detect", "-", "--tags", "tags.txt"),
            *(*RADIO, *options),
        ],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
    )
    assert program.stdin is not None
    assert program.stderr is not None
    recording = (folder / "a.cf32").read_bytes()
    times = math.ceil(seconds / SECONDS)
    samples = (recording * times)[: round(seconds * 3750) * 8]
    begun_s = time.monotonic()
    with program.stdin as pipe:
        for number, begin in enumerate(range(0, len(samples), 3000), 1):
            pipe.write(samples[begin : begin + 3000])
            pipe.flush()
            # A radio makes up for what a busy computer delays.
            time.sleep(max(0.0, begun_s + number * pause_s - time.monotonic()))
    said = program.stderr.read().decode()
    program.stderr.close()
    assert program.wait(timeout=60) == 0, said
    return said


def test_a_slow_stream_gives_the_pulses_of_its_recording(folder: Path) -> None:
    """Its samples pass no filter: detectors kept blocks that the next was written over."""
    told = ("--start-time", "2026-05-01T06:00:00Z")
    assert uavrt("detect", "a.cf32", *RADIO, *told, "--tags", "tags.txt", "-o", "file.csv") == 0
    piped(folder, *told, "-o", "pipe.csv", seconds=SECONDS)
    recorded, streamed = found(folder / "file.csv"), found(folder / "pipe.csv")
    assert len(streamed) == len(recorded) > 8
    for one, other in zip(recorded, streamed, strict=True):
        assert abs(int(one["start_time_ns"]) - int(other["start_time_ns"])) < 1000
        assert float(one["snr_db"]) == pytest.approx(float(other["snr_db"]), abs=0.3)


def test_a_live_stream_is_told_with_the_bound_of_what_it_may_have_lost(folder: Path) -> None:
    said = piped(folder, seconds=1.5, pause_s=0.1)
    assert " 0 samples lost" in said
    assert "more samples may be lost" in said


def test_a_recording_in_a_pipe_is_told_to_show_no_losses(folder: Path) -> None:
    # So long that a busy machine, too, takes it sooner than a radio would give it.
    said = piped(folder, seconds=6.0 * SECONDS)
    assert "came faster than a radio takes them" in said
    assert "times are counted from the first sample" in said
    assert "may be lost" not in said
    told = piped(folder, "--start-time", "2026-05-01T06:00:00Z", seconds=SECONDS)
    assert "--start-time was given: times are counted from the first sample" in told
