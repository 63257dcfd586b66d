"""Bearings noted by hand beside turns, surveys by strength, and copies of themselves."""

import shutil
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from some import some
from tests.unit.analysis.test_bearings import STATIONS, flown, true_bearing
from tests.unit.analysis.test_noted_bearings import from_there, miss_m, noted
from tests.unit.analysis.test_tags_of_several_logs import as_log, pings

from uavrt.analysis.estimates.positions import read_positions
from uavrt.analysis.survey import read_survey
from uavrt.core.clock import iso_utc
from uavrt.core.messages import PulsePose
from uavrt.localization.estimates.flight_estimates import EstimationOptions

OFF_THE_TURNS = ((-250.0, 0.0), (0.0, 0.0), (400.0, 300.0))
LEFT_OUT = "from turns in these flights and are not counted twice"


def by_hand(path: Path, sigma: str = "3") -> Path:
    rows = [(*place, from_there(*place), "", sigma) for place in OFF_THE_TURNS]
    return noted(path, *rows)


def still(pulses: Sequence[PulsePose]) -> list[PulsePose]:
    """The pulses as a receiver that stays where it began has them."""
    first = some(pulses[0].pose)
    times_ns = [some(one.pose).time_ns for one in pulses]
    return [
        replace(one, pose=replace(first, time_ns=time_ns))
        for one, time_ns in zip(pulses, times_ns, strict=True)
    ]


@pytest.mark.parametrize(("off_deg", "kept"), [(0.0, 0), (10.0, 0), (60.0, 3), (-120.0, 3)])
def test_a_noted_bearing_that_contradicts_the_turn_in_its_place_is_no_copy(
    tmp_path: Path, off_deg: float, kept: int
) -> None:
    log = as_log(tmp_path / "flight.jsonl", flown(threshold_db=-20.0).pulse_poses)
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


def test_a_file_of_bearings_given_twice_counts_once(tmp_path: Path) -> None:
    table = by_hand(tmp_path / "noted.csv")
    (alone,) = read_positions(table)
    shutil.copy(table, copy := tmp_path / "copy.csv")
    for paths in ((table, table), (table, copy)):
        said: list[str] = []
        (found,) = read_positions(*paths, warn=said.append)
        assert some(found.position).stations == 3
        assert some(found.position).radius95_m == some(alone.position).radius95_m
        assert (
            f"3 bearings of {paths[1]} are also in another file and are not counted twice"
            in said
        )


def test_a_survey_by_strength_and_noted_bearings_have_each_their_own_position(
    tmp_path: Path,
) -> None:
    survey = pings(tmp_path / "pings.csv", 148_000_000.0, (150.0, 120.0))
    table = by_hand(tmp_path / "noted.csv")
    said: list[str] = []
    found = read_positions(
        survey, table, how=EstimationOptions(height_m=40.0), warn=said.append
    )
    assert sorted(some(one.position).stations for one in found) == [0, 3]
    assert any("each kind has its own" in text for text in said)


def test_a_method_for_bearings_places_what_was_noted_beside_a_survey(tmp_path: Path) -> None:
    survey = pings(tmp_path / "pings.csv", 148_000_000.0, (150.0, 120.0))
    found = read_positions(
        survey, by_hand(tmp_path / "noted.csv"), how=EstimationOptions(method="mle")
    )
    reasons = [one.reason for one in found if one.position is None]
    (placed,) = [one.position for one in found if one.position is not None]
    assert miss_m(placed) < 20.0
    assert any("mle needs bearings" in some(reason) for reason in reasons)


def test_a_mast_among_bearings_without_strengths_is_left_out_with_that_reason(
    tmp_path: Path,
) -> None:
    mast = as_log(tmp_path / "mast.jsonl", still(flown(threshold_db=-20.0).pulse_poses))
    (found,) = read_positions(mast, by_hand(tmp_path / "noted.csv"))
    (listener,) = some(found.position).listeners
    assert listener.endswith("not used: no bearing has a signal strength")
