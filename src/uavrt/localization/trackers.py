"""Where a tag is, kept up to date while flying: a grid for still tags, particles for all.

Both take bearings and single pulses, and misses as evidence of where the tag is not, which is
worth half the flight time. One tracker for each tag;
tags differ in frequency, so that pulses need no association.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.bayes_fix import Area
from uavrt.localization.bearing_evidence import BearingEvidence
from uavrt.localization.level_belief import LevelBelief, Listening

_Floats = NDArray[np.float64]

_EXPONENTS = (2.0, 2.7, 3.4)
RESTING, BROWSING, TRAVELLING = range(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackEstimate:
    """Where a tag is now, in the tracker's plane."""

    east_m: float
    north_m: float
    radius50_m: float
    """Circle around the point that holds the tag with 50 %."""
    radius95_m: float
    level_db: float
    """SNR that it would have at 100 m."""
    east_m_s: float = 0.0
    """How fast it goes; 0 in the mean of all hypotheses when it rests."""
    north_m_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TagPrior:
    """What is believed before the flight."""

    area: Area
    """The tag is somewhere in it."""
    level_db: float = 45.0
    """SNR at 100 m: a 20 ms collar heard at 9 dB from 3 km (reference §3.7), n = 2.5."""
    level_sigma_db: float = 12.0
    fading_db: float = 4.0
    pattern: AntennaPattern | None = None
    """None is an upright monopole."""
    walking_m_per_root_s: float = 1.0
    """A browsing animal's random walk in each direction, after a second."""
    travelling_m_s: float = 1.0
    """Usual speed of an animal that goes somewhere; 0: it never does."""


def _estimate(
    east_m: _Floats, north_m: _Floats, level_db: _Floats, weight: _Floats
) -> TrackEstimate:
    """Summarise weighted places; the point is the one with the least expected error."""
    x, y = float(weight @ east_m), float(weight @ north_m)
    for _ in range(20):
        pull = weight / np.maximum(np.hypot(east_m - x, north_m - y), 1.0)
        x, y = float(pull @ east_m / pull.sum()), float(pull @ north_m / pull.sum())
    distance = np.hypot(east_m - x, north_m - y)
    order = np.argsort(distance)
    held = np.cumsum(weight[order])
    half, most = np.interp([0.5, 0.95], held, distance[order])
    return TrackEstimate(
        east_m=x,
        north_m=y,
        radius50_m=float(half),
        radius95_m=float(most),
        level_db=float(weight @ level_db),
    )


class GridTracker:
    """Probability of every cell of an area, for a tag that stays.

    Parameters
    ----------
    prior : TagPrior
        Area, strength, antenna.
    cells : int
        Cells along the longer side.
    """

    def __init__(self, prior: TagPrior, *, cells: int = 120) -> None:
        area = prior.area
        self._prior = prior
        width, height = area.east_m - area.west_m, area.north_m - area.south_m
        self._cell_m = max(width, height) / cells
        across, along = (max(2, round(side / self._cell_m)) for side in (width, height))
        east = area.west_m + (np.arange(across) + 0.5) * width / across
        north = area.south_m + (np.arange(along) + 0.5) * height / along
        places_north, places_east = np.meshgrid(north, east, indexing="ij")
        self._east_m, self._north_m = places_east.ravel(), places_north.ravel()
        shape = (len(_EXPONENTS), len(self._east_m))
        self._log_weight = np.zeros(shape)
        self._exponent = np.array(_EXPONENTS)[:, None]
        self._level = LevelBelief(
            mean_db=np.full(shape, prior.level_db),
            variance_db2=np.full(shape, prior.level_sigma_db**2),
        )

    def listen(self, heard: Listening) -> None:
        """Take in a pulse, or that none was heard."""
        expected = self._level.expected_db(
            heard, self._east_m, self._north_m, self._exponent, self._prior.pattern
        )
        self._log_weight += self._level.update(heard, expected, self._prior.fading_db)

    def take_bearing(self, east_m: float, north_m: float, posterior: _Floats) -> None:
        """Take in a bearing's (360,) posterior; its pulses must not be listened to as well."""
        evidence = BearingEvidence(
            np.array([east_m]), np.array([north_m]), posterior[None, :], outlier_share=0.05
        )
        self._log_weight += evidence.log_likelihood(self._east_m, self._north_m, self._cell_m)

    def probability(self) -> _Floats:
        """(cells,) probability, south to north, west to east within."""
        weight = np.exp(self._log_weight - self._log_weight.max()).sum(axis=0)
        return np.asarray(weight / weight.sum())

    def estimate(self) -> TrackEstimate:
        """Say where the tag is, as far as is known."""
        joint = np.exp(self._log_weight - self._log_weight.max())
        joint /= joint.sum()
        weight = joint.sum(axis=0)
        level = (joint * self._level.mean_db).sum(axis=0) / np.maximum(weight, 1e-300)
        return _estimate(self._east_m, self._north_m, level, weight)


