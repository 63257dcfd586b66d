"""Bearings noted by hand: in a position, beside turns and surveys, and copies of either."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from file_bearings import read_bearings
from some import some
from tests.unit.analysis.test_bearings import (
    PLANE,
    START_NS,
    STATIONS,
    flown,
    from_there,
    off_m,
    true_bearing,
)
from tests.unit.analysis.test_tags_of_several_logs import as_log, pings

from uavrt.analysis.estimates.positions import read_positions
from uavrt.analysis.survey import read_survey
from uavrt.core.clock import iso_utc
from uavrt.core.errors import FormatError
from uavrt.core.messages import PulsePose
from uavrt.localization.estimates.flight_estimates import EstimationOptions

HEADING = "latitude_deg;longitude_deg;tag_id;bearing_deg;time_utc;sigma_deg;who\n"


def noted(path: Path, *rows: tuple[float, float, float, str, str]) -> Path:
    """Write bearings as a spreadsheet does, of places in metres."""
    lines = []
    for east, north, bearing, time, sigma in rows:
        latitude, longitude = PLANE.to_geodetic(east, north)
        lines.append(f"{latitude};{longitude};2;{bearing};{time};{sigma};Ada\n")
    path.write_text(HEADING + "".join(lines), encoding="utf-8")
    return path


OFF_THE_TURNS = ((-250.0, 0.0), (0.0, 0.0), (400.0, 300.0))
LEFT_OUT = "from turns in these flights and are not counted twice"


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """Three turns that heard every pulse."""
    return as_log(tmp_path / "flight.jsonl", flown(threshold_db=-20.0).pulse_poses)


@pytest.fixture
def by_hand(tmp_path: Path) -> Path:
    """Three noted bearings without a time."""
    rows = [(*place, from_there(*place), "", "3") for place in OFF_THE_TURNS]
    return noted(tmp_path / "noted.csv", *rows)


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
    assert off_m(position) < some(position.radius95_m)
    assert not any("clock" in text for text in said)


def test_a_bearing_that_knows_nothing_changes_nothing(log: Path, tmp_path: Path) -> None:
    """Densities and levels of the flight's own bearings count as before."""
    alone = some(read_positions(log)[0].position)
    table = noted(tmp_path / "noted.csv", (0.0, 200.0, 200.0, "", "10000"))
    found = some(read_positions(log, table)[0].position)
    assert found.stations == 4
    assert some(found.radius95_m) == pytest.approx(some(alone.radius95_m), rel=0.25)
    assert abs(off_m(found) - off_m(alone)) < 5.0


def test_bearings_of_a_file_that_came_of_the_flight_count_once(
    log: Path, tmp_path: Path
) -> None:
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


def test_noted_bearings_alone_give_a_place_and_a_bad_line_is_named(
    by_hand: Path, tmp_path: Path
) -> None:
    (found,) = read_positions(by_hand)
    assert off_m(some(found.position)) < 20.0
    (tmp_path / "bad.csv").write_text(HEADING + "35;-111;2;north;;;\n", encoding="utf-8")
    with pytest.raises(FormatError, match="line 2"):
        read_positions(tmp_path / "bad.csv")


def still(pulses: Sequence[PulsePose]) -> list[PulsePose]:
    """The pulses as a receiver that stays where it began has them."""
    first = some(pulses[0].pose)
    times_ns = [some(one.pose).time_ns for one in pulses]
    return [
        replace(one, pose=replace(first, time_ns=time_ns))
        for one, time_ns in zip(pulses, times_ns, strict=True)
    ]


@pytest.mark.parametrize(("off_deg", "kept"), [(10.0, 0), (60.0, 3), (-120.0, 3)])
def test_a_noted_bearing_that_contradicts_the_turn_in_its_place_is_no_copy(
    log: Path, tmp_path: Path, off_deg: float, kept: int
) -> None:
    rows = [
        (*STATIONS[number], true_bearing(number) + off_deg, iso_utc(one.middle_time_ns), "4")
        for number, one in enumerate(read_survey(log).bearings)
    ]
    said: list[str] = []
    (found,) = read_positions(log, noted(tmp_path / "noted.csv", *rows), warn=said.append)
    assert some(found.position).stations == 3 + kept
    assert any(LEFT_OUT in text for text in said) == (kept == 0)


def test_a_bearing_noted_where_a_turn_shows_no_direction_is_no_copy(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    flat = [
        replace(one, pulse=replace(one.pulse, snr_db=float(rng.normal(12.0, 0.5))))
        for one in flown(threshold_db=-20.0).pulse_poses
    ]
    log = as_log(tmp_path / "flight.jsonl", flat)
    turns = read_survey(log).bearings
    assert not any(one.bearing.accepted for one in turns)
    rows = [
        (*STATIONS[number], one.bearing.bearing_deg, iso_utc(one.middle_time_ns), "4")
        for number, one in enumerate(turns)
    ]
    (found,) = read_positions(log, noted(tmp_path / "noted.csv", *rows))
    assert some(found.position).stations == 3


def test_a_file_of_bearings_given_twice_counts_once(by_hand: Path, tmp_path: Path) -> None:
    (alone,) = read_positions(by_hand)
    shutil.copy(by_hand, copy := tmp_path / "copy.csv")
    for paths in ((by_hand, by_hand), (by_hand, copy)):
        said: list[str] = []
        (found,) = read_positions(*paths, warn=said.append)
        assert some(found.position).stations == 3
        assert some(found.position).radius95_m == some(alone.position).radius95_m
        assert (
            f"3 bearings of {paths[1]} are also in another file and are not counted twice"
            in said
        )


def test_a_survey_by_strength_and_noted_bearings_have_each_their_own_position(
    by_hand: Path, tmp_path: Path
) -> None:
    survey = pings(tmp_path / "pings.csv", 148_000_000.0, (150.0, 120.0))
    said: list[str] = []
    found = read_positions(
        survey, by_hand, how=EstimationOptions(height_m=40.0), warn=said.append
    )
    assert sorted(some(one.position).stations for one in found) == [0, 3]
    assert any("each kind has its own" in text for text in said)


def test_a_method_for_bearings_places_what_was_noted_beside_a_survey(
    by_hand: Path, tmp_path: Path
) -> None:
    survey = pings(tmp_path / "pings.csv", 148_000_000.0, (150.0, 120.0))
    found = read_positions(survey, by_hand, how=EstimationOptions(method="mle"))
    reasons = [one.reason for one in found if one.position is None]
    (placed,) = [one.position for one in found if one.position is not None]
    assert off_m(placed) < 20.0
    assert any("mle needs bearings" in some(reason) for reason in reasons)


def test_a_mast_among_bearings_without_strengths_is_left_out_with_that_reason(
    by_hand: Path, tmp_path: Path
) -> None:
    mast = as_log(tmp_path / "mast.jsonl", still(flown(threshold_db=-20.0).pulse_poses))
    (found,) = read_positions(mast, by_hand)
    (listener,) = some(found.position).listeners
    assert listener.endswith("not used: no bearing has a signal strength")
