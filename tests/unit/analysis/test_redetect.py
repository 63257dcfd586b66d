import json
import math
from pathlib import Path

import made
import pytest
from some import some

from uavrt.analysis.measure.redetect import FlightWriter
from uavrt.config.settings import AntennaSettings, DetectionSettings, Settings
from uavrt.core.earth.attitude import yaw_deg
from uavrt.core.errors import RecordingError
from uavrt.core.messages import Pulse, StatusText
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.logs.detector_configs import read_detector_config
from uavrt.flight.reading.flight_reader import Flight, read_flight

START_NS = 1_700_000_000_000_000_000
TAGS = (made.tag(2, 148.71e6, 1.0), made.tag(9, 148.72e6, 1.0))


class Nothing:
    sample_rate_hz = 375e3
    center_frequency_hz = 148.7e6
    total_samples = 0

    def read(self, timeout_s: float | None = None) -> None:
        raise EOFError

    def close(self) -> None:
        pass


@pytest.fixture
def flown(tmp_path: Path) -> Flight:
    """A flight of a minute that turns at 30°/s, with its antenna to the right."""
    info = made.flight_info(
        tmp_path / "flight_log_2023-11-14_22-13-20",
        TAGS[:1],
        start_time_ns=START_NS,
        clock_offset_ns=5,
    )
    settings = Settings(antenna=AntennaSettings(yaw_offset_deg=90.0))
    recorder = FlightRecorder.create(info, settings)
    poses = (
        made.pose(
            START_NS + number * 100_000_000,
            35.0,
            -111.0 + number * 1e-6,
            altitude_relative_m=100.0,
            altitude_amsl_m=2200.0,
            yaw_deg=3.0 * number,
        )
        for number in range(600)
    )
    recorder.write(*poses)
    recorder.write_status_text(StatusText(severity=6, text="armed"), START_NS)
    recorder.close()
    return read_flight(info.directory)


def pulse(tag_id: int, at_s: float) -> Pulse:
    start_ns = START_NS + round(at_s * 1e9)
    return made.pulse(start_ns, tag_id=tag_id, frequency_hz=148.72e6, noise_psd=1e-9)


def test_a_search_that_was_refused_leaves_no_flight_behind(
    flown: Flight, tmp_path: Path
) -> None:
    """A season would count it as a flight in which no animal was heard."""
    place = tmp_path / "again"
    place.mkdir()
    (place / "notes.txt").write_text("mine")
    for directory in (place, tmp_path / "new", None):
        writer = FlightWriter(flown, Nothing(), TAGS, directory)
        writer.discard()
    assert [path.name for path in place.iterdir()] == ["notes.txt"]
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "again",
        "flight_log_2023-11-14_22-13-20",
    ]


def test_pulses_found_again_get_the_pose_of_the_flight_at_their_centre(flown: Flight) -> None:
    writer = FlightWriter(flown, Nothing(), TAGS)
    writer.write([pulse(9, 0.54), pulse(9, 29.99), pulse(2, 1.04)])
    writer.write([])
    writer.close()
    again = read_flight(writer.directory)
    assert [p.pulse.tag_id for p in again.pulse_poses] == [9, 2, 9]
    for recorded in again.pulse_poses:
        center_s = (recorded.pulse.start_time_ns - START_NS) / 1e9 + 0.010
        error = yaw_deg(some(recorded.pose).quaternion_wxyz) - (30.0 * center_s + 90.0)
        assert abs(math.remainder(error, 360.0)) < 0.01
    assert (writer.with_pose, writer.without_pose) == (3, 0)


def test_the_new_directory_is_a_flight_beside_the_old_one(flown: Flight) -> None:
    writer = FlightWriter(flown, Nothing(), TAGS)
    writer.close()
    assert writer.directory.parent == Path(flown.info.directory).parent
    again = read_flight(writer.directory)
    assert again.poses == flown.poses
    assert again.info.tags == TAGS
    assert again.info.start_time_ns == flown.info.start_time_ns
    assert again.settings_json == flown.settings_json
    assert [text.text for _, text in again.status_texts] == ["armed"]
    assert any("detected again" in note for _, note in again.notes)
    assert (writer.directory / "detector_log" / "tag_id_9").is_dir()


def test_pulses_outside_the_flight_are_kept_without_a_pose_and_counted(flown: Flight) -> None:
    writer = FlightWriter(flown, Nothing(), TAGS)
    writer.write([pulse(9, 4000.0)])
    writer.close()
    assert writer.without_pose == 1
    assert read_flight(writer.directory).pulse_poses[0].pose is None


def test_a_directory_that_holds_a_flight_is_not_overwritten(flown: Flight) -> None:
    with pytest.raises(RecordingError, match="already holds a flight"):
        FlightWriter(flown, Nothing(), TAGS, Path(flown.info.directory))


def test_a_flight_searched_again_says_how_it_was_searched_this_time(flown: Flight) -> None:
    searched = DetectionSettings(operating_mode="freqKnownHardLock", frequency_window_hz=80.0)
    writer = FlightWriter(flown, Nothing(), TAGS, searched=searched)
    writer.close()
    config = read_detector_config(FlightLayout(writer.directory).tag_config(9))
    assert config.operating_mode == "freqKnownHardLock"
    again = json.loads(read_flight(writer.directory).settings_json or "")
    assert again["detection"]["frequency_window_hz"] == 80.0
    assert again["antenna"]["yaw_offset_deg"] == 90.0
