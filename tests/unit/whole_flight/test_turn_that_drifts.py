"""A drone that the wind carries off while it turns: the tag is found, and its region holds."""

import math
from dataclasses import dataclass, replace
from pathlib import Path

import made
import numpy as np
import pytest
from depth import share
from tests.unit.whole_flight.conftest import WINDOW_HZ, flight_info, judged

from uavrt.analysis.whole_flights.judged_flights import IntegratedTag
from uavrt.flight.reading.flight_reader import Flight
from uavrt.localization.angles import difference_deg
from uavrt_experiments.integrate.flights import (
    PLANE,
    Course,
    World,
    add_pulses,
    silence,
    turning,
)

TURN_S = 60.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Told:
    """What a turn says of a tag that is there."""

    one: IntegratedTag
    held: bool
    """Whether the region of 90 % holds it."""
    off_deg: float


def carried(rng: np.random.Generator, speed_m_s: float, away_m: float) -> Course:
    """One turn in gusts, carried off evenly; the tag lies at a distance from its middle."""
    still = turning(round(TURN_S / 1.254))
    time_s, wind = still.time_s, rng.uniform(0.0, 2.0 * math.pi)
    gone_m = speed_m_s * (time_s - time_s.mean())
    gusts_deg = 12.0 * np.sin(2.0 * math.pi * (time_s / 17.0 + rng.random()))
    bearing = rng.uniform(0.0, 2.0 * math.pi)
    return replace(
        still,
        east_m=gone_m * math.sin(wind),
        north_m=gone_m * math.cos(wind),
        yaw_deg=still.yaw_deg + rng.uniform(0.0, 360.0) + gusts_deg,
        tag_at=lambda _: (away_m * math.sin(bearing), away_m * math.cos(bearing)),
    )


def still(course: Course) -> Course:
    """The same turn in the middle of its way."""
    middle = np.ones_like(course.east_m)
    return replace(
        course, east_m=course.east_m.mean() * middle, north_m=course.north_m.mean() * middle
    )


def flight_of(course: Course, world: World) -> Flight:
    """The flight with the poses of a course."""
    flown = course.poses
    poses = (
        made.pose(
            time_ns,
            latitude,
            longitude,
            altitude_relative_m=50.0,
            altitude_amsl_m=2050.0,
            quaternion_wxyz=tuple(turned),
        )
        for time_ns, latitude, longitude, turned in zip(
            flown.time_ns.tolist(),
            flown.latitude_deg,
            flown.longitude_deg,
            flown.quaternion_wxyz.tolist(),
            strict=True,
        )
    )
    return made.recorded_flight(flight_info("a turn", world.tag), poses)


def turned(
    seed: int, path: Path, speed_m_s: float, enr_db: float, *, in_one_place: bool = False
) -> Told:
    rng = np.random.default_rng((31, seed))
    course = carried(rng, speed_m_s, 200.0 + 50.0 * seed)
    world = World(course=course, window_hz=WINDOW_HZ, spread_s=0.04)
    truth, samples = world.truth(rng), silence(rng, course)
    add_pulses(rng, samples, world.pulses(rng, truth, enr_db))
    file = path / f"{seed}.cf32"
    samples.tofile(file)
    flight = flight_of(still(course) if in_one_place else course, world)
    one = judged(flight, world.tag, file, frequency_window_hz=WINDOW_HZ)
    if one.place is None:
        return Told(one=one, held=False, off_deg=math.nan)
    latitude, longitude = PLANE.to_geodetic(truth.east_m, truth.north_m)
    east, north = one.places.plane.to_local([float(latitude)], [float(longitude)])
    bearing = math.degrees(math.atan2(truth.east_m, truth.north_m))
    return Told(
        one=one,
        held=one.place.cells.holds(float(east[0]), float(north[0]), 0.9),
        off_deg=abs(float(difference_deg(one.place.bearing_deg, bearing))),
    )


@pytest.mark.parametrize("speed_m_s", share([1.0, 0.5], 2))
def test_a_turn_carried_off_by_the_wind_finds_and_places_its_tag(
    tmp_path: Path, speed_m_s: float
) -> None:
    told = [turned(seed, tmp_path, speed_m_s, 14.0) for seed in range(4)]
    assert all(one.one.found for one in told)
    assert sum(one.held for one in told) >= 3
    assert float(np.median([one.off_deg for one in told])) < 4.0


def test_where_the_drone_was_at_each_pulse_counts(tmp_path: Path) -> None:
    """At 4 m/s, 200 m from the tag: taken as turning in one place it is 19° off."""
    assert turned(0, tmp_path, 4.0, 20.0).off_deg < 4.0
    assert turned(0, tmp_path, 4.0, 20.0, in_one_place=True).off_deg > 10.0
