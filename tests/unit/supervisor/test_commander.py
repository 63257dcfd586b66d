"""Whose commands count, by whatever wire they come, and what a stranger can remove: nothing."""

import os
from pathlib import Path
from typing import Any

import made
import pytest
from operated import Operator
from virtual_time import VirtualClock

from uavrt.config.settings import MavlinkSettings, RecordingSettings
from uavrt.core.messages import Command, CommandReply
from uavrt.drone.supervisor.mission.commanding_station import SILENCE_S, CommandingStation
from uavrt.drone.supervisor.mission.storage.flight_removal import SecondStep, removable
from uavrt.drone.supervisor.mission.storage.operations import Operations
from uavrt.flight.flight_layout import FlightLayout
from uavrt.flight.flight_order import flights_in_order, note_flight

TAG = made.tag()
FIRST, STRANGER, ROS = "mavlink 255/190", "mavlink 254/190", "ros2"


def command(source: str, name: Any = "stop_detection", *, sealed: bool = False) -> Command:
    return Command(name=name, request_id=1, source=source, sealed=sealed)


def test_the_first_commands_and_a_second_watches_until_a_minute_of_silence(
    clock_of_test: VirtualClock,
) -> None:
    commander = CommandingStation()
    assert commander.refusal(command(FIRST)) is None
    assert commander.accepted(command(FIRST))
    for _ in range(3):
        clock_of_test.now_s += SILENCE_S - 1.0
        refusal = commander.refusal(command(STRANGER))
        assert refusal is not None
        assert refusal.startswith("mavlink 255/190 is in command")
        assert len(refusal.encode()) <= 107, "an acknowledgement has no more room"
        commander.heard(FIRST, 0.0)  # its heartbeat
        commander.heard(STRANGER, 0.0)  # not its own
    assert commander.refused == 3
    assert commander.refusal(command(FIRST)) is None
    clock_of_test.now_s += SILENCE_S + 1.0
    assert commander.refusal(command(STRANGER)) is None
    assert commander.accepted(command(STRANGER))
    assert commander.refusal(command(FIRST)) is not None


def test_a_seal_takes_over_at_once_and_questions_need_nobody() -> None:
    commander = CommandingStation()
    commander.accepted(command(FIRST))
    assert commander.refusal(command(STRANGER, "radio_status")) is None
    assert not commander.accepted(command(STRANGER, "radio_status"))
    assert commander.name == FIRST
    assert commander.refusal(command(STRANGER, sealed=True)) is None
    assert commander.accepted(command(STRANGER, sealed=True))
    assert commander.refusal(command(FIRST)) is not None


def test_who_sits_at_the_drone_and_a_drone_for_everybody_ask_nobody() -> None:
    commander = CommandingStation()
    commander.accepted(command(FIRST))
    for source in ("capture", "command line", "command line 4711 140 6433.67"):
        assert commander.refusal(command(source)) is None
        assert not commander.accepted(command(source))
    everybody = CommandingStation(pinned=False)
    everybody.accepted(command(FIRST))
    assert everybody.refusal(command(STRANGER)) is None


@pytest.mark.parametrize("other", [STRANGER, ROS])
@pytest.mark.parametrize(
    "name", ["stop_detection", "set_parameter", "start_tags", "clean_logs"]
)
def test_nobody_elses_command_counts_by_any_wire(tmp_path: Path, name: str, other: str) -> None:
    operator = Operator(tmp_path)
    operator.detect(TAG, source=FIRST)
    before = operator.mission.settings.now
    reply = operator.refusal(name, other, parameter="DET_FALSE_ALARM", value=0.5)
    assert reply.startswith("mavlink 255/190 is in command")
    assert operator.state == "detecting"
    assert operator.mission.settings.now == before
    assert operator.say("stop_detection", FIRST).accepted


def test_the_next_flight_may_be_anybodys_but_not_the_flights_that_were(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    operator.detect(TAG, source=FIRST)
    assert operator.say("stop_detection", FIRST).accepted
    operator.mission.flight_ended()
    for name in ("clean_logs", "set_parameter"):
        refused = operator.say(name, STRANGER, parameter="DET_FALSE_ALARM", value=0.5)
        assert "is in command" in refused.message
    operator.detect(TAG, source=ROS)
    assert not operator.say("stop_detection", FIRST).accepted
    assert operator.mission.commander.name == ROS


def test_tags_that_were_sent_are_not_a_strangers_to_clear(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    operator.detect(TAG, source=FIRST)
    operator.say("stop_detection", FIRST)
    operator.mission.flight_ended()
    operator.send_tags(TAG, source=FIRST)
    assert not operator.say("start_tags", STRANGER).accepted
    assert list(operator.mission.upload.tags) == [2]


def test_a_command_that_does_nothing_makes_nobody_the_first(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    assert operator.say("stop_detection", STRANGER).message == "not detecting"
    assert not operator.say("set_parameter", STRANGER, parameter="NO", value=0.5).accepted
    operator.detect(TAG, source=FIRST)
    assert operator.mission.commander.name == FIRST


def test_a_locked_drone_takes_no_command_from_ros_2(tmp_path: Path) -> None:
    locked = Operator(tmp_path, mavlink=MavlinkSettings(key_file="command.key"))
    assert "refuses unauthenticated commands" in locked.refusal("start_tags", ROS)
    open_to_first = MavlinkSettings(key_file="command.key", key_required=False)
    Operator(tmp_path, mavlink=open_to_first).detect(TAG, source=ROS)


def test_a_restarted_supervisor_knows_who_commands(tmp_path: Path) -> None:
    Operator(tmp_path).detect(TAG, source=FIRST)
    again = Operator(tmp_path)
    again.mission.resume()
    assert not again.say("stop_detection", STRANGER).accepted
    assert again.say("stop_detection", FIRST).accepted


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


def test_to_delete_takes_two_steps_no_repetition(
    tmp_path: Path, clock_of_test: VirtualClock
) -> None:
    flights = flights_in(tmp_path, 3)
    operations = Operations(
        RecordingSettings(directory=str(tmp_path)),
        publish=lambda _operation: None,
        notify=lambda _severity, _text: None,
    )
    operator = Operator(tmp_path, {"operations": operations})

    def clean(after_s: float) -> CommandReply:
        clock_of_test.now_s += after_s
        try:
            return operator.say("clean_logs", FIRST)
        finally:
            assert all(flight.is_dir() for flight in flights)

    assert clean(0.0).message == (
        "send it again after 10 s to delete 2 flights: "
        "newest and starred flights are kept, 1 of 3"
    )
    for after_s in (2.0, 2.0, 2.0, 9.0):  # as a ground station repeats what is not answered
        assert not clean(after_s).accepted
    assert not clean(121.0).accepted, "forgotten"
    assert operations.running is None


def test_two_steps_are_two_of_the_same_one(clock_of_test: VirtualClock) -> None:
    step = SecondStep()
    for source, confirms in ((FIRST, False), (STRANGER, False), (FIRST, False), (FIRST, True)):
        assert step.is_confirmation(source) is confirms
        clock_of_test.now_s += 20.0
    assert not step.is_confirmation(FIRST), "the next time it is two steps again"
