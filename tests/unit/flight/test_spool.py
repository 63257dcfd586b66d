"""What a flight's database says of the ground: pulses not delivered yet, tags received."""

from dataclasses import replace
from pathlib import Path

import made
import numbered
import pytest
from sql import sql

from uavrt.core.errors import RecordingError
from uavrt.core.messages import Delivered, FlightInfo
from uavrt.flight.database.spool import note_deliveries, received_tags, undelivered
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_recorder import FlightRecorder


def test_pulses_are_undelivered_until_it_is_noted_for_that_store(info: FlightInfo) -> None:
    recorder = FlightRecorder.create(info)
    items = [numbered.pulse_pose(number) for number in range(5)]
    recorder.write_pulses(items)
    recorder.commit()
    assert undelivered(info.directory, 7, 10) == (items[::-1], False)
    assert undelivered(info.directory, 7, 2) == ([items[4], items[3]], True)
    recorder.write_delivered(Delivered(time_ns=1, store=7, pulses=(items[4].pulse.key,)))
    recorder.commit()
    assert undelivered(info.directory, 7, 10) == (items[3::-1], False)
    assert undelivered(info.directory, 8, 10) == (items[::-1], False)
    assert undelivered(info.directory, 7, 3, {items[3].pulse.key}) == (items[2::-1], False)
    recorder.close()


def test_plain_ground_stations_are_owed_only_what_nobody_has(info: FlightInfo) -> None:
    recorder = FlightRecorder.create(info)
    items = [numbered.pulse_pose(number) for number in range(3)]
    recorder.write_pulses(items)
    for store, item in zip((7, 0), items, strict=False):
        recorder.write_delivered(Delivered(time_ns=1, store=store, pulses=(item.pulse.key,)))
    recorder.close()
    assert undelivered(info.directory, 0, 10) == ([items[2]], False)
    assert undelivered(info.directory, 7, 10) == ([items[2], items[1]], False)


def test_a_delivery_is_noted_after_the_flight_also_of_an_unposed_pulse(
    info: FlightInfo,
) -> None:
    item = replace(numbered.pulse_pose(1), pose=None)
    made.flight(info, pulse_poses=[item])
    assert undelivered(info.directory, 7, 10) == ([item], False)
    note_deliveries(
        info.directory, Delivered(time_ns=1, store=7, pulses=(item.pulse.key, (9, 9)))
    )
    assert undelivered(info.directory, 7, 10) == ([], False)


def test_a_directory_without_a_flight_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"flight\.sqlite"):
        undelivered(tmp_path, 7, 10)
    with pytest.raises(RecordingError, match=r"flight\.sqlite"):
        note_deliveries(tmp_path, Delivered(time_ns=1, store=7, pulses=((1, 1),)))
    assert list(tmp_path.iterdir()) == []


def test_in_a_new_flight_without_tables_nothing_was_heard(tmp_path: Path) -> None:
    sql(tmp_path, "PRAGMA user_version = 4")
    assert received_tags(tmp_path) == {}


def test_a_damaged_database_is_no_empty_one(tmp_path: Path) -> None:
    FlightLayout(tmp_path).database.write_bytes(b"no database" * 500)
    with pytest.raises(RecordingError, match="cannot be read"):
        received_tags(tmp_path)
