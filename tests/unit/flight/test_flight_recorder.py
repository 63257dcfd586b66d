"""A flight is written and read; kills, full disks and repeats lose and double nothing."""

import math
import random
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import made
import numbered
import pytest
from sql import sql
from virtual_time import VirtualClock

from uavrt.config.settings import DetectionSettings, Settings
from uavrt.core.errors import FormatError, RecordingError
from uavrt.core.messages import (
    Command,
    CommandReply,
    FlightInfo,
    Poses,
    PulsePose,
    StatusText,
)
from uavrt.flight.database.flight_database import CHECKPOINT_S
from uavrt.flight.flight_layout import FlightLayout, new_flight_directory
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.logs.detector_configs import read_detector_config
from uavrt.flight.logs.pulse_pose_log import read_pulse_pose_log
from uavrt.flight.reading.flight_reader import read_flight, read_health, read_search_reports

START_NS = 1_700_205_419_230_494_976


def test_what_is_recorded_is_read_back(info: FlightInfo) -> None:
    recorder = FlightRecorder.create(info, Settings())
    posed = [numbered.pulse_pose(n, tag) for n in range(4) for tag in (2, 4)]
    unposed = PulsePose(pulse=numbered.pulse(9), pose=None)
    raw = Poses(poses=tuple(numbered.pose(START_NS + n * 20_000_000) for n in range(50)))
    health = made.health("receiver", START_NS, counters={"lost": 3})
    recorder.write_pulses(one.pulse for one in posed)
    recorder.write_pulses([unposed.pulse])
    recorder.commit()
    recorder.write_pulses(posed)
    recorder.write(*raw.poses)
    recorder.write(health)
    recorder.write_status_text(StatusText(severity=4, text="radio absent"), START_NS + 5)
    recorder.write_command(
        Command(name="start_detection", request_id=7, center_frequency_hz=1.5e8, source="x"),
        CommandReply(request_id=7, name="start_detection", accepted=False, message="no tags"),
        START_NS,
    )
    searched = made.search_report(2, START_NS)
    recorder.write(searched)
    recorder.write_note("wall clock set forward by 3 s", START_NS + 9)
    recorder.close()

    flight = read_flight(info.directory)
    assert flight.info == info
    assert flight.settings_json is not None
    assert '"airspy"' in flight.settings_json
    expected = sorted([*posed, unposed], key=lambda one: one.pulse.start_time_ns)
    assert list(flight.pulse_poses) == expected
    assert flight.poses == raw.poses
    assert read_health(info.directory) == (health,)
    assert read_search_reports(info.directory) == (searched,)
    assert flight.status_texts == ((START_NS + 5, StatusText(severity=4, text="radio absent")),)
    assert flight.notes == ((START_NS + 9, "wall clock set forward by 3 s"),)
    assert recorder.database.committed_pulses == 9
    rows = sql(info.directory, "SELECT name, detail, accepted, message FROM commands")
    assert rows == [("start_detection", '{"center_frequency_hz": 150000000.0}', 0, "no tags")]


def test_the_thesis_files_lie_where_the_thesis_put_them(info: FlightInfo) -> None:
    made.flight(info, pulse_poses=[numbered.pulse_pose(0, 2), numbered.pulse_pose(0, 4)])
    root = Path(info.directory)
    assert (root / "airspy_csdr_netcat_log").is_dir()
    assert (root / "channelizer_log").is_dir()
    tag_directory = root / "detector_log" / "tag_id_4"
    config = read_detector_config(tag_directory / "config" / "detectorConfig.txt")
    assert config.tag == info.tags[1]
    assert config.operating_mode == "freqSearchSoftLock"
    own = read_pulse_pose_log(tag_directory / "output" / "pulse_pose_log.txt")
    assert [one.pulse.tag_id for one in own] == [4]
    everything = read_pulse_pose_log(root / "pulse_pose_log.txt")
    assert {one.pulse.tag_id for one in everything} == {2, 4}


def test_a_flights_detector_config_says_in_which_mode_was_searched(info: FlightInfo) -> None:
    settings = Settings(detection=DetectionSettings(operating_mode="freqKnownHardLock"))
    FlightRecorder.create(info, settings).close()
    config = read_detector_config(FlightLayout(Path(info.directory)).tag_config(2))
    assert config.operating_mode == "freqKnownHardLock"


def test_a_repeated_pulse_is_recorded_once(info: FlightInfo) -> None:
    one = numbered.pulse_pose()
    for _ in range(2):
        recorder = FlightRecorder.open(info)
        recorder.write_pulses([one.pulse])
        recorder.write_pulses([one, one])
        recorder.close()
    assert recorder.database.repeated_pulses == 3
    assert read_flight(info.directory).pulse_poses == (one,)
    assert len(read_pulse_pose_log(Path(info.directory) / "pulse_pose_log.txt")) == 1


