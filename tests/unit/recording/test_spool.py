"""What was recorded and has not reached the ground."""

from pathlib import Path

import numbered
import pytest

from uavrt.errors import RecordingError
from uavrt.messages import Delivered
from uavrt.recording.flight_recorder import FlightRecorder
from uavrt.recording.spool import note_deliveries, undelivered


def test_recorded_pulses_are_undelivered_until_it_is_noted_for_that_store(
    tmp_path: Path,
) -> None:
    info = numbered.info(tmp_path / "flight")
    recorder = FlightRecorder.create(info)
    items = [numbered.pulse_pose(number) for number in range(5)]
    recorder.write_pulse_poses(items)
    recorder.commit()
    assert undelivered(info.directory, 7, 10) == (items[::-1], False)
    assert undelivered(info.directory, 7, 2) == ([items[4], items[3]], True)
    key = (items[4].pulse.tag_id, items[4].pulse.start_time_ns)
    recorder.write_delivered(Delivered(time_ns=1, store=7, pulses=(key,)))
    recorder.commit()
    assert undelivered(info.directory, 7, 10) == (items[3::-1], False)
    assert undelivered(info.directory, 8, 10) == (items[::-1], False)
    other = (items[3].pulse.tag_id, items[3].pulse.start_time_ns)
    assert undelivered(info.directory, 7, 3, {other}) == (items[2::-1], False)
    recorder.close()


def test_plain_ground_stations_are_owed_only_what_nobody_has(tmp_path: Path) -> None:
    info = numbered.info(tmp_path / "flight")
    recorder = FlightRecorder.create(info)
    items = [numbered.pulse_pose(number) for number in range(3)]
    recorder.write_pulse_poses(items)
    for store, item in zip((7, 0), items, strict=False):
        key = (item.pulse.tag_id, item.pulse.start_time_ns)
        recorder.write_delivered(Delivered(time_ns=1, store=store, pulses=(key,)))
    recorder.close()
    assert undelivered(info.directory, 0, 10) == ([items[2]], False)
    assert undelivered(info.directory, 7, 10) == ([items[2], items[1]], False)


def test_a_delivery_is_noted_after_the_flights_end(tmp_path: Path) -> None:
    info = numbered.info(tmp_path / "flight")
    recorder = FlightRecorder.create(info)
    item = numbered.pulse_pose(1)
    recorder.write_pulse_poses([item])
    recorder.close()
    key = (item.pulse.tag_id, item.pulse.start_time_ns)
    note_deliveries(info.directory, Delivered(time_ns=1, store=7, pulses=(key, (9, 9))))
    assert undelivered(info.directory, 7, 10) == ([], False)


def test_a_pulse_without_a_pose_is_delivered_too(tmp_path: Path) -> None:
    from dataclasses import replace

    info = numbered.info(tmp_path / "flight")
    recorder = FlightRecorder.create(info)
    item = replace(numbered.pulse_pose(1), pose=None)
    recorder.write_pulse_poses([item])
    recorder.close()
    assert undelivered(info.directory, 7, 10) == ([item], False)


def test_a_directory_without_a_flight_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"flight\.sqlite"):
        undelivered(tmp_path, 7, 10)
    with pytest.raises(RecordingError, match=r"flight\.sqlite"):
        note_deliveries(tmp_path, Delivered(time_ns=1, store=7, pulses=((1, 1),)))
    assert list(tmp_path.iterdir()) == []
