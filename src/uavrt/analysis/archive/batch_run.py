"""Run a batch: detect pulses in all recordings, estimate positions and write Parquet tables.

Work that an earlier run finished is not repeated.

::

    OUT/unfinished/KEY/CELL    pulses of cells whose recording is not finished
    OUT/pulses/KEY.parquet     pulses; same for poses, bearings, positions, integrated
    OUT/done/KEY.json          result of a finished recording: its row of the table
    OUT/placed/KEY.json        result of a finished flight: its row of the table
    OUT/recordings.parquet, OUT/flights.parquet, OUT/passed_over.parquet
    OUT/months/                copies of the tables by month, if there are 100 files or more
    OUT/outlines.msgpack       times and pulses of the flights, used to find copies
    OUT/rows.json              files that belong to each finished recording and flight
    OUT/copies.json            digests of the files in the four lines above this one

KEY is a hash of the recording or flight, the tags and the settings that affect it. When one of
these changes, the work is repeated, and its old rows are removed when the new ones are
written.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

import msgspec

from uavrt.analysis.archive.copies import copies_of, drop_copies, without
from uavrt.analysis.archive.names import name_flights
from uavrt.analysis.archive.parquet.ledger import Ledger
from uavrt.analysis.archive.parquet.months import Copy, gather_months, read_index, write_index
from uavrt.analysis.archive.parquet.parquet_tables import (
    DONE,
    FLIGHTS,
    OUTLINES,
    PASSED_OVER,
    PLACED,
    PULSES,
    RECORDINGS,
    ROWS,
    TABLES,
    FlightRow,
    RecordingRow,
    need_pyarrow,
    write_rows,
)
from uavrt.analysis.archive.parquet.questions import keep_answers
from uavrt.analysis.archive.parquet.seals import read_note, sealed, write_note
from uavrt.analysis.archive.recordings import Found, SkippedFile
from uavrt.analysis.archive.steps.batch_settings import BatchSettings, BatchSummary, BatchWatch
from uavrt.analysis.archive.steps.detecting import UNFINISHED, Detecting
from uavrt.analysis.archive.steps.flight_placing import Placing
from uavrt.analysis.archive.steps.workers import Task, run_tasks
from uavrt.analysis.measure.tag_source import TagSource
from uavrt.core.atomic_file import PART, is_part, make_directories
from uavrt.core.errors import FormatError, RecordingError
from uavrt.core.foreign import decode_record
from uavrt.flight.database.writer_lock import WriterLock

R = TypeVar("R")


def run_batch(
    found: Found,
    sought: TagSource,
    output: Path,
    settings: BatchSettings,
    watch: BatchWatch | None = None,
) -> BatchSummary:
    """Detect the tags in all recordings, and locate the tags from all flights.

    Parameters
    ----------
    found : Found
        Recordings and flights.
    sought : TagSource
        Tags to search for.
    output : Path
        Directory for the tables; created if missing.
    settings : BatchSettings
        Settings of detection and positions.
    watch : BatchWatch, optional
        Receives progress, and may stop the run.

    Raises
    ------
    RecordingError
        Another run writes to the output, or the output cannot be written.
    UsageError
        The extra ``uavrt[batch]`` is missing, or a step of the settings cannot run.
    """
    settings.check()
    need_pyarrow()
    lock = WriterLock()
    if not lock.take(output, 0.0):
        raise RecordingError(
            f"{output} cannot be written, or another batch is writing to it",
            remedy="Wait until the other batch ends, or give another directory with -o",
        )
    try:
        return _run(found, sought, output.absolute(), settings, watch or BatchWatch())
    except OSError as error:
        raise RecordingError(
            f"{output} cannot be written: {error.strerror}",
            remedy="Free some disk space, or give a writable directory with -o",
        ) from error
    finally:
        lock.release()


def _run(
    found: Found, sought: TagSource, output: Path, settings: BatchSettings, watch: BatchWatch
) -> BatchSummary:
    make_directories(output / UNFINISHED)
    for folder in (output, output / UNFINISHED):
        for part in filter(is_part, folder.glob(f".*{PART}")):
            part.unlink()  # a cut came while it was written
    how = {"thorough": settings.verify}
    recordings = Ledger(output, DONE, RecordingRow, [PULSES], **how)
    flights = Ledger(output, PLACED, FlightRow, list(TABLES)[1:], **how)
    index, faults = read_index(output, **how)
    damaged = _lost_rows(output, recordings, flights)
    damaged |= recordings.damaged | flights.damaged | faults
    for name, fault in damaged.items():
        watch.on_damage(name, fault)
    copies = copies_of(found, recordings, flights, output)
    found, passed_over = without(found, copies)
    found = name_flights(found, recordings, flights, copies)
    detecting = Detecting(sought, output, settings, recordings)
    rows = [row for one in found.recordings if (row := detecting.plan(one)) is not None]
    for name, origin in detecting.dated_by_file.items():
        watch.on_origin(name, origin)
    for row in rows:
        watch.on_row(row)
    done_now = len(rows)
    samples = sum(task.cell.end - task.cell.lead_in for task in detecting.tasks)
    watch.on_stage("detecting", samples)
    for number, result in _worked(detecting.tasks, output, settings, watch):
        if (finished := detecting.finish(number, result)) is not None:
            watch.on_row(finished)
            done_now += 1
    _report_kept(detecting.kept, watch)
    placing = Placing(sought, output, settings, recordings, flights)
    placed_now = 0
    if not watch.should_stop():
        placing.plan(found, detecting.keys, copies)
        watch.on_stage("placing", len(placing.tasks))
        for number, placed in _worked(placing.tasks, output, settings, watch):
            if (row_of_flight := placing.finish(number, placed)) is not None:
                watch.on_row(row_of_flight)
                placed_now += 1
        _report_kept(placing.kept, watch)
        drop_copies(copies, recordings, flights)
    for name, record, table_rows in (
        (RECORDINGS, RecordingRow, recordings.rows),
        (FLIGHTS, FlightRow, flights.rows),
        (PASSED_OVER, SkippedFile, found.passed_over),
    ):
        index[name] = Copy(write_rows(output / name, record, table_rows))
    write_note(output / ROWS, msgspec.json.encode(_rows_of(recordings, flights)))
    for name in (OUTLINES, ROWS):
        index[name] = Copy(sealed(output / name))
    write_index(output, index)
    if not watch.should_stop():
        times = {
            table: (recordings if table == PULSES else flights).times(table) for table in TABLES
        }
        write_index(output, gathered := gather_months(output, index, times, lost=bool(faults)))
        write_index(output, keep_answers(output, gathered))
    return BatchSummary(
        rows=tuple(recordings.rows),
        flights=tuple(flights.rows),
        done_now=done_now,
        done_before=detecting.done_before,
        placed_now=placed_now,
        placed_before=placing.done_before,
        copies=passed_over,
        kept=len(detecting.kept) + len(placing.kept),
        stopped=watch.should_stop(),
        damaged=damaged,
    )


def _rows_of(*ledgers: Ledger[RecordingRow] | Ledger[FlightRow]) -> list[dict[str, list[str]]]:
    return [
        {
            row.path: [ledger.place(row.fingerprint), *ledger.files(row.fingerprint)]
            for row in ledger.rows
        }
        for ledger in ledgers
    ]


def _lost_rows(
    output: Path, *ledgers: Ledger[RecordingRow] | Ledger[FlightRow]
) -> dict[str, str]:
    """Output files with rows of the last run that no longer exist, mapped to ``"missing"``."""
    try:
        before = decode_record(read_note(output / ROWS), list[dict[str, list[str]]])
    except (FormatError, OSError):
        return {}  # noticed with the other copies
    return {
        name: "missing"
        for ledger, rows in zip(ledgers, before, strict=True)
        for path in rows.keys() - {row.path for row in ledger.rows}
        for name in rows[path]
        if name not in ledger.withdrawn and not (output / name).exists()
    }


def _report_kept(kept: Mapping[str, str], watch: BatchWatch) -> None:
    for name, fault in kept.items():
        watch.on_kept(name, fault)


def _worked(
    tasks: Sequence[Task[R]], output: Path, settings: BatchSettings, watch: BatchWatch
) -> Iterator[tuple[int, R]]:
    if settings.scheduler is not None:
        from uavrt.analysis.archive.steps.cluster import run_on_cluster

        return run_on_cluster(
            tasks,
            settings.scheduler,
            output / UNFINISHED,
            should_stop=watch.should_stop,
            on_done=watch.on_done,
            on_wait=watch.on_wait,
        )
    return run_tasks(
        tasks, settings.workers, should_stop=watch.should_stop, on_done=watch.on_done
    )
