"""Flights that an older version recorded are read and gone on with."""

from dataclasses import replace
from pathlib import Path

import made
import numbered
import pytest
from sql import sql

from uavrt.core.messages import FlightInfo, PulsePose
from uavrt.flight.database.schema import VERSION
from uavrt.flight.database.spool import undelivered
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.ground.store.stored_flights import PULSE_COLUMNS, FlightLibrary

PULSES_OF_VERSION_1 = """
CREATE TABLE pulses (
    pulse_id INTEGER PRIMARY KEY, tag_id INTEGER, frequency_hz REAL, start_time_ns INTEGER,
    end_time_ns INTEGER, snr_db REAL, group_snr_db REAL, score REAL, group_index INTEGER,
    group_sequence INTEGER, noise_psd REAL, detection_status TEXT, confirmed INTEGER,
    rate INTEGER, predicted_next_start_ns INTEGER, predicted_next_end_ns INTEGER,
    UNIQUE (tag_id, start_time_ns)
)
"""


def record_and_age(info: FlightInfo, version: int = 1) -> list[PulsePose]:
    """Record a flight and give its database the columns of version 1."""
    recorded = [numbered.pulse_pose(number) for number in range(5)]
    made.flight(info, pulse_poses=recorded)
    sql(info.directory, "ALTER TABLE pulses RENAME TO newer", PULSES_OF_VERSION_1)
    columns = ", ".join(row[1] for row in sql(info.directory, "PRAGMA table_info(pulses)"))
    copy = f"INSERT INTO pulses ({columns}) SELECT {columns} FROM newer"
    sql(info.directory, copy, "DROP TABLE newer", f"PRAGMA user_version={version}")
    return recorded


@pytest.mark.parametrize("version", [1, VERSION])
def test_a_flight_without_later_columns_is_read_everywhere(
    info: FlightInfo, version: int
) -> None:
    recorded = record_and_age(info, version)
    assert read_flight(info.directory).pulse_poses == tuple(recorded)
    waiting, more = undelivered(info.directory, store=1, limit=10)
    assert (waiting, more) == (recorded[::-1], False)
    library = FlightLibrary(Path(info.directory).parent)
    flight_id = Path(info.directory).name
    cells = library.pulses(flight_id)
    assert cells.shape == (len(PULSE_COLUMNS), len(recorded))
    assert not cells[PULSE_COLUMNS.index("clipped")].any()
    records = library.records(flight_id, 0, 10)
    assert [record["also_possible_tag_ids"] for record in records] == [[]] * len(recorded)


def test_a_flight_of_version_1_goes_on_and_keeps_what_is_in_doubt(info: FlightInfo) -> None:
    recorded = record_and_age(info)
    recorder = FlightRecorder.reopen(info.directory)
    newer = numbered.pulse_pose(7)
    doubt = {"also_possible_tag_ids": (4, 6), "ghost_of_tag_id": 8, "clipped": True}
    doubtful = replace(newer, pulse=replace(newer.pulse, **doubt))  # type: ignore[arg-type]
    recorder.write_pulses([doubtful])
    recorder.close()
    assert read_flight(info.directory).pulse_poses == (*recorded, doubtful)
    assert sql(info.directory, "PRAGMA user_version") == [(VERSION,)]


def test_doubt_about_a_pulse_is_read_back_before_it_has_a_pose(info: FlightInfo) -> None:
    pulses = [
        numbered.pulse(0),
        replace(numbered.pulse(1), also_possible_tag_ids=(4,)),
        replace(
            numbered.pulse(2), ghost_of_tag_id=4, confirmed=False, detection_status="detected"
        ),
        replace(numbered.pulse(3), clipped=True),
    ]
    recorder = FlightRecorder.create(info)
    recorder.write_pulses(pulses)
    recorder.commit()
    assert recorder.database.without_pose(10) == pulses
    recorder.close()
