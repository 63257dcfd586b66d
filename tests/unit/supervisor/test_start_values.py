"""A start with what no radio can be set to, or with fewer tags than were sent, is refused."""

import math
from pathlib import Path
from typing import Any

import made
import pytest

from uavrt.config.parameters import check_start
from uavrt.config.settings import RadioSettings, RecordingSettings, Settings
from uavrt.core.errors import ConfigError
from uavrt.core.messages import Command, CommandReply, Tag
from uavrt.drone.supervisor.mission.operator_commands import Mission
from uavrt.drone.supervisor.mission.saved_state import StateStore

TAGS = [made.tag(2 * number, 148.7e6 + 5e3 * number) for number in range(1, 4)]
SOURCES = ["ros2", "mavlink 255/190", "command line 1"]


class Drone:
    """A mission and its operator."""

    def __init__(self, directory: Path, kind: str = "airspy") -> None:
        self.told: list[str] = []
        self.mission = Mission(
            Settings(
                recording=RecordingSettings(directory=str(directory)),
                radio=RadioSettings(kind=kind, center_frequency_hz=148.7e6),
            ),
            StateStore(directory),
            notify=lambda _severity, text: self.told.append(text),
            on_start=lambda _flight: None,
            on_stop=lambda: None,
        )
        self._number = 0

    def ask(self, name: Any, source: str = "ros2", **details: Any) -> CommandReply:
        self._number += 1
        return self.mission.command(
            Command(name=name, request_id=self._number, source=source, **details)
        )

    def send_tags(
        self, tags: list[Tag], source: str = "ros2", count: int | None = None
    ) -> None:
        assert self.ask("start_tags", source).accepted
        for tag in tags:
            assert self.ask("add_tag", source, tag=tag).accepted
        assert self.ask("end_tags", source, tag_count=count).accepted


@pytest.mark.parametrize("hertz", [148705000e6, -148.7e6, 0.0, 19.9e6, 1.01e9, math.inf])
@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("name", ["start_detection", "raw_capture"])
def test_an_impossible_frequency_is_refused_on_every_road(
    tmp_path: Path, hertz: float, source: str, name: str
) -> None:
    drone = Drone(tmp_path)
    drone.send_tags(TAGS, source)
    reply = drone.ask(name, source, center_frequency_hz=hertz, gain=3)
    assert not reply.accepted
    assert reply.message.endswith("MHz is not supported: choose 20 to 1000 MHz")
    assert drone.mission.flights.flight is None
    assert drone.mission.settings.now.radio.gain is None, "a refused start changes nothing"
    assert drone.ask(name, source, center_frequency_hz=148.71e6).accepted


@pytest.mark.parametrize("source", SOURCES)
def test_an_impossible_gain_is_refused_with_the_radio_s_range(
    tmp_path: Path, source: str
) -> None:
    drone = Drone(tmp_path, kind="airspyhf")
    drone.send_tags(TAGS, source)
    reply = drone.ask("start_detection", source, gain=9)
    assert not reply.accepted
    assert reply.message == "RADIO_GAIN cannot be 9: whole, 0 to 8, or -1"


def test_where_the_radio_is_not_known_the_widest_range_holds() -> None:
    assert check_start(None, 148.7e6, 102) == 102
    for frequency_hz, gain in ((math.nan, None), (None, math.nan), (None, 121), (None, 1.5)):
        with pytest.raises(ConfigError):
            check_start(None, frequency_hz, gain)


def test_a_frequency_at_which_no_tag_is_received_is_refused_and_missing_ones_are_named(
    tmp_path: Path,
) -> None:
    drone = Drone(tmp_path)
    drone.send_tags(TAGS)
    reply = drone.ask("start_detection", center_frequency_hz=433e6)
    assert (reply.accepted, reply.message) == (
        False,
        "no tag is in the band received at 433 MHz (431.5 to 434.5 MHz): choose another "
        "frequency",
    )
    assert drone.ask("start_detection", center_frequency_hz=148.712e6 + 1.5e6).accepted
    assert "Not received (148.712 to 151.712 MHz): tags 2, 4" in drone.told


@pytest.mark.parametrize("source", SOURCES)
def test_an_incomplete_upload_is_remembered_whoever_starts_and_whatever_restarts(
    tmp_path: Path, source: str
) -> None:
    drone = Drone(tmp_path)
    drone.send_tags(TAGS[:2], count=3)
    drone.mission.drop_replies()  # the gateway was killed
    for _ in range(2):
        reply = drone.ask("start_detection", source)
        if source != "mavlink 255/190":  # which does not command
            assert reply.message == "only 2 of 3 tags arrived: send them all again"
        assert not reply.accepted
        reply = drone.ask("set_parameter", source, parameter="DET_RUN", value=1.0)
        assert not reply.accepted
        drone = Drone(tmp_path)  # the supervisor was killed
        drone.mission.resume()
    drone.send_tags(TAGS, count=3)
    assert drone.ask("start_detection").accepted


def test_an_incomplete_upload_does_not_replace_the_last_tags(tmp_path: Path) -> None:
    drone = Drone(tmp_path)
    drone.send_tags(TAGS, count=3)
    drone.send_tags(TAGS[:1], count=2)
    drone.mission.delete_saved_state()
    afterwards = Drone(tmp_path)
    assert afterwards.ask("set_parameter", parameter="DET_RUN", value=1.0).accepted
    assert list(afterwards.mission.upload.tags.values()) == TAGS


@pytest.mark.parametrize("source", SOURCES)
def test_a_start_that_is_asked_for_again_is_answered_with_the_same_flight(
    tmp_path: Path, source: str
) -> None:
    drone = Drone(tmp_path)
    drone.send_tags(TAGS, source)
    first, again = (drone.ask("start_detection", source) for _ in range(2))
    assert first.accepted
    assert again.accepted
    assert Path(first.message).is_dir()
    assert again.message == first.message
