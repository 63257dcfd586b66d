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
from tests.unit.analysis.test_tags_of_several_logs import as_log

from uavrt.analysis.estimates.positions import read_positions
from uavrt.config.settings import Settings
from uavrt.core.clock import flight_stamp
from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.messages import Pose, PulsePose
from uavrt.flight.flight_order import note_flight
from uavrt.flight.flight_recorder import FlightRecorder
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
TURN_S, WAY_S = 60.0, 40.0
AROUND = [(300.0 * math.sin(a), 300.0 * math.cos(a)) for a in np.arange(6) * math.pi / 3.0]
TABLE = PATTERNS["RA-23K"]
ANGLES = np.linspace(0.0, 180.0, len(TABLE.e_plane_db))
BACK_DB = np.array(TABLE.e_plane_db) - 7.0 / (1.0 + np.exp(-(ANGLES - 100.0) / 12.0))
"""The real antenna's: 7 dB weaker behind than the table's."""


def pose(time_ns: int, east: float, north: float, yaw_deg: float) -> Pose:
    latitude, longitude = PLANE.to_geodetic(east, north)
    return made.pose(time_ns, latitude, longitude, altitude_amsl_m=540.0, yaw_deg=yaw_deg)


def flown(
    number: int, stations: Sequence[tuple[float, float]], seed: int = 3
) -> tuple[list[Pose], list[PulsePose]]:
    """Poses and pulses of a flight with a turn at each station."""
    rng = np.random.default_rng([seed, number])
    times, east, north, yaw = [0.0], [stations[0][0]], [stations[0][1]], [10.0]
    for station in stations:
        for took, turned in ((WAY_S, 0.0), (TURN_S, 360.0), (5.0, 0.0)):
            times.append(times[-1] + took)
            east.append(station[0])
            north.append(station[1])
            yaw.append(yaw[-1] + turned)

    def at(time_s: float) -> tuple[float, float, float]:
        e, n, y = (float(np.interp(time_s, times, one)) for one in (east, north, yaw))
        return e, n, y

    start_ns = START_NS + number * HOUR_NS
    poses = [pose(start_ns + round(t * 1e9), *at(t)) for t in np.arange(0.0, times[-1], 0.25)]
    pulses = []
    for count, time in enumerate(np.arange(0.4, times[-1], 1.25)):
        e, n, y = at(time)
        off = difference_deg(math.degrees(math.atan2(TAG[0] - e, TAG[1] - n)), y)
        snr = 25.0 + float(np.interp(abs(off), ANGLES, BACK_DB)) + float(rng.normal(0.0, 1.2))
        time_ns = start_ns + round(time * 1e9)
        heard = made.pulse(
            time_ns, frequency_hz=148e6, snr_db=snr, group_sequence=count, noise_psd=1e-10
        )
        pulses.append(PulsePose(pulse=heard, pose=pose(time_ns, e, n, y)))
    return poses, pulses


def as_flight(
    folder: Path, number: int, vehicle: int | None = None, *, clock_ns: int | None = None
) -> Path:
    """A flight directory with two turns; the flights were flown in order of their numbers.

    With `clock_ns` the computer's clock was wrong: that is when it believes to have begun.
    """
    poses, pulses = flown(number, AROUND[2 * number % 6 : 2 * number % 6 + 2])
    start_ns = START_NS + number * HOUR_NS if clock_ns is None else clock_ns
    stamp = f"2026-05-01_0{number}-00-00" if clock_ns is None else flight_stamp(clock_ns)
    directory = folder / f"flight_log_{stamp}"
    tag = made.tag(2, 148e6, 1.25)
    recorder = FlightRecorder.create(
        made.flight_info(directory, (tag,), start_time_ns=start_ns, center_frequency_hz=148e6),
        Settings(),
    )
    recorder.write(*poses)
    recorder.write_pulses(pulses)
    if vehicle is not None:
        recorder.write_note(vehicle_note(vehicle), START_NS)
    recorder.close()
    return directory


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
    (position,) = read_positions(*logs, warn=told.append)
    assert position.position is not None
    off = PLANE.to_local(position.position.latitude_deg, position.position.longitude_deg)
    assert math.dist(off, TAG) < min(15.0, some(position.position.radius95_m))
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


def as_pings(path: Path) -> Path:
    """A survey of UCSD's tracker, with a whip."""
    lines = ["Run,Timestamp,Frequency,Amplitude,Easting,Northing,Altitude,Heading,EPSG Code"]
    time_s = 1.7e9
    for line, east in enumerate(range(0, 301, 50)):
        for north in range(0, 301, 9)[:: 1 if line % 2 == 0 else -1]:
            level = -60.0 - 25.0 * math.log10(
                math.dist((east, north, 40.0), (150.0, 120.0, 0.0))
            )
            place = f"{462300 + east},{5249900 + north}"
            lines.append(f"1,{time_s:.1f},172464000,{level:.2f},{place},540.0,0,32632")
            time_s += 1.5
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize("method", ["bayes", "mle"])
def test_every_tag_of_a_mixed_set_has_a_position_or_a_reason(
    tmp_path: Path, method: str
) -> None:
    turned = as_log(tmp_path / "turned.jsonl", flown(0, AROUND)[1])
    pings = as_pings(tmp_path / "pings.csv")
    told: list[str] = []
    found = read_positions(
        turned, pings, how=EstimationOptions(method=method, height_m=40.0), warn=told.append
    )
    assert [one.tag_id for one in found] == [1, 2]
    assert some(found[1].position).stations == 6
    if method == "bayes":
        assert some(found[0].position).pulses > 100
    else:
        assert "needs bearings" in some(found[0].reason)
    assert any("each kind has its own positions" in text for text in told)


def test_a_tag_that_was_heard_in_no_turn_has_a_reason(tmp_path: Path) -> None:
    _, pulses = flown(0, AROUND)
    way_only = [one for one in pulses if one.pulse.start_time_ns < START_NS + 38 * 10**9]
    (found,) = read_positions(as_log(tmp_path / "way.jsonl", [*way_only]))
    assert found.position is None or found.position.stations
    moved = [
        PulsePose(pulse=one.pulse, pose=pose(one.pulse.start_time_ns, 9.0 * number, 0.0, 90.0))
        for number, one in enumerate(way_only)
    ]
    (found,) = read_positions(as_log(tmp_path / "line.jsonl", moved))
    assert found.position is None
    assert some(found.reason).startswith("it was detected, but not in a turn in place")
