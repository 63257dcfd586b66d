"""Experiment C1: simulation-based calibration of posteriors (Talts et al. 2018).

Truths are drawn from the prior. The rank of a true value is the posterior probability of all
values with a higher density; over many draws, ranks are uniform from 0 to 1. A deliberate fault
must be detected.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy import stats

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.units import wrap_degrees_360
from uavrt.localization.antenna import PATTERNS
from uavrt.localization.bearing.estimate_bearing import estimate_bearing
from uavrt.localization.bearing.tuning import PATTERN
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.tuning import COMMON, GRID
from uavrt.localization.results import Position
from uavrt.localization.tuning import FLIGHT, POWER_LAW
from uavrt_experiments.localization.flight_calibration import path_rank, surveyed, tracker_rank
from uavrt_experiments.localization.rotations import matched_power
from uavrt_experiments.result import Row

_Floats = NDArray[np.float64]
_PLANE = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
_OWN_DEG, _RING_M, _OUTLIERS = 2.0, 400.0, 0.05
LEAST_P = 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Fault:
    """What a simulation violates; nothing by default."""

    noise_db: float = 0.0
    """Noise unknown to the estimator, in a third of all directions [dB]."""
    heading_deg: float = 0.0
    """Error of all headings beyond the prior's [deg]."""
    heading_known: bool = False
    """True: the estimator assumes that headings are exact."""
    place_m: float = FLIGHT.place_sigma_m
    """Standard deviation of the error of all positions [m]."""


NO_FAULT = Fault()


def bearing_rank(rng: Generator, fault: Fault = NO_FAULT) -> float:
    """Rank of the true direction in the posterior of a turn of 60 pulses."""
    truth, yaw = float(rng.uniform(0.0, 360.0)), np.arange(60) * 6.0 + rng.uniform(0.0, 6.0)
    fading = rng.normal(0.0, rng.choice(POWER_LAW.fadings_db), len(yaw))
    if rng.random() < PATTERN.correlated_share:
        alike = float(rng.choice(PATTERN.correlations))
        for number in range(1, len(yaw)):
            fading[number] *= np.sqrt(1.0 - alike**2)
            fading[number] += alike * fading[number - 1]
    level_db = rng.uniform(12.0, 32.0) + PATTERNS["RA-23K"].gain_db(truth - yaw) + fading
    loud = np.remainder(yaw - truth - 20.0, 360.0) < 120.0
    turned = rng.normal(0.0, COMMON.heading_sigma_deg) + fault.heading_deg
    found = estimate_bearing(
        yaw + turned,
        None,
        matched_power=matched_power(rng, level_db - np.where(loud, fault.noise_db, 0.0)),
        heading_sigma_deg=0.0 if fault.heading_known else COMMON.heading_sigma_deg,
    )
    assert found.posterior is not None
    # Around the truth the posterior is taken evenly over each degree.
    return _rank(rng, found.posterior, int(wrap_degrees_360(round(truth))))


def position_rank(rng: Generator, fault: Fault = NO_FAULT) -> float:
    """Rank of the true place in the posterior of six bearings from a ring."""
    angle = rng.uniform(0.0, 2.0 * np.pi) + np.arange(6) * np.pi / 3.0
    east, north = _RING_M * np.sin(angle), _RING_M * np.cos(angle)
    tag = _from_prior(rng, float(np.hypot(np.ptp(east), np.ptp(north))))
    bearing = np.degrees(np.arctan2(tag[0] - east, tag[1] - north)) + fault.heading_deg
    bearing += rng.normal(0.0, COMMON.heading_sigma_deg) + rng.normal(0.0, _OWN_DEG, 6)
    gross = rng.random(6) < _OUTLIERS
    bearing = wrap_degrees_360(np.where(gross, rng.uniform(0.0, 360.0, 6), bearing))
    shift = rng.normal(0.0, fault.place_m, 2)
    latitude, longitude = _PLANE.to_geodetic(east + shift[0], north + shift[1])
    found = estimate_position(
        Stations(
            latitude_deg=latitude,
            longitude_deg=longitude,
            bearing_deg=bearing,
            sigma_deg=np.full(6, _OWN_DEG),
        ),
        heading_sigma_deg=0.0 if fault.heading_known else COMMON.heading_sigma_deg,
    )
    return _rank_of_place(rng, found, tag)


