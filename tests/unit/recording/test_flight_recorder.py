"""A flight is written and read; kills, full disks and repeats lose and double nothing."""

import contextlib
import json
import math
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from uavrt.config import Settings
from uavrt.errors import FormatError, RecordingError
from uavrt.messages import (
    Command,
    CommandReply,
    FlightInfo,
    Health,
    Pose,
    Poses,
    Pulse,
    PulsePose,
    SearchReport,
    StatusText,
)
from uavrt.recording import (
    FlightLayout,
    FlightRecorder,
    new_flight_directory,
    read_detector_config,
    read_flight,
    read_health,
    read_pulse_pose_log,
    read_search_reports,
)

START_NS = 1_700_205_419_230_494_976

MakePulse = Callable[..., Pulse]
MakePulsePose = Callable[..., PulsePose]
MakePose = Callable[..., Pose]
MakeInfo = Callable[..., FlightInfo]


def test_what_is_recorded_is_read_back(
    make_info: MakeInfo,
    make_pulse: MakePulse,
    make_pulse_pose: MakePulsePose,
    make_pose: MakePose,
) -> None:
    info = make_info()
    recorder = FlightRecorder.create(info, Settings())
    posed = [make_pulse_pose(n, tag) for n in range(4) for tag in (2, 4)]
    unposed = PulsePose(pulse=make_pulse(9), pose=None)
    raw = Poses(poses=tuple(make_pose(START_NS + n * 20_000_000) for n in range(50)))
    health = Health(
        process="receiver", time_ns=START_NS, status="ready", ok=True, counters={"lost": 3}
    )
    recorder.write_pulses(one.pulse for one in posed)
    recorder.write_pulses([unposed.pulse])
    recorder.commit()
    recorder.write_pulse_poses(posed)
    recorder.write_poses(raw)
    recorder.write_health(health)
    recorder.write_status_text(StatusText(severity=4, text="radio absent"), START_NS + 5)
    recorder.write_command(
        Command(name="start_detection", request_id=7, center_frequency_hz=1.5e8, source="x"),
        CommandReply(request_id=7, name="start_detection", accepted=False, message="no tags"),
        START_NS,
    )
    searched = SearchReport(
        tag_id=2, time_ns=START_NS, frequency_hz=148.71e6, noise_psd=1e-12, best_score=0.4
    )
    recorder.write_search_report(searched)
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
    assert recorder.committed_pulses == 9
    with contextlib.closing(sqlite3.connect(FlightLayout(Path(info.directory)).database)) as db:
        rows = db.execute("SELECT name, detail, accepted, message FROM commands").fetchall()
    assert rows == [("start_detection", '{"center_frequency_hz": 150000000.0}', 0, "no tags")]


def test_the_thesis_files_lie_where_the_thesis_put_them(
    make_info: MakeInfo, make_pulse_pose: MakePulsePose
) -> None:
    info = make_info()
    recorder = FlightRecorder.create(info)
    recorder.write_pulse_poses([make_pulse_pose(0, 2), make_pulse_pose(0, 4)])
    recorder.close()
    root = Path(info.directory)
    assert (root / "airspy_csdr_netcat_log").is_dir()
    assert (root / "channelizer_log").is_dir()
    tag_directory = root / "detector_log" / "tag_id_4"
    config = read_detector_config(tag_directory / "config" / "detectorConfig.txt")
    assert config.tag == info.tags[1]
    own = read_pulse_pose_log(tag_directory / "output" / "pulse_pose_log.txt")
    assert [one.pulse.tag_id for one in own] == [4]
    everything = read_pulse_pose_log(root / "pulse_pose_log.txt")
    assert {one.pulse.tag_id for one in everything} == {2, 4}


def test_a_repeated_pulse_is_recorded_once(
    make_info: MakeInfo, make_pulse_pose: MakePulsePose
) -> None:
    info = make_info()
    one = make_pulse_pose()
    for _ in range(2):
        recorder = FlightRecorder.open(info)
        recorder.write_pulses([one.pulse])
        recorder.write_pulse_poses([one, one])
        recorder.close()
    assert recorder.repeated_pulses == 3
    assert read_flight(info.directory).pulse_poses == (one,)
    assert len(read_pulse_pose_log(Path(info.directory) / "pulse_pose_log.txt")) == 1


