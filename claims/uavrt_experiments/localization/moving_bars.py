"""Experiment L9: how often circles along a path contain an animal that moves.

No constant of the estimator may be chosen by these walks.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.units import NANOSECONDS_PER_SECOND, wrap_degrees_360
from uavrt.localization.antenna import monopole_gain_db
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.results import Position
from uavrt_experiments.figures import mean, measured, median, share
from uavrt_experiments.localization.position_bars import flown_lines
from uavrt_experiments.result import Row

_Floats = NDArray[np.float64]
PLANE = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
SIDE_M = 300.0
_HEIGHT_M = 40.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Walk:
    """Path of an animal with straight stretches."""

    time_s: _Floats
    """Times of the corners [s]."""
    east_m: _Floats
    north_m: _Floats

    def at(self, time_s: _Floats | float) -> tuple[_Floats, _Floats]:
        """East and north at given times [m]."""
        return (
            np.asarray(np.interp(time_s, self.time_s, self.east_m)),
            np.asarray(np.interp(time_s, self.time_s, self.north_m)),
        )

    def moved(self, east_m: float, north_m: float) -> "Walk":
        """Path shifted by a distance to east and north."""
        return Walk(
            time_s=self.time_s, east_m=self.east_m + east_m, north_m=self.north_m + north_m
        )


def steady(rng: Generator, span_s: float, *, speed_m_s: float) -> Walk:
    """Walk in a straight line, in a random direction."""
    towards = rng.uniform(0.0, 2.0 * np.pi)
    gone = speed_m_s * span_s
    return Walk(
        time_s=np.array([0.0, span_s]),
        east_m=np.array([0.0, gone * np.sin(towards)]),
        north_m=np.array([0.0, gone * np.cos(towards)]),
    )


def stop_and_go(rng: Generator, span_s: float, *, speed_m_s: float) -> Walk:
    """Walk for 30 to 120 s, rest for as long, and go on in about the same direction."""
    time_s, east_m, north_m = [0.0], [0.0], [0.0]
    towards, goes = rng.uniform(0.0, 2.0 * np.pi), bool(rng.random() < 0.5)
    while time_s[-1] < span_s:
        lasts_s = float(rng.uniform(30.0, 120.0))
        gone = speed_m_s * lasts_s if goes else 0.0
        time_s.append(time_s[-1] + lasts_s)
        east_m.append(east_m[-1] + gone * float(np.sin(towards)))
        north_m.append(north_m[-1] + gone * float(np.cos(towards)))
        towards += rng.normal(0.0, np.radians(30.0)) if goes else 0.0
        goes = not goes
    return Walk(time_s=np.array(time_s), east_m=np.array(east_m), north_m=np.array(north_m))


def winding(rng: Generator, span_s: float, *, speed_m_s: float) -> Walk:
    """Walk in a bow of 60 to 180° over the flight, to either side."""
    time_s = np.linspace(0.0, span_s, 41)
    turn = np.radians(rng.uniform(60.0, 180.0)) * rng.choice([-1.0, 1.0])
    towards = rng.uniform(0.0, 2.0 * np.pi) + turn * (time_s[:-1] + time_s[1]) / span_s
    step_m = speed_m_s * time_s[1]
    return Walk(
        time_s=time_s,
        east_m=np.concatenate(([0.0], np.cumsum(step_m * np.sin(towards)))),
        north_m=np.concatenate(([0.0], np.cumsum(step_m * np.cos(towards)))),
    )


Walks = Callable[[Generator, float], Walk]


@dataclass(frozen=True, slots=True, kw_only=True)
class Followed:
    """An animal's path as estimated, and its true one."""

    walk: Walk
    found: Position
    origin_ns: int = 0

    def off_m(self) -> _Floats:
        """Distance of each point of the path from the animal at that time [m]."""
        track = self.found.track
        east, north = PLANE.to_local(
            [one.latitude_deg for one in track], [one.longitude_deg for one in track]
        )
        since_ns = np.array([one.time_ns - self.origin_ns for one in track])
        x, y = self.walk.at(since_ns / NANOSECONDS_PER_SECOND)
        return np.asarray(np.hypot(east - x, north - y))

    def share_held(self, percent: int) -> float:
        """Share of the path's circles of 50 or 95 % that contain the animal."""
        track = self.found.track
        radius_m = [one.radius50_m if percent == 50 else one.radius95_m for one in track]
        return float(np.mean(self.off_m() <= np.array(radius_m)))


