"""Whose commands count, by whatever wire they come, and what a stranger can remove: nothing."""

import os
from pathlib import Path
from typing import Any

import made
import pytest

from uavrt.config.settings import MavlinkSettings, RadioSettings, RecordingSettings, Settings
from uavrt.core.commands import SystemState
from uavrt.core.messages import Command, CommandReply
from uavrt.drone.supervisor.mission.commanding_station import SILENCE_S, CommandingStation
from uavrt.drone.supervisor.mission.storage.disk_guard import DiskGuard
from uavrt.drone.supervisor.mission.storage.flight_removal import SecondStep, removable
from uavrt.drone.supervisor.mission.storage.operations import Operations
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import flights_in_order, note_flight

TAG = made.tag()
FIRST, STRANGER, ROS = "mavlink 255/190", "mavlink 254/190", "ros2"


class Watch:
    """A monotonic clock that a test turns."""

    def __init__(self) -> None:
        self.now_s = 1000.0

    def __call__(self) -> float:
        return self.now_s


def command(source: str, name: Any = "stop_detection", *, sealed: bool = False) -> Command:
    return Command(name=name, request_id=1, source=source, sealed=sealed)


def test_the_first_commands_and_a_second_watches_until_a_minute_of_silence() -> None:
    watch = Watch()
    commander = CommandingStation(clock_s=watch)
    assert commander.refusal(command(FIRST)) is None
    assert commander.accepted(command(FIRST))
    for _ in range(3):
        watch.now_s += SILENCE_S - 1.0
        refusal = commander.refusal(command(STRANGER))
        assert refusal is not None
        assert refusal.startswith("mavlink 255/190 is in command")
        assert len(refusal.encode()) <= 107, "an acknowledgement has no more room"
        commander.heard(FIRST, 0.0)  # its heartbeat
        commander.heard(STRANGER, 0.0)  # not its own
    assert commander.refused == 3
    assert commander.refusal(command(FIRST)) is None
    watch.now_s += SILENCE_S + 1.0
    assert commander.refusal(command(STRANGER)) is None
    assert commander.accepted(command(STRANGER))
    assert commander.refusal(command(FIRST)) is not None


def test_a_seal_takes_over_at_once_and_questions_need_nobody() -> None:
    commander = CommandingStation(clock_s=Watch())
    commander.accepted(command(FIRST))
    assert commander.refusal(command(STRANGER, "radio_status")) is None
    assert not commander.accepted(command(STRANGER, "radio_status"))
    assert commander.name == FIRST
    assert commander.refusal(command(STRANGER, sealed=True)) is None
    assert commander.accepted(command(STRANGER, sealed=True))
    assert commander.refusal(command(FIRST)) is not None


def test_who_sits_at_the_drone_and_a_drone_for_everybody_ask_nobody() -> None:
    commander = CommandingStation(clock_s=Watch())
    commander.accepted(command(FIRST))
    for source in ("capture", "command line", "command line 4711 140 6433.67"):
        assert commander.refusal(command(source)) is None
        assert not commander.accepted(command(source))
    everybody = CommandingStation(pinned=False, clock_s=Watch())
    everybody.accepted(command(FIRST))
    assert everybody.refusal(command(STRANGER)) is None


class Drone:
    """A mission with what it records."""

    def __init__(self, directory: Path, **mavlink: Any) -> None:
        settings = Settings(
            recording=RecordingSettings(directory=str(directory)),
            radio=RadioSettings(center_frequency_hz=148.7e6),
            mavlink=MavlinkSettings(**mavlink),
        )
        self.watch = Watch()
        self.operations = Operations(
            settings.recording,
            publish=lambda _operation: None,
            notify=lambda _severity, _text: None,
            clock_s=self.watch,
        )
        self.mission = made.mission(settings, directory, operations=self.operations)
        self._number = 0

    def say(self, source: str, name: Any, **details: Any) -> CommandReply:
        self._number += 1
        return self.mission.command(
            Command(name=name, request_id=self._number, source=source, **details)
        )

    def detect(self, source: str) -> None:
        self.say(source, "start_tags")
        self.say(source, "add_tag", tag=TAG)
        self.say(source, "end_tags")
        assert self.say(source, "start_detection").accepted


@pytest.mark.parametrize("other", [STRANGER, ROS])
@pytest.mark.parametrize(
    "name", ["stop_detection", "set_parameter", "start_tags", "clean_logs"]
)
def test_nobody_elses_command_counts_by_any_wire(tmp_path: Path, name: str, other: str) -> None:
    drone = Drone(tmp_path)
    drone.detect(FIRST)
    before = drone.mission.settings.now
    reply = drone.say(other, name, parameter="DET_FALSE_ALARM", value=0.5)
    assert not reply.accepted
    assert reply.message.startswith("mavlink 255/190 is in command")
    assert drone.mission.state is SystemState.DETECTING
    assert drone.mission.settings.now == before
    assert drone.say(FIRST, "stop_detection").accepted


def test_the_next_flight_may_be_anybodys_but_not_the_flights_that_were(tmp_path: Path) -> None:
    drone = Drone(tmp_path)
    drone.detect(FIRST)
    assert drone.say(FIRST, "stop_detection").accepted
    drone.mission.flight_ended()
    for name in ("clean_logs", "set_parameter"):
        refused = drone.say(STRANGER, name, parameter="DET_FALSE_ALARM", value=0.5)
        assert "is in command" in refused.message
    drone.detect(ROS)
    assert not drone.say(FIRST, "stop_detection").accepted
    assert drone.mission.commander.name == ROS


