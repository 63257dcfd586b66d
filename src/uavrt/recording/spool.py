"""Find recorded pulses that have not reached the ground, in the flight's database.

A delivery is a row linked to its pulse.
"""

import sqlite3
from collections.abc import Collection
from contextlib import closing
from pathlib import Path

from uavrt.errors import RecordingError
from uavrt.messages import Delivered, PulsePose
from uavrt.recording import schema
from uavrt.recording.layout import FlightLayout

_UNDELIVERED = (
    f"SELECT {schema.PULSE_POSE_COLUMNS} FROM pulses JOIN pulse_poses USING (pulse_id) "
    "WHERE NOT EXISTS (SELECT 1 FROM deliveries"
    " WHERE deliveries.pulse_id = pulses.pulse_id AND (deliveries.store = ?1 OR ?1 = 0)) "
    "ORDER BY pulses.start_time_ns DESC LIMIT ?2"
)


def undelivered(
    directory: str | Path, store: int, limit: int, without: Collection[tuple[int, int]] = ()
) -> tuple[list[PulsePose], bool]:
    """Recorded pulses that a ground station lacks, the newest first, and whether there are
    more.

    `store` is the station's number. With 0, only pulses sent to no station at all are returned:
    plain stations get no old pulses after a restart. Pulses in `without` (tag id, start time)
    are excluded. Raises `RecordingError` if the database cannot be read.
    """
    path = FlightLayout(Path(directory)).database
    try:
        uri = f"{path.absolute().as_uri()}?mode=ro"
        with closing(sqlite3.connect(uri, uri=True, timeout=0.05)) as database:
            schema.read_older(database)
            rows = database.execute(_UNDELIVERED, (store, limit + len(without) + 1)).fetchall()
        wanted = (row for row in rows if (row[0], row[2]) not in without)
        found = list(map(schema.pulse_pose_from_row, wanted))
    except (sqlite3.Error, ValueError, TypeError) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error
    return found[:limit], len(found) > limit


def note_deliveries(directory: str | Path, delivered: Delivered) -> None:
    """Record deliveries in a closed flight; raises `RecordingError` if not writable."""
    path = FlightLayout(Path(directory)).database
    rows = [
        (delivered.store, delivered.time_ns, tag_id, start_time_ns)
        for tag_id, start_time_ns in delivered.pulses
    ]
    try:
        uri = f"{path.absolute().as_uri()}?mode=rw"
        with closing(sqlite3.connect(uri, uri=True, timeout=0.5)) as database, database:
            database.executemany(schema.INSERT_DELIVERY, rows)
    except sqlite3.Error as error:
        raise RecordingError(f"{path} cannot be written: {error}") from error
