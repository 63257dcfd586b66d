"""A tag that is searched gets other values in the flight that goes on; nothing else does."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest

from uavrt.commands import SystemState
from uavrt.config.settings import RadioSettings, RecordingSettings, Settings
from uavrt.messages import Command, CommandReply, FlightInfo
from uavrt.supervisor.mission.orders import Mission

TAG = made.tag(2, 148_710_000.0, 1.254, name="otter")
Say = Callable[..., CommandReply]


@pytest.fixture
def flown(tmp_path: Path) -> tuple[Mission, Say, list[FlightInfo]]:
    corrected: list[FlightInfo] = []
    mission = made.mission(
        Settings(
            recording=RecordingSettings(directory=str(tmp_path)),
            radio=RadioSettings(center_frequency_hz=148.7e6),
        ),
        tmp_path,
        on_correction=corrected.append,
    )
    numbers = iter(range(100))

    def say(name: Any, **details: Any) -> CommandReply:
        return mission.command(Command(name=name, request_id=next(numbers), **details))

    say("start_tags")
    say("add_tag", tag=TAG)
    say("end_tags")
    assert say("start_detection").accepted
    return mission, say, corrected


def test_a_corrected_frequency_is_searched_and_remembered_under_the_same_name(
    flown: tuple[Mission, Say, list[FlightInfo]],
) -> None:
    mission, say, corrected = flown
    assert mission.flight is not None
    directory = mission.flight.directory
    better = replace(TAG, frequency_hz=148_710_640.0, name=None)
    reply = say("add_tag", tag=better)
    assert (reply.accepted, reply.message) == (True, "148.710640 MHz, was 148.710000")
    (flight,) = corrected
    assert flight.directory == directory
    assert flight.tags == (replace(better, name="otter"),)
    assert mission.tags[2] == flight.tags[0]
    assert mission.state is SystemState.DETECTING
    assert say("add_tag", tag=better).message == "as it was"
    assert len(corrected) == 1


@pytest.mark.parametrize(
    ("tag", "words"),
    [
        (replace(TAG, tag_id=4), "send stop first"),
        (replace(TAG, frequency_hz=151_000_000.0), "not received at 148.7"),
        (replace(TAG, frequency_hz=-1.0), "frequency"),
        (replace(TAG, pulse_width_s=0.0025, gaps_s=(0.022, 0.0488)), "coded"),
    ],
)
def test_what_cannot_be_searched_in_this_flight_is_refused(
    flown: tuple[Mission, Say, list[FlightInfo]], tag: Any, words: str
) -> None:
    mission, say, corrected = flown
    reply = say("add_tag", tag=tag)
    assert not reply.accepted
    assert words in reply.message
    assert mission.tags == {2: TAG}
    assert corrected == []
