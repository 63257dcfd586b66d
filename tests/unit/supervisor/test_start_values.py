"""A start with what no radio can be set to, or with fewer tags than were sent, is refused."""

import math
from dataclasses import replace
from pathlib import Path

import made
import pytest
from operated import RADIO, Operator

from uavrt.config.parameters import check_start
from uavrt.core.errors import ConfigError

TAGS = [made.tag(2 * number, 148.7e6 + 5e3 * number) for number in range(1, 4)]
SOURCES = ["ros2", "mavlink 255/190", "command line 1"]


@pytest.mark.parametrize("hertz", [148705000e6, -148.7e6, 0.0, 19.9e6, 1.01e9, math.inf])
@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("name", ["start_detection", "raw_capture"])
def test_an_impossible_frequency_is_refused_on_every_road(
    tmp_path: Path, hertz: float, source: str, name: str
) -> None:
    operator = Operator(tmp_path)
    operator.send_tags(*TAGS, source=source)
    reply = operator.refusal(name, source, center_frequency_hz=hertz, gain=3)
    assert reply.endswith("MHz is not supported: choose 20 to 1000 MHz")
    assert operator.mission.flights.flight is None
    assert operator.mission.settings.now.radio.gain is None, "a refused start changes nothing"
    assert operator.say(name, source, center_frequency_hz=148.71e6).accepted


@pytest.mark.parametrize("source", SOURCES)
def test_an_impossible_gain_is_refused_with_its_range(tmp_path: Path, source: str) -> None:
    operator = Operator(tmp_path, radio=replace(RADIO, kind="airspyhf"))
    operator.send_tags(*TAGS, source=source)
    reply = operator.refusal("start_detection", source, gain=9)
    assert reply == "RADIO_GAIN cannot be 9: whole, 0 to 8, or -1"


def test_where_the_radio_is_not_known_the_widest_range_holds() -> None:
    assert check_start(None, 148.7e6, 102) == 102
    for frequency_hz, gain in ((math.nan, None), (None, math.nan), (None, 121), (None, 1.5)):
        with pytest.raises(ConfigError):
            check_start(None, frequency_hz, gain)


def test_a_frequency_without_tags_is_refused_and_missing_tags_are_named(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    operator.send_tags(*TAGS)
    reply = operator.say("start_detection", center_frequency_hz=433e6)
    assert (reply.accepted, reply.message) == (
        False,
        "no tag is in the band received at 433 MHz (431.5 to 434.5 MHz): choose another "
        "frequency",
    )
    assert operator.say("start_detection", center_frequency_hz=148.712e6 + 1.5e6).accepted
    assert "Not received (148.712 to 151.712 MHz): tags 2, 4" in operator.texts


@pytest.mark.parametrize("source", SOURCES)
def test_an_incomplete_upload_is_remembered_whoever_starts_and_whatever_restarts(
    tmp_path: Path, source: str
) -> None:
    operator = Operator(tmp_path)
    operator.send_tags(*TAGS[:2], source="ros2", count=3)
    operator.mission.drop_replies()  # the gateway was killed
    for _ in range(2):
        reply = operator.say("start_detection", source)
        if source != "mavlink 255/190":  # which does not command
            assert reply.message == "only 2 of 3 tags arrived: send them all again"
        assert not reply.accepted
        reply = operator.set("DET_RUN", 1.0, source)
        assert not reply.accepted
        operator = Operator(tmp_path)  # the supervisor was killed
        operator.mission.resume()
    operator.send_tags(*TAGS, source="ros2", count=3)
    assert operator.say("start_detection", "ros2").accepted


def test_an_incomplete_upload_does_not_replace_the_last_tags(tmp_path: Path) -> None:
    operator = Operator(tmp_path)
    operator.send_tags(*TAGS, count=3)
    operator.send_tags(*TAGS[:1], count=2)
    operator.mission.delete_saved_state()
    afterwards = Operator(tmp_path)
    assert afterwards.set("DET_RUN", 1.0).accepted
    assert list(afterwards.mission.upload.tags.values()) == TAGS


@pytest.mark.parametrize("source", SOURCES)
def test_a_repeated_start_is_answered_with_the_same_flight(tmp_path: Path, source: str) -> None:
    operator = Operator(tmp_path)
    operator.send_tags(*TAGS, source=source)
    first, again = (operator.say("start_detection", source) for _ in range(2))
    assert first.accepted
    assert again.accepted
    assert Path(first.message).is_dir()
    assert again.message == first.message
