"""Disks that are full, damaged or not there: what a flight recorder makes of them."""

import itertools
import os
import resource
import shutil
import subprocess
from pathlib import Path

import numbered
import pytest
from command_line import python
from forked import in_child

from uavrt.config.settings import Settings
from uavrt.core.errors import FormatError, RecordingError
from uavrt.core.messages import FlightInfo
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_recorder import FlightRecorder
from uavrt.flight.logs.pulse_pose_log import read_pulse_pose_log
from uavrt.flight.reading.flight_reader import read_flight

START_NS = 1_700_205_419_230_494_976


def write_beyond(limit: int, directory: str) -> tuple[int, int, int, int, int]:
    """Write until no file may grow, then go on.

    How many pulses were recorded, waited, were written; failed commits; what waits at the end.
    """
    recorder = FlightRecorder.reopen(directory)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, resource.RLIM_INFINITY))
    remedies: list[str | None] = []
    recorded = number = 0
    while len(remedies) < 3:
        recorder.write_pulses([numbered.pulse_pose(number + n) for n in range(10)])
        number += 10
        try:
            recorder.commit()
            recorded, remedies = number, []  # at first, closing the log still made room
        except RecordingError as error:
            remedies.append(error.remedy)
    assert all(remedies)
    waiting = recorder.waiting_records
    resource.setrlimit(resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    recorder.commit()
    recorder.close()
    return recorded, waiting, number, recorder.failed_commits, recorder.waiting_records


def test_a_full_disk_loses_nothing_and_is_made_up_for_when_there_is_space(
    tmp_path: Path,
) -> None:
    info = numbered.info(tmp_path / "flight")
    FlightRecorder.create(info).close()
    recorded, waiting, number, failed, after = in_child(write_beyond, 200_000, info.directory)
    assert recorded > 100
    assert waiting == number - recorded == 30
    assert failed >= 3
    assert after == 0
    starts = [one.pulse.start_time_ns for one in read_flight(info.directory).pulse_poses]
    assert starts == [numbered.pulse(n).start_time_ns for n in range(number)]
    FlightRecorder.reopen(info.directory).close()
    logged = read_pulse_pose_log(Path(info.directory) / "pulse_pose_log.txt")
    assert len(logged) == number


def test_a_place_that_cannot_be_written_is_refused_with_a_remedy(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(RecordingError, match="cannot make the flight directory") as caught:
        FlightRecorder.create(numbered.info(tmp_path / "file" / "flight"))
    assert caught.value.remedy


def test_a_flight_begun_on_a_failing_disk_is_recorded_once_the_disk_is_mended(
    tmp_path: Path,
) -> None:
    card = tmp_path / "card"
    card.write_text("a file in the place of the directory")
    info = numbered.info(card / "flight")
    recorder = FlightRecorder.open(info, Settings())
    recorder.write_pulses([numbered.pulse_pose(0)])
    with pytest.raises(RecordingError, match="cannot make the flight directory"):
        recorder.commit()
    assert recorder.failed_commits == 2
    card.unlink()
    recorder.write_pulses([numbered.pulse_pose(1)])
    recorder.close()
    flight = read_flight(info.directory)
    assert flight.info == info
    assert flight.pulse_poses == (numbered.pulse_pose(0), numbered.pulse_pose(1))


@pytest.mark.parametrize("damage", ["header", "inside"])
def test_a_damaged_database_is_put_aside_and_its_pulses_come_from_the_text_log(
    tmp_path: Path, damage: str
) -> None:
    info = numbered.info(tmp_path / "flight")
    recorder = FlightRecorder.create(info)
    recorder.write_pulses(numbered.pulse_pose(n) for n in range(200))
    recorder.close()
    layout = FlightLayout(Path(info.directory))
    content = bytearray(layout.database.read_bytes())
    if damage == "header":
        content[:100] = b"\xff" * 100
    else:
        content[4096:] = b"\xff" * (len(content) - 4096)
    layout.database.write_bytes(content)
    with pytest.raises(FormatError, match="has the same pulses"):
        read_flight(info.directory)

    restarted = FlightRecorder.open(info)
    restarted.write_pulses([numbered.pulse_pose(200)])
    restarted.close()
    flight = read_flight(info.directory)
    starts = [one.pulse.start_time_ns for one in flight.pulse_poses]
    assert starts == [numbered.pulse_pose(n).pulse.start_time_ns for n in range(201)]
    assert all(one.pose is not None for one in flight.pulse_poses)
    assert "put aside as flight.sqlite.damaged-1" in flight.notes[0][1]
    aside = layout.database.with_name("flight.sqlite.damaged-1")
    assert aside.read_bytes()[4096:] == bytes(content[4096:])
    assert len(read_pulse_pose_log(layout.pulse_pose_log)) == 201


def test_memory_is_bounded_while_the_disk_fails_and_pulses_outlast_poses(
    tmp_path: Path,
) -> None:
    info = numbered.info(tmp_path / "flight")
    recorder = FlightRecorder.create(info)
    recorder.write_pulses([numbered.pulse(0)])
    for second in range(30):
        many = tuple(numbered.pose(START_NS + second * 1000 + n) for n in range(1000))
        recorder.write(*many)
    assert recorder.waiting_records == 20_001
    assert recorder.dropped_records == 10_000
    recorder.close()
    flight = read_flight(info.directory)
    assert len(flight.poses) == 20_000
    assert len(flight.pulse_poses) == 1


def test_a_small_disk_filled_to_the_brim_keeps_what_was_recorded(tmp_path: Path) -> None:
    disk = tmp_path / "card"
    disk.mkdir()
    mounting = ["mount", "-t", "tmpfs", "-o", "size=600k", "tmpfs", str(disk)]
    mounted = shutil.which("mount") is not None and os.geteuid() == 0
    if mounted:
        mounted = subprocess.run(mounting, check=False, capture_output=True).returncode == 0
    try:
        fill_the_disk(disk, numbered.info(disk / "flight"), full=mounted)
    finally:
        if mounted:
            subprocess.run(["umount", str(disk)], check=True)


def fill_the_disk(disk: Path, info: FlightInfo, *, full: bool) -> None:
    """Fill a disk with pulses; without the right to mount one, only count what is recorded."""
    ballast = disk / "ballast"
    ballast.write_bytes(b"\0" * 150_000)
    recorder = FlightRecorder.create(info)
    recorded = number = failures = 0
    while failures < 3 and number < 2000:
        recorder.write_pulses([numbered.pulse_pose(number)])
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


REOPENED = r"""
import re, sys
from pathlib import Path
from uavrt.flight.flight_recorder import FlightRecorder

def peak_mb():
    # Not ru_maxrss: that of a program which the tests start begins with the tests' own.
    (peak_kb,) = re.findall(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return float(peak_kb) / 1024

before = peak_mb()
FlightRecorder.reopen(sys.argv[1]).close()
print(peak_mb() - before)
"""


@pytest.mark.parametrize("logs", ["whole", "missing"])
def test_to_go_on_with_a_long_flight_takes_no_more_memory_than_with_a_short_one(
    tmp_path: Path, logs: str
) -> None:
    info = numbered.info(tmp_path / "flight")
    recorder = FlightRecorder.create(info)
    grown = {}
    numbers = iter(range(15_000))
    for count in (1_000, 14_000):
        recorder.write_pulses(
            numbered.pulse_pose(number, tag_id=2 + 2 * (number % 2))
            for number in itertools.islice(numbers, count)
        )
        recorder.commit()
        if logs == "missing":
            for log in Path(info.directory).rglob("pulse_pose_log.txt"):
                log.unlink()
        told = python("-c", REOPENED, info.directory, check=True)
        grown[count] = float(told.stdout)
    recorder.close()
    assert grown[14_000] < grown[1_000] + 3.0
    for log in Path(info.directory).rglob("pulse_pose_log.txt"):
        of_all = log.parent == Path(info.directory)
        assert len(read_pulse_pose_log(log)) == (15_000 if of_all else 7_500)
