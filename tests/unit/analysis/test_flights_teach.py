"""Flights of one drone teach each other its antenna; logs of all kinds go together."""

import math
from collections.abc import Sequence
from pathlib import Path

import made
import numpy as np
import pytest
from archived import flight_task
from file_bearings import read_bearings
from some import some
from sql import sql
from tests.unit.analysis.test_tags_of_several_logs import FIRST, as_log, pings
from turned import Way, turns

from uavrt.analysis.estimates.positions import read_positions
from uavrt.config.settings import Settings
from uavrt.core.clock import flight_stamp
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import PulsePose
from uavrt.flight.flight_order import note_flight
from uavrt.flight.reading.flight_reader import read_flight
from uavrt.flight.reading.noted_places import vehicle_note
from uavrt.ground.store.estimates import AntennaChoice, Estimator
from uavrt.ground.store.stored_flights import FlightLibrary
from uavrt.localization.angles import difference_deg
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.estimates.flight_estimates import (
    EstimationOptions,
    Found,
    TagBearing,
    place,
)

PLANE = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
START_NS = 1_700_000_000 * 10**9
HOUR_NS = 3600 * 10**9
TAG = (40.0, 60.0)
AROUND = [(300.0 * math.sin(a), 300.0 * math.cos(a)) for a in np.arange(6) * math.pi / 3.0]
TABLE = PATTERNS["RA-23K"]
ANGLES = np.linspace(0.0, 180.0, len(TABLE.e_plane_db))
BACK_DB = np.array(TABLE.e_plane_db) - 7.0 / (1.0 + np.exp(-(ANGLES - 100.0) / 12.0))
"""The real antenna's: 7 dB weaker behind than the table's."""


def flown(number: int, stations: Sequence[tuple[float, float]]) -> tuple[Way, list[PulsePose]]:
    """A flight with a turn at each station, and its pulses."""
    rng = np.random.default_rng([3, number])
    way = turns(stations, wait_s=40.0, plane=PLANE, start_ns=START_NS + number * HOUR_NS)
    pulses = []
    for time in np.arange(0.4, way.end_s, 1.25):
        off_deg = abs(difference_deg(way.seen(time, TAG)[0], 0.0))
        snr_db = 25.0 + float(np.interp(off_deg, ANGLES, BACK_DB)) + rng.normal(0.0, 1.2)
        pose = way.pose(time)
        pulses.append(way.pulse(time, snr_db, pose, frequency_hz=148e6, noise_psd=1e-10))
    return way, pulses


def as_flight(
    folder: Path, number: int, vehicle: int | None = None, *, clock_ns: int | None = None
) -> Path:
    """A flight directory with two turns; the flights were flown in order of their numbers.

    With `clock_ns` the computer's clock was wrong: that is when it believes to have begun.
    """
    way, pulses = flown(number, AROUND[2 * number % 6 : 2 * number % 6 + 2])
    start_ns = way.start_ns if clock_ns is None else clock_ns
    stamp = f"2026-05-01_0{number}-00-00" if clock_ns is None else flight_stamp(clock_ns)
    info = made.flight_info(
        folder / f"flight_log_{stamp}",
        (made.tag(2, 148e6, 1.25),),
        start_time_ns=start_ns,
        center_frequency_hz=148e6,
    )
    flight = made.flight(info, Settings(), poses=way.poses(), pulse_poses=pulses)
    if vehicle is not None:
        note = (START_NS, vehicle_note(vehicle))
        sql(flight, "INSERT INTO notes VALUES (?, ?)", values=note)
    return flight


def widths(found: Sequence[TagBearing]) -> list[float]:
    arcs = [one.bearing.interval90_deg for one in found]
    return [(arc[1] - arc[0]) % 360.0 for arc in arcs if arc is not None]


def clear(found: Sequence[TagBearing], turns: int) -> bool:
    """Whether all turns have arcs of a few degrees, without a word of a reflection."""
    flagged = any(one.bearing.multipath_suspected for one in found)
    return len(found) == turns and not flagged and max(widths(found)) < 10.0


def test_three_logs_of_two_turns_teach_each_other_a_weaker_back(tmp_path: Path) -> None:
    logs = [
        as_log(tmp_path / f"{n}.jsonl", flown(n, AROUND[2 * n : 2 * n + 2])[1])
        for n in range(3)
    ]
    told: list[str] = []
    found = read_bearings(*logs, warn=told.append)
    assert not clear(read_bearings(logs[0]), 2)  # two turns alone teach nothing
    assert clear(found, 6)
    assert told == ["the antenna's pattern was corrected by 6 turns of 3 flights"]
    position = some(read_positions(*logs, warn=told.append)[0].position)
    off_m = math.dist(PLANE.to_local(position.latitude_deg, position.longitude_deg), TAG)
    assert off_m < min(15.0, some(position.radius95_m))
    assert told[-1] == told[0]


