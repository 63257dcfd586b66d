"""A flight that is removed, replaced or unreachable while it is written: reported and whole."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numbered
import pytest

from uavrt.core.errors import RecordingError
from uavrt.core.messages import FlightInfo
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.logs.pulse_pose_log import read_pulse_pose_log
from uavrt.flight.reading.flight_reader import read_flight


def remove_all(root: Path) -> None:
    shutil.rmtree(root)


def remove_database(root: Path) -> None:
    FlightLayout(root).database.unlink()


def replace_database(root: Path) -> None:
    database = FlightLayout(root).database
    database.rename(database.with_name("taken away"))
    database.write_bytes(b"something else")


@pytest.mark.parametrize("hurt", [remove_all, remove_database, replace_database])
@pytest.mark.parametrize("durable", [False, True])
def test_a_database_that_is_removed_under_the_recorder_is_written_again_and_whole(
    info: FlightInfo,
    hurt: Callable[[Path], None],
    durable: bool,
) -> None:
    recorder = FlightRecorder.open(info, durable=durable)
    recorder.write_pulses(numbered.pulse_pose(n) for n in range(50))
    recorder.commit()
    assert not recorder.is_suspect()
    assert recorder.mended == ""
    hurt(Path(info.directory))
    assert recorder.is_suspect()
    for number in (50, 51):
        recorder.write_pulses([numbered.pulse_pose(number)])
        recorder.commit()
        flight = read_flight(info.directory)
        assert flight.pulse_poses == tuple(numbered.pulse_pose(n) for n in range(number + 1))
    assert "written again" in recorder.mended
    assert not recorder.is_suspect()
    recorder.close()
    assert read_flight(info.directory).info == info
    logged = read_pulse_pose_log(FlightLayout(Path(info.directory)).pulse_pose_log)
    assert len(logged) == 52


def test_a_flight_whose_directory_cannot_be_made_again_waits_and_loses_nothing(
    info: FlightInfo, tmp_path: Path
) -> None:
    info = numbered.info(tmp_path / "card" / "flight")
    recorder = FlightRecorder.open(info, durable=True)
    recorder.write_pulses([numbered.pulse_pose(0)])
    recorder.commit()
    (tmp_path / "card").rename(tmp_path / "away")
    (tmp_path / "card").write_text("a file in its place")
    for number in (1, 2):
        recorder.write_pulses([numbered.pulse_pose(number)])
        with pytest.raises(RecordingError, match="cannot"):
            recorder.commit()
    (tmp_path / "card").unlink()
    recorder.close()
    found = read_flight(info.directory).pulse_poses
    assert found == tuple(numbered.pulse_pose(n) for n in range(3))


def test_a_flight_that_has_not_begun_or_whose_disk_is_full_is_suspect(
    info: FlightInfo, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("")
    unbegun = FlightRecorder.open(numbered.info(tmp_path / "file" / "flight"))
    assert unbegun.is_suspect()
    recorder = FlightRecorder.open(info)
    assert not recorder.is_suspect()
    usage = shutil.disk_usage(tmp_path)._replace(free=10_000)
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage)
    assert recorder.is_suspect()
    recorder.close()