def test_a_flight_is_begun_only_once(info: FlightInfo) -> None:
    FlightRecorder.create(info).close()
    with pytest.raises(RecordingError, match="already holds a flight"):
        FlightRecorder.create(info)


def test_what_is_no_flight_is_neither_reopened_nor_read(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"no flight\.sqlite"):
        FlightRecorder.reopen(tmp_path)
    with pytest.raises(FormatError, match="is not a flight"):
        read_flight(tmp_path)
    (tmp_path / "flight.sqlite").write_bytes(b"not a database" * 100)
    with pytest.raises(FormatError, match="cannot be read"):
        read_flight(tmp_path)
    with pytest.raises(RecordingError, match="not a database"):
        FlightRecorder.reopen(tmp_path)


def test_an_odd_record_bars_no_other(info: FlightInfo) -> None:
    recorder = FlightRecorder.create(info)
    odd = replace(numbered.pulse(1), snr_db=-math.inf, noise_psd=math.nan)
    impossible = replace(numbered.pulse(2), start_time_ns=1 << 70)
    recorder.write_pulses([numbered.pulse(0), odd, impossible, numbered.pulse(3)])
    recorder.close()
    assert recorder.database.refused_records == 1
    read = [one.pulse for one in read_flight(info.directory).pulse_poses]
    assert [pulse.start_time_ns for pulse in read] == [
        numbered.pulse(n).start_time_ns for n in (0, 1, 3)
    ]
    assert read[1].snr_db == -math.inf
    assert math.isnan(read[1].noise_psd)


def test_two_flights_of_one_second_have_two_directories(tmp_path: Path) -> None:
    first = new_flight_directory(tmp_path, START_NS)
    assert first.name == "flight_log_2023-11-17_07-16-59"
    first.mkdir()
    assert new_flight_directory(tmp_path, START_NS).name == f"{first.name}_2"


def test_text_logs_cut_off_by_a_power_cut_are_completed(info: FlightInfo) -> None:
    made.flight(info, pulse_poses=map(numbered.pulse_pose, range(5)))
    layout = FlightLayout(Path(info.directory))
    whole = layout.pulse_pose_log.read_text()
    for path in (layout.pulse_pose_log, layout.tag_pulse_pose_log(2)):
        path.write_text(whole[: len(whole) // 2])
    FlightRecorder.reopen(info.directory).close()
    assert layout.pulse_pose_log.read_text() == whole
    assert layout.tag_pulse_pose_log(2).read_text() == whole


def test_a_flight_on_a_medium_without_write_access_is_read_with_its_write_ahead_log(
    info: FlightInfo, tmp_path: Path
) -> None:
    recorder = FlightRecorder.create(info)
    recorder.write_pulses([numbered.pulse(n) for n in range(5)])
    recorder.commit()
    cut_off = tmp_path / "from the card"
    cut_off.mkdir()
    for name in ("flight.sqlite", "flight.sqlite-wal"):
        shutil.copy(Path(info.directory) / name, cut_off / name)
    recorder.close()
    # A plain file cannot be made in this directory, by root neither: its name is taken.
    (cut_off / "flight.sqlite-shm").mkdir()
    assert len(read_flight(cut_off).pulse_poses) == 5


def test_a_torn_log_leaves_a_prefix_of_the_flight(info: FlightInfo, tmp_path: Path) -> None:
    recorder = FlightRecorder.create(info)
    recorder.close()  # the tables are in the database file
    recorder = FlightRecorder.reopen(info.directory)
    for number in range(20):
        recorder.write_pulses([numbered.pulse(number)])
        recorder.commit()
    source = Path(info.directory)
    whole = (source / "flight.sqlite-wal").read_bytes()
    database = (source / "flight.sqlite").read_bytes()
    recorder.close()
    offsets = random.Random(3)
    counts = []
    for cut in sorted(offsets.randrange(len(whole) + 1) for _ in range(30)):
        torn = tmp_path / f"torn at {cut}"
        torn.mkdir()
        (torn / "flight.sqlite").write_bytes(database)
        # The length was written, the rest of the content was not: zeros, as ext4 leaves them.
        (torn / "flight.sqlite-wal").write_bytes(whole[:cut] + bytes(len(whole) - cut))
        read = read_flight(torn).pulse_poses
        assert [one.pulse for one in read] == [numbered.pulse(n) for n in range(len(read))]
        counts.append(len(read))
    assert counts == sorted(counts)
    assert counts[-1] >= 15


def test_after_a_checkpoint_the_database_file_alone_has_everything(
    info: FlightInfo, tmp_path: Path, clock_of_test: VirtualClock
) -> None:
    recorder = FlightRecorder.create(info)
    recorder.write_pulses([numbered.pulse(number) for number in range(20)])
    clock_of_test.now_s += CHECKPOINT_S
    recorder.commit()
    alone = tmp_path / "alone"
    alone.mkdir()
    shutil.copy(Path(info.directory) / "flight.sqlite", alone)
    assert len(read_flight(alone).pulse_poses) == 20
    recorder.close()


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
