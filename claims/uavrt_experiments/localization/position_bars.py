"""Experiments L2–L5: accuracy of positions."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UsageError
from uavrt.localization.antenna import monopole_gain_db
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.results import Position, PositionMethod
from uavrt_experiments.figures import measured, median, share, tenth_worst
from uavrt_experiments.result import Row

_Floats = NDArray[np.float64]
_PLANE = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
_DIVERGED_M = 1e6
_OTHERS: tuple[PositionMethod, ...] = ("mle", "rmr", "mest", "rmr_ahead", "mest_lenth")


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """Stations and a tag."""

    name: str
    east_m: tuple[float, ...]
    north_m: tuple[float, ...]
    tag: tuple[float, float]


LINE = Layout(
    name="6 stations on 500 m",
    east_m=(-250.0, -150.0, -50.0, 50.0, 150.0, 250.0),
    north_m=(0.0,) * 6,
    tag=(0.0, 400.0),
)
SQUARE = Layout(
    name="square of 600 m",
    east_m=(-300.0, 300.0, 300.0, -300.0),
    north_m=(-300.0, -300.0, 300.0, 300.0),
    tag=(50.0, 100.0),
)


def crossings(runs: int, seed: int) -> list[Row]:
    """L2 and L3: crossing bearings, clean and with one gross error; all methods compared.

    Headings are exact here, and the estimator assumes so; L6 tests heading errors.
    """
    results = []
    for sigma, clean, spoilt, worst in ((3.0, 22.0, 24.0, 60.0), (6.0, 43.0, 60.0, 150.0)):
        results += _crossing("L2", LINE, sigma, False, runs, seed, clean, None)
        results += _crossing("L2", LINE, sigma, True, runs, seed, spoilt, worst)
    return results + _crossing("L3", SQUARE, 3.0, True, runs, seed, 30.0, None)


def _crossing(
    name: str,
    layout: Layout,
    sigma_deg: float,
    gross: bool,
    runs: int,
    seed: int,
    most: float,
    worst: float | None,
) -> list[Row]:
    condition = f"{layout.name}, sd {sigma_deg:g}°{', one gross' if gross else ''}"
    errors, covered, named = [], [], []
    for stations, bad in _bearings(layout, sigma_deg, gross, runs, seed):
        found = estimate_position(stations, heading_sigma_deg=0.0)
        errors.append(_miss_m(found, layout.tag))
        covered.append(float(_inside(found, layout.tag, 0.95)))
        if bad is not None and found.outlier_probabilities is not None:
            named.append(float(found.outlier_probabilities[bad] > 0.5))
    results = [
        measured(name, condition, "median [m]", errors, median, most=most),
        measured(name, condition, "90 % within [m]", errors, tenth_worst, most=worst),
        measured(name, condition, "95 % region holds", covered, share, least=0.92, most=0.98),
    ]
    if named:
        results.append(measured(name, condition, "outlier named", named, share, least=0.6))
    for method in _OTHERS:
        others = [
            _miss_or_divergence(stations, layout.tag, method)
            for stations, _ in _bearings(layout, sigma_deg, gross, runs, seed)
        ]
        label = f"{condition}: {method}"
        results.append(measured(name, label, "median [m]", others, median))
        lost = [float(one >= _DIVERGED_M) for one in others]
        results.append(measured(name, label, "diverged", lost, share))
    return results


def _bearings(
    layout: Layout, sigma_deg: float, gross: bool, runs: int, seed: int
) -> Iterator[tuple[Stations, int | None]]:
    """Stations with noisy bearings; the gross one, if any, points anywhere."""
    rng = np.random.default_rng(seed)
    east, north = np.array(layout.east_m), np.array(layout.north_m)
    latitude, longitude = _PLANE.to_geodetic(east, north)
    true = np.degrees(np.arctan2(layout.tag[0] - east, layout.tag[1] - north))
    for _ in range(runs):
        bearing = true + rng.normal(0.0, sigma_deg, len(east))
        bad = int(rng.integers(len(east))) if gross else None
        if bad is not None:
            bearing[bad] = rng.uniform(0.0, 360.0)
        yield (
            Stations(
                latitude_deg=latitude,
                longitude_deg=longitude,
                bearing_deg=bearing,
                sigma_deg=np.full(len(east), sigma_deg),
            ),
            bad,
        )


def _miss_or_divergence(
    stations: Stations, tag: tuple[float, float], method: PositionMethod
) -> float:
    try:
        return _miss_m(estimate_position(stations, method=method), tag)
    except UsageError:
        return _DIVERGED_M


def _miss_m(found: Position, tag: tuple[float, float]) -> float:
    east, north = _PLANE.to_local(found.latitude_deg, found.longitude_deg)
    return float(np.hypot(east - tag[0], north - tag[1]))


def _inside(found: Position, tag: tuple[float, float], share_held: float) -> bool:
    """True if the smallest region of a probability contains the tag."""
    grid = found.grid
    if grid is None:
        return False
    origin = TangentPlane(latitude_deg=grid.latitude_deg, longitude_deg=grid.longitude_deg)
    east, north = origin.to_local(*_PLANE.to_geodetic(*tag))
    column = round(float((east - grid.east_m[0]) / (grid.east_m[1] - grid.east_m[0])))
    row = round(float((north - grid.north_m[0]) / (grid.north_m[1] - grid.north_m[0])))
    rows, columns = grid.probability.shape
    if not (0 <= row < rows and 0 <= column < columns):
        return False
    more = grid.probability[grid.probability > grid.probability[row, column]].sum()
    return bool(more < share_held)


def surveys(runs: int, seed: int) -> list[Row]:
    """L4: a monopole flown in lines at a known height of 40 m; the tag is unknown."""
    cases = (
        (300.0, 50.0, 3.0, 0.0, 5.0, 10.0, 5.1),
        (300.0, 50.0, 4.0, 0.7, 12.0, 30.0, 11.0),
        (600.0, 100.0, 3.0, 0.0, 16.0, 32.0, 16.0),
    )
    results = []
    for side, spacing, sigma, correlation, most, worst, bound in cases:
        rng = np.random.default_rng(seed)
        errors, covered, ring = [], [], []
        for _ in range(runs):
            tag = (float(rng.uniform(0.0, side)), float(rng.uniform(0.0, side)))
            track = survey(rng, side, spacing, sigma, correlation, tag)
            found = estimate_position(None, track, height_sigma_m=0.0)
            errors.append(_miss_m(found, tag))
            covered.append(
                float(found.radius95_m is not None and errors[-1] <= found.radius95_m)
            )
            ring.append(_strongest_miss_m(track, tag))
        condition = (
            f"{side:g} m, lines {spacing:g} m apart, sd {sigma:g} dB, AR {correlation:g}"
        )
        results += [
            measured("L4", condition, "median [m]", errors, median, most=most, bound=bound),
            measured("L4", condition, "90 % within [m]", errors, tenth_worst, most=worst),
            measured("L4", condition, "95 % circle holds", covered, share),
            measured("L4", f"{condition}: strongest", "median [m]", ring, median),
        ]
    return results


def flown_lines(side_m: float, spacing_m: float) -> tuple[_Floats, _Floats, _Floats]:
    """East, north [m] and time [s] of pulses each 1.5 s along lines over a square at 6 m/s."""
    corners = []
    for number, east_m in enumerate(np.arange(0.0, side_m + 1.0, spacing_m)):
        ends = (0.0, side_m) if number % 2 == 0 else (side_m, 0.0)
        corners += [(east_m, ends[0]), (east_m, ends[1])]
    path = np.array(corners)
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))])
    pulses = np.arange(0.0, along[-1], 9.0)
    east, north = (np.interp(pulses, along, path[:, axis]) for axis in (0, 1))
    return east, north, pulses / 6.0


def survey(
    rng: Generator,
    side_m: float,
    spacing_m: float,
    fading_db: float,
    correlation: float,
    tag: tuple[float, float],
    velocity_m_s: tuple[float, float] = (0.0, 0.0),
    *,
    height_m: float = 40.0,
    exponent: float = 2.5,
) -> PowerTrack:
    """Fly lines over a square at 6 m/s, with a pulse each 1.5 s and correlated fading.

    The tag is at its place in the middle of the flight. The estimator gets a height of 40 m,
    whatever the true one.
    """
    east, north, time_s = flown_lines(side_m, spacing_m)
    fading = rng.normal(0.0, fading_db, len(time_s))
    for number in range(1, len(time_s)):
        fading[number] *= np.sqrt(1.0 - correlation**2)
        fading[number] += correlation * fading[number - 1]
    since_s = time_s - 0.5 * time_s[-1]
    off_east = east - tag[0] - velocity_m_s[0] * since_s
    off_north = north - tag[1] - velocity_m_s[1] * since_s
    slant = np.sqrt(off_east**2 + off_north**2 + height_m**2)
    gain = monopole_gain_db(np.degrees(np.arcsin(height_m / slant)))
    latitude, longitude = _PLANE.to_geodetic(east, north)
    return PowerTrack(
        latitude_deg=latitude,
        longitude_deg=longitude,
        height_m=np.full(len(time_s), 40.0),
        snr_db=40.0 - 10.0 * exponent * np.log10(slant / 100.0) + gain + fading,
        time_s=time_s,
    )


def _strongest_miss_m(track: PowerTrack, tag: tuple[float, float]) -> float:
    """Distance of the tag from the place where six pulses in a row were strongest [m]."""
    east, north = _PLANE.to_local(track.latitude_deg, track.longitude_deg)
    mean = np.convolve(track.snr_db, np.ones(6) / 6.0, mode="valid")
    top = int(np.argmax(mean)) + 3
    return float(np.hypot(east[top] - tag[0], north[top] - tag[1]))


def fusion(runs: int, seed: int) -> list[Row]:
    """L5: three stations 200 m apart, tag 500 m away; bearings alone and with the levels.

    The tag's strength is unknown, the path loss exponent known to 0.05, without shadowing; so
    the levels' differences give the distance. Bearings have errors of 2°, levels of 0.26 dB, as
    from 60 pulses with 2 dB of fading.
    """
    rng = np.random.default_rng(seed)
    turns = np.radians([0.0, 120.0, 240.0])
    known = Propagation(exponent=2.5, exponent_sigma=0.05, shadowing_db=0.0)
    alone, together = [], []
    for _ in range(runs):
        phase = rng.uniform(0.0, 2.0 * np.pi)
        east, north = 115.0 * np.sin(turns + phase), 115.0 * np.cos(turns + phase)
        tag = (0.0, 500.0)
        latitude, longitude = _PLANE.to_geodetic(east, north)
        bearing = np.degrees(np.arctan2(tag[0] - east, tag[1] - north))
        bearing += rng.normal(0.0, 2.0, 3)
        slant = np.hypot(tag[0] - east, tag[1] - north)
        level = 60.0 - 25.0 * np.log10(slant / 100.0) + rng.normal(0.0, 0.26, 3)
        plain = Stations(
            latitude_deg=latitude,
            longitude_deg=longitude,
            bearing_deg=bearing,
            sigma_deg=np.full(3, 2.0),
        )
        fused = Stations(
            latitude_deg=latitude,
            longitude_deg=longitude,
            bearing_deg=bearing,
            sigma_deg=np.full(3, 2.0),
            level_db=level,
            level_sigma_db=np.full(3, 0.26),
        )
        alone.append(_miss_m(estimate_position(plain, heading_sigma_deg=0.0), tag))
        both = estimate_position(fused, propagation=known, heading_sigma_deg=0.0)
        together.append(_miss_m(both, tag))
    condition = "3 stations 200 m apart, tag at 500 m"
    before = float(median(np.array(alone)))
    return [
        measured("L5", f"{condition}: bearings", "median [m]", alone, median),
        measured(
            "L5", f"{condition}: and levels", "median [m]", together, median, most=0.7 * before
        ),
    ]
