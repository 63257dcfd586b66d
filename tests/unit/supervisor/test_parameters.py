"""Parameters that an operator sets: in force, kept, refused."""

import math
from dataclasses import replace
from pathlib import Path

import made
import msgspec
import pytest
from operated import RADIO, Operator

from uavrt.config.settings import MavlinkSettings
from uavrt.drone.supervisor.mission.kept_parameters import PARAMETERS_NAME
from uavrt.drone.supervisor.mission.tag_upload import LAST_TAGS_NAME

TAG = made.tag()


def test_k_that_is_set_in_flight_waits_for_the_next_start(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    operator.detect(TAG)
    reply = operator.set("DET_K", 5)
    assert (reply.accepted, reply.message) == (True, "DET_K = 5, from the next start")
    assert operator.set("RADIO_GAIN", 10).message == "RADIO_GAIN = 10"
    assert operator.flights[-1].tags[0].k == 3
    assert operator.state == "detecting"
    operator.say("stop_detection")
    operator.mission.flight_ended()
    operator.say("start_detection")
    assert operator.flights[-1].tags[0].k == 5
    assert operator.mission.upload.tags[2].k == 3
    assert [change.detection.k for change in operator.changes] == [5, 5]


def test_a_parameter_outlives_the_supervisor_until_the_file_differs(tmp_path: Path) -> None:
    assert Operator(tmp_path).set("RADIO_GAIN", 12).accepted
    assert Operator(tmp_path).mission.settings.now.radio.gain == 12
    edited = replace(RADIO, gain=18)
    assert Operator(tmp_path, radio=edited).mission.settings.now.radio.gain == 18


def test_a_parameter_set_back_to_the_file_is_forgotten(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    operator.set("RADIO_GAIN", 12)
    operator.set("RADIO_GAIN", -1)
    assert (tmp_path / PARAMETERS_NAME).read_text().strip() == "{}"


def test_a_damaged_file_of_parameters_costs_only_them(tmp_path: Path) -> None:
    (tmp_path / PARAMETERS_NAME).write_text('{"RADIO_GAIN": 3')
    assert Operator(tmp_path).mission.settings.now.radio.gain is None
    (tmp_path / PARAMETERS_NAME).write_text('{"RADIO_GAIN": {"value": 99, "instead_of": -1}}')
    assert Operator(tmp_path).mission.settings.now.radio.gain is None


def test_an_impossible_value_is_refused_and_changes_nothing(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    for name, value in (("RADIO_GAIN", 22), ("DET_FALSE_ALARM", 1.0), ("NOTHING", 1.0)):
        assert name in operator.refusal("set_parameter", parameter=name, value=value)
    assert not operator.say("set_parameter").accepted
    assert operator.changes == []
    assert not (tmp_path / PARAMETERS_NAME).exists()


def with_tags(directory: Path, source: str = "") -> Operator:
    operator = Operator(directory)
    operator.send_tags(TAG, source=source)
    return operator


def test_detection_starts_and_stops_by_a_parameter(tmp_path: Path) -> None:
    operator = with_tags(tmp_path)
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
    operator = with_tags(tmp_path)
    reply = operator.refusal("set_parameter", parameter="DET_RUN", value=value)
    assert reply == f"DET_RUN cannot be {value:g}: 1 starts detection, 0 stops it"
    assert operator.state == "has_tags"


def test_without_any_tags_the_parameter_is_refused_with_the_remedy(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    reply = operator.refusal("set_parameter", parameter="DET_RUN", value=1)
    assert reply == "no tags stored: send them once with uavrt ground"
    assert operator.state == "idle"
    assert operator.set("DET_RUN", 0).accepted
    assert operator.flights == []


def test_the_tags_that_were_sent_last_outlive_a_stop_in_good_order(tmp_path: Path) -> None:
    before = with_tags(tmp_path)
    before.mission.delete_saved_state()
    after = Operator(tmp_path)
    assert not after.mission.resume()
    assert after.say("start_detection").message == "no tags: send tags first"
    assert after.set("DET_RUN", 1).accepted
    assert after.flights[0].tags == (TAG,)
    assert after.state == "detecting"


def test_an_unfinished_list_keeps_no_other_from_the_last_one(tmp_path: Path) -> None:
    laptop, tablet = "mavlink 254/190", "mavlink 255/190"
    operator = with_tags(tmp_path, laptop)
    operator.say("start_tags", laptop)
    operator.say("add_tag", laptop, tag=replace(TAG, tag_id=4))
    own = operator.set("DET_RUN", 1.0, laptop)
    assert own.message == "tags are being sent: send END_TAGS first"
    assert not operator.set("DET_RUN", 1.0, tablet).accepted
    assert operator.state == "receiving_tags"
    assert operator.set("DET_RUN", 1.0, tablet, sealed=True).accepted
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
    operator = Operator(tmp_path)
    assert "tag" in operator.refusal("set_parameter", parameter="DET_RUN", value=1)
    assert operator.state == "idle"
    assert operator.mission.upload.tags == {}
    assert operator.flights == []


def test_the_parameter_is_for_who_commands_as_start_and_stop_are(tmp_path: Path) -> None:
    first, other = "mavlink 255/190", "mavlink 254/190"
    operator = with_tags(tmp_path, first)
    assert operator.set("DET_RUN", 1, first).accepted
    refused = operator.set("DET_RUN", 0, other)
    assert refused.message.startswith("mavlink 255/190 is in command")
    assert operator.state == "detecting"
    assert operator.set("DET_RUN", 0, first).accepted
    operator.mission.flight_ended()
    # The next flight may be anybody's, though settings stay with who flew the last one.
    assert not operator.set("DET_K", 5, other).accepted
    assert operator.set("DET_RUN", 1, other).accepted
    assert not operator.set("DET_RUN", 0, first).accepted
    assert operator.set("DET_RUN", 0, first, sealed=True).accepted


def test_with_a_key_the_parameter_needs_a_seal_by_ros_2_too(tmp_path: Path) -> None:
    operator = with_tags(tmp_path)
    operator.mission.settings.now = replace(
        operator.mission.settings.now, mavlink=MavlinkSettings(key_file="key")
    )
    reply = operator.set("DET_RUN", 1.0, "ros2")
    assert (
        reply.message
        == "this drone has a key, so it refuses unauthenticated commands, as from ROS 2"
    )
    assert operator.flights == []
