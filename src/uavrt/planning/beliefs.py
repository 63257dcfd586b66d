"""Probabilities of each tag's position and existence during a search.

A tracker of `uavrt.localization` estimates the tag's position on the assumption that the tag is
in the area. This module adds the probability that the tag is in the area at all, and checks
whether the received pulses agree with such a tag.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.core.errors import ConfigError
from uavrt.core.runtime.lean_scipy import special
from uavrt.localization.position.levels.level_belief import Listening, false_pulse_density
from uavrt.localization.position.trackers import (
    Expectation,
    Hypotheses,
    ParticleTracker,
    Spread,
    TagPrior,
    TrackEstimate,
)

_Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True, kw_only=True)
class _ExistenceRules:
    """Constants of the model check, and of an interferer received in place of the tag."""

    memory: float = 0.95
    """Factor by which the weight of earlier pulses in the model check is multiplied at each new
    pulse."""
    largest_sigmas: float = 4.0
    """Limit of one pulse's level deviation in the model check [standard deviations]."""
    failing_sigmas: float = 3.3
    """Mean level deviation from which the model check fails [standard deviations]; it fails by
    chance once in 1000."""
    rival_sigma_db: float = 12.0
    """Prior standard deviation of the level of a stationary interferer [dB]."""
    rival_particles: int = 2000
    rival_share: float = 0.1
    """Prior probability that the signal of a stationary interferer is received as the tag's."""
    rival_nats: float = 7.0
    """Largest log odds of an interferer as the source of the received pulses [nats]."""
    tag_nats: float = 25.0
    """Upper limit of the evidence that a tag exists [nats], with which the probability can
    still fall when pulses stop."""
    known_share: float = 0.5
    """Largest position spread at which an interferer counts as located, as a share of the
    search area's spread."""


_RULES = _ExistenceRules()


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelCheck:
    """Measures of how well recent pulses agree with a tag at its estimated position."""

    bias_sigmas: float
    """Mean level deviation from the model [standard deviations of this mean]."""
    scatter: float
    """Ratio of the mean square level deviation to the expected one; 1 if the model holds."""
    pulses: float
    """Effective number of recent pulses in the check, after weighting."""

    @property
    def passed(self) -> bool:
        """True if the mean and the scatter of the pulses' levels are as the model predicts."""
        if self.pulses < 1.0:
            return False
        room = _RULES.failing_sigmas * np.sqrt(2.0 / self.pulses)
        return abs(self.bias_sigmas) <= _RULES.failing_sigmas and self.scatter <= 1.0 + room

    def __str__(self) -> str:
        return f"bias {self.bias_sigmas:+.1f} σ, scatter × {self.scatter:.1f}"


def _deviation(level_db: float, threshold_db: float, expected: Expectation) -> float:
    """Return a received pulse's level deviation [standard deviations], corrected for the
    detection threshold.

    Far from a tag only its strongest pulses reach the threshold. So the deviation is the normal
    deviate with the same probability as the pulse's level, given that it exceeded the
    threshold.
    """
    sigma = np.sqrt(expected.variance_db2)
    above, heard = (
        special.log_ndtr((expected.level_db - one) / sigma) for one in (level_db, threshold_db)
    )
    most = _RULES.largest_sigmas
    return float(np.clip(-special.ndtri_exp(min(above - heard, -1e-12)), -most, most))