def by_bearings(rng: Generator, walks: Walks, stations: int = 6) -> Followed:
    """Estimate a walk by one bearing from each station of a ring.

    Each bearing has an error of 3°, and all have a common error of 1.5°.
    """
    angle = rng.uniform(0.0, 2.0 * np.pi) + np.arange(stations) * 2.0 * np.pi / stations
    radius = rng.uniform(250.0, 450.0, stations)
    east, north = radius * np.sin(angle), radius * np.cos(angle)
    hops_s = np.hypot(np.diff(east), np.diff(north)) / 8.0
    time_s = np.concatenate([[0.0], np.cumsum(hops_s + 60.0)])
    walk = walks(rng, float(time_s[-1])).moved(*rng.normal(0.0, 50.0, 2))
    x, y = walk.at(time_s)
    bearing = np.degrees(np.arctan2(x - east, y - north))
    bearing += rng.normal(0.0, 1.5) + rng.normal(0.0, 3.0, stations)
    latitude, longitude = PLANE.to_geodetic(east, north)
    given = Stations(
        latitude_deg=latitude,
        longitude_deg=longitude,
        bearing_deg=wrap_degrees_360(bearing),
        sigma_deg=np.full(stations, 3.0),
        time_s=time_s,
        origin_ns=1_700_000_000_000_000_000,
    )
    found = estimate_position(given, method="track")
    return Followed(walk=walk, found=found, origin_ns=given.origin_ns)


def by_strengths(
    rng: Generator,
    walks: Walks,
    *,
    leaves: bool = False,
    fading_db: float = 3.0,
    correlation: float = 0.0,
) -> Followed:
    """Estimate a walk by a survey of 300 by 300 m with lines 50 m apart.

    `leaves`: True if the animal begins in the square, and ends 30 m or more outside. False: it
    is in the inner part of the square in the middle of the flight.
    """
    east, north, time_s = flown_lines(SIDE_M, 50.0)
    while True:
        walk = walks(rng, float(time_s[-1]))
        if leaves:
            walk = walk.moved(*rng.uniform(0.0, SIDE_M, 2))
            end = np.abs(np.array([walk.east_m[-1], walk.north_m[-1]]) - 0.5 * SIDE_M)
            if end.max() < 0.5 * SIDE_M + 30.0:
                continue
        else:
            middle = walk.at(0.5 * float(time_s[-1]))
            place = rng.uniform(0.2 * SIDE_M, 0.8 * SIDE_M, 2)
            walk = walk.moved(float(place[0] - middle[0]), float(place[1] - middle[1]))
        break
    x, y = walk.at(time_s)
    slant = np.sqrt((east - x) ** 2 + (north - y) ** 2 + _HEIGHT_M**2)
    fading = rng.normal(0.0, fading_db, len(time_s))
    for number in range(1, len(time_s)):
        fading[number] *= np.sqrt(1.0 - correlation**2)
        fading[number] += correlation * fading[number - 1]
    gain_db = monopole_gain_db(np.degrees(np.arcsin(_HEIGHT_M / slant)))
    latitude, longitude = PLANE.to_geodetic(east, north)
    track = PowerTrack(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.full(len(time_s), _HEIGHT_M),
        snr_db=40.0 - 25.0 * np.log10(slant / 100.0) + gain_db + fading,
        time_s=time_s,
    )
    return Followed(walk=walk, found=estimate_position(None, track, method="track"))


def _walks(make: Callable[..., Walk], speed_m_s: float) -> Walks:
    return lambda rng, span_s: make(rng, span_s, speed_m_s=speed_m_s)


KINDS: dict[str, Callable[[Generator], Followed]] = {
    f"{how}, {kind}": (lambda rng, observe=observe, walks=walks: observe(rng, walks))
    for how, observe in (("six turns", by_bearings), ("survey", by_strengths))
    for kind, walks in (
        ("steady, 0.5 m/s", _walks(steady, 0.5)),
        ("steady, 1 m/s", _walks(steady, 1.0)),
        ("stop and go, 1 m/s", _walks(stop_and_go, 1.0)),
        ("in a bow, 0.7 m/s", _walks(winding, 0.7)),
    )
} | {
    "survey, out of its area, 1 m/s": lambda rng: by_strengths(
        rng, _walks(steady, 1.0), leaves=True
    ),
    "survey, correlation 0.7, steady, 1 m/s": lambda rng: by_strengths(
        rng, _walks(steady, 1.0), fading_db=4.0, correlation=0.7
    ),
    "survey, correlation 0.7, out of its area, 1 m/s": lambda rng: by_strengths(
        rng, _walks(steady, 1.0), leaves=True, fading_db=4.0, correlation=0.7
    ),
}
"""Kinds of walk and of observation, by name."""


def moving_tags(runs: int, seed: int, only: str = "") -> list[Row]:
    """L9: share of circles along the path that contain the animal, for each kind of walk."""
    rows = []
    for name, follow in KINDS.items():
        if only not in name:
            continue
        each = [follow(np.random.default_rng([seed, number])) for number in range(runs)]
        half, most = ([one.share_held(percent) for one in each] for percent in (50, 95))
        off_m = [float(np.median(one.off_m())) for one in each]
        seen = [float(any(two.name == "walk" for two in one.found.cautions)) for one in each]
        rows += [
            measured("L9", name, "median along the path [m]", off_m, median),
            measured("L9", name, "50 % circles hold", half, mean),
            measured("L9", name, "95 % circles hold", most, mean, least=0.92),
            measured("L9", name, "walk recognised", seen, share),
        ]
    return rows
