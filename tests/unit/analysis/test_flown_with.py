"""What a flight was flown with is what everything reckons with, unless another is named."""

import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import pytest
from file_bearings import read_bearings
from some import some

from uavrt.analysis.estimates.positions import read_positions
from uavrt.analysis.inputs.flown_with import flight_antenna, flight_settings
from uavrt.analysis.survey import read_survey
from uavrt.config.settings import Settings
from uavrt.core.errors import UsageError
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.localization.estimates.flight_estimates import EstimationOptions, TagBearing

WriteFlight = Callable[..., Path]


def flown_with(antenna: str) -> Settings:
    return replace(Settings(), bearings=replace(Settings().bearings, antenna=antenna))


def told(bearings: Sequence[TagBearing]) -> list[tuple[float, float | None]]:
    return [(one.bearing.bearing_deg, one.bearing.evidence) for one in bearings]


@pytest.fixture(scope="module")
def flight(write_flight: WriteFlight) -> Path:
    return write_flight(settings=flown_with("RA-2A"), name="with_ra_2a")


def test_bearings_positions_and_reports_take_the_drones_own_antenna(flight: Path) -> None:
    found = told(read_bearings(flight))
    assert found == told(read_bearings(flight, how=EstimationOptions(antenna="RA-2A")))
    assert found != told(read_bearings(flight, how=EstimationOptions(antenna="RA-23K")))
    survey = read_survey(flight)
    assert survey.antenna == "RA-2A"
    assert told(survey.bearings) == found
    (own,), (named,) = (
        read_positions(flight),
        read_positions(flight, how=EstimationOptions(antenna="RA-2A")),
    )
    assert own.position is not None
    assert own.position.latitude_deg == some(named.position).latitude_deg
    (shown,) = survey.positions
    assert some(shown.position).latitude_deg == own.position.latitude_deg


def test_a_flight_with_a_whip_is_a_survey_of_strength(write_flight: WriteFlight) -> None:
    flight = write_flight(settings=flown_with("monopole"), name="with_whip")
    survey = read_survey(flight)
    assert (survey.antenna, survey.bearings) == ("monopole", ())
    assert survey.signals
    (own,), (named,) = (
        read_positions(flight),
        read_positions(flight, how=EstimationOptions(antenna="monopole")),
    )
    assert some(own.position).latitude_deg == some(named.position).latitude_deg
    with pytest.raises(UsageError, match="an upright whip, which gives no bearings"):
        read_bearings(flight)


def test_an_antenna_that_is_not_known_here_is_told_with_what_to_do(
    write_flight: WriteFlight,
) -> None:
    flight = write_flight(settings=flown_with("made-at-home"), name="made_at_home")
    for read in (read_bearings, read_positions, read_survey):
        with pytest.raises(
            UsageError, match="set up with the antenna 'made-at-home'"
        ) as caught:
            read(flight)
        assert "--antenna" in (caught.value.remedy or "")
    assert read_survey(flight, EstimationOptions(antenna="RA-23K")).antenna == "RA-23K"


def test_the_antenna_of_another_versions_settings_is_read(flight: Path) -> None:
    read = read_flight(flight)
    tables = json.loads(some(read.settings_json)) | {"of_next_year": {"a": "b"}}
    tables["detection"]["operating_mode"] = "of next year"
    later = replace(read, settings_json=json.dumps(tables))
    settings = flight_settings(later)
    assert flight_antenna(later) == "RA-2A"
    assert some(settings).detection == Settings().detection
    assert flight_antenna(replace(read, settings_json=None)) == "RA-23K"