class Interferer:
    """Stationary interferer whose signal may be received as the tag's, with its position and
    probability of existence.

    Its tracker weights each pulse by the probability that it came from the interferer and not
    from the tag.
    """

    def __init__(self, prior: TagPrior, rng: Generator) -> None:
        own = replace(
            prior,
            level_sigma_db=_RULES.rival_sigma_db,
            motion=(1.0, 0.0, 0.0),
            level_drift_db_per_root_s=0.0,
            reflects=False,
        )
        self._missed = prior.missed_share
        self._chance = prior.chance_share
        self.tracker = ParticleTracker(own, rng, particles=_RULES.rival_particles)
        share = _RULES.rival_share
        self._log_odds = self._least = float(np.log(share / (1.0 - share)))
        self._density = 0.0

    @classmethod
    def of(cls, prior: TagPrior, rng: Generator) -> "Interferer | None":
        """Model of a tag's possible interferer; None if the prior excludes one (`missed_share`
        0).
        """
        return cls(prior, rng) if prior.missed_share > 0.0 else None

    @property
    def probability(self) -> float:
        """Probability that the interferer exists."""
        return float(1.0 / (1.0 + np.exp(-self._log_odds)))

    def density(self, heard: Listening) -> float:
        """Probability density of a pulse's level if the interferer sent it [1/dB]."""
        self._density = self.tracker.density(heard)
        return self._density

    def heard(self, heard: Listening, log_probability: float) -> None:
        """Update position and probability of the interferer with a received pulse;
        `log_probability` is that of the pulse under all sources.
        """
        others = self._missed * self.probability * self._density
        chance = self._chance * false_pulse_density(heard)
        tags = max(float(np.exp(log_probability)) - others, chance)
        self._add(np.log((tags + self._missed * self._density) / tags))
        self.tracker.listen(heard, elsewhere=max(tags / self._missed - chance, 0.0))

    def missed(self, heard: Listening) -> None:
        """Update position and probability of the interferer after a missed pulse."""
        self._add(self.tracker.listen(heard).log_probability)

    def _add(self, nats: float) -> None:
        self._log_odds = float(np.clip(self._log_odds + nats, self._least, _RULES.rival_nats))