def _from_prior(rng: Generator, extent_m: float) -> tuple[float, float]:
    """Draw a place: even within half the extent, then even over the distance's logarithm."""
    near_m = max(GRID.near_m, 0.5 * extent_m)
    beyond = np.log(GRID.bearing_range_m / near_m)
    away_m = near_m * np.sqrt(rng.random())
    if rng.random() < beyond / (0.5 + beyond):
        away_m = near_m * np.exp(rng.uniform(0.0, beyond))
    turn = rng.uniform(0.0, 2.0 * np.pi)
    return float(away_m * np.sin(turn)), float(away_m * np.cos(turn))


def _rank_of_place(rng: Generator, found: Position, tag: tuple[float, float]) -> float:
    grid = found.grid
    assert grid is not None
    plane = TangentPlane(latitude_deg=grid.latitude_deg, longitude_deg=grid.longitude_deg)
    east, north = plane.to_local(*_PLANE.to_geodetic(*tag))
    column, row = (
        int(np.argmin(np.abs(axis - at)))
        for axis, at in ((grid.east_m, float(east)), (grid.north_m, float(north)))
    )
    step = float(grid.east_m[1] - grid.east_m[0])
    off = abs(grid.east_m[column] - east), abs(grid.north_m[row] - north)
    if max(off) > step:
        return float(1.0 - rng.uniform(0.0, 1.0 - GRID.map_share))
    return _rank(rng, grid.probability.ravel(), row * len(grid.east_m) + column)


def _rank(rng: Generator, probability: _Floats, at: int) -> float:
    own = probability[at]
    return float(probability[probability > own].sum() + rng.random() * own)


def survey_rank(rng: Generator, *, place_m: float = FLIGHT.place_sigma_m) -> float:
    """Rank of the true place in the posterior of a survey by strength.

    `place_m`: standard deviation of the error of all positions [m].
    """
    return _rank_of_place(rng, *surveyed(rng, place_m))


Rank = Callable[[Generator], float]

RANKS: dict[str, Rank] = {
    "bearing": bearing_rank,
    "position by bearings": position_rank,
    "survey": survey_rank,
    "tracker": tracker_rank,
    "path of a moving tag": path_rank,
}
"""Functions that draw a rank, by posterior; experiment I8 tests those of whole flights."""

FAULTS: dict[str, tuple[str, int, Rank]] = {
    "noise 3 dB wrong": ("bearing", 200, partial(bearing_rank, fault=Fault(noise_db=3.0))),
    "headings 3° off, taken for exact": (
        "bearing",
        200,
        partial(bearing_rank, fault=Fault(heading_deg=3.0, heading_known=True)),
    ),
    "positions 20 m off": (
        "position by bearings",
        200,
        partial(position_rank, fault=Fault(place_m=20.0)),
    ),
    "drone 20 m off": ("survey", 24, partial(survey_rank, place_m=20.0)),
    "noise 12 dB higher in half of the area": (
        "tracker",
        40,
        partial(tracker_rank, weaker_db=12.0),
    ),
    "headings 12° off": ("path of a moving tag", 24, partial(path_rank, turned_deg=12.0)),
}
"""Simulations that violate a model: the posterior that must show it, and in how many draws."""


def p_uniform(rank: Rank, runs: int, seed: int) -> float:
    """Probability that uniform ranks deviate as much (Kolmogorov-Smirnov test)."""
    ranks = [rank(np.random.default_rng([seed, number])) for number in range(runs)]
    return float(stats.kstest(ranks, "uniform").pvalue)


def calibrations(runs: int, seed: int) -> list[Row]:
    """C1: test if ranks are uniform, without a fault (Holm) and with each fault."""
    found = sorted((p_uniform(rank, runs, seed), name) for name, rank in RANKS.items())
    corrected, before = [], 0.0
    for number, (chance, name) in enumerate(found):
        before = max(before, min(1.0, chance * (len(found) - number)))
        corrected.append((before, name))
    what = "chance of the ranks"
    rows = [
        Row.counted("C1", what, name, chance, runs, least=LEAST_P) for chance, name in corrected
    ]
    for fault, (name, count, rank) in FAULTS.items():
        chance = p_uniform(rank, count, seed)
        rows.append(Row.counted("C1", what, f"{name}: {fault}", chance, count, most=LEAST_P))
    return rows
