"""Estimate the path of a moving animal from the bearings or powers of a whole flight.

A particle tracker follows the animal, and each surviving hypothesis has a path through the
whole flight. Long before the last pulse, only few different paths survive, and a tracker may
have lost the true one among similar paths. So one tracker runs forwards in time and one
backwards. At each time, their paths are weighted by the trackers' evidence and by the number of
different positions.
"""

import math
from collections.abc import Callable, Sequence
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
    stations: Stations, plane: TangentPlane, near: Area, *, heading_sigma_deg: float
) -> tuple[TrackPoint, ...]:
    """Estimate the path of a tag near an area from the bearings of a flight."""
    times = _checked(stations.time_s, "bearings")
    east, north = plane.to_local(stations.latitude_deg, stations.longitude_deg)
    posterior = _blurred(_posteriors(stations), heading_sigma_deg)
    prior = TagPrior(
        area=_widened(near, TRACK.margin_m + 0.5 * TRACK.fastest_m_s * float(np.ptp(times))),
        turning_m_s_per_root_s=TRACK.turning_m_s_per_root_s,
        reflects=False,
    )

    def take(tracker: ParticleTracker, number: int) -> float:
        return tracker.take_bearing(
            float(east[number]), float(north[number]), posterior[number]
        )

    return _forwards_and_backwards((prior, prior), times, take, plane, stations.origin_ns)


def path_by_powers(
    powers: PowerTrack,
    plane: TangentPlane,
    first: Area,
    last: Area | None,
    *,
    fading_db: float,
    hills: HillLosses | None = None,
) -> tuple[TrackPoint, ...]:
    """Estimate the path of a tag from the pulses of a flight, including missed pulses.

    `first` and `last` are areas that contain the tag at the first and at the last pulse.
    Without `last`, the tag is at most as far from `first` as an animal can walk during the
    flight.
    """
    times = _checked(powers.time_s, "pulses")
    east, north = plane.to_local(powers.latitude_deg, powers.longitude_deg)
    thresholds_db = np.broadcast_to(powers.threshold_db, times.shape)
    prior = TagPrior(
        area=first,
        fading_db=TRACK.fading_factor * fading_db,
        shadowing_db=0.0,
        reflects=False,
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

    walked_m = 0.5 * TRACK.fastest_m_s * float(np.ptp(times))
    priors = (prior, replace(prior, area=last or _widened(first, walked_m)))
    began = first if last is None else None
    return _forwards_and_backwards(priors, times, take, plane, powers.origin_ns, began)


def _checked(times: _Floats | None, what: str) -> _Floats:
    if times is None or len(times) < TRACK.least_times:
        raise UsageError(
            f"a track needs the times of three or more {what} of one flight",
            remedy="Name a single flight, or use the method bayes for a tag at rest",
        )
    return times


def _widened(area: Area, margin_m: float) -> Area:
    return Area(
        west_m=area.west_m - margin_m,
        east_m=area.east_m + margin_m,
        south_m=area.south_m - margin_m,
        north_m=area.north_m + margin_m,
    )


def around(places: Sequence[tuple[float, float]], margin_m: float) -> Area:
    """Rectangle that contains positions (east, north), with a margin on all sides [m]."""
    east, north = (np.asarray(one, np.float64) for one in zip(*places, strict=True))
    return _widened(
        Area(
            west_m=float(east.min()),
            east_m=float(east.max()),
            south_m=float(north.min()),
            north_m=float(north.max()),
        ),
        margin_m,
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
    began: Area | None = None,
) -> tuple[TrackPoint, ...]:
    """Estimate a path with one tracker that runs forwards and one that runs backwards in time.

    `began` is the area in which the path begins; at its end, the backward tracker is confined
    to it.
    """
    points_s = _point_times(times)
    forwards = _trail(priors[0], times, points_s, take)
    reverse_s = [-one for one in reversed(points_s)]
    backwards = _trail(priors[1], -times, reverse_s, take, began)
    found = []
    for time_s, ahead, back in zip(
        points_s, forwards.places, backwards.places[::-1], strict=True
    ):
        runs = ((ahead, forwards.log_evidence), (back, backwards.log_evidence))
        both = [one for one in runs if one[0].distinct]
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
    """Times of the path's points [s]: the first and the last, with evenly spaced times between
    them.
    """
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
    """Positions that one tracker estimates at the times of a path, and the tracker's log
    evidence.
    """

    places: list[PastPlaces]
    log_evidence: float


def _trail(
    prior: TagPrior,
    times: _Floats,
    points_s: list[float],
    take: Callable[[ParticleTracker, int], float],
    ends_in: Area | None = None,
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
    if ends_in is not None:
        evidence += tracker.confine(ends_in)
    area = prior.area  # evidence per square metre, since the trackers begin in unequal areas
    wide_m, high_m = area.east_m - area.west_m, area.north_m - area.south_m
    return _Trail(places=tracker.past(), log_evidence=evidence + math.log(wide_m * high_m))


def _remember_at(tracker: ParticleTracker, time_s: float) -> None:
    tracker.advance_to(time_s)
    tracker.remember()