class TagBelief:
    """Probability distribution of one tag's position, and probability that the tag exists.

    `particles` is the number of position hypotheses. `existence` is the prior probability that
    the tag is in the area and transmits.
    """

    def __init__(
        self,
        tag_id: int,
        prior: TagPrior,
        rng: Generator,
        *,
        particles: int = 10_000,
        existence: float = 0.9,
    ) -> None:
        if not 0.0 < existence < 1.0:
            raise ConfigError(
                f"the probability that tag {tag_id} exists is out of range: {existence}",
                remedy="Give a probability above 0 and below 1",
            )
        self.tag_id = tag_id
        self._tracker = ParticleTracker(prior, rng, particles=particles)
        self._rival = Interferer.of(prior, rng)
        self._prior_odds = np.log(existence / (1.0 - existence))
        self._log_bayes_factor = 0.0
        self._sums = np.zeros(4)

    @property
    def prior(self) -> TagPrior:
        """Signal strength, motion and detection threshold assumed before the flight."""
        return self._tracker.prior

    @property
    def tracker(self) -> ParticleTracker:
        """Particle tracker of the tag's position, which assumes that the tag is in the area."""
        return self._tracker

    @property
    def log_bayes_factor(self) -> float:
        """Log Bayes factor of all pulses so far for "the tag is there" against "it is not"."""
        return float(self._log_bayes_factor)

    @property
    def existence_probability(self) -> float:
        """Probability that the tag is in the area and transmits."""
        return float(1.0 / (1.0 + np.exp(-self._prior_odds - self._log_bayes_factor)))

    def advance_to(self, time_s: float) -> None:
        """Advance the model of the animal's motion (rest, browse or travel) to a time."""
        self._tracker.advance_to(time_s)
        if self._rival is not None:
            self._rival.tracker.advance_to(time_s)

    def listen(self, heard: Listening) -> Expectation:
        """Update position and existence of the tag with a received or a missed pulse; return
        the level that was expected.
        """
        rival, chance = self._rival, self.prior.chance_share
        if heard.snr_db is None:
            expected = self._tracker.listen(heard)
            # That nothing came by chance either is as probable with a tag as without one.
            absent = 0.0
            if rival is not None:
                rival.missed(heard)
        else:
            others = 0.0 if rival is None else rival.density(heard)
            part = 0.0 if rival is None else self.prior.missed_share * rival.probability
            expected = self._tracker.listen(heard, elsewhere=part * others)
            by_chance = max(chance, 1e-6) * false_pulse_density(heard)
            # Were there no tag, what is heard would be a rival.
            absent = float(np.log(by_chance + others))
            if rival is not None:
                rival.heard(heard, expected.log_probability)
        gained = self._log_bayes_factor + expected.log_probability - absent
        self._log_bayes_factor = min(gained, _RULES.tag_nats)
        self._check(heard, expected, absent)
        return expected

    def _check(self, heard: Listening, expected: Expectation, absent: float) -> None:
        """Record how far a received pulse's level deviates from the model; pulses that may be
        false alarms get less weight.
        """
        if heard.snr_db is None:
            return
        off = _deviation(heard.snr_db, heard.threshold_db, expected)
        own = 1.0 - min(1.0, float(np.exp(absent - expected.log_probability)))
        fade = np.array([_RULES.memory, _RULES.memory**2, _RULES.memory, _RULES.memory])
        self._sums = self._sums * fade + own * np.array([1.0, own, off, off * off])

    def model_check(self) -> ModelCheck:
        """Compare recent pulses' levels with those expected from the estimated position."""
        weight, squares, off, off2 = (float(one) for one in self._sums)
        if weight < 1.0:
            return ModelCheck(bias_sigmas=0.0, scatter=0.0, pulses=0.0)
        count = weight * weight / squares
        return ModelCheck(
            bias_sigmas=off / weight * np.sqrt(count), scatter=off2 / weight, pulses=count
        )

    def doubt(self) -> str | None:
        """Reason to suspect that an interferer sent the tag's pulses; None if there is none.

        An interferer that is more likely than not must be located, away from the tag. Until
        then, the tag's position may be based on the interferer's pulses.
        """
        rival = self._rival
        if rival is None or rival.probability < 0.5:
            return None
        area, place, own = self.prior.area, rival.tracker.spread(), self.spread()
        width = np.hypot(area.east_m - area.west_m, area.north_m - area.south_m) / np.sqrt(12.0)
        if place.rms_m > _RULES.known_share * width:
            return f"an interferer is likely (p {rival.probability:.2f}), its position unknown"
        apart = np.hypot(place.east_m - own.east_m, place.north_m - own.north_m)
        if apart < place.rms_m + 2.0 * own.rms_m:
            return f"an interferer is likely (p {rival.probability:.2f}), {apart:.0f} m away"
        return None

    def estimate(self) -> TrackEstimate:
        """Estimated position of the tag, on the assumption that it is in the area."""
        return self._tracker.estimate()

    def spread(self) -> Spread:
        """Mean and covariance of the tag's position."""
        return self._tracker.spread()

    def hypotheses(self, count: int) -> Hypotheses:
        """Draw equally probable hypotheses of the tag's state from its tracker."""
        return self._tracker.hypotheses(count)


class Beliefs(Mapping[int, TagBelief]):
    """Position and existence of several tags whose pulses differ in frequency, by tag id.

    Raises `ConfigError` without tags and for repeated ids.
    """

    def __init__(self, *beliefs: TagBelief) -> None:
        self._by_id = {one.tag_id: one for one in beliefs}
        if not beliefs or len(self._by_id) < len(beliefs):
            raise ConfigError(
                "a search needs tags, each with a unique number",
                remedy="List them in the tag file",
            )

    def __getitem__(self, tag_id: int) -> TagBelief:
        return self._by_id[tag_id]

    def __iter__(self) -> Iterator[int]:
        return iter(self._by_id)

    def __len__(self) -> int:
        return len(self._by_id)

    def advance_to(self, time_s: float) -> None:
        """Advance the motion models of all animals to a time."""
        for one in self._by_id.values():
            one.advance_to(time_s)