@dataclass(slots=True, kw_only=True, eq=False)
class _Particles:
    """Hypotheses of where the tag is, how it moves and how strong it is."""

    east_m: _Floats
    north_m: _Floats
    east_m_s: _Floats
    """Velocity of those that travel, 0 for the others."""
    north_m_s: _Floats
    mode: NDArray[np.int8]
    exponent: _Floats
    level: LevelBelief
    log_weight: _Floats = field(default_factory=lambda: np.zeros(0))

    def chosen(self, index: NDArray[np.intp]) -> "_Particles":
        return _Particles(
            east_m=self.east_m[index],
            north_m=self.north_m[index],
            east_m_s=self.east_m_s[index],
            north_m_s=self.north_m_s[index],
            mode=self.mode[index],
            exponent=self.exponent[index],
            level=LevelBelief(
                mean_db=self.level.mean_db[index], variance_db2=self.level.variance_db2[index]
            ),
            log_weight=np.zeros(len(index)),
        )


class ParticleTracker:
    """Ten thousand hypotheses of a tag that rests, browses or travels, each with its strength.

    Three motions that go over into each other (interacting multiple models): resting, a random
    walk, and a nearly constant velocity.

    Parameters
    ----------
    prior : TagPrior
        Area, strength, antenna, walk.
    rng : Generator
        Randomness; the same seed gives the same track.
    particles : int
        Hypotheses.
    """

    _SWITCHING_PER_S = 0.005
    """An animal changes what it does every three minutes or so."""
    _TURNING_M_S_PER_ROOT_S = 0.08
    """Change of a traveller's velocity in each direction, after a second: 5° at 1 m/s."""
    _LOST_NATS = 12.0
    """A pulse this much less probable than chance alone explains: hypotheses are renewed."""

    def __init__(self, prior: TagPrior, rng: Generator, *, particles: int = 10_000) -> None:
        self._prior, self._rng, self._count = prior, rng, particles
        self._state = self._fresh(particles)
        self._time_s: float | None = None
        self._surprise = 0.0

    def _fresh(self, count: int) -> _Particles:
        area, rng = self._prior.area, self._rng
        mode = self._modes(count)
        velocity = self._velocities(mode)
        return _Particles(
            east_m=rng.uniform(area.west_m, area.east_m, count),
            north_m=rng.uniform(area.south_m, area.north_m, count),
            east_m_s=velocity[0],
            north_m_s=velocity[1],
            mode=mode,
            exponent=np.clip(rng.normal(2.5, 0.5, count), 1.8, 4.0),
            level=LevelBelief(
                mean_db=np.full(count, self._prior.level_db),
                variance_db2=np.full(count, self._prior.level_sigma_db**2),
            ),
            log_weight=np.zeros(count),
        )

    def _modes(self, count: int) -> NDArray[np.int8]:
        """Half rest; the others browse or travel."""
        drawn = self._rng.random(count)
        straight = 0.75 if self._prior.travelling_m_s > 0.0 else 2.0
        mode = np.where(drawn < 0.5, RESTING, np.where(drawn < straight, BROWSING, TRAVELLING))
        return mode.astype(np.int8)

    def _velocities(self, mode: NDArray[np.int8]) -> _Floats:
        """(2, count) any direction for those that travel, speeds about the usual one."""
        sigma = self._prior.travelling_m_s * np.sqrt(2.0 / np.pi)
        return np.asarray(self._rng.normal(0.0, sigma, (2, len(mode))) * (mode == TRAVELLING))

    def advance_to(self, time_s: float) -> None:
        """Let the tag rest or walk until a time, which must not go back."""
        step = 0.0 if self._time_s is None else max(0.0, time_s - self._time_s)
        self._time_s = time_s
        if step == 0.0:
            return
        state, rng = self._state, self._rng
        switching = rng.random(self._count) < 1.0 - np.exp(-self._SWITCHING_PER_S * step)
        if switching.any():
            mode = self._modes(self._count)
            velocity = self._velocities(mode)
            state.mode = np.where(switching, mode, state.mode)
            state.east_m_s = np.where(switching, velocity[0], state.east_m_s)
            state.north_m_s = np.where(switching, velocity[1], state.north_m_s)
        walk = self._prior.walking_m_per_root_s * np.sqrt(step)
        sigma = np.where(state.mode == BROWSING, walk, 0.0)
        turning = self._TURNING_M_S_PER_ROOT_S * np.sqrt(step) * (state.mode == TRAVELLING)
        for place, speed in (("east_m", "east_m_s"), ("north_m", "north_m_s")):
            velocity = getattr(state, speed)
            moved = velocity * step + sigma * rng.normal(size=self._count)
            setattr(state, place, getattr(state, place) + moved)
            setattr(state, speed, velocity + turning * rng.normal(size=self._count))

    def listen(self, heard: Listening) -> None:
        """Take in a pulse, or that none was heard."""
        state = self._state
        expected = state.level.expected_db(
            heard, state.east_m, state.north_m, state.exponent, self._prior.pattern
        )
        self._weigh(state.level.update(heard, expected, self._prior.fading_db))

    def take_bearing(self, east_m: float, north_m: float, posterior: _Floats) -> None:
        """Take in a bearing's (360,) posterior; its pulses must not be listened to as well."""
        evidence = BearingEvidence(
            np.array([east_m]), np.array([north_m]), posterior[None, :], outlier_share=0.05
        )
        state = self._state
        self._weigh(evidence.log_likelihood(state.east_m, state.north_m, 1.0))

    def estimate(self) -> TrackEstimate:
        """Say where the tag is, as far as is known."""
        state, weight = self._state, self._weights()
        found = _estimate(state.east_m, state.north_m, state.level.mean_db, weight)
        return replace(
            found,
            east_m_s=float(weight @ state.east_m_s),
            north_m_s=float(weight @ state.north_m_s),
        )

    def _weights(self) -> _Floats:
        weight = np.exp(self._state.log_weight - self._state.log_weight.max())
        return np.asarray(weight / weight.sum())

    def _weigh(self, log_likelihood: _Floats) -> None:
        before = self._weights()
        expected = float(before @ np.exp(np.maximum(log_likelihood, -700.0)))
        self._state.log_weight = self._state.log_weight + log_likelihood
        weight = self._weights()
        # Surprise is what the data lose against chance alone; it fades with each good pulse.
        chance = np.log(0.02 / 120.0)
        self._surprise = max(0.0, self._surprise + chance + 1.0 - np.log(max(expected, 1e-300)))
        if self._surprise > self._LOST_NATS:
            self._renew(weight)
        elif 1.0 / float(weight @ weight) < self._count / 2:
            self._state = self._resampled(weight, self._count)

    def _resampled(self, weight: _Floats, count: int) -> _Particles:
        """Systematic resampling, with Silverman's smoothing so that copies part ways."""
        state = self._state
        comb = (np.arange(count) + self._rng.random()) / count
        index = np.minimum(np.searchsorted(np.cumsum(weight), comb), self._count - 1)
        chosen = state.chosen(index)
        bandwidth = 0.5 * count ** (-1.0 / 6.0)
        for axis in ("east_m", "north_m"):
            value = getattr(state, axis)
            mean = float(weight @ value)
            sigma = float(np.sqrt(weight @ (value - mean) ** 2))
            # Shrunk towards the mean by as much as the smoothing widens.
            shrink = np.sqrt(1.0 - bandwidth**2 * 0.25)
            smooth = self._rng.normal(0.0, 0.5 * bandwidth * sigma, count)
            setattr(chosen, axis, mean + shrink * (getattr(chosen, axis) - mean) + smooth)
        moving = chosen.mode == TRAVELLING
        for axis in ("east_m_s", "north_m_s"):
            jitter = self._rng.normal(0.0, 0.02, count) * moving
            setattr(chosen, axis, getattr(chosen, axis) + jitter)
        chosen.exponent = np.clip(
            chosen.exponent + self._rng.normal(0.0, 0.03, count), 1.8, 4.0
        )
        return chosen

    def _renew(self, weight: _Floats) -> None:
        """Half of the hypotheses start anew: the tag is not where they were."""
        half = self._count // 2
        kept, fresh = self._resampled(weight, self._count - half), self._fresh(half)
        self._surprise = 0.0
        self._state = _Particles(
            east_m=np.concatenate([kept.east_m, fresh.east_m]),
            north_m=np.concatenate([kept.north_m, fresh.north_m]),
            east_m_s=np.concatenate([kept.east_m_s, fresh.east_m_s]),
            north_m_s=np.concatenate([kept.north_m_s, fresh.north_m_s]),
            mode=np.concatenate([kept.mode, fresh.mode]),
            exponent=np.concatenate([kept.exponent, fresh.exponent]),
            level=LevelBelief(
                mean_db=np.concatenate([kept.level.mean_db, fresh.level.mean_db]),
                variance_db2=np.concatenate(
                    [kept.level.variance_db2, fresh.level.variance_db2]
                ),
            ),
            log_weight=np.zeros(self._count),
        )
