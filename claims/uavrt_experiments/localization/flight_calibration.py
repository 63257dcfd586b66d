"""Ranks of true positions in posteriors of surveys, of trackers, and of moving tags' paths.

The worlds are drawn from the estimator's priors, by code that the estimator does not use.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.core.earth.tangent_plane import TangentPlane
from uavrt.core.units import wrap_degrees_360
from uavrt.localization.antenna import NULL_DB
from uavrt.localization.position.bayes_fix import Area
from uavrt.localization.position.bearings.stations import Stations
from uavrt.localization.position.estimate_position import estimate_position
from uavrt.localization.position.levels.ground_reflection import reflection_shapes
from uavrt.localization.position.levels.level_belief import Listening
from uavrt.localization.position.levels.level_evidence import Propagation
from uavrt.localization.position.trackers import ParticleTracker, TagPrior
from uavrt.localization.position.tuning import COMMON, LEVEL, LOSS, TRACK
from uavrt.localization.results import Position
from uavrt.localization.tuning import FLIGHT, LEVELS
from uavrt_experiments.localization.circle_bars import height_error_m
from uavrt_experiments.localization.position_bars import flown_lines, survey

_Floats = NDArray[np.float64]
_PLANE = TangentPlane(latitude_deg=47.4, longitude_deg=8.5)
_SIDE_M, _SPACING_M = 300.0, 50.0
_AREA = Area(west_m=0.0, east_m=600.0, south_m=0.0, north_m=600.0)
_OWN_DEG = 3.0


def surveyed(
    rng: Generator, place_m: float = FLIGHT.place_sigma_m
) -> tuple[Position, tuple[float, float]]:
    """Fly lines past a tag with errors drawn from the priors; return estimate and truth.

    `place_m`: standard deviation of the error of all positions [m].
    """
    # Uniform in the square; outside, the density falls by a factor e per quarter spacing.
    scale_m = max(0.25 * _SPACING_M * _SIDE_M / (_SIDE_M + _SPACING_M), 10.0)
    while True:
        tag = rng.uniform(-10.0 * scale_m, _SIDE_M + 10.0 * scale_m, 2)
        outside_m = float(np.hypot(*np.maximum(np.maximum(-tag, tag - _SIDE_M), 0.0)))
        if rng.random() < np.exp(-outside_m / scale_m):
            break
    usual = Propagation()
    track = survey(
        rng,
        _SIDE_M,
        _SPACING_M,
        4.0,
        float(rng.choice((0.0, 0.3, 0.5, 0.7, 0.85, 0.93))),
        (float(tag[0]), float(tag[1])),
        height_m=40.0 + height_error_m(rng),
        exponent=float(np.clip(rng.normal(usual.exponent, usual.exponent_sigma), 1.6, 4.5)),
    )
    foreign = rng.random(len(track.snr_db)) < LEVELS.outlier_share
    middle_db = float(np.median(track.snr_db))
    any_db = middle_db + LEVELS.any_strength_db * rng.uniform(-0.5, 0.5, len(foreign))
    shift = rng.normal(0.0, place_m, 2)
    east, north = _PLANE.to_local(track.latitude_deg, track.longitude_deg)
    latitude, longitude = _PLANE.to_geodetic(east + shift[0], north + shift[1])
    track = replace(
        track,
        latitude_deg=latitude,
        longitude_deg=longitude,
        snr_db=np.where(foreign, any_db, track.snr_db),
    )
    return estimate_position(None, track), (float(tag[0]), float(tag[1]))


@dataclass(slots=True, kw_only=True)
class _Animal:
    """An animal that rests, browses or travels, as in a tracker's prior."""

    rng: Generator
    prior: TagPrior
    at_m: _Floats
    mode: int = 0
    velocity_m_s: _Floats
    since_s: float = 0.0

    @classmethod
    def drawn(cls, rng: Generator, prior: TagPrior) -> "_Animal":
        area = prior.area
        at_m = np.array(
            [rng.uniform(area.west_m, area.east_m), rng.uniform(area.south_m, area.north_m)]
        )
        animal = cls(rng=rng, prior=prior, at_m=at_m, velocity_m_s=np.zeros(2))
        animal._choose()
        return animal

    def _choose(self) -> None:
        self.mode = int(self.rng.choice(3, p=np.array(self.prior.motion)))
        sigma = self.prior.travelling_m_s * np.sqrt(2.0 / np.pi)
        self.velocity_m_s = self.rng.normal(0.0, sigma, 2) * (self.mode == 2)

    def walk(self, step_s: float) -> _Floats:
        """Move over a time step, and return the position [m]."""
        rng, prior = self.rng, self.prior
        if rng.random() < 1.0 - np.exp(-TRACK.switching_per_s * step_s):
            self._choose()
        if self.mode == 1:
            self.at_m += prior.walking_m_per_root_s * np.sqrt(step_s) * rng.normal(size=2)
        if self.mode == 2:
            self.at_m += self.velocity_m_s * step_s
            self.velocity_m_s += (
                prior.turning_m_s_per_root_s * np.sqrt(step_s) * rng.normal(size=2)
            )
        self.since_s += step_s
        return self.at_m