def test_each_flight_has_its_own_gain_whatever_its_vehicles_number_is(tmp_path: Path) -> None:
    def radius_m(*vehicles: int) -> float:
        folder = tmp_path / f"{vehicles}"
        flights = [as_flight(folder, n, vehicle) for n, vehicle in enumerate(vehicles)]
        (one,) = read_positions(*flights)
        (same,) = place([Found(bearings=read_bearings(*flights))])
        own = some(one.position)
        joined[vehicles] = own.latitude_deg == some(same.position).latitude_deg
        return some(own.radius95_m)

    joined: dict[tuple[int, ...], bool] = {}
    assert radius_m(1, 1) == radius_m(1, 7)
    assert joined == {(1, 1): False, (1, 7): False}


def test_past_flights_of_the_same_drone_teach_a_flight_of_two_turns(tmp_path: Path) -> None:
    flights = [as_flight(tmp_path, number, 1) for number in range(3)]
    told: list[str] = []
    assert clear(read_bearings(flights[2], warn=told.append), 2)
    assert told == ["the antenna's pattern was corrected by 6 turns of 3 flights"]
    # A flight is not taught by those after it, nor by another drone's.
    assert not clear(read_bearings(flights[0], warn=told.append), 2)
    other = as_flight(tmp_path, 4, 7)
    assert not clear(read_bearings(other, warn=told.append), 2)
    assert len(told) == 1


def test_which_flights_are_past_is_told_by_what_was_noted_and_not_by_a_clock_of_1970(
    tmp_path: Path,
) -> None:
    clocks = (None, None, 300 * 10**9, None)
    flights = [as_flight(tmp_path, n, 1, clock_ns=clock) for n, clock in enumerate(clocks)]
    for flight in flights:
        note_flight(flight)
    told: list[str] = []
    assert clear(read_bearings(flights[2], warn=told.append), 2)
    assert told == ["the antenna's pattern was corrected by 6 turns of 3 flights"]
    # The first was flown before the one of 1970, and is not taught by it.
    assert not clear(read_bearings(flights[0], warn=told.append), 2)
    assert len(told) == 1


def test_batch_and_page_are_taught_by_past_flights_as_the_command_line_is(
    tmp_path: Path,
) -> None:
    *_, last = [as_flight(tmp_path, number, 1) for number in range(3)]
    told = [one.bearing.interval90_deg for one in read_bearings(last)]
    result = flight_task(last, "bearing").work(lambda: False, lambda _done: None)
    assert [
        (one.interval90_from_deg, one.interval90_to_deg) for one in some(result).bearings
    ] == told
    estimator, antenna = Estimator(), AntennaChoice()
    columns, listed = FlightLibrary(tmp_path).columns(last.name), read_flight(last).info.tags
    page = estimator.estimate(
        columns, antenna, (), listed, past=estimator.past(last, antenna)
    ).bearings
    for one, arc in zip(page, told, strict=True):
        assert not one["multipath_suspected"]
        assert one["interval90_deg"] == [*some(arc)]
    alone = Estimator().estimate(columns, antenna, (), listed).bearings
    assert [one["interval90_deg"] for one in alone] != [one["interval90_deg"] for one in page]


@pytest.mark.parametrize("method", ["bayes", "mle"])
def test_every_tag_of_a_mixed_set_has_a_position_or_a_reason(
    tmp_path: Path, method: str
) -> None:
    turned = as_log(tmp_path / "turned.jsonl", flown(0, AROUND)[1])
    survey = pings(tmp_path / "pings.csv", 172_464_000.0, FIRST)
    how, told = EstimationOptions(method=method, height_m=40.0), list[str]()
    found = read_positions(turned, survey, how=how, warn=told.append)
    assert [one.tag_id for one in found] == [1, 2]
    assert some(found[1].position).stations == 6
    if method == "bayes":
        assert some(found[0].position).pulses > 100
    else:
        assert "needs bearings" in some(found[0].reason)
    assert any("each kind has its own positions" in text for text in told)


def test_a_tag_that_was_heard_in_no_turn_has_a_reason(tmp_path: Path) -> None:
    line = Way(np.array([(0.0, 0.0, 0.0, 90.0), (38.0, 270.0, 0.0, 90.0)]), plane=PLANE)
    pulses = [
        line.pulse(time, 20.0, line.pose(time), frequency_hz=148e6, noise_psd=1e-10)
        for time in np.arange(0.4, line.end_s, 1.25)
    ]
    (found,) = read_positions(as_log(tmp_path / "line.jsonl", pulses))
    assert found.position is None
    assert some(found.reason).startswith("it was detected, but not in a turn in place")