def test_a_flight_is_begun_only_once(make_info: MakeInfo) -> None:
    FlightRecorder.create(make_info()).close()
    with pytest.raises(RecordingError, match="holds a flight already"):
        FlightRecorder.create(make_info())


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


def test_an_odd_record_bars_no_other(make_info: MakeInfo, make_pulse: MakePulse) -> None:
    info = make_info()
    recorder = FlightRecorder.create(info)
    odd = replace(make_pulse(1), snr_db=-math.inf, noise_psd=math.nan)
    impossible = replace(make_pulse(2), start_time_ns=1 << 70)
    recorder.write_pulses([make_pulse(0), odd, impossible, make_pulse(3)])
    recorder.close()
    assert recorder.refused_records == 1
    read = [one.pulse for one in read_flight(info.directory).pulse_poses]
    assert [pulse.start_time_ns for pulse in read] == [
        make_pulse(n).start_time_ns for n in (0, 1, 3)
    ]
    assert read[1].snr_db == -math.inf
    assert math.isnan(read[1].noise_psd)


def test_a_flight_is_read_while_it_is_written(
    make_info: MakeInfo, make_pulse: MakePulse
) -> None:
    info = make_info()
    recorder = FlightRecorder.create(info)
    for number in range(3):
        recorder.write_pulses([make_pulse(number)])
        recorder.commit()
        assert len(read_flight(info.directory).pulse_poses) == number + 1
    recorder.close()


def test_two_flights_of_one_second_have_two_directories(tmp_path: Path) -> None:
    first = new_flight_directory(tmp_path, START_NS)
    assert first.name == "flight_log_2023-11-17_07-16-59"
    first.mkdir()
    assert new_flight_directory(tmp_path, START_NS).name == f"{first.name}_2"


