"""Rules that decide when a tag counts as found."""

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from uavrt.core.errors import ConfigError
from uavrt.planning.beliefs import TagBelief


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """Decision whether a tag counts as found, with the reason."""

    found: bool
    reason: str


class StopRule(Protocol):
    """Interface of a rule that decides whether a tag counts as found."""

    def verdict(self, belief: TagBelief) -> Verdict:
        """Decide whether a tag counts as found; return the decision with its reason."""

    def needed_nats(self, belief: TagBelief) -> float:
        """Approximate position information missing until the tag is found [nats]."""


@dataclass(frozen=True, slots=True, kw_only=True)
class AccuracyStop:
    """Rule by which a tag is found if its 95 % circle is small enough, it very probably exists,
    and its pulses fit the model.
    """

    radius95_m: float = 25.0
    bayes_factor: float = 100.0

    def __post_init__(self) -> None:
        if self.radius95_m <= 0.0 or self.bayes_factor < 1.0:
            raise ConfigError(
                f"the accuracy of {self.radius95_m:g} m or the Bayes factor of "
                f"{self.bayes_factor:g} is out of range",
                remedy="Give an accuracy above 0 and a Bayes factor of 1 or more",
            )

    def verdict(self, belief: TagBelief) -> Verdict:
        """Decide whether a tag is found; the cheapest checks come first."""
        rms = belief.spread().rms_m
        # The 95 % radius is 1.7 times the rms of a round cloud of hypotheses, and twice that of
        # a long one, so a cloud whose rms exceeds the target is rejected without its circle.
        if rms > self.radius95_m:
            return Verdict(
                found=False, reason=f"the position is still uncertain by {rms:.0f} m"
            )
        if belief.log_bayes_factor < np.log(self.bayes_factor):
            return Verdict(found=False, reason="the tag may be absent")
        check = belief.model_check()
        if not check.passed:
            return Verdict(
                found=False, reason=f"the pulses do not fit the estimated position ({check})"
            )
        doubt = belief.doubt()
        if doubt is not None:
            return Verdict(found=False, reason=doubt)
        radius = belief.estimate().radius95_m
        if radius > self.radius95_m:
            return Verdict(found=False, reason=f"95 % within {radius:.0f} m")
        return Verdict(
            found=True, reason=f"95 % within {radius:.0f} m of {self.radius95_m:.0f} m; {check}"
        )

    def needed_nats(self, belief: TagBelief) -> float:
        """Missing position information [nats]: 1.4 per halving of the 95 % radius, at least
        0.3.
        """
        ratio = 1.75 * belief.spread().rms_m / self.radius95_m
        return float(max(0.3, 2.0 * np.log(ratio)))
