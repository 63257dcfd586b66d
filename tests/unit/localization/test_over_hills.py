"""Hills weaken what is heard and explain silence, in positions and in beliefs."""

import math
from dataclasses import replace

import numpy as np
import pytest
from depth import seeds
from numpy.typing import NDArray
from some import some

from uavrt.core.errors import UsageError
from uavrt.localization.estimates.heard import FlightGround, PoseColumns
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.level_belief import Listening
from uavrt.localization.position.trackers import ParticleTracker, TagPrior
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt_experiments.coverage.shadow import CASES, fly, surveyed
from uavrt_experiments.search.terrain import PLANE, elevation_of

_Floats = NDArray[np.float64]
AREA = Area(west_m=-500.0, east_m=500.0, south_m=-500.0, north_m=500.0)


def ridge(east_m: _Floats, north_m: _Floats) -> _Floats:
    """60 m high, 100 m east of the take-off, from south to north."""
    return np.asarray(400.0 + 60.0 * np.exp(-(((east_m - 100.0) / 50.0) ** 2)) + 0.0 * north_m)


def hills() -> HillLosses:
    return HillLosses(
        elevation_of(ridge), latitude_deg=PLANE.latitude_deg, longitude_deg=PLANE.longitude_deg
    )


def silent_flight() -> list[Listening]:
    """Along the ridge, 100 m west of its top and lower than it: nothing is heard."""
    return [
        Listening(east_m=0.0, north_m=float(north), height_m=35.0, snr_db=None)
        for north in np.arange(-400.0, 401.0, 20.0)
    ]


def test_silence_speaks_no_longer_against_a_tag_behind_the_ridge() -> None:
    held = {}
    for ground in (None, hills()):
        prior = TagPrior(
            area=AREA,
            level_db=42.0,
            level_sigma_db=3.0,
            exponent=2.5,
            exponent_sigma=0.0,
            motion=(1.0, 0.0, 0.0),
            hills=ground,
        )
        tracker = ParticleTracker(prior, np.random.default_rng(3), particles=10_000)
        for heard in silent_flight():
            tracker.listen(heard)
        share = np.mean(tracker.hypotheses(4000).east_m > 140.0)
        held[ground is not None] = float(share)
    # East of 140 m lies .36 of the area; to the west the drone flew past at 0 to 500 m.
    assert held[False] < 0.55
    assert held[True] > held[False] + 0.25


def test_a_ridge_that_takes_twice_what_its_map_says_does_not_move_the_tag() -> None:
    """As an error of each pulse by itself it left particles 400 m off."""
    ground, rng = hills(), np.random.default_rng(4)
    tag_east, tag_north = 350.0, 80.0
    prior = TagPrior(
        area=AREA,
        level_db=60.0,
        level_sigma_db=3.0,
        exponent=2.5,
        exponent_sigma=0.0,
        fading_db=4.0,
        motion=(1.0, 0.0, 0.0),
        hills=ground,
    )
    tracker = ParticleTracker(prior, np.random.default_rng(3), particles=4000)
    lost = []
    for north in np.arange(-400.0, 401.0, 8.0):
        east = -60.0
        place = np.array([tag_east]), np.array([tag_north])
        lost.append(float(ground.loss_db((east, float(north), 35.5), *place)[0]))
        slant = np.sqrt((east - tag_east) ** 2 + (north - tag_north) ** 2 + 35.0**2)
        level = 60.0 - 25.0 * np.log10(slant / 100.0) - 2.0 * lost[-1] + rng.normal(0.0, 4.0)
        tracker.listen(
            Listening(east_m=east, north_m=float(north), height_m=35.0, snr_db=float(level))
        )
    assert np.mean(lost) > 15.0
    found = tracker.estimate()
    miss = np.hypot(found.east_m - tag_east, found.north_m - tag_north)
    assert miss < found.radius95_m


