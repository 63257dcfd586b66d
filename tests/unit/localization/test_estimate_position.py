"""Positions: exact where nothing errs, honest where something does."""

from typing import get_args

import numpy as np
import pytest
from numpy.random import Generator
from numpy.typing import NDArray
from some import some

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UsageError
from uavrt.localization.antenna import PATTERNS, monopole_gain_db
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.position.bayes_fix import shifted_m
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.results import Position, PositionMethod

METHODS = tuple(one for one in get_args(PositionMethod) if one != "track")
"""Those that need no times."""
PLANE = TangentPlane(latitude_deg=35.18, longitude_deg=-111.66)
LINE = (np.linspace(-250.0, 250.0, 6), np.zeros(6))
SQUARE = (np.array([-300.0, 300.0, 300.0, -300.0]), np.array([-300.0, -300.0, 300.0, 300.0]))

Floats = NDArray[np.float64]


def stations(
    places: tuple[Floats, Floats],
    tag: tuple[float, float],
    errors_deg: Floats | float = 0.0,
    sigma_deg: float | None = 3.0,
) -> Stations:
    east, north = places
    latitude, longitude = PLANE.to_geodetic(east, north)
    return Stations(
        latitude_deg=latitude,
        longitude_deg=longitude,
        bearing_deg=np.degrees(np.arctan2(tag[0] - east, tag[1] - north)) + errors_deg,
        sigma_deg=None if sigma_deg is None else np.full(len(east), sigma_deg),
    )


def miss_m(found: Position, tag: tuple[float, float]) -> float:
    east, north = PLANE.to_local(found.latitude_deg, found.longitude_deg)
    return float(np.hypot(east - tag[0], north - tag[1]))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("tag", [(0.0, 400.0), (-120.0, 250.0), (310.0, -500.0)])
def test_bearings_without_error_meet_at_the_tag(
    method: PositionMethod, tag: tuple[float, float]
) -> None:
    found = estimate_position(stations(LINE, tag, sigma_deg=1.0), method=method)
    assert found.method == method
    assert found.stations == 6
    # The prior of distance draws a posterior that is 40 m long by a metre or two.
    assert miss_m(found, tag) < 3.0


def test_two_bearings_cross_at_one_point_for_the_estimators_of_lenth() -> None:
    two = (np.array([0.0, 500.0]), np.zeros(2))
    for method in METHODS[1:]:
        assert (
            miss_m(
                estimate_position(stations(two, (200.0, 300.0)), method=method), (200.0, 300.0)
            )
            < 0.05
        )


def test_one_bearing_gives_a_wedge() -> None:
    found = estimate_position(stations((np.zeros(1), np.zeros(1)), (0.0, 500.0)))
    assert found.at_edge
    assert found.ellipse95 is not None
    assert found.ellipse95.semi_major_m > 2 * found.ellipse95.semi_minor_m
    assert min(found.ellipse95.orientation_deg, 180 - found.ellipse95.orientation_deg) < 5.0


def test_parallel_bearings_have_no_position_but_a_region() -> None:
    parallel = Stations(
        latitude_deg=np.array([35.0, 35.0, 35.0]),
        longitude_deg=np.array([-111.0, -110.999, -110.998]),
        bearing_deg=np.zeros(3),
        sigma_deg=np.full(3, 5.0),
    )
    with pytest.raises(UsageError, match="bayes"):
        estimate_position(parallel, method="mle")
    assert estimate_position(parallel).at_edge


def runs_with_a_gross_bearing(
    rng: Generator, places: tuple[Floats, Floats], tag: tuple[float, float], count: int
) -> list[tuple[int, Stations]]:
    out = []
    for _ in range(count):
        errors = rng.normal(0, 3.0, len(places[0]))
        bad = int(rng.integers(len(errors)))
        errors[bad] = rng.uniform(40, 320)
        out.append((bad, stations(places, tag, errors)))
    return out


@pytest.mark.parametrize(
    ("places", "tag", "median_m"), [(LINE, (0.0, 400.0), 31.0), (SQUARE, (50.0, 100.0), 30.0)]
)
def test_one_gross_bearing_is_found_out_and_does_no_harm(
    places: tuple[Floats, Floats], tag: tuple[float, float], median_m: float
) -> None:
    rng = np.random.default_rng(31)
    errors, named = [], 0
    for bad, given in runs_with_a_gross_bearing(rng, places, tag, 18):
        found = estimate_position(given)
        errors.append(miss_m(found, tag))
        named += some(found.outlier_probabilities)[bad] > 0.5
    assert np.median(errors) <= median_m
    assert np.max(errors) < 1500.0
    assert named >= 0.6 * 18


def test_the_circle_of_95_percent_holds_the_tag_as_often_as_it_says() -> None:
    rng = np.random.default_rng(32)
    inside = 0
    for _ in range(30):
        found = estimate_position(stations(LINE, (0.0, 400.0), rng.normal(0, 6.0, 6), 6.0))
        inside += miss_m(found, (0.0, 400.0)) <= some(found.radius95_m)
    assert inside >= 26  # .95 of 30 are 28.5; by chance fewer than 26 once in 300


