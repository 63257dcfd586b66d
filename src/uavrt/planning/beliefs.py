"""What is believed of each tag while it is searched for.

A tracker of `uavrt.localization` says where the tag is if it is there. Here is added whether it
is there at all, and whether what comes is what such a tag would give.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from uavrt.errors import ConfigError
from uavrt.localization import (
    Expectation,
    Hypotheses,
    Listening,
    ParticleTracker,
    Spread,
    TagPrior,
    TrackEstimate,
)
from uavrt.localization.level_belief import ANY_STRENGTH

_Floats = NDArray[np.float64]
_FADES = 0.95
"""Weight of a pulse in the check of the model when the next one comes: twenty pulses long."""
_GROSS = 4.0
_LIMIT = 3.3
"""Standard deviations at which the check fails: once in a thousand."""


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
        room = _LIMIT * np.sqrt(2.0 / self.pulses)
        return abs(self.bias_sigmas) <= _LIMIT and self.scatter <= 1.0 + room

    def __str__(self) -> str:
        return f"bias {self.bias_sigmas:+.1f} σ, scatter × {self.scatter:.1f}"


class TagBelief:
    """Everything believed of one tag.

    Parameters
    ----------
    tag_id : int
    prior : TagPrior
        Area, strength, antenna, motion, shares of misses and of false pulses.
    rng : Generator
        Randomness; the same seed gives the same beliefs.
    particles : int
        Hypotheses of the place.
    existence : float
        Probability, before the flight, that the tag is in the area and beeps.
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
        self._prior_odds = np.log(existence / (1.0 - existence))
        self._log_bayes_factor = 0.0
        self._sums = np.zeros(4)

    @property
    def prior(self) -> TagPrior:
        """What was believed before the flight."""
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

    def listen(self, heard: Listening) -> Expectation:
        """Take in a pulse, or that none was heard: both are evidence."""
        expected = self._tracker.listen(heard)
        chance = self.prior.chance_share
        if heard.snr_db is None:
            absent = np.log1p(-min(chance, 0.999))
        else:
            absent = np.log(max(chance, 1e-6) * ANY_STRENGTH)
        self._log_bayes_factor += expected.log_probability - absent
        self._check(heard, expected, float(absent))
        return expected

    def take_bearing(self, east_m: float, north_m: float, posterior: _Floats) -> None:
        """Take in a rotation's whole (360,) posterior; its pulses must not be listened to."""
        evidence = self._tracker.take_bearing(east_m, north_m, posterior)
        self._log_bayes_factor += evidence - np.log(1.0 / 360.0)

    def _check(self, heard: Listening, expected: Expectation, absent: float) -> None:
        """Note how far a pulse is from what was expected, false ones counting less."""
        if heard.snr_db is None:
            return
        off = (heard.snr_db - expected.level_db) / np.sqrt(expected.variance_db2)
        off = float(np.clip(off, -_GROSS, _GROSS))
        own = 1.0 - min(1.0, float(np.exp(absent - expected.log_probability)))
        fade = np.array([_FADES, _FADES**2, _FADES, _FADES])
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

    Parameters
    ----------
    beliefs : sequence of TagBelief

    Raises
    ------
    ConfigError
        There is no tag, or a number comes twice.
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