def test_positions_over_hills_are_nearer_and_their_circles_hold() -> None:
    rng = np.random.default_rng(11)
    flights = [fly(rng, replace(CASES[1], map_error_m=1.0)) for _ in seeds(3, 5)]
    without, mapped = (np.median([one[which].miss_m for one in flights]) for which in (0, 1))
    assert mapped < without
    # Of .95; fewer once in 140, or 800.
    assert sum(one[1].held for one in flights) > 0.5 * len(flights)
    assert sum(one[1].held for one in flights) >= sum(one[0].held for one in flights)


def test_levels_of_rotations_are_compared_by_what_the_ridge_takes() -> None:
    """Two bearings cross flatly beyond the ridge; levels tell how far, were it not for it."""
    east, north = np.array([-300.0, -200.0, 300.0]), np.array([0.0, 0.0, -60.0])
    tag = (220.0, 10.0)
    ground = hills().in_plane(PLANE)
    up_m = np.full(3, 45.0)
    lost = ground.seen_from(east, north, up_m)(np.array([tag[0]]), np.array([tag[1]]))[0]
    slant = np.sqrt((east - tag[0]) ** 2 + (north - tag[1]) ** 2 + 45.0**2)
    bearing = np.degrees(np.arctan2(tag[0] - east, tag[1] - north)) % 360.0
    latitude, longitude = PLANE.to_geodetic(east, north)
    stations = Stations(
        latitude_deg=latitude,
        longitude_deg=longitude,
        bearing_deg=bearing,
        sigma_deg=np.full(3, 12.0),
        level_db=40.0 - 25.0 * np.log10(slant / 100.0) - lost,
        level_sigma_db=np.full(3, 0.5),
        height_m=up_m,
    )
    miss = []
    for known in (None, hills()):
        found = estimate_position(stations, hills=known)
        at = PLANE.to_local(found.latitude_deg, found.longitude_deg)
        miss.append(float(np.hypot(float(at[0]) - tag[0], float(at[1]) - tag[1])))
    assert lost.max() > 15.0
    assert miss[1] < 0.7 * miss[0]


def test_ground_that_the_files_do_not_know_is_told_and_changes_no_position() -> None:
    rng = np.random.default_rng(12)
    track = some(surveyed(rng, CASES[0], ridge, (-50.0, 40.0)))
    elsewhere = HillLosses(elevation_of(ridge), latitude_deg=10.0, longitude_deg=10.0)
    level, told = (estimate_position(None, track, hills=one) for one in (None, elsewhere))
    assert (told.latitude_deg, told.radius95_m) == (level.latitude_deg, level.radius95_m)
    (caution,) = [one for one in told.cautions if one.name == "ground"]
    assert "do not cover the flight" in caution.text


def poses(height_m: float = 0.0, takeoff_amsl_m: float = math.nan) -> PoseColumns:
    count = 5
    return PoseColumns(
        time_ns=np.arange(count) * 1_000_000_000,
        latitude_deg=np.full(count, PLANE.latitude_deg),
        longitude_deg=np.full(count, PLANE.longitude_deg),
        height_m=np.asarray(height_m + 10.0 * np.arange(count), np.float64),
        quaternion_wxyz=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
        altitude_amsl_m=np.asarray(
            takeoff_amsl_m + height_m + 10.0 * np.arange(count), np.float64
        ),
    )


def test_another_datum_and_poses_that_begin_in_the_air_are_told() -> None:
    elevation = elevation_of(ridge)
    same = FlightGround.of(elevation, poses(takeoff_amsl_m=401.0))
    other = FlightGround.of(elevation, poses(takeoff_amsl_m=448.0))
    up = FlightGround.of(elevation, poses(30.0))
    assert same is not None
    assert same.hills.cautions() == ()
    assert "height datums or positions differ" in some(other).hills.cautions()[0]
    assert "begin 30 m up" in some(up).hills.cautions()[0]
    assert same.heights_m([500_000_000]) == pytest.approx([5.0])


def test_too_few_powers_are_refused_with_hills_as_without() -> None:
    track = some(surveyed(np.random.default_rng(12), CASES[0], ridge, (-50.0, 40.0)))
    none = replace(track, snr_db=np.full(len(track.snr_db), np.nan))
    with pytest.raises(UsageError, match="fewer than three"):
        estimate_position(None, none, hills=hills())