@pytest.mark.parametrize(("count", "median_m"), [(2, 32.0), (4, 21.0)])
def test_few_bearings_are_as_fine_as_many(count: int, median_m: float) -> None:
    """Their outliers' tails kept all of a 6 km square in sight, on a grid of 32 m."""
    rng = np.random.default_rng(38)
    errors, held50, held95 = [], 0, 0
    for _ in range(60):
        turns = rng.uniform(0, 2 * np.pi) + np.arange(count) * np.pi / 2
        tag = (float(rng.normal(0, 60)), float(rng.normal(0, 60)))
        given = stations(
            (400 * np.sin(turns), 400 * np.cos(turns)), tag, rng.normal(0, 3.0, count)
        )
        found = estimate_position(given, heading_sigma_deg=0.0)
        errors.append(miss_m(found, tag))
        held50 += errors[-1] <= some(found.radius50_m)
        held95 += errors[-1] <= some(found.radius95_m)
    assert np.median(errors) <= median_m
    assert 20 <= held50 <= 40
    assert held95 >= 52


def test_circles_are_not_held_to_the_size_of_a_cell() -> None:
    found = estimate_position(stations(SQUARE, (50.0, 100.0), 0.0, 0.3), heading_sigma_deg=0.0)
    assert found.radius50_m is not None
    assert found.radius50_m < shifted_m(2.0, 0.5)
    assert 1.8 < some(found.radius95_m) / found.radius50_m < 2.4


def test_bearings_without_a_known_error_are_weighed_by_their_scatter() -> None:
    rng = np.random.default_rng(33)
    radii = []
    for sigma in (1.0, 10.0):
        given = stations(LINE, (0.0, 400.0), rng.normal(0, sigma, 6), None)
        found = estimate_position(given)
        radii.append(some(found.radius50_m))
    assert radii[1] > 2.0 * radii[0]


def test_the_original_m_estimator_rejects_nothing_and_lenths_does() -> None:
    """Its kappa is 1/A(C) instead of A⁻¹(C): 2.2 for any bearings."""
    errors = np.array([0.5, -0.5, 0.3, 25.0, -0.4, 0.2])
    given = stations(LINE, (0.0, 400.0), errors)
    as_original = miss_m(estimate_position(given, method="mest"), (0.0, 400.0))
    maximum = miss_m(estimate_position(given, method="mle"), (0.0, 400.0))
    right = miss_m(estimate_position(given, method="mest_lenth"), (0.0, 400.0))
    assert as_original == pytest.approx(maximum, rel=0.1)
    assert right < 0.1 * maximum


def test_levels_of_the_rotations_narrow_the_distance() -> None:
    """Three stations around a point 500 m from the tag, path loss known (experiment L5)."""
    turns = np.radians([90.0, 210.0, 330.0])
    places = (115.0 * np.cos(turns), 115.0 * np.sin(turns))
    tag = (0.0, 500.0)
    plain = stations(places, tag, 0.0, 2.0)
    distance = np.hypot(places[0] - tag[0], places[1] - tag[1])
    fused = Stations(
        latitude_deg=plain.latitude_deg,
        longitude_deg=plain.longitude_deg,
        bearing_deg=plain.bearing_deg,
        sigma_deg=plain.sigma_deg,
        level_db=70.0 - 25.0 * np.log10(distance),
        level_sigma_db=np.full(3, 0.26),
    )
    known = Propagation(exponent=2.5, exponent_sigma=0.05, shadowing_db=0.0)
    without, together = estimate_position(plain), estimate_position(fused, propagation=known)
    assert miss_m(together, tag) < 5.0
    assert some(together.radius50_m) < 0.7 * some(without.radius50_m)


def lawnmower() -> tuple[Floats, Floats]:
    """300 m square, lines 50 m apart, a pulse each 9 m."""
    corners = [
        (x, y) for k, x in enumerate(range(0, 301, 50)) for y in ((0, 300), (300, 0))[k % 2]
    ]
    path = np.array(corners, np.float64)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    pulses = np.arange(0.0, along[-1], 9.0)
    return np.interp(pulses, along, path[:, 0]), np.interp(pulses, along, path[:, 1])


def survey(
    tag: tuple[float, float], fading_db: Floats, threshold_db: float | None = None
) -> PowerTrack:
    east, north = lawnmower()
    distance = np.sqrt((east - tag[0]) ** 2 + (north - tag[1]) ** 2 + 40.0**2)
    gain = monopole_gain_db(np.degrees(np.arcsin(40.0 / distance)))
    snr = 40.0 - 25.0 * np.log10(distance / 100.0) + gain + fading_db
    if threshold_db is not None:
        snr = np.where(snr < threshold_db, np.nan, snr)
    latitude, longitude = PLANE.to_geodetic(east, north)
    return PowerTrack(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.full(len(east), 40.0),
        snr_db=snr,
        threshold_db=threshold_db or 10.0,
    )


