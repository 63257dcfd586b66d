"""Experiment L7: coverage of 50 and 95 % circles, with errors drawn from the priors.

A circle that allows for heading errors of 1.5° is too wide for a flight with exact headings.
Over flights with such errors, it contains the tag with the stated probability.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.position.tuning import COMMON, SURVEY
from uavrt.localization.results import Position
from uavrt_experiments.figures import measured, share
from uavrt_experiments.localization.position_bars import survey
from uavrt_experiments.result import Row

_Floats = NDArray[np.float64]
_PLANE = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
_OWN_DEG = 2.0
"""Independent error of each bearing [deg]."""
_OUTLIER_SHARE = 0.05
_HEIGHT_M = 40.0
_SIDE_M = 300.0
_FADING_DB = 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Bearings:
    """Stations, and the errors of their bearings."""

    name: str
    stations: int = 6
    one_side: bool = False
    headings: bool = True
    """True: headings have a common error, drawn from the prior."""
    unusual: bool = False
    """True: wrong compasses, walks and gross bearing errors are drawn too."""
    known: bool = False
    """True: the estimator assumes that headings are exact."""
    judged: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Strengths:
    """A survey by strength, and its errors."""

    name: str
    heights: bool = False
    """True: the given height has an error, drawn from the prior."""
    known: bool = True
    """True: the estimator assumes that heights are exact."""
    too_weak: float = 0.0
    """Share of the pulses that are too weak to be detected."""
    lost: float = 0.0
    """Share of the pulses that are missed for other reasons."""
    judged: bool = True


BEARINGS = (
    Bearings(name="6 stations around, all drawn", unusual=True),
    Bearings(name="4 stations around, all drawn", stations=4, unusual=True),
    Bearings(name="6 stations on one side, headings drawn", one_side=True),
    Bearings(
        name="6 stations on one side, nothing wrong",
        one_side=True,
        headings=False,
        judged=False,
    ),
    Bearings(
        name="6 stations on one side, headings known", one_side=True, headings=False, known=True
    ),
)
STRENGTHS = (
    Strengths(name="survey, heights drawn", heights=True, known=False),
    Strengths(name="survey, nothing wrong", known=False, judged=False),
    Strengths(name="survey, heights known"),
    Strengths(name="survey, heights known, half of the pulses too weak", too_weak=0.5),
    Strengths(name="survey, heights known, a tenth too weak", too_weak=0.1),
    Strengths(name="survey, heights known, half of the pulses lost", lost=0.5),
)


def circles(runs: int, seed: int) -> list[Row]:
    """L7: coverage of the circles; no requirement if the estimator allows for absent errors."""
    results = []
    for bearings in BEARINGS:
        rng = np.random.default_rng(seed)
        within = [by_bearings(rng, bearings) for _ in range(runs)]
        results += _rows(bearings.name, within, bearings.judged)
    for strengths in STRENGTHS:
        rng = np.random.default_rng(seed)
        within = [by_strength(rng, strengths) for _ in range(runs)]
        results += _rows(strengths.name, within, strengths.judged)
    return results


def _rows(name: str, within: list[tuple[bool, bool]], judged: bool) -> list[Row]:
    half, most = ([float(one[number]) for one in within] for number in (0, 1))
    limits: tuple[float | None, ...] = (0.45, 0.55, 0.93, 0.97) if judged else (None,) * 4
    return [
        measured("L7", name, "50 % circle holds", half, share, least=limits[0], most=limits[1]),
        measured("L7", name, "95 % circle holds", most, share, least=limits[2], most=limits[3]),
    ]


def by_bearings(rng: Generator, case: Bearings) -> tuple[bool, bool]:
    """True if the 50 % and the 95 % circle contain a tag with stations around it."""
    east, north = _stations(rng, case)
    hops_s = np.hypot(np.diff(east), np.diff(north)) / 8.0
    time_s = np.concatenate([[0.0], np.cumsum(hops_s + 60.0)])
    turned = rng.normal(0.0, COMMON.heading_sigma_deg) if case.headings else 0.0
    start, velocity = rng.normal(0.0, 50.0, 2), np.zeros(2)
    if case.unusual and rng.random() < COMMON.walking_share:
        velocity = rng.normal(0.0, COMMON.walking_m_s, 2)
    elif case.unusual and rng.random() < COMMON.wrong_compass_share:
        turned = rng.normal(0.0, COMMON.wrong_compass_deg)
    places = start + velocity * time_s[:, None]
    bearing = np.degrees(np.arctan2(places[:, 0] - east, places[:, 1] - north)) + turned
    bearing += rng.normal(0.0, _OWN_DEG, len(east))
    gross = rng.random(len(east)) < (_OUTLIER_SHARE if case.unusual else 0.0)
    bearing = np.where(gross, rng.uniform(0.0, 360.0, len(east)), bearing)
    latitude, longitude = _PLANE.to_geodetic(east, north)
    stations = Stations(
        latitude_deg=latitude,
        longitude_deg=longitude,
        bearing_deg=bearing,
        sigma_deg=np.full(len(east), _OWN_DEG),
        time_s=time_s,
    )
    heading_sigma_deg = 0.0 if case.known else COMMON.heading_sigma_deg
    found = estimate_position(stations, heading_sigma_deg=heading_sigma_deg)
    return _within(found, places[-1])


def _stations(rng: Generator, case: Bearings) -> tuple[_Floats, _Floats]:
    if case.one_side:
        return np.linspace(-250.0, 250.0, case.stations), np.full(case.stations, -400.0)
    angle = rng.uniform(0.0, 2.0 * np.pi) + np.arange(case.stations) * (
        2.0 * np.pi / case.stations
    )
    radius = rng.uniform(250.0, 450.0, case.stations)
    return radius * np.sin(angle), radius * np.cos(angle)


def by_strength(rng: Generator, case: Strengths) -> tuple[bool, bool]:
    """True if the 50 % and the 95 % circle contain a tag below survey lines."""
    tag = rng.uniform(0.0, _SIDE_M, 2)
    track = survey(rng, _SIDE_M, 50.0, _FADING_DB, 0.0, (float(tag[0]), float(tag[1])))
    if case.heights:
        track = replace(track, height_m=track.height_m - height_error_m(rng))
    found = estimate_position(
        None,
        strengths_heard(rng, track, case),
        height_sigma_m=0.0 if case.known else SURVEY.height_sigma_m,
    )
    return _within(found, tag)


def height_error_m(rng: Generator) -> float:
    """Draw a usual error of the height [m], or in one of ten cases four times as much."""
    while True:
        sigma = SURVEY.height_sigma_m * (4.0 if rng.random() < 0.1 else 1.0)
        error = float(rng.normal(0.0, sigma))
        if error < _HEIGHT_M - 3.0:
            return error


def strengths_heard(rng: Generator, track: PowerTrack, case: Strengths) -> PowerTrack:
    """Strengths of a track that are received; too weak ones and lost ones are NaN."""
    threshold_db = float(np.quantile(track.snr_db, case.too_weak)) if case.too_weak else 10.0
    missed = track.snr_db < threshold_db if case.too_weak else np.zeros(len(track.snr_db), bool)
    missed |= rng.random(len(missed)) < case.lost
    return replace(
        track, snr_db=np.where(missed, np.nan, track.snr_db), threshold_db=threshold_db
    )


def _within(found: Position, tag: _Floats) -> tuple[bool, bool]:
    assert found.radius50_m is not None
    assert found.radius95_m is not None
    east, north = _PLANE.to_local(found.latitude_deg, found.longitude_deg)
    miss_m = float(np.hypot(east - tag[0], north - tag[1]))
    return miss_m <= found.radius50_m, miss_m <= found.radius95_m
