"""A tag that is searched gets other values in the flight that goes on; nothing else does."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import made
import pytest
from operated import Operator
from some import some

from uavrt.config.parameters import parameter_values
from uavrt.config.settings import DetectionSettings
from uavrt.core.errors import TunerError
from uavrt.drone.supervisor.mission.search_planning import Tuning, TuningRequest
from uavrt.link.tunnel.tag_lists import digest_in, tag_list_digest

TAG = made.tag(2, 148_710_000.0, 1.254, name="otter")


@pytest.fixture
def operator(tmp_path: Path) -> Operator:
    """Of a drone that searches the tag."""
    flying = Operator(tmp_path)
    flying.detect(TAG)
    return flying


def test_a_corrected_frequency_is_searched_under_the_same_name(operator: Operator) -> None:
    mission = operator.mission
    directory = some(mission.flights.flight).directory
    better = replace(TAG, frequency_hz=148_710_640.0, name=None)
    reply = operator.say("add_tag", tag=better)
    assert (reply.accepted, reply.message) == (True, "148.710640 MHz, was 148.710000")
    (flight,) = operator.corrected
    assert flight.directory == directory
    assert flight.tags == (replace(better, name="otter"),)
    assert mission.upload.tags[2] == flight.tags[0]
    assert operator.state == "detecting"
    assert operator.say("add_tag", tag=better).message == "unchanged"
    assert len(operator.corrected) == 1


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
    operator: Operator, tag: Any, words: str
) -> None:
    assert words in operator.refusal("add_tag", tag=tag)
    assert operator.mission.upload.tags == {2: TAG}
    assert operator.corrected == []


def test_a_new_list_is_refused_with_the_one_that_is_searched(operator: Operator) -> None:
    reply = operator.refusal("start_tags")
    assert reply.startswith("detecting tags 2 (list ")
    assert reply.endswith(": send stop first")
    assert digest_in(reply) == tag_list_digest([TAG])


def test_a_wide_search_of_a_corrected_tag_is_checked_as_at_a_start(tmp_path: Path) -> None:
    asked: list[TuningRequest] = []

    def tuner(question: TuningRequest) -> Tuning:
        asked.append(question)
        if len(asked) > 2:
            raise TunerError("the search does not fit its channel")
        return Tuning(center_frequency_hz=148.7e6, warnings=("at the edge",) * (len(asked) - 1))

    wide = DetectionSettings(frequency_window_hz=900.0)
    operator = Operator(tmp_path, {"tuner": tuner}, detection=wide)
    operator.detect(TAG)
    assert operator.say("add_tag", tag=replace(TAG, frequency_hz=148_711_000.0)).accepted
    assert [one.frequency_hz for one in asked[1].tags] == [148_711_000.0]
    assert asked[1].center_frequency_hz == 148.7e6
    refused = operator.say("add_tag", tag=replace(TAG, frequency_hz=148_712_000.0))
    assert (refused.accepted, len(operator.corrected)) == (False, 1)
    assert "does not fit" in refused.message
    assert operator.mission.upload.tags[2].frequency_hz == 148_711_000.0


def test_settings_promised_from_the_next_start_wait(operator: Operator, tmp_path: Path) -> None:
    settings = operator.mission.settings
    begun = parameter_values(settings.in_flight)
    changed = {"DET_K": 7.0, "DET_FALSE_ALARM": 0.125, "RADIO_PPM": 12.0}
    for name, value in changed.items():
        said = operator.set(name, value).message
        assert ("from the next start" in said) is (name != "RADIO_PPM")
    in_flight = begun | {"RADIO_PPM": 12.0}
    assert parameter_values(settings.in_flight) == in_flight
    operator.say("add_tag", tag=replace(TAG, frequency_hz=148_710_640.0))
    assert operator.corrected[0].tags[0].k == TAG.k
    again = Operator(tmp_path, radio=settings.now.radio).mission
    assert again.resume()
    assert parameter_values(again.settings.in_flight) == in_flight
    again.flight_ended()
    again.flights.begin(148.7e6)
    assert parameter_values(again.settings.in_flight) == begun | changed
