"""What a batch has written of flights each tenth day, small enough for tests."""

from pathlib import Path
from typing import Any

import made

from uavrt.analysis.archive.parquet.ledger import Ledger
from uavrt.analysis.archive.parquet.months import gather_months, read_index, write_index
from uavrt.analysis.archive.parquet.parquet_tables import (
    DONE,
    PULSES,
    RECORDINGS,
    RecordingRow,
    write_pulses,
    write_rows,
)
from uavrt.analysis.archive.parquet.questions import keep_answers

DAY_NS = 86_400 * 10**9


def recording_row(flight: str, pulses: int, **fields: Any) -> RecordingRow:
    """Row of a recording of one minute that was searched."""
    usual: dict[str, Any] = {
        "path": f"/archive/{flight}.wav",
        "fingerprint": flight,
        "state": "done",
        "fault": None,
        "start_time_ns": DAY_NS,
        "length_s": 60.0,
        "sample_rate_hz": 48e3,
        "center_frequency_hz": 148.7e6,
        "lost_samples": 0,
        "invalid_values": 0,
        "cells": 1,
        "cpu_s": 1.0,
        "finished_time_ns": 2 * DAY_NS,
        "uavrt_version": "0",
    }
    return RecordingRow(flight=flight, pulses=pulses, confirmed=pulses, **(usual | fields))


def put(
    output: Path, ledger: Ledger[RecordingRow], number: int, *, key: str, pulses: int
) -> None:
    """A flight each tenth day, of so many pulses."""
    start_ns = 10 * number * DAY_NS
    flight = f"{number:02d}"
    state, files = "done" if pulses else "failed", {}
    if pulses:
        found = [
            (
                0,
                made.pulse(
                    start_ns + 10**9 * each, tag_id=2 + 2 * (each % 2), snr_db=float(each)
                ),
            )
            for each in range(pulses)
        ]
        name = f"{PULSES}/{key}.parquet"
        files[name] = write_pulses(output / name, found, flight, flight)
    ledger.record(
        recording_row(
            flight, pulses, path=flight, fingerprint=key, state=state, start_time_ns=start_ns
        ),
        files,
    )
    write_rows(output / RECORDINGS, RecordingRow, ledger.rows)


def archive(output: Path, flights: int = 9) -> Ledger[RecordingRow]:
    ledger = Ledger(output, DONE, RecordingRow, [PULSES])
    for number in range(flights):
        put(output, ledger, number, key=f"key{number}", pulses=0 if number == 4 else 5)
    return ledger


def gathered(output: Path, ledger: Ledger[RecordingRow], least_files: int = 1) -> int:
    """Gather months, and count those that are new."""
    before, _ = read_index(output)
    times = {PULSES: ledger.times(PULSES)}
    after = gather_months(output, before, times, least_files=least_files)
    write_index(output, after)
    write_index(output, keep_answers(output, after))
    return len(after.keys() - before.keys())
