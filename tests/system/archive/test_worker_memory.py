"""What a worker of a batch holds: not the recording, and nothing that writes Parquet."""

import math
from pathlib import Path
from typing import Any

import numpy as np
from archived import START_NS, TAGS, flight_task
from past_flight import write_flight
from watched_task import Seen, WatchedTask

from uavrt.analysis.archive.recordings import Recording
from uavrt.analysis.archive.steps.batch_settings import USUAL_STEPS
from uavrt.analysis.archive.steps.cell_work import CellTask
from uavrt.analysis.archive.steps.recording_cells import Cell
from uavrt.analysis.archive.steps.workers import run_tasks
from uavrt.analysis.measure.tag_source import TagSource

RATE_HZ, CENTER_HZ = 3_000_000, 148.7e6
WRITER_ONLY = {"pyarrow", "duckdb", "pandas"}
MOST_MB, MORE_MB = 200.0, 15.0


def record_wide(path: Path, length_s: int) -> None:
    """Noise and a tag of 20 dB at the radio's full rate, 12 MB a second."""
    rng = np.random.default_rng(7)
    samples = (60.0 * rng.standard_normal(2 * RATE_HZ, np.float32)).view(np.complex64)
    width = round(0.02 * RATE_HZ)
    turns = 2j * math.pi * (TAGS[0].frequency_hz - CENTER_HZ) / RATE_HZ
    samples[:width] += (20.0 * np.exp(turns * np.arange(width))).astype(np.complex64)
    second = samples.view(np.float32).astype("<i2").tobytes()
    with path.open("wb") as file:
        for _ in range(length_s):
            file.write(second)


def worked(task: Any) -> Seen:
    """Have a worker of its own do it."""
    ((_, seen),) = run_tasks([WatchedTask(task)], 2)
    assert isinstance(seen, Seen)
    return seen


def searched(folder: Path, length_s: int) -> Seen:
    path = folder / f"{length_s}.cs16"
    record_wide(path, length_s)
    seen = worked(
        CellTask(
            recording=Recording(
                path=path,
                flight="a",
                sample_rate_hz=RATE_HZ,
                center_frequency_hz=CENTER_HZ,
                start_time_ns=START_NS,
            ),
            cell=Cell(number=0, lead_in=0, begin_ns=None, end=length_s * RATE_HZ),
            sought=TagSource(tags=TAGS[:1]),
            frequency_window_hz=500.0,
        )
    )
    path.unlink()
    assert (seen.result.fault, seen.result.searched) == (None, True)
    return seen


def test_a_worker_takes_no_more_memory_for_a_recording_of_three_times_the_length(
    tmp_path: Path,
) -> None:
    short, long = (searched(tmp_path, length_s) for length_s in (5, 15))
    # Held whole, the long one would be 120 MB more as it is stored, and 240 as samples.
    assert long.most_mb < short.most_mb + MORE_MB
    assert long.most_mb < MOST_MB
    for seen in (short, long):
        assert {"uavrt", "numpy"} <= seen.modules
        assert not WRITER_ONLY & seen.modules


def test_a_worker_that_places_a_flight_loads_nothing_that_writes_parquet(
    tmp_path: Path,
) -> None:
    name = write_flight(tmp_path, 120.0, 300.0)
    seen = worked(flight_task(tmp_path / name, *USUAL_STEPS[1:], tags=TAGS[:1]))
    assert len(seen.result.positions) == 1
    assert not WRITER_ONLY & seen.modules
