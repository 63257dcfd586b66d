"""What is believed of each tag while it is searched for.

A tracker of `uavrt.localization` says where the tag is if it is there. Here is added whether it
is there at all, and whether what comes is what such a tag would give.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.errors import ConfigError
from uavrt.lean_scipy import special
from uavrt.localization.position.level_belief import Listening, by_chance_density
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
    """Constants of the check of the model, and of an interferer that rivals a tag."""

    memory: float = 0.95
    """Weight of a pulse in the check of the model when the next one comes: twenty pulses."""
    largest_sigmas: float = 4.0
    """Largest deviation with which one pulse counts [standard deviations]."""
    failing_sigmas: float = 3.3
    """Deviation at which the check fails [standard deviations]: once in a thousand."""
    rival_sigma_db: float = 12.0
    """Uncertainty of the level of an interferer [dB]."""
    rival_particles: int = 2000
    rival_share: float = 0.1
    """Probability, before the flight, that a stationary interferer is received as the tag."""
    rival_nats: float = 7.0
    """Largest log odds of the interferer."""
    tag_nats: float = 25.0
    """Largest evidence that a tag is there: a tag that falls silent is to be doubted."""
    known_share: float = 0.5
    """Share of its area's width: an interferer whose place is known better is not the tag."""


_RULES = _ExistenceRules()


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelCheck:
    """Whether the pulses of late are as a tag at the believed place would give them."""

    bias_sigmas: float
    """How far their mean is off, in its own standard deviations."""
    scatter: float
    """Mean square over what is expected; 1 is right."""
    pulses: float
    """That count, older ones less."""

    @property
    def passed(self) -> bool:
        """Whether both are as they should be."""
        if self.pulses < 1.0:
            return False
        room = _RULES.failing_sigmas * np.sqrt(2.0 / self.pulses)
        return abs(self.bias_sigmas) <= _RULES.failing_sigmas and self.scatter <= 1.0 + room

    def __str__(self) -> str:
        return f"bias {self.bias_sigmas:+.1f} σ, scatter × {self.scatter:.1f}"


def _deviation(level_db: float, threshold_db: float, expected: Expectation) -> float:
    """How far a pulse is off, in standard deviations of those that are heard.

    Far from a tag only the strongest of its pulses reach the threshold: among these a pulse is
    as far off as a normal deviate that as many exceed.
    """
    sigma = np.sqrt(expected.variance_db2)
    above, heard = (
        special.log_ndtr((expected.level_db - one) / sigma) for one in (level_db, threshold_db)
    )
    most = _RULES.largest_sigmas
    return float(np.clip(-special.ndtri_exp(min(above - heard, -1e-12)), -most, most))


class Rival:
    """Something that stays where it is and is heard as the tag is: an interferer.

    A tracker of its own, to which every pulse belongs as far as it explains it better than the
    tag does, and the probability that there is one at all.
    """

    def __init__(self, prior: TagPrior, rng: Generator) -> None:
        own = replace(
            prior,
            level_sigma_db=_RULES.rival_sigma_db,
            motion=(1.0, 0.0, 0.0),
            level_drift_db_per_root_s=0.0,
        )
        self._missed = prior.missed_share
        self._chance = prior.chance_share
        self.tracker = ParticleTracker(own, rng, particles=_RULES.rival_particles)
        share = _RULES.rival_share
        self._log_odds = self._least = float(np.log(share / (1.0 - share)))
        self._density = 0.0

    @classmethod
    def of(cls, prior: TagPrior, rng: Generator) -> "Rival | None":
        """For a tag that may have one: another is heard only when the tag itself is missed."""
        return cls(prior, rng) if prior.missed_share > 0.0 else None

    @property
    def probability(self) -> float:
        """That there is one."""
        return float(1.0 / (1.0 + np.exp(-self._log_odds)))

    def density(self, heard: Listening) -> float:
        """Probability density [1/dB] that it gives this pulse."""
        self._density = self.tracker.density(heard)
        return self._density

    def heard(self, heard: Listening, log_probability: float) -> None:
        """Take a pulse, with its density by the tag and by all other sources."""
        others = self._missed * self.probability * self._density
        chance = self._chance * by_chance_density(heard)
        tags = max(float(np.exp(log_probability)) - others, chance)
        self._add(np.log((tags + self._missed * self._density) / tags))
        self.tracker.listen(heard, elsewhere=max(tags / self._missed - chance, 0.0))

    def missed(self, heard: Listening) -> None:
        """Take in that nothing was heard."""
        self._add(self.tracker.listen(heard).log_probability)

    def _add(self, nats: float) -> None:
        self._log_odds = float(np.clip(self._log_odds + nats, self._least, _RULES.rival_nats))