def test_a_survey_with_a_monopole_finds_the_tag_and_not_the_ring_of_strongest_signal() -> None:
    rng = np.random.default_rng(34)
    errors, inside = [], 0
    for _ in range(24):
        tag = (float(rng.uniform(0, 300)), float(rng.uniform(0, 300)))
        track = survey(tag, rng.normal(0, 3.0, len(lawnmower()[0])))
        found = estimate_position(None, track, height_sigma_m=0.0)  # it is true here
        errors.append(miss_m(found, tag))
        inside += errors[-1] <= some(found.radius95_m)
    assert np.median(errors) <= 6.5  # the bound is 5.1 rms
    # 11.3 where no pulse can be someone else's.
    assert np.quantile(errors, 0.9) <= 14.0
    assert 20 <= inside <= 24


def test_pulses_missed_for_weakness_do_not_flatten_the_path_loss() -> None:
    """Two thirds of the pulses are below the threshold."""
    tag = (120.0, 170.0)
    fading = np.random.default_rng(35).normal(0, 3.0, len(lawnmower()[0]))
    track = survey(tag, fading, threshold_db=39.0)
    assert np.mean(np.isnan(track.snr_db)) > 0.4
    found = estimate_position(None, track)
    assert found.path_loss_exponent == pytest.approx(2.5, abs=0.5)
    assert miss_m(found, tag) < 15.0


def test_bearings_and_powers_go_together() -> None:
    tag = (120.0, 260.0)
    track = survey(tag, np.random.default_rng(36).normal(0, 4.0, len(lawnmower()[0])))
    places = (np.array([0.0, 300.0]), np.zeros(2))
    found = estimate_position(stations(places, tag), track)
    assert (found.stations, found.pulses) == (2, len(track.snr_db))
    assert miss_m(found, tag) < 15.0


def test_estimated_bearings_go_straight_into_a_position() -> None:
    rng = np.random.default_rng(37)
    tag = (60.0, 380.0)
    yaw = np.arange(0.0, 360.0, 9.0)
    bearings = []
    for east in LINE[0][::2]:
        truth = np.degrees(np.arctan2(tag[0] - east, tag[1]))
        level = 20.0 + PATTERNS["RA-23K"].gain_db(truth - yaw) + rng.normal(0, 2, len(yaw))
        bearings.append(estimate_bearing(yaw, level))
    latitude, longitude = PLANE.to_geodetic(LINE[0][::2], np.zeros(3))
    found = estimate_position(Stations.of(latitude, longitude, bearings))
    assert miss_m(found, tag) < min(100.0, some(found.radius95_m))


@pytest.mark.parametrize(
    ("change", "word"),
    [
        ({"method": "guess"}, "mest"),
        ({"stations": None}, "missing"),
        (
            {"stations": stations((np.zeros(1), np.zeros(1)), (0.0, 9.0)), "method": "mle"},
            "two",
        ),
        (
            {
                "stations": Stations(
                    latitude_deg=np.zeros(2), longitude_deg=np.zeros(3), bearing_deg=np.zeros(2)
                )
            },
            "length",
        ),
        (
            {
                "stations": Stations(
                    latitude_deg=np.array([np.nan]),
                    longitude_deg=np.zeros(1),
                    bearing_deg=np.zeros(1),
                )
            },
            "finite",
        ),
    ],
)
def test_what_has_no_position_is_refused_by_name(change: dict[str, object], word: str) -> None:
    arguments = {"stations": stations(LINE, (0.0, 400.0)), **change}
    with pytest.raises(UsageError, match=word):
        estimate_position(**arguments)  # type: ignore[arg-type]


@pytest.mark.parametrize("spread_m", [0.0, 3.0])
def test_powers_of_a_station_that_stands_still_give_no_place(spread_m: float) -> None:
    rng = np.random.default_rng(5)
    latitude, longitude = PLANE.to_geodetic(*rng.normal(0.0, spread_m, (2, 200)))
    heard = PowerTrack(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.full(200, 5.0),
        snr_db=rng.normal(15.0, 2.0, 200),
        time_s=3.0 * np.arange(200.0),
    )
    with pytest.raises(UsageError, match="one place"):
        estimate_position(None, heard)


def test_powers_that_are_all_equal_break_nothing() -> None:
    latitude, longitude = PLANE.to_geodetic(np.linspace(-100.0, 100.0, 60), np.zeros(60))
    heard = PowerTrack(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.full(60, 40.0),
        snr_db=np.full(60, 15.0),
        time_s=2.0 * np.arange(60.0),
    )
    radius95_m = estimate_position(None, heard).radius95_m
    assert some(radius95_m) > 30.0
