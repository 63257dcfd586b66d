"""Parameters that an operator sets: in force, kept, refused."""

import math
from dataclasses import replace
from pathlib import Path

import made
import msgspec
import pytest

from uavrt.config.settings import MavlinkSettings, RadioSettings, RecordingSettings, Settings
from uavrt.core.commands import SystemState
from uavrt.core.messages import Command, CommandReply, FlightInfo
from uavrt.drone.supervisor.mission.kept_parameters import PARAMETERS_NAME
from uavrt.drone.supervisor.mission.tag_upload import LAST_TAGS_NAME

TAG = made.tag()


class Operator:
    """Commands a mission as a freshly started supervisor has it."""

    def __init__(self, directory: Path, radio: RadioSettings) -> None:
        self.flights: list[FlightInfo] = []
        self.changes: list[Settings] = []
        self.mission = made.mission(
            Settings(recording=RecordingSettings(directory=str(directory)), radio=radio),
            directory,
            on_start=self.flights.append,
            on_settings=self.changes.append,
        )
        self._number = 0

    @property
    def state(self) -> str:
        return self.mission.state.value

    def say(self, name: str, **details: object) -> CommandReply:
        self._number += 1
        command = Command(name=name, request_id=self._number, **details)  # type: ignore[arg-type]
        return self.mission.command(command)

    def set(self, name: str, value: float) -> CommandReply:
        return self.say("set_parameter", parameter=name, value=value)


RADIO = RadioSettings(center_frequency_hz=148.7e6)


def test_k_that_is_set_in_flight_waits_for_the_next_start(tmp_path: Path) -> None:
    operator = Operator(tmp_path, RADIO)
    operator.say("start_tags")
    operator.say("add_tag", tag=TAG)
    operator.say("end_tags")
    operator.say("start_detection")
    reply = operator.set("DET_K", 5)
    assert (reply.accepted, reply.message) == (True, "DET_K = 5, from the next start")
    assert operator.set("RADIO_GAIN", 10).message == "RADIO_GAIN = 10"
    assert operator.flights[-1].tags[0].k == 3
    assert operator.mission.state is SystemState.DETECTING
    operator.say("stop_detection")
    operator.mission.flight_ended()
    operator.say("start_detection")
    assert operator.flights[-1].tags[0].k == 5
    assert operator.mission.upload.tags[2].k == 3
    assert [change.detection.k for change in operator.changes] == [5, 5]


def test_a_parameter_outlives_the_supervisor_until_the_file_says_otherwise(
    tmp_path: Path,
) -> None:
    assert Operator(tmp_path, RADIO).set("RADIO_GAIN", 12).accepted
    assert Operator(tmp_path, RADIO).mission.settings.now.radio.gain == 12
    edited = RadioSettings(center_frequency_hz=148.7e6, gain=18)
    assert Operator(tmp_path, edited).mission.settings.now.radio.gain == 18


def test_a_parameter_set_back_to_the_file_is_forgotten(tmp_path: Path) -> None:
    operator = Operator(tmp_path, RADIO)
    operator.set("RADIO_GAIN", 12)
    operator.set("RADIO_GAIN", -1)
    assert (tmp_path / PARAMETERS_NAME).read_text().strip() == "{}"


def test_a_damaged_file_of_parameters_costs_only_them(tmp_path: Path) -> None:
    (tmp_path / PARAMETERS_NAME).write_text('{"RADIO_GAIN": 3')
    assert Operator(tmp_path, RADIO).mission.settings.now.radio.gain is None
    (tmp_path / PARAMETERS_NAME).write_text('{"RADIO_GAIN": {"value": 99, "instead_of": -1}}')
    assert Operator(tmp_path, RADIO).mission.settings.now.radio.gain is None


def test_an_impossible_value_is_refused_and_changes_nothing(tmp_path: Path) -> None:
    operator = Operator(tmp_path, RADIO)
    for name, value in (("RADIO_GAIN", 22), ("DET_FALSE_ALARM", 1.0), ("NOTHING", 1.0)):
        reply = operator.set(name, value)
        assert not reply.accepted
        assert name in reply.message
    assert not operator.say("set_parameter").accepted
    assert operator.changes == []
    assert not (tmp_path / PARAMETERS_NAME).exists()


def with_tags(operator: Operator, source: str = "") -> Operator:
    operator.say("start_tags", source=source)
    operator.say("add_tag", tag=TAG, source=source)
    operator.say("end_tags", source=source)
    return operator


def test_detection_starts_and_stops_by_a_parameter(tmp_path: Path) -> None:
    operator = with_tags(Operator(tmp_path, RADIO))
    reply = operator.set("DET_RUN", 1)
    assert (reply.accepted, reply.name) == (True, "set_parameter")
    assert operator.state == "detecting"
    assert operator.set("DET_RUN", 1).accepted  # repeated, as a ground station does
    assert len(operator.flights) == 1
    assert operator.set("DET_RUN", 0).accepted
    assert operator.state == "has_tags"
    assert operator.set("DET_RUN", 1).message == "stopping: try again in a moment"
    operator.mission.flight_ended()
    assert operator.set("DET_RUN", 1).accepted
    assert [flight.tags for flight in operator.flights] == [(TAG,), (TAG,)]


