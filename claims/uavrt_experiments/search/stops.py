"""Stop rules of the published searches."""

from dataclasses import dataclass

import numpy as np

from uavrt.planning.beliefs import TagBelief
from uavrt.planning.stopping import Verdict


@dataclass(frozen=True, slots=True, kw_only=True)
class DeterminantStop:
    """Stop rule of TrackerBots and ConservationBots: the determinant of the covariance."""

    limit_m4: float = 1e4

    def verdict(self, belief: TagBelief) -> Verdict:
        """Decide that a tag is found if the covariance's determinant is below the limit."""
        got = belief.spread().determinant_m4
        return Verdict(
            found=got < self.limit_m4, reason=f"det {got:.3g} m⁴ of {self.limit_m4:.3g}"
        )

    def needed_nats(self, belief: TagBelief) -> float:
        """Information still needed [nats]: half the logarithm of the factor by which the
        determinant is too large.
        """
        ratio = belief.spread().determinant_m4 / self.limit_m4
        return float(max(0.3, 0.5 * np.log(max(ratio, 1e-9))))


@dataclass(frozen=True, slots=True, kw_only=True)
class LongestAxisStop:
    """LAVAPilot's stop rule: the standard deviation along the longer axis."""

    limit_m: float = 15.0

    def verdict(self, belief: TagBelief) -> Verdict:
        """Decide that a tag is found if its longer axis is below the limit."""
        got = belief.spread().major_sigma_m
        return Verdict(found=got < self.limit_m, reason=f"{got:.0f} m of {self.limit_m:.0f}")

    def needed_nats(self, belief: TagBelief) -> float:
        """Information still needed [nats]: twice the logarithm of the factor by which the axis
        is too long.
        """
        return float(max(0.3, 2.0 * np.log(belief.spread().major_sigma_m / self.limit_m)))