def test_text_logs_cut_off_by_a_power_cut_are_completed(
    make_info: MakeInfo, make_pulse_pose: MakePulsePose
) -> None:
    info = make_info()
    recorder = FlightRecorder.create(info)
    recorder.write_pulse_poses(make_pulse_pose(n) for n in range(5))
    recorder.close()
    layout = FlightLayout(Path(info.directory))
    whole = layout.pulse_pose_log.read_text()
    for path in (layout.pulse_pose_log, layout.tag_pulse_pose_log(2)):
        path.write_text(whole[: len(whole) // 2])
    FlightRecorder.reopen(info.directory).close()
    assert layout.pulse_pose_log.read_text() == whole
    assert layout.tag_pulse_pose_log(2).read_text() == whole


WRITER = """
import sys
sys.path.insert(0, sys.argv[3])
from flight_writer import write
write(sys.argv[1], int(sys.argv[2]))
"""

FLIGHT_WRITER = '''
"""Writes pulses as fast as it can and prints each number once it is recorded."""
import sys
from uavrt.messages import Pose, Poses, Pulse, PulsePose
from uavrt.recording import FlightRecorder

def write(directory: str, first: int) -> None:
    recorder = FlightRecorder.reopen(directory)
    number = first
    while True:
        batch = []
        for number in range(number, number + 1 + number % 4):
            start = 1_700_205_419_230_494_976 + number * 1_000_001
            pulse = Pulse(tag_id=2 + 2 * (number % 2), frequency_hz=148.71e6,
                start_time_ns=start, end_time_ns=start + 20_000_000, snr_db=20.0,
                group_snr_db=20.0, score=2.0, group_index=1, group_sequence=number,
                noise_psd=1e-12, detection_status="detected", confirmed=False, rate=1,
                predicted_next_start_ns=None, predicted_next_end_ns=None)
            pose = Pose(time_ns=start, latitude_deg=47.4, longitude_deg=8.5,
                altitude_amsl_m=488.0, altitude_relative_m=30.0,
                quaternion_wxyz=(1.0, 0.0, 0.0, 0.0))
            batch.append(PulsePose(pulse=pulse, pose=pose))
        number += 1
        recorder.write_pulses(one.pulse for one in batch)
        recorder.commit()
        recorder.write_pulse_poses(batch)
        recorder.write_poses(Poses(poses=tuple(one.pose for one in batch)))
        recorder.commit()
        sys.stdout.write(f"{number}\\n")
        sys.stdout.flush()
'''


def test_kills_at_random_moments_lose_and_double_nothing(
    make_info: MakeInfo, tmp_path: Path
) -> None:
    info = make_info()
    FlightRecorder.create(info).close()
    (tmp_path / "flight_writer.py").write_text(FLIGHT_WRITER)
    moments = random.Random(11)
    recorded = 0
    for _ in range(6):
        before = recorded
        writer = subprocess.Popen(
            [sys.executable, "-c", WRITER, info.directory, str(recorded), str(tmp_path)],
            stdout=subprocess.PIPE,
            text=True,
        )
        assert writer.stdout is not None
        writer.stdout.readline()  # it is at work
        time.sleep(moments.uniform(0.0, 0.12))
        writer.send_signal(signal.SIGKILL)
        reports = writer.communicate()[0].splitlines(keepends=True)
        finished = [line for line in reports if line.endswith("\n")]
        recorded = int(finished[-1]) if finished else before + 1
        numbers = [one.pulse.group_sequence for one in read_flight(info.directory).pulse_poses]
        assert numbers == list(range(len(numbers)))
        assert len(numbers) >= recorded
        recorded = len(numbers)
    assert recorded > 50
    FlightRecorder.reopen(info.directory).close()
    flight = read_flight(info.directory)
    with_pose = [one for one in flight.pulse_poses if one.pose is not None]
    # A pulse whose own commit ended and whose pose's did not has none, in the logs neither.
    assert len(with_pose) >= recorded - 4 * 6
    logged = read_pulse_pose_log(Path(info.directory) / "pulse_pose_log.txt")
    starts = [one.pulse.start_time_ns for one in logged]
    assert sorted(starts) == [one.pulse.start_time_ns for one in with_pose]
    assert len(set(starts)) == len(starts)


def test_a_flight_on_a_medium_without_write_access_is_read_with_its_write_ahead_log(
    make_info: MakeInfo, make_pulse: MakePulse, tmp_path: Path
) -> None:
    info = make_info()
    recorder = FlightRecorder.create(info)
    recorder.write_pulses([make_pulse(n) for n in range(5)])
    recorder.commit()
    cut_off = tmp_path / "from the card"
    cut_off.mkdir()
    for name in ("flight.sqlite", "flight.sqlite-wal"):
        shutil.copy(Path(info.directory) / name, cut_off / name)
    recorder.close()
    # A plain file cannot be made in this directory, by root neither: its name is taken.
    (cut_off / "flight.sqlite-shm").mkdir()
    assert len(read_flight(cut_off).pulse_poses) == 5


def test_a_write_ahead_log_torn_anywhere_leaves_a_prefix_of_the_flight(
    make_info: MakeInfo, make_pulse: MakePulse, tmp_path: Path
) -> None:
    info = make_info()
    recorder = FlightRecorder.create(info)
    recorder.close()  # the tables are in the database file
    recorder = FlightRecorder.reopen(info.directory)
    for number in range(20):
        recorder.write_pulses([make_pulse(number)])
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
        assert [one.pulse for one in read] == [make_pulse(n) for n in range(len(read))]
        counts.append(len(read))
    assert counts == sorted(counts)
    assert counts[-1] >= 15


def test_after_a_checkpoint_the_database_file_alone_has_everything(
    make_info: MakeInfo,
    make_pulse: MakePulse,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("uavrt.recording.flight_recorder.CHECKPOINT_S", 0.0)
    info = make_info()
    recorder = FlightRecorder.create(info)
    recorder.write_pulses([make_pulse(number) for number in range(20)])
    recorder.commit()
    alone = tmp_path / "alone"
    alone.mkdir()
    shutil.copy(Path(info.directory) / "flight.sqlite", alone)
    assert len(read_flight(alone).pulse_poses) == 20
    recorder.close()


FILE_SIZE_LIMIT = """
import json, resource, sys
sys.path.insert(0, sys.argv[2])
from flight_pulses import pulse_pose
from uavrt.errors import RecordingError
from uavrt.recording import FlightRecorder

recorder = FlightRecorder.reopen(sys.argv[1])
limit = 200_000
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
recorded, failures, number = 0, 0, 0
while failures < 3:
    recorder.write_pulse_poses([pulse_pose(number + n) for n in range(10)])
    number += 10
    try:
        recorder.commit()
        recorded, failures = number, 0  # at first, closing the log still made room
    except RecordingError as error:
        assert error.remedy
        failures += 1
waiting = recorder.waiting_records
resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
recorder.commit()
recorder.close()
print(json.dumps({"recorded": recorded, "waiting": waiting, "number": number,
                  "failed": recorder.failed_commits, "after": recorder.waiting_records}))
"""

FLIGHT_PULSES = (
    FLIGHT_WRITER.split("def write")[0]
    + """
def pulse_pose(number: int) -> PulsePose:
    start = 1_700_205_419_230_494_976 + number * 1_000_001
    pulse = Pulse(tag_id=2, frequency_hz=148.71e6, start_time_ns=start,
        end_time_ns=start + 20_000_000, snr_db=20.0, group_snr_db=20.0, score=2.0,
        group_index=1, group_sequence=number, noise_psd=1e-12, detection_status="detected",
        confirmed=False, rate=1, predicted_next_start_ns=None, predicted_next_end_ns=None)
    pose = Pose(time_ns=start, latitude_deg=47.4, longitude_deg=8.5, altitude_amsl_m=488.0,
        altitude_relative_m=30.0, quaternion_wxyz=(1.0, 0.0, 0.0, 0.0))
    return PulsePose(pulse=pulse, pose=pose)
"""
)


def test_a_full_disk_loses_nothing_and_is_made_up_for_when_there_is_space(
    make_info: MakeInfo, tmp_path: Path
) -> None:
    info = make_info()
    FlightRecorder.create(info).close()
    (tmp_path / "flight_pulses.py").write_text(FLIGHT_PULSES)
    child = subprocess.run(
        [sys.executable, "-c", FILE_SIZE_LIMIT, info.directory, str(tmp_path)],
        capture_output=True,
        text=True,
        check=False,
    )
    assert child.returncode == 0, child.stderr
    told = json.loads(child.stdout)
    assert told["recorded"] > 100
    assert told["waiting"] == told["number"] - told["recorded"] == 30
    assert told["failed"] >= 3
    assert told["after"] == 0
    numbers = [one.pulse.group_sequence for one in read_flight(info.directory).pulse_poses]
    assert numbers == list(range(told["number"]))
    FlightRecorder.reopen(info.directory).close()
    logged = read_pulse_pose_log(Path(info.directory) / "pulse_pose_log.txt")
    assert len(logged) == told["number"]


def test_a_place_that_cannot_be_written_is_refused_with_a_remedy(
    make_info: MakeInfo, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot make the flight directory") as caught:
        FlightRecorder.create(make_info(tmp_path / "file" / "flight"))
    assert caught.value.remedy


def test_a_flight_begun_on_a_failing_disk_is_recorded_once_the_disk_is_mended(
    make_info: MakeInfo, make_pulse_pose: MakePulsePose, tmp_path: Path
) -> None:
    card = tmp_path / "card"
    card.write_text("a file in the place of the directory")
    info = make_info(card / "flight")
    recorder = FlightRecorder.open(info, Settings())
    recorder.write_pulse_poses([make_pulse_pose(0)])
    with pytest.raises(RecordingError, match="cannot make the flight directory"):
        recorder.commit()
    assert recorder.failed_commits == 2
    card.unlink()
    recorder.write_pulse_poses([make_pulse_pose(1)])
    recorder.close()
    flight = read_flight(info.directory)
    assert flight.info == info
    assert flight.pulse_poses == (make_pulse_pose(0), make_pulse_pose(1))


@pytest.mark.parametrize("damage", ["header", "inside"])
def test_a_damaged_database_is_put_aside_and_its_pulses_come_from_the_text_log(
    make_info: MakeInfo, make_pulse_pose: MakePulsePose, damage: str
) -> None:
    info = make_info()
    recorder = FlightRecorder.create(info)
    recorder.write_pulse_poses(make_pulse_pose(n) for n in range(200))
    recorder.close()
    layout = FlightLayout(Path(info.directory))
    content = bytearray(layout.database.read_bytes())
    if damage == "header":
        content[:100] = b"\xff" * 100
    else:
        content[4096:] = b"\xff" * (len(content) - 4096)
    layout.database.write_bytes(content)
    with pytest.raises(FormatError, match="give that instead"):
        read_flight(info.directory)

    restarted = FlightRecorder.open(info)
    restarted.write_pulse_poses([make_pulse_pose(200)])
    restarted.close()
    flight = read_flight(info.directory)
    starts = [one.pulse.start_time_ns for one in flight.pulse_poses]
    assert starts == [make_pulse_pose(n).pulse.start_time_ns for n in range(201)]
    assert all(one.pose is not None for one in flight.pulse_poses)
    assert "put aside as flight.sqlite.damaged-1" in flight.notes[0][1]
    aside = layout.database.with_name("flight.sqlite.damaged-1")
    assert aside.read_bytes()[4096:] == bytes(content[4096:])
    assert len(read_pulse_pose_log(layout.pulse_pose_log)) == 201


def test_memory_is_bounded_while_the_disk_fails_and_pulses_outlast_poses(
    make_info: MakeInfo, make_pulse: MakePulse, make_pose: MakePose
) -> None:
    info = make_info()
    recorder = FlightRecorder.create(info)
    recorder.write_pulses([make_pulse(0)])
    for second in range(30):
        many = tuple(make_pose(START_NS + second * 1000 + n) for n in range(1000))
        recorder.write_poses(Poses(poses=many))
    assert recorder.waiting_records == 20_001
    assert recorder.dropped_records == 10_000
    recorder.close()
    flight = read_flight(info.directory)
    assert len(flight.poses) == 20_000
    assert len(flight.pulse_poses) == 1


def test_a_small_disk_filled_to_the_brim_keeps_what_was_recorded(
    tmp_path: Path, make_info: MakeInfo, make_pulse_pose: MakePulsePose
) -> None:
    disk = tmp_path / "card"
    disk.mkdir()
    mounting = ["mount", "-t", "tmpfs", "-o", "size=600k", "tmpfs", str(disk)]
    mounted = shutil.which("mount") is not None and os.geteuid() == 0
    if mounted:
        mounted = subprocess.run(mounting, check=False, capture_output=True).returncode == 0
    try:
        fill_the_disk(disk, make_info(disk / "flight"), make_pulse_pose, full=mounted)
    finally:
        if mounted:
            subprocess.run(["umount", str(disk)], check=True)


def fill_the_disk(
    disk: Path, info: FlightInfo, make_pulse_pose: MakePulsePose, *, full: bool
) -> None:
    """Fill a disk with pulses; without the right to mount one, only count what is recorded."""
    ballast = disk / "ballast"
    ballast.write_bytes(b"\0" * 150_000)
    recorder = FlightRecorder.create(info)
    recorded = number = failures = 0
    while failures < 3 and number < 2000:
        recorder.write_pulse_poses([make_pulse_pose(number)])
        number += 1
        try:
            recorder.commit()
            recorded = number
        except RecordingError:
            failures += 1
    assert (failures == 3) == full
    assert len(read_flight(info.directory).pulse_poses) == recorded
    ballast.unlink()
    recorder.close()
    assert recorder.waiting_records == 0
    assert len(read_flight(info.directory).pulse_poses) == number
