"""Compute log-likelihood ratios for a track: pulses of a tag against bursts that fit by chance.

Bursts can begin many tracks; in each, a burst must by chance lie at every expected pulse. The
product of the likelihood ratios exceeds A with a probability of at most 1/A (Ville's
inequality; J. Ville, Étude critique de la notion de collectif, 1939). The bound A is therefore
the number of expected tracks divided by the number of false tracks allowed.
"""

import math
from dataclasses import dataclass

from uavrt.detection.track.tuning import CHANCE


@dataclass(frozen=True, slots=True, kw_only=True)
class BurstRates:
    """Rates of other transmitters' bursts around an expected pulse [1/s]."""

    alike_per_s: float
    """Rate of bursts of similar power to a detection, at the track's frequency [1/s]."""
    hiding_per_s: float
    """Rate of bursts of at least half a detection's power, at the track's frequency [1/s]."""
    begin_per_s: float
    """Rate of bursts of similar power in the whole band [1/s]; each may begin a false group."""


QUIET = BurstRates(alike_per_s=0.0, hiding_per_s=0.0, begin_per_s=0.0)


def log_begin(per_s: float) -> float:
    """Log odds that a track of one pulse is a tag's.

    `per_s`: rate of other transmitters' bursts, each of which may begin a track [1/s].
    """
    return math.log(
        CHANCE.confirmed_falsely / (CHANCE.period_s * max(per_s, 10.0 * CHANCE.quiet_per_s))
    )


def log_doubt(allowed: float, decision_s: float) -> float:
    """Log odds below which chance bursts make more tracks than `allowed` in `decision_s`."""
    return -math.log(
        max(1.0, allowed * CHANCE.period_s / (CHANCE.confirmed_falsely * decision_s))
    )


def log_odds(
    rates: BurstRates,
    *,
    width_s: float,
    late_s: float,
    spread_s: float,
    beside_hz: float,
    above_db: float,
) -> float:
    """Log-likelihood ratio of a detection at an expected time: pulse of the tag to burst.

    `late_s`, `beside_hz`, `above_db`: deviations of the detection from the expected pulse.
    `spread_s`: standard deviation of the pulse's time.
    """
    seen = _seen(rates, width_s)
    likely = math.exp(
        -0.5
        * (
            (late_s / spread_s) ** 2
            + (beside_hz / CHANCE.frequency_hz) ** 2
            + (above_db / CHANCE.power_db) ** 2
        )
    ) / (math.sqrt(2.0 * math.pi) * spread_s)
    return math.log(1.0 - seen + seen * likely / max(rates.alike_per_s, CHANCE.quiet_per_s))


def log_empty(rates: BurstRates, *, width_s: float) -> float:
    """Log-likelihood ratio of a tag to chance bursts, where no pulse was received."""
    return math.log(1.0 - _seen(rates, width_s))


def _seen(rates: BurstRates, width_s: float) -> float:
    return CHANCE.received_share * math.exp(
        -CHANCE.hidden_widths * width_s * rates.hiding_per_s
    )
