"""A tag that is searched gets other values in the flight that goes on; nothing else does."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest

from uavrt.config.parameters import parameter_values
from uavrt.config.settings import DetectionSettings, RadioSettings, RecordingSettings, Settings
from uavrt.core.commands import SystemState
from uavrt.core.errors import TunerError
from uavrt.core.messages import Command, CommandReply, FlightInfo
from uavrt.drone.supervisor.mission.mission_flights import Tuner
from uavrt.drone.supervisor.mission.operator_commands import Mission
from uavrt.drone.supervisor.mission.search_planning import Tuning, TuningRequest, request_tuning

TAG = made.tag(2, 148_710_000.0, 1.254, name="otter")
PrintText = Callable[..., CommandReply]


@pytest.fixture
def flown(tmp_path: Path) -> tuple[Mission, PrintText, list[FlightInfo]]:
    return fly(tmp_path, 500.0)


def fly(
    directory: Path, window_hz: float, tuner: Tuner = request_tuning
) -> tuple[Mission, PrintText, list[FlightInfo]]:
    corrected: list[FlightInfo] = []
    mission = made.mission(
        Settings(
            recording=RecordingSettings(directory=str(directory)),
            radio=RadioSettings(center_frequency_hz=148.7e6),
            detection=DetectionSettings(frequency_window_hz=window_hz),
        ),
        directory,
        on_correction=corrected.append,
        tuner=tuner,
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
    flown: tuple[Mission, PrintText, list[FlightInfo]],
) -> None:
    mission, say, corrected = flown
    assert mission.flights.flight is not None
    directory = mission.flights.flight.directory
    better = replace(TAG, frequency_hz=148_710_640.0, name=None)
    reply = say("add_tag", tag=better)
    assert (reply.accepted, reply.message) == (True, "148.710640 MHz, was 148.710000")
    (flight,) = corrected
    assert flight.directory == directory
    assert flight.tags == (replace(better, name="otter"),)
    assert mission.upload.tags[2] == flight.tags[0]
    assert mission.state is SystemState.DETECTING
    assert say("add_tag", tag=better).message == "unchanged"
    assert len(corrected) == 1


@pytest.mark.parametrize(
    ("tag", "words"),
    [
        (replace(TAG, tag_id=4), "send stop first"),
        (replace(TAG, frequency_hz=151_000_000.0), "148.7"),
        (replace(TAG, frequency_hz=-1.0), "frequency"),
        (replace(TAG, pulse_width_s=0.0025, gaps_s=(0.022, 0.0488)), "coded"),
    ],
)
def test_what_cannot_be_searched_in_this_flight_is_refused(
    flown: tuple[Mission, PrintText, list[FlightInfo]], tag: Any, words: str
) -> None:
    mission, say, corrected = flown
    reply = say("add_tag", tag=tag)
    assert not reply.accepted
    assert words in reply.message
    assert mission.upload.tags == {2: TAG}
    assert corrected == []


def test_a_wide_search_of_a_corrected_tag_is_checked_like_that_of_a_start(
    tmp_path: Path,
) -> None:
    asked: list[TuningRequest] = []

    def tuner(question: TuningRequest) -> Tuning:
        asked.append(question)
        if len(asked) > 2:
            raise TunerError("the search does not fit its channel")
        return Tuning(center_frequency_hz=148.7e6, warnings=("at the edge",) * (len(asked) - 1))

    mission, say, corrected = fly(tmp_path, 900.0, tuner)
    assert say("add_tag", tag=replace(TAG, frequency_hz=148_711_000.0)).accepted
    assert [one.frequency_hz for one in asked[1].tags] == [148_711_000.0]
    assert asked[1].center_frequency_hz == 148.7e6
    refused = say("add_tag", tag=replace(TAG, frequency_hz=148_712_000.0))
    assert (refused.accepted, len(corrected)) == (False, 1)
    assert "does not fit" in refused.message
    assert mission.upload.tags[2].frequency_hz == 148_711_000.0


def test_settings_that_were_promised_from_the_next_start_wait_for_it(
    flown: tuple[Mission, PrintText, list[FlightInfo]], tmp_path: Path
) -> None:
    mission, say, corrected = flown
    begun = parameter_values(mission.settings.in_flight)
    changed = {"DET_K": 7.0, "DET_FALSE_ALARM": 0.125, "RADIO_PPM": 12.0}
    for name, value in changed.items():
        said = say("set_parameter", parameter=name, value=value).message
        assert ("from the next start" in said) is (name != "RADIO_PPM")
    in_flight = begun | {"RADIO_PPM": 12.0}
    assert parameter_values(mission.settings.in_flight) == in_flight
    say("add_tag", tag=replace(TAG, frequency_hz=148_710_640.0))
    assert corrected[0].tags[0].k == TAG.k
    killed = mission.settings.now
    again = made.mission(Settings(recording=killed.recording, radio=killed.radio), tmp_path)
    assert again.resume()
    assert parameter_values(again.settings.in_flight) == in_flight
    again.flight_ended()
    again.flights.begin(148.7e6)
    assert parameter_values(again.settings.in_flight) == begun | changed
