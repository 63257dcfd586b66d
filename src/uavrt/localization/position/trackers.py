"""Track a tag's position during the flight with a particle filter.

Inputs are bearings, received pulses, and missed pulses, which show where the tag is not and
halve the flight time. There is one tracker for each tag; tags differ in frequency, so pulses
need not be associated with tags.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.localization.antenna import AntennaPattern
from uavrt.localization.position.bayes_fix import Area, shifted_m
from uavrt.localization.position.bearings.bearing_evidence import BearingEvidence
from uavrt.localization.position.levels.ground_models import (
    GroundModel,
    HillyGround,
    LevelGround,
)
from uavrt.localization.position.levels.ground_reflection import reflection_shapes
from uavrt.localization.position.levels.level_belief import (
    EXPONENT,
    LASTING,
    LEVEL_AT_100_M,
    ExpectedLevel,
    LevelBelief,
    Listening,
    false_pulse_density,
)
from uavrt.localization.position.tuning import TRACK
from uavrt.localization.terrain.hill_losses import HillLosses
from uavrt.localization.tuning import LEVELS

_Floats = NDArray[np.floating[Any]]
_Singles = NDArray[np.float32]
PathGain = Callable[[_Floats, _Floats, _Floats | float], _Floats]
"""Function from distances east, north and height [m] to the level relative to the distance law
[dB]."""

RESTING, BROWSING, TRAVELLING = range(3)


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackEstimate:
    """Present position and strength of a tag, in the tracker's plane."""

    east_m: float
    north_m: float
    radius50_m: float
    """Radius of the circle around the estimate that contains the tag with 50 % probability
    [m]."""
    radius95_m: float
    level_db: float
    """SNR of the tag's pulses at a distance of 100 m [dB]."""
    east_m_s: float = 0.0
    """Velocity towards east, averaged over all hypotheses [m/s]; hypotheses of a resting tag
    count as 0."""
    north_m_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class TagPrior:
    """Assumptions about a tag's area, strength and motion before the flight."""

    area: Area
    level_db: float = 45.0
    """Mean SNR at 100 m [dB]: that of a collar with 20 ms pulses whose SNR at 3 km is 9 dB, for
    a path loss exponent of 2.4."""
    level_sigma_db: float = 12.0
    level_drift_db_per_root_s: float = 0.0
    """Random walk of a tag's strength [dB/√s], since the animal turns and moves behind
    plants."""
    fading_db: float = LEVELS.fading_db
    pattern: AntennaPattern | None = None
    """Pattern of the receiving antenna; None for an upright monopole."""
    walking_m_per_root_s: float = 1.0
    """Random walk of a browsing animal in each direction [m/√s]."""
    travelling_m_s: float = 1.0
    """Usual speed of a travelling animal [m/s]; 0 if it never travels."""
    turning_m_s_per_root_s: float = 0.08
    """Random change of a travelling animal's velocity in each direction [m/s/√s], about 5° in
    the first second at 1 m/s."""
    motion: tuple[float, float, float] = (0.5, 0.25, 0.25)
    """Shares of the time in which an animal rests, browses, and travels."""
    exponent: float = 3.0
    exponent_sigma: float = LEVELS.exponent_sigma
    """Prior standard deviation of the path loss exponent; 0 if it is known."""
    missed_share: float = LEVELS.outlier_share
    """Share of a tag's pulses that are missed by chance, however strong they are."""
    chance_share: float = LEVELS.outlier_share
    """Share of received pulses that are not the tag's, such as false alarms and interferers."""
    path_gain: PathGain | None = None
    """Propagation model that gives the level relative to the distance law; None for the
    distance law alone."""
    hills: HillLosses | None = None
    """Ground model; None: level ground. Heights count from a tag at the take-off."""
    shadowing_db: float = 1.5
    """Standard deviation of the shadowing on level ground [dB]; 0: none."""
    reflects: bool = True
    """True if level ground may reflect; unknown are the tag's height and the ground's
    roughness."""

    @property
    def ground(self) -> GroundModel:
        """Losses by hills, or shadowing and reflection by level ground."""
        if self.hills is not None:
            return HillyGround(hills=self.hills)
        return LevelGround(
            shadowing_db=self.shadowing_db,
            reflection=reflection_shapes() if self.reflects else None,
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Circles:
    """Point estimate of a position, and the radii of the 50 % and 95 % circles around it."""

    east_m: float
    north_m: float
    radius50_m: float
    radius95_m: float


def circles_around(east_m: _Floats, north_m: _Floats, weight: _Floats) -> Circles:
    """Return the point with the smallest expected error for weighted positions, and the circles
    around it.
    """
    x, y = float(weight @ east_m), float(weight @ north_m)
    for _ in range(20):
        pull = weight / np.maximum(np.sqrt((east_m - x) ** 2 + (north_m - y) ** 2), 1.0)
        whole = float(pull.sum())
        was, x, y = (x, y), float(pull @ east_m) / whole, float(pull @ north_m) / whole
        if abs(x - was[0]) + abs(y - was[1]) < TRACK.settled_m:
            break
    distance = np.sqrt((east_m - x) ** 2 + (north_m - y) ** 2)
    order = np.argsort(distance)
    held = np.cumsum(weight[order])
    half, most = np.interp([0.5, 0.95], held, distance[order])
    return Circles(
        east_m=x,
        north_m=y,
        radius50_m=shifted_m(float(half), 0.5),
        radius95_m=shifted_m(float(most), 0.95),
    )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypotheses:
    """Equally probable hypotheses of a tag's position and strength, drawn from a tracker."""

    east_m: _Singles
    north_m: _Singles
    level: LevelBelief
    """Unknowns of the level, given the exponent, which is drawn."""
    east_m_s: _Singles
    north_m_s: _Singles
    wandering_m_per_root_s: _Singles
    """Random walk of the tag in each direction, for each hypothesis [m/√s]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """A tracker's prediction of a pulse, made before the pulse updates the tracker."""

    level_db: float
    """Mean of the pulse's expected SNR over all hypotheses [dB]."""
    variance_db2: float
    """Variance of the pulse's expected SNR, including fading [dB²]."""
    log_probability: float
    """Log-probability of a missed pulse, or log-density of a received pulse's level [1/dB], if
    the tag exists."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Spread:
    """Mean and covariance of a tag's position, which take little time to compute."""

    east_m: float
    north_m: float
    east_m2: float
    """Variance of the tag's east coordinate [m²]."""
    north_m2: float
    product_m2: float

    @property
    def determinant_m4(self) -> float:
        """Determinant of the covariance of the tag's position [m⁴]."""
        return max(0.0, self.east_m2 * self.north_m2 - self.product_m2**2)

    @property
    def major_sigma_m(self) -> float:
        """Standard deviation along the longer axis [m]."""
        middle = 0.5 * (self.east_m2 + self.north_m2)
        off = np.hypot(0.5 * (self.east_m2 - self.north_m2), self.product_m2)
        return float(np.sqrt(middle + off))

    @property
    def rms_m(self) -> float:
        """Root mean square distance of the tag from the mean position [m]."""
        return float(np.sqrt(self.east_m2 + self.north_m2))


def _spread(east_m: _Floats, north_m: _Floats, weight: _Floats) -> Spread:
    east, north = float(weight @ east_m), float(weight @ north_m)
    dx, dy = east_m - east, north_m - north
    weighted = weight * dx
    return Spread(
        east_m=east,
        north_m=north,
        east_m2=float(weighted @ dx),
        north_m2=float((weight * dy) @ dy),
        product_m2=float(weighted @ dy),
    )


@dataclass(slots=True, kw_only=True, eq=False)
class _Particles:
    east_m: _Singles
    north_m: _Singles
    east_m_s: _Singles
    """Velocity towards east of hypotheses that travel [m/s]; 0 for all others."""
    north_m_s: _Singles
    mode: NDArray[np.int8]
    level_mean: _Singles
    level_covariance: _Singles
    origin: NDArray[np.int32]
    """Index of each hypothesis's ancestor at the last stored time; -1 for a new hypothesis."""

    @property
    def level(self) -> LevelBelief:
        """Unknowns of each hypothesis' level; a view, updated in place."""
        return LevelBelief(mean=self.level_mean, covariance=self.level_covariance)

    def chosen(self, index: NDArray[np.intp]) -> "_Particles":
        return _Particles(
            **{one.name: getattr(self, one.name)[..., index] for one in fields(self)}
        )

    def joined(self, other: "_Particles") -> "_Particles":
        return _Particles(
            **{
                one.name: np.concatenate(
                    [getattr(self, one.name), getattr(other, one.name)], axis=-1
                )
                for one in fields(self)
            }
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Remembered:
    """Positions of all hypotheses at a stored time, with the index of each one's ancestor."""

    east_m: _Singles
    north_m: _Singles
    origin: NDArray[np.int32]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PastPlaces:
    """Equally probable earlier positions of a tag, traced back from a tracker's hypotheses."""

    east_m: _Singles
    north_m: _Singles
    distinct: int
    """Number of different positions, each of a hypothesis that later data did not rule out."""


class _MotionModel:
    """Moves hypotheses according to rest, random walk or travel, and to changes between
    these.
    """

    def __init__(self, prior: TagPrior, rng: Generator) -> None:
        self._prior, self._rng = prior, rng
        self._external_exponent = (0.0, 0.0)
        """Precision, and precision times mean, of the path loss exponent by other tags."""
        self._since_s = 0.0

    def normal(self, count: int) -> _Singles:
        return self._rng.standard_normal(count, dtype=np.float32)

    def fresh(self, count: int) -> _Particles:
        prior, rng = self._prior, self._rng
        area = prior.area
        mode = self._modes(count)
        velocity = self._velocities(mode)
        level = self._level_before(count)
        return _Particles(
            east_m=rng.uniform(area.west_m, area.east_m, count).astype(np.float32),
            north_m=rng.uniform(area.south_m, area.north_m, count).astype(np.float32),
            east_m_s=velocity[0],
            north_m_s=velocity[1],
            mode=mode,
            level_mean=level.mean,
            level_covariance=level.covariance,
            origin=np.full(count, -1, np.int32),
        )

    def _level_before(self, count: int) -> LevelBelief:
        """Unknowns of the level before any pulse."""
        prior, ground = self._prior, self._prior.ground
        exponent, exponent_sigma = self._exponent_before()
        means, sigmas = [prior.level_db, exponent], [prior.level_sigma_db, exponent_sigma]
        if ground.lasting_error is not None:
            means.append(ground.lasting_error.mean)
            sigmas.append(ground.lasting_error.sigma)
        if ground.reflection is not None:
            means += [0.0] * ground.reflection.components
            sigmas += [1.0] * ground.reflection.components
        return LevelBelief.before_pulses(means, sigmas, count)

    def _modes(self, count: int) -> NDArray[np.int8]:
        rest, browse, travel = self._prior.motion
        if self._prior.travelling_m_s <= 0.0:
            browse, travel = browse + travel, 0.0
        shares = np.cumsum([rest, browse, travel])
        if max(rest, browse, travel) >= shares[-1]:
            return np.full(count, int(np.argmax([rest, browse, travel])), np.int8)
        drawn = self._rng.random(count) * shares[-1]
        return np.asarray(np.searchsorted(shares[:2], drawn, side="right"), np.int8)

    def _velocities(self, mode: NDArray[np.int8]) -> _Singles:
        velocity = np.zeros((2, len(mode)), np.float32)
        moving = np.flatnonzero(mode == TRAVELLING)
        sigma = self._prior.travelling_m_s * float(np.sqrt(2.0 / np.pi))
        for axis in velocity:
            axis[moving] = sigma * self.normal(len(moving))
        return velocity

    def advance(self, state: _Particles, step: float) -> None:
        """Move the hypotheses over a time step [s]."""
        self._drift(state, step)
        self._switch(state, step)
        walk = self._prior.walking_m_per_root_s * float(np.sqrt(step))
        browsing = state.mode == BROWSING
        if walk > 0.0 and browsing.any():
            if browsing.all():
                state.east_m += walk * self.normal(len(state.mode))
                state.north_m += walk * self.normal(len(state.mode))
            else:
                those = np.flatnonzero(browsing)
                state.east_m[those] += walk * self.normal(len(those))
                state.north_m[those] += walk * self.normal(len(those))
        those = np.flatnonzero(state.mode == TRAVELLING)
        if len(those):
            turning = self._prior.turning_m_s_per_root_s * float(np.sqrt(step))
            for place, speed in (
                (state.east_m, state.east_m_s),
                (state.north_m, state.north_m_s),
            ):
                place[those] += speed[those] * float(step)
                speed[those] += turning * self.normal(len(those))
        self._since_s += step
        prior, area = self._prior, self._prior.area
        strays = (
            TRACK.strays_sigmas * prior.walking_m_per_root_s * float(np.sqrt(self._since_s))
        )
        strays += 2.0 * prior.travelling_m_s * self._since_s
        _turn_back_inside(state.east_m, area.west_m - strays, area.east_m + strays)
        _turn_back_inside(state.north_m, area.south_m - strays, area.north_m + strays)

    def _drift(self, state: _Particles, step: float) -> None:
        """Let the strength walk randomly around its prior mean, limited to the prior's
        variance.
        """
        drift2 = self._prior.level_drift_db_per_root_s**2 * step
        usual, most = float(self._prior.level_db), float(self._prior.level_sigma_db)
        if drift2 > 0.0 and most > 0.0:
            kept = float(np.sqrt(max(0.0, 1.0 - drift2 / most**2)))
            state.level.relax(LEVEL_AT_100_M, usual, most, kept)

    def _switch(self, state: _Particles, step: float) -> None:
        if max(self._prior.motion) >= sum(self._prior.motion):
            return
        count = len(state.mode)
        chance = 1.0 - float(np.exp(-TRACK.switching_per_s * step))
        those = self._rng.choice(count, self._rng.binomial(count, chance), False)
        mode = self._modes(len(those))
        velocity = self._velocities(mode)
        state.mode[those] = mode
        state.east_m_s[those], state.north_m_s[those] = velocity

    def learn_exponent(self, precision: float, weighted: float) -> None:
        """Add other tags' information on the path loss exponent (precision, precision × mean)
        to the prior.
        """
        known, before = self._external_exponent
        self._external_exponent = (known + precision, before + weighted)

    def _exponent_before(self) -> tuple[float, float]:
        """Mean and standard deviation of the path loss exponent, from the prior and other
        tags.
        """
        prior = self._prior
        if prior.exponent_sigma == 0.0:
            return prior.exponent, 0.0
        known, weighted = self._external_exponent
        own = 1.0 / prior.exponent_sigma**2
        precision = own + known
        return (own * prior.exponent + weighted) / precision, float(np.sqrt(1.0 / precision))

    def resampled(self, state: _Particles, weight: _Singles, count: int) -> _Particles:
        """Resample the hypotheses systematically; Silverman's smoothing separates copies of the
        same one.
        """
        chosen = state.chosen(
            _systematic_indices(weight, (np.arange(count) + self._rng.random()) / count)
        )
        bandwidth = 0.5 * count ** (-1.0 / 6.0)
        # Shrunk towards the mean by as much as the smoothing widens.
        shrink = float(np.sqrt(1.0 - bandwidth**2 * 0.25))
        for axis in ("east_m", "north_m"):
            value = getattr(state, axis)
            mean = float(weight @ value)
            sigma = float(np.sqrt(weight @ (value - mean) ** 2))
            smooth = (0.5 * bandwidth * sigma) * self.normal(count)
            setattr(chosen, axis, mean + shrink * (getattr(chosen, axis) - mean) + smooth)
        moving = np.flatnonzero(chosen.mode == TRAVELLING)
        for velocity in (chosen.east_m_s, chosen.north_m_s):
            velocity[moving] += 0.02 * self.normal(len(moving))
        return chosen


def _turn_back_inside(place: _Singles, least: float, most: float) -> None:
    """Reflect hypotheses back that are farther outside the area than an animal can have
    walked.
    """
    if float(place.min()) < least:
        np.copyto(place, 2.0 * least - place, where=place < least)
    if float(place.max()) > most:
        np.copyto(place, 2.0 * most - place, where=place > most)


def _systematic_indices(weight: _Singles, places: _Floats) -> NDArray[np.intp]:
    """Indices of the hypotheses at given fractions (0 to 1) of the cumulative weight."""
    return np.minimum(np.searchsorted(np.cumsum(weight), places), len(weight) - 1)


class _StoredPaths:
    """Stored positions of the hypotheses, from which paths are traced back through
    ancestors.
    """

    def __init__(self) -> None:
        self._remembered: list[_Remembered] = []

    def remember(self, state: _Particles) -> None:
        self._remembered.append(
            _Remembered(
                east_m=state.east_m.copy(), north_m=state.north_m.copy(), origin=state.origin
            )
        )
        state.origin = np.arange(len(state.mode), dtype=np.int32)

    def traced(self, state: _Particles, kept: NDArray[np.intp]) -> "list[PastPlaces]":
        index, found = state.origin[kept], []
        for then in reversed(self._remembered):
            past = index[index >= 0]
            found.append(
                PastPlaces(
                    east_m=then.east_m[past],
                    north_m=then.north_m[past],
                    distinct=len(np.unique(past)),
                )
            )
            index = np.where(index >= 0, then.origin[np.maximum(index, 0)], -1)
        return found[::-1]


class ParticleTracker:
    """Particle filter with hypotheses of a tag that rests, browses or travels, each with the
    unknowns of its level.

    `prior`: assumptions about area, strength, antenna and motion. `rng`: random numbers; the
    same seed gives the same track. `particles`: number of hypotheses; with 10 000, a pulse
    takes 0.8 ms in single precision. `first`: number of hypotheses at the beginning, if larger;
    each resampling halves it, down to `particles`, since a wide prior needs more hypotheses.
    """

    def __init__(
        self, prior: TagPrior, rng: Generator, *, particles: int, first: int = 0
    ) -> None:
        self._prior, self._rng, self._least = prior, rng, particles
        self._walk = _MotionModel(prior, rng)
        self._count = max(first, particles)
        self._state = self._walk.fresh(self._count)
        self._even()
        self._time_s: float | None = None
        self._surprise = 0.0
        self._past = _StoredPaths()
        self._heard_from_m: tuple[float, float] | None = None

    @property
    def prior(self) -> TagPrior:
        """Assumptions about the tag before the flight."""
        return self._prior

    def advance_to(self, time_s: float) -> None:
        """Move the hypotheses forward to a time [s]; times must not decrease."""
        step = 0.0 if self._time_s is None else max(0.0, time_s - self._time_s)
        self._time_s = time_s
        if step > 0.0:
            self._walk.advance(self._state, step)

    def listen(self, heard: Listening, *, elsewhere: float = 0.0) -> Expectation:
        """Update with a received or missed pulse; return what was expected before the update.

        `elsewhere` is the density [1/dB] of pulses of this level from another source, in
        addition to false alarms.
        """
        prior = self._prior
        self._decorrelate(heard)
        expected = self._expected(heard)
        mean = float(self._weight @ expected.level_db)
        spread2 = (expected.level_db - mean) ** 2 + expected.variance_db2 + prior.fading_db**2
        variance = float(self._weight @ spread2)
        likelihood = self._state.level.update(
            heard,
            expected,
            prior.fading_db,
            missed_share=prior.missed_share,
            chance_share=prior.chance_share,
            elsewhere=elsewhere,
        )
        evidence = self._weigh(likelihood)
        if heard.snr_db is None:
            self._add_surprise(min(-evidence, TRACK.unheard_nats) - TRACK.decay_nats)
        else:
            chance = max(prior.chance_share, LEVELS.outlier_share) * false_pulse_density(heard)
            by_others = chance + elsewhere
            self._add_surprise(float(np.log(by_others)) + chance / by_others - evidence)
        return Expectation(level_db=mean, variance_db2=variance, log_probability=evidence)

    def density(self, heard: Listening) -> float:
        """Probability density of this pulse's level if the tag sent it [1/dB]; no update."""
        expected = self._expected(heard)
        both = self._state.level.update(
            heard,
            expected,
            self._prior.fading_db,
            missed_share=self._prior.missed_share,
            chance_share=0.0,
            learns=False,
        )
        return float(self._weight @ np.exp(both))

    def _decorrelate(self, heard: Listening) -> None:
        """Decorrelate the lasting error by the drone's movement since the last pulse."""
        law, was_m = self._prior.ground.lasting_error, self._heard_from_m
        if law is None:
            return
        self._heard_from_m = float(heard.east_m), float(heard.north_m)
        level = self._state.level
        np.clip(level.mean[LASTING], *law.limits, out=level.mean[LASTING])
        if was_m is not None and was_m != self._heard_from_m:
            moved_m = math.dist(was_m, self._heard_from_m)
            kept = math.exp(-moved_m / law.correlation_m)
            level.relax(LASTING, law.mean, law.sigma, kept)

    def _expected(self, heard: Listening) -> ExpectedLevel:
        """Expected levels of one pulse."""
        state, prior = self._state, self._prior
        ground = prior.ground.effect(heard, state.east_m, state.north_m)
        expected = state.level.expected(
            heard, state.east_m, state.north_m, prior.pattern, ground
        )
        if prior.path_gain is not None:
            gain_db = prior.path_gain(
                state.east_m - float(heard.east_m),
                state.north_m - float(heard.north_m),
                float(heard.height_m),
            )
            expected = replace(expected, level_db=expected.level_db + gain_db)
        return expected

    def take_bearing(
        self, east_m: float, north_m: float, posterior: NDArray[np.float64]
    ) -> float:
        """Update with the posterior (360,) of a bearing, whose pulses must not be used as well.

        Returns the logarithm of its probability density per degree if the tag is there.
        """
        evidence = BearingEvidence(
            np.array([east_m]), np.array([north_m]), posterior[None, :], outlier_share=0.05
        )
        east = self._state.east_m.astype(np.float64)
        north = self._state.north_m.astype(np.float64)
        gained = self._weigh(evidence.log_likelihood(east, north, 1.0))
        self._add_surprise(
            float(np.log(LEVELS.outlier_share / LEVELS.any_strength_db)) + 1.0 - gained
        )
        return gained

    def confine(self, area: Area) -> float:
        """Exclude hypotheses outside an area; return the log of the probability inside."""
        state = self._state
        inside = (state.east_m >= area.west_m) & (state.east_m <= area.east_m)
        inside &= (state.north_m >= area.south_m) & (state.north_m <= area.north_m)
        return self._weigh(np.where(inside, np.float32(0.0), np.float32(-80.0)))

    def exponent(self) -> tuple[float, float]:
        """Mean and variance of the path loss exponent over the hypotheses."""
        level, weight = self._state.level, self._weight
        mean = float(weight @ level.mean[EXPONENT])
        spread2 = level.variance(EXPONENT) + (level.mean[EXPONENT] - mean) ** 2
        return mean, float(weight @ spread2)

    def take_exponent(self, precision: float, weighted: float) -> None:
        """Update the path loss exponent by other tags' (precision, precision × mean)."""
        self._walk.learn_exponent(precision, weighted)
        self._weigh(self._state.level.take(EXPONENT, precision, weighted))
        self._spread_out()

    def estimate(self) -> TrackEstimate:
        """Estimate the tag's present position."""
        state, weight = self._state, self._weight
        found = circles_around(state.east_m, state.north_m, weight)
        return TrackEstimate(
            east_m=found.east_m,
            north_m=found.north_m,
            radius50_m=found.radius50_m,
            radius95_m=found.radius95_m,
            level_db=float(weight @ state.level_mean[LEVEL_AT_100_M]),
            east_m_s=float(weight @ state.east_m_s),
            north_m_s=float(weight @ state.north_m_s),
        )

    def remember(self) -> None:
        """Store the present positions of the hypotheses, for use by `past`."""
        self._past.remember(self._state)

    def past(self) -> list[PastPlaces]:
        """Return the tag's positions at each stored time, estimated from all data until now.

        Each present hypothesis has a path, and these paths give the earlier positions (the
        paths of the filter; Kitagawa 1996, J. Comput. Graph. Stat. 5, 1-25). A time has no
        positions if all hypotheses were replaced after it.
        """
        kept = _systematic_indices(self._weight, (np.arange(TRACK.paths) + 0.5) / TRACK.paths)
        return self._past.traced(self._state, kept)

    def spread(self) -> Spread:
        """Mean and covariance of the hypotheses' positions."""
        return _spread(self._state.east_m, self._state.north_m, self._weight)

    def hypotheses(self, count: int) -> Hypotheses:
        """Select a few hypotheses in proportion to their weights, without random numbers."""
        state = self._state
        index = _systematic_indices(self._weight, (np.arange(count) + 0.5) / count)
        walk = self._prior.walking_m_per_root_s
        return Hypotheses(
            east_m=state.east_m[index],
            north_m=state.north_m[index],
            level=state.level.at(index).drawn(EXPONENT, np.random.default_rng(0)),
            east_m_s=state.east_m_s[index],
            north_m_s=state.north_m_s[index],
            wandering_m_per_root_s=np.where(state.mode[index] == BROWSING, walk, 0.0).astype(
                np.float32
            ),
        )

    def replace_at_random(self, share: float) -> None:
        """Move a share of the hypotheses to random positions, as TrackerBots does."""
        count = round(share * self._count)
        those = self._rng.choice(self._count, count, replace=False)
        kept = np.setdiff1d(np.arange(self._count), those)
        whole = self._walk.resampled(self._state, self._weight, self._count)
        fresh = self._walk.fresh(count)
        self._state = whole.chosen(kept).joined(fresh)
        self._even()

    def _even(self) -> None:
        self._weight: _Singles = np.full(self._count, 1.0 / self._count, np.float32)

    def _weigh(self, log_likelihood: _Floats) -> float:
        top = float(log_likelihood.max())
        gained = self._weight * np.exp(log_likelihood - top)
        whole = float(gained.sum())
        evidence = top + float(np.log(max(whole, 1e-37)))
        self._weight = (gained / max(whole, 1e-37)).astype(np.float32)
        return evidence

    def _add_surprise(self, nats: float) -> None:
        """Add to the log-likelihood ratio of clutter to tag; redraw all above a limit."""
        self._surprise = max(0.0, self._surprise + nats)
        if self._surprise > TRACK.lost_nats:
            self._renew()
        else:
            self._spread_out()

    def _spread_out(self) -> None:
        if 1.0 / float(self._weight @ self._weight) < self._count / 2:
            self._count = max(self._least, self._count // 2)
            self._state = self._walk.resampled(self._state, self._weight, self._count)
            self._even()

    def _renew(self) -> None:
        half = self._count // 2
        kept = self._walk.resampled(self._state, self._weight, self._count - half)
        self._state = kept.joined(self._walk.fresh(half))
        self._surprise = 0.0
        self._even()
