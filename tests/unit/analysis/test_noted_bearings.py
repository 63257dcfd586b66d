"""Bearings that a person has noted go into a position beside those of flights."""

import math
from pathlib import Path

import pytest
from file_bearings import read_bearings
from some import some
from tests.unit.analysis.test_bearings import (
    PLANE,
    START_NS,
    STATIONS,
    TAG,
    flown,
    true_bearing,
)
from tests.unit.analysis.test_tags_of_several_logs import as_log

from uavrt.analysis.estimates.positions import read_positions
from uavrt.analysis.survey import read_survey
from uavrt.core.clock import iso_utc
from uavrt.core.errors import FormatError
from uavrt.localization.results import Position

HEADING = "latitude_deg;longitude_deg;tag_id;bearing_deg;time_utc;sigma_deg;who\n"


def noted(path: Path, *rows: tuple[float, float, float, str, str]) -> Path:
    """Write bearings as a spreadsheet does, of places in metres."""
    lines = []
    for east, north, bearing, time, sigma in rows:
        latitude, longitude = PLANE.to_geodetic(east, north)
        lines.append(f"{latitude};{longitude};2;{bearing};{time};{sigma};Ada\n")
    path.write_text(HEADING + "".join(lines), encoding="utf-8")
    return path


def miss_m(found: Position) -> float:
    east, north = PLANE.to_local(found.latitude_deg, found.longitude_deg)
    return math.hypot(float(east) - TAG[0], float(north) - TAG[1])


def from_there(east: float, north: float) -> float:
    return math.degrees(math.atan2(TAG[0] - east, TAG[1] - north))


@pytest.fixture(scope="module")
def one_turn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A flight that turned once, which gives a direction and hardly a distance."""
    directory = tmp_path_factory.mktemp("flight")
    pulses = flown(threshold_db=-20.0).pulse_poses
    whole = as_log(directory / "whole.jsonl", pulses)
    end_ns = read_bearings(whole)[0].end_time_ns
    return as_log(
        directory / "flight.jsonl", [one for one in pulses if one.pulse.start_time_ns <= end_ns]
    )


@pytest.mark.parametrize("sigma", ["4", ""])
@pytest.mark.parametrize("time", [iso_utc(START_NS + 60 * 10**9), ""])
def test_a_bearing_noted_by_hand_makes_a_flights_place_sharp(
    one_turn: Path, tmp_path: Path, time: str, sigma: str
) -> None:
    (alone,) = read_positions(one_turn)
    table = noted(tmp_path / "noted.csv", (600.0, 400.0, from_there(600.0, 400.0), time, sigma))
    said: list[str] = []
    (found,) = read_positions(one_turn, table, warn=said.append)
    position = some(found.position)
    assert position.stations == 2
    assert some(position.radius95_m) < 0.5 * some(some(alone.position).radius95_m)
    assert miss_m(position) < some(position.radius95_m)
    assert not any("clock" in text for text in said)


def test_a_bearing_that_knows_nothing_changes_nothing(tmp_path: Path) -> None:
    """Densities and levels of the flight's own bearings count as before."""
    log = as_log(tmp_path / "flight.jsonl", flown(threshold_db=-20.0).pulse_poses)
    alone = some(read_positions(log)[0].position)
    table = noted(tmp_path / "noted.csv", (0.0, 200.0, 200.0, "", "10000"))
    found = some(read_positions(log, table)[0].position)
    assert found.stations == 4
    assert some(found.radius95_m) == pytest.approx(some(alone.radius95_m), rel=0.25)
    assert abs(miss_m(found) - miss_m(alone)) < 5.0


def test_bearings_of_a_file_that_came_of_the_flight_count_once(tmp_path: Path) -> None:
    log = as_log(tmp_path / "flight.jsonl", flown(threshold_db=-20.0).pulse_poses)
    alone = some(read_positions(log)[0].position)
    rows = [
        (*STATIONS[number], true_bearing(number), iso_utc(one.middle_time_ns), "3")
        for number, one in enumerate(read_survey(log).bearings)
    ]
    said: list[str] = []
    (found,) = read_positions(log, noted(tmp_path / "noted.csv", *rows), warn=said.append)
    assert some(found.position).radius95_m == alone.radius95_m
    assert (
        "3 bearings of a file come from turns in these flights and are not counted twice"
        in said
    )


@pytest.mark.parametrize("year", ["1970-01-01T00:20:00Z", "2022-11-14T22:14:20Z"])
def test_a_watch_that_is_off_is_named(one_turn: Path, tmp_path: Path, year: str) -> None:
    table = noted(tmp_path / "noted.csv", (600.0, 400.0, from_there(600.0, 400.0), year, "4"))
    said: list[str] = []
    read_positions(one_turn, table, warn=said.append)
    assert any("noted.csv" in text and "clock" in text for text in said)


def test_noted_bearings_alone_give_a_place_and_a_bad_line_is_named(tmp_path: Path) -> None:
    places = ((-250.0, 0.0), (0.0, 0.0), (400.0, 300.0))
    rows = [(*place, from_there(*place), "", "3") for place in places]
    (found,) = read_positions(noted(tmp_path / "noted.csv", *rows))
    assert miss_m(some(found.position)) < 20.0
    (tmp_path / "bad.csv").write_text(HEADING + "35;-111;2;north;;;\n", encoding="utf-8")
    with pytest.raises(FormatError, match="line 2"):
        read_positions(tmp_path / "bad.csv")