class TagBelief:
    """Everything believed of one tag.

    `particles`: hypotheses of the place.
    `existence`: probability, before the flight, that the tag is in the area and beeps.
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
                f"tag {tag_id} exists with a probability of {existence}",
                remedy="Give one above 0 and below 1",
            )
        self.tag_id = tag_id
        self._tracker = ParticleTracker(prior, rng, particles=particles)
        self._rival = Rival.of(prior, rng)
        self._prior_odds = np.log(existence / (1.0 - existence))
        self._log_bayes_factor = 0.0
        self._sums = np.zeros(4)

    @property
    def prior(self) -> TagPrior:
        """The prior, before the flight."""
        return self._tracker.prior

    @property
    def tracker(self) -> ParticleTracker:
        """The hypotheses of the place."""
        return self._tracker

    @property
    def log_bayes_factor(self) -> float:
        """Of all evidence so far, for "it is there" against "there is none"."""
        return float(self._log_bayes_factor)

    @property
    def existence_probability(self) -> float:
        """That the tag is in the area and beeps."""
        return float(1.0 / (1.0 + np.exp(-self._prior_odds - self._log_bayes_factor)))

    def advance_to(self, time_s: float) -> None:
        """Let the animal rest, browse or travel until then."""
        self._tracker.advance_to(time_s)
        if self._rival is not None:
            self._rival.tracker.advance_to(time_s)

    def listen(self, heard: Listening) -> Expectation:
        """Update with a pulse, or that none was heard: both are evidence."""
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
            by_chance = max(chance, 1e-6) * by_chance_density(heard)
            # Were there no tag, what is heard would be a rival.
            absent = float(np.log(by_chance + others))
            if rival is not None:
                rival.heard(heard, expected.log_probability)
        gained = self._log_bayes_factor + expected.log_probability - absent
        self._log_bayes_factor = min(gained, _RULES.tag_nats)
        self._check(heard, expected, absent)
        return expected

    def _check(self, heard: Listening, expected: Expectation, absent: float) -> None:
        """Note how far a pulse is from what was expected, false ones counting less."""
        if heard.snr_db is None:
            return
        off = _deviation(heard.snr_db, heard.threshold_db, expected)
        own = 1.0 - min(1.0, float(np.exp(absent - expected.log_probability)))
        fade = np.array([_RULES.memory, _RULES.memory**2, _RULES.memory, _RULES.memory])
        self._sums = self._sums * fade + own * np.array([1.0, own, off, off * off])

    def model_check(self) -> ModelCheck:
        """Compare the pulses of late with what was expected of them."""
        weight, squares, off, off2 = (float(one) for one in self._sums)
        if weight < 1.0:
            return ModelCheck(bias_sigmas=0.0, scatter=0.0, pulses=0.0)
        count = weight * weight / squares
        return ModelCheck(
            bias_sigmas=off / weight * np.sqrt(count), scatter=off2 / weight, pulses=count
        )

    def doubt(self) -> str | None:
        """Why the pulses may be an interferer's; None where it differs from the tag.

        A probable interferer must be known to be elsewhere: as long as it may be anywhere,
        the place of the tag may have been made from its pulses.
        """
        rival = self._rival
        if rival is None or rival.probability < 0.5:
            return None
        area, place, own = self.prior.area, rival.tracker.spread(), self.spread()
        width = np.hypot(area.east_m - area.west_m, area.north_m - area.south_m) / np.sqrt(12.0)
        if place.rms_m > _RULES.known_share * width:
            return f"something else is heard ({rival.probability:.2f}), none knows where"
        apart = np.hypot(place.east_m - own.east_m, place.north_m - own.north_m)
        if apart < place.rms_m + 2.0 * own.rms_m:
            return f"something else is heard ({rival.probability:.2f}), {apart:.0f} m away"
        return None

    def estimate(self) -> TrackEstimate:
        """Where the tag is if it is there."""
        return self._tracker.estimate()

    def spread(self) -> Spread:
        """How far apart the hypotheses of its place are."""
        return self._tracker.spread()

    def hypotheses(self, count: int) -> Hypotheses:
        """Some hypotheses, evenly from all."""
        return self._tracker.hypotheses(count)


class Beliefs(Mapping[int, TagBelief]):
    """Several tags; they differ in frequency, so each pulse belongs to one.

    Raises `ConfigError`: there is no tag, or a number comes twice.
    """

    def __init__(self, *beliefs: TagBelief) -> None:
        self._by_id = {one.tag_id: one for one in beliefs}
        if not beliefs or len(self._by_id) < len(beliefs):
            raise ConfigError(
                "a search needs tags, each with a number of its own",
                remedy="List them in the tag file",
            )

    def __getitem__(self, tag_id: int) -> TagBelief:
        return self._by_id[tag_id]

    def __iter__(self) -> Iterator[int]:
        return iter(self._by_id)

    def __len__(self) -> int:
        return len(self._by_id)

    def advance_to(self, time_s: float) -> None:
        """Let all animals move until then."""
        for one in self._by_id.values():
            one.advance_to(time_s)
