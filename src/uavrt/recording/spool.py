"""Recorded pulses that have not reached the ground; the flight's database is the spool.

A delivery is a row linked to its pulse, and a pulse without one is read from the recorded
pulses.
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
    """Get recorded pulses that a store lacks, the newest first.

    `directory`: the flight. `store`: number of the store; 0: pulses no station was sent or has:
    after a restart, plain stations get no old pulses. `limit`: how many at most. `without`: tag
    id and start time of pulses to leave out. Returns the pulses, and whether there are more.
    Raises `RecordingError` if the database cannot be read.
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
    """Note deliveries in a closed flight; raises `RecordingError` if it cannot be written."""
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