def tracker_rank(rng: Generator, *, weaker_db: float = 0.0) -> float:
    """Rank of the true position in a tracker's posterior after 100 pulses over 600 m.

    `weaker_db`: loss of pulses in the western half, unknown to the tracker [dB].
    """
    prior = TagPrior(area=_AREA)
    tracker = ParticleTracker(prior, np.random.default_rng(rng.integers(2**32)), particles=4000)
    animal = _Animal.drawn(rng, prior)
    east, north, time_s = flown_lines(600.0, 150.0)
    level_db = rng.normal(prior.level_db, prior.level_sigma_db)
    exponent = float(rng.normal(prior.exponent, prior.exponent_sigma))
    reflection = reflection_shapes()
    reflected = np.append(1.0, rng.normal(size=reflection.components))
    law = LOSS.shadowing
    shadow, kept = rng.normal(law.mean, law.sigma), np.exp(-27.0 / law.correlation_m)
    for number in range(0, len(time_s), 3):
        here = animal.walk(4.5 if number else 0.0)
        ground = float(np.hypot(here[0] - east[number], here[1] - north[number]))
        slant = float(np.hypot(ground, 40.0))
        gain_db = max(20.0 * np.log10(max(ground / slant, 1e-6)), NULL_DB)
        snr_db = level_db - 10.0 * exponent * np.log10(slant / 100.0) + gain_db
        snr_db += rng.normal(0.0, prior.fading_db) - prior.shadowing_db * shadow
        snr_db += float(reflected @ reflection.at(np.array(40.0 / slant)))
        snr_db -= weaker_db * float(east[number] < 300.0)
        heard = snr_db >= 10.0 and rng.random() >= prior.missed_share
        if rng.random() < prior.chance_share:
            over = rng.exponential(LEVEL.false_pulse_db)
            snr_db = 10.0 + (over if rng.random() < 0.5 else rng.uniform(0.0, 60.0))
            heard = True
        shadow = law.mean + kept * (shadow - law.mean)
        shadow += law.sigma * float(np.sqrt(1.0 - kept**2)) * rng.normal()
        tracker.advance_to(float(time_s[number]))
        tracker.listen(
            Listening(
                east_m=float(east[number]),
                north_m=float(north[number]),
                height_m=40.0,
                snr_db=float(snr_db) if heard else None,
            )
        )
    drawn = tracker.hypotheses(1200)
    places = np.stack([drawn.east_m, drawn.north_m], axis=1).astype(np.float64)
    return rank_among(rng, places, animal.at_m)


def rank_among(rng: Generator, places: _Floats, truth: _Floats) -> float:
    """Share of a posterior's draws at positions with a higher density than the true one.

    The density is estimated from half of the draws, and evaluated at the other half.
    """
    order = rng.permutation(len(places))
    known, tried = places[order[::2]], np.vstack([truth, places[order[1::2]]])
    width_m = np.maximum(0.3 * np.median(np.abs(known - np.median(known, axis=0)), axis=0), 1.0)
    off = (tried[:, np.newaxis] - known) / width_m
    # Far from all draws, the nearest one decides.
    density = np.log(np.exp(-0.5 * (off**2).sum(axis=2)).sum(axis=1) + 1e-300)
    density -= 1e-9 * (off**2).sum(axis=2).min(axis=1)
    return float((np.sum(density[1:] > density[0]) + rng.random()) / len(tried))


def path_rank(rng: Generator, *, turned_deg: float = 0.0) -> float:
    """Rank of the true position at the end of a path by eight bearings.

    As only the circles of 50 and 95 % are known, the rank is drawn evenly between their
    probabilities. `turned_deg`: error of all headings, added to the usual one.
    """
    prior = TagPrior(
        area=Area(west_m=-150.0, east_m=150.0, south_m=-150.0, north_m=150.0),
        turning_m_s_per_root_s=TRACK.turning_m_s_per_root_s,
    )
    animal = _Animal.drawn(rng, prior)
    angle = rng.uniform(0.0, 2.0 * np.pi) + np.arange(8) * 2.4
    east, north = 400.0 * np.sin(angle), 400.0 * np.cos(angle)
    bearing, time_s = np.empty(8), np.arange(8.0) * 60.0
    for number in range(8):
        for _ in range(20 if number else 0):
            animal.walk(3.0)
        here = animal.at_m
        bearing[number] = np.degrees(
            np.arctan2(here[0] - east[number], here[1] - north[number])
        )
    # The tracker treats the common heading error as independent for each bearing.
    sigma_deg = float(np.hypot(_OWN_DEG, COMMON.heading_sigma_deg))
    bearing += rng.normal(0.0, sigma_deg, 8) + turned_deg
    gross = rng.random(8) < 0.05
    bearing = np.where(gross, rng.uniform(0.0, 360.0, 8), bearing)
    shift = rng.normal(0.0, FLIGHT.place_sigma_m, 2)
    latitude, longitude = _PLANE.to_geodetic(east + shift[0], north + shift[1])
    found = estimate_position(
        Stations(
            latitude_deg=latitude,
            longitude_deg=longitude,
            bearing_deg=wrap_degrees_360(bearing),
            sigma_deg=np.full(8, _OWN_DEG),
            time_s=np.asarray(time_s, np.float64),
        ),
        method="track",
    )
    end = found.track[-1]
    x, y = _PLANE.to_local(end.latitude_deg, end.longitude_deg)
    off_m = float(np.hypot(x - animal.at_m[0], y - animal.at_m[1]))
    within = int(off_m > end.radius50_m) + int(off_m > end.radius95_m)
    return float(rng.uniform(*((0.0, 0.5), (0.5, 0.95), (0.95, 1.0))[within]))
