"""Tags received so far in the flight in progress: number of pulses, and time of the last."""

import sqlite3
from contextlib import closing
from pathlib import Path

from uavrt.errors import RecordingError
from uavrt.recording.layout import FlightLayout

_MADE = "SELECT COUNT(*) FROM sqlite_master WHERE name = 'pulses'"
_HEARD = "SELECT tag_id, COUNT(*), MAX(end_time_ns) FROM pulses WHERE confirmed GROUP BY tag_id"


def heard_tags(directory: str | Path) -> dict[int, tuple[int, int]]:
    """Number of confirmed pulses of each tag in the flight, and the end of the newest [ns].

    Tags without pulses are left out. Raises `RecordingError` if the database cannot be read.
    """
    path = FlightLayout(Path(directory)).database
    try:
        uri = f"{path.absolute().as_uri()}?mode=ro"
        with closing(sqlite3.connect(uri, uri=True, timeout=0.05)) as database:
            # The recorder makes the tables after the file: there are no pulses yet.
            made = database.execute(_MADE).fetchone()[0]
            rows = database.execute(_HEARD).fetchall() if made else []
        return {int(tag_id): (int(count), int(end_ns)) for tag_id, count, end_ns in rows}
    except (sqlite3.Error, ValueError, TypeError) as error:
        raise RecordingError(f"{path} cannot be read: {error}") from error
