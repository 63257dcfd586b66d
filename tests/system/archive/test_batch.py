"""A batch whose workers die."""

import multiprocessing
import os
import signal
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
from archived import RATE_HZ
from tests.unit.archive.test_batch import (  # noqa: F401  # fixtures
    SETTINGS,
    archive_fixture,
    pulses,
    reference_fixture,
    run,
)


def test_a_killed_worker_costs_its_chunk_and_no_pulse(
    archive: Path, reference: pa.Table, tmp_path: Path
) -> None:
    killed: list[int] = []
    done = [0]

    def kill_one(samples: int) -> None:
        done[0] += samples
        if not killed and done[0] > 20 * RATE_HZ:
            worker = multiprocessing.active_children()[0]
            assert worker.pid is not None
            os.kill(worker.pid, signal.SIGKILL)
            killed.append(worker.pid)

    settings = replace(SETTINGS, workers=2)
    summary = run(archive, tmp_path, settings, on_samples=kill_one)
    assert len(killed) == 1
    assert {row.state for row in summary.rows} == {"done"}
    assert pulses(tmp_path).equals(reference)
