"""Query a flight in progress: received tags, and pulses that a ground station lacks.

Each row of the delivery table links a pulse to a ground station that received it.
"""

import sqlite3
from collections.abc import Collection, Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from uavrt.core.errors import RecordingError
from uavrt.core.messages import Delivered, PulsePose
from uavrt.flight.database import schema
from uavrt.flight.flight_layout import FlightLayout

_MADE = "SELECT COUNT(*) FROM sqlite_master WHERE name = 'pulses'"
_HEARD = "SELECT tag_id, COUNT(*), MAX(end_time_ns) FROM pulses WHERE confirmed GROUP BY tag_id"
_UNDELIVERED = (
    f"SELECT {schema.PULSE_POSE_COLUMNS} FROM pulses JOIN pulse_poses USING (pulse_id) "
    "WHERE NOT EXISTS (SELECT 1 FROM deliveries"
    " WHERE deliveries.pulse_id = pulses.pulse_id AND (deliveries.store = ?1 OR ?1 = 0)) "
    "ORDER BY pulses.start_time_ns DESC LIMIT ?2"
)


def received_tags(directory: str | Path) -> dict[int, tuple[int, int]]:
    """Number of confirmed pulses and end of the newest pulse [ns, UTC], by tag id.

    Tags without confirmed pulses are left out.
    """
    with _opened(directory) as database:
        # The recorder makes the tables after the file: there are no pulses yet.
        made = database.execute(_MADE).fetchone()[0]
        rows = database.execute(_HEARD).fetchall() if made else []
        return {int(tag_id): (int(count), int(end_ns)) for tag_id, count, end_ns in rows}


def undelivered(
    directory: str | Path, store: int, limit: int, without: Collection[tuple[int, int]] = ()
) -> tuple[list[PulsePose], bool]:
    """Recorded pulses that a ground station lacks, newest first, and whether there are more.

    `store`: id of the ground station's database; 0: pulses that were not sent to any station,
    for stations that send no receipts. `without`: tag id and start time [ns] of pulses to leave
    out.
    """
    with _opened(directory) as database:
        schema.read_older(database)
        rows = database.execute(_UNDELIVERED, (store, limit + len(without) + 1)).fetchall()
        wanted = (row for row in rows if (row[0], row[2]) not in without)
        found = list(map(schema.pulse_pose_from_row, wanted))
    return found[:limit], len(found) > limit


def note_deliveries(directory: str | Path, delivered: Delivered) -> None:
    """Record deliveries in a flight that is closed; raises `RecordingError` if that fails."""
    rows = [
        (delivered.store, delivered.time_ns, tag_id, start_time_ns)
        for tag_id, start_time_ns in delivered.pulses
    ]
    with _opened(directory, writable=True) as database, database:
        database.executemany(schema.INSERT_DELIVERY, rows)


@contextmanager
def _opened(directory: str | Path, *, writable: bool = False) -> Iterator[sqlite3.Connection]:
    path = FlightLayout(Path(directory)).database
    mode, timeout_s, done = ("rw", 0.5, "written") if writable else ("ro", 0.05, "read")
    try:
        uri = f"{path.absolute().as_uri()}?mode={mode}"
        with closing(sqlite3.connect(uri, uri=True, timeout=timeout_s)) as database:
            yield database
    except (sqlite3.Error, ValueError, TypeError) as error:
        raise RecordingError(f"{path} cannot be {done}: {error}") from error