def test_tags_that_were_sent_are_not_a_strangers_to_clear(tmp_path: Path) -> None:
    drone = Drone(tmp_path)
    drone.detect(FIRST)
    drone.say(FIRST, "stop_detection")
    drone.mission.flight_ended()
    drone.say(FIRST, "start_tags")
    drone.say(FIRST, "add_tag", tag=TAG)
    drone.say(FIRST, "end_tags")
    assert not drone.say(STRANGER, "start_tags").accepted
    assert list(drone.mission.upload.tags) == [2]


def test_who_commands_by_ros_2_is_the_first_like_anybody_else(tmp_path: Path) -> None:
    drone = Drone(tmp_path)
    drone.detect(ROS)
    assert not drone.say(FIRST, "stop_detection").accepted
    assert drone.say(ROS, "stop_detection").accepted


def test_a_command_that_does_nothing_makes_nobody_the_first(tmp_path: Path) -> None:
    drone = Drone(tmp_path)
    assert drone.say(STRANGER, "stop_detection").message == "not detecting"
    assert not drone.say(STRANGER, "set_parameter", parameter="NO", value=0.5).accepted
    drone.detect(FIRST)
    assert drone.mission.commander.name == FIRST


def test_a_locked_drone_takes_no_command_from_ros_2(tmp_path: Path) -> None:
    drone = Drone(tmp_path, key_file="command.key")
    reply = drone.say(ROS, "start_tags")
    assert (reply.accepted, "only accepts sealed" in reply.message) == (False, True)
    open_to_first = Drone(tmp_path, key_file="command.key", key_required=False)
    open_to_first.detect(ROS)


def test_a_restarted_supervisor_knows_who_commands(tmp_path: Path) -> None:
    Drone(tmp_path).detect(FIRST)
    again = Drone(tmp_path)
    again.mission.resume()
    assert not again.say(STRANGER, "stop_detection").accepted
    assert again.say(FIRST, "stop_detection").accepted


def flights_in(directory: Path, count: int) -> list[Path]:
    made = []
    for number in range(count):
        flight = directory / f"flight_log_2026-01-0{number + 1}_08-00-00"
        flight.mkdir(parents=True)
        (flight / "flight.sqlite").touch()
        for path in (flight / "flight.sqlite", flight):
            os.utime(path, (1000 + number, 1000 + number))
        made.append(flight)
    return made


def test_the_newest_and_the_starred_flights_are_never_removed(tmp_path: Path) -> None:
    flights = flights_in(tmp_path, 5)
    FlightLayout(flights[1]).star.touch()
    assert removable(flights) == [flights[0], *flights[2:4]]
    assert removable([]) == removable(flights[:1]) == []


def test_a_flight_of_1970_that_was_flown_last_is_the_newest_and_stays(tmp_path: Path) -> None:
    """Neither its name nor its files' times say so: only what was noted as it began."""
    (before,) = flights_in(tmp_path, 1)
    note_flight(before)
    last = tmp_path / "flight_log_1970-01-01_00-05-00"
    last.mkdir()
    (last / "flight.sqlite").touch()
    note_flight(last)
    for path in (last / "flight.sqlite", last):
        os.utime(path, (300, 300))
    assert removable(flights_in_order(tmp_path)) == [before]


def test_a_full_disk_removes_no_starred_flight(tmp_path: Path) -> None:
    flights = flights_in(tmp_path, 3)
    FlightLayout(flights[0]).star.touch()
    settings = RecordingSettings(
        minimum_free_mb=1e12, remove_oldest_flights=True, keep_newest_flights=1
    )
    DiskGuard(tmp_path, settings).check()
    assert flights[0].is_dir()
    assert not flights[1].exists()


def test_to_delete_takes_two_steps_that_no_repetition_makes(tmp_path: Path) -> None:
    flights = flights_in(tmp_path, 3)
    drone = Drone(tmp_path)

    def clean(after_s: float) -> CommandReply:
        drone.watch.now_s += after_s
        try:
            return drone.say(FIRST, "clean_logs")
        finally:
            assert all(flight.is_dir() for flight in flights)

    assert clean(0.0).message == (
        "send it again after 10 s to delete 2 flights: "
        "newest and starred flights are kept, 1 of 3"
    )
    for after_s in (2.0, 2.0, 2.0, 9.0):  # as a ground station repeats what is not answered
        assert not clean(after_s).accepted
    assert not clean(121.0).accepted, "forgotten"
    assert drone.operations.running is None


def test_two_steps_are_two_of_the_same_one() -> None:
    watch = Watch()
    step = SecondStep(watch)
    assert not step.is_confirmation(FIRST)
    watch.now_s += 20.0
    assert not step.is_confirmation(STRANGER)
    watch.now_s += 20.0
    assert not step.is_confirmation(FIRST)
    watch.now_s += 20.0
    assert step.is_confirmation(FIRST)
    watch.now_s += 20.0
    assert not step.is_confirmation(FIRST), "the next time it is two steps again"
