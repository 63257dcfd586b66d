"""What a flight's database says was heard so far, also at its very beginning."""

from pathlib import Path

import pytest
from sql import sql

from uavrt.core.errors import RecordingError
from uavrt.flight.database.spool import received_tags
from uavrt.flight.flight_layout import FlightLayout


def test_in_a_new_flight_whose_tables_are_not_made_yet_nothing_was_heard(
    tmp_path: Path,
) -> None:
    sql(tmp_path, "PRAGMA user_version = 4")
    assert received_tags(tmp_path) == {}


def test_a_damaged_database_is_no_empty_one(tmp_path: Path) -> None:
    FlightLayout(tmp_path).database.write_bytes(b"no database" * 500)
    with pytest.raises(RecordingError, match="cannot be read"):
        received_tags(tmp_path)
