"""Estimate the path of a moving animal, from the bearings or powers of a whole flight.

A particle tracker follows the animal, and each surviving hypothesis has a path through the
whole flight. Far before the present, few different paths survive, and a tracker may have lost
the true one among similar paths. So one tracker runs forwards and one backwards. At each time,
their paths are weighted by the trackers' evidence and by the number of different positions.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.errors import UsageError
from uavrt.core.runtime.lean_scipy import special
from uavrt.core.units import NANOSECONDS_PER_SECOND
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.bearings.bearing_evidence import von_mises
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.levels.level_belief import Listening
from uavrt.localization.position.levels.power_evidence import PowerTrack
from uavrt.localization.position.trackers import (
    ParticleTracker,
    PastPlaces,
    TagPrior,
    circles_around,
)
from uavrt.localization.position.tuning import BEARING_FIX, TRACK
from uavrt.localization.results import TrackPoint
from uavrt.localization.terrain.hill_losses import HillLosses

_Floats = NDArray[np.float64]


def path_by_bearings(
    stations: Stations, plane: TangentPlane, around: Area, *, heading_sigma_deg: float
) -> tuple[TrackPoint, ...]:
    """Estimate the path of a tag near `around`, through the bearings of a flight."""
    times = _checked(stations.time_s, "bearings")
    east, north = plane.to_local(stations.latitude_deg, stations.longitude_deg)
    posterior = _blurred(_posteriors(stations), heading_sigma_deg)
    prior = TagPrior(
        area=_widened(around, float(np.ptp(times))),
        turning_m_s_per_root_s=TRACK.turning_m_s_per_root_s,
    )

    def take(tracker: ParticleTracker, number: int) -> float:
        return tracker.take_bearing(
            float(east[number]), float(north[number]), posterior[number]
        )

    return _forwards_and_backwards((prior, prior), times, take, plane, stations.origin_ns)


def path_by_powers(
    powers: PowerTrack,
    plane: TangentPlane,
    ends: tuple[tuple[float, float], tuple[float, float]],
    *,
    astray_m_s: float,
    fading_db: float,
    hills: HillLosses | None = None,
) -> tuple[TrackPoint, ...]:
    """Estimate the path of a tag through the pulses of a flight, missed pulses included.

    Hypotheses begin around `ends`, which are uncertain by `astray_m_s` times the duration.
    """
    times = _checked(powers.time_s, "pulses")
    east, north = plane.to_local(powers.latitude_deg, powers.longitude_deg)
    half_m = TRACK.end_m + astray_m_s * float(np.ptp(times))
    thresholds_db = np.broadcast_to(powers.threshold_db, times.shape)
    prior = TagPrior(
        area=_around(ends[0], half_m),
        fading_db=TRACK.fading_factor * fading_db,
        shadowing_db=0.0,
        turning_m_s_per_root_s=TRACK.turning_m_s_per_root_s,
        pattern=powers.antenna,
        hills=hills,
    )

    def take(tracker: ParticleTracker, number: int) -> float:
        snr_db = float(powers.snr_db[number])
        expected = tracker.listen(
            Listening(
                east_m=float(east[number]),
                north_m=float(north[number]),
                height_m=float(powers.height_m[number]),
                snr_db=None if math.isnan(snr_db) else snr_db,
                threshold_db=float(thresholds_db[number]),
                yaw_deg=None if powers.yaw_deg is None else float(powers.yaw_deg[number]),
            )
        )
        return expected.log_probability

    priors = (prior, replace(prior, area=_around(ends[1], half_m)))
    return _forwards_and_backwards(priors, times, take, plane, powers.origin_ns)


def _checked(times: _Floats | None, what: str) -> _Floats:
    if times is None or len(times) < TRACK.least_times:
        raise UsageError(
            f"a track needs the times of three or more {what} of one flight",
            remedy="Name one flight alone, or use the method bayes for a tag at rest",
        )
    return times


def _widened(around: Area, span_s: float) -> Area:
    margin = TRACK.margin_m + 0.5 * TRACK.fastest_m_s * span_s
    return Area(
        west_m=around.west_m - margin,
        east_m=around.east_m + margin,
        south_m=around.south_m - margin,
        north_m=around.north_m + margin,
    )


def _around(place: tuple[float, float], half_m: float) -> Area:
    return Area(
        west_m=place[0] - half_m,
        east_m=place[0] + half_m,
        south_m=place[1] - half_m,
        north_m=place[1] + half_m,
    )


def _posteriors(stations: Stations) -> _Floats:
    if stations.posterior is not None:
        return stations.posterior
    if stations.sigma_deg is not None:
        return von_mises(stations.bearing_deg, stations.sigma_deg)
    each = [
        von_mises(stations.bearing_deg, np.full(len(stations.bearing_deg), sigma))
        for sigma in BEARING_FIX.unknown_sigmas_deg
    ]
    return np.asarray(np.mean(each, axis=0))


def _blurred(posterior: _Floats, sigma_deg: float) -> _Floats:
    order = np.arange(posterior.shape[1] // 2 + 1)
    damping = np.exp(-0.5 * (np.radians(sigma_deg) * order) ** 2)
    blurred = np.fft.irfft(np.fft.rfft(posterior, axis=1) * damping, posterior.shape[1], axis=1)
    return np.asarray(np.maximum(blurred, 0.0))


def _forwards_and_backwards(
    priors: tuple[TagPrior, TagPrior],
    times: _Floats,
    take: Callable[[ParticleTracker, int], float],
    plane: TangentPlane,
    origin_ns: int,
) -> tuple[TrackPoint, ...]:
    points_s = _point_times(times)
    forwards = _trail(priors[0], times, points_s, take)
    backwards = _trail(priors[1], -times, [-one for one in reversed(points_s)], take)
    found = []
    for time_s, ahead, back in zip(
        points_s, forwards.places, backwards.places[::-1], strict=True
    ):
        every = ((ahead, forwards.log_evidence), (back, backwards.log_evidence))
        both = tuple(one for one in every if one[0].distinct)
        if not both:
            continue
        share = special.softmax([log + math.log(one.distinct) for one, log in both])
        place = circles_around(
            np.concatenate([one.east_m for one, _ in both]),
            np.concatenate([one.north_m for one, _ in both]),
            np.concatenate(
                [
                    np.full(len(one.east_m), part / len(one.east_m))
                    for (one, _), part in zip(both, share, strict=True)
                ]
            ),
        )
        latitude, longitude = plane.to_geodetic(place.east_m, place.north_m)
        found.append(
            TrackPoint(
                time_ns=origin_ns + round(time_s * NANOSECONDS_PER_SECOND),
                latitude_deg=float(latitude),
                longitude_deg=float(longitude),
                radius50_m=place.radius50_m,
                radius95_m=place.radius95_m,
            )
        )
    return tuple(found)


def _point_times(times: _Floats) -> list[float]:
    """Times of the path's points [s]: the first, the last, and evenly spaced ones between."""
    ordered = np.sort(times)
    step = max(TRACK.point_step_s, float(np.ptp(times)) / TRACK.most_points)
    points_s = [float(ordered[0])]
    for until in ordered[1:]:
        while points_s[-1] + 1.5 * step < until:
            points_s.append(points_s[-1] + step)
        if until >= points_s[-1] + 0.5 * step:
            points_s.append(float(until))
    if points_s[-1] < ordered[-1]:
        points_s.append(float(ordered[-1]))
    return points_s


@dataclass(frozen=True, slots=True, kw_only=True)
class _Trail:
    """Positions at the times of a path by one tracker, and its log evidence."""

    places: list[PastPlaces]
    log_evidence: float


def _trail(
    prior: TagPrior,
    times: _Floats,
    points_s: list[float],
    take: Callable[[ParticleTracker, int], float],
) -> _Trail:
    tracker = ParticleTracker(
        prior, np.random.default_rng(0), particles=TRACK.particles, first=TRACK.first_particles
    )
    waiting, evidence = list(points_s), 0.0
    for number in np.argsort(times, kind="stable"):
        while waiting and waiting[0] < times[number]:
            _remember_at(tracker, waiting.pop(0))
        tracker.advance_to(float(times[number]))
        evidence += take(tracker, int(number))
    for time_s in waiting:
        _remember_at(tracker, time_s)
    return _Trail(places=tracker.past(), log_evidence=evidence)


def _remember_at(tracker: ParticleTracker, time_s: float) -> None:
    tracker.advance_to(time_s)
    tracker.remember()