@pytest.mark.parametrize("value", [2.0, -1.0, 0.5, math.nan, math.inf])
def test_what_is_neither_start_nor_stop_changes_nothing(tmp_path: Path, value: float) -> None:
    operator = with_tags(Operator(tmp_path, RADIO))
    reply = operator.set("DET_RUN", value)
    assert not reply.accepted
    assert reply.message == f"DET_RUN cannot be {value:g}: 1 starts, 0 stops"
    assert operator.mission.state is SystemState.HAS_TAGS


def test_without_any_tags_the_parameter_is_refused_with_the_remedy(tmp_path: Path) -> None:
    operator = Operator(tmp_path, RADIO)
    reply = operator.set("DET_RUN", 1)
    assert not reply.accepted
    assert reply.message == "no tags stored: send them once with uavrt ground"
    assert operator.mission.state is SystemState.IDLE
    assert operator.set("DET_RUN", 0).accepted
    assert operator.flights == []


def test_the_tags_that_were_sent_last_outlive_a_stop_in_good_order(tmp_path: Path) -> None:
    before = with_tags(Operator(tmp_path, RADIO))
    before.mission.delete_saved_state()
    after = Operator(tmp_path, RADIO)
    assert not after.mission.resume()
    assert after.say("start_detection").message == "no tags: send tags first"
    assert after.set("DET_RUN", 1).accepted
    assert after.flights[0].tags == (TAG,)
    assert after.mission.state is SystemState.DETECTING


def test_a_list_that_its_sender_never_finished_keeps_nobody_from_the_last_one(
    tmp_path: Path,
) -> None:
    laptop, tablet = "mavlink 254/190", "mavlink 255/190"
    operator = with_tags(Operator(tmp_path, RADIO), laptop)
    operator.say("start_tags", source=laptop)
    operator.say("add_tag", tag=replace(TAG, tag_id=4), source=laptop)
    run = {"parameter": "DET_RUN", "value": 1.0}
    own = operator.say("set_parameter", source=laptop, **run)
    assert own.message == "tags are being sent: send END_TAGS first"
    assert not operator.say("set_parameter", source=tablet, **run).accepted
    assert operator.state == "receiving_tags"
    assert operator.say("set_parameter", source=tablet, sealed=True, **run).accepted
    assert operator.flights[0].tags == (TAG,)


@pytest.mark.parametrize(
    "content",
    [
        b"[{",
        b"\xff\xfe",
        b'[{"tag_id": "2"}]',
        msgspec.json.encode([replace(TAG, k=10**6)]),
        msgspec.json.encode([TAG, replace(TAG, k=5)]),
    ],
)
def test_damaged_or_bad_last_tags_are_not_searched(tmp_path: Path, content: bytes) -> None:
    (tmp_path / LAST_TAGS_NAME).write_bytes(content)
    operator = Operator(tmp_path, RADIO)
    reply = operator.set("DET_RUN", 1)
    assert not reply.accepted
    assert "tag" in reply.message
    assert operator.mission.state is SystemState.IDLE
    assert operator.mission.upload.tags == {}
    assert operator.flights == []


def test_the_parameter_is_for_who_commands_as_start_and_stop_are(tmp_path: Path) -> None:
    operator = with_tags(Operator(tmp_path, RADIO), "mavlink 255/190")

    def run(value: float, source: str, **details: object) -> CommandReply:
        return operator.say(
            "set_parameter", parameter="DET_RUN", value=value, source=source, **details
        )

    assert run(1, "mavlink 255/190").accepted
    refused = run(0, "mavlink 254/190")
    assert refused.message.startswith("mavlink 255/190 is in command")
    assert operator.mission.state is SystemState.DETECTING
    assert run(0, "mavlink 255/190").accepted
    operator.mission.flight_ended()
    # The next flight may be anybody's, though settings stay with who flew the last one.
    assert not operator.say(
        "set_parameter", parameter="DET_K", value=5.0, source="mavlink 254/190"
    ).accepted
    assert run(1, "mavlink 254/190").accepted
    assert not run(0, "mavlink 255/190").accepted
    assert run(0, "mavlink 255/190", sealed=True).accepted


def test_with_a_key_the_parameter_needs_a_seal_by_ros_2_too(tmp_path: Path) -> None:
    operator = with_tags(Operator(tmp_path, RADIO))
    operator.mission.settings.now = replace(
        operator.mission.settings.now, mavlink=MavlinkSettings(key_file="key")
    )
    reply = operator.say("set_parameter", parameter="DET_RUN", value=1.0, source="ros2")
    assert (
        reply.message
        == "this drone has a key, so it refuses unauthenticated commands, as from ROS 2"
    )
    assert operator.flights == []
