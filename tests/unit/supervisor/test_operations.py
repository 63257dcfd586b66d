"""Saving and removing flights, and captures, as an operator sees them."""

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from operated import Operator
from until import until_async as until
from virtual_time import VirtualClock, follow

from uavrt.config.settings import RadioSettings, RecordingSettings
from uavrt.core.errors import RecordingError, UavrtError
from uavrt.core.messages import FlightInfo, Health, Operation
from uavrt.drone.supervisor.mission.mission_progress import FlightProgress
from uavrt.drone.supervisor.mission.storage.copying import save_flights
from uavrt.drone.supervisor.mission.storage.operations import Operations, removable_drives


class Drone(Operator):
    """With a drive, and the operations that save and remove flights."""

    def __init__(self, directory: Path, drive: Path | None, **recording: Any) -> None:
        self.steps: list[Operation] = []
        settings = RecordingSettings(
            directory=str(directory),
            save_directory=None if drive is None else str(drive),
            **recording,
        )
        self.operations = Operations(
            settings, self.steps.append, lambda _severity, text: self.texts.append(text)
        )
        options = {"operations": self.operations}
        super().__init__(directory, options, recording=settings, radio=RadioSettings())

    async def done(self) -> Operation:
        await until(lambda: self.operations.running is None)
        return self.steps[-1]


@pytest.fixture
def flights(tmp_path: Path) -> Path:
    """A directory with two flights."""
    for number in (1, 2):
        flight = tmp_path / "flights" / f"flight_log_2026-01-0{number}"
        (flight / "iq").mkdir(parents=True)
        (flight / "flight.sqlite").write_bytes(b"pulses" * number)
        (flight / "iq" / "band_1.sigmf-data").write_bytes(bytes(range(256)) * number)
    return tmp_path / "flights"


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    (tmp_path / "drive").mkdir()
    return tmp_path / "drive"


def save(flights: Path, drive: Path, wanted: Callable[[], bool] = lambda: True) -> None:
    save_flights(sorted(flights.iterdir()), drive, lambda *_: None, wanted)


def names(directory: Path) -> list[str]:
    return sorted(path.name for path in directory.glob("flight_log_*"))


def tree(directory: Path) -> dict[str, bytes]:
    files = (path for path in directory.rglob("*") if path.is_file())
    return {str(path.relative_to(directory)): path.read_bytes() for path in files}


async def test_flights_are_copied_to_the_drive_and_then_removed(
    flights: Path, drive: Path, clock_of_test: VirtualClock
) -> None:
    before = tree(flights)
    drone = Drone(flights, drive)
    reply = drone.say("save_logs")
    assert reply.accepted, reply.message
    assert drone.say("clean_logs").message == "busy: save logs in progress"
    assert drone.say("raw_capture", center_frequency_hz=148.7e6).accepted is False
    assert (await drone.done()).state == "complete"
    assert tree(drive) == before
    assert [step.step for step in drone.steps] == [0, 0, 1, 2, 2]
    assert {step.step_count for step in drone.steps} == {2}
    assert drone.texts == ["#Saving logs", "#Log save complete"]
    first = drone.say("clean_logs")
    assert first.message.startswith("send it again after 10 s to delete 1 flight:")
    assert len(names(flights)) == 2
    clock_of_test.now_s += 11.0
    answer = drone.say("clean_logs")
    assert answer.message == "1 flight; newest and starred flights are kept, 1 of 2"
    assert answer.accepted
    assert (await drone.done()).state == "complete"
    assert names(flights) == ["flight_log_2026-01-02"]
    assert not drone.say("clean_logs").accepted
    assert drone.texts[-1] == "#Logs deleted"


def test_a_second_save_copies_only_what_is_new(flights: Path, drive: Path) -> None:
    save(flights, drive)
    (flights / "flight_log_2026-01-02" / "flight.sqlite").write_bytes(b"longer than before")
    before = {path: path.stat().st_ino for path in drive.rglob("*") if path.is_file()}
    save(flights, drive)
    written = [path for path, number in before.items() if path.stat().st_ino != number]
    assert [path.name for path in written] == ["flight.sqlite"]
    assert tree(drive) == tree(flights)


def test_a_save_broken_off_leaves_whole_files_only_and_can_be_repeated(
    flights: Path, drive: Path
) -> None:
    before = tree(flights)
    for asked in range(9):  # each of the four files is asked for twice
        answers = iter([True] * asked)
        wanted = lambda answers=answers: next(answers, False)  # noqa: E731
        if asked < 8:
            with pytest.raises(RecordingError, match="uavrt is shutting down"):
                save(flights, drive, wanted)
        else:
            save(flights, drive, wanted)
        there = tree(drive)
        assert there.items() <= before.items()
        assert len(there) == asked // 2
        shutil.rmtree(drive)
        drive.mkdir()
    assert tree(flights) == before


async def test_the_system_ends_though_the_drive_hangs(flights: Path, drive: Path) -> None:
    hanging = drive / "flight_log_2026-01-01" / "flight.sqlite.part"
    hanging.parent.mkdir(parents=True)
    os.mkfifo(hanging)  # opening it takes until somebody reads
    drone = Drone(flights, drive)
    assert drone.say("save_logs").accepted
    await until(lambda: drone.steps and drone.steps[-1].message)
    await drone.operations.end()
    assert drone.operations.running is not None
    os.close(os.open(hanging, os.O_RDONLY))  # lets the thread go


async def test_a_drive_that_cannot_be_written_is_told(flights: Path, drive: Path) -> None:
    (drive / "flight_log_2026-01-01").write_text("a file in the way")
    drone = Drone(flights, drive)
    assert drone.say("save_logs").accepted
    last = await drone.done()
    assert last.state == "failed"
    assert drone.texts[-1] == last.message != ""


