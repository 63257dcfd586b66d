"""A batch: all recordings, cell by cell, to Parquet; what is done already is not done again.

::

    OUT/unfinished/KEY/CELL/   states and pulses of cells that are not written yet
    OUT/pulses/flight=NAME/KEY.parquet
    OUT/poses, OUT/bearings, OUT/positions   the same for what was made of a flight's pulses
    OUT/done/KEY.json          what was done with a recording: a row of the table
    OUT/placed/KEY.json        what was done with a flight
    OUT/recordings.parquet, OUT/flights.parquet
    OUT/months/   copies of the tables, by month, where there are many files

KEY stands for the recording or flight as it is, the tags and the settings that touch it: what
was changed is done anew, and its old rows go when the new ones are there.
"""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TypeVar

from uavrt.analysis.measure import TagSource
from uavrt.batch.copies import copies_of, drop_copies, without
from uavrt.batch.detecting import UNFINISHED, Detecting
from uavrt.batch.ledger import DONE, PLACED, Ledger
from uavrt.batch.months import gather_months
from uavrt.batch.names import name_flights
from uavrt.batch.placing import Placing
from uavrt.batch.questions import keep_answers
from uavrt.batch.recordings import Found
from uavrt.batch.settings import BatchSettings, BatchSummary, BatchWatch
from uavrt.batch.tables import (
    BEARINGS,
    FLIGHTS,
    INTEGRATED,
    POSES,
    POSITIONS,
    PULSES,
    RECORDINGS,
    FlightRow,
    RecordingRow,
    need_pyarrow,
    write_rows,
)
from uavrt.batch.workers import Task, run_tasks
from uavrt.errors import RecordingError
from uavrt.recording import WriterLock

R = TypeVar("R")


def run_batch(
    found: Found,
    sought: TagSource,
    output: Path,
    settings: BatchSettings,
    watch: BatchWatch | None = None,
) -> BatchSummary:
    """Detect the tags in all recordings, and locate them from all flights.

    Parameters
    ----------
    found : Found
        Recordings and flights.
    sought : TagSource
        The tags.
    output : Path
        Directory for the tables; made if need be.
    settings : BatchSettings
        How.
    watch : BatchWatch, optional
        Who looks on.

    Raises
    ------
    RecordingError
        Another run writes there, or it cannot be written.
    UsageError
        The extra is missing, or a step.
    """
    settings.check()
    need_pyarrow()
    lock = WriterLock()
    if not lock.take(output, 0.0):
        raise RecordingError(
            f"{output} cannot be written, or another batch is writing there",
            remedy="Wait for it, or give -o another directory",
        )
    try:
        return _run(found, sought, output.absolute(), settings, watch or BatchWatch())
    except OSError as error:
        raise RecordingError(
            f"{output} cannot be written: {error.strerror}", remedy="Free space there"
        ) from error
    finally:
        lock.release()


def _run(
    found: Found,
    sought: TagSource,
    output: Path,
    settings: BatchSettings,
    watch: BatchWatch,
) -> BatchSummary:
    (output / UNFINISHED).mkdir(parents=True, exist_ok=True)
    recordings = Ledger(output, DONE, RecordingRow, [PULSES])
    flights = Ledger(output, PLACED, FlightRow, [POSES, BEARINGS, POSITIONS, INTEGRATED])
    copies = copies_of(found, recordings, flights)
    found, passed_over = without(found, copies)
    found, names = name_flights(found, recordings, flights, copies)
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
    _tell_kept(detecting.kept, watch)
    placing = Placing(sought, output, settings, recordings, flights)
    placed_now = 0
    if not watch.should_stop():
        placing.plan(found, detecting.keys, names, copies)
        watch.on_stage("placing", len(placing.tasks))
        for number, placed in _worked(placing.tasks, output, settings, watch):
            if (row_of_flight := placing.finish(number, placed)) is not None:
                watch.on_row(row_of_flight)
                placed_now += 1
        _tell_kept(placing.kept, watch)
        drop_copies(copies, recordings, flights)
    write_rows(output / RECORDINGS, RecordingRow, recordings.rows)
    write_rows(output / FLIGHTS, FlightRow, flights.rows)
    gather_months(output, recordings.rows, flights.rows)
    keep_answers(output)
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
    )


def _tell_kept(kept: Mapping[str, str], watch: BatchWatch) -> None:
    for name, fault in kept.items():
        watch.on_kept(name, fault)


def _worked(
    tasks: Sequence[Task[R]], output: Path, settings: BatchSettings, watch: BatchWatch
) -> Iterator[tuple[int, R]]:
    """Have tasks done by this machine's cores, or by a cluster."""
    if settings.scheduler is not None:
        from uavrt.batch.cluster import run_on_cluster

        return run_on_cluster(
            tasks,
            settings.scheduler,
            output / UNFINISHED,
            should_stop=watch.should_stop,
            on_done=watch.on_done,
        )
    return run_tasks(
        tasks, settings.workers, should_stop=watch.should_stop, on_done=watch.on_done
    )
