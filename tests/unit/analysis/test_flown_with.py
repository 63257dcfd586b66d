"""What a flight was flown with, and what it is trusted to, is what everything reckons with."""

import csv
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from depth import share
from file_bearings import read_bearings
from some import some
from tests.unit.analysis.conftest import WriteFlight

from uavrt.analysis.estimates.positions import read_positions
from uavrt.analysis.inputs.flown_with import flight_antenna, flight_settings
from uavrt.analysis.survey import read_survey
from uavrt.cli.options.placing_options import Placing
from uavrt.cli.results.export import export
from uavrt.cli.results.localize import localize
from uavrt.cli.results.report import report
from uavrt.config.settings import Settings
from uavrt.core.errors import UsageError
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.localization.estimates.flight_estimates import EstimationOptions, TagBearing


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
    (shown,) = survey.positions
    places = (some(one.position).latitude_deg for one in (own, named, shown))
    assert len(set(places)) == 1


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


PRIORS: dict[str, dict[str, Any]] = {
    "RA-23K": {"heading_error": 0.0},
    "monopole": {"height_error": 40.0},
}


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("antenna", share([*PRIORS], 2))
def test_report_and_export_trust_the_flight_as_localize_does(
    antenna: str, write_flight: WriteFlight, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    flight, priors = write_flight(tags=2, heard=1), PRIORS[antenna]
    localize(flight, place=Placing(antenna=antenna), as_json=True)
    (usual,) = json.loads(capsys.readouterr().out)
    localize(flight, place=Placing(antenna=antenna, **priors), as_json=True)
    (told,) = json.loads(capsys.readouterr().out)
    assert told["radius95_m"] != pytest.approx(usual["radius95_m"], abs=0.5)

    export(flight, place=Placing(antenna=antenna, **priors), formats=["csv"], output=tmp_path)
    with (tmp_path / "fixes.csv").open(encoding="utf-8") as file:
        fix = next(csv.DictReader(file))
    assert float(fix["radius95_m"]) == pytest.approx(told["radius95_m"], abs=0.01)

    report(flight, place=Placing(antenna=antenna, **priors), pdf=False, output=tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8").replace("\u00a0", " ")
    assert f"{told['radius95_m']:.0f} m (95 %)" in page