def test_without_a_drive_saving_is_refused_with_what_to_do(tmp_path: Path) -> None:
    drone = Drone(tmp_path, tmp_path / "gone")
    assert "Plug the drive in" in drone.refusal("save_logs")


def test_drives_are_those_mounted_where_desktops_mount_them() -> None:
    mounts = [
        "/dev/mmcblk0p2 / ext4 rw 0 0",
        "/dev/sda1 /media/pi/MY\\040STICK vfat rw 0 0",
        "tmpfs /run/user/1000 tmpfs rw 0 0",
        "/dev/sdb1 /run/media/pi/Füchse exfat rw 0 0",
        "broken",
    ]
    found = removable_drives(mounts)
    assert found == [Path("/media/pi/MY STICK"), Path("/run/media/pi/Füchse")]


def test_flights_are_left_alone_until_the_last_one_is_closed(flights: Path) -> None:
    drone = Drone(flights, flights.parent, capture_s=1.0, minimum_free_mb=0.0)
    assert drone.say("raw_capture", center_frequency_hz=146.0e6).accepted
    assert drone.say("stop_detection").accepted
    for name in ("clean_logs", "save_logs"):
        reply = drone.say(name)
        assert (reply.accepted, reply.message) == (False, "stopping: try again in a moment")
    assert (flights / "flight_log_2026-01-01" / "flight.sqlite").is_file()


def test_a_capture_needs_a_frequency_and_room_and_no_tags(tmp_path: Path) -> None:
    drone = Drone(tmp_path, None, minimum_free_mb=0.0, capture_s=2.0)
    assert "frequency is unknown" in drone.say("raw_capture").message
    assert drone.state == "idle"
    assert drone.say("raw_capture", center_frequency_hz=148.7e6).accepted
    assert drone.state == "capturing"
    assert (drone.flights[-1].tags, drone.flights[-1].capture_s) == ((), 2.0)
    assert drone.say("raw_capture").message == drone.flights[-1].directory
    assert not drone.say("save_logs").accepted
    assert drone.say("stop_detection").accepted
    assert drone.state == "idle"
    assert drone.say("raw_capture", center_frequency_hz=148.7e6).message.startswith("stopping")
    drone.mission.flight_ended()
    full = Drone(tmp_path, None, minimum_free_mb=1e9)
    assert "the disk is nearly full" in full.refusal("raw_capture", center_frequency_hz=148.7e6)


def health(status: str, process: str = "receiver") -> Health:
    return made.health(process, status=status)


def flight(capture_s: float | None) -> FlightInfo:
    return made.flight_info("flight_log_x", capture_s=capture_s)


def test_a_start_is_complete_when_samples_flow() -> None:
    steps: list[Operation] = []
    progress = FlightProgress(steps.append)
    progress.started(flight(None))
    progress.heard(health("receiving", "recorder"))
    progress.heard(health("waiting for samples"))
    progress.heard(health("receiving"))
    progress.heard(health("receiving"))
    progress.stopping()
    assert progress.ended("flight_log_x") == "Detection stopped"
    assert [(step.name, step.state) for step in steps] == [
        ("start_detection", "running"),
        ("start_detection", "complete"),
        ("stop_detection", "running"),
        ("stop_detection", "complete"),
    ]


@pytest.mark.parametrize(
    ("word", "state", "text"),
    [
        ("captured", "complete", "Raw capture: 5.0 of 8 s in x: the disk is nearly full"),
        ("not captured", "failed", "Raw capture failed: the samples were not recorded"),
    ],
)
def test_a_capture_ends_as_the_receiver_says(word: str, state: str, text: str) -> None:
    steps: list[Operation] = []
    progress = FlightProgress(steps.append)
    progress.started(flight(8.0))
    progress.heard(health("receiving"))
    assert not progress.capture_over()
    said = "5.0 of 8 s in x: the disk is nearly full" if word == "captured" else ""
    progress.heard(replace(health(word), reason=said))
    assert progress.capture_over()
    assert progress.ended("flight_log_x") == text
    assert (steps[-1].name, steps[-1].state) == ("raw_capture", state)
    assert not progress.capture_over()


def test_nothing_runs_beside_an_operation(tmp_path: Path) -> None:
    drone = Drone(tmp_path, None)
    drone.operations.running = Operation(name="clean_logs", state="running")
    with pytest.raises(UavrtError, match="busy: clean logs in progress"):
        drone.operations.check_free()


@pytest.mark.parametrize(
    ("status", "reason", "dropped_a_second", "why"),
    [
        (
            "waiting for samples",
            "",
            0.0,
            "the radio delivers no samples. Check that it is plugged in",
        ),
        ("radio absent", "airspy_rx found no radio", 0.0, "airspy_rx found no radio"),
        (
            "receiving",
            "",
            1e5,
            "the samples could not be written in time. Record to a faster disk, or record less",
        ),
        (
            "receiving",
            "",
            0.0,
            "the radio delivers too few samples. Check its cable, or set a lower sample rate",
        ),
    ],
)
def test_a_capture_that_takes_too_long_says_why(
    status: str, reason: str, dropped_a_second: float, why: str
) -> None:
    now_s = 0.0
    follow(lambda: now_s)
    progress = FlightProgress(lambda _: None)
    progress.started(made.flight_info("flight_log_x", capture_s=8.0))
    while not progress.capture_over():
        assert now_s < 100.0
        now_s += 1.0
        counters = {"recording_samples_dropped": dropped_a_second * now_s}
        progress.heard(
            made.health(
                "receiver", status=status, ok=not reason, reason=reason, counters=counters
            )
        )
    assert progress.ended("flight_log_x") == f"Raw capture failed: {why}"
